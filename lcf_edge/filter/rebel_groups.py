"""Rebel edges that move together, as groups: how they move and expand, and which of them make no circle."""

import math

from lcf_edge.filter import circles as shared
from lcf_edge.filter import lengths, rebel_detection, situation
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.circles import Members
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.memory import Integers, doubles, integers, octets
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation

VELOCITY_NOISE_PX = 4.0  # 1 sigma of a rebel's velocity, times its elapsed time
LIKE_SPEED = 0.5  # share by which the velocities of linked rebels may differ
RATE_SIGMAS = 2.0  # by which an expansion must exceed its noise
LEADER_HEIGHT_SHARE = 0.3  # least height of a leader, as a share of the camera's; paint and reflections have less,
DOUBTFUL_HEIGHT_SHARE = 0.5  # or this, above a glossy floor, or with fewer than
MANY_REBELS = 7  # rebels
MIRROR_NOISE_PX = 0.6  # 1 sigma of an edge's motion
MIRROR_SIGMAS = 3.0  # of it, by which a level plane must fit a group better than something upright
MOVER_SHARE = 0.25  # of the edges in a moving circle that must be rebels: in repetitive texture, edges swap places
LIKELY_OWN_S = 0.9  # an edge that has not moved in the image for this long may be an own part,
SEEN_TO_MOVE_PX = 3.0  # if the ground there would have moved by this; otherwise it may just be far off
OWN_SHARE = 0.1  # of a group's rebels: with more likely own parts among them, the group is one too
SPREAD_NOISE_PX = 0.85  # 1 sigma of an edge's motion, with the noise of two positions
STRAY_ROUNDS = 2
STRAY_SIGMAS = 2.0  # of its noise, and of
STRAY_SHARE = 0.25  # this share of the expansion: width beyond which an edge is an outlier
SPREAD_SIGMAS = 2.0  # of the measured spreading rate, by which
SWING_SIGMAS = 4.0  # or, of what moves and has limbs that swing, these,
SPREAD_SHARE = 0.5  # a group may spread less than this share of its expansion
MIN_EXTENT2_PX = 1.0  # px², least squared extent in a fit of an expansion
# Times are shares of the horizon, so that they hold for any speed.
FASTEST_EXPANSION = 4.0  # of one object, per horizon,
TURN_SHARE = 0.25  # of that, by which its parts may turn or come together
LINK_SHARE = 0.03  # rebels link over what the faster moves in this share of the horizon: near things are large;
FAR_LINK_SHARE = 0.08  # or in this share, where they move almost the same,
FAR_LINK_RAD = 0.35  # but no farther
NEAR_LINK_M = 0.3  # distance over which standing rebels link, and on the ground groups are merged
NEAR_LIKE_HZ = 0.3  # that move alike but for an expansion of this
STAND_SHARE = 0.3  # by which 1/Z of linked standing rebels may differ
FAR_LIKE_SPEED = 0.3  # difference of those, and their noise, at most, as a share of the faster one's speed
INFINITY = float("inf")


class RebelGroups:
    """The rebel edges of a frame, clustered into groups.

    One row per rebel: ``verdict``, its row of ``Verdicts``; ``vx``, ``vy``, px/s, measured over ``elapsed_s``;
    ``inverse``, 1/Z of one that stands in the way, else 0, 1/m; ``label``, parent in its cluster; ``group``, its group,
    -1: too small.

    One row per group: ``members``; means ``mean_vx``, ``mean_vy``, ``mean_s``; ``standing``, number of incoming edges;
    ``inwards``, of those that fall short of the flow; ``closing_mps``, mean ΔZ/t; ``focus_rate``, ``focus_r2``, means
    of μ/t·r² and r²; ``rate_below``, ``r2_below2``, means of μ/t·r²·h and r²·h², h px below the horizon; ``below2``,
    ``below_vy``, means of h² and h·v_y; ``below2_vy``, ``below4``, of h²·v_y and h⁴; ``then_x``, ``then_y``, mean of
    the earlier positions; ``spread``, ``spreading``, sums about that of squared distance, and of distance times
    velocity; ``expansion``, V_e/r about O, from the sums ``weight`` and ``weighed_rate``; ``flowing``, normal edges
    inside; ``odd``, makes no circle; ``circle``, row of C_r, -1: none; ``votes`` for each circle.
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
        self.below2_vy, self.below4 = [doubles(rebels) for _ in range(2)]
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


def are_linked(
    groups: RebelGroups,
    a: int,
    b: int,
    dx: float,
    dy: float,
    distance: float,
    around: Situation,
    settings: Settings,
) -> bool:
    """Whether two rebels, ``a`` at ``dx``, ``dy`` px from ``b``, move together (eq. EdgeErcompareER, and by position).

    Near each other they must have a similar direction and speed, or differ no more than parts of an object that expands
    in the image: these move apart, and hardly turn about each other or come together. The few corners on something
    large and plain that passes fast lie farther apart: these must move almost the same, beyond noise.
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
    fastest = FASTEST_EXPANSION / around.horizon_s * distance
    apart = ((ax - bx) * dx + (ay - by) * dy) / max(distance, 1.0)
    aside = math.sqrt(max(difference * difference - apart * apart, 0.0))
    if apart < noise + fastest and max(-apart, aside) < noise + TURN_SHARE * fastest:
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
    if not farther > 0 or distance >= min(NEAR_LINK_M * nearer, FAR_LINK_RAD) * around.pinhole.fx:
        return False
    return nearer - farther < STAND_SHARE * nearer


