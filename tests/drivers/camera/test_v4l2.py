"""The camera driver against mock cameras: what it delivers, what it counts, what it refuses, how it comes back."""

import errno
import re
import shlex
import sys
from collections import Counter, deque
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from drivers.camera import v4l2_ioctl as v4l2
from drivers.camera.find import cameras, is_libcameras
from drivers.camera.v4l2 import BUFFERS, MAX_WAIT_S, V4l2Camera, main
from drivers.device import KeptOpen
from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    DeviceStalledError,
    DriverError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from drivers.samples import Frame
from hil_mocks.v4l2_device import MockCamera, MockControl, MockKernel, drawn_image
from hil_mocks.virtual_clock import VirtualClock

PATH = "/dev/video0"
BY_ID = "/dev/v4l/by-id/usb-Mock_Webcam-video-index0"

Open = Callable[..., V4l2Camera]
INTERVAL_NS = round(1e9 / 30)
REALTIME_FLAGS = v4l2.FLAG_STAMPED_AT_EXPOSURE  # V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture
def webcam() -> MockCamera:
    return MockCamera()


@pytest.fixture
def kernel(clock: VirtualClock, webcam: MockCamera) -> MockKernel:
    kernel = MockKernel(clock)
    kernel.plug(PATH, webcam, link=BY_ID)
    return kernel


@pytest.fixture
def open_camera(kernel: MockKernel, clock: VirtualClock) -> Open:
    def opened(device: str = PATH, **settings: Any) -> V4l2Camera:
        return V4l2Camera(device, clock=clock, kernel=kernel, **settings)

    return opened


def take(camera: V4l2Camera, count: int) -> list[Frame]:
    """The next images; reads at most twice as often as the camera's rate asks for."""
    frames: list[Frame] = []
    for _ in range(2 * count + 2):
        frames += camera.read()
        if len(frames) >= count:
            return frames[:count]
    raise AssertionError(f"only {len(frames)} of {count} images came: {camera.counts}")


def ribbon_camera(interface: int = v4l2.CAP_VIDEO_CAPTURE) -> MockCamera:
    """As the kernel's rp1-cfe: formats are offered and granted, starting is refused."""
    caps = interface | v4l2.CAP_STREAMING | 0x2000_0000  # V4L2_CAP_IO_MC
    return MockCamera(card="rp1-cfe", caps=caps, controls={}, tells_rate=False, start_error=errno.EINVAL)


def counted(camera: V4l2Camera) -> Counter[str]:
    """Without zeros."""
    return +camera.counts


def fail(camera: V4l2Camera, reads: int = 30) -> DriverError:
    """The error that reading ends with."""
    with pytest.raises(DriverError) as caught:
        deque((camera.read() for _ in range(reads)), maxlen=0)
    return caught.value


class Rounding(MockControl):
    """Takes only every fifteenth value, and tells a step of one."""

    def __setattr__(self, name: str, value: int) -> None:
        object.__setattr__(self, name, round(value / 15) * 15 if name == "value" else value)


