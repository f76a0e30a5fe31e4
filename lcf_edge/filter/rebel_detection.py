"""α: which edges break the flow over three key frames, and how.

Between a key frame and now, a stationary point moves along the line through the focus of expansion by a share μ = ΔZ/Z
of its distance r from it; Z lies between the nearest depth expected and, below the horizon, the ground. An edge off
that segment moves independently (a *mover*); one on it that will be met within the horizon and the vehicle's width, and
lies above the ground, is *incoming*.
"""

import math

from lcf_edge.filter import baselines as lines
from lcf_edge.filter import edge_equations, error_matrix, flow, lengths, path
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.error_matrix import MotionError
from lcf_edge.filter.memory import Doubles, doubles, integers, octets
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation

NEAREST_M = 0.25  # depth below which nothing stationary is expected
MOVER_SIGMAS = 5.0  # by which a mover leaves the flow of the static scene
GROUP_SIGMAS = 4.0  # and a group of them,
GROUP_SIZE = 4  # edges at least,
TOGETHER_SIGMAS = 1.5  # of both, by which they may differ,
ODD_SIGMAS = 1.5  # and by which each leaves the flow at least,
SAME_WAY = 0.9  # cosine of the angle between their flow lines, at least
PARALLAX_DRIFT = 0.25  # drift, as a share of the outward motion, of a corner between two things at different depths
LINK_RATIO = 1.8  # factor by which the rates of two links of a chain may differ
GROUND_DIPS = 0.8  # share of the camera's height by which the ground may lie deeper, before it is a leader
COMMON_NOISE_PX = 0.3  # noise above this is common to neighbours, and does not average out
ALIKE_SIGMAS = 2.0  # of both, by which neighbours at the same depth, or on the same level plane, may differ,
OWN_SIGMAS = 2.0  # and an edge from what they show together
NEAR_PATH = 1.5  # half widths within which candidates lie from the path, and new threats from the one that has lasted,
SWERVE_SHARE = 0.4  # of the horizon, if they are reached later: a swerve is over sooner
NEAR_SIGMAS = 2.0  # by which a candidate may move slower than it should
MAX_CANDIDATES = 200  # all pairs are compared
NEW_THREAT = 0.97  # share of the horizon within which a threat begins; hysteresis against flicker
RANGE_SIGMAS = 4.0  # by which 1/Z of an incoming edge exceeds zero,
GROUND_SIGMAS = 4.0  # and by which the ground fits worse
SLOWER_HORIZONS = 1.5  # time to contact, one sigma slower, in horizons at most
MIN_INVERSE_RANGE = 1e-6  # 1/m
MIN_LEVER2 = 1e-9  # m²
MIN_OUTWARD_PX = 1e-3
MIN_R_PX = 1.0
LINK_NOISE_SIGMAS = 1.5  # of noise in the rate of a mover over the younger link
CLOSING_NOISE_SIGMAS = 2.0  # of noise in the expansion over the younger link
MIN_FIRST_LINK_PX = 2.0  # a shorter first link has no direction


