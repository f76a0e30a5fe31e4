"""``lcf-edge bench``: the filter's speed on this computer, on a drive that it renders itself.

Half of the time frames follow without pauses, half at the rate of a camera, where caches go cold and the processor's
governor may slow down between two frames. No camera, no Zenoh: only ``Pipeline.process`` is measured.
"""

import os
import platform
import re
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge import __version__
from lcf_edge.compilation import uncompiled
from lcf_edge.config import Camera, Config, Vehicle
from lcf_edge.lens import Lens
from lcf_edge.messages import PipelineScene
from lcf_edge.pipeline import Pipeline
from lcf_edge.rendered import scenes

CAMERA_HZ = 30
KIND, SEED = "two_crossing", 1
DRIVE_S = 2.5
WARM_UP = 10  # frames, in which the tables fill

Say = Callable[[str], None]
Event = Frame | ImuSample | SpeedSample


@dataclass(frozen=True, slots=True)
class Measured:
    """Measurements at one frame rate: stages in ms, (n, 3) of detect, filter, whole; CPU time, s a frame."""

    stages_ms: npt.NDArray[np.float64]
    cpu_s: float
    corners: float  # median

    @property
    def frames_a_second(self) -> float:
        """Frames that one core can process in a second."""
        return 1 / self.cpu_s

    @property
    def share_of_a_core(self) -> float:
        """Share of a core that a camera of ``CAMERA_HZ`` needs."""
        return CAMERA_HZ * self.cpu_s


def bench(seconds: float, say: Say) -> None:
    """Measure for ``seconds`` and print a report, with one line at the end that can be sent in."""
    cv2.setNumThreads(1)  # as the daemon
    drive = Drive()
    fast = measure(drive, seconds / 2, rate_hz=None)
    paced = measure(drive, seconds / 2, rate_hz=CAMERA_HZ)
    for line in report(Computer.this(), fast, paced):
        say(line)


class Drive:
    """A rendered drive, held in memory, that can be repeated."""

    def __init__(self) -> None:
        drive = scenes.make(KIND, SEED, seconds=DRIVE_S)
        late_ns = round(1e9 / min(scenes.IMU_HZ, scenes.ODOMETRY_HZ))  # samples come a little after their frame
        events: list[tuple[int, Event]] = [(frame.stamp_ns + late_ns, frame) for frame, _ in scenes.frames(drive)]
        samples: list[ImuSample | SpeedSample] = [*scenes.imu(drive), *scenes.odometry(drive)]
        events += [(sample.stamp_ns, sample) for sample in samples]
        self._events = [event for _, event in sorted(events, key=lambda timed: timed[0])]
        self._config = Config(
            camera=Camera(height_m=drive.camera_height_m, pitch_rad=drive.camera_pitch_rad),
            vehicle=Vehicle(half_width_m=drive.half_width_m, horizon_s=drive.horizon_s),
        )
        self._lens = Lens.from_config(self._config.camera, drive.lens.width, drive.lens.height)

    def steps(self) -> Iterator[tuple[bool, Callable[[], PipelineScene]]]:
        """Yield without end: each frame as a call that processes it, and whether the tables are filled."""
        while True:
            pipeline, samples, frames = Pipeline(self._config, self._lens), list[ImuSample | SpeedSample](), 0
            for event in self._events:
                if isinstance(event, Frame):
                    frames += 1
                    yield frames > WARM_UP, _step(pipeline, samples, event)
                    samples = []
                else:
                    samples.append(event)


def _step(pipeline: Pipeline, samples: Sequence[ImuSample | SpeedSample], frame: Frame) -> Callable[[], PipelineScene]:
    def step() -> PipelineScene:
        for sample in samples:
            pipeline.add(sample)
        return pipeline.process(frame)

    return step


def measure(drive: Drive, seconds: float, rate_hz: float | None) -> Measured:
    """Measure for ``seconds``, but at least one frame; ``rate_hz``: of the camera, None: without pauses."""
    stages_us: list[tuple[int, int, int]] = []
    corners: list[int] = []
    cpu_s: list[float] = []
    start_s = time.monotonic()
    for number, (counts, step) in enumerate(drive.steps()):
        if rate_hz is not None:
            time.sleep(max(start_s + number / rate_hz - time.monotonic(), 0))
        before_s = time.thread_time()
        scene = step()
        if counts:
            cpu_s.append(time.thread_time() - before_s)
            stages_us.append((scene.timing.detect, scene.timing.filter, scene.timing.total))
            corners.append(scene.sizes.corners)
        if time.monotonic() - start_s > seconds and stages_us:
            break
    return Measured(np.array(stages_us) / 1e3, float(np.mean(cpu_s)), float(np.median(corners)))


@dataclass(frozen=True, slots=True)
class Computer:
    """The computer that was measured, each part in one line."""

    board: str
    machine: str
    cores: int
    software: str  # "Python 3.11.2, NumPy 2.1.0, OpenCV 4.10.0"

    @classmethod
    def this(cls) -> "Computer":
        """Return the computer that this runs on."""
        software = f"Python {platform.python_version()}, NumPy {version('numpy')}, OpenCV {cv2.__version__}"
        return cls(_board(), platform.machine(), os.cpu_count() or 1, software)


def _board() -> str:
    """Return the board's model, or the processor's where there is no device tree."""
    for name, pattern in (
        ("/sys/firmware/devicetree/base/model", r"([^\0]+)"),
        ("/proc/cpuinfo", r"^model name\s*: (.+)$"),
    ):
        try:
            text = Path(name).read_text(encoding="utf-8", errors="replace")
        except OSError:
            continue
        if found := re.search(pattern, text, re.MULTILINE):
            return " ".join(found[1].split())
    return "unknown board"


def report(computer: Computer, fast: Measured, paced: Measured) -> list[str]:
    """Return the lines for the user; the last one sums up."""
    compiled = "uncompiled" if uncompiled() else "compiled"
    where = f"{computer.board}, {computer.machine}, {computer.cores} cores"
    short = " ".join(
        f"{name} {middle:.2f}/{slow:.2f}/{paced_middle:.2f}/{paced_slow:.2f} ms"
        for name, (middle, slow), (paced_middle, paced_slow) in zip(
            ("detect", "filter", "whole"), _figures(fast), _figures(paced), strict=True
        )
    )
    return [
        f"computer   {where}; {computer.software}",
        f"filter     {uncompiled() or 'compiled'}",
        f"drive      {KIND}, 640x480, {fast.corners:.0f} corners a frame",
        f"full speed {fast.frames_a_second:.0f} frames a second on one core; {_stage_times(fast)}",
        f"{CAMERA_HZ} a second {paced.share_of_a_core:.1%} of a core; {_stage_times(paced)}",
        "",
        f"lcf-edge {__version__} {compiled} | {where} | {computer.software} | {fast.corners:.0f} corners | "
        f"{fast.frames_a_second:.0f} frames/s | {short} | {paced.share_of_a_core:.1%} of a core at {CAMERA_HZ}/s",
    ]


def _figures(measured: Measured) -> list[tuple[float, float]]:
    """Return a line with median and 99th percentile of each stage."""
    middle, slow = np.percentile(measured.stages_ms, (50, 99), axis=0)
    return [*zip(middle.tolist(), slow.tolist(), strict=True)]


def _stage_times(measured: Measured) -> str:
    stages = ", ".join(
        f"{name} {middle:.2f} / {slow:.2f}"
        for name, (middle, slow) in zip(("detect", "filter", "whole"), _figures(measured), strict=True)
    )
    return f"{stages} ms (median / 99 %)"