class TestPictures:
    """A camera without faults."""

    @pytest.mark.parametrize("pixel_format", ["GREY", "NV12", "YUYV", "UYVY"])
    def test_luminance_arrives_as_the_camera_saw_it(
        self, open_camera: Open, webcam: MockCamera, pixel_format: str
    ) -> None:
        webcam.modes = {pixel_format: {(640, 480): (30.0,)}}
        webcam.row_padding = 64 * (pixel_format != "NV12")
        first, second = take(open_camera(pixel_format=pixel_format), 2)
        assert np.array_equal(first.image, drawn_image(0, 640, 480))
        assert np.array_equal(second.image, drawn_image(1, 640, 480))

    def test_jpegs_are_decoded(self, open_camera: Open) -> None:
        frame = take(open_camera(pixel_format="MJPG"), 1)[0]
        assert np.abs(frame.image.astype(int) - drawn_image(0, 640, 480)).max() < 10

    def test_an_image_keeps_its_content_when_its_buffer_is_filled_again(self, open_camera: Open) -> None:
        frames = take(open_camera(), 2 * BUFFERS)
        assert all(np.array_equal(frame.image, drawn_image(n, 640, 480)) for n, frame in enumerate(frames))

    def test_stamps_are_the_kernels_and_numbers_count_without_gaps(
        self, open_camera: Open, clock: VirtualClock
    ) -> None:
        began_ns = clock.monotonic_ns()
        camera = open_camera()
        frames = take(camera, 10)
        assert [frame.seq - frames[0].seq for frame in frames] == list(range(10))
        exposures_ns = [began_ns + round(n * 1e9 / 30) for n in range(10)]
        assert [frame.stamp_ns for frame in frames] == pytest.approx(exposures_ns, abs=1000)  # the kernel tells µs
        assert camera.stamped_at_exposure is True
        assert not counted(camera)

    def test_stamps_of_the_end_of_the_frame_are_known_to_be_that(self, open_camera: Open, webcam: MockCamera) -> None:
        webcam.stamp_flags = v4l2.FLAG_TIMESTAMP_MONOTONIC
        webcam.stamp_offset_s = 0.9 / 30  # reckoned in advance, as the kernel's vivid does
        camera = open_camera()
        take(camera, 5)
        assert camera.stamped_at_exposure is False
        assert not counted(camera)

    def test_reading_waits_in_the_kernel_and_not_in_a_loop(self, open_camera: Open, kernel: MockKernel) -> None:
        camera = open_camera()
        kernel.calls.clear()
        take(camera, 30)
        assert kernel.calls["poll"] <= 31
        assert kernel.calls["ioctl"] <= 3 * 31

    def test_one_reading_waits_a_quarter_of_a_second_at_most(
        self, open_camera: Open, webcam: MockCamera, clock: VirtualClock
    ) -> None:
        webcam.stalled = True
        camera = open_camera()
        began_ns = clock.monotonic_ns()
        assert camera.read() == []
        assert clock.monotonic_ns() - began_ns <= MAX_WAIT_S * 1e9

    def test_everything_is_given_back(self, open_camera: Open, kernel: MockKernel) -> None:
        camera = open_camera()
        take(camera, 3)
        camera.close()
        camera.close()
        assert kernel.open_files == 0
        assert len(kernel.mapped) == BUFFERS
        assert all(memory.closed for memory in kernel.mapped)

    @pytest.mark.parametrize("fault", ["format_error", "start_error"])
    def test_everything_is_given_back_when_opening_fails(
        self, open_camera: Open, kernel: MockKernel, webcam: MockCamera, fault: str
    ) -> None:
        setattr(webcam, fault, errno.EIO)
        with pytest.raises(DeviceLostError):
            open_camera()
        assert kernel.open_files == 0
        assert all(memory.closed for memory in kernel.mapped)


class TestMultiPlanar:
    """A device whose images may lie in several memories, as on many systems on a chip."""

    @pytest.fixture
    def webcam(self) -> MockCamera:
        modes = {name: {(640, 480): (30.0,)} for name in ("NM12", "RG10", "YUYV")}
        return MockCamera(modes=modes, caps=v4l2.CAP_VIDEO_CAPTURE_MPLANE | v4l2.CAP_STREAMING)

    @pytest.mark.parametrize("data_offset", [0, 64])
    @pytest.mark.parametrize("padding", [0, 32])
    def test_luminance_is_the_first_plane(
        self, open_camera: Open, webcam: MockCamera, padding: int, data_offset: int
    ) -> None:
        webcam.row_padding, webcam.data_offset = padding, data_offset
        camera = open_camera()
        assert camera.mode.pixel_format == "NM12"
        for number, frame in enumerate(take(camera, 6)):
            assert np.array_equal(frame.image, drawn_image(number, 640, 480))

    def test_formats_in_one_memory_are_read_as_well(self, open_camera: Open) -> None:
        frame = take(open_camera(pixel_format="YUYV"), 1)[0]
        assert np.array_equal(frame.image, drawn_image(0, 640, 480))

    def test_half_an_image_is_none(self, open_camera: Open, webcam: MockCamera) -> None:
        webcam.short = 1
        camera = open_camera()
        assert take(camera, 1)[0].seq == 1
        assert counted(camera) == {"short": 1}

    def test_everything_is_given_back(self, open_camera: Open, kernel: MockKernel) -> None:
        camera = open_camera()
        take(camera, 2)
        camera.close()
        assert kernel.open_files == 0
        assert all(memory.closed for memory in kernel.mapped)