class Verdicts:
    """Edges compared with the flow of the static scene, over their history since a key frame; one row per edge.

    ``row``: of the table of edges. ``slot``: of the key frame. ``x``, ``y``: position then, derotated to now, px.
    ``r``: px from the focus. ``drift``: px off the flow line. ``short``: px by which the edge falls short of the flow.
    ``over``: px by which it exceeds it. ``outward``: px along the flow line. ``expansion``: μ per second, 1/s.
    ``sigma``: of the rotation since, px along the flow line; ``astray``: of O, likewise; ``noise``: of its own two
    places, px. ``along``, ``across``: of all this, along the flow line and across it, px.
    ``mover``, ``incoming``: the verdict. ``together``: only its neighbours show that it is a mover.

    ``near``: rows that may stand near the path, with their positions (``near_x``, ``near_y``, px), inverse ranges
    (``inverse``, 1/m) with 1 sigma (``inverse_sigma``), ``lever_x`` and ``lever_y``, px m, their motion for 1/Z = 1/m,
    ``weight``, 1/σ² of their noise, 1/px², ``common``, 1 sigma of what they share with neighbours, px, and ``level``,
    1/Z of the ground there, 1/m. ``shared``, ``shared_sigma``, 1/m, and ``worse``: result of ``ask_neighbours``.
    """

    def __init__(self, capacity: int) -> None:
        self.count = 0
        self.row, self.slot, self.oldest, self.near = [integers(capacity) for _ in range(4)]
        self.x, self.y, self.r, self.drift = [doubles(capacity) for _ in range(4)]
        self.short, self.over, self.outward, self.expansion = [doubles(capacity) for _ in range(4)]
        self.mover, self.together, self.incoming = [octets(capacity) for _ in range(3)]
        self.sigma, self.astray, self.noise, self.along, self.across = [doubles(capacity) for _ in range(5)]
        self.inverse, self.inverse_sigma = [doubles(capacity) for _ in range(2)]
        self.near_x, self.near_y, self.lever_x, self.lever_y = [doubles(capacity) for _ in range(4)]
        self.weight, self.common, self.level = [doubles(capacity) for _ in range(3)]
        self.near_count = 0
        self.shared = self.shared_sigma = self.worse = 0.0
        self.error = MotionError()


def link(verdicts: Verdicts, j: int, edges: EdgeColumns, i: int, slot: int, baselines: Baselines) -> None:
    """Link edge ``i`` to its position at the key frame in ``slot``, derotated to now."""
    key_x, key_y = edges.key_x[i, slot], edges.key_y[i, slot]
    x, y = lines.then_x(baselines, slot, key_x, key_y), lines.then_y(baselines, slot, key_x, key_y)
    verdicts.row[j], verdicts.slot[j] = i, slot
    verdicts.x[j], verdicts.y[j] = x, y


def judge(verdicts: Verdicts, j: int, edges: EdgeColumns, baselines: Baselines, around: Situation) -> None:
    """Compare a linked edge with the flow of the static scene.

    From x' = (Z/(Z - ΔZ))·x about the focus: 1/TTC = V_e/r.
    """
    i, slot = verdicts.row[j], verdicts.slot[j]
    ax, ay = verdicts.x[j] - baselines.focus_x[slot], verdicts.y[j] - baselines.focus_y[slot]
    mx, my = edges.x[i] - verdicts.x[j], edges.y[i] - verdicts.y[j]
    r = max(lengths.of(ax, ay), MIN_R_PX)
    outward = (mx * ax + my * ay) / r
    drift = (my * ax - mx * ay) / r
    depth_m = baselines.depth_m[slot]
    verdicts.r[j], verdicts.drift[j] = r, drift
    verdicts.expansion[j] = outward / r / baselines.elapsed_s[slot]
    if depth_m < 0:
        outward = -outward
    verdicts.outward[j] = outward
    verdicts.short[j] = verdicts.over[j] = 0.0
    if math.isfinite(around.speed_mps):  # else ΔZ has only a direction: only drift shows movers
        verdicts.over[j] = outward - r * math.fabs(depth_m) / NEAREST_M
        verdicts.short[j] = ground_outward(edges.y[i], r * math.fabs(depth_m), around) - outward
    cos, sin = ax / r, ay / r
    error_matrix.of_rotation(verdicts.error, baselines, edges, i, slot, verdicts.x[j], verdicts.y[j], around)
    verdicts.sigma[j] = math.sqrt(error_matrix.variance(verdicts.error, cos, sin))
    verdicts.noise[j] = error_matrix.add_places(verdicts.error, edges, i, around)
    verdicts.astray[j] = math.sqrt(error_matrix.add_focus(verdicts.error, outward / r, cos, sin, around))
    verdicts.along[j] = math.sqrt(error_matrix.variance(verdicts.error, cos, sin))
    verdicts.across[j] = math.sqrt(error_matrix.variance(verdicts.error, -sin, cos))
    drifts = math.fabs(drift) > MOVER_SIGMAS * verdicts.across[j] + PARALLAX_DRIFT * math.fabs(outward)
    strays = max(verdicts.short[j], verdicts.over[j]) > MOVER_SIGMAS * verdicts.along[j]
    verdicts.mover[j] = 1 if drifts or strays else 0
    verdicts.together[j] = verdicts.incoming[j] = 0


