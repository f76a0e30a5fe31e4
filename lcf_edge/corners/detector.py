"""From an image to corners: FAST without places along an edge, spread over the image, with their appearance."""

import math

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Filter
from lcf_edge.corners.along_edge import WITHIN, keep_round
from lcf_edge.corners.appearance import BORDER_PX, appearance
from lcf_edge.corners.fast import Fast, Grey, Parts, Pixels, Strengths
from lcf_edge.corners.fast_threshold import FollowingThreshold
from lcf_edge.corners.hot_pixels import SINGLES, keep_cool
from lcf_edge.corners.spread import Squares, find_poor, keep_distinct, keep_spread, keep_strongest, leave_poor
from lcf_edge.filter.inputs import Corners
from lcf_edge.filter.memory import integers, memory_of
from lcf_edge.lens import Lens

SQUARES = 192  # approximate number that an image is divided into
MAX_TIMES_MEAN = 4.0  # corners of a square, at most
FEW = 2  # a square with fewer is poor;
HORIZON_RAD = 0.15  # within this of the horizon, where what can be met first shows,
APART_RAD = 0.056  # so is one with fewer than a corner for each patch of this side,
APART_PX = 12.6  # or of this, if larger
SPREAD_PX = 40  # a frame with too many corners keeps the strongest of each such square first
CLOSE_PX = 3  # corners as close as this are mistaken for each other if they look alike
THRESHOLDS = (13, 90)
WEAKEST = THRESHOLDS[0]  # half of what is fainter is noise
DARK_SHARE = 0.6  # of the faint threshold, which is enough for what is dark
ROWS_ABOVE = 2  # of squares: margin for how high things that can be met may reach
WEAK_SHARE = 0.5  # of the wanted corners, at most, come from there

Samples = npt.NDArray[np.uint8]
Found = tuple[Pixels, Strengths, Samples]
"""Pixels, how strong their corners are, and their appearance."""