class TestNewest:
    """Whoever reads late gets what is new."""

    def test_the_newest_of_several_wins(self, open_camera: Open, clock: VirtualClock) -> None:
        camera = open_camera()
        (first,) = take(camera, 1)
        clock.sleep_s(3 / 30)
        (frame,) = camera.read()
        assert frame.seq == first.seq + 3
        assert counted(camera) == {"overtaken": 2}

    def test_what_waited_in_full_buffers_is_passed_over(self, open_camera: Open, clock: VirtualClock) -> None:
        """A queue that nobody emptied holds what is old, and what came later found no room."""
        camera = open_camera()
        take(camera, 1)
        clock.sleep_s(5.0)
        (frame,) = take(camera, 1)
        assert clock.monotonic_ns() - frame.stamp_ns < 2 * INTERVAL_NS
        assert counted(camera)["overtaken"] == BUFFERS
        assert counted(camera)["dropped"] >= 5 * 30 - BUFFERS - 1
        assert not camera.counts["late"]

    def test_full_buffers_of_unknown_age_are_passed_over_too(
        self, open_camera: Open, webcam: MockCamera, clock: VirtualClock
    ) -> None:
        webcam.stamp_flags = REALTIME_FLAGS
        webcam.transfer = 0.9
        camera = open_camera()
        take(camera, 1)
        clock.sleep_s(5.0)
        (frame,) = take(camera, 1)
        exposed = round((clock.monotonic_ns() - VirtualClock().monotonic_ns()) * 30 / 1e9 - webcam.transfer)
        assert np.array_equal(frame.image, drawn_image(exposed, 640, 480))

    def test_being_away_is_not_a_stall(self, open_camera: Open, clock: VirtualClock) -> None:
        camera = open_camera()
        for _ in range(5):
            clock.sleep_s(30.0)
            assert take(camera, 1)


class TestStamps:
    """The kernel's stamps are checked, not believed."""

    @pytest.mark.parametrize(
        ("flags", "offset_s"),
        [
            (REALTIME_FLAGS, 0.0),
            (v4l2.FLAG_TIMESTAMP_MONOTONIC, 1.7e9),  # the clock of the calendar
            (v4l2.FLAG_TIMESTAMP_MONOTONIC, -3.0),  # a constant off
            (v4l2.FLAG_TIMESTAMP_MONOTONIC, 0.2),  # of the future
        ],
        ids=["of no clock", "of the calendar", "too early", "of the future"],
    )
    def test_what_cannot_be_is_stamped_at_arrival(
        self, open_camera: Open, webcam: MockCamera, clock: VirtualClock, flags: int, offset_s: float
    ) -> None:
        webcam.stamp_flags, webcam.stamp_offset_s = flags, offset_s
        camera = open_camera()
        for count in range(1, 6):
            (frame,) = take(camera, 1)
            assert frame.stamp_ns == clock.monotonic_ns()
            assert counted(camera) == {"stamped at arrival": count}

    def test_a_stamp_that_steps_back_is_not_taken(self, open_camera: Open, webcam: MockCamera) -> None:
        camera = open_camera()
        before = take(camera, 3)
        webcam.stamp_offset_s = -1.5 / 30
        after = take(camera, 3)
        stamps = [frame.stamp_ns for frame in before + after]
        assert stamps == sorted(set(stamps))
        assert counted(camera) == {"stamped at arrival": 3}

    def test_a_late_image_is_delivered_and_known_to_be_late(self, open_camera: Open, webcam: MockCamera) -> None:
        camera = open_camera()
        take(camera, 3)
        webcam.late_s = 2.5 / 30
        (frame,) = take(camera, 1)
        assert counted(camera) == {"late": 1}
        webcam.late_s = 0.0
        after = take(camera, 3)
        assert counted(camera)["late"] == 1
        assert after[0].stamp_ns > frame.stamp_ns


