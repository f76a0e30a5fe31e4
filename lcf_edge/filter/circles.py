"""What normal and rebel circles share: identities, rows of the table, members, and the update from members."""

import math

from lcf_edge.filter import edge_equations, lengths, path
from lcf_edge.filter.columns import CircleColumns, EdgeColumns
from lcf_edge.filter.memory import doubles, integers
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import Cause

RADIUS_SIGMAS = 1.5  # R of a circle, in rms distances of its members from the centre
MIN_RADIUS_PX = 6.0
EXTENT_SIGMAS = 3.6  # full width of the members, in standard deviations
TRUST_A_FRAME = 0.25  # trust above Tr_cr that a predicted contact gets for each frame until then
MIN_RANGE_M = 0.01
LAST_ID = 0xFFFFFFFF
INCOMING = int(Cause.INCOMING)
INFINITY = float("inf")
NAN = float("nan")


class Ids:
    """Identities of new circles: never 0, reused only after 4 billion others."""

    def __init__(self) -> None:
        self.next = 1


def new_id(ids: Ids) -> int:
    """Return the next identity."""
    number = ids.next
    ids.next = number % LAST_ID + 1
    return number


class Members:
    """Statistics of the edges in each group, from which circles are updated; one row per group.

    ``size``: number of edges. ``x``, ``y``: their mean, px; ``variance_x``, ``variance_y`` about it, px².
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.size = integers(capacity)
        self.x, self.y, self.variance_x, self.variance_y = [doubles(capacity) for _ in range(4)]


def clear(members: Members, g: int) -> None:
    """Reset a group."""
    members.size[g] = 0
    members.x[g] = members.y[g] = members.variance_x[g] = members.variance_y[g] = 0.0


def radius_of(members: Members, g: int, max_px: float) -> float:
    """R that covers most of a group, px."""
    reach = RADIUS_SIGMAS * math.sqrt(members.variance_x[g] + members.variance_y[g])
    return min(max(reach, MIN_RADIUS_PX), max_px)


def blend(circles: CircleColumns, c: int, members: Members, g: int, settings: Settings) -> None:
    """Update a predicted circle from its members, weighted by trust (as eq. EnEstimation)."""
    trust, tr_cr = circles.trust[c], settings.tr_cr
    radius = radius_of(members, g, settings.bs_px)
    circles.x[c] = edge_equations.update_position(trust, tr_cr, circles.x[c], members.x[g])
    circles.y[c] = edge_equations.update_position(trust, tr_cr, circles.y[c], members.y[g])
    circles.radius[c] = edge_equations.update_position(trust, tr_cr, circles.radius[c], radius)
    describe(circles, c, members, g)


def confirm(circles: CircleColumns, c: int, members: Members, g: int, settings: Settings) -> None:
    """Update a circle from members that show it again: Tr +1."""
    blend(circles, c, members, g, settings)
    circles.trust[c] = edge_equations.change_trust(circles.trust[c], 1.0, settings.tr_max)


def contact_rate(circles: CircleColumns, c: int, rate: float, dt_s: float, settings: Settings) -> float:
    """1/TTC from prediction and measurement, by the equation of L, 1/s.

    A prediction counts less the sooner the contact: otherwise one that never comes would be imminent for ever.
    """
    if not math.isfinite(circles.ttc[c]):
        return rate
    left_s = max(circles.ttc[c], dt_s)
    trust = min(circles.trust[c], settings.tr_cr + TRUST_A_FRAME * left_s / dt_s)
    return edge_equations.update_position(trust, settings.tr_cr, 1 / left_s, rate)


def stand(circles: CircleColumns, c: int, x: float, range_m: float, around: Situation, settings: Settings) -> None:
    """Set cause, motion, time to contact, range and lateral miss of a circle: what it shows, at ``x``, stands."""
    right_m = (x - around.focus_x) / around.pinhole.fx * range_m
    rate = around.assumed_mps / max(path.way_to(right_m, range_m, around), MIN_RANGE_M)
    rate = contact_rate(circles, c, rate, around.dt_s, settings)
    circles.cause[c] = INCOMING
    circles.ttc[c], circles.range[c] = 1 / rate, range_m
    circles.lateral[c] = path.least_miss(right_m, range_m, around)
    if not math.isfinite(around.speed_mps):
        circles.range[c] = circles.lateral[c] = NAN
    dx, dy = circles.x[c] - around.focus_x, circles.y[c] - around.focus_y
    circles.beta[c], circles.speed[c] = math.atan2(dy, dx), rate * lengths.of(dx, dy)


def describe(circles: CircleColumns, c: int, members: Members, g: int) -> None:
    """Set support and extent of a circle from its members."""
    circles.support[c] = members.size[g]
    circles.width[c] = EXTENT_SIGMAS * math.sqrt(members.variance_x[g])
    circles.height[c] = EXTENT_SIGMAS * math.sqrt(members.variance_y[g])


def give_birth(circles: CircleColumns, c: int, members: Members, g: int, settings: Settings, ids: Ids) -> None:
    """Make a new circle from its members: Tr = ½(Tr_cr + Tr_s), no time to contact yet."""
    begin(circles, c, ids)
    circles.x[c], circles.y[c] = members.x[g], members.y[g]
    circles.radius[c] = radius_of(members, g, settings.bs_px)
    describe(circles, c, members, g)
    circles.trust[c] = settings.tr_new


def begin(circles: CircleColumns, c: int, ids: Ids) -> None:
    """Start a new circle in row ``c`` with a new identity and nothing else known."""
    circles.active[c] = 1
    circles.id[c] = new_id(ids)
    circles.corr[c] = 1.0
    circles.cause[c] = 0
    circles.ttc[c], circles.range[c], circles.lateral[c] = INFINITY, NAN, NAN
    circles.unseen_s[c] = 0.0
    circles.square[c] = -1


def nearest_circle(members: Members, g: int, circles: CircleColumns, settings: Settings) -> int:
    """The nearest circle that contains a group's centre, or whose centre the group contains; -1: none."""
    nearest, least = -1, 0.0
    reach = radius_of(members, g, settings.bs_px) + settings.member_margin_px
    for c in range(circles.capacity):
        if circles.active[c]:
            away = lengths.of(circles.x[c] - members.x[g], circles.y[c] - members.y[g])
            away -= max(circles.radius[c], reach)
            if away < least:
                nearest, least = c, away
    return nearest


