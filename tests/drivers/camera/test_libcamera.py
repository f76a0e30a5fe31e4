"""The libcamera driver and its process, with a stand-in for libcamera: images, the sensor's mode, locks, faults."""

import errno
import json
import os
import shlex
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from drivers.camera import libcamera, libcamera_process
from drivers.camera.libcamera import LibcameraCamera, cameras, main, monotonic
from drivers.camera.libcamera_process import Refused, serve, why_none
from drivers.device import KeptOpen
from drivers.errors import (
    DeviceBusyError,
    DeviceLostError,
    DeviceMissingError,
    DeviceStalledError,
    DriverError,
    MissingSoftwareError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from drivers.samples import Frame
from hil_mocks.libcamera_device import MODES, World, command
from hil_mocks.v4l2_device import drawn_image

SIZE = {"width": 160, "height": 120, "fps": 30.0}

OPENING_S = 300.0  # a busy or an emulated computer may need longer to start a program than a vehicle has

Open = Callable[..., LibcameraCamera]


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libcamera, "OPENING_S", OPENING_S)


@pytest.fixture
def open_camera() -> Iterator[Open]:
    opened: list[LibcameraCamera] = []

    def open_one(world: World | None = None, device: str = "imx219", **settings: Any) -> LibcameraCamera:
        opened.append(LibcameraCamera(device, command=command(world or World()), **{**SIZE, **settings}))
        return opened[-1]

    yield open_one
    for camera in opened:
        camera.close()


def take(camera: LibcameraCamera, count: int) -> list[Frame]:
    """The next images."""
    frames: list[Frame] = []
    while len(frames) < count:
        frames += camera.read()
    return frames


def read_until_error(camera: LibcameraCamera) -> DriverError:
    """What reading ends with."""
    with pytest.raises(DriverError) as caught:
        take(camera, sys.maxsize)
    return caught.value


def started(world: World) -> dict[str, Any]:
    """With which mode and controls the camera was started."""
    started_with: dict[str, Any] = json.loads(Path(world.log_path).read_text(encoding="utf-8"))
    return started_with