def ground_outward(y: float, lever: float, around: Situation) -> float:
    """Outward motion of the deepest ground at image row ``y``, px; 0 above the horizon. ``lever``: r·ΔZ, px m."""
    if not around.camera_height_m > 0:
        return 0.0
    # px below the lowest horizon that the pitch allows
    below = y - (around.horizon_y + around.pinhole.focal * around.pitch_sigma_rad)
    return lever * max(below, 0.0) / (around.camera_height_m * (1 + GROUND_DIPS) * around.pinhole.focal)


def sigma_px(verdicts: Verdicts, j: int) -> float:
    """1 sigma of an edge's motion, px: of its two positions, of the rotation between, and of O."""
    return lengths.of(common_px(verdicts, j), verdicts.noise[j])


def common_px(verdicts: Verdicts, j: int) -> float:
    """What of that it shares with its neighbours, px."""
    return lengths.of(verdicts.sigma[j], verdicts.astray[j])


def unusual_px(around: Situation) -> float:
    """Noise beyond what is usual, which neighbours share, px."""
    return max(around.noise_px - COMMON_NOISE_PX, 0.0)


def lever_of(verdicts: Verdicts, j: int, baselines: Baselines) -> float:
    """r·ΔZ, px m, so that outward/lever is 1/Z; negative in reverse."""
    return verdicts.r[j] * baselines.depth_m[verdicts.slot[j]]


def near_path(verdicts: Verdicts, edges: EdgeColumns, baselines: Baselines, around: Situation) -> None:
    """Gather candidates: edges that, taken alone, may stand near the path within the horizon."""
    near = 0
    reach_m = around.assumed_mps * around.horizon_s
    for j in range(verdicts.count):
        sigma = sigma_px(verdicts, j)
        lever = lever_of(verdicts, j, baselines)
        outward = verdicts.outward[j]
        if verdicts.mover[j] or lever <= 0 or (outward + NEAR_SIGMAS * sigma) * reach_m <= lever:
            continue
        range_m = min(lever / max(outward, MIN_OUTWARD_PX), reach_m)
        right_m = (edges.x[verdicts.row[j]] - around.focus_x) / around.pinhole.fx * range_m
        if math.fabs(path.miss(right_m, range_m, around)) < NEAR_PATH * around.half_width_m:
            verdicts.near[near] = j
            near += 1
    stride = 1 + near // MAX_CANDIDATES
    verdicts.near_count = (near + stride - 1) // stride
    lowest_y = around.horizon_y - around.pinhole.focal * around.horizon_sigma_rad
    for a in range(verdicts.near_count):
        j = verdicts.near[a * stride]
        slot, lever = verdicts.slot[j], lever_of(verdicts, j, baselines)
        verdicts.near[a] = j
        verdicts.near_x[a], verdicts.near_y[a] = edges.x[verdicts.row[j]], edges.y[verdicts.row[j]]
        verdicts.inverse[a] = verdicts.outward[j] / lever
        verdicts.inverse_sigma[a] = sigma_px(verdicts, j) / lever
        verdicts.lever_x[a] = baselines.depth_m[slot] * (verdicts.x[j] - baselines.focus_x[slot])
        verdicts.lever_y[a] = baselines.depth_m[slot] * (verdicts.y[j] - baselines.focus_y[slot])
        verdicts.weight[a] = 1 / (verdicts.noise[j] * verdicts.noise[j])
        verdicts.common[a] = common_px(verdicts, j) + unusual_px(around)
        verdicts.level[a] = 0.0
        if around.camera_height_m > 0:
            below = max(verdicts.near_y[a] - lowest_y, 0.0)
            verdicts.level[a] = below / (around.camera_height_m * around.pinhole.focal)


