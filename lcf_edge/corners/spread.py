"""Which corners are kept, and where there are too few.

Of corners that lie close and look alike the next image mistakes one for the other, so only the strongest is kept. A
hedge, a row of trees or printed paint has more corners than all the rest, and would use up the budget; something dark
before a bright sky has none that strong. So the image is divided into squares.
"""

from typing import Any, TypeAlias

import numpy as np

from lcf_edge.corners import appearance
from lcf_edge.filter import rounding
from lcf_edge.filter.memory import integers, memory_of, octets

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview
Grid: TypeAlias = Any  # and [i, j]
LEVELS = 256  # of strength
LEAVES = -1  # in place of a square: the corner is surplus


class Squares:
    """The squares of one size of image, row after row.

    ``row_of``: the row, or column, that each coordinate lies in. ``counted``: corners of each square. ``ends``: of each
    strength, where its corners end, or begin, in the list ordered by it. ``poor``: uint8, 1 where there are few;
    ``rectangles``: int32 (n, 4), left, top, right, bottom, px, the last two beyond it; as many in use as ``find_poor``
    says.
    """

    def __init__(self, width: int, height: int, side_px: int) -> None:
        self.side_px = side_px
        self.rows, self.columns = -(-height // side_px), -(-width // side_px)
        self.row_of = memory_of(np.arange(max(width, height), dtype=np.int32) // side_px)
        self.counted, self.ends = integers(self.rows * self.columns), integers(LEVELS)
        self.poor = octets(self.rows * self.columns)
        self.rectangles = integers(self.rows * self.columns, 4)


def keep_distinct(pixel: Grid, strength: Column, samples: Grid, words: Grid, beaten: Column, reach: int) -> int:
    """Move the corners without a stronger one that lies close and looks alike to the front, in the same order.

    Of equals the first stays. Close: no more than ``reach`` px away, both across and down. ``pixel``: int32 (n, 2),
    part by part of an image, row by row; parts do not rival each other. ``samples``: uint8 (n, 16), the appearances;
    ``words``: uint64 (n, 2), the same memory, which moves faster. ``beaten``: uint8 (n,), written. Return how many are
    kept.
    """
    corners = pixel.shape[0]
    for i in range(corners):
        beaten[i] = 0
    for i in range(corners):
        for k in range(i + 1, corners):
            across, down = pixel[k, 0] - pixel[i, 0], pixel[k, 1] - pixel[i, 1]
            if down < 0 or down > reach:
                break
            if abs(across) <= reach and appearance.look_alike(samples, i, k):
                beaten[i if strength[k] > strength[i] else k] = 1
    kept = 0
    for i in range(corners):
        if not beaten[i]:
            pixel[kept, 0], pixel[kept, 1], strength[kept] = pixel[i, 0], pixel[i, 1], strength[i]
            words[kept, 0], words[kept, 1] = words[i, 0], words[i, 1]
            kept += 1
    return kept


def count(squares: Squares, pixel: Grid, square: Column) -> None:
    """How many corners each square has; ``square``, int32 (n,), of each corner, is written."""
    for s in range(squares.counted.shape[0]):
        squares.counted[s] = 0
    for i in range(pixel.shape[0]):
        s = squares.row_of[pixel[i, 1]] * squares.columns + squares.row_of[pixel[i, 0]]
        square[i] = s
        squares.counted[s] += 1


def order_by_strength(squares: Squares, strength: Column, order: Column) -> None:
    """List the corners, the strongest first, of equals the first; ``order``, int32 (n,), is written."""
    ends = squares.ends
    for level in range(ends.shape[0]):
        ends[level] = 0
    for i in range(strength.shape[0]):
        ends[rounding.whole(strength[i])] += 1
    for level in range(ends.shape[0] - 1, 0, -1):
        ends[level - 1] += ends[level]
    for i in range(strength.shape[0] - 1, -1, -1):
        level = rounding.whole(strength[i])
        ends[level] -= 1
        order[ends[level]] = i


def keep_spread(squares: Squares, pixel: Grid, strength: Column, order: Column, place: Column, capacity: int) -> None:
    """Write to ``place`` which ``capacity`` corners stay, ascending: the strongest of every square, then the second,
    and on; of the last ones the strongest of all.

    ``strength``: whole, below ``LEVELS``. ``order``, ``place``: int32 (n,), written; ``capacity``: n at most.
    """
    corners, counted = pixel.shape[0], squares.counted
    count(squares, pixel, place)
    last, fit = 0, 0  # ranks within a square that fit, and corners of these ranks
    while fit < capacity:
        last += 1
        fit = 0
        for s in range(counted.shape[0]):
            fit += min(counted[s], last)
    for s in range(counted.shape[0]):
        counted[s] = 0
    order_by_strength(squares, strength, order)
    room = capacity
    for k in range(corners):
        i = order[k]
        s = place[i]
        place[i] = counted[s]
        counted[s] += 1
        room -= place[i] < last - 1
    for k in range(corners):
        i = order[k]
        if place[i] == last - 1:
            place[i] = last - 1 if room > 0 else last
            room -= 1
    kept = 0
    for i in range(corners):
        if place[i] < last:
            place[kept] = i
            kept += 1


def keep_strongest(
    squares: Squares, pixel: Grid, strength: Column, words: Grid, order: Column, square: Column, share: Column
) -> int:
    """Move the strongest corners of each square to the front, in the same order. Return how many.

    ``share``: int32 (rows,), of a square of each row, how many at most. ``strength``: whole, below ``LEVELS``.
    ``order``, ``square``: int32 (n,), written.
    """
    counted = squares.counted
    count(squares, pixel, square)
    order_by_strength(squares, strength, order)
    for k in range(pixel.shape[0] - 1, -1, -1):
        i = order[k]
        s = square[i]
        if counted[s] > share[s // squares.columns]:
            counted[s] -= 1
            square[i] = LEAVES
    kept = 0
    for i in range(pixel.shape[0]):
        if square[i] != LEAVES:
            pixel[kept, 0], pixel[kept, 1], strength[kept] = pixel[i, 0], pixel[i, 1], strength[i]
            words[kept, 0], words[kept, 1] = words[i, 0], words[i, 1]
            kept += 1
    return kept


def find_poor(squares: Squares, pixel: Grid, square: Column, few: Column, among: Grid) -> int:
    """Mark the squares that have fewer than ``few`` corners, and make rectangles of them.

    ``few``: int32 (rows,), for the squares of each row. ``square``: int32 (n,), written. ``among``: uint8 (rows,
    columns), 0: not this one. Neighbours in a row are one rectangle, and so are rows with the same ones below each
    other. Return how many there are.
    """
    count(squares, pixel, square)
    for row in range(squares.rows):
        for column in range(squares.columns):
            s = row * squares.columns + column
            squares.poor[s] = squares.counted[s] < few[row] and among[row, column] != 0
    found = 0
    for row in range(squares.rows):
        column = 0
        while column < squares.columns:
            left = column
            while column < squares.columns and squares.poor[row * squares.columns + column]:
                column += 1
            if column > left:
                found = add_rectangle(squares, found, left, column, row)
            column += 1
    return found


def add_rectangle(squares: Squares, found: int, left: int, right: int, row: int) -> int:
    """Add the squares from ``left`` to before ``right`` to the rectangle of those above them, or as a new one.

    Return how many rectangles there are.
    """
    side = squares.side_px
    for k in range(found - 1, -1, -1):
        below = squares.rectangles[k, 3] == row * side
        if below and squares.rectangles[k, 0] == left * side and squares.rectangles[k, 2] == right * side:
            squares.rectangles[k, 3] += side
            return found
    squares.rectangles[found, 0], squares.rectangles[found, 1] = left * side, row * side
    squares.rectangles[found, 2], squares.rectangles[found, 3] = right * side, (row + 1) * side
    return found + 1


def leave_poor(squares: Squares, pixel: Grid, strength: Column, words: Grid, square: Column) -> int:
    """Move the corners outside the poor squares to the front, in the same order. Return how many.

    ``square``: as ``find_poor`` has written it.
    """
    kept = 0
    for i in range(pixel.shape[0]):
        if not squares.poor[square[i]]:
            pixel[kept, 0], pixel[kept, 1], strength[kept] = pixel[i, 0], pixel[i, 1], strength[i]
            words[kept, 0], words[kept, 1] = words[i, 0], words[i, 1]
            kept += 1
    return kept
