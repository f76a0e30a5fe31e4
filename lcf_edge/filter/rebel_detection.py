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
import numpy.typing as npt

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


def links_since(edges: EdgeTable, rows: Rows, key: npt.NDArray[np.int64], keys: KeyFrames, around: Situation) -> Links:
    """Links of ``rows`` from key frame number ``key`` (int (n,)), which each edge must have seen, to now."""
    pinhole = around.pinhole
    slot_h = pinhole.homography(keys.rotation).reshape(KEYS, 9).astype(np.float32)
    displacement = keys.displacement
    moves = np.abs(displacement[:, 2]) > STILL_M
    depth = np.where(moves, displacement[:, 2], 1.0)
    focus_x = np.where(moves, pinhole.cx + pinhole.fx * displacement[:, 0] / depth, around.focus[0])
    focus_y = np.where(moves, pinhole.cy + pinhole.fy * displacement[:, 1] / depth, around.focus[1])
    per_slot = np.stack([focus_x, focus_y, displacement[:, 2], keys.elapsed_s, keys.sigma_rad * pinhole.focal]).astype(
        np.float32
    )
    slot = key % KEYS
    h = slot_h.T[:, slot]
    kx, ky = edges.key_x[slot, rows], edges.key_y[slot, rows]
    scale = 1 / (h[6] * kx + h[7] * ky + h[8])
    fx, fy, dz, elapsed, sigma = per_slot[:, slot]
    return Links(
        (h[0] * kx + h[1] * ky + h[2]) * scale,
        (h[3] * kx + h[4] * ky + h[5]) * scale,
        fx,
        fy,
        dz,
        elapsed,
        sigma,
    )


