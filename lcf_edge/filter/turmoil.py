"""Turmoil: regions where edges come and go and hardly any is found again, though a static scene would hardly move.

Something that tumbles, spins or bursts keeps no corner for two frames, and so shows no rebel: the flow breaks as a
whole. The image is divided into cells, and found and lost edges are counted in each. Near O, or at rest, even something
one second from contact is found again from frame to frame. A region where nearly all edges are lost, for several
frames, while the rest of the image is found, becomes a circle of C_r, with unknown time to contact.
"""

import math

from lcf_edge.filter import circles as shared
from lcf_edge.filter import coarse_motion, edge_equations, lengths, rounding, situation
from lcf_edge.filter.circles import Ids, Members
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.columns import CircleColumns, EdgeColumns
from lcf_edge.filter.memory import Bytes, Doubles, doubles, integers, octets
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import Cause

ACROSS = 20  # cells in a row; each is judged with the eight around it
HALF_LIFE_S = 0.15  # of the counts
MIN_EDGES = 25.0  # counted lately,
MIN_LOST = 6.0  # and lost in this frame, so that one bad image is no turmoil
FOUND_SHARE = 0.15  # found lately, at most,
FOUND_NOW_SHARE = 0.2  # and in this frame; elsewhere more than that,
FOUND_ELSEWHERE = 0.35  # and lately this share, where edges are found at all
LOST_STILL_SHARE = 0.3  # found, at most, where a circle continues
BLIND_SHARE = 0.15  # found of all edges, at most, where something covers the image
MIN_HIDDEN = 6.0  # trusted edges lost in this frame, where something occludes them,
HIDDEN_FOUND_SHARE = 0.05  # and found, at most, as a share of these
MIN_HIDDEN_CELLS = 6  # occluded cells of a region: smaller ones show what passes far off
MIN_HIDDEN_S = 0.09  # duration of occlusion before it counts; lost edges soon lose their trust
MIN_CELLS = 3  # cells of a region that are in turmoil
CHANGED_SHARE = 0.02  # least share of its pieces that changed; fine texture keeps no corner either, but it stands
MIN_S = 0.15  # duration of turmoil before it counts
MET_S = 1.0  # what is met later than this is found again;
SLOW_MPS = 0.5  # for a slower vehicle, all that is farther off than this speed covers in that time
NONE = int(Cause.NONE)
INFINITY = float("inf")


class Turmoil:
    """One row per cell of the image, row-major.

    ``across``, ``down``: number of cells; ``side_px``, ``per_px``: their side and its inverse. ``found``, ``lost``:
    edges, decaying with ``HALF_LIFE_S``; ``found_now``, ``lost_now``: in this frame, ``trusted_now``, ``hidden_now``:
    trusted ones of these. ``standing``, ``changed``: pieces of the downscaled image that are stationary or have
    changed, decaying as well. ``unruly``: whether it and the cells around it are in turmoil, ``hidden``: occluded;
    ``lasts_s``: for how long it or a neighbour has been; ``place``: the region that it belongs to, -1: none.

    One row per region ("place"): ``members``, its edges; ``weight``, their recent number; ``size``, ``hidden_size``,
    its cells in turmoil and occluded; ``longest_s``, its duration; ``all_standing``, ``all_changed``, its pieces.
    """

    def __init__(self, width: int, height: int) -> None:
        self.across = ACROSS
        self.side_px, self.per_px = width / ACROSS, ACROSS / width
        self.down = (height * ACROSS + width - 1) // width
        cells = self.across * self.down
        self.found, self.lost, self.found_now, self.lost_now = [doubles(cells) for _ in range(4)]
        self.trusted_now, self.hidden_now = doubles(cells), doubles(cells)
        self.standing, self.changed = doubles(cells), doubles(cells)
        self.unruly, self.hidden = octets(cells), octets(cells)
        self.lasts_s = doubles(cells)
        self.place = integers(cells)
        self.members = Members(cells)
        self.size, self.hidden_size = integers(cells), integers(cells)
        self.weight, self.longest_s = doubles(cells), doubles(cells)
        self.all_standing, self.all_changed = doubles(cells), doubles(cells)


def cell_at(turmoil: Turmoil, x: float, y: float) -> int:
    """The cell that contains a point, -1: none."""
    column, row = x * turmoil.per_px, y * turmoil.per_px
    if x < 0 or y < 0 or column >= turmoil.across or row >= turmoil.down:
        return -1
    return rounding.whole(row) * turmoil.across + rounding.whole(column)


def middle_x(turmoil: Turmoil, k: int) -> float:
    """Of a cell, px."""
    return (k % turmoil.across + 0.5) * turmoil.side_px


