"""Circle expert, C_r: rebel edges that move together become circles with a cause and a time to contact."""

import math

from lcf_edge.filter import circles as shared
from lcf_edge.filter import (
    coarse_circles,
    edge_equations,
    flow,
    image_plane,
    lengths,
    patch_circles,
    path,
    rebel_detection,
    situation,
    turmoil,
)
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.circles import Ids, Members
from lcf_edge.filter.coarse_circles import CoarseGroups
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.columns import CircleColumns, EdgeColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.memory import Integers, doubles, integers, octets
from lcf_edge.filter.patch_circles import PatchGroups
from lcf_edge.filter.patches import Patches
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.turmoil import Turmoil
from lcf_edge.messages import Cause

VELOCITY_NOISE_PX = 4.0  # 1 sigma of a rebel's velocity, times its elapsed time
STILL_PX = 6.0  # circles that moved less over that time have no direction
LIKE_SPEED = 0.5  # share by which the velocities of linked rebels may differ
SIDEWAYS = 0.2  # sideways speed of a leader, at most, as a share of the vehicle's speed
MIN_RANGE_M = 0.01
MIN_RATE = 1e-6  # 1/s; slower expansions are none
RATE_SIGMAS = 2.0  # by which an expansion must exceed its noise
MAX_GROWTH = 1.5  # of a circle in one frame
MAX_EXCESS = 2.0  # size of a circle, at most, in extents of the edges that show it,
MIN_SHOWN_PX = 12.0  # which count as at least this
LEADER_HEIGHT_SHARE = 0.3  # least height of a leader, as a share of the camera's; paint and reflections have less
MIRROR_NOISE_PX = 0.6  # 1 sigma of an edge's motion
MIRROR_SIGMAS = 3.0  # of it, by which a level plane must fit a group better than something upright
SURE_REBELS = 5.0  # smaller groups must be seen once more before their circle is published
MOVER_SHARE = 0.25  # of the edges in a moving circle that must be rebels: in repetitive texture, edges swap places
LIKELY_OWN_S = 0.9  # an edge that has not moved in the image for this long may be an own part,
SEEN_TO_MOVE_PX = 3.0  # if the ground there would have moved by this; otherwise it may just be far off
OWN_SHARE = 0.1  # of a group's rebels: with more likely own parts among them, the group is one too
SPREAD_NOISE_PX = 0.85  # 1 sigma of an edge's motion, with the noise of two positions
STRAY_ROUNDS = 2
STRAY_SIGMAS = 2.0  # of its noise, and of
STRAY_SHARE = 0.25  # this share of the expansion: width beyond which an edge is an outlier
SPREAD_SIGMAS = 2.0  # of the measured spreading rate, by which
SPREAD_SHARE = 0.5  # a stationary group may spread less than this share of its expansion about O
MAX_RANGE_M = 1000.0  # longer ranges are unknown,
MAX_TTC_HORIZONS = 10.0  # and later contacts, in horizons
MIN_EXTENT2_PX = 1.0  # px², least squared extent in a fit of an expansion
# Times are shares of the horizon, so that they hold for any speed.
FASTEST_EXPANSION = 4.0  # of one object, per horizon
LINK_SHARE = 0.03  # rebels link over what the faster moves in this share of the horizon: near things are large;
FAR_LINK_SHARE = 0.08  # or in this share, where they move almost the same,
FAR_LINK_RAD = 0.35  # but no farther
NEAR_LINK_M = 0.3  # distance over which standing rebels link, and on the ground groups are merged
NEAR_LIKE_HZ = 0.3  # that move alike but for an expansion of this
STAND_SHARE = 0.3  # by which 1/Z of linked standing rebels may differ
FAR_LIKE_SPEED = 0.3  # difference of those, and their noise, at most, as a share of the faster one's speed
COAST_SHARE = 0.25  # nearer contacts, in horizons, grow too fast for their corners to be tracked, and coast
COAST_TIME_SHARE = 0.1  # for this long
MIN_TTC_SHARE = 0.0125
BLIND_S = 1.0  # time that circles stay in place while the whole image is covered
MAX_TURN_RAD = 0.25  # of the path until contact: in a sharper turn, a circle may be lost for other reasons
CROSSING, INCOMING, LEADING = int(Cause.CROSSING), int(Cause.INCOMING), int(Cause.LEADING)
INFINITY = float("inf")
NAN = float("nan")