@dataclass(frozen=True, slots=True)
class Verdict(Columns):
    """What the links say; (n,) each.

    ``r``: px from the focus. ``drift``: px off the flow line. ``short``: px by which the edge stays inside of where
    it should be. ``over``: px beyond. ``expansion``: μ per second, 1/s. ``range_m``, ``lateral_m``, ``ttc_s``: if it
    stands still. ``mover``, ``incoming``: bool.
    """

    r: Floats
    drift: Floats
    short: Floats
    over: Floats
    expansion: Floats
    range_m: Floats
    lateral_m: Floats
    ttc_s: Floats
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

    From x' = (Z/(Z - ΔZ))·x about the focus: 1/TTC = V_e/r. The lateral miss is measured from the arc that speed and
    yaw rate give.
    """
    pinhole, focal = around.pinhole, np.float32(around.pinhole.focal)
    ax, ay = links.x - links.focus_x, links.y - links.focus_y
    r = np.maximum(np.hypot(ax, ay), np.float32(1))
    mx, my = x - links.x, y - links.y
    outward = (mx * ax + my * ay) / r
    drift = (my * ax - mx * ay) / r
    sign = np.where(links.depth_m < 0, np.float32(-1), np.float32(1))
    travelled = np.abs(links.depth_m)
    outward = outward * sign
    mu = outward / r

    below = y - np.float32(around.horizon_y)
    slack = np.float32(focal * around.pitch_sigma_rad)
    reach = np.float32(around.camera_height_m) * focal
    ground_far = below - slack  # px below the horizon if the camera looks as far down as it may
    if around.camera_height_m > 0:
        least_mu = travelled * np.maximum(ground_far, 0) / (reach * np.float32(1 + GROUND_DIPS))
    else:
        least_mu = np.zeros_like(mu)
    short = r * least_mu - outward
    over = outward - r * travelled / np.float32(NEAREST_M)
    if not np.isfinite(around.speed_mps):  # then ΔZ has a direction and no size: only what leaves its line moves
        short, over = np.zeros_like(short), np.zeros_like(over)
    astray = np.float32(around.focus_sigma_px) * np.minimum(np.abs(mu), np.float32(MOST_ASTRAY))
    tolerance = around.delta_px + astray + links.sigma_px
    askew = np.float32(ASKEW) * np.abs(outward)
    mover = (np.abs(drift) > tolerance + askew) | (short > tolerance) | (over > tolerance)

    closing = np.maximum(mu, np.float32(1e-6))
    range_m = travelled / closing
    speed = np.float32(around.speed_mps)
    lateral_m = miss((x - np.float32(around.focus[0])) / np.float32(pinhole.fx) * range_m, range_m, around)
    ttc = range_m / np.maximum(speed, np.float32(1e-3))
    incoming = np.zeros(len(x), np.bool_)
    return Verdict(r, drift, short, over, mu * sign / links.elapsed_s, range_m, lateral_m, ttc, mover, incoming)


def find_incoming(verdict: Verdict, links: Links, x: Floats, y: Floats, known: Mask, around: Situation) -> None:
    """Mark the edges of what stands in the way, and give them the range that they have together.

    Near the focus a single edge hardly moves; its neighbours at a like depth lend it their evidence. 1/Z = V_e/(r V),
    by least squares over the neighbours, with its standard deviation.
    """
    if not around.speed_mps > 0:
        return
    pinhole, focal, speed = around.pinhole, np.float32(around.pinhole.focal), np.float32(around.speed_mps)
    lever = verdict.r * links.depth_m  # px m
    reach_m = speed * np.float32(around.horizon_s)
    sigma = np.float32(math.sqrt(2) * around.noise_px) + links.sigma_px
    outward = verdict.expansion * links.elapsed_s * verdict.r
    rows = np.flatnonzero((links.depth_m > 0) & ~verdict.mover & ((outward + 2 * sigma) * reach_m > lever))
    nearest = np.minimum(reach_m / np.maximum(verdict.range_m[rows], np.float32(1e-3)), 1)
    rows = rows[np.abs(verdict.lateral_m[rows]) * nearest < np.float32(NEAR_PATH * around.half_width_m)]
    rows = rows[:: 1 + len(rows) // MOST_CANDIDATES]
    if not len(rows):
        return
    x, y, lever, sigma, outward = x[rows], y[rows], lever[rows], sigma[rows], outward[rows]
    inverse = outward / lever  # 1/Z
    doubt = sigma / lever
    below = y - np.float32(around.horizon_y)
    if around.camera_height_m > 0:
        lowest = np.maximum(below + focal * np.float32(around.pitch_sigma_rad), 0)
        ground = lowest * np.float32((1 + around.ground_margin) / (around.camera_height_m * focal))
    else:
        ground = np.zeros_like(below)
    away2 = np.square(x[:, None] - x) + np.square(y[:, None] - y)
    weight = np.where(away2 < np.float32(NEIGHBOUR_PX**2), np.float32(1), np.float32(0))
    weight *= np.abs(inverse[:, None] - inverse) < 2 * (doubt[:, None] + doubt)
    weight *= np.square(1 / doubt)
    total = weight.sum(axis=1)
    inverse = (weight @ inverse) / total
    excess = inverse - (weight @ ground) / total
    doubt = 1 / np.sqrt(total) + links.sigma_px[rows] / lever
    range_m = 1 / np.maximum(inverse, np.float32(1e-6))
    right_m = (x - np.float32(around.focus[0])) / np.float32(pinhole.fx) * range_m
    lateral = miss(right_m, range_m, around)
    height_m = np.float32(around.camera_height_m) - below / focal * range_m  # above the ground
    soon = reach_m * np.where(known[rows], np.float32(1), np.float32(NEWCOMER))
    meets = (
        (way_to(right_m, range_m, around) < soon)
        & (np.abs(lateral) < around.half_width_m)
        & (height_m < around.height_m)
    )
    meets &= (inverse - doubt) * np.float32(DOUBT) * reach_m > 1
    meets &= (inverse > 2 * doubt) & (excess > np.float32(CERTAIN) * doubt)
    verdict.incoming[rows] = meets
    verdict.range_m[rows], verdict.lateral_m[rows], verdict.ttc_s[rows] = range_m, lateral, range_m / speed


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