def are_alike(verdicts: Verdicts, a: int, b: int) -> bool:
    """Whether two candidates may be at one depth, or on one level plane."""
    one, other = verdicts.inverse_sigma[a], verdicts.inverse_sigma[b]
    if math.fabs(verdicts.inverse[a] - verdicts.inverse[b]) < ALIKE_SIGMAS * (one + other):
        return True
    apart = math.fabs(verdicts.level[b] * verdicts.inverse[a] - verdicts.level[a] * verdicts.inverse[b])
    return apart < ALIKE_SIGMAS * (verdicts.level[b] * one + verdicts.level[a] * other)


def ask_neighbours(verdicts: Verdicts, a: int, settings: Settings) -> None:
    """Fit the motion of a candidate and its neighbours by something upright, and by the ground.

    With m, their motion, l, their levers, and s, the sigma of what they share: m = ρ·l + s·t, and m = k·g·l + s·t,
    g the ground's 1/Z; t ~ N(0, 1) is the same for all, k at most 1 + ``filter.ground_margin``. By least squares,
    ``shared`` = ρ, and ``worse`` = χ² of the ground - χ² of the upright; both for the noise that is left, which few
    edges show badly.
    """
    reach2 = settings.neighbour_px * settings.neighbour_px
    number = total = mx = my = mm = lx = ly = ll = lm = gx = gy = gg = gm = 0.0
    for b in range(verdicts.near_count):
        dx, dy = verdicts.near_x[a] - verdicts.near_x[b], verdicts.near_y[a] - verdicts.near_y[b]
        if dx * dx + dy * dy >= reach2 or not are_alike(verdicts, a, b):
            continue
        j, weight, level = verdicts.near[b], verdicts.weight[b], verdicts.level[b]
        across, down = verdicts.near_x[b] - verdicts.x[j], verdicts.near_y[b] - verdicts.y[j]
        lever_x, lever_y, common = verdicts.lever_x[b], verdicts.lever_y[b], weight * verdicts.common[b]
        lever2, along = lever_x * lever_x + lever_y * lever_y, lever_x * across + lever_y * down
        number += 1
        total += common * verdicts.common[b]
        mx += common * across
        my += common * down
        mm += weight * (across * across + down * down)
        lx += common * lever_x
        ly += common * lever_y
        ll += weight * lever2
        lm += weight * along
        gx += common * level * lever_x
        gy += common * level * lever_y
        gg += weight * level * level * lever2
        gm += weight * level * along
    taken = 1 / (total + 1)  # t, eliminated
    mm -= taken * (mx * mx + my * my)
    ll = max(ll - taken * (lx * lx + ly * ly), MIN_LEVER2)
    lm -= taken * (lx * mx + ly * my)
    gg -= taken * (gx * gx + gy * gy)
    gm -= taken * (gx * mx + gy * my)
    left = max(mm - lm * lm / ll, 0.0)
    noise2 = max(left / (2 * number - 1), 1.0) * (1 + 1 / number) * (1 + 1 / number)
    times = 1 + settings.ground_margin
    if gg > 0:
        times = min(gm / gg, times)
    verdicts.shared, verdicts.shared_sigma = lm / ll, math.sqrt(noise2 / ll)
    verdicts.worse = (mm - times * (2 * gm - times * gg) - left) / noise2