def free_row(circles: CircleColumns) -> int:
    """The first row not in use, -1: none."""
    for c in range(circles.capacity):
        if not circles.active[c]:
            return c
    return -1


def weakest_row(circles: CircleColumns, settings: Settings) -> int:
    """Row of the least trusted circle, if it is trusted less than a new one; -1: none."""
    weakest = -1
    for c in range(circles.capacity):
        if not circles.active[c] or circles.trust[c] >= settings.tr_new:
            continue
        if weakest < 0 or circles.trust[c] < circles.trust[weakest]:
            weakest = c
    return weakest


def release(edges: EdgeColumns, circles: CircleColumns, rebel: bool) -> None:
    """Detach edges from circles that ended. ``rebel``: C_r, else C_n."""
    for i in range(edges.count):
        c = edges.circle[i]
        if c >= 0 and (edges.rebel[i] != 0) == rebel and not circles.active[c]:
            edges.circle[i] = -1


def make_room(edges: EdgeColumns, circles: CircleColumns, rebel: bool, settings: Settings) -> int:
    """End the least trusted circle, if it is trusted less than a new one; return its row, -1: there is none."""
    c = weakest_row(circles, settings)
    if c >= 0:
        circles.active[c] = 0
        release(edges, circles, rebel)
    return c


def row_for_newborn(edges: EdgeColumns, circles: CircleColumns, rebel: bool, settings: Settings) -> int:
    """A row for a new circle, free or evicted; -1: there is none. ``rebel``: of C_r, else of C_n.

    In a full table this counts as an eviction: of the circle whose row it was, or else of the new one.
    """
    c = free_row(circles)
    if c < 0:
        circles.evicted += 1
        c = make_room(edges, circles, rebel, settings)
    return c
