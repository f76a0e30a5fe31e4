"""How strong a corner is among those in its square of the picture."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview
Grid: TypeAlias = Any  # and [i, j]


def place_in_square(
    pixel: npt.NDArray[np.int32], strength: npt.NDArray[np.float32], side_px: int
) -> npt.NDArray[np.intp]:
    """How many corners in the same square are stronger, or as strong and earlier, (n,)."""
    place = np.zeros(len(pixel), np.intp)
    if len(pixel):
        columns, rows = pixel.max(axis=0) // side_px + 1
        square = np.empty(len(pixel), np.int32)
        first = np.zeros(int(columns) * int(rows) + 1, np.int32)
        held = np.empty(len(pixel), np.int32)
        rank(pixel.data, strength.data, side_px, columns, square.data, first.data, held.data, place.data)
    return place


def rank(
    pixel: Grid,
    strength: Column,
    side_px: int,
    columns: int,
    square: Column,
    first: Column,
    held: Column,
    place: Column,
) -> None:
    """Add to ``place``, intp (n,), of each corner how many of its square come before it.

    ``square``: int32 (n,), written; ``first``: int32 (squares + 1,), zeros, becomes where each square's run ends in
    ``held``, int32 (n,), written: corners, square after square.
    """
    count = pixel.shape[0]
    for i in range(count):
        square[i] = pixel[i, 1] // side_px * columns + pixel[i, 0] // side_px
        first[square[i] + 1] += 1
    for s in range(1, first.shape[0]):
        first[s] += first[s - 1]
    for i in range(count):
        here = square[i]
        held[first[here]] = i
        first[here] += 1  # the run's end so far
    for i in range(count):
        k = first[square[i]] - 1
        while k >= 0 and square[held[k]] == square[i]:
            other = held[k]
            if strength[other] > strength[i] or (strength[other] == strength[i] and other < i):
                place[i] += 1
            k -= 1
