"""What leaps across the picture: its corners are found by what neighbours agree on, not by what is predicted.

Where most of the edges that were just seen have no corner where the camera's motion and their own put them, nothing
that is predicted fits. There every pair of such an edge and a free corner that look alike votes for its shift; a shift
that most of them share, and no other one, is how that part of the picture moved.
"""

from lcf_edge.filter import image_plane, matching, rounding
from lcf_edge.filter.columns import CornerColumns, EdgeColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.memory import doubles, integers
from lcf_edge.filter.settings import Settings

COLUMNS = 8  # parts of the picture
ROWS = 6
REACH_SHARE = 0.16  # of the picture's width, by which something may leap
BINS = 50  # of shifts, each way
MIN_LOST = 4  # edges without a corner that a part needs
LOST_SHARE = 0.6  # of those that were just seen
MIN_VOTES = 4
AGREEING_SHARE = 0.25  # of the edges that ask
RIVAL_SHARE = 0.4  # of the votes, that no other shift may have
MAX_ASKING = 120  # edges in a frame


class Leaps:
    """Work space. A row an edge: ``part``, -1: it does not ask; ``u``, ``v``: where it was, px of the input frame.

    A row a part: ``seen``, ``lost``. ``votes``, ``voter``: of each shift, and the edge that voted for it last.
    """

    def __init__(self, capacity: int) -> None:
        self.part = integers(capacity)
        self.u, self.v = doubles(capacity), doubles(capacity)
        self.seen, self.lost = (integers(COLUMNS * ROWS) for _ in range(2))
        self.votes, self.voter = (integers(BINS + 1, BINS + 1) for _ in range(2))
        self.across = self.down = self.most = 0


def ask(leaps: Leaps, plane: ImagePlane, edges: EdgeColumns) -> None:
    """Which edges were seen in the last frame and have no corner now, by parts of the picture."""
    for p in range(COLUMNS * ROWS):
        leaps.seen[p] = leaps.lost[p] = 0
    for i in range(edges.count):
        leaps.part[i] = -1
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
            leaps.part[i], leaps.u[i], leaps.v[i] = part, plane.u, plane.v


def is_lost(leaps: Leaps, part: int) -> bool:
    """Whether nothing that is predicted fits in a part of the picture."""
    return leaps.lost[part] >= MIN_LOST and leaps.lost[part] > LOST_SHARE * leaps.seen[part]


def vote(
    leaps: Leaps,
    index: CornerIndex,
    edges: EdgeColumns,
    i: int,
    corners: CornerColumns,
    reach: float,
    settings: Settings,
) -> None:
    """One edge votes for its shift to each free corner within ``reach``, px, but not near by, that looks like it."""
    u, v = leaps.u[i], leaps.v[i]
    most = matching.likeness_needed(matching.contrast(edges, i), settings)
    left, right = matching.first_cell(u, reach, index.columns), matching.last_cell(u, reach, index.columns)
    for row in range(matching.first_cell(v, reach, index.rows), matching.last_cell(v, reach, index.rows) + 1):
        for place in range(index.start[row * index.columns + left], index.start[row * index.columns + right + 1]):
            dx, dy = index.x[place] - u, index.y[place] - v
            away2 = dx * dx + dy * dy
            astray = away2 >= reach * reach or away2 <= settings.leap_px * settings.leap_px
            if astray or not corners.free[index.order[place]] or matching.difference(edges, i, index, place) >= most:
                continue
            across = rounding.whole((dx / reach + 1) * (BINS / 2.0))
            down = rounding.whole((dy / reach + 1) * (BINS / 2.0))
            for a in range(max(across - 1, 0), across + 1):
                for b in range(max(down - 1, 0), down + 1):
                    if leaps.voter[a, b] != i:
                        leaps.voter[a, b] = i
                        leaps.votes[a, b] += 1


def most_votes(leaps: Leaps) -> None:
    """The shift with the most votes."""
    leaps.most = 0
    for a in range(BINS + 1):
        for b in range(BINS + 1):
            if leaps.votes[a, b] > leaps.most:
                leaps.most, leaps.across, leaps.down = leaps.votes[a, b], a, b


def rival_votes(leaps: Leaps) -> int:
    """How many votes the best shift has that is another one."""
    rival = 0
    for a in range(BINS + 1):
        for b in range(BINS + 1):
            near = abs(a - leaps.across) <= 2 and abs(b - leaps.down) <= 2
            if not near and leaps.votes[a, b] > rival:
                rival = leaps.votes[a, b]
    return rival


def take(
    leaps: Leaps,
    index: CornerIndex,
    edges: EdgeColumns,
    i: int,
    corners: CornerColumns,
    reach: float,
    settings: Settings,
) -> int:
    """An edge takes the corner that looks most like it where the shift of its part puts it; return how many it found.

    A shift of ``across`` stands for all between it and the next one but one.
    """
    step = reach / (BINS / 2.0)
    u, v = leaps.u[i] + (leaps.across + 1) * step - reach, leaps.v[i] + (leaps.down + 1) * step - reach
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
    """Corners for the edges of what leaps; return how many were found. After ``matching.find``."""
    ask(leaps, plane, edges)
    reach = REACH_SHARE * plane.width
    found = 0
    asking = 0
    for part in range(COLUMNS * ROWS):
        if not is_lost(leaps, part) or asking + leaps.lost[part] > MAX_ASKING:
            continue
        asking += leaps.lost[part]
        for a in range(BINS + 1):
            for b in range(BINS + 1):
                leaps.votes[a, b] = 0
                leaps.voter[a, b] = -1
        for i in range(edges.count):
            if leaps.part[i] == part:
                vote(leaps, index, edges, i, corners, reach, settings)
        most_votes(leaps)
        agree = leaps.most >= max(1.0 * MIN_VOTES, AGREEING_SHARE * leaps.lost[part])
        if agree and rival_votes(leaps) <= RIVAL_SHARE * leaps.most:
            for i in range(edges.count):
                if leaps.part[i] == part:
                    found += take(leaps, index, edges, i, corners, reach, settings)
    return found
