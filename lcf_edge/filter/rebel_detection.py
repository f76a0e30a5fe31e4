"""α: over three key frames, which edges break the flow, and how.

What stands still moves, between a key frame and now, along the line through the focus of expansion by a share
μ = ΔZ/Z of its distance r from it; Z lies between the nearest depth that is looked at and, below the horizon, the
ground. Whatever leaves that segment of a line moves by itself (a *mover*); what stays on it but will be met within
the horizon inside the vehicle's width, and stands above the ground, is *incoming*.
"""

import math
from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from lcf_edge.filter.flow import KeyFrames, wrap
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import KEYS, EdgeTable, Floats, Mask, Rows

NEAREST_M = 0.25  # depth below which nothing is expected to stand
MOST_ASTRAY = 0.5  # share of an error of the focus that shows in the drift of an edge; near the focus μ has no bound
ASKEW = 0.25  # share of its way outwards that a corner between two things at different depths drifts
STILL_M = 1e-3  # a displacement below this has no direction
LINK_RATIO = 1.8  # two links of a chain agree when their rates differ by no more than this factor
GROUND_DIPS = 0.8  # the ground may lie deeper than the camera's height by this share before it is a leader's
NEIGHBOUR_PX = 28.0  # edges nearer than this, at a like depth, tell it together
NEAR_PATH = 1.5  # half widths from the path, within which edges are looked at
MOST_CANDIDATES = 200  # edges in the way; all pairs are compared
NEWCOMER = 0.97  # share of the horizon within which a threat begins, so that it does not flicker at its end
CERTAIN = 1.0  # standard deviations above the ground
DOUBT = 1.5  # time to contact, a standard deviation slower, may exceed the horizon by this factor


@dataclass(frozen=True, slots=True)
class Columns:
    """Columns of one length, taken together."""

    def take(self, rows: Rows) -> Self:
        """Some of the rows."""
        parts = (getattr(self, field.name) for field in fields(self))
        return type(self)(*(part.take(rows) for part in parts))  # a column is an array or columns


@dataclass(frozen=True, slots=True)
class Links(Columns):
    """Edges seen from a key frame; float32 (n,): where they were (``x``, ``y``, derotated to now, px), the focus of
    the displacement since (``focus_x``, ``focus_y``, px), its forward part (``depth_m``), time and uncertainty."""

    x: Floats
    y: Floats
    focus_x: Floats
    focus_y: Floats
    depth_m: Floats
    elapsed_s: Floats
    sigma_px: Floats


class Baselines:
    """What the displacement since each key frame implies for a picture; one column a slot of ``KeyFrames``."""

    def __init__(self, keys: KeyFrames, around: Situation) -> None:
        pinhole = around.pinhole
        ahead = keys.displacement[:, 2]
        moves = np.abs(ahead) > STILL_M
        focus = keys.displacement[:, :2] / np.where(moves, ahead, 1.0)[:, None]
        focus = np.where(moves[:, None], focus * (pinhole.fx, pinhole.fy) + (pinhole.cx, pinhole.cy), around.focus)
        self._columns = np.empty((14, KEYS), np.float32)
        self._columns[:9] = pinhole.homography(keys.rotation).reshape(KEYS, 9).T
        self._columns[9:11] = focus.T
        self._columns[11] = ahead
        self._columns[12] = keys.elapsed_s
        self._columns[13] = keys.sigma_rad * pinhole.focal

    def links(self, edges: EdgeTable, rows: Rows, key: Rows) -> Links:
        """Links of ``rows`` from key frame number ``key`` (int (n,)), which each edge must have seen, to now."""
        slot = key % KEYS
        h0, h1, h2, h3, h4, h5, h6, h7, h8, focus_x, focus_y, ahead, elapsed, sigma = self._columns.take(slot, axis=1)
        place = slot * edges.capacity + rows
        x, y = edges.key_x.take(place), edges.key_y.take(place)
        scale = 1 / (h6 * x + h7 * y + h8)
        then_x, then_y = (h0 * x + h1 * y + h2) * scale, (h3 * x + h4 * y + h5) * scale
        return Links(then_x, then_y, focus_x, focus_y, ahead, elapsed, sigma)


@dataclass(frozen=True, slots=True)
class Verdict(Columns):
    """What the links say; (n,) each.

    ``r``: px from the focus. ``drift``: px off the flow line. ``short``: px by which the edge stays inside of where
    it should be. ``over``: px beyond. ``outward``: px along the flow line, as what stands still goes. ``expansion``: μ
    per second, 1/s. ``mover``, ``incoming``: bool, the latter as ``find_incoming`` finds.
    """

    r: Floats
    drift: Floats
    short: Floats
    over: Floats
    outward: Floats
    expansion: Floats
    mover: Mask
    incoming: Mask


