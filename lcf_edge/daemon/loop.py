"""The pipeline's thread: takes the newest frame and its inertial samples, and delivers the scene."""

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.daemon.clock import StoppableClock, SystemTime
from lcf_edge.daemon.degrade import Degradation
from lcf_edge.daemon.lenses import lens_for
from lcf_edge.daemon.link import Link
from lcf_edge.daemon.log import LOGGER
from lcf_edge.daemon.mailbox import Newest, SampleRing
from lcf_edge.daemon.outputs import Outputs
from lcf_edge.ego_motion.estimator import IMU_CAPACITY, SPEED_CAPACITY
from lcf_edge.ego_motion.gyro_bias import GyroBias
from lcf_edge.filter.line_circle_filter import Mounting
from lcf_edge.filter.rolling_shutter import RollingShutter
from lcf_edge.messages import PipelineScene
from lcf_edge.meters import DurationHistogram
from lcf_edge.pipeline import Pipeline

FRAME_WAIT_S = 0.25  # then the loop goes round without a frame
IMU_WAIT_S = 4e-3  # for the first sample after a frame; without it the last one is held
TRIALS = 4  # images to try out a new pipeline
CLUTTER_PX = 16
IMU_SILENT_NS = 50_000_000  # an IMU silent for longer is not waited for


@dataclass(frozen=True, slots=True)
class Mail:
    """Queues from the devices' threads to the pipeline's."""

    frames: Newest[Frame] = field(default_factory=Newest)
    imu: SampleRing[ImuSample] = field(default_factory=lambda: SampleRing(IMU_CAPACITY))
    speeds: SampleRing[SpeedSample] = field(default_factory=lambda: SampleRing(SPEED_CAPACITY))