class TestBadPictures:
    """Each is a counted drop, and the next good one is delivered."""

    def test_lost_images_show_as_a_gap(self, open_camera: Open, webcam: MockCamera) -> None:
        camera = open_camera()
        (before,) = take(camera, 1)
        webcam.drop = 3
        (after,) = take(camera, 1)
        assert after.seq == before.seq + 4
        assert counted(camera) == {"dropped": 3}

    @pytest.mark.parametrize("first_sequence", [2**32 - 3, 7])
    def test_a_number_that_wraps_is_no_gap(self, open_camera: Open, webcam: MockCamera, first_sequence: int) -> None:
        webcam.first_sequence = first_sequence
        camera = open_camera()
        frames = take(camera, 6)
        assert [frame.seq - frames[0].seq for frame in frames] == list(range(6))
        assert not counted(camera)

    def test_a_device_that_counts_anew_does_not_drop_billions(self, open_camera: Open, webcam: MockCamera) -> None:
        camera = open_camera()
        (before,) = take(camera, 1)
        webcam.first_sequence = 3_000_000_000
        (after,) = take(camera, 1)
        assert after.seq == before.seq + 1

    def test_what_the_kernel_flags_is_corrupt(self, open_camera: Open, webcam: MockCamera) -> None:
        camera = open_camera()
        webcam.flag_error = 2
        assert np.array_equal(take(camera, 1)[0].image, drawn_image(2, 640, 480))
        assert counted(camera) == {"corrupt": 2}

    @pytest.mark.parametrize(("pixel_format", "reason"), [("YUYV", "short"), ("MJPG", "corrupt")])
    def test_half_an_image_is_none(self, open_camera: Open, webcam: MockCamera, pixel_format: str, reason: str) -> None:
        camera = open_camera(pixel_format=pixel_format)
        webcam.short = 2
        assert take(camera, 1)
        assert counted(camera) == {reason: 2}

    def test_an_image_of_another_size_is_none(self, open_camera: Open, webcam: MockCamera) -> None:
        camera = open_camera(pixel_format="MJPG")
        take(camera, 1)
        webcam.images = lambda seq, _width, _height: drawn_image(seq, 320, 240)
        assert camera.read() == []
        assert counted(camera) == {"wrong size": 1}

    def test_a_camera_that_sends_only_rubbish_is_stalled(self, open_camera: Open, webcam: MockCamera) -> None:
        camera = open_camera(pixel_format="MJPG")
        webcam.spoil = lambda data: data[100:]
        assert isinstance(fail(camera, reads=40), DeviceStalledError)
        assert counted(camera)["corrupt"] >= 25