class RebelGroups:
    """The rebel edges of a frame, clustered into groups.

    One row per rebel: ``verdict``, its row of ``Verdicts``; ``vx``, ``vy``, px/s, measured over ``elapsed_s``;
    ``inverse``, 1/Z of one that stands in the way, else 0, 1/m; ``label``, parent in its cluster; ``group``, its group,
    -1: too small.

    One row per group: ``members``; means ``mean_vx``, ``mean_vy``, ``mean_s``; ``standing``, number of incoming edges;
    ``inwards``, of those that fall short of the flow; ``closing_mps``, mean ΔZ/t; ``focus_rate``, ``focus_r2``, means
    of μ/t·r² and r²; ``rate_below``, ``r2_below2``, means of μ/t·r²·h and r²·h², h px below the horizon; ``below2``,
    ``below_vy``, means of h² and h·v_y; ``then_x``, ``then_y``, mean of the earlier positions; ``spread``,
    ``spreading``, sums about that of squared distance, and of distance times velocity; ``expansion``, V_e/r about O,
    from the sums ``weight`` and ``weighed_rate``; ``flowing``, normal edges inside; ``odd``, makes no circle;
    ``circle``, row of C_r, -1: none; ``votes`` for each circle.
    """

    def __init__(self, rebels: int, circles: int) -> None:
        self.count = self.groups = 0
        self.verdict, self.label, self.group = [integers(rebels) for _ in range(3)]
        self.vx, self.vy, self.elapsed_s = [doubles(rebels) for _ in range(3)]
        self.inverse = doubles(rebels)
        self.members = Members(rebels)
        self.mean_vx, self.mean_vy, self.mean_s = [doubles(rebels) for _ in range(3)]
        self.closing_mps, self.focus_rate = [doubles(rebels) for _ in range(2)]
        self.focus_r2, self.below2, self.below_vy = [doubles(rebels) for _ in range(3)]
        self.rate_below, self.r2_below2 = [doubles(rebels) for _ in range(2)]
        self.then_x, self.then_y, self.spread, self.spreading = [doubles(rebels) for _ in range(4)]
        self.expansion, self.weight, self.weighed_rate = [doubles(rebels) for _ in range(3)]
        self.left, self.right, self.top, self.bottom = [doubles(rebels) for _ in range(4)]
        self.standing, self.inwards, self.flowing, self.circle = [integers(rebels) for _ in range(4)]
        self.odd = octets(rebels)
        self.votes = integers(rebels, circles)
        self.best_circle, self.best_group = (
            integers(rebels),
            integers(circles),
        )
        self.updated, self.missed = [octets(circles) for _ in range(2)]


# Prediction


def predict(circles: CircleColumns, around: Situation) -> None:
    """C'_r: at constant velocity in space the centre moves as a + b/τ, τ the time to contact, and R as 1/τ.

    Without a time to contact the centre moves on at constant speed. While the image is covered nothing moves.
    """
    if around.is_blind:
        return
    min_s = MIN_TTC_SHARE * around.horizon_s
    for c in range(circles.capacity):
        if not circles.active[c]:
            continue
        grow = 1.0
        if math.isfinite(circles.ttc[c]) and circles.ttc[c] > min_s:
            grow = min(circles.ttc[c] / max(circles.ttc[c] - around.dt_s, min_s), MAX_GROWTH)
        step = circles.speed[c] * around.dt_s * grow
        circles.x[c] += step * math.cos(circles.beta[c])
        circles.y[c] += step * math.sin(circles.beta[c])
        circles.speed[c] *= grow * grow
        circles.radius[c] *= grow
        circles.width[c] *= grow
        circles.height[c] *= grow
        circles.ttc[c] -= around.dt_s


def coasts(circles: CircleColumns, c: int, around: Situation, settings: Settings) -> bool:
    """Whether a trusted circle is so near that it grows too fast to be tracked.

    In a sharp turn it may be lost for another reason, and be passed.
    """
    return (
        circles.active[c] != 0
        and math.fabs(circles.ttc[c]) < COAST_SHARE * around.horizon_s
        and math.fabs(circles.ttc[c] * around.yaw_rate_radps) < MAX_TURN_RAD
        and max(circles.width[c], circles.height[c]) > settings.min_coast_px
        and circles.trust[c] >= settings.tr_coast
    )


def end_outside(circles: CircleColumns, plane: ImagePlane, around: Situation, settings: Settings) -> None:
    """End the circles that left the frame.

    A near one fills the image, and is not gone when its centre leaves: there the innermost point of its extent must
    leave, and the flow must be seen again.
    """
    for c in range(circles.capacity):
        near = coasts(circles, c, around, settings)
        if not circles.active[c] or (near and not around.flow_is_seen):
            continue
        half = 0.5 if near else 0.0
        across, down = half * circles.width[c], half * circles.height[c]
        x = circles.x[c] + min(max(around.pinhole.cx - circles.x[c], -across), across)
        y = circles.y[c] + min(max(around.pinhole.cy - circles.y[c], -down), down)
        if not image_plane.project(plane, x, y):
            circles.active[c] = 0


# Motion of what is inside


def circle_at(circles: CircleColumns, x: float, y: float, settings: Settings) -> int:
    """The nearest circle that contains a point, -1: none; only those from Tr_s up, and none in turmoil."""

    nearest = -1
    least = 0.0
    for c in range(circles.capacity):
        if circles.active[c] and circles.trust[c] >= settings.tr_s and not turmoil.is_shown_by(circles, c):
            away = lengths.of(x - circles.x[c], y - circles.y[c]) - circles.radius[c] - settings.member_margin_px
            if away < least:
                nearest, least = c, away
    return nearest


def looming_rate(circles: CircleColumns, c: int, horizon_s: float) -> float:
    """1/TTC, 1/s; 0 without contact, or when it is now."""
    return 1 / circles.ttc[c] if circles.ttc[c] > MIN_TTC_SHARE * horizon_s else 0.0


