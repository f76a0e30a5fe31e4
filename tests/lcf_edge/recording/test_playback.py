"""A recording as camera, IMU and odometry: true timing, shared start, faults."""

import gc
import threading
import weakref
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from drivers.clock import SYSTEM_CLOCK
from drivers.device import Device, KeptOpen
from drivers.errors import DeviceLostError, DeviceMissingError, DeviceStalledError, WrongDeviceError
from drivers.samples import Frame, ImuSample, SpeedSample
from hil_mocks.virtual_clock import VirtualClock
from lcf_edge.config import Config, Imu
from lcf_edge.recording.playback import MAX_WAIT_S, Faults, Playback, RecordedCamera, RecordedImu, RecordedSpeed
from lcf_edge.recording.read.decoding import read_image

FRAMES, FPS, IMU_HZ = 8, 20, 100
START_NS = 1_700_000_000_000_000_000
FRAME_NS, SAMPLE_NS = round(1e9 / FPS), round(1e9 / IMU_HZ)
LAP_NS = (FRAMES - 1) * FRAME_NS


def write_recording(folder: Path, *, imu: bool = True, imu_ahead_ns: int = 0) -> Path:
    """Images whose grey is their number, samples whose gyro x is their time in s since the start."""
    header = "#timestamp [ns],…"
    frames = [START_NS + n * FRAME_NS for n in range(FRAMES)]
    (folder / "mav0/cam0/data").mkdir(parents=True)
    for n, stamp in enumerate(frames):
        cv2.imwrite(str(folder / f"mav0/cam0/data/{stamp}.png"), np.full((24, 32), n, np.uint8))
    rows = [header, *(f"{stamp},{stamp}.png" for stamp in frames)]
    (folder / "mav0/cam0/data.csv").write_text("\n".join(rows) + "\n")
    if imu:
        times = range(0, LAP_NS + 1, SAMPLE_NS)
        for sensor, values in (("imu0", ",0,0,0,-9.81,0"), ("odom0", "")):
            (folder / "mav0" / sensor).mkdir()
            rows = [header, *(f"{START_NS + t + imu_ahead_ns},{t / 1e9}{values or ',0'}" for t in times)]
            (folder / "mav0" / sensor / "data.csv").write_text("\n".join(rows) + "\n")
        (folder / "mav0/imu0/sensor.yaml").write_text("sensor_type: imu\n")
    return folder


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    return write_recording(tmp_path / "drive")


@pytest.fixture
def clock() -> VirtualClock:
    return VirtualClock()


@pytest.fixture(autouse=True)
def everything_is_left() -> Iterator[None]:
    """No recording stays open behind a test's back."""
    yield
    assert not Playback._playing


class Devices:
    """Opens stand-ins, and closes them at the end."""

    def __init__(self, path: Path, clock: VirtualClock) -> None:
        self._path, self._clock = path, clock
        self._open: list[Any] = []

    def __call__(self, kind: type[Any], config: Config | None = None, faults: Faults | None = None) -> Any:
        device = kind(self._path, config or Config(), self._clock, faults)
        self._open.append(device)
        return device

    def close(self) -> None:
        for device in self._open:
            device.close()
            device.close()


@pytest.fixture
def devices(recording: Path, clock: VirtualClock) -> Iterator[Devices]:
    devices = Devices(recording, clock)
    yield devices
    devices.close()


def read_until(device: Device[Any], clock: VirtualClock, end_ns: int) -> list[tuple[Any, int]]:
    """Records with the time of their delivery."""
    records = []
    while clock.monotonic_ns() < end_ns:
        read = device.read()
        records += [(record, clock.monotonic_ns()) for record in read]
    return records


