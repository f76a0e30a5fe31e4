"""Circle expert, C_r: rebel edges that go together become circles with a cause and a time to contact."""

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Filter
from lcf_edge.filter.circles import EXTENT_SIGMAS, Ids, blend, claim, newborn_trust, radius_of, release
from lcf_edge.filter.edge_equations import update_position
from lcf_edge.filter.flow import wrap
from lcf_edge.filter.matching import one_to_one
from lcf_edge.filter.rebel_detection import Rebels, miss
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, EdgeTable, Floats, Mask, Rows
from lcf_edge.records import Cause

VELOCITY_NOISE_PXPS = 10.0  # 1 sigma of a rebel's velocity over its links
LOOMS_PER_S = 1.0  # fastest expansion of one object, 1/s
STILL_PXPS = 15.0  # slower circles have no direction
MEMBER_MARGIN_PX = 8.0
COAST_S = 1.0  # what is this near grows too fast to be followed corner by corner, and must not be forgotten
LEAST_TTC_S = 0.05


class RebelCircles:
    """Groups rebel edges into circles (C_r) and keeps the circles from frame to frame."""

    def __init__(self, settings: Filter) -> None:
        self._settings = settings
        self._tr_new = newborn_trust(settings)
        self._ids = Ids()

    def predict(self, circles: CircleTable, dt_s: float) -> None:
        """C'_r: with constant velocities in space the centre runs as a + b/τ, τ the time to contact, R as 1/τ.

        Without a time to contact, the centre goes on as it went.
        """
        dt = np.float32(dt_s)
        ttc = circles.ttc
        looming = np.isfinite(ttc) & (ttc > LEAST_TTC_S) & circles.active
        tau = np.where(looming, ttc, np.float32(1e6))
        grow = np.minimum(tau / np.maximum(tau - dt, np.float32(LEAST_TTC_S)), np.float32(1.5))
        step = circles.speed * dt * grow
        circles.x += step * np.cos(circles.beta)
        circles.y += step * np.sin(circles.beta)
        circles.speed *= grow * grow
        circles.radius[:] = np.where(looming, circles.radius * grow, circles.radius)
        circles.ttc -= dt

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
        rate = np.where(circles.ttc[row] > LEAST_TTC_S, 1 / np.maximum(circles.ttc[row], np.float32(LEAST_TTC_S)), 0)
        vx = circles.speed[row] * np.cos(circles.beta[row]) + rate * dx[pick, nearest]
        vy = circles.speed[row] * np.sin(circles.beta[row]) + rate * dy[pick, nearest]
        return np.where(held, row, NO_CIRCLE), vx.astype(np.float32), vy.astype(np.float32)

    def update(self, edges: EdgeTable, circles: CircleTable, rebels: Rebels | None, around: Situation) -> int:
        """C_r from E_r (eqs. EdgeErcompareER, EdgeCirclerebelcompareER, percentinvolve); answers evictions."""
        settings = self._settings
        live = circles.active.copy()
        updated = np.zeros(circles.capacity, np.bool_)
        evicted = 0
        if rebels is not None and len(rebels.rows):
            label, size = self._groups(rebels, edges.circle[rebels.rows], circles)
            if len(size):
                evicted = self._meet(edges, circles, rebels, label, size, around, updated)
        missed = live & circles.active & ~updated
        coasts = (circles.ttc < COAST_S) & (circles.ttc > -COAST_S) & (circles.trust >= settings.tr_s)
        circles.trust[missed & ~coasts] -= 1
        circles.active &= circles.ttc > 0
        circles.active &= circles.trust >= settings.tr_cr
        release(edges, circles, rebel=True)
        return evicted

    def _groups(
        self, rebels: Rebels, owner: npt.NDArray[np.int32], circles: CircleTable
    ) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Group of each rebel, -1 for those in groups without support; and the size of each group."""
        label = link(rebels.x, rebels.y, rebels.vx, rebels.vy, self._settings)
        _, label, size = np.unique(label, return_inverse=True, return_counts=True)
        big = size >= self._settings.rebel_support
        number = np.where(big, np.cumsum(big) - 1, NO_CIRCLE)
        return number[label], size[big]

    def _meet(
        self,
        edges: EdgeTable,
        circles: CircleTable,
        rebels: Rebels,
        label: npt.NDArray[np.intp],
        size: npt.NDArray[np.intp],
        around: Situation,
        updated: Mask,
    ) -> int:
        """Groups update the circles that they belong to, and found new ones."""
        settings = self._settings
        grouped = np.flatnonzero(label >= 0)
        label = label[grouped]
        x, y = rebels.x[grouped], rebels.y[grouped]
        vx, vy = rebels.vx[grouped], rebels.vy[grouped]
        count = size.astype(np.float32)

        def mean(values: Floats) -> Floats:
            return (np.bincount(label, values, minlength=len(size)) / count).astype(np.float32)

        cx, cy, cvx, cvy = mean(x), mean(y), mean(vx), mean(vy)
        dx, dy = x - cx[label], y - cy[label]
        spread = mean(dx * dx + dy * dy)
        radius = radius_of(spread, settings.bs_px)
        extent_x = np.sqrt(mean(dx * dx))
        extent_y = np.sqrt(mean(dy * dy))
        beta, speed = np.arctan2(cvy, cvx), np.hypot(cvx, cvy)
        crowded = size < settings.rebel_share * (size + self._normal_inside(edges, cx, cy, radius))

        active = np.flatnonzero(circles.active)
        distance = np.hypot(x[:, None] - circles.x, y[:, None] - circles.y)
        inside = circles.active & (distance < circles.radius + np.float32(MEMBER_MARGIN_PX))
        owner = edges.circle[rebels.rows[grouped]]
        circle_of = (
            involve(label, owner, inside, size, settings.involvement) if len(active) else np.full(len(size), NO_CIRCLE)
        )
        circle_of[crowded] = NO_CIRCLE  # a few odd ones in a crowd that flows are mistakes, not an object
        known = circle_of >= 0
        rows = circle_of[known]
        turn = np.abs(wrap(beta[known] - circles.beta[rows]))
        noise_angle = np.arctan2(np.float32(STILL_PXPS), speed[known])
        aligned = turn < settings.eps_beta_circle_rebel_rad + noise_angle
        blend(circles, rows, settings, cx[known], cy[known], radius[known])
        circles.trust[rows] = np.minimum(
            circles.trust[rows] + np.where(aligned, 1, -1).astype(np.float32), np.float32(settings.tr_max)
        )
        updated[rows] = True

        new = np.flatnonzero(~known & ~crowded)
        new = new[np.argsort(-size[new], kind="stable")]
        places, evicted = claim(edges, circles, len(new), self._tr_new, rebel=True)
        new = new[: len(places)]
        circles.x[places], circles.y[places], circles.radius[places] = cx[new], cy[new], radius[new]
        circles.trust[places] = self._tr_new
        circles.id[places] = self._ids.take(len(places))
        circles.ttc[places] = np.inf
        circles.corr[places] = 1
        updated[places] = True

        row_of = circle_of.copy()
        row_of[new] = places
        has = np.flatnonzero(row_of >= 0)
        rows = row_of[has]
        fresh = np.isin(rows, places)
        circles.support[rows] = size[has]
        circles.beta[rows], circles.speed[rows] = beta[has], speed[has]
        circles.width[rows] = EXTENT_SIGMAS * extent_x[has]
        circles.height[rows] = EXTENT_SIGMAS * extent_y[has]
        self._contact(circles, rows, fresh, rebels, grouped, label, has, around, mean)
        edges.circle[rebels.rows] = NO_CIRCLE
        edges.circle[rebels.rows[grouped]] = row_of[label]
        return evicted

    def _normal_inside(self, edges: EdgeTable, x: Floats, y: Floats, radius: Floats) -> npt.NDArray[np.intp]:
        """Edges that were seen to follow the flow inside each circle; int (groups,)."""
        n = edges.count
        rows = np.flatnonzero(edges.matched[:n] & ~edges.rebel[:n] & (edges.links[:n] == 0) & (edges.trust[:n] >= 4))
        away2 = np.square(edges.x[rows, None] - x) + np.square(edges.y[rows, None] - y)
        return np.count_nonzero(away2 < radius * radius, axis=0)

    def _contact(
        self,
        circles: CircleTable,
        rows: Rows,
        fresh: Mask,
        rebels: Rebels,
        grouped: Rows,
        label: npt.NDArray[np.intp],
        has: Rows,
        around: Situation,
        mean: object,
    ) -> None:
        """Cause, time to contact, range and lateral miss of each circle."""
        assert callable(mean)
        links, verdict = rebels.links, rebels.verdict
        elapsed = links.elapsed_s[grouped]
        x0, y0 = links.x[grouped], links.y[grouped]
        vx, vy = rebels.vx[grouped], rebels.vy[grouped]
        incoming = verdict.incoming[grouped]
        share = mean(incoming.astype(np.float32))[has]

        # What stands still expands about the focus; what moves, about itself: V_e/r, fitted over the members.
        weight = np.square(x0 - links.focus_x[grouped]) + np.square(y0 - links.focus_y[grouped])
        still_rate = (mean(verdict.expansion[grouped] * weight) / np.maximum(mean(weight), 1))[has]
        depth_rate = links.depth_m[grouped] / elapsed  # mean V_ν over the links
        still_range = mean(depth_rate)[has] / np.maximum(still_rate, np.float32(1e-3))
        px, py = x0 - mean(x0)[label], y0 - mean(y0)[label]
        own_var = mean(px * px + py * py)
        own_rate = (mean(px * vx + py * vy) / np.maximum(own_var, 1))[has]
        sigma = np.float32(VELOCITY_NOISE_PXPS) / np.sqrt(np.maximum(own_var[has] * circles.support[rows], 1))
        moves_rate = np.where(own_rate > 2 * sigma, own_rate, 0)

        speed = np.float32(around.speed_mps)
        focal = np.float32(around.pinhole.focal)
        stands = share >= 0.5
        still_ttc = still_range / np.maximum(speed, np.float32(1e-3)) if speed > 0 else np.full_like(still_rate, np.inf)
        rate = np.where(stands, 1 / np.maximum(still_ttc, np.float32(1e-3)), moves_rate)
        before = np.where(fresh | ~np.isfinite(circles.ttc[rows]), rate, 1 / np.maximum(circles.ttc[rows], 1e-3))
        rate = update_position(circles.trust[rows], self._settings.tr_cr, before.astype(np.float32), rate)
        with np.errstate(divide="ignore"):
            ttc = np.where(rate > 1e-3, 1 / rate, np.inf).astype(np.float32)

        bottom = circles.y[rows] + np.float32(0.5) * circles.height[rows] - np.float32(around.horizon_y)
        slack = focal * np.float32(around.pitch_sigma_rad)
        with np.errstate(divide="ignore", invalid="ignore"):
            ground = np.where(
                (bottom > slack) & (around.camera_height_m > 0),
                around.camera_height_m * focal / bottom,
                np.nan,
            )
        right = (circles.x[rows] - np.float32(around.focus[0])) / focal
        range_m = np.where(stands, still_range, ground).astype(np.float32)
        drift_rate = mean(vx)[has] / focal
        moving_miss = range_m * np.where(np.isfinite(ttc), drift_rate * ttc, np.nan)
        lateral = np.where(stands, miss(right * range_m, range_m, around), moving_miss).astype(np.float32)
        if not np.isfinite(around.speed_mps):
            range_m = np.where(stands, np.nan, range_m).astype(np.float32)
            lateral = np.full_like(range_m, np.nan)
        inwards = mean(((verdict.short > np.abs(verdict.drift)) & verdict.mover)[grouped].astype(np.float32))[has]
        meets = stands | ((ttc < around.horizon_s) & ~(np.abs(lateral) > around.half_width_m))
        cause = np.where(meets, Cause.INCOMING, np.where(inwards > 0.5, Cause.LEADING, Cause.CROSSING))
        circles.ttc[rows], circles.range[rows], circles.lateral[rows] = ttc, range_m, lateral
        circles.cause[rows] = cause


def link(x: Floats, y: Floats, vx: Floats, vy: Floats, settings: Filter) -> npt.NDArray[np.intp]:
    """Label of each rebel edge's group (eq. EdgeErcompareER, and by place); int (k,), k at most E_r's capacity.

    Two rebels are linked when they are near and move in the same direction with a like speed, or differ in velocity
    by no more than the parts of an object that grows in the picture do.
    """
    dx, dy = x[:, None] - x, y[:, None] - y
    distance = np.hypot(dx, dy)
    difference = np.hypot(vx[:, None] - vx, vy[:, None] - vy)
    speed = np.hypot(vx, vy)
    faster = np.maximum(speed[:, None], speed)
    along = vx[:, None] * vx + vy[:, None] * vy
    together = (along > np.cos(settings.eps_beta_rebel_rad) * speed[:, None] * speed) & (
        difference < np.float32(0.5) * faster
    )
    looms = difference < np.float32(2 * VELOCITY_NOISE_PXPS) + np.float32(LOOMS_PER_S) * distance
    linked = (distance < settings.rebel_link_px) & (together | looms)
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