def velocity_x(circles: CircleColumns, c: int, x: float, horizon_s: float) -> float:
    """Image velocity to the right at ``x`` inside a circle, px/s: the circle's own plus looming."""
    own = circles.speed[c] * math.cos(circles.beta[c])
    return own + looming_rate(circles, c, horizon_s) * (x - circles.x[c])


def velocity_y(circles: CircleColumns, c: int, y: float, horizon_s: float) -> float:
    """Image velocity down at ``y`` inside a circle, px/s: the circle's own plus looming."""
    own = circles.speed[c] * math.sin(circles.beta[c])
    return own + looming_rate(circles, c, horizon_s) * (y - circles.y[c])


# Groups


def take_rebels(
    groups: RebelGroups,
    rebels: int,
    breaking: Integers,
    verdicts: Verdicts,
    edges: EdgeColumns,
    baselines: Baselines,
) -> None:
    """The rebels of this frame: the first ``rebels`` rows of ``breaking``, see ``alpha.gather_rebels``."""
    groups.count = rebels
    for k in range(rebels):
        j = breaking[k]
        i = verdicts.row[j]
        elapsed_s = baselines.elapsed_s[verdicts.slot[j]]
        groups.verdict[k], groups.elapsed_s[k], groups.label[k] = j, elapsed_s, k
        groups.vx[k] = (edges.x[i] - verdicts.x[j]) / elapsed_s
        groups.vy[k] = (edges.y[i] - verdicts.y[j]) / elapsed_s
        groups.inverse[k] = 0.0
        if verdicts.incoming[j]:
            groups.inverse[k] = verdicts.outward[j] / rebel_detection.lever_of(verdicts, j, baselines)


def noise_between(groups: RebelGroups, a: int, b: int) -> float:
    """Sum of the sigmas of two rebels' velocities, px/s."""
    return VELOCITY_NOISE_PX / groups.elapsed_s[a] + VELOCITY_NOISE_PX / groups.elapsed_s[b]


def are_linked(groups: RebelGroups, a: int, b: int, distance: float, around: Situation, settings: Settings) -> bool:
    """Whether two rebels, ``distance`` px apart, move together (eq. EdgeErcompareER, and by position).

    Near each other they must have a similar direction and speed, or differ no more than parts of an object that expands
    in the image. The few corners on something large and plain that passes fast lie farther apart: these must move
    almost the same, beyond noise.
    """
    ax, ay, bx, by = groups.vx[a], groups.vy[a], groups.vx[b], groups.vy[b]
    one, other = lengths.of(ax, ay), lengths.of(bx, by)
    slower, faster = min(one, other), max(one, other)
    near = max(settings.rebel_link_px, LINK_SHARE * around.horizon_s * faster)
    far = min(FAR_LINK_SHARE * around.horizon_s * faster, FAR_LINK_RAD * around.pinhole.focal)
    if distance >= max(near, far):  # most pairs
        return False
    difference = lengths.of(ax - bx, ay - by)
    noise = noise_between(groups, a, b)
    if distance >= near:
        return max(difference, noise) < FAR_LIKE_SPEED * faster
    if difference < noise + FASTEST_EXPANSION / around.horizon_s * distance:
        return True
    return (
        ax * bx + ay * by > math.cos(settings.eps_beta_rebel_rad) * one * other
        and difference < LIKE_SPEED * faster
        and faster <= slower + settings.eps_v_rebel * around.scene_flow_pxps
    )


def stand_together(groups: RebelGroups, a: int, b: int, distance: float, around: Situation) -> bool:
    """Whether two rebels that stand in the way, ``distance`` px apart, are at one range and near each other there.

    The few corners of something large and plain lie far apart in the image.
    """
    nearer, farther = max(groups.inverse[a], groups.inverse[b]), min(groups.inverse[a], groups.inverse[b])
    if not farther > 0 or distance >= NEAR_LINK_M * around.pinhole.fx * nearer:
        return False
    return nearer - farther < STAND_SHARE * nearer


def lowest_label(groups: RebelGroups, k: int) -> int:
    """The lowest rebel of a rebel's cluster (union-find, with path halving)."""
    while groups.label[k] != k:
        groups.label[k] = groups.label[groups.label[k]]
        k = groups.label[k]
    return k


def join(groups: RebelGroups, a: int, b: int) -> None:
    """Merge the clusters of two rebels."""
    one, other = lowest_label(groups, a), lowest_label(groups, b)
    groups.label[max(one, other)] = min(one, other)


def cluster(groups: RebelGroups, verdicts: Verdicts, edges: EdgeColumns, around: Situation, settings: Settings) -> None:
    """Cluster linked rebels."""
    for a in range(groups.count):
        i = verdicts.row[groups.verdict[a]]
        for b in range(a):
            k = verdicts.row[groups.verdict[b]]
            distance = lengths.of(edges.x[i] - edges.x[k], edges.y[i] - edges.y[k])
            if are_linked(groups, a, b, distance, around, settings) or stand_together(groups, a, b, distance, around):
                join(groups, a, b)


