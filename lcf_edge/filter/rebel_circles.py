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
    rebel_groups,
    situation,
    turmoil,
)
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.coarse_circles import CoarseGroups
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.columns import CircleColumns, EdgeColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.memory import Integers
from lcf_edge.filter.patch_circles import PatchGroups
from lcf_edge.filter.patches import Patches
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.rebel_groups import RebelGroups
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.turmoil import Turmoil
from lcf_edge.messages import Cause

STILL_PX = 6.0  # circles that moved less over that time have no direction
SIDEWAYS = 0.2  # sideways speed of a leader, at most, as a share of the vehicle's speed
MIN_RANGE_M = 0.01
MIN_RATE = 1e-6  # 1/s; slower expansions are none
MAX_GROWTH = 1.5  # of a circle in one frame
MAX_EXCESS = 2.0  # size of a circle, at most, in extents of the edges that show it,
MIN_SHOWN_PX = 12.0  # which count as at least this
SURE_REBELS = 5.0  # smaller groups must be seen once more before their circle is published
MAX_RANGE_M = 1000.0  # longer ranges are unknown,
MAX_TTC_HORIZONS = 10.0  # and later contacts, in horizons
COAST_SHARE = 0.25  # nearer contacts, in horizons, grow too fast for their corners to be tracked, and coast
COAST_TIME_SHARE = 0.1  # for this long
MIN_TTC_SHARE = 0.0125
BLIND_S = 1.0  # time that circles stay in place while the whole image is covered
MAX_TURN_RAD = 0.25  # of the path until contact: in a sharper turn, a circle may be lost for other reasons
CROSSING, INCOMING, LEADING = int(Cause.CROSSING), int(Cause.INCOMING), int(Cause.LEADING)
INFINITY = float("inf")
NAN = float("nan")


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


def expansion_of(groups: RebelGroups, g: int, stands: bool, range_m: float, around: Situation) -> float:
    """1/TTC of a group, 1/s: stationary things close at V_ν, moving ones expand about the horizon."""
    if not stands:
        return rebel_groups.own_expansion(groups, g)
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
    rebel_groups.gather(groups, edges, verdicts, breaking, rebels, baselines, around, settings)
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