class TestSettings:
    """What is asked is set and read back, or refused with what is offered."""

    def test_automatic_takes_the_cheapest_format_at_that_size_and_rate(self, open_camera: Open) -> None:
        assert open_camera(width=640, height=480).mode.pixel_format == "YUYV"
        small = open_camera(width=1280, height=720, fps=10)
        assert small.mode.pixel_format == "YUYV"

    def test_automatic_takes_jpegs_where_only_they_are_fast_enough(self, open_camera: Open) -> None:
        assert open_camera(width=1280, height=720, fps=30).mode.pixel_format == "MJPG"

    def test_raw_images_come_last(self, open_camera: Open, webcam: MockCamera) -> None:
        webcam.modes = {name: {(640, 480): (30.0,)} for name in ("RGGB", "MJPG", "Y12")}
        assert open_camera().mode.pixel_format == "Y12"
        del webcam.modes["Y12"]
        assert open_camera().mode.pixel_format == "MJPG"

    @pytest.mark.parametrize(("size", "reduction"), [((1280, 960), 2), ((2560, 1920), 4)])
    def test_a_larger_jpeg_is_made_smaller_where_nothing_fits(
        self, open_camera: Open, webcam: MockCamera, size: tuple[int, int], reduction: int
    ) -> None:
        webcam.modes = {"YUYV": {size: (5.0,)}, "MJPG": {size: (30.0,)}}
        camera = open_camera(width=640, height=480)
        assert (camera.mode.pixel_format, camera.mode.reduction) == ("MJPG", reduction)
        image = take(camera, 1)[0].image
        assert np.abs(image.astype(int) - drawn_image(0, 640, 480)).max() < 8

    def test_a_jpeg_that_is_no_multiple_is_not_bent_to_fit(self, open_camera: Open, webcam: MockCamera) -> None:
        webcam.modes = {"MJPG": {(1280, 720): (30.0,)}}
        with pytest.raises(UnsupportedSettingError, match=r"offered: MJPG: 1280x720 \(30/s\)"):
            open_camera(width=640, height=480)

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"width": 123, "height": 77}, ["123x77", "YUYV: ", "640x480 (30, 15/s)", "1280x720 (10/s)"]),
            ({"fps": 17}, ["at 17/s", "(30, 15/s)"]),
            ({"pixel_format": "GREY"}, ["no GREY", "YUYV: ", "MJPG: "]),
        ],
        ids=["size", "rate", "format"],
    )
    def test_what_is_not_offered_is_refused_with_what_is(
        self, open_camera: Open, settings: dict[str, object], message: list[str]
    ) -> None:
        with pytest.raises(UnsupportedSettingError) as caught:
            open_camera(**settings)
        assert all(part in str(caught.value) for part in message)
        assert "\n" not in str(caught.value)

    def test_a_size_that_is_offered_but_not_granted_is_refused(self, open_camera: Open, webcam: MockCamera) -> None:
        class Deceiver(dict[tuple[int, int], tuple[float, ...]]):
            """Lists a size that it does not have when it is asked for it."""

            def __contains__(self, size: object) -> bool:
                return size != (640, 480)

        webcam.modes = {"YUYV": Deceiver({(320, 240): (30.0,), (640, 480): (30.0,)})}
        with pytest.raises(UnsupportedSettingError, match="no YUYV of 640x480"):
            open_camera(pixel_format="YUYV")

    def test_thirty_is_also_30000_by_1001(self, open_camera: Open, webcam: MockCamera) -> None:
        webcam.modes = {"YUYV": {(640, 480): (30000 / 1001,)}}
        assert open_camera(fps=30).mode.fps == pytest.approx(29.97)

    def test_a_camera_that_does_not_tell_its_rate_is_taken_at_its_word(
        self, open_camera: Open, webcam: MockCamera
    ) -> None:
        webcam.tells_rate = False
        camera = open_camera(fps=17)
        assert camera.mode.fps == 17
        assert take(camera, 3)

    def test_interlaced_images_are_refused(self, open_camera: Open, webcam: MockCamera) -> None:
        webcam.field = 4  # V4L2_FIELD_INTERLACED
        with pytest.raises(UnsupportedSettingError, match="interlaced"):
            open_camera()

    def test_locks(self, open_camera: Open, webcam: MockCamera) -> None:
        open_camera(exposure_s=0.01, gain=40, power_line_hz=50)
        values = {control: model.value for control, model in webcam.controls.items()}
        assert values[v4l2.CID_EXPOSURE_AUTO] == 1  # manual
        assert values[v4l2.CID_EXPOSURE_ABSOLUTE] == 100  # of 100 µs
        assert values[v4l2.CID_GAIN] == 40
        assert values[v4l2.CID_POWER_LINE_FREQUENCY] == 1

    def test_what_is_not_locked_is_automatic_again_and_keeps_its_rate_in_the_dark(
        self, open_camera: Open, webcam: MockCamera
    ) -> None:
        webcam.controls[v4l2.CID_AUTOGAIN] = MockControl(1, 0, 1)
        open_camera(exposure_s=0.01, gain=40, power_line_hz=60).close()
        assert webcam.controls[v4l2.CID_AUTOGAIN].value == 0
        open_camera()
        assert webcam.controls[v4l2.CID_EXPOSURE_AUTO].value == 3
        assert webcam.controls[v4l2.CID_EXPOSURE_AUTO_PRIORITY].value == 0
        assert webcam.controls[v4l2.CID_AUTOGAIN].value == 1
        assert webcam.controls[v4l2.CID_POWER_LINE_FREQUENCY].value == 2

    @pytest.mark.parametrize(
        ("settings", "message"),
        [
            ({"exposure_s": 10.0}, r"camera\.exposure_s cannot be 10; choose 0\.0003 to 0\.2047, or leave it unset"),
            ({"gain": 256}, r"camera\.gain cannot be 256; choose 0 to 255, or leave it unset"),
        ],
    )
    def test_a_value_out_of_range_is_refused_with_the_range(
        self, open_camera: Open, settings: dict[str, object], message: str
    ) -> None:
        with pytest.raises(UnsupportedSettingError, match=message):
            open_camera(**settings)

    def test_a_value_that_becomes_another_is_refused(self, open_camera: Open, webcam: MockCamera) -> None:
        webcam.controls[v4l2.CID_GAIN] = Rounding(0, 0, 255)
        with pytest.raises(UnsupportedSettingError, match="became 15 instead of 13; set 15 or leave it unset"):
            open_camera(gain=13)

    @pytest.mark.parametrize("settings", [{"exposure_s": 0.01}, {"gain": 1}, {"power_line_hz": 50}])
    def test_a_lock_that_the_camera_does_not_have_is_refused(
        self, open_camera: Open, webcam: MockCamera, settings: dict[str, object]
    ) -> None:
        webcam.controls.clear()
        with pytest.raises(
            UnsupportedSettingError, match=rf"camera\.{next(iter(settings))} cannot be set; leave it unset"
        ):
            open_camera(**settings)