def near_link_px(y: float, around: Situation) -> float:
    """``NEAR_LINK_M`` at the range of the ground at image row ``y``, px: nothing seen there is farther off."""
    if not around.camera_height_m > 0:
        return 0.0
    return NEAR_LINK_M * max(y - around.horizon_y, 0.0) / around.camera_height_m


def join_near(groups: RebelGroups, verdicts: Verdicts, edges: EdgeColumns, around: Situation, support: int) -> None:
    """Merge groups of one near thing, whose corners lie far apart in the image, if they move alike.

    Not stationary ones: these spread over the ground.
    """
    measure_sizes(groups)
    for a in range(groups.count):
        i = verdicts.row[groups.verdict[a]]
        for b in range(a):
            if verdicts.incoming[groups.verdict[a]] or verdicts.incoming[groups.verdict[b]]:
                continue
            one, other = lowest_label(groups, a), lowest_label(groups, b)
            if one == other or groups.group[one] < support or groups.group[other] < support:
                continue
            k = verdicts.row[groups.verdict[b]]
            distance = lengths.of(edges.x[i] - edges.x[k], edges.y[i] - edges.y[k])
            if distance >= near_link_px(max(edges.y[i], edges.y[k]), around):
                continue
            difference = lengths.of(groups.vx[a] - groups.vx[b], groups.vy[a] - groups.vy[b])
            noise = noise_between(groups, a, b)
            if difference < noise + NEAR_LIKE_HZ * distance:
                join(groups, a, b)
                groups.group[min(one, other)] += groups.group[max(one, other)]


def measure_sizes(groups: RebelGroups) -> None:
    """Set ``group`` of the lowest rebel of each cluster to the size of the cluster."""
    for k in range(groups.count):
        groups.group[k] = 0
    for k in range(groups.count):
        groups.group[lowest_label(groups, k)] += 1


def number_groups(groups: RebelGroups, support: int) -> None:
    """Number the groups of at least ``support`` rebels."""
    groups.groups = 0
    measure_sizes(groups)
    for k in range(groups.count):
        lowest = lowest_label(groups, k)
        if lowest < k:
            groups.group[k] = groups.group[lowest]  # already numbered
        elif groups.group[k] >= support:
            groups.group[k] = groups.groups
            groups.groups += 1
        else:
            groups.group[k] = -1


def clear_group(groups: RebelGroups, g: int) -> None:
    """Reset a group."""
    shared.clear(groups.members, g)
    groups.mean_vx[g] = groups.mean_vy[g] = groups.mean_s[g] = 0.0
    groups.closing_mps[g] = groups.focus_rate[g] = groups.focus_r2[g] = groups.below2[g] = groups.below_vy[g] = 0.0
    groups.rate_below[g] = groups.r2_below2[g] = 0.0
    groups.then_x[g] = groups.then_y[g] = groups.spread[g] = groups.spreading[g] = 0.0
    groups.left[g] = groups.top[g] = INFINITY
    groups.right[g] = groups.bottom[g] = -INFINITY
    groups.flowing[g] = groups.standing[g] = groups.inwards[g] = 0


def average(
    groups: RebelGroups,
    members: Members,
    verdicts: Verdicts,
    edges: EdgeColumns,
    baselines: Baselines,
    around: Situation,
) -> None:
    """Compute the statistics of each group."""
    for g in range(groups.groups):
        clear_group(groups, g)
    for k in range(groups.count):
        if groups.group[k] >= 0:
            members.size[groups.group[k]] += 1
    for k in range(groups.count):
        g, j = groups.group[k], groups.verdict[k]
        if g < 0:
            continue
        i, slot = verdicts.row[j], verdicts.slot[j]
        share = 1.0 / members.size[g]
        from_x, from_y = verdicts.x[j] - baselines.focus_x[slot], verdicts.y[j] - baselines.focus_y[slot]
        r2 = from_x * from_x + from_y * from_y
        below = verdicts.y[j] - around.horizon_y
        members.x[g] += share * edges.x[i]
        members.y[g] += share * edges.y[i]
        groups.then_x[g] += share * verdicts.x[j]
        groups.then_y[g] += share * verdicts.y[j]
        groups.mean_vx[g] += share * groups.vx[k]
        groups.mean_vy[g] += share * groups.vy[k]
        groups.mean_s[g] += share * groups.elapsed_s[k]
        groups.closing_mps[g] += share * baselines.depth_m[slot] / groups.elapsed_s[k]
        groups.focus_rate[g] += share * verdicts.expansion[j] * r2
        groups.focus_r2[g] += share * r2
        groups.rate_below[g] += share * verdicts.expansion[j] * r2 * below
        groups.r2_below2[g] += share * r2 * below * below
        groups.below2[g] += share * below * below
        groups.below_vy[g] += share * below * groups.vy[k]
        groups.left[g], groups.right[g] = min(groups.left[g], edges.x[i]), max(groups.right[g], edges.x[i])
        groups.top[g], groups.bottom[g] = min(groups.top[g], edges.y[i]), max(groups.bottom[g], edges.y[i])
        if verdicts.incoming[j]:
            groups.standing[g] += 1
        if verdicts.mover[j] and verdicts.short[j] > math.fabs(verdicts.drift[j]):
            groups.inwards[g] += 1
    for k in range(groups.count):
        g = groups.group[k]
        if g >= 0:
            i = verdicts.row[groups.verdict[k]]
            dx, dy = edges.x[i] - members.x[g], edges.y[i] - members.y[g]
            members.variance_x[g] += dx * dx / members.size[g]
            members.variance_y[g] += dy * dy / members.size[g]
            j = groups.verdict[k]
            dx, dy = verdicts.x[j] - groups.then_x[g], verdicts.y[j] - groups.then_y[g]
            groups.spread[g] += dx * dx + dy * dy
            groups.spreading[g] += dx * (groups.vx[k] - groups.mean_vx[g]) + dy * (groups.vy[k] - groups.mean_vy[g])


