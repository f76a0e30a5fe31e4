"""Circle expert, C_r: rebel edges that go together become circles with a cause and a time to contact."""

import math

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Filter
from lcf_edge.filter.circles import Ids, Members, blend, claim, give_birth, release
from lcf_edge.filter.edge_equations import change_trust, update_position
from lcf_edge.filter.flow import Pinhole, wrap
from lcf_edge.filter.matching import one_to_one
from lcf_edge.filter.rebel_detection import Rebels, miss
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, EdgeTable, Floats, Mask, Rows
from lcf_edge.records import Cause

VELOCITY_NOISE_PX = 4.0  # 1 sigma of a rebel's velocity, times the time over which it was seen
STILL_PX = 6.0  # circles that moved less over that time have no direction
LIKE_SPEED = 0.5  # rebels that go together differ in velocity by no more than this share
MEMBER_MARGIN_PX = 8.0
SIDEWAYS = 0.2  # what leads moves to the side with no more than this share of the vehicle's speed
LEAST_RANGE_M = 0.01
LEAST_RATE = 1e-6  # 1/s, slower expansions are none
# Times in shares of the horizon, so that what holds for a rover holds for a snail.
LOOMS = 4.0  # fastest expansion of one object, over one horizon
LINK_SHARE = 0.03  # rebels are linked over what the faster moves in this share of the horizon: what is near is large
COAST_SHARE = 0.25  # nearer contacts grow too fast to be followed corner by corner, and must not be forgotten
COAST_LEAST_PX = 40.0  # what is that near is not small
LEAST_TTC_SHARE = 0.0125


