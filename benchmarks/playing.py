"""Drives and recordings, as a stream that is fed to every method."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.methods import Method, make
from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Camera, Config, Filter, Imu, Memory, Vehicle
from lcf_edge.lens import Lens
from lcf_edge.messages import Scene
from lcf_edge.recording.read import Recording, open_recording
from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import Drive
from lcf_edge.rendered.truth import Truth

Sample = ImuSample | SpeedSample


@dataclass(frozen=True, slots=True)
class Moment:
    """One frame, the result of each method, and the ground truth (None: unknown)."""

    frame: Frame
    scenes: dict[str, Scene]
    truth: Truth | None


def config_of(drive: Drive, settings: Filter | None = None, memory: Memory | None = None) -> Config:
    """The configuration that a user of the drive's vehicle would write."""
    matrix = drive.lens.matrix
    camera = Camera(
        width=drive.lens.width,
        height=drive.lens.height,
        fps=drive.fps,
        intrinsics=[float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2])],
        distortion_model=drive.lens.model,
        distortion=list(drive.lens.distortion),
        height_m=drive.camera_height_m,
        pitch_rad=drive.camera_pitch_rad,
        mask=[[list(point) for point in part] for part in drive.own_parts],
    )
    vehicle = Vehicle(half_width_m=drive.half_width_m, horizon_s=drive.horizon_s)
    imu = Imu(time_offset_s=-drive.exposure_s / 2)  # an image shows the middle of its exposure, its stamp the start
    return Config(camera=camera, imu=imu, vehicle=vehicle, filter=settings or Filter(), memory=memory or Memory())


def play_drive(drive: Drive, config: Config, names: Sequence[str]) -> Iterator[Moment]:
    """Render a drive and feed the methods, frame by frame in turn."""
    lens = Lens.from_config(config.camera, drive.lens.width, drive.lens.height)
    yield from feed(drive, {name: make(name, config, lens) for name in names})


def feed(drive: Drive, methods: Mapping[str, Method]) -> Iterator[Moment]:
    """Render a drive and feed these methods, frame by frame in turn."""
    samples: list[Sample] = [*scenes.imu(drive), *scenes.odometry(drive)]
    samples.sort(key=lambda sample: sample.stamp_ns)
    late_ns = round(1e9 / min(scenes.IMU_HZ, scenes.ODOMETRY_HZ))  # the first sample after the frame too
    given = 0
    for frame, truth in scenes.frames(drive):
        while given < len(samples) and samples[given].stamp_ns <= frame.stamp_ns + late_ns:
            _add(methods, samples[given])
            given += 1
        yield Moment(frame, {name: method.process(frame) for name, method in methods.items()}, truth)


def play_recording(path: Path, config: Config, names: Sequence[str]) -> Iterator[Moment]:
    """Read a recording and feed the methods, frame by frame in turn. Raises ``RecordingError``."""
    recording = open_recording(path, config)
    methods: dict[str, Method] = {}
    waiting: list[Sample] = []
    for item in recording:
        if not isinstance(item, Frame):
            if methods:
                _add(methods, item)
            else:
                waiting.append(item)
            continue
        if not methods:
            lens = lens_of(recording, config, *item.image.shape)
            methods = {name: make(name, config, lens) for name in names}
            for sample in waiting:
                _add(methods, sample)
        yield Moment(item, {name: method.process(item) for name, method in methods.items()}, None)


def lens_of(recording: Recording, config: Config, height: int, width: int) -> Lens:
    """The lens of images of a size, px: the configuration's, if that has intrinsics, else the recording's own."""
    own = None if config.camera.intrinsics else recording.lens
    return own.scaled(width, height) if own else Lens.from_config(config.camera, width, height)


def _add(methods: Mapping[str, Method], sample: Sample) -> None:
    for method in methods.values():
        method.add(sample)