class TestNames:
    """Which camera is meant."""

    @pytest.mark.parametrize("name", [PATH, BY_ID, "Mock Webcam", "mock webcam", "webcam"])
    def test_by_path_by_id_and_by_name(self, open_camera: Open, name: str) -> None:
        assert take(open_camera(name), 1)

    def test_nodes_of_metadata_are_passed_over(self, open_camera: Open, kernel: MockKernel, webcam: MockCamera) -> None:
        metadata = MockCamera(caps=0x00A0_0000 | v4l2.CAP_STREAMING)  # V4L2_CAP_META_CAPTURE
        kernel.unplug(PATH)
        kernel.plug("/dev/video0", metadata)
        kernel.plug("/dev/video1", webcam)
        assert take(open_camera("Mock Webcam"), 1)
        with pytest.raises(WrongDeviceError, match=r"/dev/video0: gives no images .*/dev/video1 \(Mock Webcam\)"):
            open_camera("/dev/video0")

    @pytest.mark.parametrize("interface", [v4l2.CAP_VIDEO_CAPTURE, v4l2.CAP_VIDEO_CAPTURE_MPLANE])
    @pytest.mark.parametrize("name", [PATH, "rp1-cfe"])
    def test_a_ribbon_cable_camera_is_reported_at_once_with_the_remedy(
        self, open_camera: Open, kernel: MockKernel, clock: VirtualClock, name: str, interface: int
    ) -> None:
        kernel.unplug(PATH)
        kernel.plug(PATH, ribbon_camera(interface))
        kept = KeptOpen("camera", partial(open_camera, name), clock)
        kept.read()
        assert isinstance(kept.error, WrongDeviceError)
        assert str(kept.error) == (
            f"{name}: gives images only through libcamera, as ribbon-cable cameras do;"
            ' set camera.driver = "libcamera" (docs/raspberry-pi.md); no other camera is plugged in'
        )
        assert not kept.error.retry
        assert kernel.open_files == 0

    @pytest.mark.parametrize("driver", ["bcm2835-isp", "pispbe"])
    def test_a_signal_processor_that_does_not_tell_is_known_by_its_driver(
        self, open_camera: Open, webcam: MockCamera, driver: str
    ) -> None:
        webcam.driver = driver
        with pytest.raises(WrongDeviceError, match="only through libcamera"):
            open_camera()

    @pytest.mark.parametrize("interface", [v4l2.CAP_VIDEO_CAPTURE, v4l2.CAP_VIDEO_CAPTURE_MPLANE])
    def test_libcamera_is_meant_by_its_nodes_and_by_names_that_no_v4l2_camera_has(
        self, kernel: MockKernel, interface: int
    ) -> None:
        meant = partial(is_libcameras, kernel=kernel)
        kernel.plug("/dev/video14", MockCamera(driver="bcm2835-isp"))  # is there without a camera as well
        assert meant("/dev/video14")
        assert not any(map(meant, (PATH, BY_ID, "Mock Webcam", "imx219", "/dev/video1")))
        kernel.plug("/dev/video1", ribbon_camera(interface))
        assert all(map(meant, ("/dev/video1", "imx219", "/base/soc/i2c0mux/i2c@1/imx219@10")))
        assert not any(map(meant, (PATH, BY_ID, "mock webcam", "/dev/video2")))
        assert kernel.open_files == 0

    def test_a_ribbon_cable_camera_is_not_offered_but_the_usb_camera_beside_it(
        self, open_camera: Open, kernel: MockKernel
    ) -> None:
        kernel.plug("/dev/video1", ribbon_camera())
        assert [node.path for node in cameras(kernel)] == [PATH]
        with pytest.raises(WrongDeviceError, match=r"libcamera.*; found: /dev/video0 \(Mock Webcam\)$"):
            open_camera("/dev/video1")

    @pytest.mark.parametrize("number", [errno.EINVAL, errno.EPIPE, errno.ENOLINK])
    def test_a_pipeline_whose_node_does_not_tell_is_known_by_not_starting(
        self, open_camera: Open, kernel: MockKernel, webcam: MockCamera, number: int
    ) -> None:
        """As older kernels' nodes of ribbon-cable cameras do: they grant formats, and then do not start."""
        webcam.start_error = number
        with pytest.raises(WrongDeviceError, match=r"does not start on its own .* through libcamera"):
            open_camera()
        assert kernel.open_files == 0

    def test_a_name_that_two_cameras_have_is_refused(self, open_camera: Open, kernel: MockKernel) -> None:
        kernel.plug("/dev/video2", MockCamera())
        with pytest.raises(WrongDeviceError, match="/dev/video0 and /dev/video2"):
            open_camera("Mock Webcam")

    def test_a_whole_name_goes_before_a_part(self, open_camera: Open, kernel: MockKernel) -> None:
        other = MockCamera(card="Mock Webcam 2")
        kernel.plug("/dev/video2", other)
        take(open_camera("Mock Webcam 2"), 1)
        take(open_camera("Mock Webcam"), 1)

    @pytest.mark.parametrize("name", ["C920", "/dev/video9", "/dev/v4l/by-id/other"])
    def test_a_camera_that_is_not_there_is_reported_with_those_that_are(self, open_camera: Open, name: str) -> None:
        with pytest.raises(DeviceMissingError, match=rf"{name}: no .*found: /dev/video0 \(Mock Webcam\)"):
            open_camera(name)

    @pytest.mark.parametrize(
        ("fault", "number", "kind"),
        [
            ("open_error", errno.EACCES, DeviceForbiddenError),
            ("open_error", errno.EBUSY, DeviceBusyError),
            ("format_error", errno.EBUSY, DeviceBusyError),
            ("start_error", errno.ENOSPC, UnsupportedSettingError),
        ],
    )
    @pytest.mark.parametrize("name", [PATH, BY_ID])
    def test_why_it_cannot_be_opened(
        self, open_camera: Open, webcam: MockCamera, name: str, fault: str, number: int, kind: type[DriverError]
    ) -> None:
        setattr(webcam, fault, number)
        with pytest.raises(kind, match=f"^{name}: "):
            open_camera(name)

    def test_a_forbidden_camera_is_not_a_missing_one(self, open_camera: Open, webcam: MockCamera) -> None:
        webcam.open_error = errno.EACCES
        with pytest.raises(DeviceForbiddenError, match="group video"):
            open_camera("Mock Webcam")