class RebelCircles:
    """Groups rebel edges into circles (C_r) and keeps the circles from frame to frame."""

    def __init__(self, settings: Filter, horizon_s: float, ids: Ids) -> None:
        self._settings = settings
        self._horizon_s = horizon_s
        self._least_ttc_s = np.float32(LEAST_TTC_SHARE * horizon_s)
        self._ids = ids

    def predict(self, circles: CircleTable, dt_s: float) -> None:
        """C'_r: with constant velocities in space the centre runs as a + b/τ, τ the time to contact, R as 1/τ.

        Without a time to contact, the centre goes on as it went.
        """
        dt = np.float32(dt_s)
        ttc = circles.ttc
        looming = np.isfinite(ttc) & (ttc > self._least_ttc_s) & circles.active
        tau = np.where(looming, ttc, np.float32(1e6))
        grow = np.minimum(tau / np.maximum(tau - dt, self._least_ttc_s), np.float32(1.5))
        step = circles.speed * dt * grow
        circles.x += step * np.cos(circles.beta)
        circles.y += step * np.sin(circles.beta)
        circles.speed *= grow * grow
        for size in (circles.radius, circles.width, circles.height):
            size[:] = np.where(looming, size * grow, size)
        circles.ttc -= dt

    def coasting(self, circles: CircleTable) -> Mask:
        """Trusted circles so near to contact that they grow too fast to be followed; bool (capacity,)."""
        near = np.abs(circles.ttc) < COAST_SHARE * self._horizon_s
        large = np.maximum(circles.width, circles.height) > np.float32(COAST_LEAST_PX)
        return circles.active & near & large & (circles.trust >= self._settings.tr_s)

    def innermost(self, circles: CircleTable, pinhole: Pinhole) -> tuple[Floats, Floats]:
        """The point of each circle that must leave the frame for the circle to end, px.

        What is about to be met fills the picture, and is not gone because its middle has left.
        """
        half = np.where(self.coasting(circles), np.float32(0.5), np.float32(0))
        most_x, most_y = half * circles.width, half * circles.height
        x = circles.x + np.clip(np.float32(pinhole.cx) - circles.x, -most_x, most_x)
        y = circles.y + np.clip(np.float32(pinhole.cy) - circles.y, -most_y, most_y)
        return x, y

    def motion_at(self, circles: CircleTable, x: Floats, y: Floats) -> tuple[npt.NDArray[np.intp], Floats, Floats]:
        """Circle that holds each point (-1: none) and the image velocity there, px/s: the circle's own plus looming.

        Only circles from Tr_s up speak for what is inside them.
        """
        rows = np.flatnonzero(circles.active & (circles.trust >= self._settings.tr_s))
        if not len(rows) or not len(x):
            none = np.zeros(len(x), np.float32)
            return np.full(len(x), NO_CIRCLE), none, none
        dx, dy = x[:, None] - circles.x[rows], y[:, None] - circles.y[rows]
        away = np.hypot(dx, dy) - circles.radius[rows] - np.float32(MEMBER_MARGIN_PX)
        nearest = np.argmin(away, axis=1)
        pick = np.arange(len(x))
        held = away[pick, nearest] < 0
        row = rows[nearest]
        rate = np.where(circles.ttc[row] > self._least_ttc_s, 1 / np.maximum(circles.ttc[row], self._least_ttc_s), 0)
        vx = circles.speed[row] * np.cos(circles.beta[row]) + rate * dx[pick, nearest]
        vy = circles.speed[row] * np.sin(circles.beta[row]) + rate * dy[pick, nearest]
        return np.where(held, row, NO_CIRCLE), vx.astype(np.float32), vy.astype(np.float32)

    def update(self, edges: EdgeTable, circles: CircleTable, rebels: Rebels | None, around: Situation) -> int:
        """C_r from E_r (eqs. EdgeErcompareER, EdgeCirclerebelcompareER, percentinvolve); answers evictions."""
        live = circles.active.nonzero()[0]
        if rebels is None and not len(live):
            return 0
        updated: Rows = np.empty(0, np.intp)
        evicted = 0
        if rebels is not None and len(rebels.rows):
            rebels, label, size = self._group(rebels, around)
            if len(size):
                updated, evicted = self._meet(edges, circles, rebels, label, size, around)
        was_updated = np.zeros(circles.capacity, np.bool_)
        was_updated[updated] = True
        missed = live[circles.active[live] & ~was_updated[live]]
        waits = self.coasting(circles)[missed] | self._hidden(circles, missed)
        circles.trust[missed[~waits]] -= 1
        circles.active &= (circles.ttc > 0) & (circles.trust >= self._settings.tr_cr)
        release(edges, circles, rebel=True)
        return evicted

    def _hidden(self, circles: CircleTable, rows: Rows) -> Mask:
        """Whether each circle lies behind another one that will be met earlier; bool (rows,)."""
        dx, dy = np.abs(circles.x[rows, None] - circles.x), np.abs(circles.y[rows, None] - circles.y)
        reach = circles.radius + np.float32(MEMBER_MARGIN_PX)
        covers = (dx < np.maximum(circles.width / 2, reach)) & (dy < np.maximum(circles.height / 2, reach))
        nearer = circles.active & (circles.trust >= self._settings.tr_s) & (circles.ttc < circles.ttc[rows, None])
        trusted = circles.trust[rows] >= self._settings.tr_s
        return np.asarray((covers & nearer).any(axis=1) & trusted & np.isfinite(circles.ttc[rows]))

    def _group(self, rebels: Rebels, around: Situation) -> tuple[Rebels, Rows, Rows]:
        """The rebels in groups with support, the group of each, and the groups' sizes."""
        label = link(rebels, self._settings, around)
        size = np.bincount(label)
        big = size >= self._settings.rebel_support
        number = np.where(big, np.cumsum(big) - 1, NO_CIRCLE).take(label)
        chosen = (number >= 0).nonzero()[0]
        return rebels.take(chosen), number.take(chosen), size[big]

    def _meet(
        self, edges: EdgeTable, circles: CircleTable, rebels: Rebels, label: Rows, size: Rows, around: Situation
    ) -> tuple[Rows, int]:
        """Groups update the circles that they are involved in, and found new ones; answers the rows and evictions."""
        settings = self._settings
        members = Members(label, len(size), rebels.x, rebels.y)
        vx, vy = members.mean(rebels.vx), members.mean(rebels.vy)
        beta, speed = np.arctan2(vy, vx), np.hypot(vx, vy)
        still = np.float32(STILL_PX) / members.mean(rebels.links.elapsed_s)
        radius = members.radius(settings.bs_px)
        odd = size < settings.rebel_share * (size + self._normal_inside(edges, members, radius))

        away = np.hypot(rebels.x[:, None] - circles.x, rebels.y[:, None] - circles.y)
        inside = circles.active & (away < circles.radius + np.float32(MEMBER_MARGIN_PX))
        row = involve(label, edges.circle[rebels.rows], inside, size, settings.involvement)
        row[odd] = NO_CIRCLE  # a few odd ones in a crowd that flows are mistakes, not an object
        known = np.flatnonzero(row >= 0)
        new = np.flatnonzero((row < 0) & ~odd)
        new = new[np.argsort(-size[new], kind="stable")]

        rows = row[known]
        turn = np.abs(wrap(beta[known] - circles.beta[rows]))
        like = speed[known] <= circles.speed[rows] + settings.eps_v_circle_rebel * around.scene_flow_pxps
        aligned = like & (turn < settings.eps_beta_circle_rebel_rad + np.arctan2(still[known], speed[known]))
        extents = circles.width[rows], circles.height[rows]
        blend(circles, rows, members, known, settings)
        self._remember_extents(circles, rows, *extents)
        change = np.where(aligned, np.float32(1), np.float32(-1))
        circles.trust[rows] = change_trust(circles.trust[rows], change, settings.tr_max)

        places, evicted = claim(edges, circles, len(new), settings, rebel=True)
        new = new[: len(places)]
        give_birth(circles, places, members, new, settings, self._ids)
        row[new] = places

        groups = np.concatenate([known, new])
        rows = row[groups]
        circles.beta[rows], circles.speed[rows] = beta[groups], speed[groups]
        self._contact(circles, rows, groups, rebels, members, around)
        edges.circle[rebels.rows] = row[label]
        return rows, evicted

    def _remember_extents(self, circles: CircleTable, rows: Rows, width: Floats, height: Floats) -> None:
        """An object shows ever other parts of itself: its extent grows at once and shrinks slowly."""
        for column, before in ((circles.width, width), (circles.height, height)):
            seen = column[rows]
            column[rows] = np.maximum(seen, update_position(circles.trust[rows], self._settings.tr_cr, before, seen))

    def _normal_inside(self, edges: EdgeTable, members: Members, radius: Floats) -> Rows:
        """Edges that were seen to follow the flow inside the circle of each group; int (groups,)."""
        n = edges.count
        flows = edges.matched[:n] & ~edges.rebel[:n] & (edges.links[:n] == 0) & (edges.trust[:n] > self._settings.tr_s)
        rows = np.flatnonzero(flows)
        away2 = np.square(edges.x[rows, None] - members.centre_x) + np.square(edges.y[rows, None] - members.centre_y)
        return np.asarray(np.count_nonzero(away2 < radius * radius, axis=0))

    def _contact(
        self, circles: CircleTable, rows: Rows, groups: Rows, rebels: Rebels, members: Members, around: Situation
    ) -> None:
        """Cause, time to contact, range and lateral miss of circles; ``groups``: the group of members of each.

        What stands still expands about the focus, what moves about the horizon: 1/TTC = V_e/r, fitted over the members.
        """
        links, verdict = rebels.links, rebels.verdict
        stands = members.mean(verdict.incoming)[groups] >= 0.5
        expanding = standing_expansion(rebels, members)[groups]
        range_m = members.mean(links.depth_m / links.elapsed_s)[groups] / np.maximum(expanding, LEAST_RATE)
        speed = around.speed_mps
        closing = max(speed, 0.0) / np.maximum(range_m, LEAST_RANGE_M) if math.isfinite(speed) else expanding
        rate = np.where(stands, closing, own_expansion(rebels, members, around.horizon_y)[groups])
        before = np.where(np.isfinite(circles.ttc[rows]), 1 / np.maximum(circles.ttc[rows], self._least_ttc_s), rate)
        rate = update_position(circles.trust[rows], self._settings.tr_cr, before, rate)
        ttc = np.where(rate > LEAST_RATE, 1 / np.maximum(rate, LEAST_RATE), np.inf)

        right = (circles.x[rows] - around.focus[0]) / around.pinhole.fx
        on_ground_m = around.ground_range_m(circles.y[rows] + 0.5 * circles.height[rows])
        drift = members.mean(rebels.vx)[groups] / around.pinhole.fx  # of its bearing, 1/s
        moving_miss = on_ground_m * drift * np.where(np.isfinite(ttc), ttc, np.nan)
        lateral = np.where(stands, miss(right * range_m, range_m, around), moving_miss)
        if not math.isfinite(speed):
            range_m, lateral = np.full_like(range_m, np.nan), np.full_like(lateral, np.nan)
        inwards = members.mean(verdict.mover & (verdict.short > np.abs(verdict.drift)))[groups] > 0.5
        inwards &= ~(np.abs(on_ground_m * drift) > SIDEWAYS * abs(speed))  # who walks in from the side crosses
        meets = stands | ((ttc < around.horizon_s) & ~(np.abs(lateral) > around.half_width_m))
        circles.cause[rows] = np.where(meets, Cause.INCOMING, np.where(inwards, Cause.LEADING, Cause.CROSSING))
        circles.ttc[rows], circles.lateral[rows] = ttc, lateral
        circles.range[rows] = np.where(stands, range_m, on_ground_m)