def try_out(pipeline: Pipeline, width: int, height: int) -> None:
    """Let a pipeline process some images of moving clutter, to see whether it works."""
    across, down = -(-width // CLUTTER_PX) + TRIALS, -(-height // CLUTTER_PX)
    clutter = _scattered(down * across).reshape(down, across)
    image = clutter.repeat(CLUTTER_PX, axis=0).repeat(CLUTTER_PX, axis=1)
    for seq in range(TRIALS):
        left = seq * CLUTTER_PX // 2
        pipeline.process(Frame(seq * 50_000_000, seq, np.ascontiguousarray(image[:height, left : left + width])))
        pipeline.view()


def _scattered(number: int) -> npt.NDArray[np.uint8]:
    """Return random grey levels; NumPy's generator would be loaded at a reload, when descriptors may be short."""
    mixed = np.arange(number, dtype=np.uint32) * np.uint32(2654435761)
    mixed = (mixed ^ (mixed >> np.uint32(15))) * np.uint32(2246822519)
    return (mixed >> np.uint32(24)).astype(np.uint8)


class Loop(threading.Thread):
    """Goes round for each frame, or after ``FRAME_WAIT_S`` without one, until ``clock`` is stopped.

    For other threads to read: ``turns`` (its progress), ``frames`` (that became scenes), ``scene`` (the last),
    ``evicted``, ``latency`` (from the frame's stamp until the first of ``outputs`` has its scene), of which ``detect``
    and ``filter`` are parts, and ``degradation``. ``first_scene`` is called once. Raises ``ConfigError`` for images
    that the configured lens does not fit.
    """

    def __init__(
        self,
        config: Config,
        mail: Mail,
        link: Link,
        outputs: Outputs,
        clock: StoppableClock,
        system_time: SystemTime,
        first_scene: Callable[[], object],
    ) -> None:
        super().__init__(name="pipeline", daemon=True)
        self.turns = 0
        self.frames = 0
        self.scene: PipelineScene | None = None
        self.evicted = 0
        self.latency, self.detect, self.filter = DurationHistogram(), DurationHistogram(), DurationHistogram()
        self.degradation = Degradation(config)
        self._config = config
        self._pipeline: Pipeline | None = None  # made for the size of the first frame
        self._shape: tuple[int, int] | None = None  # of the images that the pipeline is for
        self._next: tuple[Config, Pipeline, tuple[int, int]] | None = None
        self._refused_before: Counter[str] = Counter()  # counted by earlier pipelines
        self._mail = mail
        self._link = link
        self._outputs = outputs
        self._clock = clock
        self._system_time = system_time
        self._first_scene = first_scene

    @property
    def refused(self) -> Counter[str]:
        """IMU and speed samples that were not used, by reason."""
        pipeline = self._pipeline
        return self._refused_before + Counter(dict(pipeline.refused) if pipeline else {})

    @property
    def gyro_bias(self) -> GyroBias | None:
        """The gyro's bias as estimated so far; None before the first frame."""
        return self._pipeline.gyro_bias if self._pipeline else None

    @property
    def mounting(self) -> Mounting | None:
        """The camera's mounting as learnt so far; None before the first frame."""
        return self._pipeline.mounting if self._pipeline else None

    @property
    def shutter(self) -> RollingShutter | None:
        """What is known of a rolling shutter; None before the first frame."""
        return self._pipeline.shutter if self._pipeline else None

    def rebuild(self, config: Config) -> None:
        """Use a new pipeline with empty tables from the next frame on, after trying out another like it.

        If it raises, the old one stays in use. Raises ``LcfError``.
        """
        height, width = shape = self._shape or (config.camera.height, config.camera.width)
        lens = lens_for(config, width, height)
        try_out(Pipeline(config, lens), width, height)
        self._next = config, Pipeline(config, lens), shape  # meanwhile the images may have become others

    def run(self) -> None:
        """Process frames until stopped."""
        while not self._clock.stopped:
            self._turn(self._mail.frames.take(FRAME_WAIT_S))
            self.turns += 1

    def wake(self) -> None:
        """Make ``run`` notice a stop at once."""
        self._mail.frames.close()

    def _turn(self, frame: Frame | None) -> None:
        step_ns = self._system_time.notice()
        if step_ns:
            LOGGER.warning("clock: the system clock was set by %+.3f s; stamps follow", step_ns / 1e9)
        if frame is None:
            if self._pipeline is not None:
                self._feed(self._pipeline)
            return
        pipeline = self._pipeline_for(frame)
        imu_by_s = time.monotonic() + IMU_WAIT_S
        look = pipeline.look(frame)  # meanwhile the IMU's next sample arrives
        self._await_imu(frame, imu_by_s)
        self._feed(pipeline)
        scene = pipeline.follow(look)
        scene = replace(scene, stamp_ns=self._system_time.system_ns(frame.stamp_ns))
        delivered_ns = self._outputs.put(frame, scene, pipeline.view)
        self.latency.add((delivered_ns - frame.stamp_ns) / 1e9)
        self.detect.add(scene.timing.detect / 1e6)
        self.filter.add(scene.timing.filter / 1e6)
        self.scene = scene
        self.frames += 1
        self.evicted += scene.sizes.evicted
        if self.frames == 1:
            self._first_scene()
        self.degradation.add(frame, scene)

    def _pipeline_for(self, frame: Frame) -> Pipeline:
        """Return the pipeline in use, or a new one: after ``rebuild``, or when the images have another size."""
        height, width = frame.image.shape
        pipeline = self._pipeline
        if self._next is not None:
            (self._config, pipeline, self._shape), self._next = self._next, None
        if pipeline is None or (height, width) != self._shape:
            pipeline = Pipeline(self._config, lens_for(self._config, width, height))
            self._shape = height, width
        if pipeline is not self._pipeline:
            self._refused_before = self.refused
            self._pipeline = pipeline
            self.degradation = Degradation(self._config)
        return pipeline

    def _await_imu(self, frame: Frame, until_s: float) -> None:
        offset_ns = round(self._config.imu.time_offset_s * 1e9)
        wait_s = max(until_s - time.monotonic(), 0.0)
        self._mail.imu.wait_until(frame.stamp_ns - offset_ns, wait_s, IMU_SILENT_NS)

    def _feed(self, pipeline: Pipeline) -> None:
        received = (
            replace(speed, stamp_ns=self._system_time.monotonic_ns(speed.stamp_ns))
            for _, speed in self._link.take_speeds()
        )
        samples: Iterable[ImuSample | SpeedSample] = chain(self._mail.imu.take(), self._mail.speeds.take(), received)
        for sample in samples:
            pipeline.add(sample)
            self._outputs.put_sample(sample)
