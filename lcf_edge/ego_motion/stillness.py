"""Whether the image is stationary: corners are where they were half a second ago. No clock, no I/O."""

import numpy as np
import numpy.typing as npt

from lcf_edge.filter.memory import Bytes, octets

Pixels = npt.NDArray[np.int32]

APART_NS = 500_000_000
MIN_CORNERS = 40  # fewer do not decide
NEAR_PX = 1  # amplitude of a camera shaken by motors
CELL_PX = 2
SHARE = 0.7  # of the corners; others flicker, or are on moving objects


class Stillness:
    """For images of one size. Keeps where corners were, half a second to a second ago, in cells of 2 px.

    ``then``, ``latest``: uint8, row-major, ``columns`` cells a row, 1 where a corner was near; with their stamps.
    ``marks``: how many of both are valid; if one, ``latest``.
    """

    def __init__(self, width: int, height: int) -> None:
        self.columns = (width + 2 * NEAR_PX) // CELL_PX + 1
        cells = self.columns * ((height + 2 * NEAR_PX) // CELL_PX + 1)
        self.then, self.latest = octets(cells), octets(cells)
        self.then_ns = self.latest_ns = self.marks = 0

    def look(self, stamp_ns: int, pixel: Pixels) -> bool | None:
        """Take the corners of a frame, (n, 2) px. Return whether they are stationary, None: undecided."""
        corners = pixel.shape[0]
        if corners < MIN_CORNERS or (self.marks > 0 and stamp_ns < self.latest_ns):
            self.marks = 0
            return None
        if self.marks == 0 or stamp_ns - self.latest_ns >= APART_NS:
            self.then, self.latest = self.latest, self.then
            self.then_ns, self.latest_ns = self.latest_ns, stamp_ns
            self.marks = min(self.marks + 1, 2)
            mark(self.latest, self.columns, pixel)
        if self.marks < 2 or stamp_ns - self.then_ns < APART_NS:
            return None
        return bool(count_near(self.then, self.columns, pixel) >= SHARE * corners)


def mark(near: Bytes, columns: int, pixel: Pixels) -> None:
    """Mark the cells that a corner, (n, 2) px, is near."""
    for cell in range(near.shape[0]):
        near[cell] = 0
    for i in range(pixel.shape[0]):
        for y in range(pixel[i, 1], pixel[i, 1] + 2 * NEAR_PX + 1):
            for x in range(pixel[i, 0], pixel[i, 0] + 2 * NEAR_PX + 1):
                near[y // CELL_PX * columns + x // CELL_PX] = 1


def count_near(near: Bytes, columns: int, pixel: Pixels) -> int:
    """Return how many corners, (n, 2) px, lie in marked cells."""
    number = 0
    for i in range(pixel.shape[0]):
        number += near[(pixel[i, 1] + NEAR_PX) // CELL_PX * columns + (pixel[i, 0] + NEAR_PX) // CELL_PX]
    return number