class TestPictures:
    """A camera without faults."""

    @pytest.mark.parametrize("padding", [0, 32])
    @pytest.mark.parametrize("offered", ["YUV420", "NV12", "YUYV", "UYVY", "R8", "BGR888", "XRGB8888"])
    def test_luminance_arrives_as_the_camera_saw_it(self, open_camera: Open, offered: str, padding: int) -> None:
        camera = open_camera(World(formats=(offered,), padding=padding))
        for frame in take(camera, 3):
            assert np.array_equal(frame.image, drawn_image(frame.seq, 160, 120))

    def test_the_cheapest_format_is_taken(self, open_camera: Open) -> None:
        assert open_camera(World(formats=("BGR888", "YUYV", "YUV420"))).mode.pixel_format == "YU12"
        assert open_camera(World(formats=("BGR888", "YUYV", "YUV420")), pixel_format="YUYV").mode.pixel_format == "YUYV"

    def test_an_image_keeps_its_content_when_its_buffer_is_filled_again(self, open_camera: Open) -> None:
        camera = open_camera()
        first = take(camera, 1)[0]
        kept = first.image.copy()
        take(camera, 6)
        assert np.array_equal(first.image, kept)

    def test_stamps_are_libcameras_on_the_monotonic_clock(self, open_camera: Open) -> None:
        began_ns = time.monotonic_ns()
        camera = open_camera()
        frames = take(camera, 3)
        assert began_ns < frames[0].stamp_ns < frames[1].stamp_ns < frames[2].stamp_ns < time.monotonic_ns()
        assert camera.counts["stamped at arrival"] == 0

    def test_without_a_sensors_stamp_the_buffers_counts(self, open_camera: Open) -> None:
        camera = open_camera(World(stamped=False))
        take(camera, 2)
        assert camera.counts["stamped at arrival"] == 0

    def test_a_stamp_that_cannot_be_is_replaced_and_counted(self, open_camera: Open) -> None:
        camera = open_camera(World(stamp_offset_s=-3600.0))
        before_ns = time.monotonic_ns()
        assert take(camera, 1)[0].stamp_ns > before_ns
        assert camera.counts["stamped at arrival"] == 1

    def test_a_stamp_of_the_clock_that_counts_sleep_becomes_one_of_the_clock_that_does_not(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        slept_ns = 7_200_000_000_000
        clocks = {time.CLOCK_MONOTONIC: 50_000_000_000, time.CLOCK_BOOTTIME: 50_000_000_000 + slept_ns}
        monkeypatch.setattr(time, "clock_gettime_ns", clocks.__getitem__)
        assert monotonic(49_990_000_000, 50_000_000_000) == 49_990_000_000
        assert monotonic(49_990_000_000 + slept_ns, 50_000_000_000) == 49_990_000_000

    def test_the_newest_of_several_wins(self, open_camera: Open) -> None:
        camera = open_camera(fps=10.0)
        first = take(camera, 1)[0]
        while time.monotonic_ns() < first.stamp_ns + 250_000_000:
            os.sched_yield()
        newest = take(camera, 1)[0]
        assert newest.seq >= first.seq + 2
        assert camera.counts["overtaken"] + camera.counts["dropped"] == newest.seq - first.seq - 1

    def test_lost_images_show_as_a_gap(self, open_camera: Open) -> None:
        camera = open_camera(World(skipped=2))
        numbers = [frame.seq for frame in take(camera, 5)]
        assert 2 not in numbers
        assert camera.counts["dropped"] == 1

    def test_an_image_that_is_marked_as_bad_is_refused(self, open_camera: Open) -> None:
        camera = open_camera(World(bad=True))
        while not camera.counts["corrupt"]:  # on a slow computer a newer one may overtake it unseen
            assert not any(frame.seq % 2 for frame in camera.read())

    def test_everything_is_given_back(self, open_camera: Open, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(libcamera, "ENDING_S", 60.0)  # a busy computer may need longer than a vehicle has
        before = len(os.listdir("/proc/self/fd"))  # noqa: PTH208
        camera = open_camera()
        take(camera, 2)
        process = camera._process._process
        camera.close()
        camera.close()
        assert process.returncode == 0
        assert len(os.listdir("/proc/self/fd")) == before  # noqa: PTH208


class TestField:
    """The sensor's mode: the whole field of view, as cheaply as that goes."""

    @pytest.mark.parametrize(
        ("fps", "mode"),
        [
            (20.0, (1640, 1232)),  # the smaller of the two that see everything
            (40.0, (1640, 1232)),
            (45.0, (1920, 1080)),  # sees more than the other that is as fast
            (90.0, (640, 480)),
        ],
    )
    def test_the_mode_that_sees_the_most_at_the_rate(
        self, open_camera: Open, tmp_path: Path, fps: float, mode: tuple[int, int]
    ) -> None:
        world = World(log_path=str(tmp_path / "started"))
        open_camera(world, width=640, height=480, fps=fps)
        read_first = started_when_there(world)
        assert tuple(read_first["mode"]) == mode
        assert read_first["FrameDurationLimits"] == [round(1e6 / fps)] * 2

    def test_left_alone_it_would_have_been_a_part_of_the_image(self, open_camera: Open, tmp_path: Path) -> None:
        world = World(log_path=str(tmp_path / "started"), chooses_modes=False)
        open_camera(world, width=640, height=480)
        assert MODES[tuple(started_when_there(world)["mode"])][0] == (1280, 960)

    def test_a_rate_that_no_mode_has_is_refused_with_what_there_is(self, open_camera: Open) -> None:
        with pytest.raises(UnsupportedSettingError, match=r"no 500 frames a second .* offered: 0\.1\.\.208\.3/s"):
            open_camera(width=640, height=480, fps=500.0)


def started_when_there(world: World) -> dict[str, Any]:
    """The stream starts right after its being granted was told."""
    while not Path(world.log_path).exists() or not Path(world.log_path).read_text(encoding="utf-8"):
        os.sched_yield()
    return started(world)


class TestSettings:
    """What is locked, and what is refused."""

    def test_what_is_not_locked_is_automatic(self, open_camera: Open, tmp_path: Path) -> None:
        world = World(log_path=str(tmp_path / "started"))
        open_camera(world)
        started_with = started_when_there(world)
        assert started_with["AeEnable"] is True
        assert not {"ExposureTime", "AnalogueGain", "AeFlickerMode"} & set(started_with)

    def test_the_power_lines_frequency_is_locked(self, open_camera: Open, tmp_path: Path) -> None:
        world = World(log_path=str(tmp_path / "started"))
        open_camera(world, power_line_hz=50)
        started_with = started_when_there(world)
        assert (started_with["AeFlickerMode"], started_with["AeFlickerPeriod"]) == (1, 10_000)

    @pytest.mark.parametrize("starts_bare", [False, True])
    @pytest.mark.parametrize("newer", [False, True])
    @pytest.mark.parametrize(
        ("settings", "locked"),
        [
            ({}, {}),
            ({"exposure_s": 0.008}, {"ExposureTime": 8000}),
            ({"gain": 2}, {"AnalogueGain": 2.0}),
            ({"exposure_s": 0.008, "gain": 2}, {"ExposureTime": 8000, "AnalogueGain": 2.0}),
        ],
        ids=["nothing", "exposure", "gain", "both"],
    )
    def test_what_is_locked_stays_locked_in_whatever_order_libcamera_takes_it(
        self,
        open_camera: Open,
        tmp_path: Path,
        settings: dict[str, Any],
        locked: dict[str, Any],
        newer: bool,
        starts_bare: bool,
    ) -> None:
        world = World(log_path=str(tmp_path / "started"), newer=newer, starts_bare=starts_bare)
        take(open_camera(world, **settings), 3)
        assert started(world)["locked"] == locked

    def test_autofocus_is_off_and_the_lens_at_its_default(self, open_camera: Open, tmp_path: Path) -> None:
        world = World(log_path=str(tmp_path / "started"), focuses=True)
        open_camera(world)
        started_with = started_when_there(world)
        assert (started_with["AfMode"], started_with["LensPosition"]) == (0, 1.0)

    @pytest.mark.parametrize(
        ("setting", "text"),
        [
            ({"exposure_s": 20.0}, "camera.exposure_s cannot be 20; choose 7.5e-05 to 11.7668, or leave it unset"),
            ({"gain": 64}, "camera.gain cannot be 64; choose 1 to 10.6, or leave it unset"),
            ({"pixel_format": "MJPG"}, "no MJPG of 160x120; offered: YU12: (64x64)-(3280x2464)/(+2,+2); NV12: "),
            ({"width": 8000}, "no format that can be read of 8000x120; offered: "),
        ],
        ids=["exposure", "gain", "format", "size"],
    )
    def test_what_is_not_granted_is_refused_with_what_is(
        self, open_camera: Open, setting: dict[str, Any], text: str
    ) -> None:
        with pytest.raises(UnsupportedSettingError) as caught:
            open_camera(**setting)
        assert str(caught.value).startswith("imx219: ")
        assert text in str(caught.value)


class TestNames:
    """Which camera is meant."""

    @pytest.mark.parametrize("device", ["imx219", "IMX2", "i2c@1", "/base/soc/i2c0mux/i2c@1/imx219@10"])
    def test_by_sensor_or_id_whole_or_in_part(self, open_camera: Open, device: str) -> None:
        take(open_camera(World(names=("ov5647", "imx219")), device), 1)

    def test_by_a_node_that_belongs_to_it(self, open_camera: Open) -> None:
        world = World(names=("imx708", "imx219"), nodes=(Path("/dev/null").stat().st_rdev,))
        take(open_camera(world, "/dev/null"), 1)
        with pytest.raises(
            DeviceMissingError, match=r"^/dev/zero: libcamera has no such camera; found: imx708 \(/base/"
        ):
            open_camera(world, "/dev/zero")

    def test_a_name_that_two_have_is_refused_with_their_ids(self, open_camera: Open) -> None:
        with pytest.raises(WrongDeviceError, match=r"use an id from: imx219 \(.*i2c@0.*\), imx219 \(.*i2c@1"):
            open_camera(World(names=("imx219", "imx219")))

    def test_all_of_them_are_listed(self) -> None:
        assert [camera.name for camera in cameras(command(World(names=("imx708", "ov5647"))))] == ["imx708", "ov5647"]

    def test_no_camera_at_all(self, open_camera: Open) -> None:
        with pytest.raises(DeviceMissingError, match="libcamera finds no camera; check that the ribbon cable"):
            open_camera(World(names=()))


class TestFaults:
    """Each is one line with the remedy, and none ends the program."""

    def test_without_libcamera_the_package_is_named(self, open_camera: Open) -> None:
        with pytest.raises(MissingSoftwareError, match=r"^imx219: .* has no libcamera .*; apt install python3-libcam"):
            open_camera(World(installed=False))

    def test_without_a_python_of_the_system_too(self) -> None:
        with pytest.raises(MissingSoftwareError, match=r"^imx219: /nowhere/python3 cannot be run .*; apt install"):
            LibcameraCamera("imx219", command=("/nowhere/python3",))

    def test_busy(self, open_camera: Open) -> None:
        with pytest.raises(
            DeviceBusyError, match=r"^imx219: in use by another program .*; close that \(fuser -v /dev/media\*"
        ):
            open_camera(World(busy=True))

    def test_gone(self, open_camera: Open) -> None:
        error = read_until_error(open_camera(World(cancelled=3)))
        assert isinstance(error, DeviceLostError)
        assert "as when a camera is unplugged; check its cable" in str(error)

    def test_a_crash_of_libcamera_is_an_error_like_others(self, open_camera: Open) -> None:
        error = read_until_error(open_camera(World(crash=2)))
        assert isinstance(error, DeviceLostError)
        assert str(error) == "imx219: the process that runs libcamera was ended by SIGSEGV; opened again"

    def test_after_a_crash_it_is_opened_again(self) -> None:
        worlds = iter([World(crash=2), World()])
        kept = KeptOpen("camera", lambda: LibcameraCamera("imx219", command=command(next(worlds)), **SIZE))
        with closing(kept):
            while kept.counts["opened"] < 2 or kept.error is not None or not kept.read():
                kept.read()
        assert kept.counts["failed"] == 1

    def test_silence_is_a_stall(self, open_camera: Open) -> None:
        camera = open_camera(World(silent=2), fps=30.0)
        error = read_until_error(camera)
        assert isinstance(error, DeviceStalledError)
        assert str(error).startswith("imx219: no usable image for 1.0 s; ")

    def test_a_libcamera_that_hangs_is_given_up_and_killed(
        self, open_camera: Open, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(libcamera, "OPENING_S", 0.5)
        with pytest.raises(DeviceStalledError, match=r"has not opened it within 0\.5 s"):
            open_camera(World(hangs=True))

    def test_signals_for_the_program_do_not_end_its_process_before_it(self, open_camera: Open) -> None:
        camera = open_camera()
        take(camera, 1)
        for number in (signal.SIGINT, signal.SIGTERM):
            camera._process._process.send_signal(number)
        take(camera, 3)

    def test_the_process_does_not_outlive_the_program(self) -> None:
        """Not even one that is killed."""
        program = (
            "import time; from drivers.camera import libcamera;"
            "from hil_mocks.libcamera_device import *;"
            f"libcamera.OPENING_S = {OPENING_S};"
            f"c = libcamera.LibcameraCamera('imx219', command=command(World()), **{SIZE!r});"
            "print(c._process._process.pid, flush=True); time.sleep(60)"
        )
        with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as running:
            assert running.stdout is not None
            pid = int(running.stdout.readline())
            handle = os.pidfd_open(pid)
            running.kill()
        ended = libcamera.select.poll()
        ended.register(handle, libcamera.select.POLLIN)
        assert ended.poll(10_000)
        os.close(handle)


class TestByHand:
    """python -m drivers.camera.libcamera."""

    @pytest.fixture(autouse=True)
    def stand_in(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(libcamera, "COMMAND", command(World()))

    def test_it_tells_rate_and_values(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["imx219", "--width", "160", "--height", "120", "--seconds", "1.2"]) == 0
        out = capsys.readouterr().out
        assert "Hz" in out
        assert "160x120" in out

    def test_cameras_are_listed(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["--list"]) == 0
        assert capsys.readouterr().out == "imx219: /base/soc/i2c0mux/i2c@0/imx219@10\n"

    def test_without_a_camera_the_list_is_a_line_that_says_so(
        self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(libcamera, "COMMAND", command(World(names=())))
        assert main(["--list"]) == 1
        output = capsys.readouterr()
        assert output.out == ""
        *_, listing = output.err.removesuffix("\n").partition(
            "libcamera finds no camera; check the ribbon cable, at both ends; those at USB: "
        )
        assert shlex.split(listing) == [sys.executable, "-m", "drivers.camera.v4l2", "--list"]

    def test_a_camera_that_is_not_there_is_one_line(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["imx500"]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("imx500: libcamera has no such camera; found: imx219")


class TestWhyThereIsNone:
    """When libcamera finds no camera, its media devices tell why."""

    @pytest.fixture
    def media(self, tmp_path: Path) -> Path:
        path = tmp_path / "media0"
        path.touch()
        return path

    def test_another_process_has_it_locked(self, media: Path) -> None:
        lock = f"import os; os.lockf(os.open({str(media)!r}, os.O_RDWR), os.F_TLOCK, 0); print(flush=True); input()"
        with subprocess.Popen([sys.executable, "-c", lock], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
            assert other.stdout is not None
            other.stdout.readline()
            assert why_none([media]).kind == "busy"
            other.communicate(b"\n")
        assert why_none([media]).kind == "missing"

    def test_it_may_not_be_opened(self, media: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def refused(self: Path, *_: object, **__: object) -> None:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))

        monkeypatch.setattr(Path, "open", refused)  # root may open everything
        assert why_none([media]).kind == "forbidden"

    def test_there_is_nothing(self) -> None:
        assert why_none([]).kind == "missing"

    def test_an_empty_list_tells_it_too(self, media: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Not that a cable is loose, when the user may not look."""
        bare = SimpleNamespace(CameraManager=SimpleNamespace(singleton=lambda: SimpleNamespace(cameras=[])))
        monkeypatch.setattr(libcamera_process, "why_none", lambda: Refused("forbidden", f"no permission for {media}"))
        ours, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ours, other, pytest.raises(Refused, match="no permission for"):
            serve(bare, other, {"device": ""})
