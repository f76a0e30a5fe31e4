"""Leaps across the image: corners that prediction loses are found by a shift that neighbours agree on.

Where most of the edges just seen have no corner where camera motion and their own motion predict it, prediction is no
help. There every pair of such an edge and a similar free corner votes for its shift; if one shift has most of the
votes and no rival, that part of the image moved by it.
"""

from lcf_edge.filter import image_plane, matching, rounding
from lcf_edge.filter.columns import CornerColumns, EdgeColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.memory import doubles, integers
from lcf_edge.filter.settings import Settings

COLUMNS = 8  # parts of the image
ROWS = 6
REACH_SHARE = 0.16  # longest leap, as a share of the image's width
BINS = 50  # of shifts, in each direction
SIDE = BINS + 1  # of the table of shifts
MIN_LOST = 4  # lost edges that a part needs,
LOST_SHARE = 0.6  # as a share of those just seen, too
MIN_VOTES = 4
AGREEING_SHARE = 0.25  # of the lost edges, that must vote for the shift
RIVAL_SHARE = 0.4  # of the best shift's votes, that no other may exceed
MAX_ASKING = 120  # lost edges in a frame that are searched for


class Leaps:
    """Work space. One row per lost ("asking") edge: ``rows``, its own; ``part``; ``u``, ``v``: its position, px of the
    input frame.

    One row per part: ``seen``, ``lost``. One row per shift, ``across`` * ``SIDE`` + ``down``: ``votes``, and ``voter``,
    the edge that voted for it last. ``shifts``: the ``count`` of them that have votes; the others have 0 and -1.
    """

    def __init__(self, capacity: int) -> None:
        self.rows, self.part = integers(capacity), integers(capacity)
        self.u, self.v = doubles(capacity), doubles(capacity)
        self.seen, self.lost = [integers(COLUMNS * ROWS) for _ in range(2)]
        self.votes, self.voter, self.shifts = [integers(SIDE * SIDE) for _ in range(3)]
        for shift in range(SIDE * SIDE):
            self.voter[shift] = -1
        self.asking = self.count = self.across = self.down = self.most = 0


def ask(leaps: Leaps, plane: ImagePlane, edges: EdgeColumns) -> None:
    """Gather the edges seen in the last frame that have no corner now, by parts of the image."""
    for p in range(COLUMNS * ROWS):
        leaps.seen[p] = leaps.lost[p] = 0
    leaps.asking = 0
    for i in range(edges.count):
        if not edges.matched[i] or edges.held[i] or edges.is_own_part(i):
            continue
        if not image_plane.project(plane, edges.x[i], edges.y[i]):
            continue
        column = min(max(rounding.whole(plane.u * COLUMNS / plane.width), 0), COLUMNS - 1)
        row = min(max(rounding.whole(plane.v * ROWS / plane.height), 0), ROWS - 1)
        part = row * COLUMNS + column
        leaps.seen[part] += 1
        if edges.corner[i] < 0:
            leaps.lost[part] += 1
            leaps.rows[leaps.asking], leaps.part[leaps.asking] = i, part
            leaps.u[leaps.asking], leaps.v[leaps.asking] = plane.u, plane.v
            leaps.asking += 1


def is_lost(leaps: Leaps, part: int) -> bool:
    """Whether prediction failed in a part of the image."""
    return leaps.lost[part] >= MIN_LOST and leaps.lost[part] > LOST_SHARE * leaps.seen[part]


def list_far(index: CornerIndex, corners: CornerColumns, u: float, v: float, reach: float, near_px: float) -> int:
    """List the free corners farther than ``near_px`` from (u, v) and nearer than ``reach``; return how many."""
    count, reach2, near2 = 0, reach * reach, near_px * near_px
    left, right = matching.first_cell(u, reach, index.columns), matching.last_cell(u, reach, index.columns)
    for row in range(matching.first_cell(v, reach, index.rows), matching.last_cell(v, reach, index.rows) + 1):
        for place in range(index.start[row * index.columns + left], index.start[row * index.columns + right + 1]):
            dx, dy = index.x[place] - u, index.y[place] - v
            away2 = dx * dx + dy * dy
            index.listed[count] = place  # no branch, as in ``matching.list_near``
            count += (away2 < reach2) & (away2 > near2) & corners.free[index.order[place]]
    return count


