"""Circle expert, C_r from coarse motion: pieces of the downscaled image that touch and move alike."""

import math

from lcf_edge.filter import body_ahead, coarse_motion, lengths, situation
from lcf_edge.filter import circles as shared
from lcf_edge.filter.body_ahead import BodyAhead
from lcf_edge.filter.circles import Ids, Members
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.columns import CircleColumns, EdgeColumns
from lcf_edge.filter.memory import Bytes, doubles, integers
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import Cause

LINKS = 3  # images over which the motion of a piece must continue,
MIN_S = 0.19  # and the time over which it must for at least
MIN_PIECES = 2
MANY_PIECES = 6  # a group of this many need not have moved for that long
TOUCHING = 2  # pieces apart: they still adjoin, as neighbours overlap by half
HALF_PIECE = 4  # small px
SPREAD_PX2 = 2.7  # small px², variance of what a piece shows about its centre
CROSSING = int(Cause.CROSSING)
INFINITY = float("inf")
NAN = float("nan")


class CoarseGroups:
    """One row per piece: ``group``, lowest piece of its group, -1: none; ``circle``, row of C_r, -1: none.

    One row per group: ``members``; mean velocity ``mean_vx``, ``mean_vy``, px/s; ``foot``, its lowest image row, px;
    ``lasting``: pieces that have moved for ``MIN_S``. ``body``: the body ahead.
    """

    def __init__(self, pieces: int) -> None:
        self.group, self.circle, self.lasting = (integers(pieces) for _ in range(3))
        self.members = Members(pieces)
        self.mean_vx, self.mean_vy, self.foot = [doubles(pieces) for _ in range(3)]
        self.body = BodyAhead(pieces)


def begin(groups: CoarseGroups, coarse: CoarseMotion) -> bool:
    """Make each piece with at least ``LINKS`` links a group of its own; return whether there are any."""
    is_any = False
    for k in range(coarse.columns * coarse.rows):
        linked = coarse.links[k] >= LINKS
        groups.group[k] = k if linked else -1
        groups.circle[k] = -1
        is_any = is_any or linked
    return is_any


def join(groups: CoarseGroups, coarse: CoarseMotion) -> None:
    """Merge the groups of pieces that touch and move alike."""
    changed = True
    while changed:
        changed = False
        for k in range(coarse.columns * coarse.rows):
            if groups.group[k] < 0:
                continue
            column, row = k % coarse.columns, k // coarse.columns
            for r in range(max(row - TOUCHING, 0), min(row + TOUCHING + 1, coarse.rows)):
                for c in range(max(column - TOUCHING, 0), min(column + TOUCHING + 1, coarse.columns)):
                    other = r * coarse.columns + c
                    if not 0 <= groups.group[other] < groups.group[k]:
                        continue
                    if coarse_motion.are_alike(coarse, coarse.vx[k], coarse.vy[k], coarse.vx[other], coarse.vy[other]):
                        groups.group[k] = groups.group[other]
                        changed = True


def gather(groups: CoarseGroups, members: Members, coarse: CoarseMotion, dt_s: float) -> None:
    """Compute the statistics of each group."""
    pieces = coarse.columns * coarse.rows
    for g in range(pieces):
        shared.clear(members, g)
        groups.mean_vx[g] = groups.mean_vy[g] = 0.0
        groups.foot[g] = -INFINITY
        groups.lasting[g] = 0
    for k in range(pieces):
        g = groups.group[k]
        if g >= 0:
            members.size[g] += 1
            if (coarse.links[k] - 1) * dt_s >= MIN_S:
                groups.lasting[g] += 1
    for k in range(pieces):
        g = groups.group[k]
        if g >= 0:
            share = 1.0 / members.size[g]
            members.x[g] += share * coarse.x[k]
            members.y[g] += share * coarse.y[k]
            groups.mean_vx[g] += share * coarse.vx[k]
            groups.mean_vy[g] += share * coarse.vy[k]
            groups.foot[g] = max(groups.foot[g], coarse.y[k] + HALF_PIECE * coarse.side)
    for k in range(pieces):
        g = groups.group[k]
        if g >= 0:
            share, spread = 1.0 / members.size[g], SPREAD_PX2 * coarse.side * coarse.side
            dx, dy = coarse.x[k] - members.x[g], coarse.y[k] - members.y[g]
            members.variance_x[g] += share * (dx * dx + spread)
            members.variance_y[g] += share * (dy * dy + spread)


def set_cause(
    groups: CoarseGroups, coarse: CoarseMotion, g: int, circles: CircleColumns, c: int, around: Situation
) -> None:
    """Set cause, motion and range of a group's circle; its range is that of the ground seen under it."""
    circles.beta[c] = math.atan2(groups.mean_vy[g], groups.mean_vx[g])
    circles.speed[c] = lengths.of(groups.mean_vx[g], groups.mean_vy[g])
    circles.cause[c], circles.ttc[c], circles.lateral[c] = CROSSING, INFINITY, NAN
    circles.range[c] = situation.ground_range_m(around, circles.y[c] + 0.5 * circles.height[c])
    for k in range(coarse.columns * coarse.rows):
        if groups.group[k] == g:
            groups.circle[k] = c


def update_moving(
    groups: CoarseGroups,
    coarse: CoarseMotion,
    edges: EdgeColumns,
    circles: CircleColumns,
    updated: Bytes,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> None:
    """Update C_r from groups that reach below the horizon: what moves stands on the ground."""
    if not begin(groups, coarse):
        return
    join(groups, coarse)
    gather(groups, groups.members, coarse, around.dt_s)
    for g in range(coarse.columns * coarse.rows):
        in_the_air = groups.foot[g] < around.horizon_y
        enough = groups.lasting[g] >= MIN_PIECES or groups.members.size[g] >= MANY_PIECES
        if groups.group[g] != g or not enough or in_the_air:
            continue
        c = shared.nearest_circle(groups.members, g, circles, settings)
        if c < 0:
            c = shared.row_for_newborn(edges, circles, True, settings)
            if c < 0:
                continue
            shared.give_birth(circles, c, groups.members, g, settings, ids)
        elif updated[c] or circles.cause[c] != CROSSING:
            continue  # other sources know more about it
        else:
            shared.confirm(circles, c, groups.members, g, settings)
        updated[c] = 1
        set_cause(groups, coarse, g, circles, c, around)


def update(
    groups: CoarseGroups,
    coarse: CoarseMotion,
    edges: EdgeColumns,
    circles: CircleColumns,
    updated: Bytes,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> None:
    """Update C_r from the pieces that move, and from those of the body ahead.

    ``updated``: circles that other sources have updated, which are left alone; those updated here are marked too.
    """
    update_moving(groups, coarse, edges, circles, updated, around, settings, ids)
    body_ahead.update(
        groups.body, groups.body.members, coarse, groups.circle, edges, circles, updated, around, settings, ids
    )