def will_be_met(verdicts: Verdicts, a: int, edges: EdgeColumns, around: Situation) -> bool:
    """Whether a candidate, by its neighbours, stands in the way, above the ground, within the horizon."""
    i, inverse, inverse_sigma = verdicts.row[verdicts.near[a]], verdicts.shared, verdicts.shared_sigma
    reach_m = around.assumed_mps * around.horizon_s
    range_m = 1 / max(inverse, MIN_INVERSE_RANGE)
    right_m = (edges.x[i] - around.focus_x) / around.pinhole.fx * range_m
    below_m = (edges.y[i] - around.horizon_y) / around.pinhole.focal * range_m
    soon_m = reach_m if edges.rebel[i] else reach_m * NEW_THREAT
    way_m = path.way_to(right_m, range_m, around)
    return (
        way_m < soon_m
        and math.fabs(path.miss(right_m, range_m, around)) < around.half_width_m
        and (
            edges.rebel[i]
            or way_m < SWERVE_SHARE * reach_m
            or math.fabs(path.miss_at(around.lasting_yaw_radps, right_m, range_m, around))
            < NEAR_PATH * around.half_width_m
        )
        and around.camera_height_m - below_m < around.height_m
        and (inverse - inverse_sigma) * SLOWER_HORIZONS * reach_m > 1
        and inverse > RANGE_SIGMAS * inverse_sigma
        and math.fabs(inverse - verdicts.inverse[a]) < OWN_SIGMAS * verdicts.inverse_sigma[a]
        and verdicts.worse > GROUND_SIGMAS * GROUND_SIGMAS
    )


def find_incoming(
    verdicts: Verdicts, edges: EdgeColumns, baselines: Baselines, around: Situation, settings: Settings
) -> None:
    """Mark the edges that stand in the way.

    Near the focus a single edge hardly moves, and a small thing moves much as the ground under it: an edge is judged
    together with its neighbours.
    """
    if not around.assumed_mps > 0:
        return
    near_path(verdicts, edges, baselines, around)
    for a in range(verdicts.near_count):
        ask_neighbours(verdicts, a, settings)
        verdicts.incoming[verdicts.near[a]] = 1 if will_be_met(verdicts, a, edges, around) else 0


def moves_together(
    verdicts: Verdicts,
    j: int,
    off: Doubles,
    sigma: Doubles,
    parallax: float,
    edges: EdgeColumns,
    around: Situation,
    settings: Settings,
) -> bool:
    """Whether an edge and the neighbours that are off alike are so by too much, on average.

    ``off``: px off the flow of the static scene, with ``sigma``. ``parallax``: share of the outward motion that is not
    off. The noise of their places averages out; the rest of ``sigma`` does not, nor does noise that is unusual.
    """
    x, y = edges.x[verdicts.row[j]], edges.y[verdicts.row[j]]
    from_x, from_y = x - around.focus_x, y - around.focus_y
    reach2 = settings.neighbour_px * settings.neighbour_px
    least_cos = SAME_WAY * lengths.of(from_x, from_y)
    number = total = mean = outward = 0.0
    for k in range(verdicts.count):
        i = verdicts.row[k]
        dx, dy = edges.x[i] - x, edges.y[i] - y
        if dx * dx + dy * dy >= reach2:
            continue
        other_x, other_y = edges.x[i] - around.focus_x, edges.y[i] - around.focus_y
        if from_x * other_x + from_y * other_y < least_cos * lengths.of(other_x, other_y):
            continue
        if math.fabs(off[k] - off[j]) > TOGETHER_SIGMAS * (verdicts.noise[k] + verdicts.noise[j]):
            continue
        weight = 1 / (verdicts.noise[k] * verdicts.noise[k])
        number += 1
        total += weight
        mean += weight * off[k]
        outward += weight * math.fabs(verdicts.outward[k])
    unusual = unusual_px(around)
    common2 = max(sigma[j] * sigma[j] - verdicts.noise[j] * verdicts.noise[j], 0.0) + unusual * unusual
    least = GROUP_SIGMAS * math.sqrt(1 / total + common2) + parallax * outward / total
    return number >= GROUP_SIZE and math.fabs(mean) / total > least