def vote(
    leaps: Leaps,
    index: CornerIndex,
    edges: EdgeColumns,
    k: int,
    corners: CornerColumns,
    reach: float,
    settings: Settings,
) -> None:
    """Vote for the shift of an asking edge to each similar free corner in the ring up to ``reach``, px."""
    i, u, v = leaps.rows[k], leaps.u[k], leaps.v[k]
    most = matching.likeness_needed(matching.contrast(edges, i), settings)
    for n in range(list_far(index, corners, u, v, reach, settings.leap_px)):
        place = index.listed[n]
        if matching.difference(edges, i, index, place) >= most:
            continue
        across = rounding.whole(((index.x[place] - u) / reach + 1) * (BINS / 2.0))
        down = rounding.whole(((index.y[place] - v) / reach + 1) * (BINS / 2.0))
        for a in range(max(across - 1, 0), across + 1):
            for b in range(max(down - 1, 0), down + 1):
                add_vote(leaps, a * SIDE + b, i)


def add_vote(leaps: Leaps, shift: int, i: int) -> None:
    """Count an edge's vote for a shift, once."""
    if leaps.voter[shift] == i:
        return
    if not leaps.votes[shift]:
        leaps.shifts[leaps.count] = shift
        leaps.count += 1
    leaps.voter[shift] = i
    leaps.votes[shift] += 1


def most_votes(leaps: Leaps) -> None:
    """Find the shift with the most votes, of equals the first in the table."""
    best = leaps.most = 0
    for k in range(leaps.count):
        shift = leaps.shifts[k]
        votes = leaps.votes[shift]
        if votes > leaps.most or (votes == leaps.most and shift < best):
            leaps.most, best = votes, shift
    leaps.across, leaps.down = best // SIDE, best % SIDE


def rival_votes(leaps: Leaps) -> int:
    """Votes of the best shift that is not next to the winner."""
    rival = 0
    for k in range(leaps.count):
        shift = leaps.shifts[k]
        near = abs(shift // SIDE - leaps.across) <= 2 and abs(shift % SIDE - leaps.down) <= 2
        if not near and leaps.votes[shift] > rival:
            rival = leaps.votes[shift]
    return rival


def forget(leaps: Leaps) -> None:
    """Reset all votes."""
    for k in range(leaps.count):
        leaps.votes[leaps.shifts[k]] = 0
        leaps.voter[leaps.shifts[k]] = -1
    leaps.count = 0


def take(
    leaps: Leaps,
    index: CornerIndex,
    edges: EdgeColumns,
    k: int,
    corners: CornerColumns,
    reach: float,
    settings: Settings,
) -> int:
    """Give an asking edge the most similar corner where the shift of its part puts it; return 1 if there is one.

    A shift of ``across`` stands for all between it and the next but one.
    """
    step = reach / (BINS / 2.0)
    i = leaps.rows[k]
    u, v = leaps.u[k] + (leaps.across + 1) * step - reach, leaps.v[k] + (leaps.down + 1) * step - reach
    least = matching.likeness_needed(matching.contrast(edges, i), settings)
    best = -1
    left, right = matching.first_cell(u, step, index.columns), matching.last_cell(u, step, index.columns)
    for row in range(matching.first_cell(v, step, index.rows), matching.last_cell(v, step, index.rows) + 1):
        for place in range(index.start[row * index.columns + left], index.start[row * index.columns + right + 1]):
            dx, dy = index.x[place] - u, index.y[place] - v
            if max(dx, -dx) > step or max(dy, -dy) > step or not corners.free[index.order[place]]:
                continue
            unlike = matching.difference(edges, i, index, place)
            if unlike < least:
                least, best = unlike, index.order[place]
    if best < 0:
        return 0
    edges.corner[i] = best
    corners.free[best] = 0
    return 1


def find(
    leaps: Leaps,
    index: CornerIndex,
    plane: ImagePlane,
    edges: EdgeColumns,
    corners: CornerColumns,
    settings: Settings,
) -> int:
    """Find corners for the edges of parts that leapt, after ``matching.find``; return how many were found."""
    ask(leaps, plane, edges)
    reach = REACH_SHARE * plane.width
    found = 0
    asked = 0
    for part in range(COLUMNS * ROWS):
        if not is_lost(leaps, part) or asked + leaps.lost[part] > MAX_ASKING:
            continue
        asked += leaps.lost[part]
        for k in range(leaps.asking):
            if leaps.part[k] == part:
                vote(leaps, index, edges, k, corners, reach, settings)
        most_votes(leaps)
        agree = leaps.most >= max(1.0 * MIN_VOTES, AGREEING_SHARE * leaps.lost[part])
        if agree and rival_votes(leaps) <= RIVAL_SHARE * leaps.most:
            for k in range(leaps.asking):
                if leaps.part[k] == part:
                    found += take(leaps, index, edges, k, corners, reach, settings)
        forget(leaps)
    return found