def middle_y(turmoil: Turmoil, k: int) -> float:
    """Of a cell, px."""
    return (k // turmoil.across + 0.5) * turmoil.side_px


def count(turmoil: Turmoil, edges: EdgeColumns, around: Situation, settings: Settings) -> None:
    """Count which edges of the last frame are found in this one, before the lost ones are deleted.

    Not in a quick turn, whose motion blur loses edges.
    """
    kept = math.exp(-math.log(2.0) * around.dt_s / HALF_LIFE_S)
    for k in range(turmoil.across * turmoil.down):
        turmoil.found[k] *= kept
        turmoil.lost[k] *= kept
        turmoil.standing[k] *= kept
        turmoil.changed[k] *= kept
        turmoil.found_now[k] = turmoil.lost_now[k] = turmoil.trusted_now[k] = turmoil.hidden_now[k] = 0.0
    if math.fabs(around.yaw_rate_radps) * around.dt_s * around.pinhole.focal > settings.bl0_px:
        return
    for i in range(edges.count):
        k = cell_at(turmoil, edges.predicted_x[i], edges.predicted_y[i])
        if k < 0 or edges.held[i]:
            continue
        trusted = 1 if edges.trust[i] >= settings.tr_s else 0
        if edges.corner[i] >= 0:
            turmoil.found_now[k] += 1
            turmoil.trusted_now[k] += trusted
        else:
            turmoil.lost_now[k] += 1
            turmoil.hidden_now[k] += trusted
    for k in range(turmoil.across * turmoil.down):
        turmoil.found[k] += turmoil.found_now[k]
        turmoil.lost[k] += turmoil.lost_now[k]


def count_pieces(turmoil: Turmoil, coarse: CoarseMotion) -> None:
    """Count which pieces of the downscaled image are stationary, and which have changed."""
    for p in range(coarse.columns * coarse.rows):
        k = cell_at(turmoil, coarse.x[p], coarse.y[p])
        if k >= 0 and coarse.stance[p] == coarse_motion.STANDS:
            turmoil.standing[k] += 1
        elif k >= 0 and coarse.stance[p] == coarse_motion.CHANGED:
            turmoil.changed[k] += 1


def is_all_lost(turmoil: Turmoil, before: bool) -> bool:
    """Whether hardly an edge of the whole image is found in this frame; with few, only if it was so ``before``."""
    found = lost = 0.0
    for k in range(turmoil.across * turmoil.down):
        found += turmoil.found_now[k]
        lost += turmoil.lost_now[k]
    return found <= BLIND_SHARE * (found + lost) and (before or lost >= MIN_EDGES)


def is_inner(turmoil: Turmoil, k: int) -> bool:
    """Whether a cell has neighbours on all sides; at the border edges are lost because they leave the image."""
    column, row = k % turmoil.across, k // turmoil.across
    return 0 < column < turmoil.across - 1 and 0 < row < turmoil.down - 1


def with_those_around(values: Doubles, turmoil: Turmoil, k: int) -> float:
    """Sum over an inner cell and its eight neighbours."""
    total = 0.0
    for row in range(-1, 2):
        middle = k + row * turmoil.across
        total += values[middle - 1] + values[middle] + values[middle + 1]
    return total


def stays_px(turmoil: Turmoil, k: int, around: Situation) -> float:
    """Largest motion per frame, at a cell, of a static scene that is met in ``MET_S`` or later, or is ground, px."""
    x, y = middle_x(turmoil, k), middle_y(turmoil, k)
    rate = 1 / MET_S
    if math.fabs(around.speed_mps) < SLOW_MPS:
        rate *= math.fabs(around.speed_mps) / SLOW_MPS
    ground_m = situation.ground_range_m(around, y)
    if math.fabs(around.speed_mps) > rate * ground_m:
        rate = math.fabs(around.speed_mps) / ground_m
    return rate * around.dt_s * lengths.of(x - around.focus_x, y - around.focus_y)


def is_unruly(turmoil: Turmoil, k: int, around: Situation, settings: Settings) -> bool:
    """Whether edges that should be found again are lost, in a cell and its neighbours."""
    if not turmoil.lost_now[k] > 0 or not is_inner(turmoil, k):
        return False
    lost_now = with_those_around(turmoil.lost_now, turmoil, k)
    if lost_now < MIN_LOST or with_those_around(turmoil.found_now, turmoil, k) > FOUND_NOW_SHARE * lost_now:
        return False
    found, lost = with_those_around(turmoil.found, turmoil, k), with_those_around(turmoil.lost, turmoil, k)
    if found + lost < MIN_EDGES or found > FOUND_SHARE * (found + lost):
        return False
    return stays_px(turmoil, k, around) <= settings.bl0_px


def is_hidden(turmoil: Turmoil, k: int) -> bool:
    """Whether something occludes a cell and its neighbours: hardly a trusted edge there is found."""
    if not turmoil.hidden_now[k] > 0 or not is_inner(turmoil, k):
        return False
    hidden = with_those_around(turmoil.hidden_now, turmoil, k)
    return hidden >= MIN_HIDDEN and with_those_around(turmoil.trusted_now, turmoil, k) <= HIDDEN_FOUND_SHARE * hidden


def mark(turmoil: Turmoil, k: int) -> None:
    """Add a cell and its neighbours to a region."""
    for row in range(-1, 2):
        for column in range(-1, 2):
            turmoil.place[k + row * turmoil.across + column] = k


def is_found_elsewhere(turmoil: Turmoil) -> bool:
    """Whether edges outside of turmoil are found, in this frame and lately; for the latter the best cells count most.

    Something near that tumbles may fill much of the image, and its surroundings may be lost now and then.
    """
    found = share = found_now = lost_now = 0.0
    for k in range(turmoil.across * turmoil.down):
        if turmoil.place[k] < 0 and turmoil.found[k] > 0:
            found += turmoil.found[k]
            share += turmoil.found[k] * turmoil.found[k] / (turmoil.found[k] + turmoil.lost[k])
            found_now += turmoil.found_now[k]
            lost_now += turmoil.lost_now[k]
    return share > FOUND_ELSEWHERE * found and found_now > FOUND_NOW_SHARE * lost_now


def see(turmoil: Turmoil, around: Situation, settings: Settings) -> bool:
    """Find the cells in turmoil, and for how long they have been; none if all the image is lost. Return whether any."""
    is_any = False
    for k in range(turmoil.across * turmoil.down):
        turmoil.place[k] = -1
    for k in range(turmoil.across * turmoil.down):
        turmoil.unruly[k] = is_unruly(turmoil, k, around, settings)
        turmoil.hidden[k] = is_hidden(turmoil, k)
        if turmoil.unruly[k] or turmoil.hidden[k]:
            mark(turmoil, k)
            is_any = True
    is_any = is_any and is_found_elsewhere(turmoil)
    for k in range(turmoil.across * turmoil.down):
        turmoil.lasts_s[k] = turmoil.lasts_s[k] + around.dt_s if is_any and turmoil.place[k] >= 0 else 0.0
    return is_any


def join_cells(turmoil: Turmoil) -> None:
    """Merge adjoining cells into regions, labelled by their lowest cell."""
    for k in range(turmoil.across * turmoil.down):
        if turmoil.place[k] >= 0:
            turmoil.place[k] = k
    changed = True
    while changed:
        changed = False
        for k in range(turmoil.across * turmoil.down):
            if turmoil.place[k] < 0:
                continue
            column, row = k % turmoil.across, k // turmoil.across
            for y in range(max(row - 1, 0), min(row + 2, turmoil.down)):
                for x in range(max(column - 1, 0), min(column + 2, turmoil.across)):
                    other = turmoil.place[y * turmoil.across + x]
                    if 0 <= other < turmoil.place[k]:
                        turmoil.place[k] = other
                        changed = True


def gather(turmoil: Turmoil) -> None:
    """Compute the statistics of each region; edges are taken as uniform within their cell."""
    spread = turmoil.side_px * turmoil.side_px / 12
    cells = turmoil.across * turmoil.down
    for g in range(cells):
        shared.clear(turmoil.members, g)
        turmoil.weight[g] = turmoil.longest_s[g] = turmoil.all_standing[g] = turmoil.all_changed[g] = 0.0
        turmoil.size[g] = turmoil.hidden_size[g] = 0
    for k in range(cells):
        g = turmoil.place[k]
        if g >= 0:
            weight = turmoil.found[k] + turmoil.lost[k]
            turmoil.weight[g] += weight
            turmoil.all_standing[g] += turmoil.standing[k]
            turmoil.all_changed[g] += turmoil.changed[k]
            turmoil.size[g] += turmoil.unruly[k]
            turmoil.hidden_size[g] += turmoil.hidden[k]
            turmoil.longest_s[g] = max(turmoil.longest_s[g], turmoil.lasts_s[k])
            turmoil.members.size[g] += rounding.whole(turmoil.found_now[k] + turmoil.lost_now[k])
            turmoil.members.x[g] += weight * middle_x(turmoil, k)
            turmoil.members.y[g] += weight * middle_y(turmoil, k)
    for g in range(cells):
        if turmoil.place[g] == g:
            turmoil.members.x[g] /= turmoil.weight[g]
            turmoil.members.y[g] /= turmoil.weight[g]
            turmoil.members.variance_x[g] = turmoil.members.variance_y[g] = spread
    for k in range(cells):
        g = turmoil.place[k]
        if g >= 0:
            share = (turmoil.found[k] + turmoil.lost[k]) / turmoil.weight[g]
            dx, dy = middle_x(turmoil, k) - turmoil.members.x[g], middle_y(turmoil, k) - turmoil.members.y[g]
            turmoil.members.variance_x[g] += share * dx * dx
            turmoil.members.variance_y[g] += share * dy * dy


def is_believed(turmoil: Turmoil, g: int, around: Situation) -> bool:
    """Whether a region is large and old enough: more than one image, much of which a fence that stands may hide."""
    longest_s = turmoil.longest_s[g]
    if turmoil.hidden_size[g] >= MIN_HIDDEN_CELLS and longest_s >= MIN_HIDDEN_S and longest_s > around.dt_s:
        return True
    return turmoil.size[g] >= MIN_CELLS and longest_s >= MIN_S


def looks_changed(turmoil: Turmoil, g: int) -> bool:
    """Whether the downscaled image shows that a region changed as well, or shows nothing."""
    return turmoil.all_changed[g] >= CHANGED_SHARE * (turmoil.all_standing[g] + turmoil.all_changed[g])


def is_shown_by(circles: CircleColumns, c: int) -> bool:
    """Whether a circle is in turmoil, with unknown motion."""
    return circles.active[c] != 0 and circles.cause[c] == NONE


def circle_of(turmoil: Turmoil, g: int, circles: CircleColumns, settings: Settings) -> int:
    """The circle of a region, -1: none. One in turmoil matches if their boxes overlap, since the centre of what a fast
    occluder hides leaps.
    """
    width = shared.EXTENT_SIGMAS * math.sqrt(turmoil.members.variance_x[g])
    height = shared.EXTENT_SIGMAS * math.sqrt(turmoil.members.variance_y[g])
    nearest, least = -1, INFINITY
    for c in range(circles.capacity):
        if is_shown_by(circles, c):
            dx, dy = circles.x[c] - turmoil.members.x[g], circles.y[c] - turmoil.members.y[g]
            meets = 2 * math.fabs(dx) < circles.width[c] + width and 2 * math.fabs(dy) < circles.height[c] + height
            if meets and lengths.of(dx, dy) < least:
                nearest, least = c, lengths.of(dx, dy)
    return nearest if nearest >= 0 else shared.nearest_circle(turmoil.members, g, circles, settings)


def set_cause(circles: CircleColumns, c: int, around: Situation) -> None:
    """Set a circle in turmoil: its motion is unknown, its range that of the ground seen under it."""
    circles.cause[c] = NONE
    circles.beta[c] = circles.speed[c] = 0.0
    circles.range[c] = situation.ground_range_m(around, circles.y[c] + 0.5 * circles.height[c])


def rages_on(turmoil: Turmoil, circles: CircleColumns, c: int) -> bool:
    """Whether most edges are still lost at the centre of a circle in turmoil, though fewer than would found one."""
    k = cell_at(turmoil, circles.x[c], circles.y[c])
    if k < 0 or not is_inner(turmoil, k):
        return False
    found, lost = with_those_around(turmoil.found, turmoil, k), with_those_around(turmoil.lost, turmoil, k)
    return found + lost >= MIN_EDGES and found <= LOST_STILL_SHARE * (found + lost)


def update(
    turmoil: Turmoil,
    edges: EdgeColumns,
    circles: CircleColumns,
    updated: Bytes,
    coarse: CoarseMotion,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> None:
    """Update C_r from regions in turmoil.

    ``updated``: circles that other sources have updated, which are left alone; those updated here are marked too.
    """
    seen = see(turmoil, around, settings)
    for c in range(circles.capacity):
        if is_shown_by(circles, c) and not updated[c]:
            updated[c] = rages_on(turmoil, circles, c)
    count_pieces(turmoil, coarse)
    if not seen:
        return
    join_cells(turmoil)
    gather(turmoil)
    for g in range(turmoil.across * turmoil.down):
        if turmoil.place[g] != g or not is_believed(turmoil, g, around):
            continue
        c = circle_of(turmoil, g, circles, settings)
        if c < 0 and not looks_changed(turmoil, g):
            continue
        if c < 0:
            c = shared.row_for_newborn(edges, circles, True, settings)
            if c < 0:
                continue
            shared.give_birth(circles, c, turmoil.members, g, settings, ids)
        elif updated[c] and not is_shown_by(circles, c):
            continue
        elif is_shown_by(circles, c):
            shared.blend(circles, c, turmoil.members, g, settings)
            circles.trust[c] = edge_equations.change_trust(circles.trust[c], 1.0, settings.tr_max)
        updated[c] = 1
        if is_shown_by(circles, c):
            set_cause(circles, c, around)