def are_on_body(
    groups: RebelGroups, a: int, b: int, edges: EdgeColumns, i: int, k: int, around: Situation, settings: Settings
) -> bool:
    """Whether two rebels, edges ``i`` and ``k``, may be corners of one large and plain thing.

    They move almost the same; it rises above the horizon, and hides all that flows behind it: none is between them.
    """
    ax, ay, bx, by = groups.vx[a], groups.vy[a], groups.vx[b], groups.vy[b]
    reach = 0.5 * lengths.of(edges.x[i] - edges.x[k], edges.y[i] - edges.y[k])
    if min(edges.y[i], edges.y[k]) >= around.horizon_y or 2 * reach >= FAR_LINK_RAD * around.pinhole.focal:
        return False
    most = LIKE_SPEED * max(lengths.of(ax, ay), lengths.of(bx, by))
    if max(lengths.of(ax - bx, ay - by), noise_between(groups, a, b)) >= most:
        return False
    x, y = 0.5 * (edges.x[i] + edges.x[k]), 0.5 * (edges.y[i] + edges.y[k])
    for n in range(edges.count):
        flows = edges.matched[n] and edges.trust[n] > settings.tr_s and not edges.own_way(n)
        if flows and lengths.of(edges.x[n] - x, edges.y[n] - y) < reach:
            return False
    return True


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
            dx, dy = edges.x[i] - edges.x[k], edges.y[i] - edges.y[k]
            distance = lengths.of(dx, dy)
            linked = are_linked(groups, a, b, dx, dy, distance, around, settings)
            if linked or stand_together(groups, a, b, distance, around):
                join(groups, a, b)


def join_sparse(
    groups: RebelGroups, verdicts: Verdicts, edges: EdgeColumns, around: Situation, settings: Settings
) -> None:
    """Merge clusters too small for a group where they may be corners of one large and plain thing."""
    measure_sizes(groups)
    for a in range(groups.count):
        if groups.group[lowest_label(groups, a)] >= settings.rebel_support:
            continue
        i = verdicts.row[groups.verdict[a]]
        for b in range(a):
            other, k = lowest_label(groups, b), verdicts.row[groups.verdict[b]]
            if other == lowest_label(groups, a) or groups.group[other] >= settings.rebel_support:
                continue
            if are_on_body(groups, a, b, edges, i, k, around, settings):
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
    groups.rate_below[g] = groups.r2_below2[g] = groups.below2_vy[g] = groups.below4[g] = 0.0
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
        groups.below4[g] += share * below * below * below * below
        groups.below2_vy[g] += share * below * below * groups.vy[k]
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


def spreads_less(groups: RebelGroups, g: int, rate: float, sigmas: float) -> bool:
    """Whether the parts of a group move apart by less than an expansion demands. ``rate``: V_e/r, 1/s."""
    sigma = SPREAD_NOISE_PX / groups.mean_s[g] / math.sqrt(max(groups.spread[g], MIN_EXTENT2_PX))
    spreads = groups.spreading[g] / max(groups.spread[g], MIN_EXTENT2_PX)
    return spreads + sigmas * sigma < SPREAD_SHARE * rate


