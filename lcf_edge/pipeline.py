"""One frame in, one scene out: corners, ego-motion, filter; live and replay alike."""

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge import scene_records
from lcf_edge.config import Config
from lcf_edge.corners import own_parts
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.corners.image_quality import ImageQuality
from lcf_edge.corners.lens_dirt import LensDirt
from lcf_edge.corners.repeats import Repeats
from lcf_edge.ego_motion.estimator import IMU_CAPACITY, SPEED_CAPACITY, EgoMotion, EgoMotionEstimator
from lcf_edge.ego_motion.gyro_bias import GyroBias
from lcf_edge.ego_motion.image_rotation import ImageRotation, Turn
from lcf_edge.ego_motion.stillness import Stillness
from lcf_edge.errors import ConfigError
from lcf_edge.filter import LineCircleFilter
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.inputs import NO_CORNERS, Corners
from lcf_edge.filter.line_circle_filter import Mounting
from lcf_edge.filter.normal_circles import mean_expansion
from lcf_edge.filter.rolling_shutter import RollingShutter
from lcf_edge.filter.tables import Floats
from lcf_edge.lens import Lens
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Kind, PipelineScene, Timing, View
from lcf_edge.scene_records import Records
from lcf_edge.small_image import SmallImage

if TYPE_CHECKING:  # the daemon reads none, and importing their formats takes megabytes
    from lcf_edge.recording.read import Recording

MIN_RANGE_M = 0.1
_AGREEING_SHARE = 0.8  # of the edges found by the predicted rotation, which that of the image must find
_MIN_CORNERS = 15  # fewer cannot contradict a rotation of the image, which must show more than a plain surface
_ALIKE_PX = 3.0  # in the middle of the image: rotations nearer than that find the same edges
NO_IMAGE = np.zeros((0, 0), np.uint8)

Rows = np.ndarray[Any, np.dtype[np.void]]


