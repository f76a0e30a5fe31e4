"""The picture in squares: which corners are kept, and where there are too few.

A hedge, a row of trees or printed paint has more corners than all the rest and would take them all; something dark
before a bright sky has none that are as strong.
"""

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from lcf_edge.ranking import place_in_square

SQUARES = 192  # that a picture is divided into, about
MOST = 4.0  # times the mean: no square has more corners
FEW = 2  # a square with fewer is poor

Rows = npt.NDArray[np.intp]
Pixels = npt.NDArray[np.int32]
Strengths = npt.NDArray[np.float32]


class Squares:
    """The squares of one size of picture, where about ``target`` corners are wanted in all."""

    def __init__(self, width: int, height: int, target: int) -> None:
        self.side_px = max(round(math.sqrt(width * height / SQUARES)), 1)
        self.most = max(round(MOST * target / SQUARES), FEW)
        self._shape = -(-height // self.side_px), -(-width // self.side_px)

    def strongest(self, pixel: Pixels, strength: Strengths, most: int) -> Rows:
        """Rows, ascending, of the ``most`` strongest corners of each square."""
        strongest: Rows = (place_in_square(pixel, strength, self.side_px) < most).nonzero()[0]
        return strongest

    def poor(self, pixel: Pixels) -> npt.NDArray[np.bool_]:
        """Which squares hold less than ``FEW`` corners; bool (rows, columns)."""
        rows, columns = self._shape
        column, row = (pixel // self.side_px).T
        return np.bincount(row * columns + column, minlength=rows * columns).reshape(rows, columns) < FEW

    def at(self, marked: npt.NDArray[np.bool_], pixel: Pixels) -> npt.NDArray[np.bool_]:
        """What is ``marked`` (rows, columns) of the squares, at each pixel (n, 2)."""
        column, row = (pixel // self.side_px).T
        there: npt.NDArray[np.bool_] = marked[row, column]
        return there

    def touched(self, where: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Which squares have a pixel of ``where`` (height, width); bool (rows, columns)."""
        rows, columns = (np.arange(count) * self.side_px for count in self._shape)
        return np.logical_or.reduceat(np.logical_or.reduceat(where, rows, axis=0), columns, axis=1)

    def runs(self, marked: npt.NDArray[np.bool_]) -> Iterator[tuple[int, int, int, int]]:
        """Marked squares as rectangles: left, top, right, bottom, px, the last two beyond it.

        Neighbours in a row are one rectangle, and so are rows with the same ones below each other.
        """
        rows, columns = self._shape
        closed = np.zeros((rows, columns + 2), np.int8)
        closed[:, 1:-1] = marked
        change = np.diff(closed, axis=1)
        begins, ends = np.argwhere(change == 1).tolist(), np.argwhere(change == -1).tolist()
        side = self.side_px
        tops: dict[tuple[int, int, int], int] = {}  # of open rectangles: first and last column, row below
        for (row, first), (_, beyond) in zip(begins, ends, strict=True):
            tops[first, beyond, row + 1] = tops.pop((first, beyond, row), row)
        for (first, beyond, bottom), top in tops.items():
            yield first * side, top * side, beyond * side, bottom * side


def strongest_spread(pixel: Pixels, strength: Strengths, capacity: int, side_px: int) -> Rows:
    """Rows of the ``capacity`` corners to keep: the strongest of every square, then the second, and on.

    ``pixel``: int32 (n, 2), ``strength``: float32 (n,). Return rows, ascending.
    """
    place = place_in_square(pixel, strength, side_px)
    return np.sort(np.lexsort((-strength, place))[:capacity])