class CornerDetector:
    """FAST-9 corners of one size of image, at most ``capacity`` a frame.

    With ``fast_adaptive`` about ``corners_target`` are found, by a threshold that follows the scene; no part of the
    image has more than its share, and where there are next to none a lower threshold looks again. All of it depends
    on the images so far and nothing else. ``visible``: where corners are wanted, (height, width), elsewhere 0; None:
    everywhere.
    """

    def __init__(self, settings: Filter, lens: Lens, capacity: int, visible: Grey | None = None) -> None:
        self._visible = visible
        self._settings = settings
        self._lens = lens
        self._capacity = capacity
        size = lens.width, lens.height
        self._room = BORDER_PX, np.array((*size, *size), np.int32) - BORDER_PX
        self._whole = self._inside(np.array([(0, 0, *size)], np.int32))
        self._fast = Fast(*size)
        self._singles, self._images = integers(*SINGLES), 0
        self._budget_squares = Squares(*size, SPREAD_PX)
        self._squares = Squares(lens.width, lens.height, side_px(lens.width, lens.height))
        most = max(round(MAX_TIMES_MEAN * settings.corners_target / SQUARES), FEW)
        self._most = np.full(self._squares.rows, most, np.int32)
        self._rectangles = np.asarray(self._squares.rectangles)
        self._among = memory_of(self._touched(visible))
        self._strong = FollowingThreshold(settings.fast_threshold, *THRESHOLDS)
        self._weak = FollowingThreshold(WEAKEST, WEAKEST, THRESHOLDS[1])

    @property
    def threshold(self) -> int:
        """Threshold of the next frame, grey levels."""
        return self._strong.value

    def detect(self, image: Grey, highest_row: float = math.nan, horizon_row: float = math.nan) -> tuple[Corners, int]:
        """Corners of a (height, width) image, and how many were left out because the budget was full.

        ``highest_row``: px, above it nothing can be met, and faint corners are not looked for. ``horizon_row``: px,
        that of the horizon, around which more of them are. NaN: unknown.
        """
        image = np.ascontiguousarray(image)
        self._fast.look(image)
        self._images += 1
        found = self._look(image, self._strong.value, self._whole)
        if self._settings.fast_adaptive:
            found = self._shared_out(image, found, self._few(highest_row, horizon_row))
        pixel, strength, samples = found
        position = self._lens.undistort_pixels(pixel[:, 0], pixel[:, 1])
        if self._lens.is_distorted:
            placed = np.isfinite(position[:, 0]).nonzero()[0]
            pixel, position, strength = pixel.take(placed, axis=0), position.take(placed, axis=0), strength.take(placed)
            samples = samples.take(placed, axis=0)
        evicted = max(0, len(pixel) - self._capacity)
        if evicted:
            kept = strongest_spread(self._budget_squares, pixel, strength, self._capacity)
            pixel, position, samples = pixel.take(kept, axis=0), position.take(kept, axis=0), samples.take(kept, axis=0)
        return Corners(pixel, position, samples), evicted

    def _look(self, image: Grey, threshold: int, parts: Parts, on_dark: int | None = None) -> Found:
        """Return the corners of parts of the image: no hot pixels, none along an edge or easily mistaken for others."""
        pixel, strength = self._fast.corners(threshold, parts, on_dark)
        if self._visible is not None:
            visible = self._visible[pixel[:, 1], pixel[:, 0]] != 0
            pixel, strength = pixel[visible], strength[visible]
        flat, width = image.reshape(-1).data, image.shape[1]
        if self._settings.fast_adaptive:
            count = keep_cool(self._singles, self._images, flat, width, pixel.data, strength.data)
            pixel, strength = pixel[:count], strength[:count]
        if least := self._settings.least_roundness:
            count = keep_round(flat, width, WITHIN, pixel.data, strength.data, least)
            pixel, strength = pixel[:count], strength[:count]
        samples = appearance(image, pixel)
        if self._settings.fast_adaptive:
            beaten = np.empty(len(pixel), np.uint8)
            count = keep_distinct(
                pixel.data, strength.data, samples.data, words_of(samples).data, beaten.data, CLOSE_PX
            )
            pixel, strength, samples = pixel[:count], strength[:count], samples[:count]
        return pixel, strength, samples

    def _few(self, highest_row: float, horizon_row: float) -> npt.NDArray[np.int32]:
        """Return, for each row of squares, the number of corners below which a square is poor; int32 (rows,)."""
        side, rows = self._squares.side_px, self._squares.rows
        few = np.full(rows, FEW, np.int32)
        focal_px = math.sqrt(self._lens.fx * self._lens.fy)
        if math.isfinite(horizon_row):
            first, end = horizon_row - HORIZON_RAD * focal_px, horizon_row + HORIZON_RAD * focal_px
            near = slice(max(math.floor(first / side), 0), max(math.ceil(end / side), 0))
            few[near] = max(round((side / max(APART_RAD * focal_px, APART_PX)) ** 2), FEW)
        if highest_row > 0:  # NaN is not
            few[: max(int(highest_row / side) - ROWS_ABOVE, 0)] = 0
        return few

    def _shared_out(self, image: Grey, looked: Found, few: npt.NDArray[np.int32]) -> Found:
        """Limit every square to its share, and search poor ones again."""
        squares = self._squares
        pixel, strength, samples = strongest(squares, looked, self._most)
        found = 0
        if self._weak.value < self._strong.value:  # else it would find the same again
            square = np.empty(len(pixel), np.int32)
            poor = find_poor(squares, pixel.data, square.data, few.data, self._among)
            poorest = np.bincount(square, minlength=squares.rows * squares.columns) < FEW
            threshold = self._weak.value
            parts = self._inside(self._rectangles[:poor])
            faint = self._look(image, threshold, parts, round(DARK_SHARE * threshold))
            column, row = (faint[0] // squares.side_px).T
            # only the poorest steer the threshold: what the others ask for would raise it above what these show
            found = int(np.count_nonzero(poorest[row * squares.columns + column]))
            if len(faint[0]):  # includes the corners already found there
                rich = leave_poor(squares, pixel.data, strength.data, words_of(samples).data, square.data)
                faint = strongest(squares, faint, few)
                pixel = np.concatenate([pixel[:rich], faint[0]])
                strength = np.concatenate([strength[:rich], faint[1]])
                samples = np.concatenate([samples[:rich], faint[2]])
        self._weak.follow(max(found, 1) / (WEAK_SHARE * self._settings.corners_target))
        self._strong.follow(max(len(pixel), 1) / self._settings.corners_target)
        return pixel, strength, samples

    def _inside(self, parts: Parts) -> Parts:
        """Return parts of the image without its border."""
        return np.minimum(np.maximum(parts, self._room[0]), self._room[1])

    def _touched(self, visible: Grey | None) -> npt.NDArray[np.uint8]:
        """Return which squares have a pixel where corners are wanted; uint8 (rows, columns)."""
        rows, columns, side = self._squares.rows, self._squares.columns, self._squares.side_px
        if visible is None:
            return np.ones((rows, columns), np.uint8)
        across = np.maximum.reduceat(visible, np.arange(columns) * side, axis=1)
        return np.maximum.reduceat(across, np.arange(rows) * side, axis=0)


def strongest(squares: Squares, found: Found, share: npt.NDArray[np.int32]) -> Found:
    """The ``share`` (of each row) strongest corners of each square, in the same order; the arrays are written."""
    pixel, strength, samples = found
    order, square = np.empty((2, len(pixel)), np.int32)
    count = keep_strongest(
        squares, pixel.data, strength.data, words_of(samples).data, order.data, square.data, share.data
    )
    return pixel[:count], strength[:count], samples[:count]


def strongest_spread(squares: Squares, pixel: Pixels, strength: Strengths, capacity: int) -> npt.NDArray[np.int32]:
    """Rows, ascending, of the ``capacity`` corners to keep: the strongest of every square, then the second, and on."""
    order, place = np.empty((2, len(pixel)), np.int32)
    count = min(capacity, len(pixel))
    keep_spread(squares, pixel.data, strength.data, order.data, place.data, count)
    return place[:count]


def words_of(samples: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint64]:
    """Appearances, uint8 (n, 16), as uint64 (n, 2): the same memory."""
    return samples.view(np.uint64)


def side_px(width: int, height: int) -> int:
    """Return the side, px, of about ``SQUARES`` squares that divide an image."""
    return max(round(math.sqrt(width * height / SQUARES)), 1)