@dataclass(frozen=True, slots=True)
class Look:
    """What a frame shows without inertial samples: corners, image quality, stillness.

    ``repeats``: the last scene, if the frame repeats its image.
    """

    frame: Frame
    small: npt.NDArray[np.uint8]  # the downscaled image
    corners: Corners
    cut: int  # corners dropped because the budget was full
    notes: tuple[str, ...]
    still: bool | None  # whether the image has been still for half a second; None: unknown
    detect_ns: int  # time for the corners
    took_ns: int  # total time
    repeats: PipelineScene | None = None


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of one frame, and a view of its making, valid until the next frame."""

    scene: PipelineScene
    view: Callable[[], View]


class Pipeline:
    """Corners, ego-motion and ``filter`` for one camera. Its output positions are px of the input frame.

    Raises ``ConfigError`` when the tables alone need more than ``memory.budget_mib``.
    """

    def __init__(self, config: Config, lens: Lens) -> None:
        self._config = config
        self._lens = lens
        visible = own_parts.in_sight(config.camera, lens.width, lens.height)
        self._detector = CornerDetector(config.filter, lens, config.memory.corners, visible)
        self._own_parts = own_parts.polygons(config.camera, lens.width, lens.height)
        self._quality = ImageQuality()
        self._dirt = LensDirt(lens, visible)
        self._repeats = Repeats()
        self._scene: PipelineScene | None = None  # of the last new image
        self._speed_mps = math.nan  # of the last frame
        self._motion = EgoMotionEstimator(config.imu, config.vehicle)
        self._small_image = SmallImage(lens.width, lens.height)
        self._image_rotation = ImageRotation(lens)
        self._stillness = Stillness(lens.width, lens.height)
        self._lost = False  # the last step had too few edges to measure the rotation
        self.filter = LineCircleFilter(config, lens)
        memory, self._plane = config.memory, ImagePlane(lens)
        self._circle_records = Records(memory.circles_rebel + memory.circles_normal, CIRCLE)
        self._object_records, self._psi_records = Records(memory.objects, OBJECT), Records(memory.psi, PSI_REGION)
        self._last_corners = NO_CORNERS, np.empty(0, np.bool_)  # of the last frame: corners, and which ψ omitted
        self._refuse_excess(config.memory.budget_mib)

    def _refuse_excess(self, budget_mib: float) -> None:
        tables = self.table_bytes()
        needed_mib = sum(tables.values()) / 2**20
        if needed_mib > budget_mib:
            name, size = max(tables.items(), key=lambda table: table[1])
            raise ConfigError(
                f"memory.budget_mib: the tables need {needed_mib:.2f} MiB, the budget is {budget_mib:g}; "
                f"most goes to {name} ({size / 2**20:.2f}): lower the other keys of memory, or take smaller "
                "images"
            )

    def table_bytes(self) -> dict[str, int]:
        """Bytes of each preallocated table."""
        lens = {"lens": 8 * self._lens.width * self._lens.height} if self._lens.is_distorted else {}
        return {**self.filter.table_bytes(), **lens}

    @property
    def refused(self) -> Counter[str]:
        """IMU and speed samples that were not used, by reason."""
        return self._motion.refused

    @property
    def gyro_bias(self) -> GyroBias:
        """The gyro's bias as estimated so far."""
        return self._motion.bias

    @property
    def mounting(self) -> Mounting:
        """The camera's mounting as learnt so far."""
        return self.filter.mounting

    @property
    def shutter(self) -> RollingShutter:
        """What is known of a rolling shutter."""
        return self.filter.shutter

    def add(self, sample: ImuSample | SpeedSample) -> None:
        """Take an inertial sample or a speed, each kind in stamp order."""
        if isinstance(sample, ImuSample):
            self._motion.add_imu(sample)
        else:
            self._motion.add_speed(sample)

    def process(self, frame: Frame) -> PipelineScene:
        """Run the filter on one frame."""
        return self.follow(self.look(frame))

    def look(self, frame: Frame) -> Look:
        """Do the part of ``process`` that needs no samples; ``follow`` does the rest, and comes next."""
        started = time.perf_counter_ns()
        if self._repeats.is_repeat(frame.stamp_ns, frame.image):
            took_ns = time.perf_counter_ns() - started
            return Look(frame, NO_IMAGE, NO_CORNERS, 0, (), None, 0, took_ns, self._scene)
        corners, cut = self._detector.detect(frame.image, self._highest_row(), self.filter.focus[1])
        detect_ns = time.perf_counter_ns() - started
        notes = self._quality.notes(frame.image, len(corners))
        still = self._stillness.look(frame.stamp_ns, corners.pixel)
        small = self._small_image.of(frame.image)
        return Look(frame, small, corners, cut, notes, still, detect_ns, time.perf_counter_ns() - started)

    def follow(self, look: Look) -> PipelineScene:
        """Return the scene of the frame that ``look`` took, with the samples added since."""
        if look.repeats is not None:
            return _repeated(look.repeats, look)
        started = time.perf_counter_ns()
        frame, corners = look.frame, look.corners
        ego = self._see_rotation(look, self._motion.advance(frame.stamp_ns, look.still))
        before = time.perf_counter_ns()
        self._dirt.look(look.small, ego.rotation, look.still)
        if self._dirt.is_seen:
            corners = corners.of(self._dirt.shows_world(corners.pixel))
        step = self.filter.step(corners, ego.to_motion(), frame.image, look.small, self._dirt.hidden)
        self._lost = step.residual is None
        self._motion.see_ground(self.filter.ground)
        self._motion.see_driving(self.filter.drives)
        if step.residual is not None:
            self._motion.correct(
                step.residual.turn_rad, step.residual.sigma_rad, mean_expansion(self.filter.normal.columns)
            )
        filtered = time.perf_counter_ns()
        (circles, circle_objects), objects, psi = self._circles(), self._objects(), self._psi()
        notes = [*ego.notes, *look.notes]
        if self.filter.stands:
            notes.append("stands still")
        if self._dirt.is_seen:
            notes.append("dirty lens")
        if self.shutter.matters:
            notes.append("rolling shutter")
        if self.filter.floor.is_glossy:
            notes.append("glossy floor")
        sizes = replace(step.sizes, evicted=step.sizes.evicted + look.cut) if look.cut else step.sizes
        done = time.perf_counter_ns()
        self._last_corners = corners, step.omitted
        self._speed_mps = ego.speed_mps
        self._scene = PipelineScene(
            stamp_ns=frame.stamp_ns,
            seq=frame.seq,
            image_width=self._lens.width,
            image_height=self._lens.height,
            vehicle_speed=ego.speed_mps,
            circles=circles,
            psi=psi,
            sizes=sizes,
            timing=Timing(
                detect=look.detect_ns // 1000,
                filter=(filtered - before) // 1000,
                total=(look.took_ns + done - started) // 1000,
            ),
            notes=tuple(notes),
            objects=objects,
            circle_objects=circle_objects,
        )
        return self._scene

    def _highest_row(self) -> float:
        """Return the row, px, above which nothing within the horizon is low enough to be hit; NaN: unknown."""
        vehicle, camera = self._config.vehicle, self._config.camera
        farthest_m = max(abs(self._speed_mps) * vehicle.horizon_s, MIN_RANGE_M)
        return self.filter.focus[1] - self._lens.fy * max(vehicle.height_m - camera.height_m, 0.0) / farthest_m

    def _see_rotation(self, look: Look, ego: EgoMotion) -> EgoMotion:
        """Return the motion, with the rotation from the image where the gyro's is uncertain."""
        if not self._lost and not self._motion.needs_image_rotation(self._image_rotation.sigma_rad):
            self._image_rotation.forget()
            return ego
        turn = self._image_rotation.turn(look.small)
        if turn is None or not self._corners_agree(look.corners, ego, turn):
            return ego
        return self._motion.add_image_rotation(turn.turn_rad, turn.sigma_rad)

    def _corners_agree(self, corners: Corners, ego: EgoMotion, turn: Turn) -> bool:
        """Whether the rotation of the image explains the corners about as well as the predicted one, or better.

        What is near and fills the image moves it as a rotation would. Without trusted edges, as in the beginning,
        there are no grounds to contradict; without corners, no rotation is to be seen.
        """
        if len(corners) < _MIN_CORNERS:
            return False
        apart_x, apart_y, _ = self._lens.fx * (turn.rotation - ego.rotation)[:, 2]
        if math.hypot(apart_x, apart_y) < _ALIKE_PX:
            return True
        predicted = self.filter.found_share(corners, ego.rotation, ego.dt_s)
        return not self.filter.found_share(corners, turn.rotation, ego.dt_s) < _AGREEING_SHARE * predicted

    def _circles(self) -> tuple[Rows, npt.NDArray[np.uint32]]:
        """Return the circles from Tr_s up, rebels first, and the object id of each, 0: none."""
        records, least = self._circle_records, self._config.filter.tr_s
        records.count = 0
        objects = self.filter.objects.columns
        for kind, table in ((Kind.REBEL, self.filter.rebel), (Kind.NORMAL, self.filter.normal)):
            scene_records.add_circles(records, table.columns, objects, kind, self._plane, least)
        return records.written(), records.written_owners()

    def _objects(self) -> Rows:
        """Return the objects from Tr_s up."""
        records = self._object_records
        records.count = 0
        least = self._config.filter.tr_s
        scene_records.add_objects(records, self.filter.objects.columns, self._plane, least)
        return records.written()

    def _psi(self) -> Rows:
        records = self._psi_records
        records.count = 0
        scene_records.add_psi(records, self.filter.psi.columns, self._plane)
        return records.written()

    def view(self) -> View:
        """Return what led to the last scene, for drawing."""
        corners, omitted = self._last_corners
        edges, n, groups = self.filter.edges, self.filter.edges.count, self.filter.groups
        rebel = edges.rebel[:n]
        place = self._lens.distort(_points(edges.x[:n], edges.y[:n]))
        g = groups.count
        centres = self._lens.distort(_points(groups.x[:g], groups.y[:g]))
        focus = self._lens.distort(np.array([self.filter.focus], np.float32))[0]
        return View(
            corners=corners.pixel.astype(np.float32),
            omitted=omitted,
            edges=place[~rebel],
            rebels=place[rebel],
            groups=np.concatenate([centres, _points(groups.bs[:g])], axis=1),
            edge_group=groups.assign(edges.x[:n][~rebel], edges.y[:n][~rebel]).astype(np.intp),
            focus=focus,
            own_parts=self._own_parts,
        )


