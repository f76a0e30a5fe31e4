"""From a picture to corners: FAST, no more than the budget holds, spread over the picture, with looks."""

from operator import attrgetter

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.appearance import BORDER_PX, appearance
from lcf_edge.config import Filter
from lcf_edge.filter.inputs import Corners
from lcf_edge.lens import Lens

FAST_FROM_PX = BORDER_PX - 3  # FAST itself leaves out 3 px
SPREAD_PX = 40  # a frame with too many corners keeps the strongest of each such square first
THRESHOLDS = (13, 90)


class CornerDetector:
    """FAST-9 corners of one size of picture, at most ``capacity`` a frame.

    With ``fast_adaptive`` the threshold follows the scene, so that about ``corners_target`` are found; it
    depends on the pictures so far and nothing else.
    """

    def __init__(self, settings: Filter, lens: Lens, capacity: int) -> None:
        self._settings = settings
        self._lens = lens
        self._capacity = capacity
        self.threshold = settings.fast_threshold
        self._too_many: bool | None = None  # in the last frame
        self._fast = cv2.FastFeatureDetector.create(self.threshold, True, cv2.FAST_FEATURE_DETECTOR_TYPE_9_16)

    def detect(self, image: npt.NDArray[np.uint8]) -> tuple[Corners, int]:
        """Corners of a (height, width) picture, and how many were left out because the budget was full."""
        middle = image[FAST_FROM_PX:-FAST_FROM_PX, FAST_FROM_PX:-FAST_FROM_PX]
        keypoints = self._fast.detect(middle) if middle.size else ()
        found = len(keypoints)
        if self._settings.fast_adaptive:
            self._adapt(found)
        pixel = np.asarray(cv2.KeyPoint.convert(keypoints), np.float32).reshape(-1, 2).astype(np.int32)
        pixel += FAST_FROM_PX
        position = self._lens.undistort_pixels(pixel[:, 0], pixel[:, 1])
        keep = np.arange(found)
        if self._lens.is_distorted:
            keep = np.isfinite(position[:, 0]).nonzero()[0]
        evicted = max(0, len(keep) - self._capacity)
        if evicted:
            strength = np.fromiter(map(attrgetter("response"), keypoints), np.float32, found)[keep]
            keep = keep[strongest_spread(pixel[keep], strength, self._capacity)]
        if len(keep) < found:
            pixel, position = pixel.take(keep, axis=0), position.take(keep, axis=0)
        return Corners(pixel, position, appearance(image, pixel)), evicted

    def _adapt(self, found: int) -> None:
        """Next frame's threshold.

        Corner counts fall with its 1.5th to 8th power: a step suits 2.5, and 5 when the last one went too far.
        """
        ratio = max(found, 1) / self._settings.corners_target
        swung = self._too_many not in {None, ratio > 1}
        self._too_many = ratio > 1
        power = 0.2 if swung else 0.4
        wanted = self.threshold * min(max(ratio**power, 0.6), 1.6)
        threshold = int(min(max(round(wanted), THRESHOLDS[0]), THRESHOLDS[1]))
        if abs(wanted - self.threshold) > 0.2 * power * self.threshold and threshold != self.threshold:
            self.threshold = threshold
            self._fast.setThreshold(threshold)


def strongest_spread(
    pixel: npt.NDArray[np.int32], strength: npt.NDArray[np.float32], capacity: int
) -> npt.NDArray[np.intp]:
    """Rows of the ``capacity`` corners to keep: the strongest of every square, then the second, and on.

    ``pixel``: int32 (n, 2), ``strength``: float32 (n,). Answers rows, ascending.
    """
    square = (pixel[:, 1] // SPREAD_PX) * 65536 + pixel[:, 0] // SPREAD_PX
    order = np.lexsort((-strength, square))
    ordered = square[order]
    starts = np.flatnonzero(np.r_[True, ordered[1:] != ordered[:-1]])
    rank = np.arange(len(order)) - np.repeat(starts, np.diff(np.r_[starts, len(order)]))
    best = np.lexsort((-strength[order], rank))[:capacity]
    return np.sort(order[best])