@dataclass(frozen=True, slots=True)
class Rebels(Columns):
    """Rebel edges as the circles see them; (k,) each. ``rows``: of the edge table; ``vx``, ``vy``: px/s."""

    rows: Rows
    x: Floats
    y: Floats
    vx: Floats
    vy: Floats
    links: Links
    verdict: Verdict


def judge(links: Links, x: Floats, y: Floats, around: Situation) -> Verdict:
    """Hold edges at ``x``, ``y`` (float32 (n,), px) against the flow of what stands still.

    From x' = (Z/(Z - ΔZ))·x about the focus: 1/TTC = V_e/r.
    """
    ax, ay = links.x - links.focus_x, links.y - links.focus_y
    r = np.maximum(np.sqrt(ax * ax + ay * ay), np.float32(1))
    inverse = 1 / r
    mx, my = x - links.x, y - links.y
    outward = (mx * ax + my * ay) * inverse
    drift = (my * ax - mx * ay) * inverse
    expansion = outward * inverse / links.elapsed_s
    backwards = links.depth_m < 0
    if backwards.any():
        outward = np.where(backwards, -outward, outward)
    way_out = np.abs(outward)

    if math.isfinite(around.speed_mps):
        lever = r * np.abs(links.depth_m)
        over = outward - lever * np.float32(1 / NEAREST_M)
        short = -outward
        if around.camera_height_m > 0:
            deepest_m = np.float32(around.camera_height_m * (1 + GROUND_DIPS) * around.pinhole.focal)
            # px below the horizon if the camera looks as far down as it may
            below = y - np.float32(around.horizon_y + around.pinhole.focal * around.pitch_sigma_rad)
            short += lever * np.maximum(below, 0) / deepest_m
    else:  # then ΔZ has a direction and no size: only what leaves its line moves
        short, over = np.zeros_like(r), np.zeros_like(r)
    astray = np.float32(around.focus_sigma_px) * np.minimum(way_out * inverse, np.float32(MOST_ASTRAY))
    tolerance = links.sigma_px + astray + np.float32(around.delta_px)
    mover = np.abs(drift) > tolerance + np.float32(ASKEW) * way_out
    mover |= np.maximum(short, over) > tolerance
    return Verdict(r, drift, short, over, outward, expansion, mover, np.zeros(len(x), np.bool_))


