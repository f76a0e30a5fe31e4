"""From a picture to corners: FAST, but for those along an edge; spread over the picture, with looks."""

import math
from collections.abc import Iterable
from operator import attrgetter

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.along_edge import roundness
from lcf_edge.appearance import BORDER_PX, appearance
from lcf_edge.config import Filter
from lcf_edge.fast_threshold import FollowingThreshold
from lcf_edge.filter.inputs import Corners
from lcf_edge.lens import Lens
from lcf_edge.spread import FEW, Squares, strongest_spread

FAST_BORDER_PX = 3  # FAST itself leaves out
SPREAD_PX = 40  # a frame with too many corners keeps the strongest of each such square first
THRESHOLDS = (13, 90)
WEAKEST = THRESHOLDS[0]  # what is fainter still is noise as often as not
ROWS_ABOVE = 2  # of squares: what can be met may begin so much higher than is thought
WEAK_SHARE = 0.5  # of the wanted corners may be looked at there

Grey = npt.NDArray[np.uint8]
Found = tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]
"""Pixels (n, 2), x and y, and how strong their corners are."""
Part = tuple[int, int, int, int]
"""Left, top, right, bottom, px; the last two beyond it."""


class CornerDetector:
    """FAST-9 corners of one size of picture, at most ``capacity`` a frame.

    With ``fast_adaptive`` about ``corners_target`` are found, by a threshold that follows the scene; no part of the
    picture has more than its share, and where there are next to none a lower threshold looks again. All of it depends
    on the pictures so far and nothing else. ``seen``: where corners are wanted, (height, width), elsewhere 0; None:
    everywhere.
    """

    def __init__(self, settings: Filter, lens: Lens, capacity: int, seen: Grey | None = None) -> None:
        self._seen = seen
        self._settings = settings
        self._lens = lens
        self._capacity = capacity
        self._squares = Squares(lens.width, lens.height, settings.corners_target)
        self._strong = FollowingThreshold(settings.fast_threshold, *THRESHOLDS)
        self._weak = FollowingThreshold(WEAKEST, WEAKEST, THRESHOLDS[1])
        self._open = self._squares.touched(np.ones((lens.height, lens.width), np.bool_) if seen is None else seen > 0)

    @property
    def threshold(self) -> int:
        """Of the next frame, grey levels."""
        return self._strong.value

    def detect(self, image: Grey, highest_row: float = math.nan) -> tuple[Corners, int]:
        """Corners of a (height, width) picture, and how many were left out because the budget was full.

        ``highest_row``: px, above it nothing can be met, and faint corners are not looked for; NaN: unknown.
        """
        height, width = image.shape
        pixel, strength = self._look(image, self._strong, [(0, 0, width, height)])
        if self._settings.fast_adaptive:
            pixel, strength = self._shared_out(image, pixel, strength, highest_row)
        position = self._lens.undistort_pixels(pixel[:, 0], pixel[:, 1])
        keep = np.arange(len(pixel))
        if self._lens.is_distorted:
            keep = np.isfinite(position[:, 0]).nonzero()[0]
        evicted = max(0, len(keep) - self._capacity)
        if evicted:
            keep = keep[strongest_spread(pixel[keep], strength[keep], self._capacity, SPREAD_PX)]
        if len(keep) < len(pixel):
            pixel, position = pixel.take(keep, axis=0), position.take(keep, axis=0)
        return Corners(pixel, position, appearance(image, pixel)), evicted

    def _shared_out(
        self, image: Grey, pixel: npt.NDArray[np.int32], strength: npt.NDArray[np.float32], highest_row: float
    ) -> Found:
        """No square has more than its share; the poor ones are looked at again."""
        squares = self._squares
        rows = squares.strongest(pixel, strength, squares.most)
        pixel, strength = pixel[rows], strength[rows]
        poor = squares.poor(pixel) & self._open
        if self._weak.value >= self._strong.value:
            poor[:] = False  # it would find what has been found
        elif highest_row > 0:  # NaN is not
            poor[: max(int(highest_row / squares.side_px) - ROWS_ABOVE, 0)] = False
        faint, how_faint = self._look(image, self._weak, squares.runs(poor))
        self._weak.follow(max(len(faint), 1) / (WEAK_SHARE * self._settings.corners_target))
        rows = squares.strongest(faint, how_faint, FEW)
        rich = ~squares.at(poor, pixel)  # the second look has found what was in the poor ones
        pixel, strength = np.concatenate([pixel[rich], faint[rows]]), np.concatenate([strength[rich], how_faint[rows]])
        self._strong.follow(max(len(pixel), 1) / self._settings.corners_target)
        return pixel, strength

    def _look(self, image: Grey, threshold: FollowingThreshold, parts: Iterable[Part]) -> Found:
        """Corners of parts of the picture, but for those along an edge."""
        height, width = image.shape
        margin = BORDER_PX - FAST_BORDER_PX
        keypoints: list[cv2.KeyPoint] = []
        corner_of_part, counts = [], []
        for part in parts:
            left, top = max(part[0] - FAST_BORDER_PX, margin), max(part[1] - FAST_BORDER_PX, margin)
            right = min(part[2] + FAST_BORDER_PX, width - margin)
            bottom = min(part[3] + FAST_BORDER_PX, height - margin)
            if left < right and top < bottom:
                seen = None if self._seen is None else self._seen[top:bottom, left:right]
                found = threshold.fast.detect(image[top:bottom, left:right], seen)
                keypoints += found
                corner_of_part.append((left, top))
                counts.append(len(found))
        pixel = np.asarray(cv2.KeyPoint.convert(keypoints), np.float32).reshape(-1, 2).astype(np.int32)
        pixel += np.array(corner_of_part, np.int32).reshape(-1, 2).repeat(counts, axis=0)
        strength = np.fromiter(map(attrgetter("response"), keypoints), np.float32, len(keypoints))
        if self._settings.least_roundness:
            kept = (roundness(image, pixel) >= self._settings.least_roundness).nonzero()[0]
            pixel, strength = pixel.take(kept, axis=0), strength.take(kept)
        return pixel, strength
