"""A rendered drive through every driver: on a stand-in below it, each finds what the replay of the recording finds."""

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from drivers.camera.v4l2 import V4l2Camera
from drivers.device import Device
from drivers.imu.iio import Iio
from drivers.imu.registry import has_interface
from drivers.samples import Frame, ImuSample, SpeedSample
from hil_mocks.i2c import CHIPS, SimulatedBus, replay
from hil_mocks.i2c.bmi import Bmi270
from hil_mocks.i2c.motion import Vector
from hil_mocks.serial_imu import ENCODERS, SerialImuStandIn
from hil_mocks.v4l2_device import MockCamera, MockKernel
from hil_mocks.virtual_clock import VirtualClock
from lcf_edge.cli.findings import findings, trusted_rebels
from lcf_edge.config import Config, ImuDriver, load
from lcf_edge.devices import open_camera, open_imu
from lcf_edge.ego_motion.estimator import EgoMotionEstimator
from lcf_edge.lens import Lens
from lcf_edge.pipeline import Pipeline
from lcf_edge.recording.read import open_recording
from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import START_NS

SHAKES = (
    scenes.Shake("yaw", 0.04, 1.3, 0.0),
    scenes.Shake("pitch", 0.02, 2.1, 1.0),
    scenes.Shake("roll", 0.03, 0.9, 2.0),
)
DRIVE = replace(scenes.make("crossing", 1, seconds=1.0), shakes=SHAKES)
LEARNING = 10  # images
FRAMES = round(DRIVE.seconds * DRIVE.fps)
SAMPLES, SPEEDS = scenes.imu(DRIVE), scenes.odometry(DRIVE)
LEAD_NS = START_NS - SAMPLES[0].stamp_ns  # the samples begin before the images
WARM_UP_S = 1.5  # from power-on; the rates of devices are known after that
RATE_HZ = {"bno08x_rvc": 100.0}  # where it is not that of the recording
FIRST_IS_NONE = ("bno08x_rvc", "csv")  # angles need a second frame, a line may have begun before

Read = Callable[[Device[ImuSample]], Iterable[ImuSample]]
"""Reads a device, after its stand-in did what is due by now."""