def near_path(verdict: Verdict, links: Links, x: Floats, around: Situation) -> Rows:
    """Edges that may stand near the vehicle's path within the horizon, by themselves; at most ``MOST_CANDIDATES``."""
    reach_m = np.float32(around.speed_mps * around.horizon_s)
    sigma = sigma_px(links, around)
    lever = verdict.r * links.depth_m  # px m, negative: backwards
    rows = (((verdict.outward + 2 * sigma) * reach_m > lever) & (lever > 0) & ~verdict.mover).nonzero()[0]
    range_m = np.minimum(lever.take(rows) / np.maximum(verdict.outward.take(rows), np.float32(1e-3)), reach_m)
    right_m = (x.take(rows) - np.float32(around.focus[0])) * np.float32(1 / around.pinhole.fx) * range_m
    near = (np.abs(miss(right_m, range_m, around)) < np.float32(NEAR_PATH * around.half_width_m)).nonzero()[0]
    return rows.take(near[:: 1 + len(near) // MOST_CANDIDATES])


def sigma_px(links: Links, around: Situation) -> Floats:
    """1 sigma of how far an edge went, px: of its two places, and of the rotation between."""
    return links.sigma_px + np.float32(math.sqrt(2) * around.noise_px)


def find_incoming(verdict: Verdict, links: Links, x: Floats, y: Floats, known: Mask, around: Situation) -> None:
    """Mark the edges of what stands in the way.

    Near the focus a single edge hardly moves; its neighbours at a like depth lend it their evidence. 1/Z = V_e/(r V),
    by least squares over the neighbours, with its standard deviation. ``known``: bool (n,), rebels already.
    """
    rows = near_path(verdict, links, x, around) if around.speed_mps > 0 else np.empty(0, np.intp)
    if not len(rows):
        return
    focal = np.float32(around.pinhole.focal)
    reach_m = np.float32(around.speed_mps * around.horizon_s)
    x, y = x.take(rows), y.take(rows)
    lever = verdict.r.take(rows) * links.depth_m.take(rows)
    inverse = verdict.outward.take(rows) / lever  # 1/Z
    doubt = sigma_px(links, around).take(rows) / lever
    below = y - np.float32(around.horizon_y)
    away2 = np.square(x[:, None] - x)
    away2 += np.square(y[:, None] - y)
    alike = np.abs(inverse[:, None] - inverse) < 2 * (doubt[:, None] + doubt)
    weight = ((away2 < np.float32(NEIGHBOUR_PX**2)) & alike) / (doubt * doubt)
    total = weight.sum(axis=1)
    shared = (weight @ inverse) / total
    excess = shared
    if around.camera_height_m > 0:
        lowest = np.maximum(below + np.float32(around.pinhole.focal * around.pitch_sigma_rad), 0)
        ground = lowest * np.float32((1 + around.ground_margin) / (around.camera_height_m * around.pinhole.focal))
        excess = shared - (weight @ ground) / total
    doubt = 1 / np.sqrt(total) + links.sigma_px.take(rows) / lever
    range_m = 1 / np.maximum(shared, np.float32(1e-6))
    right_m = (x - np.float32(around.focus[0])) * np.float32(1 / around.pinhole.fx) * range_m
    soon = reach_m * np.where(known.take(rows), np.float32(1), np.float32(NEWCOMER))
    meets = (way_to(right_m, range_m, around) < soon) & (np.abs(miss(right_m, range_m, around)) < around.half_width_m)
    meets &= np.float32(around.camera_height_m) - below / focal * range_m < around.height_m
    meets &= (shared - doubt) * np.float32(DOUBT) * reach_m > 1
    meets &= (shared > 3 * doubt) & (excess > np.float32(CERTAIN) * doubt)
    verdict.incoming[rows] = meets


def miss(right_m: Floats, ahead_m: Floats, around: Situation) -> Floats:
    """Distance of points from the vehicle's path, m, right positive: from the arc of speed and yaw rate."""
    radius = arc_radius_m(around)
    if radius is None:
        return right_m
    distance = np.hypot(right_m + radius, ahead_m)
    return np.asarray((distance - np.abs(radius)) * np.sign(radius))


def way_to(right_m: Floats, ahead_m: Floats, around: Situation) -> Floats:
    """How far the vehicle goes along its arc until points are beside it, m."""
    radius = arc_radius_m(around)
    if radius is None:
        return ahead_m
    return np.asarray(np.abs(radius) * np.arctan2(ahead_m, (right_m + radius) * np.sign(radius)))


def arc_radius_m(around: Situation) -> np.float32 | None:
    """Radius of the path, m, its centre to the left when positive; None: as good as straight."""
    speed = around.speed_mps
    if not np.isfinite(speed) or abs(around.yaw_rate_radps) < 1e-3 * max(abs(speed), 0.05):
        return None
    return np.float32(speed / around.yaw_rate_radps)


def agree(whole: Verdict, whole_s: Floats, recent: Verdict, recent_s: Floats, noise_px: float) -> Mask:
    """Whether the younger link of each chain says the same as the whole chain (bounded, consistent deviation).

    The rate of the deviation over the recent link may differ by ``LINK_RATIO`` from that of the whole, plus noise.
    """
    verdict = np.ones(len(whole_s), np.bool_)
    mover = whole.mover
    slack = np.float32(2 * noise_px) / recent_s
    strongest = np.argmax(np.stack([np.abs(whole.drift), whole.short, whole.over]), axis=0)
    pick = np.arange(len(whole_s))
    old = np.stack([whole.drift, whole.short, whole.over])[strongest, pick] / whole_s
    new = np.stack([recent.drift, recent.short, recent.over])[strongest, pick] / recent_s
    sign = np.sign(old)
    old, new = old * sign, new * sign
    same = (new + slack > old / LINK_RATIO) & (new - slack < old * LINK_RATIO)
    verdict[mover] = same[mover]
    slack = np.float32(3 * noise_px) / (recent_s * recent.r)
    closing = (recent.expansion + slack > whole.expansion / LINK_RATIO) & (
        recent.expansion - slack < whole.expansion * LINK_RATIO
    )
    verdict[~mover] = closing[~mover]
    return verdict


def give_birth(edges: EdgeTable, rows: Rows, first: Links, second: Links) -> None:
    """A chain becomes a rebel edge (eq. Intialrebelpara): DL, V, β, O from the key positions L1, L2, L3 = L.

    DL = ∠(L3-L1) - ∠(L2-L1), V = |L3-L2|/t, β = ∠(L3-L1), O = L1.
    """
    x, y = edges.x[rows], edges.y[rows]
    beta = np.arctan2(y - first.y, x - first.x)
    before = np.arctan2(second.y - first.y, second.x - first.x)
    long_enough = np.hypot(second.x - first.x, second.y - first.y) > 2
    edges.deviation[rows] = np.where(long_enough, np.clip(wrap(beta - before), -0.5, 0.5), 0)
    edges.speed[rows] = np.hypot(x - second.x, y - second.y) / second.elapsed_s
    edges.beta[rows] = beta
    edges.origin_x[rows], edges.origin_y[rows] = first.x, first.y
    edges.rebel[rows] = True
    edges.links[rows] = 0
