"""The paper's own comparison: a map of all FAST-9 landmarks. It finds no circles; only its size is of interest.

A landmark in sight is tracked by Lucas-Kanade; a corner where no landmark is known is a new one. Landmarks out of
sight stay in the map.
"""

import cv2
import numpy as np

from benchmarks.peers.peer import Circles, Floats, Grey, Mask
from lcf_edge.config import PAPER, Config
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens
from lcf_edge.messages import CIRCLE

_KNOWN_PX = 5  # a corner this near to a landmark is that landmark
_MAX_CORNERS = 65535


class LandmarkMap:
    """``landmarks``: how many there are."""

    def __init__(self, config: Config, lens: Lens) -> None:
        self._detector = CornerDetector(PAPER, lens, _MAX_CORNERS)
        self._forgotten = 0  # out of sight, or lost
        self._in_sight = np.empty((0, 2), np.float32)  # px
        self._before: Grey | None = None
        del config

    @property
    def landmarks(self) -> int:
        """Landmarks in the map."""
        return self._forgotten + len(self._in_sight)

    def process(self, image: Grey, motion: Motion) -> Circles:
        """Process one image; there are no circles."""
        del motion
        if self._before is not None and len(self._in_sight):
            self._follow(self._before, image)
        corners, _ = self._detector.detect(image)
        at = corners.pixel.astype(np.float32)
        known = np.zeros(image.shape, np.uint8)
        spots = np.rint(self._in_sight).astype(np.intp)
        known[spots[:, 1], spots[:, 0]] = 1
        known = np.asarray(cv2.dilate(known, np.ones((2 * _KNOWN_PX + 1, 2 * _KNOWN_PX + 1), np.uint8)), np.uint8)
        new: Mask = known[corners.pixel[:, 1], corners.pixel[:, 0]] == 0
        self._in_sight = np.concatenate([self._in_sight, at[new]])
        self._before = image.copy()
        return np.zeros(0, CIRCLE)

    def _follow(self, before: Grey, image: Grey) -> None:
        height, width = image.shape
        after, found, _ = cv2.calcOpticalFlowPyrLK(before, image, self._in_sight[:, None], np.empty(0))
        moved: Floats = np.asarray(after, np.float32)[:, 0]
        seen = (found.ravel() > 0) & ((moved >= 0) & (moved < (width - 1, height - 1))).all(axis=1)
        self._forgotten += len(seen) - int(np.count_nonzero(seen))
        self._in_sight = moved[seen]