class TestTiming:
    """What was recorded comes at its time."""

    def test_each_image_comes_at_its_time(self, devices: Devices, clock: VirtualClock) -> None:
        start_ns = clock.monotonic_ns()
        frames = read_until(devices(RecordedCamera), clock, start_ns + LAP_NS)
        assert [frame.stamp_ns - start_ns for frame, _ in frames] == [n * FRAME_NS for n in range(FRAMES)]
        assert all(frame.stamp_ns == came_ns for frame, came_ns in frames)
        assert [(frame.seq, frame.image[0, 0]) for frame, _ in frames] == [(n, n) for n in range(FRAMES)]

    def test_camera_imu_and_odometry_are_aligned(self, devices: Devices, clock: VirtualClock) -> None:
        start_ns = clock.monotonic_ns()
        camera, imu, speed = devices(RecordedCamera), devices(RecordedImu), devices(RecordedSpeed)
        for device, kind in ((imu, ImuSample), (speed, SpeedSample)):
            samples = [record for record, _ in read_until(device, clock, start_ns + LAP_NS // 2)]
            assert all(isinstance(sample, kind) for sample in samples)
            values = [s.gyro[0] if isinstance(s, ImuSample) else s.speed_mps for s in samples]
            assert values == pytest.approx([(sample.stamp_ns - start_ns) / 1e9 for sample in samples], abs=1e-9)
        (frame,) = camera.read()
        assert frame.stamp_ns == start_ns + int(frame.image[0, 0]) * FRAME_NS

    def test_a_device_that_is_opened_later_joins_in(self, devices: Devices, clock: VirtualClock) -> None:
        start_ns = clock.monotonic_ns()
        read_until(devices(RecordedCamera), clock, start_ns + 3 * FRAME_NS)
        opened_ns = clock.monotonic_ns()
        first, _ = read_until(devices(RecordedImu), clock, start_ns + LAP_NS)[0]
        assert first.stamp_ns >= opened_ns
        assert first.gyro[0] == pytest.approx((first.stamp_ns - start_ns) / 1e9)

    def test_it_begins_again_without_a_break(self, devices: Devices, clock: VirtualClock) -> None:
        start_ns = clock.monotonic_ns()
        laps = 3
        camera, imu = devices(RecordedCamera), devices(RecordedImu)
        frames = [frame for frame, _ in read_until(camera, clock, start_ns + laps * FRAMES * FRAME_NS)]
        assert [frame.image[0, 0] for frame in frames[: laps * FRAMES]] == [*range(FRAMES)] * laps
        assert [later.seq - sooner.seq for sooner, later in pairwise(frames)] == [1] * (len(frames) - 1)
        assert {later.stamp_ns - sooner.stamp_ns for sooner, later in pairwise(frames)} == {FRAME_NS}
        stamps = [sample.stamp_ns for sample in imu.read()]
        assert stamps == sorted(set(stamps))

    def test_a_time_offset_of_the_imu_stays_in_its_stamps(self, tmp_path: Path, clock: VirtualClock) -> None:
        ahead_ns = 30_000_000
        path = write_recording(tmp_path / "offset", imu_ahead_ns=ahead_ns)
        config = msgspec.structs.replace(Config(), imu=Imu(time_offset_s=-ahead_ns / 1e9))
        camera, imu = (kind(path, config, clock) for kind in (RecordedCamera, RecordedImu))
        frame = read_until(camera, clock, clock.monotonic_ns() + FRAME_NS)[0][0]
        sample = imu.read()[0]
        assert sample.stamp_ns - ahead_ns - round(sample.gyro[0] * 1e9) == frame.stamp_ns - frame.seq * FRAME_NS
        camera.close()
        imu.close()

    def test_who_reads_late_gets_the_newest_image_and_all_samples(self, devices: Devices, clock: VirtualClock) -> None:
        camera, imu = devices(RecordedCamera), devices(RecordedImu)
        clock.sleep_s(0.2)
        (frame,) = camera.read()
        assert frame.seq == 4
        assert camera.counts["overtaken"] == 4
        assert len(imu.read()) == 0.2 * IMU_HZ + 1

    def test_after_a_long_pause_little_is_held_and_the_other_images_are_counted(
        self, devices: Devices, clock: VirtualClock, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        held: set[int] = set()
        most = 0

        def read_and_count(path: Path) -> Any:
            nonlocal most
            image = read_image(path)
            held.add(id(image))
            weakref.finalize(image, held.remove, id(image))
            most = max(most, len(held))
            return image

        monkeypatch.setattr("lcf_edge.recording.read.asl.read_image", read_and_count)
        camera = devices(RecordedCamera)
        for pause_s in (60.0, 240.0):
            clock.sleep_s(pause_s)
            assert len(camera.read()) == 1
            assert 0 < most < 10
            assert sum(isinstance(thing, ImuSample) for thing in gc.get_objects()) < 5000
        assert camera.counts["overtaken"] == pytest.approx(300 * FPS, rel=0.01)

    def test_threads_share_one_start(self, recording: Path) -> None:
        """With the real clock, each device opened and read by its own thread."""
        found: dict[str, list[Any]] = {}
        together = threading.Barrier(2, timeout=10)

        def run(name: str, kind: type[RecordedCamera] | type[RecordedImu], count: int) -> None:
            device = kind(recording, Config(), SYSTEM_CLOCK)
            together.wait()
            records: list[Any] = []
            while len(records) < count:
                records += device.read()
            together.wait()
            device.close()
            found[name] = records

        threads = [
            threading.Thread(target=run, args=("camera", RecordedCamera, 4)),
            threading.Thread(target=run, args=("imu", RecordedImu, 20)),
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(10)
        starts_ns = {frame.stamp_ns - int(frame.image[0, 0]) * FRAME_NS for frame in found["camera"]}
        starts_ns |= {sample.stamp_ns - round(sample.gyro[0] * 1e9) for sample in found["imu"]}
        assert len(starts_ns) == 1


class TestFaults:
    """What a stand-in is made to suffer."""

    def test_drops_are_counted(self, devices: Devices, clock: VirtualClock) -> None:
        camera = devices(RecordedCamera, faults=Faults(drop=0.3))
        end_ns = clock.monotonic_ns() + 99 * FRAME_NS
        frames = [frame for frame, _ in read_until(camera, clock, end_ns)]
        assert len(frames) + camera.counts["dropped"] == 100
        assert 15 < camera.counts["dropped"] < 45
        assert any(later.seq - sooner.seq > 1 for sooner, later in pairwise(frames))

    def test_jitter_delays_the_delivery_and_not_the_stamp(self, devices: Devices, clock: VirtualClock) -> None:
        start_ns = clock.monotonic_ns()
        frames = read_until(devices(RecordedCamera, faults=Faults(jitter_s=0.03)), clock, start_ns + LAP_NS)
        delays_s = [(came_ns - frame.stamp_ns) / 1e9 for frame, came_ns in frames]
        assert 0.01 < max(delays_s) <= 0.03
        assert min(delays_s) < max(delays_s)
        assert all((frame.stamp_ns - start_ns) % FRAME_NS == 0 for frame, _ in frames)

    def test_a_stall_is_reported_as_by_the_real_driver(self, devices: Devices) -> None:
        faults = Faults()
        camera = devices(RecordedCamera, faults=faults)
        camera.read()
        faults.stalled = True
        assert [camera.read() for _ in range(3)] == [[]] * 3
        with pytest.raises(DeviceStalledError):
            camera.read()

    @pytest.mark.parametrize("kind", [RecordedCamera, RecordedImu])
    def test_unplugged_and_back(
        self, devices: Devices, recording: Path, clock: VirtualClock, kind: type[RecordedCamera | RecordedImu]
    ) -> None:
        devices(RecordedSpeed)  # somebody else stays, so the recording goes on
        start_ns = clock.monotonic_ns()
        faults = Faults()
        kept: KeptOpen[Frame | ImuSample] = KeptOpen(
            "stand-in", lambda: kind(recording, Config(), clock, faults), clock
        )
        read_until(kept, clock, start_ns + 3 * FRAME_NS)
        faults.unplugged = True
        assert not kept.read()
        assert isinstance(kept.error, DeviceLostError)
        assert not kept.read()
        assert isinstance(kept.error, DeviceMissingError)
        faults.unplugged = False
        back_ns = clock.monotonic_ns()
        records = read_until(kept, clock, back_ns + 2 * FRAME_NS)
        assert kept.error is None
        assert all(record.stamp_ns >= back_ns for record, _ in records)
        assert (records[0][0].stamp_ns - start_ns) % SAMPLE_NS == 0
        kept.close()


class TestRefusals:
    """What cannot be played is reported on opening."""

    def test_a_recording_that_is_not_there(self, tmp_path: Path) -> None:
        with pytest.raises(DeviceMissingError, match="nowhere: no such file"):
            RecordedCamera(tmp_path / "nowhere", Config())

    @pytest.mark.parametrize("kind", [RecordedImu, RecordedSpeed])
    def test_a_recording_without_samples(self, tmp_path: Path, kind: type[RecordedImu | RecordedSpeed]) -> None:
        path = write_recording(tmp_path / "silent", imu=False)
        with pytest.raises(WrongDeviceError, match="silent: no "):
            kind(path, Config())

    def test_images_that_cannot_be_read(self, recording: Path, clock: VirtualClock) -> None:
        camera = RecordedCamera(recording, Config(), clock)
        for image_path in (recording / "mav0/cam0/data").iterdir():
            image_path.write_bytes(b"no image")
        with pytest.raises(DeviceLostError, match="not one image"):
            camera.read()
        camera.close()
        with pytest.raises(DeviceLostError):
            camera.read()

    def test_waiting_is_bounded(self, recording: Path, clock: VirtualClock) -> None:
        camera = RecordedCamera(recording, Config(), clock, Faults(stalled=True))
        began_ns = clock.monotonic_ns()
        camera.read()
        assert clock.monotonic_ns() - began_ns <= MAX_WAIT_S * 1e9
        camera.close()