def fit_expansion(groups: RebelGroups, verdicts: Verdicts) -> None:
    """V_e/r about O of each group, by least squares; far edges count more, outliers hardly.

    An outlier is an edge that took the place of another one; w = 1/(1 + (off/width)²)² (Geman and McClure).
    """
    for g in range(groups.groups):
        groups.expansion[g] = groups.focus_rate[g] / max(groups.focus_r2[g], MIN_EXTENT2_PX)
    for _ in range(STRAY_ROUNDS):
        for g in range(groups.groups):
            groups.weight[g] = groups.weighed_rate[g] = 0.0
        for k in range(groups.count):
            g, j = groups.group[k], groups.verdict[k]
            if g < 0:
                continue
            r2 = verdicts.r[j] * verdicts.r[j]
            noise = SPREAD_NOISE_PX / groups.elapsed_s[k] / verdicts.r[j] + STRAY_SHARE * math.fabs(groups.expansion[g])
            off = (verdicts.expansion[j] - groups.expansion[g]) / (STRAY_SIGMAS * noise)
            weight = r2 / ((1 + off * off) * (1 + off * off))
            groups.weight[g] += weight
            groups.weighed_rate[g] += weight * verdicts.expansion[j]
        for g in range(groups.groups):
            groups.expansion[g] = groups.weighed_rate[g] / max(groups.weight[g], MIN_EXTENT2_PX)


def spreads_less(groups: RebelGroups, g: int, rate: float) -> bool:
    """Whether the parts of a group move apart by less than an expansion demands. ``rate``: V_e/r, 1/s."""
    sigma = SPREAD_NOISE_PX / groups.mean_s[g] / math.sqrt(max(groups.spread[g], MIN_EXTENT2_PX))
    spreads = groups.spreading[g] / max(groups.spread[g], MIN_EXTENT2_PX)
    return spreads + SPREAD_SIGMAS * sigma < SPREAD_SHARE * rate


def is_shifted(groups: RebelGroups, g: int, members: Members) -> bool:
    """Whether a group that seems stationary and near does not spread accordingly.

    Its parts move outward from O at μ/t, and so apart from each other. An error of rotation, lens or O shifts them all
    alike.
    """
    if 2 * groups.standing[g] < members.size[g]:
        return False
    return spreads_less(groups, g, groups.expansion[g])


def is_mirrored(groups: RebelGroups, g: int, members: Members) -> bool:
    """Whether a group lies on a level plane: paint on the ground, or lamps reflected in a glossy floor.

    There μ/t grows with the distance h below the horizon, whereas on something upright it is the same everywhere: which
    of μ/t = k·h and μ/t = c has the smaller residual, by least squares in px/s.
    """
    level = groups.focus_rate[g] * groups.focus_rate[g] / max(groups.focus_r2[g], MIN_EXTENT2_PX)
    slope = groups.rate_below[g] * groups.rate_below[g] / max(groups.r2_below2[g], MIN_EXTENT2_PX)
    noise = MIRROR_NOISE_PX / groups.mean_s[g]
    better = (slope - level) * members.size[g]
    return groups.rate_below[g] > 0 and better > MIRROR_SIGMAS * MIRROR_SIGMAS * noise * noise


def is_flat(groups: RebelGroups, g: int, members: Members, around: Situation) -> bool:
    """Whether a group that falls short of the flow lies on the ground or below it, as paint and reflections do.

    A leader stands on the ground: from its foot it reaches up to a share of the camera's height. Where the ground
    itself does not flow, the vehicle is slower than measured, or its own parts are in view, and nothing there leads.
    """
    if 2 * groups.inwards[g] <= members.size[g]:
        return False
    lowest = around.horizon_y + around.pinhole.focal * around.pitch_sigma_rad
    if is_mirrored(groups, g, members) or (around.ground_is_still and members.y[g] > lowest):
        return True
    half = 0.5 * shared.EXTENT_SIGMAS * math.sqrt(members.variance_y[g])
    foot = max(members.y[g] + half - around.horizon_y, 0.0)
    return members.y[g] - half > lowest + (1 - LEADER_HEIGHT_SHARE) * foot


def is_paint(groups: RebelGroups, g: int, members: Members, around: Situation) -> bool:
    """Whether a group that seems to stand in the way lies below the horizon on a level plane."""
    return groups.top[g] > around.horizon_y and is_mirrored(groups, g, members)


