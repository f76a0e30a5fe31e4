"""How well rebel circles and ψ regions agree with the truth of a drive.

A rebel circle with enough trust hits an object when its centre lies in the object's box, grown on each side
by a quarter of the box's size and 8 px. A target is a threat in sight; it counts once it has been in sight
for the grace time, and never in the first moments of a drive.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from lcf_edge.messages import Kind, Scene, Shape
from lcf_edge.rendered.truth import ObjectTruth, Truth

_GROWN_SHARE, _GROWN_PX = 0.25, 8.0
_TTC_BELOW_S = 4.0
_PSI_SHARE = 0.2  # of a target's box under one ψ region
_SAMPLES = (np.arange(32) + 0.5) / 32  # of a box, per axis


@dataclass(frozen=True, slots=True)
class Score:
    """Counts over the frames of one or more drives; a ratio is NaN if its denominator is 0."""

    frames: int = 0
    hits: int = 0  # counted targets with a circle, one a frame
    misses: int = 0  # counted targets without
    false_circles: int = 0  # on no threat and on nothing that moves
    mover_circles: int = 0  # on something that moves and is no threat
    quiet_frames: int = 0  # nothing threatens
    quiet_false_circles: int = 0
    psi_on_threat_frames: int = 0
    targets: int = 0
    targets_never_hit: int = 0
    corners: int = 0
    corners_omitted: int = 0
    latencies_s: tuple[float, ...] = ()  # per target that was hit: from threat in sight to the first hit
    ttc_errors: tuple[float, ...] = ()  # relative, per circle on a target with a time to contact below 4 s

    @property
    def recall(self) -> float:
        return _ratio(self.hits, self.hits + self.misses)

    @property
    def precision(self) -> float:
        return _ratio(self.hits, self.hits + self.false_circles)

    @property
    def f1(self) -> float:
        return _ratio(2 * self.hits, 2 * self.hits + self.misses + self.false_circles)

    @property
    def strict_f1(self) -> float:
        """F1 where circles on what moves but does not threaten are false."""
        return _ratio(2 * self.hits, 2 * self.hits + self.misses + self.false_circles + self.mover_circles)

    @property
    def latency_s(self) -> float:
        """Median."""
        return _median(self.latencies_s)

    @property
    def ttc_error(self) -> float:
        """Median, relative."""
        return _median(self.ttc_errors)

    @property
    def false_per_quiet_frame(self) -> float:
        return _ratio(self.quiet_false_circles, self.quiet_frames)

    @property
    def omitted_share(self) -> float:
        """Share of the corners that ψ saved."""
        return _ratio(self.corners_omitted, self.corners)


def pool(scores: Iterable[Score]) -> Score:
    """One score over several drives: counts and lists are put together."""
    several = list(scores)
    if not several:
        return Score()
    rows = ([getattr(score, field.name) for score in several] for field in fields(Score))
    return Score(*(sum(row, start=type(row[0])()) for row in rows))


def score(
    results: Sequence[Scene],
    truths: Sequence[Truth],
    *,
    grace_s: float = 0.3,
    settle_s: float = 0.5,
    min_trust: float = 3.0,
) -> Score:
    """Compare a drive's results with its truth.

    Matched by stamp; an image without a result counts as one without circles. `grace_s`: a target counts
    when it has been in sight this long; `settle_s`: nothing counts before; `min_trust`: circles below are
    left out. Raises ValueError when a result has a stamp that the truth does not know.
    """
    scenes = {scene.stamp_ns: scene for scene in results}
    unknown = scenes.keys() - {truth.stamp_ns for truth in truths}
    if unknown:
        raise ValueError(f"results: no truth for the image at {min(unknown)} ns; another drive's truth?")
    in_sight_since: dict[int, int] = {}
    waiting: dict[int, int] = {}  # targets not hit yet, stamp of their beginning
    counted: set[int] = set()  # targets that have counted at least once
    latencies: dict[int, float] = {}
    ttc_errors: list[float] = []
    count = dict.fromkeys((field.name for field in fields(Score) if field.type is int), 0)

    for truth in truths:
        scene = scenes.get(truth.stamp_ns)
        circles = _rebels(scene, min_trust)
        in_sight_since = {
            thing.id: in_sight_since.get(thing.id, truth.stamp_ns) for thing in truth.objects if thing.in_sight
        }
        on = {thing.id: _on(circles, thing) for thing in truth.objects}
        for thing in truth.objects:
            if thing.target and thing.id not in latencies:
                begun = waiting.setdefault(thing.id, truth.stamp_ns)
                if on[thing.id].any():
                    latencies[thing.id] = (truth.stamp_ns - begun) * 1e-9
        if (truth.stamp_ns - truths[0].stamp_ns) * 1e-9 < settle_s:
            continue

        count["frames"] += 1
        on_threat, on_mover = np.zeros((2, len(circles)), dtype=bool)
        for thing in truth.objects:
            on_threat |= on[thing.id] & thing.threat
            on_mover |= on[thing.id] & thing.moving
            if not thing.target or (truth.stamp_ns - in_sight_since[thing.id]) * 1e-9 < grace_s:
                continue
            counted.add(thing.id)
            hit = bool(on[thing.id].any())
            count["hits" if hit else "misses"] += 1
            if thing.ttc_s < _TTC_BELOW_S:
                ttc = circles["ttc"][on[thing.id]]
                ttc_errors += (np.abs(ttc[np.isfinite(ttc)] - thing.ttc_s) / thing.ttc_s).tolist()
        false = int(np.count_nonzero(~on_threat & ~on_mover))
        count["false_circles"] += false
        count["mover_circles"] += int(np.count_nonzero(on_mover & ~on_threat))
        if not any(thing.threat for thing in truth.objects):
            count["quiet_frames"] += 1
            count["quiet_false_circles"] += false
        if scene is not None:
            covered = any(_covers(scene.psi, thing) for thing in truth.objects if thing.target)
            count["psi_on_threat_frames"] += covered
            count["corners"] += scene.sizes.corners
            count["corners_omitted"] += scene.sizes.omitted

    count["targets"] = len(counted)
    count["targets_never_hit"] = len(counted - latencies.keys())
    hit_after = tuple(delay for target, delay in latencies.items() if target in counted)
    return Score(**count, latencies_s=hit_after, ttc_errors=tuple(ttc_errors))


def _rebels(scene: Scene | None, min_trust: float) -> npt.NDArray[np.void]:
    if scene is None:
        return np.zeros(0, dtype=[("x", "<f4"), ("y", "<f4"), ("ttc", "<f4")])
    circles = scene.circles
    rebels: npt.NDArray[np.void] = circles[(circles["kind"] == Kind.REBEL) & (circles["trust"] >= min_trust)]
    return rebels


def _on(circles: npt.NDArray[np.void], thing: ObjectTruth) -> npt.NDArray[np.bool_]:
    """Return which circles' centres lie in the grown box."""
    x, y, width, height = thing.box
    across, along = _GROWN_SHARE * width + _GROWN_PX, _GROWN_SHARE * height + _GROWN_PX
    inside: npt.NDArray[np.bool_] = (
        (circles["x"] >= x - across)
        & (circles["x"] <= x + width + across)
        & (circles["y"] >= y - along)
        & (circles["y"] <= y + height + along)
    )
    return inside


def _covers(psi: npt.NDArray[np.void], thing: ObjectTruth) -> bool:
    """Whether one ψ region holds the middle of the box or more than a fifth of its area."""
    x, y, width, height = thing.box
    columns, rows = (
        np.append(x + width * _SAMPLES, x + width / 2),
        np.append(y + height * _SAMPLES, y + height / 2),
    )
    for region in psi:
        right = (columns - region["x"]) / (region["width"] / 2)
        down = (rows - region["y"]) / (region["height"] / 2)
        if region["shape"] == Shape.CIRCLE:
            inside = right**2 + down[:, None] ** 2 <= 1
        else:
            inside = (np.abs(right) <= 1) & (np.abs(down[:, None]) <= 1)
        if inside[-1, -1] or inside[:-1, :-1].mean() > _PSI_SHARE:
            return True
    return False


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole else math.nan


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else math.nan
