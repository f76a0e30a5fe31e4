"""Circle expert, C_n: normal edges that go together by direction, speed and place become circles."""

import math
from dataclasses import dataclass

import numpy as np

from lcf_edge.config import Filter
from lcf_edge.filter.circles import Ids, Members, blend, claim, give_birth, release
from lcf_edge.filter.edge_equations import change_trust, update_position
from lcf_edge.filter.flow import wrap
from lcf_edge.filter.rebel_detection import miss
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, EdgeTable, Floats, Mask, Rows

SPEED_NOISE_PX = 0.6  # 1 sigma of an edge's V, times t_f
PASSING_WIDTHS = 2.0  # half widths of the vehicle, beside its path
DEPTH_SPREAD = 0.5  # edges of one circle differ in expansion by no more than this share
SLOWEST_OCTAVE = -6  # expansions below 2**-6 1/s are all as good as none
OCTAVES = 16
CELLS = 32  # a side, of BS_λ each


@dataclass(frozen=True, slots=True)
class Flowing:
    """Trusted normal edges, (k,) each: rows of the table, L in px, r (px from O), direction of flow, V/r in 1/s."""

    rows: Rows
    x: Floats
    y: Floats
    r: Floats
    cos: Floats
    sin: Floats
    expansion: Floats

    def take(self, rows: Rows) -> "Flowing":
        """Some of them."""
        columns = (self.x, self.y, self.r, self.cos, self.sin, self.expansion)
        return Flowing(self.rows.take(rows), *(column.take(rows) for column in columns))


