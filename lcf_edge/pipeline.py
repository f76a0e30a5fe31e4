"""One frame in, one scene out: corners, ego-motion, filter; live and replay alike."""

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from drivers.records import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.corners import CornerDetector
from lcf_edge.ego_motion import EgoMotionEstimator
from lcf_edge.filter import LineCircleFilter, Motion
from lcf_edge.lens import Lens
from lcf_edge.recordings import Recording
from lcf_edge.records import CIRCLE, PSI_REGION, Kind, Scene, Sizes, Timing, View

LEAST_DT_S = 1e-3


@dataclass(frozen=True, slots=True)
class Outcome:
    """What one frame gave."""

    scene: Scene
    view: View


class Pipeline:
    """Corners, ego-motion and filter for one camera. Positions that leave it are px of the input frame."""

    def __init__(self, config: Config, lens: Lens) -> None:
        self._config = config
        self._lens = lens
        self._detector = CornerDetector(config.filter, lens, config.memory.corners)
        self._motion = EgoMotionEstimator(config.imu, config.vehicle)
        self._filter = LineCircleFilter(config, lens)

    def table_bytes(self) -> dict[str, int]:
        """Bytes of each preallocated table."""
        return self._filter.table_bytes()

    def add_imu(self, sample: ImuSample) -> None:
        """Take an inertial sample, in stamp order."""
        self._motion.add_imu(sample)

    def add_speed(self, sample: SpeedSample) -> None:
        """Take a speed, in stamp order."""
        self._motion.add_speed(sample)

    def process(self, frame: Frame) -> Outcome:
        """Run the filter on one frame."""
        started = time.perf_counter_ns()
        corners, cut = self._detector.detect(frame.image)
        detected = time.perf_counter_ns()
        ego = self._motion.advance(frame.stamp_ns)
        motion = Motion(
            max(ego.dt_s, LEAST_DT_S), ego.rotation, ego.rotation_sigma_rad, ego.speed_mps, ego.path_yaw_rate_radps
        )
        before = time.perf_counter_ns()
        step = self._filter.step(corners, motion)
        filtered = time.perf_counter_ns()
        circles, psi = self._circles(), self._psi()
        notes = ego.notes if len(corners) else (*ego.notes, "no corners")
        sizes = step.sizes
        done = time.perf_counter_ns()
        scene = Scene(
            stamp_ns=frame.stamp_ns,
            seq=frame.seq,
            image_width=self._lens.width,
            image_height=self._lens.height,
            vehicle_speed=ego.speed_mps,
            circles=circles,
            psi=psi,
            sizes=Sizes(**{**{f: getattr(sizes, f) for f in sizes.__slots__}, "evicted": sizes.evicted + cut}),
            timing=Timing((detected - started) // 1000, (filtered - before) // 1000, (done - started) // 1000),
            notes=notes,
        )
        return Outcome(scene, self._view(corners.pixel.astype(np.float32), step.omitted))

    def _circles(self) -> "np.ndarray":
        parts = []
        for kind, table in ((Kind.REBEL, self._filter.rebel), (Kind.NORMAL, self._filter.normal)):
            rows = np.flatnonzero(table.active & (table.trust >= self._config.filter.tr_s))
            part = np.zeros(len(rows), CIRCLE)
            part["id"], part["kind"], part["cause"] = table.id[rows], kind, table.cause[rows]
            part["support"] = np.minimum(table.support[rows], 65535)
            place = self._lens.distort(np.stack([table.x[rows], table.y[rows]], axis=1))
            part["x"], part["y"] = place[:, 0], place[:, 1]
            part["radius"], part["direction"] = table.radius[rows], table.beta[rows]
            part["speed"], part["trust"] = table.speed[rows], table.trust[rows]
            bearing, elevation = self._lens.bearing(table.x[rows], table.y[rows])
            part["bearing"], part["elevation"] = bearing, elevation
            if kind is Kind.REBEL:
                part["ttc"], part["range"], part["lateral"] = table.ttc[rows], table.range[rows], table.lateral[rows]
            else:
                part["ttc"], part["range"], part["lateral"] = np.inf, np.nan, np.nan
            parts.append(part[np.isfinite(part["x"])])
        return np.concatenate(parts)

    def _psi(self) -> "np.ndarray":
        table = self._filter.psi
        rows = np.flatnonzero(table.active)
        part = np.zeros(len(rows), PSI_REGION)
        place = self._lens.distort(np.stack([table.x[rows], table.y[rows]], axis=1))
        part["id"], part["shape"], part["x"], part["y"] = table.id[rows], table.shape[rows], place[:, 0], place[:, 1]
        part["width"], part["height"], part["trust"] = table.width[rows], table.height[rows], table.trust[rows]
        return part[np.isfinite(part["x"])]

    def _view(self, pixel: "np.ndarray", omitted: "np.ndarray") -> View:
        edges, n, groups = self._filter.edges, self._filter.edges.count, self._filter.groups
        rebel = edges.rebel[:n]
        place = self._lens.distort(np.stack([edges.x[:n], edges.y[:n]], axis=1))
        centres = self._lens.distort(np.stack([groups.x, groups.y], axis=1))
        group_of = np.full(self._config.memory.circles_normal, -1)
        named = groups.row >= 0
        group_of[groups.row[named]] = np.flatnonzero(named)
        circle = edges.circle[:n][~rebel]
        focus = self._lens.distort(np.array([self._filter.focus], np.float32))[0]
        return View(
            corners=pixel,
            omitted=omitted,
            edges=place[~rebel],
            rebels=place[rebel],
            groups=np.concatenate([centres, groups.bs[:, None]], axis=1),
            edge_group=np.where(circle >= 0, group_of[np.maximum(circle, 0)], -1),
            focus=focus,
        )


def run(recording: Recording, config: Config) -> Iterator[tuple[Frame, Outcome]]:
    """Feed a recording through the pipeline; answers each frame with its outcome."""
    pipeline: Pipeline | None = None
    waiting: list[ImuSample | SpeedSample] = []
    for event in recording:
        if isinstance(event, Frame):
            if pipeline is None:
                height, width = event.image.shape
                use_own = recording.lens is not None and not config.camera.intrinsics
                lens = recording.lens if use_own else None
                lens = lens.scaled(width, height) if lens else Lens.from_config(config.camera, width, height)
                pipeline = Pipeline(config, lens)
                for sample in waiting:
                    (pipeline.add_imu if isinstance(sample, ImuSample) else pipeline.add_speed)(sample)
                waiting.clear()
            yield event, pipeline.process(event)
        elif pipeline is None:
            waiting.append(event)
        elif isinstance(event, ImuSample):
            pipeline.add_imu(event)
        else:
            pipeline.add_speed(event)