class TestFaults:
    """A camera that goes away ends with an error at once, and comes back."""

    def test_unplugged(self, open_camera: Open, kernel: MockKernel, clock: VirtualClock) -> None:
        camera = open_camera()
        take(camera, 3)
        began_ns = clock.monotonic_ns()
        kernel.unplug(PATH)
        assert isinstance(fail(camera, reads=1), DeviceLostError)
        assert clock.monotonic_ns() == began_ns
        camera.close()
        assert kernel.open_files == 0

    @pytest.mark.parametrize("number", [errno.ENODEV, errno.EIO])
    def test_unplugged_between_waiting_and_reading(self, open_camera: Open, webcam: MockCamera, number: int) -> None:
        camera = open_camera()
        take(camera, 1)
        webcam.dequeue_error = number
        assert isinstance(fail(camera, reads=1), DeviceLostError)

    def test_stalled_after_ten_intervals_and_a_second_at_least(
        self, open_camera: Open, webcam: MockCamera, clock: VirtualClock
    ) -> None:
        camera = open_camera()
        (frame,) = take(camera, 1)
        webcam.stalled = True
        assert isinstance(fail(camera), DeviceStalledError)
        assert 1.0 < (clock.monotonic_ns() - frame.stamp_ns) / 1e9 < 1.0 + 2 * MAX_WAIT_S

    def test_a_slow_camera_may_take_its_ten_intervals(
        self, open_camera: Open, webcam: MockCamera, clock: VirtualClock
    ) -> None:
        webcam.modes = {"YUYV": {(640, 480): (2.0,)}}
        camera = open_camera(fps=2)
        frame = next(frame for _ in range(4) for frame in camera.read())
        webcam.stalled = True
        assert isinstance(fail(camera), DeviceStalledError)
        assert 5.0 < (clock.monotonic_ns() - frame.stamp_ns) / 1e9 < 6.0 + MAX_WAIT_S

    @pytest.mark.parametrize("name", [BY_ID, "Mock Webcam"])
    def test_back_under_another_number(
        self, open_camera: Open, kernel: MockKernel, webcam: MockCamera, clock: VirtualClock, name: str
    ) -> None:
        """The node's number changes when the old one is still held; link and name lead to the new one."""
        kept = KeptOpen("camera", lambda: open_camera(name), clock)
        assert len(_read_until_frame(kept)) == 1
        kernel.unplug(PATH)
        for _ in range(20):
            assert not kept.read()
        assert isinstance(kept.error, DeviceMissingError)
        kernel.plug("/dev/video4", webcam, link=BY_ID)
        began_ns = clock.monotonic_ns()
        _read_until_frame(kept)
        assert clock.monotonic_ns() - began_ns < 2e9
        assert kept.error is None
        assert kept.counts["opened"] == 2
        assert kernel.open_files == 1

    def test_an_unplugged_camera_costs_few_attempts(
        self, open_camera: Open, kernel: MockKernel, clock: VirtualClock
    ) -> None:
        kept = KeptOpen("camera", open_camera, clock)
        _read_until_frame(kept)
        kernel.unplug(PATH)
        began_ns = clock.monotonic_ns()
        attempts = 0
        while clock.monotonic_ns() - began_ns < 60e9:
            kept.read()
            attempts += 1
        assert attempts < 70

    @pytest.mark.parametrize("fault", ["format_error", "start_error", "open_error"])
    def test_busy_for_a_while(self, open_camera: Open, webcam: MockCamera, clock: VirtualClock, fault: str) -> None:
        setattr(webcam, fault, errno.EBUSY)
        kept = KeptOpen("camera", open_camera, clock)
        for _ in range(5):
            kept.read()
        assert isinstance(kept.error, DeviceBusyError)
        setattr(webcam, fault, 0)
        _read_until_frame(kept)
        assert kept.error is None