class Vehicle:
    """Before the drive begins it feels the same backwards: devices learn their rates, nothing stands quite still."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.begin_ns = self.clock.monotonic_ns() + round(WARM_UP_S * 1e9)  # of the first sample
        self._recorded = replay(SAMPLES)

    def felt(self, now_ns: float) -> tuple[Vector, Vector]:
        """Gyro and accelerometer."""
        return self._recorded(abs(now_ns - self.begin_ns) / 1e9)

    def samples(self, begin_ns: int, rate_hz: float) -> Iterator[ImuSample]:
        """As an IMU has them that samples by itself."""
        for number in count():
            stamp_ns = begin_ns + round(number * 1e9 / rate_hz)
            yield ImuSample(stamp_ns, *self.felt(stamp_ns))


@dataclass
class Bench:
    """Puts stand-ins below the drivers. Return the settings that lead to them."""

    vehicle: Vehicle
    folder: Path
    recording: Path
    monkeypatch: pytest.MonkeyPatch
    later: Callable[[Callable[[], None]], None]

    def imu(self, driver: str) -> tuple[list[str], Read]:
        if driver == "recording":
            return [], lambda imu: imu.read()
        if driver == "iio":
            return self._iio()
        return self._serial(driver) if has_interface(driver, "serial") else self._i2c(driver)

    def _i2c(self, driver: str) -> tuple[list[str], Read]:
        clock = self.vehicle.clock
        begin_ns = clock.monotonic_ns()
        chip = CHIPS[driver](lambda time_s: self.vehicle.felt(begin_ns + time_s * 1e9), clock, rate_error=0.01)
        wire = SimulatedBus(clock, chip.places, speed_hz=400_000)
        self.monkeypatch.setattr("drivers.imu.i2c_bus.smbus2.SMBus", lambda: wire)
        (self.folder / "firmware").write_bytes(Bmi270.firmware)
        return [f"imu.firmware={self.folder / 'firmware'}"], lambda imu: imu.read()

    def _serial(self, driver: str) -> tuple[list[str], Read]:
        rate_hz, begin_ns = RATE_HZ.get(driver, scenes.IMU_HZ), 0

        def samples() -> Iterator[ImuSample]:
            """Two are there at the first look; what is asked of some IMUs when they are opened takes its time."""
            nonlocal begin_ns
            begin_ns = self.vehicle.clock.monotonic_ns() - round(1e9 / rate_hz)
            yield from self.vehicle.samples(begin_ns, rate_hz)

        stand_in = SerialImuStandIn(ENCODERS[driver](), samples(), self.folder / "port")
        self.later(stand_in.close)

        missing = -(driver in FIRST_IS_NONE)

        def read(imu: Device[ImuSample]) -> Iterator[ImuSample]:
            nonlocal missing
            if not begin_ns:
                missing += stand_in.send()
            due = int((self.vehicle.clock.monotonic_ns() - begin_ns) / 1e9 * rate_hz) + 1
            missing += stand_in.send(due - stand_in.sent)
            while missing > 0:  # the terminal hands them on when it gets to it
                for sample in imu.read():
                    missing -= 1
                    yield sample

        return [f"imu.port={stand_in.port}", f"imu.rate_hz={rate_hz}"], read

    def _iio(self) -> tuple[list[str], Read]:
        device = self.folder / "iio:device0"
        device.mkdir()
        axes = []
        for kind, scale in (("in_anglvel", 0.000266), ("in_accel", 0.0012)):
            (device / f"{kind}_scale").write_text(str(scale))
            for axis in "xyz":
                file = os.open(device / f"{kind}_{axis}_raw", os.O_CREAT | os.O_WRONLY)
                self.later(partial(os.close, file))
                axes.append((file, scale))

        def feed() -> None:
            gyro, accel = self.vehicle.felt(self.vehicle.clock.monotonic_ns())
            for (file, scale), value in zip(axes, gyro + accel, strict=True):
                os.pwrite(file, b"%9d\n" % round(value / scale), 0)

        def read(imu: Device[ImuSample]) -> Iterable[ImuSample]:
            feed()
            return imu.read()

        feed()
        self.monkeypatch.setattr("drivers.imu.iio.Iio", partial(Iio, root=self.folder, dev=self.folder))
        return [], read

    def camera(self, driver: str) -> list[str]:
        if driver == "recording":
            return [f"camera.recording={self.recording}"]
        images = [event.image for event in open_recording(self.recording, Config()) if isinstance(event, Frame)]
        kernel = MockKernel(self.vehicle.clock)
        kernel.plug(
            "/dev/video0",
            MockCamera(
                modes={"YUYV": {(640, 480): (DRIVE.fps,)}},
                images=lambda seq, _width, _height: images[min(seq, FRAMES - 1)],
            ),
        )
        self.monkeypatch.setattr("drivers.camera.v4l2.V4l2Camera", partial(V4l2Camera, kernel=kernel))
        return []


@pytest.fixture
def bench(tmp_path: Path, recording: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> Bench:
    return Bench(Vehicle(), tmp_path, recording, monkeypatch, request.addfinalizer)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return scenes.write(DRIVE, tmp_path_factory.mktemp("drive"))


def configured(*settings: str) -> Config:
    lens = DRIVE.lens.matrix
    intrinsics = [float(lens[row, column]) for row, column in ((0, 0), (1, 1), (0, 2), (1, 2))]
    drive = [f"camera.height_m={DRIVE.camera_height_m}", f"vehicle.half_width_m={DRIVE.half_width_m}"]
    return load(None, [*drive, f"camera.intrinsics={intrinsics}", f"camera.fps={DRIVE.fps}", *settings])


@dataclass(frozen=True)
class Seen:
    """What came of a drive."""

    threats: dict[str, float | None]  # after how long each was found, s
    rotations: np.ndarray  # (images, 3, 3) of the camera since the image before
    notes: set[str]  # except for the first images, from which the gyro's bias is learnt


def driven(config: Config, events: Iterable[Frame | ImuSample | SpeedSample]) -> Seen:
    pipeline = Pipeline(config, Lens.from_config(config.camera, DRIVE.lens.width, DRIVE.lens.height))
    motion = EgoMotionEstimator(config.imu, config.vehicle)
    rebels, rotations, notes = {}, [], set()
    for event in events:
        if isinstance(event, Frame):
            scene = pipeline.process(event)
            rebels[scene.seq] = trusted_rebels(scene, config.filter.tr_s)
            rotations.append(motion.advance(event.stamp_ns).rotation)
            notes |= set(scene.notes) if scene.seq >= LEARNING else set()
        else:
            pipeline.add(event)
            motion.add_imu(event) if isinstance(event, ImuSample) else motion.add_speed(event)
    threats = {threat.name: threat.latency_s for threat in findings(scenes.truths(DRIVE), rebels)}
    return Seen(threats, np.array(rotations), notes)


def live(bench: Bench, config: Config, read: Read) -> Iterator[Frame | ImuSample | SpeedSample]:
    """Events of the devices, as the daemon hands them on: an image when the samples of its time are there."""
    clock = bench.vehicle.clock
    imu = open_imu(config, clock)
    assert imu is not None
    bench.later(imu.close)

    def samples_until(end_ns: float) -> Iterator[ImuSample]:
        newest_ns = 0
        while newest_ns < end_ns:
            clock.sleep_s(0.005)
            for sample in read(imu):
                newest_ns = sample.stamp_ns
                yield sample

    if config.imu.driver != "recording":  # that begins when it is opened
        deque(samples_until(bench.vehicle.begin_ns), maxlen=0)
    camera = open_camera(config, clock)
    bench.later(camera.close)
    begin_ns = bench.vehicle.begin_ns = clock.monotonic_ns() - LEAD_NS * (config.camera.driver == "v4l2")
    speeds = [replace(speed, stamp_ns=speed.stamp_ns - SAMPLES[0].stamp_ns + begin_ns) for speed in SPEEDS]
    for number in range(FRAMES):
        due_ns = begin_ns + LEAD_NS + round((number + 0.5) * 1e9 / DRIVE.fps)
        yield from samples_until(due_ns)
        while speeds and speeds[0].stamp_ns < due_ns:
            yield speeds.pop(0)
        yield from camera.read()


@pytest.fixture(scope="module")
def replayed(recording: Path) -> Seen:
    config = configured()
    return driven(config, open_recording(recording, config))


def max_error_rad(seen: Seen, other: Seen) -> float:
    """Of the rotation between two images."""
    apart = np.einsum("nij,nkj->nik", seen.rotations[2:], other.rotations[2:])
    return float(np.arccos(np.clip((np.trace(apart, axis1=1, axis2=2) - 1) / 2, -1, 1)).max())


def test_the_replay_finds_the_walker(replayed: Seen) -> None:
    assert replayed.threats == {"walker": pytest.approx(0.15, abs=0.11)}
    assert max_error_rad(replayed, replace(replayed, rotations=np.array([np.eye(3)] * FRAMES))) > 0.01


@pytest.mark.parametrize("imu", [driver for driver in get_args(ImuDriver) if driver != "none"])
def test_every_imu_finds_what_the_replay_finds(bench: Bench, replayed: Seen, imu: str) -> None:
    assert_alike(bench, replayed, "recording", imu)


def test_a_camera_of_the_kernel_finds_what_the_replay_finds(bench: Bench, replayed: Seen) -> None:
    assert_alike(bench, replayed, "v4l2", "mpu6050")


def assert_alike(bench: Bench, replayed: Seen, camera: str, imu: str) -> None:
    settings, read = bench.imu(imu)
    config = configured(f"camera.driver={camera}", *bench.camera(camera), f"imu.driver={imu}", *settings)
    seen = driven(config, live(bench, config, read))
    assert seen.threats == replayed.threats
    assert max_error_rad(seen, replayed) < 5e-4  # a quarter of a pixel
    assert not seen.notes
