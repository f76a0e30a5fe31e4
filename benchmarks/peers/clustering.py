"""Points that break the flow become circles: linked by position and motion, and trusted over time."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.peers.ego import Ego, warp
from benchmarks.peers.peer import Circles, Floats, Mask, Rows
from benchmarks.peers.residual import Residual
from lcf_edge.messages import CIRCLE, Cause, Kind

_MAX_POINTS = 500  # that are linked; all pairs are compared
_LOOMS_PER_S = 1.0  # velocities within an object may differ by this times their distance
_VELOCITY_NOISE_PXPS = 20.0
_VELOCITY_SIGMA_PXPS = 5.0
_MIN_RADIUS_PX = 6.0
_MAX_RADIUS_PX = 64.0
_NEWBORN, _SHOWN_FROM, _SHOWN_TO, _MAX_TRUST = 2.5, 3.0, 2.0, 5.0


@dataclass(frozen=True, slots=True)
class Clusters:
    """Objects of one image; (k,) each."""

    x: Floats  # px
    y: Floats
    radius: Floats
    vx: Floats  # px/s
    vy: Floats
    support: Rows
    threat: Mask  # stationary, in the path
    ttc_s: Floats
    range_m: Floats
    lateral_m: Floats

    def __len__(self) -> int:
        return len(self.x)


def cluster(points: Residual, *, least: int, link_px: float, share: float) -> Clusters:
    """Link the movers and threats among ``points``.

    ``least``: points that make a cluster; ``link_px``: between neighbours; ``share``: of all points about there
    that break the flow with it.
    """
    flagged = np.flatnonzero(points.mover | points.threat)
    if len(flagged) > _MAX_POINTS:
        flagged = flagged[np.linspace(0, len(flagged) - 1, _MAX_POINTS).astype(np.intp)]
    x, y, vx, vy = (column[flagged] for column in (points.x, points.y, points.vx, points.vy))
    label = _linked(x, y, vx, vy, points.threat[flagged], link_px)
    _, label, size = np.unique(label, return_inverse=True, return_counts=True)
    count = np.maximum(size, 1).astype(np.float32)

    def mean(values: npt.NDArray[np.generic]) -> Floats:
        return (np.bincount(label, values, minlength=len(size)) / count).astype(np.float32)

    cx, cy, cvx, cvy = mean(x), mean(y), mean(vx), mean(vy)
    dx, dy = x - cx[label], y - cy[label]
    spread = mean(dx * dx + dy * dy)
    down = points.down_then[flagged]
    lever = np.maximum(mean(down * down), 1)
    growth = mean(down * vy) / lever  # for motion along the ground, its vertical motion gives Z'/Z
    radius = np.clip(1.5 * np.sqrt(spread), _MIN_RADIUS_PX, _MAX_RADIUS_PX).astype(np.float32)
    threat = mean(points.threat[flagged]) >= 0.5
    sigma = _VELOCITY_SIGMA_PXPS / np.sqrt(lever * count)
    grown_ttc = np.where(growth > 2 * sigma, 1 / np.maximum(growth, 1e-3), np.inf)
    ttc = np.where(threat, _medians(label, points.ttc_s[flagged], len(size)), grown_ttc)
    around = np.hypot(points.x[:, None] - cx, points.y[:, None] - cy) < radius
    crowd = np.maximum(np.count_nonzero(around, axis=0), 1)
    ours = np.count_nonzero(around[flagged], axis=0)
    keep = (size >= least) & (ours >= share * crowd)
    return Clusters(
        cx[keep],
        cy[keep],
        radius[keep],
        cvx[keep],
        cvy[keep],
        size[keep],
        threat[keep],
        ttc[keep].astype(np.float32),
        mean(points.range_m[flagged])[keep],
        mean(points.lateral_m[flagged])[keep],
    )


def _medians(label: Rows, values: Floats, groups: int) -> Floats:
    """Median of each group."""
    order = np.lexsort((values, label))
    sizes = np.bincount(label, minlength=groups)
    middle = np.cumsum(sizes) - sizes + sizes // 2
    medians: Floats = values[order][middle]
    return medians


def _linked(x: Floats, y: Floats, vx: Floats, vy: Floats, threat: Mask, link_px: float) -> Rows:
    """A label for each point, the same for all that are linked by neighbours that move alike."""
    distance = np.hypot(x[:, None] - x, y[:, None] - y)
    difference = np.hypot(vx[:, None] - vx, vy[:, None] - vy)
    speed = np.hypot(vx, vy)
    alike = difference < _VELOCITY_NOISE_PXPS + _LOOMS_PER_S * distance + 0.25 * np.maximum(speed[:, None], speed)
    linked = (distance < link_px) & (alike | (threat[:, None] & threat))
    label = np.arange(len(x))
    while len(x):
        lowest = np.where(linked, label, len(x)).min(axis=1)
        lowest = lowest[lowest]
        if np.array_equal(lowest, label):
            break
        label = lowest
    return label


class TrustedCircles:
    """Circles over time: a circle is published from trust 3 until it falls below 2."""

    def __init__(self, capacity: int = 32) -> None:
        self._table = np.zeros(capacity, CIRCLE)
        self._velocity = np.zeros((capacity, 2), np.float32)
        self._trust = np.zeros(capacity, np.float32)
        self._shown = np.zeros(capacity, np.bool_)
        self._alive = np.zeros(capacity, np.bool_)
        self._next_id = 1

    @property
    def none(self) -> Circles:
        """Nothing."""
        return self._table[:0]

    def update(self, found: Clusters, ego: Ego) -> Circles:
        """Account for one image's clusters. Return the circles that are shown."""
        table, dt = self._table, np.float32(ego.last.dt_s)
        h = ego.last_homography().astype(np.float32).ravel()
        table["x"], table["y"] = warp(h, table["x"], table["y"])
        table["x"] += self._velocity[:, 0] * dt
        table["y"] += self._velocity[:, 1] * dt
        table["ttc"] -= dt
        updated = np.zeros(len(table), np.bool_)
        left = np.arange(len(found))
        row, what = self._pairs(found)
        if len(row):
            self._trust[row] = np.minimum(self._trust[row] + np.float32(1), np.float32(_MAX_TRUST))
            self._fill(row, found, what)
            updated[row] = True
            left = np.setdiff1d(left, what)
        free = np.flatnonzero(~self._alive)[: len(left)]
        left = left[np.argsort(-found.support[left], kind="stable")][: len(free)]
        table["ttc"][free] = np.inf
        self._fill(free, found, left)
        table["id"][free] = self._next_id + np.arange(len(free))
        self._next_id += len(free)
        self._trust[free], self._shown[free], self._alive[free], updated[free] = _NEWBORN, False, True, True
        missed = self._alive & ~updated
        self._trust[missed] -= np.float32(1)
        outside = (table["x"] < 0) | (table["y"] < 0) | (table["x"] >= ego.lens.width) | (table["y"] >= ego.lens.height)
        self._alive &= (self._trust >= _SHOWN_TO) & ~outside
        for name in ("x", "y"):
            table[name][~self._alive] = 0  # an empty row that is moved on for minutes would overflow
        self._velocity[~self._alive] = 0
        self._shown = (self._shown | (self._trust >= _SHOWN_FROM)) & self._alive
        table["trust"] = np.maximum(self._trust, _SHOWN_FROM)
        answer = table[self._shown]
        place = ego.lens.distort(np.stack([answer["x"], answer["y"]], axis=1))
        answer["x"], answer["y"] = place[:, 0], place[:, 1]
        return answer

    def _pairs(self, found: Clusters) -> tuple[Rows, Rows]:
        """Rows of the table and clusters that are the same thing, nearest first, one to one."""
        table = self._table
        distance = np.hypot(table["x"][:, None] - found.x, table["y"][:, None] - found.y)
        reach = np.maximum(table["radius"][:, None], found.radius) + np.float32(10)
        distance = np.where(self._alive[:, None] & (distance < reach), distance, np.float32(np.inf))
        rows, whats = [], []
        for _ in range(min(distance.shape)):
            row, what = np.unravel_index(np.argmin(distance), distance.shape)
            if not np.isfinite(distance[row, what]):
                break
            rows.append(row)
            whats.append(what)
            distance[row], distance[:, what] = np.inf, np.inf
        return np.array(rows, np.intp), np.array(whats, np.intp)

    def _fill(self, row: Rows, found: Clusters, what: Rows) -> None:
        table = self._table
        table["kind"][row] = Kind.REBEL
        for name in ("x", "y", "radius"):
            table[name][row] = getattr(found, name)[what]
        self._velocity[row, 0], self._velocity[row, 1] = found.vx[what], found.vy[what]
        table["speed"][row] = np.hypot(found.vx[what], found.vy[what])
        table["direction"][row] = np.arctan2(found.vy[what], found.vx[what])
        table["support"][row] = found.support[what]
        table["cause"][row] = np.where(found.threat[what], Cause.INCOMING, Cause.CROSSING)
        before, now = 1 / table["ttc"][row], 1 / found.ttc_s[what]
        rate = np.where(before > 0, 0.6 * before + 0.4 * now, now)
        with np.errstate(divide="ignore"):
            table["ttc"][row] = np.where(rate > 1e-3, 1 / rate, np.inf)
        table["range"][row], table["lateral"][row] = found.range_m[what], found.lateral_m[what]
        table["bearing"][row] = table["elevation"][row] = np.nan