def ground_would_flow(edges: EdgeColumns, i: int, around: Situation) -> bool:
    """Whether the ground at an edge would have visibly moved in ``LIKELY_OWN_S``.

    Near the focus distant ground does not, though it is no own part. True if the camera's height is unknown.
    """
    if not around.camera_height_m > 0:
        return True
    range_m = situation.ground_range_m(around, edges.y[i])
    away_px = lengths.of(edges.x[i] - around.focus_x, edges.y[i] - around.focus_y)
    return away_px * math.fabs(around.speed_mps) * LIKELY_OWN_S > SEEN_TO_MOVE_PX * range_m


def find_odd(groups: RebelGroups, members: Members, edges: EdgeColumns, around: Situation, settings: Settings) -> None:
    """Mark groups that make no circle: few among edges that follow the flow, flat, shifted, or own parts."""
    for g in range(groups.groups):
        margin = settings.member_margin_px
        left, right = groups.left[g] - margin, groups.right[g] + margin
        top, bottom = groups.top[g] - margin, groups.bottom[g] + margin
        own_parts = 0
        for i in range(edges.count):
            inside = left < edges.x[i] < right and top < edges.y[i] < bottom
            if not edges.matched[i] or not inside:
                continue
            if edges.fixed_s[i] >= LIKELY_OWN_S and ground_would_flow(edges, i, around):
                own_parts += 1
            elif edges.trust[i] > settings.tr_s and not edges.own_way(i):
                groups.flowing[g] += 1
        stands = 2 * groups.standing[g] >= members.size[g]
        least = settings.rebel_share if stands else max(settings.rebel_share, MOVER_SHARE)
        few = members.size[g] < least * (members.size[g] + groups.flowing[g]) or own_parts > OWN_SHARE * members.size[g]
        flat = is_flat(groups, g, members, around) or (stands and is_paint(groups, g, members, around))
        groups.odd[g] = 1 if few or flat or is_shifted(groups, g, members) else 0


# Groups and circles


def vote(
    groups: RebelGroups, verdicts: Verdicts, edges: EdgeColumns, circles: CircleColumns, settings: Settings
) -> None:
    """Rebels vote for the circles that contain them or did; too small a share of a group does not count."""
    for g in range(groups.groups):
        for c in range(circles.capacity):
            groups.votes[g, c] = 0
    for k in range(groups.count):
        g, i = groups.group[k], verdicts.row[groups.verdict[k]]
        if g < 0:
            continue
        for c in range(circles.capacity):
            away = lengths.of(edges.x[i] - circles.x[c], edges.y[i] - circles.y[c])
            inside = circles.active[c] != 0 and away < circles.radius[c] + settings.member_margin_px
            if inside or c == edges.circle[i]:
                groups.votes[g, c] += 1
    for g in range(groups.groups):
        for c in range(circles.capacity):
            if groups.votes[g, c] < max(settings.involvement * groups.members.size[g], 1.0):
                groups.votes[g, c] = 0


def choose(groups: RebelGroups, circles: CircleColumns) -> None:
    """Find the circle with the most votes for each unmatched group, and the group for each unmatched circle."""
    for c in range(circles.capacity):
        groups.best_group[c] = -1
    for g in range(groups.groups):
        groups.best_circle[g] = -1
        if groups.circle[g] >= 0:
            continue
        for c in range(circles.capacity):
            votes = groups.votes[g, c]
            if groups.updated[c] or votes == 0:
                continue
            if groups.best_circle[g] < 0 or votes > groups.votes[g, groups.best_circle[g]]:
                groups.best_circle[g] = c
            if groups.best_group[c] < 0 or votes > groups.votes[groups.best_group[c], c]:
                groups.best_group[c] = g


def involve(
    groups: RebelGroups, verdicts: Verdicts, edges: EdgeColumns, circles: CircleColumns, settings: Settings
) -> None:
    """Match groups and circles one to one by involvement (eq. percentinvolve), by mutual best choice."""
    vote(groups, verdicts, edges, circles, settings)
    for g in range(groups.groups):
        groups.circle[g] = -1
    for _ in range(2):
        choose(groups, circles)
        for g in range(groups.groups):
            c = groups.best_circle[g]
            if c >= 0 and groups.best_group[c] == g:
                groups.circle[g] = c
                groups.updated[c] = 1
    for g in range(groups.groups):
        if groups.odd[g] and groups.circle[g] >= 0:
            groups.updated[groups.circle[g]] = 0
            groups.circle[g] = -1


def is_aligned(
    groups: RebelGroups, g: int, circles: CircleColumns, c: int, around: Situation, settings: Settings
) -> bool:
    """Whether a group moves as its circle does (eq. EdgeCirclerebelcompareER); a slow one has less direction.

    The motion of turmoil is unknown, and always agrees.
    """
    if turmoil.is_shown_by(circles, c):
        return True
    beta, speed = math.atan2(groups.mean_vy[g], groups.mean_vx[g]), lengths.of(groups.mean_vx[g], groups.mean_vy[g])
    still = STILL_PX / groups.mean_s[g]
    turn = math.fabs(flow.wrap(beta - circles.beta[c]))
    most = circles.speed[c] + settings.eps_v_circle_rebel * around.scene_flow_pxps
    return speed <= most and turn < settings.eps_beta_circle_rebel_rad + math.atan2(still, speed)