def _repeated(scene: PipelineScene, look: Look) -> PipelineScene:
    """Return the scene of a repeated image: the last one, with contacts nearer by the time passed."""
    passed_s = (look.frame.stamp_ns - scene.stamp_ns) / 1e9
    return replace(
        scene,
        stamp_ns=look.frame.stamp_ns,
        seq=look.frame.seq,
        circles=_nearer(scene.circles, passed_s),
        objects=_nearer(scene.objects, passed_s),
        timing=Timing(detect=0, filter=0, total=look.took_ns // 1000),
        notes=(*scene.notes, "repeated picture"),
    )


def _nearer(rows: Rows, passed_s: float) -> Rows:
    """Return the same circles or objects ``passed_s`` later."""
    rows = rows.copy()
    for name in {"ttc", "closest"}.intersection(rows.dtype.names or ()):
        rows[name] = np.maximum(rows[name] - np.float32(passed_s), 0)
    return rows


def _points(*coordinates: Floats) -> npt.NDArray[np.float32]:
    """Stack coordinates, (n,) each, as (n, 2)."""
    return np.stack(coordinates, axis=1).astype(np.float32)


def lens_of(recording: "Recording", config: Config, width: int, height: int) -> Lens | None:
    """Return the calibrated lens for an image size: configured, else the recording's own; None: unknown."""
    if config.camera.intrinsics:
        return Lens.from_config(config.camera, width, height)
    return recording.lens and recording.lens.scaled(width, height)


def run(
    recording: "Recording", config: Config, take: Callable[[ImuSample | SpeedSample], None] | None = None
) -> Iterator[tuple[Frame, Outcome]]:
    """Feed a recording through the pipeline. Yield each frame with its outcome; ``take`` gets each sample.

    At the end the samples that the pipeline refused are added to ``recording.skipped``. Raises ``RecordingError``,
    ``ConfigError``.
    """
    pipeline: Pipeline | None = None
    waiting: deque[ImuSample | SpeedSample] = deque(maxlen=IMU_CAPACITY + SPEED_CAPACITY)
    for event in recording:
        if isinstance(event, Frame):
            if pipeline is None:
                height, width = event.image.shape
                lens = lens_of(recording, config, width, height) or Lens.from_config(config.camera, width, height)
                pipeline = Pipeline(config, lens)
                for sample in waiting:
                    pipeline.add(sample)
                waiting.clear()
            yield event, Outcome(pipeline.process(event), pipeline.view)
            continue
        if take is not None:
            take(event)
        if pipeline is None:
            waiting.append(event)
        else:
            pipeline.add(event)
    if pipeline is not None:
        recording.skipped.update(pipeline.refused)