def standing_expansion(rebels: Rebels, members: Members) -> Floats:
    """V_e/r about the focus, 1/s, float32 (groups,): least squares over the members, so that far ones count more."""
    links = rebels.links
    weight = np.square(links.x - links.focus_x) + np.square(links.y - links.focus_y)
    return members.mean(rebels.verdict.expansion * weight) / np.maximum(members.mean(weight), 1)


def own_expansion(rebels: Rebels, members: Members, horizon_y: float) -> Floats:
    """V_e/r of what moves on the ground, 1/s, float32 (groups,); 0 where it is not above its noise.

    Fitted to the vertical motion about the horizon, at ``horizon_y`` px, which motion to the side does not touch.
    """
    below = rebels.links.y - np.float32(horizon_y)
    extent2 = np.maximum(members.mean(below * below), 1)
    rate = members.mean(below * rebels.vy) / extent2
    sigma = np.float32(VELOCITY_NOISE_PX) / members.mean(rebels.links.elapsed_s) / np.sqrt(extent2 * members.size)
    return np.where(rate > 2 * sigma, rate, 0).astype(np.float32)


def link(rebels: Rebels, settings: Filter, around: Situation) -> Rows:
    """Label of each rebel edge's group (eq. EdgeErcompareER, and by place); int (k,), k at most E_r's capacity.

    Two rebels are linked when they are near and move in the same direction with a like speed, or differ in velocity
    by no more than the parts of an object that grows in the picture do.
    """
    x, y, vx, vy = rebels.x, rebels.y, rebels.vx, rebels.vy
    distance = np.hypot(x[:, None] - x, y[:, None] - y)
    difference = np.hypot(vx[:, None] - vx, vy[:, None] - vy)
    noise = np.float32(VELOCITY_NOISE_PX) / rebels.links.elapsed_s
    speed = np.hypot(vx, vy)
    faster = np.maximum(speed[:, None], speed)
    along = vx[:, None] * vx + vy[:, None] * vy
    together = along > np.cos(settings.eps_beta_rebel_rad) * speed[:, None] * speed
    together &= difference < np.float32(LIKE_SPEED) * faster
    together &= faster <= np.minimum(speed[:, None], speed) + settings.eps_v_rebel * around.scene_flow_pxps
    looms = difference < noise[:, None] + noise + np.float32(LOOMS / around.horizon_s) * distance
    reach = np.maximum(np.float32(settings.rebel_link_px), np.float32(LINK_SHARE * around.horizon_s) * faster)
    linked = (distance < reach) & (together | looms)
    label = np.arange(len(x))
    while True:
        lowest = np.where(linked, label, len(x)).min(axis=1)
        lowest = lowest[lowest]
        if np.array_equal(lowest, label):
            return label
        label = lowest


def involve(
    label: npt.NDArray[np.intp],
    owner: npt.NDArray[np.int32],
    inside: npt.NDArray[np.bool_],
    size: npt.NDArray[np.intp],
    involvement: float,
) -> npt.NDArray[np.intp]:
    """Rebel circle of each group by share of involvement (eq. percentinvolve); int (groups,), -1: none.

    ``label``: group of each edge. ``owner``: circle that it belonged to, -1: none. ``inside``: bool (edges, circles).
    """
    capacity = inside.shape[1]
    belongs = inside | (owner[:, None] == np.arange(capacity))
    votes = np.zeros((len(size), capacity), np.float32)
    np.add.at(votes, label, belongs.astype(np.float32))
    group, circle = np.nonzero(votes >= np.maximum(involvement * size[:, None], 1))
    best = one_to_one(group, circle, -votes[group, circle], len(size), capacity)
    answer = np.full(len(size), NO_CIRCLE)
    answer[group[best]] = circle[best]
    return answer