def bounded(size_px: float, shown_px: float) -> float:
    """Limit an extent by that of the edges that show it, px."""
    return min(size_px, MAX_EXCESS * max(shown_px, MIN_SHOWN_PX))


def meet(groups: RebelGroups, g: int, circles: CircleColumns, around: Situation, settings: Settings) -> None:
    """Update a group's circle: aligned Tr +1, less for few rebels, else -1.

    An object keeps showing other parts of itself, so its extent grows at once and shrinks slowly.
    """
    c = groups.circle[g]
    trust, width, height = circles.trust[c], circles.width[c], circles.height[c]
    sure = min(1.0, float(groups.members.size[g]) / SURE_REBELS)
    change = sure if is_aligned(groups, g, circles, c, around, settings) else -1.0
    shared.blend(circles, c, groups.members, g, settings)
    slow_width = edge_equations.update_position(trust, settings.tr_cr, width, circles.width[c])
    slow_height = edge_equations.update_position(trust, settings.tr_cr, height, circles.height[c])
    shown_width, shown_height = circles.width[c], circles.height[c]
    circles.width[c] = bounded(max(shown_width, slow_width), shown_width)
    circles.height[c] = bounded(max(shown_height, slow_height), shown_height)
    circles.radius[c] = bounded(circles.radius[c], shared.radius_of(groups.members, g, settings.bs_px))
    circles.trust[c] = edge_equations.change_trust(trust, change, settings.tr_max)


def largest_new(groups: RebelGroups) -> int:
    """The largest group without a circle, -1: none."""
    largest = -1
    for g in range(groups.groups):
        if groups.circle[g] >= 0 or groups.odd[g]:
            continue
        if largest < 0 or groups.members.size[g] > groups.members.size[largest]:
            largest = g
    return largest


def found(groups: RebelGroups, edges: EdgeColumns, circles: CircleColumns, settings: Settings, ids: Ids) -> None:
    """Found circles for the groups without one, largest first."""
    g = largest_new(groups)
    while g >= 0:
        c = shared.row_for_newborn(edges, circles, True, settings)
        if c >= 0:
            shared.give_birth(circles, c, groups.members, g, settings, ids)
            if groups.members.size[g] < SURE_REBELS:
                circles.trust[c] = settings.tr_cr
            groups.circle[g] = c
            groups.updated[c] = 1
        else:
            groups.odd[g] = 1
        g = largest_new(groups)


# Contact


def own_expansion(groups: RebelGroups, g: int) -> float:
    """V_e/r of something that moves on the ground, 1/s; 0 where it does not exceed its noise.

    Fitted to the vertical motion about the horizon, which sideways motion does not affect. Where the horizon is wrong,
    that moves things that stay as far away as they are, but not their parts apart.
    """
    extent2 = max(groups.below2[g], MIN_EXTENT2_PX)
    rate = groups.below_vy[g] / extent2
    sigma = VELOCITY_NOISE_PX / groups.mean_s[g] / math.sqrt(extent2 * groups.members.size[g])
    return rate if rate > RATE_SIGMAS * sigma and not spreads_less(groups, g, rate) else 0.0


def expansion_of(groups: RebelGroups, g: int, stands: bool, range_m: float, around: Situation) -> float:
    """1/TTC of a group, 1/s: stationary things close at V_ν, moving ones expand about the horizon."""
    if not stands:
        return own_expansion(groups, g)
    if not math.isfinite(around.speed_mps):
        return groups.expansion[g]
    return max(around.speed_mps, 0.0) / max(range_m, MIN_RANGE_M)


def contact(groups: RebelGroups, g: int, circles: CircleColumns, around: Situation, settings: Settings) -> None:
    """Set cause, time to contact, range and lateral miss of a group's circle.

    Stationary things expand about the focus, moving ones about the horizon: 1/TTC = V_e/r, fitted over the members.
    """
    c = groups.circle[g]
    stands = 2 * groups.standing[g] >= groups.members.size[g]
    range_m = groups.closing_mps[g] / max(groups.expansion[g], MIN_RATE)
    rate = expansion_of(groups, g, stands, range_m, around)
    rate = shared.contact_rate(circles, c, rate, around.dt_s, settings)
    circles.ttc[c] = 1 / rate if rate * MAX_TTC_HORIZONS * around.horizon_s > 1 else INFINITY

    on_ground_m = situation.ground_range_m(around, circles.y[c] + 0.5 * circles.height[c])
    aside_mps = on_ground_m * groups.mean_vx[g] / around.pinhole.fx
    right_m = (circles.x[c] - around.focus_x) / around.pinhole.fx * range_m
    circles.range[c] = range_m if stands else on_ground_m
    circles.lateral[c] = path.miss(right_m, range_m, around) if stands else aside_mps * finite(circles.ttc[c])
    if stands and not math.isfinite(around.speed_mps):
        circles.range[c] = circles.lateral[c] = NAN
    if circles.range[c] > MAX_RANGE_M:
        circles.range[c] = NAN
    if math.fabs(circles.lateral[c]) > MAX_RANGE_M:
        circles.lateral[c] = NAN
    circles.cause[c] = cause_of(groups, g, circles, stands, aside_mps, around)


