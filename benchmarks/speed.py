"""Speed and memory: the filter and its peers on the same frames in turn, one thread, for several corner counts.

Since they take turns, a noisy machine disturbs all methods alike; what counts is the ratio on each frame.
"""

import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks import memory, session, stages
from benchmarks.methods import FILTER, NAMES, NOTHING
from benchmarks.peers.peer import Floats, Grey
from benchmarks.playing import config_of, play_drive
from benchmarks.report import Table, number
from lcf_edge.config import Config, Filter, Memory
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.lens import Lens
from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import Drive, Paint

CORNERS = (300, 700, 1500, 4000)
TYPICAL = 700
FOLLOWING = "calcOpticalFlowPyrLK alone"
FINDING = "FastFeatureDetector alone"
_WARM_UP = 20
_MIN_EDGES = 1500


@dataclass(frozen=True, slots=True)
class Times:
    """Of one method at one corner count, µs, one a frame."""

    median: float
    p99: float
    over_filter: float  # median of the ratios to the filter on the same frame


@dataclass(frozen=True, slots=True)
class Row:
    """One corner count."""

    wanted: int
    corners: float  # median of what was found
    steps: dict[str, Times]  # detect, filter, total of the filter
    methods: dict[str, Times]  # totals of the peers


@dataclass(slots=True)
class Speed:
    """All measurements."""

    rows: list[Row] = field(default_factory=list)
    filter_steps: list[stages.Stage] = field(default_factory=list)
    frame_parts: list[stages.Stage] = field(default_factory=list)
    daemon: session.Session | None = None
    processes: list[memory.Memory] = field(default_factory=list)


def measure(into: Speed, *, quick: bool = False) -> Iterable[str]:
    """All corner counts, then memory. Return the name of each step that is done."""
    seconds = 2.0 if quick else 8.0
    for corners in CORNERS:
        drive = _busy(scenes.make("crossing", 0, seconds=seconds))
        into.rows.append(_row(drive, corners))
        yield f"{corners} corners"
    config = config_for(scenes.make("crossing", 0), TYPICAL)
    into.filter_steps += stages.measure(_busy(scenes.make("crossing", 0, seconds=seconds)), config)
    into.frame_parts += stages.measure_frame(scenes.make("two_crossing", 1, seconds=seconds), config)
    yield "stages"
    into.daemon = session.measure(10.0 if quick else 60.0)
    yield "session"
    frames = memory.WARM_UP + memory.STEPS
    with tempfile.TemporaryDirectory() as folder:
        path = scenes.write(scenes.make("crossing", 0, seconds=frames / 20), Path(folder))
        for name in (NOTHING, FILTER) if quick else (NOTHING, *NAMES):
            into.processes.append(memory.measure(name, path, config))
            yield f"memory of {name}"


def config_for(drive: Drive, corners: int) -> Config:
    """Return a configuration that finds about ``corners`` corners, with tables that hold them."""
    edges = max(corners, _MIN_EDGES)
    return config_of(drive, Filter(corners_target=corners), Memory(corners=corners, edges_normal=edges))


def _busy(drive: Drive) -> Drive:
    """Return the drive with finer, stronger textures, so that there are enough corners."""

    def finer(paint: Paint) -> Paint:
        return replace(paint, feature_m=0.4 * paint.feature_m, contrast=1.5 * paint.contrast)

    boxes = tuple(replace(box, paint=finer(box.paint)) for box in drive.boxes)
    return replace(drive, ground=finer(drive.ground), boxes=boxes)


def _row(drive: Drive, corners: int) -> Row:
    config = config_for(drive, corners)
    lens = Lens.from_config(config.camera, drive.lens.width, drive.lens.height)
    detector = CornerDetector(config.filter, lens, config.memory.corners)
    fast = cv2.FastFeatureDetector.create()
    times: dict[str, list[float]] = {"detect": [], "filter": [], "total": [], FINDING: [], FOLLOWING: []}
    times |= {name: [] for name in NAMES if name != FILTER}
    counts: list[int] = []
    before: tuple[Grey, Floats] | None = None
    for moment in play_drive(drive, config, NAMES):
        image = moment.frame.image
        if before is not None:
            times[FOLLOWING].append(_lucas_kanade_us(*before, image))
        fast.setThreshold(detector.threshold)
        times[FINDING].append(_fast_us(fast, image))
        before = image, detector.detect(image)[0].pixel.astype(np.float32)
        if moment.frame.seq < _WARM_UP:
            times[FOLLOWING].clear()
            times[FINDING].clear()
            continue
        for name, scene in moment.scenes.items():
            if name != FILTER:
                times[name].append(scene.timing.total)
        timing, sizes = moment.scenes[FILTER].timing, moment.scenes[FILTER].sizes
        for step in ("detect", "filter", "total"):
            times[step].append(getattr(timing, step))
        counts.append(sizes.corners)
    total = np.array(times["total"], np.float64)
    found = {name: _times(np.array(each, np.float64), total) for name, each in times.items()}
    steps = {name: found.pop(name) for name in ("detect", "filter", "total")}
    return Row(corners, float(np.median(counts)), steps, found)


def _lucas_kanade_us(before: Grey, points: Floats, image: Grey) -> float:
    started = time.perf_counter_ns()
    cv2.calcOpticalFlowPyrLK(before, image, points[:, None], np.empty(0, np.float32))
    return (time.perf_counter_ns() - started) / 1000


def _fast_us(fast: cv2.FastFeatureDetector, image: Grey) -> float:
    started = time.perf_counter_ns()
    fast.detect(image)
    return (time.perf_counter_ns() - started) / 1000


def _times(each: "np.ndarray", total: "np.ndarray") -> Times:
    ratios = each / np.maximum(total, 1)
    return Times(float(np.median(each)), float(np.percentile(each, 99)), float(np.median(ratios)))


def tables(speed: Speed) -> list[Table]:
    """Times of the filter, of the others, of the filter's steps; memory."""
    parts = ("detect", "filter", "total")
    own = [
        [str(row.wanted), number(row.corners, 0), *(_milliseconds(row.steps[part]) for part in parts)]
        for row in speed.rows
    ]
    names = [*dict.fromkeys(name for row in speed.rows for name in row.methods)]
    others = [
        [name, *(f"{_milliseconds(row.methods[name])}, {row.methods[name].over_filter:.1f}×" for row in speed.rows)]
        for name in names
    ]
    steps, parts_of_frame = (
        [
            [each.name, number(each.median / 1000, 3), f"{each.share:.0%}"]
            for each in sorted(those, key=lambda each: -each.median)
        ]
        for those in (speed.filter_steps, speed.frame_parts)
    )
    memories = [[each.method, number(each.peak_mib, 1), number(each.kept_bytes_a_step, 0)] for each in speed.processes]
    return [
        Table("The filter, ms: median (p99)", ["corners wanted", "found", *parts], own),
        Table(
            "The others on the same frames, ms: median (p99), times the filter's total",
            ["method", *(f"{row.wanted} corners" for row in speed.rows)],
            others,
        ),
        Table(f"Where the filter's time goes at {TYPICAL} corners, ms: medians", ["step", "ms", "share"], steps),
        Table("Where the time of a frame of the daemon goes, ms: medians", ["part", "ms", "share"], parts_of_frame),
        *(session.tables(speed.daemon) if speed.daemon else ()),
        Table("Memory of a process", ["method", "peak MiB", "bytes a step that stay"], memories),
    ]


def _milliseconds(times: Times) -> str:
    return f"{times.median / 1000:.2f} ({times.p99 / 1000:.2f})"
