"""The camera's check, with the shipped driver on cameras behind a kernel that is played."""

import errno
import itertools
import re
from collections import Counter
from collections.abc import Callable
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest

from drivers.camera import v4l2_ioctl as v4l2
from drivers.camera.libcamera import LibcameraCamera
from drivers.camera.v4l2 import V4l2Camera
from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.samples import Frame
from hil_mocks.libcamera_device import World, command
from hil_mocks.v4l2_device import MockCamera, MockControl, MockKernel
from hil_mocks.virtual_clock import VirtualClock
from lcf_edge.config import Camera, Config
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.doctor import camera
from lcf_edge.doctor.daemon import Daemon
from lcf_edge.doctor.finding import Context, Finding, Severity
from lcf_edge.doctor.measuring import Measured

PATH = "/dev/video0"
WANTED = Camera(fps=30.0)

Machine = Callable[..., Context]
Grey = np.ndarray[Any, np.dtype[np.uint8]]


@cache
def drawn(width: int, height: int) -> Grey:
    """Patches of grey that meet in good corners."""
    grey = np.random.default_rng(1).integers(40, 161, (height // 12 + 1, width // 12 + 1), np.uint8)
    sharp = np.kron(grey, np.ones((12, 12), np.uint8))[:height, :width]
    return np.asarray(cv2.GaussianBlur(sharp, (3, 3), 0), np.uint8)


def plain(grey: int) -> Callable[[int, int, int], Grey]:
    return lambda _, width, height: np.full((height, width), grey, np.uint8)


@pytest.fixture
def webcam() -> MockCamera:
    return MockCamera(images=lambda _, width, height: drawn(width, height))


@pytest.fixture
def look(machine: Machine, clock: VirtualClock, webcam: MockCamera) -> Callable[..., list[Finding]]:
    """What is found with the webcam at ``PATH``; other cameras by path, None: the webcam is not plugged in."""

    def find(wanted: Camera = WANTED, **cameras: MockCamera | None) -> list[Finding]:
        kernel = MockKernel(clock)
        for path, one in {"video0": webcam, **cameras}.items():
            if one is not None:
                kernel.plug(f"/dev/{path}", one)

        def opened(config: Config, clock: Clock) -> V4l2Camera:
            asked = config.camera
            settings = {"width": asked.width, "height": asked.height, "fps": asked.fps, "exposure_s": asked.exposure_s}
            return V4l2Camera(asked.device, pixel_format=asked.format, clock=clock, kernel=kernel, **settings)  # type: ignore[arg-type]

        found = list(camera.check(machine(Config(camera=wanted), kernel=kernel, open_camera=opened)))
        assert kernel.open_files == 0
        return found

    return find


Look = Callable[..., list[Finding]]


def one(findings: list[Finding], level: Severity) -> Finding:
    """The only one that bad, and none is worse."""
    (found,) = [finding for finding in findings if finding.level is not Severity.OK]
    assert found.level is level, found
    return found


def test_a_good_camera_is_reported_with_its_figures(look: Look) -> None:
    name, rate, light = look()
    assert {finding.level for finding in (name, rate, light)} == {Severity.OK}
    assert name.text == "/dev/video0: Mock Webcam"
    assert rate.text.startswith("30.0/s, jitter 0.0 ms, longest gap 33 ms, exposure 25.0 ms")
    assert "mean grey level 100 of 255" in light.text


def test_a_missing_camera_names_those_that_are_there(look: Look) -> None:
    found = one(look(video0=None, video2=MockCamera(card="HD Webcam")), Severity.FAIL)
    assert found.text == "/dev/video0: no such camera; there is /dev/video2 (HD Webcam)"
    assert found.remedy.startswith("lcf-edge doctor --set camera.device=/dev/video2 ")


def test_no_camera_at_all_asks_what_usb_sees(look: Look) -> None:
    found = one(look(video0=None), Severity.FAIL)
    assert "ribbon cable" in found.text
    assert found.remedy.startswith("lsusb")


class TestThroughLibcamera:
    """A camera at a ribbon cable, with the shipped driver on a libcamera that is played."""

    @pytest.fixture
    def look(self, machine: Machine, clock: VirtualClock) -> Callable[..., list[Finding]]:
        def find(world: World, driver: str = "auto") -> list[Finding]:
            kernel = MockKernel(clock)
            kernel.plug(PATH, MockCamera(card="rp1-cfe", caps=v4l2.CAP_VIDEO_CAPTURE | 0x2000_0000))  # V4L2_CAP_IO_MC

            def opened(_config: Config, _clock: Clock) -> LibcameraCamera:
                return LibcameraCamera("imx219", width=64, height=48, fps=30.0, command=command(world))

            wanted = Config(camera=Camera(driver=driver, fps=30.0))  # type: ignore[arg-type]
            context = machine(wanted, kernel=kernel, open_camera=opened, clock=SYSTEM_CLOCK)
            return list(camera.check(context))

        return find

    def test_it_is_reported_with_its_figures(self, look: Look) -> None:
        name, rate, _ = look(World())
        assert (name.level, name.text) == (Severity.OK, "/dev/video0: through libcamera")
        assert re.match(r"(29|30)\.\d/s", rate.text)

    @pytest.mark.parametrize("driver", ["auto", "libcamera"])
    @pytest.mark.parametrize(
        ("world", "text", "remedy"),
        [
            (World(installed=False), "has no libcamera", "sudo apt install python3-libcamera"),
            (World(busy=True), "in use by another program", "sudo fuser -v /dev/media*"),
            (World(names=()), "libcamera finds no camera", ""),
        ],
        ids=["not installed", "busy", "no camera"],
    )
    def test_what_is_wrong_is_one_line(self, look: Look, driver: str, world: World, text: str, remedy: str) -> None:
        found = one(look(world, driver), Severity.FAIL)
        assert text in found.text
        assert found.remedy.startswith(remedy)

    def test_the_other_driver_points_there(self, look: Look) -> None:
        assert 'set camera.driver = "libcamera"' in one(look(World(), "v4l2"), Severity.FAIL).text


def test_without_permission_the_group_is_named(look: Look, webcam: MockCamera) -> None:
    webcam.open_error = errno.EACCES
    found = one(look(), Severity.FAIL)
    assert found.text.startswith("/dev/video0: this user may not open it")
    assert found.remedy.startswith("sudo usermod -aG video $USER")


def test_a_node_without_images_is_reported(look: Look) -> None:
    found = one(look(video0=MockCamera(caps=v4l2.CAP_STREAMING), video1=MockCamera()), Severity.FAIL)
    assert "gives no images" in found.text
    assert "camera.device=/dev/video1" in found.remedy


def test_a_camera_in_use_names_the_program(look: Look, webcam: MockCamera, process: Callable[..., None]) -> None:
    process(4711, "/usr/bin/cheese", opened=("/dev/null", PATH))
    webcam.format_error = errno.EBUSY
    found = one(look(), Severity.FAIL)
    assert found.text == "/dev/video0: in use by cheese, process 4711"
    assert found.remedy == "kill 4711"


def test_a_program_that_may_not_be_known_is_asked_for(look: Look, webcam: MockCamera) -> None:
    webcam.format_error = errno.EBUSY
    assert one(look(), Severity.FAIL).remedy == "sudo fuser -v /dev/video0"


def test_what_only_looks_at_the_camera_is_no_trouble(look: Look, process: Callable[..., None]) -> None:
    process(4711, "/usr/bin/wireplumber", opened=(PATH,))
    assert all(finding.level is Severity.OK for finding in look())


@pytest.mark.parametrize(
    ("wanted", "remedy"),
    [
        (Camera(), "--set camera.fps=15 "),  # the default rate of 20 is not on offer
        (Camera(width=640, height=400, fps=30.0), "--set camera.height=480 "),
        (Camera(width=1280, height=720, fps=30.0, format="YUYV"), "--set camera.format=auto "),
    ],
)
def test_what_is_not_offered_comes_with_the_nearest_that_is(look: Look, wanted: Camera, remedy: str) -> None:
    found = one(look(wanted), Severity.FAIL)
    assert "offered: " in found.text
    assert found.remedy.startswith(f"lcf-edge doctor {remedy}")


def test_the_remedy_of_a_refused_mode_works(look: Look) -> None:
    refused = one(look(Camera()), Severity.FAIL)
    fps = float(refused.remedy.partition("camera.fps=")[2].split()[0])
    assert all(finding.level is Severity.OK for finding in look(Camera(fps=fps)))


def test_a_silent_camera_fails(look: Look, webcam: MockCamera) -> None:
    webcam.stalled = True
    found = one(look(), Severity.FAIL)
    assert "no usable image" in found.text
    assert "dmesg" in found.remedy


def test_images_that_are_lost_slow_it_down(look: Look, webcam: MockCamera) -> None:
    whole = itertools.cycle((True, False))
    webcam.spoil = lambda data: data if next(whole) else data[:9]
    found = one(look(), Severity.WARN)
    assert found.text.startswith("15.0/s")
    assert "slower than camera.fps = 30" in found.text
    assert "; short " in found.text
    assert "camera.exposure_s=0.0167" in found.remedy


@pytest.mark.parametrize(
    ("stamps_s", "text"),
    [([5.0], "only one came: slower than camera.fps = 30"), ([5.0, 6.6], "0.6/s, longest gap 1600 ms: slower than")],
)
def test_a_camera_too_slow_for_figures_has_none(machine: Machine, stamps_s: list[float], text: str) -> None:
    images = [Frame(round(stamp_s * 1e9), seq, drawn(64, 48)) for seq, stamp_s in enumerate(stamps_s)]
    rate, _ = camera.judged(machine(Config(camera=WANTED)), Measured("camera", images, Counter()))
    assert rate.text.startswith(text)


def test_an_exposure_longer_than_the_frame_is_why_it_is_slow(look: Look, webcam: MockCamera) -> None:
    webcam.controls[v4l2.CID_EXPOSURE_ABSOLUTE] = MockControl(500, 3, 2047)
    assert all(finding.level is Severity.OK for finding in look())  # it cannot be: the rate is kept
    whole = itertools.cycle((True, False))
    webcam.spoil = lambda data: data if next(whole) else data[:9]
    found = one(look(), Severity.WARN)
    assert found.text.endswith("slower than camera.fps = 30, its exposure of 50.0 ms is longer than a frame")
    assert "--set camera.exposure_s=0.0167" in found.remedy


def test_a_camera_that_reports_no_exposure_is_good(look: Look, webcam: MockCamera) -> None:
    del webcam.controls[v4l2.CID_EXPOSURE_ABSOLUTE]
    assert all(finding.level is Severity.OK and "exposure" not in finding.text for finding in look())


@pytest.mark.parametrize(("grey", "word"), [(8, "dark"), (120, "blind"), (250, "overexposed")])
def test_an_image_without_use_is_reported(look: Look, webcam: MockCamera, grey: int, word: str) -> None:
    webcam.images = plain(grey)
    found = one(look(), Severity.WARN)
    assert found.text.startswith(f"{word}: mean grey level {grey} of 255, 0 corners")


def test_stamps_of_another_clock_are_reported(look: Look, webcam: MockCamera) -> None:
    webcam.stamp_flags = v4l2.FLAG_STAMPED_AT_EXPOSURE
    assert one(look(), Severity.WARN).text.startswith("stamps that cannot be true (stamped at arrival ")


def test_a_camera_that_the_daemon_has_is_not_opened_but_asked_for(
    machine: Machine, clock: VirtualClock, webcam: MockCamera, process: Callable[..., None]
) -> None:
    process(7, "/opt/lcf-edge/bin/python", "/opt/lcf-edge/bin/lcf-edge", "run", opened=(PATH,))
    kernel = MockKernel(clock)
    kernel.plug(PATH, webcam)

    def untouched(config: Config, clock: Clock) -> V4l2Camera:
        raise AssertionError(f"opened {config} {clock}")

    context = machine(Config(camera=WANTED), kernel=kernel, open_camera=untouched)
    _, silent = camera.check(context)
    assert silent.level is Severity.WARN
    assert silent.remedy.startswith("sudo systemctl stop lcf-edge")

    status = DeviceStatus("camera", Level.STALE, "silent since then", {"rate_hz": "29.97"})
    context.__dict__["daemon"] = Daemon("tcp/127.0.0.1:7447", {"camera": status}, "")
    _, found = camera.check(context)
    assert (found.level, found.text) == (Severity.FAIL, "in use by the daemon: silent since then (rate_hz 29.97)")