class NormalCircles:
    """Groups normal edges into circles (C_n) and keeps the circles from frame to frame."""

    def __init__(self, settings: Filter, ids: Ids) -> None:
        self._settings = settings
        self._ids = ids
        self._dt_s = 1.0

    def predict(self, circles: CircleTable, focus: tuple[float, float], dt_s: float) -> None:
        """C'_n: what stands still goes out from the focus and grows, both at the rate of its expansion."""
        self._dt_s = dt_s
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
        off_path_m = np.abs(miss(right_m, range_m, around))
        beside_m = np.minimum(np.abs(right_m), off_path_m) - circles.radius / focal * range_m  # a turn may end
        return np.asarray((circles.expansion > 0) & (beside_m > PASSING_WIDTHS * around.half_width_m))

    def update(self, edges: EdgeTable, circles: CircleTable, around: Situation, ignored: Mask) -> int:
        """C_n from E_n (eqs. EdgeEncompare, EdgeCirclenormalcompare, percentinvolve); answers evictions.

        ``ignored``: bool (capacity,), circles under an active ψ, which are only predicted.
        """
        focus = around.focus
        flowing = self._flowing(edges, around)
        owner, involved = self._involve(flowing, edges.circle.take(flowing.rows), circles, ignored)
        edges.circle[flowing.rows] = owner
        self._compare(flowing, owner, involved, circles, ignored)
        self._direct(circles, focus)
        circles.active &= circles.trust >= self._settings.tr_cr
        release(edges, circles, rebel=False)
        left = (edges.circle.take(flowing.rows) == NO_CIRCLE).nonzero()[0]
        evicted = self._found(edges, circles, flowing.take(left), focus)
        self._direct(circles, focus)
        return evicted

    def _flowing(self, edges: EdgeTable, around: Situation) -> Flowing:
        """The edges that may be grouped; eq. EdgeEncompare's |V_e| ≤ ε_V·V_ν is held to the depth of the scene."""
        settings, n, focus = self._settings, edges.count, around.focus
        free = (edges.trust[:n] >= settings.tr_s) & ~(edges.own_way() | edges.held[:n])
        rows = free.nonzero()[0]
        x, y, speed = edges.x.take(rows), edges.y.take(rows), edges.speed.take(rows)
        dx, dy = x - np.float32(focus[0]), y - np.float32(focus[1])
        r = np.maximum(np.sqrt(dx * dx + dy * dy), np.float32(1))
        flowing = Flowing(rows, x, y, r, dx / r, dy / r, speed / r)
        fastest = settings.eps_v * around.scene_flow_pxps / around.pinhole.focal
        bounded = np.abs(speed) <= np.float32(fastest) * r + np.float32(SPEED_NOISE_PX / self._dt_s)
        return flowing if bounded.all() else flowing.take(bounded.nonzero()[0])

    def _involve(self, flowing: Flowing, owner: Rows, circles: CircleTable, ignored: Mask) -> tuple[Rows, Mask]:
        """Circle of each edge, -1: none; and the circles that most of their edges still lie in (percentinvolve)."""
        capacity = circles.capacity
        had = (owner >= 0).nonzero()[0]
        members, kept = flowing.take(had), owner.take(had)
        before = np.bincount(kept, minlength=capacity)
        fits, inside = self._fits(members, kept, circles)
        included = np.bincount(kept[inside], minlength=capacity)
        owner[had[~fits]] = NO_CIRCLE
        loose, open_circles = (owner == NO_CIRCLE).nonzero()[0], (circles.active & ~ignored).nonzero()[0]
        if len(loose) and len(open_circles):
            alone = flowing.take(loose)
            away = np.square(alone.x[:, None] - circles.x.take(open_circles))
            away += np.square(alone.y[:, None] - circles.y.take(open_circles))
            nearest = open_circles.take(away.argmin(axis=1))
            fits, inside = self._fits(alone, nearest, circles)
            joins = fits & inside
            owner[loose[joins]] = nearest[joins]
        return owner, included >= self._settings.involvement * np.maximum(before, 1)

    def _fits(self, flowing: Flowing, owner: Rows, circles: CircleTable) -> tuple[Mask, Mask]:
        """Whether each edge agrees with its circle in direction, speed and place (EdgeEncompare); and lies inside."""
        settings = self._settings
        dx, dy = flowing.x - circles.x.take(owner), flowing.y - circles.y.take(owner)
        away2 = dx * dx + dy * dy
        inside = np.sqrt(away2) < (circles.radius * np.float32(1.5) + 4).take(owner)
        beta = circles.beta
        along = flowing.cos * np.cos(beta).take(owner) + flowing.sin * np.sin(beta).take(owner)
        centre = circles.expansion.take(owner)
        slack = np.float32(DEPTH_SPREAD) * np.abs(centre) + np.float32(SPEED_NOISE_PX / self._dt_s) / flowing.r
        fits = (away2 < np.float32(settings.bs_px**2)) & (along > np.float32(math.cos(settings.eps_beta_rad)))
        fits &= circles.active.take(owner)
        return fits & (np.abs(flowing.expansion - centre) < slack), inside

    def _compare(self, flowing: Flowing, owner: Rows, involved: Mask, circles: CircleTable, ignored: Mask) -> None:
        """Groups against circles: aligned Tr +1; deviated but well included, updated and Tr -1; unmatched Tr -1."""
        settings = self._settings
        member = (owner >= 0).nonzero()[0]
        edges = flowing.take(member)
        members = Members(owner.take(member), circles.capacity, edges.x, edges.y)
        mean_cos, mean_sin = members.mean(edges.cos), members.mean(edges.sin)
        live = circles.active & ~ignored
        updated = live & involved & (members.size >= settings.circle_support)
        turn = np.abs(wrap(np.arctan2(mean_sin, mean_cos) - circles.beta))
        mean_expansion = members.mean(edges.expansion)
        like = np.abs(mean_expansion) <= 10 * settings.eps_v * np.abs(circles.expansion)
        aligned = updated & like & (turn < settings.eps_beta_rad / 5)
        rows = updated.nonzero()[0]
        circles.expansion[rows] = update_position(
            circles.trust[rows], settings.tr_cr, circles.expansion[rows], mean_expansion[rows]
        )
        blend(circles, rows, members, rows, settings)
        circles.corr[rows] = np.hypot(mean_cos, mean_sin)[rows]
        change = np.where(aligned, np.float32(1), np.float32(-1))
        circles.trust[live] = change_trust(circles.trust, change, settings.tr_max)[live]

    def _direct(self, circles: CircleTable, focus: tuple[float, float]) -> None:
        """β and V of normal circles follow from their place and expansion."""
        dx, dy = circles.x - np.float32(focus[0]), circles.y - np.float32(focus[1])
        circles.beta[:] = np.arctan2(dy, dx)
        circles.speed[:] = circles.expansion * np.sqrt(dx * dx + dy * dy)

    def _found(self, edges: EdgeTable, circles: CircleTable, left: Flowing, focus: tuple[float, float]) -> int:
        """New circles from the edges that are left: those of one cell of the picture and one octave of expansion."""
        settings = self._settings
        size = np.float32(settings.bs_px)
        u = np.floor((left.x - np.float32(focus[0])) / size).astype(np.int64)
        v = np.floor((left.y - np.float32(focus[1])) / size).astype(np.int64)
        octave = np.rint(np.log2(np.maximum(np.abs(left.expansion), np.float32(2.0**SLOWEST_OCTAVE))))
        key = ((v + CELLS // 2) % CELLS * CELLS + (u + CELLS // 2) % CELLS) * OCTAVES
        key += np.minimum(octave.astype(np.int32) - SLOWEST_OCTAVE, OCTAVES - 1)
        count = np.bincount(key, minlength=CELLS * CELLS * OCTAVES)
        big = (count >= settings.circle_support).nonzero()[0]
        if not len(big):
            return 0
        big = big[np.argsort(-count[big], kind="stable")]
        places, evicted = claim(edges, circles, len(big), settings, rebel=False)
        number = np.full(len(count), NO_CIRCLE)
        number[big[: len(places)]] = np.arange(len(places))
        group = number[key]
        chosen = (group >= 0).nonzero()[0]
        born, group = left.take(chosen), group.take(chosen)
        members = Members(group, len(places), born.x, born.y)
        give_birth(circles, places, members, np.arange(len(places)), settings, self._ids)
        circles.expansion[places] = members.mean(born.expansion)
        edges.circle[born.rows] = places[group]
        return evicted
