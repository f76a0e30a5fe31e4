"""Circle expert, C_n: normal edges that go together by direction, speed and place become circles."""

import math

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Filter
from lcf_edge.filter.circles import (
    EXTENT_SIGMAS,
    Ids,
    blend,
    claim,
    newborn_trust,
    radius_of,
    release,
)
from lcf_edge.filter.edge_equations import update_position
from lcf_edge.filter.flow import wrap
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, EdgeTable, Floats, Mask, Rows

SPEED_NOISE_PXPS = 12.0  # 1 sigma of an edge's V
PASSING_WIDTHS = 1.5  # half widths of the vehicle, beside its path
DEPTH_SPREAD = 0.5  # edges of one circle differ in expansion by no more than this share


class NormalCircles:
    """Groups normal edges into circles (C_n) and keeps the circles from frame to frame."""

    def __init__(self, settings: Filter) -> None:
        self._settings = settings
        self._tr_new = newborn_trust(settings)
        self._ids = Ids()

    def predict(self, circles: CircleTable, focus: tuple[float, float], dt_s: float) -> None:
        """C'_n: what stands still goes out from the focus and grows, both at the rate of its expansion."""
        growth = circles.expansion * np.float32(dt_s)
        circles.x += (circles.x - np.float32(focus[0])) * growth
        circles.y += (circles.y - np.float32(focus[1])) * growth
        circles.radius *= 1 + growth

    def passing_by(self, circles: CircleTable, around: Situation) -> Mask:
        """Circles that the vehicle passes at a distance; bool (capacity,). Nothing on the path may be ignored."""
        speed = around.speed_mps
        if not math.isfinite(speed) or speed <= 0:
            return np.zeros(circles.capacity, np.bool_)
        range_m = np.float32(speed) / np.maximum(circles.expansion, np.float32(1e-3))
        focal = np.float32(around.pinhole.fx)
        right_m = (circles.x - np.float32(around.focus[0])) / focal * range_m
        beside_m = np.abs(right_m) - circles.radius / focal * range_m
        return np.asarray((circles.expansion > 0) & (beside_m > PASSING_WIDTHS * around.half_width_m))

    def update(self, edges: EdgeTable, circles: CircleTable, focus: tuple[float, float], ignored: Mask) -> int:
        """C_n from E_n (eqs. EdgeEncompare, EdgeCirclenormalcompare, percentinvolve); answers evictions.

        ``focus``: O, px. ``ignored``: bool (capacity,), circles under an active ψ, which are only predicted.
        """
        settings = self._settings
        n = edges.count
        capacity = circles.capacity
        trusted = ~edges.rebel[:n] & ~edges.held[:n] & (edges.links[:n] == 0) & (edges.trust[:n] >= settings.tr_s)
        rows = np.flatnonzero(trusted)
        x, y = edges.x[rows], edges.y[rows]
        dx, dy = x - np.float32(focus[0]), y - np.float32(focus[1])
        r = np.maximum(np.hypot(dx, dy), np.float32(1))
        cos, sin = dx / r, dy / r
        expansion = edges.speed[rows] / r
        owner = edges.circle[rows]

        had = owner >= 0
        before = np.bincount(owner[had], minlength=capacity)
        fits, inside = self._fits(circles, np.maximum(owner, 0), x, y, cos, sin, r, expansion)
        included = np.bincount(owner[had & inside], minlength=capacity)
        owner = np.where(had & fits, owner, NO_CIRCLE)

        loose = np.flatnonzero(owner == NO_CIRCLE)
        candidates = np.flatnonzero(circles.active & ~ignored)
        if len(loose) and len(candidates):
            distance = np.square(x[loose, None] - circles.x[candidates]) + np.square(
                y[loose, None] - circles.y[candidates]
            )
            nearest = candidates[np.argmin(distance, axis=1)]
            fits, inside = self._fits(
                circles, nearest, x[loose], y[loose], cos[loose], sin[loose], r[loose], expansion[loose]
            )
            joins = fits & inside
            owner[loose[joins]] = nearest[joins]
        edges.circle[rows] = owner

        member = owner >= 0
        who = owner[member]
        support = np.bincount(who, minlength=capacity)
        safe = np.maximum(support, 1).astype(np.float32)

        def mean(values: Floats) -> Floats:
            return (np.bincount(who, values[member], minlength=capacity) / safe).astype(np.float32)

        mean_x, mean_y, mean_cos, mean_sin = mean(x), mean(y), mean(cos), mean(sin)
        mean_expansion = mean(expansion)
        spread = mean(np.square(x - mean_x[owner]) + np.square(y - mean_y[owner]))
        extent_x = np.sqrt(mean(np.square(x - mean_x[owner])))
        extent_y = np.sqrt(mean(np.square(y - mean_y[owner])))
        beta = np.arctan2(mean_sin, mean_cos)

        seen = circles.active & ~ignored & (support >= settings.circle_support)
        involved = included >= settings.involvement * np.maximum(before, 1)
        turn = np.abs(wrap(beta - circles.beta))
        aligned = seen & involved & (turn < settings.eps_beta_rad / 5)
        updated = seen & involved
        change = np.where(aligned, 1, -1)
        live = circles.active & ~ignored
        circles.expansion[updated] = update_position(
            circles.trust[updated], settings.tr_cr, circles.expansion[updated], mean_expansion[updated]
        )
        blend(
            circles,
            updated,
            settings,
            mean_x[updated],
            mean_y[updated],
            radius_of(spread[updated], settings.bs_px),
        )
        circles.trust[live] = np.minimum(circles.trust + change, settings.tr_max)[live]
        circles.corr[updated] = np.hypot(mean_cos, mean_sin)[updated]
        circles.width[updated], circles.height[updated] = (
            EXTENT_SIGMAS * extent_x[updated],
            EXTENT_SIGMAS * extent_y[updated],
        )
        circles.support[updated] = support[updated]
        self._direct(circles, focus)
        circles.active &= circles.trust >= settings.tr_cr
        release(edges, circles, rebel=False)

        evicted = self._found(edges, circles, rows, owner, x, y, expansion, focus)
        release(edges, circles, rebel=False)
        return evicted

    def _fits(
        self,
        circles: CircleTable,
        owner: Rows,
        x: Floats,
        y: Floats,
        cos: Floats,
        sin: Floats,
        r: Floats,
        expansion: Floats,
    ) -> tuple[Mask, Mask]:
        """Whether each edge agrees with its circle in direction, speed and place; and lies inside it."""
        settings = self._settings
        distance = np.hypot(x - circles.x[owner], y - circles.y[owner])
        inside = distance < circles.radius[owner] * np.float32(1.5) + 4
        along = cos * np.cos(circles.beta[owner]) + sin * np.sin(circles.beta[owner])
        centre = circles.expansion[owner]
        slack = np.float32(DEPTH_SPREAD) * np.abs(centre) + np.float32(SPEED_NOISE_PXPS) / r
        fits = (
            circles.active[owner]
            & (distance < settings.bs_px)
            & (along > np.cos(settings.eps_beta_rad))
            & (np.abs(expansion - centre) < slack)
        )
        return fits, inside

    def _direct(self, circles: CircleTable, focus: tuple[float, float]) -> None:
        """β and V of normal circles follow from their place and expansion."""
        dx, dy = circles.x - np.float32(focus[0]), circles.y - np.float32(focus[1])
        circles.beta[:] = np.arctan2(dy, dx)
        circles.speed[:] = circles.expansion * np.hypot(dx, dy)

    def _found(
        self,
        edges: EdgeTable,
        circles: CircleTable,
        rows: Rows,
        owner: npt.NDArray[np.int32],
        x: Floats,
        y: Floats,
        expansion: Floats,
        focus: tuple[float, float],
    ) -> int:
        """New circles from the edges that are left: those of one cell of the picture and one octave of expansion."""
        settings = self._settings
        left = np.flatnonzero(owner == NO_CIRCLE)
        if len(left) < settings.circle_support:
            return 0
        size = np.float32(settings.bs_px)
        u = np.floor((x[left] - np.float32(focus[0])) / size).astype(np.int64)
        v = np.floor((y[left] - np.float32(focus[1])) / size).astype(np.int64)
        octave = np.rint(np.log2(np.maximum(np.abs(expansion[left]), np.float32(2**-6)))).astype(np.int64)
        key = ((v + 512) * 1024 + (u + 512)) * 32 + octave + 8
        _, label = np.unique(key, return_inverse=True)
        size_of = np.bincount(label)
        big = size_of >= settings.circle_support
        if not big.any():
            return 0
        number = np.full(len(big), NO_CIRCLE)
        number[np.argsort(-size_of, kind="stable")[: int(big.sum())]] = np.arange(int(big.sum()))
        group = number[label]
        member = group >= 0
        left, group = left[member], group[member]
        places, evicted = claim(edges, circles, int(big.sum()), self._tr_new, rebel=False)
        kept = group < len(places)
        left, group = left[kept], group[kept]
        support = np.bincount(group, minlength=len(places)).astype(np.float32)

        def mean(values: Floats) -> Floats:
            return (np.bincount(group, values, minlength=len(places)) / support).astype(np.float32)

        cx, cy = mean(x[left]), mean(y[left])
        off_x, off_y = x[left] - cx[group], y[left] - cy[group]
        circles.x[places], circles.y[places] = cx, cy
        var_x, var_y = mean(off_x * off_x), mean(off_y * off_y)
        circles.radius[places] = radius_of(var_x + var_y, settings.bs_px)
        circles.width[places], circles.height[places] = (
            EXTENT_SIGMAS * np.sqrt(var_x),
            EXTENT_SIGMAS * np.sqrt(var_y),
        )
        circles.expansion[places] = mean(expansion[left])
        circles.trust[places] = self._tr_new
        circles.support[places] = support
        circles.corr[places] = 1
        circles.cause[places] = 0
        circles.ttc[places], circles.range[places], circles.lateral[places] = np.inf, np.nan, np.nan
        circles.id[places] = self._ids.take(len(places))
        self._direct(circles, focus)
        edges.circle[rows[left]] = places[group]
        return evicted