def _read_until_frame(kept: KeptOpen[Frame]) -> list[Frame]:
    for _ in range(10):
        if frames := list(kept.read()):
            return frames
    raise AssertionError(f"no image: {kept.error}")


class TestByHand:
    """``python -m drivers.camera.v4l2``."""

    def test_a_camera_that_is_not_there_is_one_line(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert main(["/dev/v4l/by-id/none"]) == 1
        output = capsys.readouterr()
        assert output.out == ""
        assert output.err.startswith("/dev/v4l/by-id/none: no such camera; ")
        assert output.err.count("\n") == 1

    def test_it_tells_rate_and_values(
        self,
        kernel: MockKernel,
        clock: VirtualClock,
        capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr("drivers.by_hand.REPORT_NS", 50_000_000)
        monkeypatch.setattr("drivers.camera.v4l2.V4l2Camera", partial(V4l2Camera, kernel=kernel, clock=clock))
        assert main(["Mock Webcam", "--seconds", "0.2"]) == 0
        assert re.match(r" +30\.00 Hz, every 33\.33 to 33\.33 ms .* 640x480, mean \d+", capsys.readouterr().out)
        assert kernel.open_files == 0

    def test_cameras_and_what_they_offer(
        self, kernel: MockKernel, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        kernel.plug("/dev/video2", MockCamera(card="Other", modes={"GREY": {(64, 48): (9.0,)}, "H264": {}}))
        monkeypatch.setattr("drivers.camera.v4l2.cameras", lambda: cameras(kernel))
        assert main(["--list"]) == 0
        first, offered, *_, second, grey, others = capsys.readouterr().out.splitlines()
        assert (first, second) == ("/dev/video0: Mock Webcam", "/dev/video2: Other")
        assert offered.startswith("  YUYV: 640x480 (30, 15/s), 320x240 (30, 15/s)")
        assert (grey, others) == ("  GREY: 64x48 (9/s)", "  not read: H264")

    def test_without_a_camera_the_list_is_a_line_that_says_so(
        self, clock: VirtualClock, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("drivers.camera.v4l2.cameras", lambda: cameras(MockKernel(clock)))
        assert main(["--list"]) == 1
        output = capsys.readouterr()
        assert output.out == ""
        *_, command = output.err.removesuffix("\n").partition(
            "no camera can be opened; lcf-edge doctor says why; those at a ribbon cable: "
        )
        assert shlex.split(command) == [sys.executable, "-m", "drivers.camera.libcamera", "--list"]

    def test_wrong_usage(self, capsys: pytest.CaptureFixture[str]) -> None:
        with pytest.raises(SystemExit, match="2"):
            main(["--fps", "0"])
        assert "--fps" in capsys.readouterr().err