def is_shifted(groups: RebelGroups, g: int, members: Members) -> bool:
    """Whether a group that seems stationary and near does not spread accordingly.

    Its parts move outward from O at μ/t, and so apart from each other. An error of rotation, lens or O shifts them all
    alike.
    """
    if 2 * groups.standing[g] < members.size[g]:
        return False
    return spreads_less(groups, g, groups.expansion[g], SPREAD_SIGMAS)


def explained(product: float, square: float) -> float:
    """What a fit of one factor explains, by least squares: mean(x·y)²/mean(x²)."""
    return product * product / max(square, MIN_EXTENT2_PX)


def is_mirrored(groups: RebelGroups, g: int, members: Members) -> bool:
    """Whether a group lies on a level plane: paint on the ground, or lamps reflected in a glossy floor.

    There μ/t grows with the distance h below the horizon, whereas on something upright it is the same everywhere: which
    of μ/t = k·h and μ/t = c has the smaller residual, by least squares in px/s. What crosses and comes nearer flows
    apart about another point than O, and its μ/t grows as well; but its v_y = c·h, and not k·h².
    """
    noise = MIRROR_SIGMAS * MIRROR_NOISE_PX / groups.mean_s[g]
    least = noise * noise / members.size[g]
    outward = explained(groups.rate_below[g], groups.r2_below2[g]) - explained(groups.focus_rate[g], groups.focus_r2[g])
    down = explained(groups.below_vy[g], groups.below2[g]) - explained(groups.below2_vy[g], groups.below4[g])
    return groups.rate_below[g] > 0 and outward > least and down <= least


def is_flat(groups: RebelGroups, g: int, members: Members, around: Situation) -> bool:
    """Whether a group that falls short of the flow lies on the ground or below it, as paint and reflections do.

    A leader stands on the ground: from its foot it reaches up to a share of the camera's height. Where the ground
    itself does not flow, the vehicle is slower than measured, or its own parts are in view, and nothing there leads.
    Before a vehicle at rest nothing flows: what moves towards O is neither. Other edges may seem to have fallen short,
    since it was at rest earlier than it knew.
    """
    if 2 * groups.inwards[g] <= members.size[g] or (situation.is_at_rest(around) and groups.focus_rate[g] < 0):
        return False
    lowest = around.horizon_y + around.pinhole.focal * around.pitch_sigma_rad
    if is_mirrored(groups, g, members) or (around.ground_is_still and members.y[g] > lowest):
        return True
    half = 0.5 * shared.EXTENT_SIGMAS * math.sqrt(members.variance_y[g])
    foot = max(members.y[g] + half - around.horizon_y, 0.0)
    is_doubtful = around.floor_mirrors or members.size[g] < MANY_REBELS
    share = DOUBTFUL_HEIGHT_SHARE if is_doubtful else LEADER_HEIGHT_SHARE
    return members.y[g] - half > lowest + (1 - share) * foot


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


def own_expansion(groups: RebelGroups, g: int) -> float:
    """V_e/r of something that moves on the ground, 1/s; 0 where it does not exceed its noise.

    Fitted to the vertical motion about the horizon, which sideways motion does not affect. About a wrong horizon, what
    only moves up or down seems to expand as well, but its parts do not move apart.
    """
    extent2 = max(groups.below2[g], MIN_EXTENT2_PX)
    rate = groups.below_vy[g] / extent2
    sigma = VELOCITY_NOISE_PX / groups.mean_s[g] / math.sqrt(extent2 * groups.members.size[g])
    return rate if rate > RATE_SIGMAS * sigma and not spreads_less(groups, g, rate, SWING_SIGMAS) else 0.0


def gather(
    groups: RebelGroups,
    edges: EdgeColumns,
    verdicts: Verdicts,
    breaking: Integers,
    rebels: int,
    baselines: Baselines,
    around: Situation,
    settings: Settings,
) -> None:
    """Make the groups of a frame of its rebels, the first ``rebels`` rows of ``breaking``."""
    take_rebels(groups, rebels, breaking, verdicts, edges, baselines)
    cluster(groups, verdicts, edges, around, settings)
    join_sparse(groups, verdicts, edges, around, settings)
    join_near(groups, verdicts, edges, around, settings.rebel_support)
    number_groups(groups, settings.rebel_support)
    average(groups, groups.members, verdicts, edges, baselines, around)
    fit_expansion(groups, verdicts)
    find_odd(groups, groups.members, edges, around, settings)