def find_moving_together(verdicts: Verdicts, edges: EdgeColumns, around: Situation, settings: Settings) -> None:
    """Mark edges as movers that are off too little to tell alone, but together with their neighbours."""
    for j in range(verdicts.count):
        if verdicts.mover[j] or verdicts.incoming[j]:
            continue
        drift = math.fabs(verdicts.drift[j]) - PARALLAX_DRIFT * math.fabs(verdicts.outward[j])
        if (
            drift > ODD_SIGMAS * verdicts.across[j]
            and moves_together(verdicts, j, verdicts.drift, verdicts.across, PARALLAX_DRIFT, edges, around, settings)
        ) or (
            verdicts.short[j] > ODD_SIGMAS * verdicts.along[j]
            and moves_together(verdicts, j, verdicts.short, verdicts.along, 0.0, edges, around, settings)
        ):
            verdicts.mover[j] = verdicts.together[j] = 1


def judge_together(
    verdicts: Verdicts, edges: EdgeColumns, baselines: Baselines, around: Situation, settings: Settings
) -> None:
    """Judge edges with their neighbours: which stand in the way, and which of the others move."""
    find_incoming(verdicts, edges, baselines, around, settings)
    find_moving_together(verdicts, edges, around, settings)


def agree(whole: Verdicts, j: int, recent: Verdicts, k: int, baselines: Baselines) -> bool:
    """Whether the younger link of a chain agrees with the whole chain (bounded, consistent deviation).

    The rate of the deviation over the younger link may differ by ``LINK_RATIO`` from that of the whole, plus noise.
    """
    whole_s, recent_s = baselines.elapsed_s[whole.slot[j]], baselines.elapsed_s[recent.slot[k]]
    if not whole.mover[j]:
        slack = CLOSING_NOISE_SIGMAS * recent.noise[k] / (recent_s * recent.r[k])
        return rates_agree(whole.expansion[j], recent.expansion[k], slack)
    slack = LINK_NOISE_SIGMAS * recent.noise[k] / recent_s
    drift = math.fabs(whole.drift[j])
    if drift >= whole.short[j] and drift >= whole.over[j]:
        sign = -1.0 if whole.drift[j] < 0 else 1.0
        return rates_agree(drift / whole_s, sign * recent.drift[k] / recent_s, slack)
    if whole.short[j] >= whole.over[j]:
        return rates_agree(whole.short[j] / whole_s, recent.short[k] / recent_s, slack)
    return rates_agree(whole.over[j] / whole_s, recent.over[k] / recent_s, slack)


def rates_agree(old: float, new: float, slack: float) -> bool:
    """Whether two rates differ by no more than ``LINK_RATIO``, plus noise."""
    return new + slack > old / LINK_RATIO and new - slack < old * LINK_RATIO


def give_birth(
    edges: EdgeColumns, first: Verdicts, j: int, second: Verdicts, k: int, elapsed_s: float, settings: Settings
) -> None:
    """Make a chain a rebel edge (eq. Intialrebelpara): DL, V, β, O from the key positions L1, L2, L3 = L.

    DL = ∠(L3-L1) - ∠(L2-L1), V = |L3-L2|/t, β = ∠(L3-L1), O = L1. ``elapsed_s``: t, since the second.
    """
    i = first.row[j]
    x1, y1, x2, y2 = first.x[j], first.y[j], second.x[k], second.y[k]
    x3, y3 = edges.x[i], edges.y[i]
    beta = math.atan2(y3 - y1, x3 - x1)
    edges.deviation[i] = 0.0
    if lengths.of(x2 - x1, y2 - y1) > MIN_FIRST_LINK_PX:
        turn = flow.wrap(beta - math.atan2(y2 - y1, x2 - x1))
        edges.deviation[i] = edge_equations.bound_deviation(turn)
    edges.speed[i] = lengths.of(x3 - x2, y3 - y2) / elapsed_s
    edges.beta[i] = beta
    edges.origin_x[i], edges.origin_y[i] = x1, y1
    edges.rebel[i] = 1
    edges.suspect_keys[i] = 0
    edges.circle[i] = -1
    edges.trust[i] = settings.tr_new
    edges.bl[i] = max(edges.bl[i], 2 * settings.bl_min_px)