def finite(value: float) -> float:
    """Return the value, NaN for infinity."""
    return value if math.isfinite(value) else NAN


def cause_of(
    groups: RebelGroups, g: int, circles: CircleColumns, stands: bool, aside_mps: float, around: Situation
) -> int:
    """Cause of a group's circle. ``aside_mps``: sideways speed, if it moves on the ground; NaN: unknown."""
    c = groups.circle[g]
    beside = math.fabs(circles.lateral[c]) > around.half_width_m
    if stands or (circles.ttc[c] < around.horizon_s and not beside):
        return INCOMING
    crosses = math.fabs(aside_mps) > SIDEWAYS * math.fabs(around.speed_mps)
    return LEADING if 2 * groups.inwards[g] > groups.members.size[g] and not crosses else CROSSING


# Circles without a group


def is_hidden(circles: CircleColumns, c: int, settings: Settings) -> bool:
    """Whether a circle is occluded by one with an earlier contact."""
    if circles.trust[c] < settings.tr_s or not math.isfinite(circles.ttc[c]):
        return False
    for o in range(circles.capacity):
        if circles.active[o] and circles.trust[o] >= settings.tr_s and circles.ttc[o] < circles.ttc[c]:
            reach = circles.radius[o] + settings.member_margin_px
            across = math.fabs(circles.x[c] - circles.x[o]) < max(0.5 * circles.width[o], reach)
            if across and math.fabs(circles.y[c] - circles.y[o]) < max(0.5 * circles.height[o], reach):
                return True
    return False


def lose_trust(groups: RebelGroups, circles: CircleColumns, around: Situation, settings: Settings) -> None:
    """Unmatched circles lose trust, coasting or hidden ones only after a while, and end below Tr_cr.

    A near one may hide all flow: then it continues until contact. While something covers the image nothing is known:
    all circles stay, but must be seen as soon as the image is.
    """
    for c in range(circles.capacity):
        circles.unseen_s[c] = 0.0 if groups.updated[c] else circles.unseen_s[c] + around.dt_s
        near = coasts(circles, c, around, settings)
        waits = near or is_hidden(circles, c, settings)
        waits = waits and circles.unseen_s[c] < COAST_TIME_SHARE * around.horizon_s
        waits = waits or (near and not around.flow_is_seen)
        if around.is_blind and circles.unseen_s[c] < BLIND_S:
            circles.trust[c] = min(circles.trust[c], settings.tr_s)
            waits = True
        groups.missed[c] = 1 if circles.active[c] and not groups.updated[c] and not waits else 0
    for c in range(circles.capacity):
        if groups.missed[c]:
            circles.trust[c] -= 1
        if not circles.ttc[c] > 0 or circles.trust[c] < settings.tr_cr:
            circles.active[c] = 0


def update(
    groups: RebelGroups,
    edges: EdgeColumns,
    circles: CircleColumns,
    verdicts: Verdicts,
    breaking: Integers,
    rebels: int,
    patches: Patches,
    patch_groups: PatchGroups,
    disorder: Turmoil,
    coarse: CoarseMotion,
    coarse_groups: CoarseGroups,
    baselines: Baselines,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> None:
    """C_r from E_r (eqs. EdgeErcompareER, EdgeCirclerebelcompareER, percentinvolve), patches, coarse motion, turmoil.

    The rebels are the first ``rebels`` rows of ``breaking``, see ``alpha.gather_rebels``.
    """
    for c in range(circles.capacity):
        groups.updated[c] = 0
    take_rebels(groups, rebels, breaking, verdicts, edges, baselines)
    cluster(groups, verdicts, edges, around, settings)
    join_near(groups, verdicts, edges, around, settings.rebel_support)
    number_groups(groups, settings.rebel_support)
    average(groups, groups.members, verdicts, edges, baselines, around)
    fit_expansion(groups, verdicts)
    find_odd(groups, groups.members, edges, around, settings)
    involve(groups, verdicts, edges, circles, settings)
    for g in range(groups.groups):
        if groups.circle[g] >= 0:
            meet(groups, g, circles, around, settings)
    found(groups, edges, circles, settings, ids)
    for g in range(groups.groups):
        c = groups.circle[g]
        if c >= 0:
            circles.beta[c] = math.atan2(groups.mean_vy[g], groups.mean_vx[g])
            circles.speed[c] = lengths.of(groups.mean_vx[g], groups.mean_vy[g])
            contact(groups, g, circles, around, settings)
    for k in range(groups.count):
        if groups.group[k] >= 0:
            edges.circle[verdicts.row[groups.verdict[k]]] = groups.circle[groups.group[k]]
    patch_circles.update(patch_groups, patches, edges, circles, groups.updated, around, settings, ids)
    coarse_circles.update(coarse_groups, coarse, edges, circles, groups.updated, around, settings, ids)
    turmoil.update(disorder, edges, circles, groups.updated, coarse, around, settings, ids)
    lose_trust(groups, circles, around, settings)
    shared.release(edges, circles, True)
