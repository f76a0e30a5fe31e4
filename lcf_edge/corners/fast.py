"""FAST-9 corners of parts of an image, with several thresholds.

The compiled ``fast_scores`` looks at each pixel once for all of them, and its corners are arrays from the beginning:
converting OpenCV's to Python objects and back to numbers would take longer than finding them. Uncompiled they come from
OpenCV, which finds the same.
"""

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.compilation import uncompiled
from lcf_edge.corners.fast_scores import RING_PX, Scores, bound, find

Grey = npt.NDArray[np.uint8]
Pixels = npt.NDArray[np.int32]
Strengths = npt.NDArray[np.float32]
Found = tuple[Pixels, Strengths]
"""Pixels (n, 2), x and y, and how strong their corners are: the highest threshold that finds them."""
Parts = npt.NDArray[np.int32]
"""(n, 4): left, top, right, bottom, px; the last two beyond it."""

DARK = 48  # grey level; what reflects little has few levels between its parts, and less noise
_REACH_PX = max(max(pixel) for pixel in RING_PX)


class Fast:
    """FAST-9 with non-maximum suppression, for one size of image; ``compiled``: None: as the filter is."""

    def __init__(self, width: int, height: int, *, compiled: bool | None = None) -> None:
        self._image = np.empty((0, 0), np.uint8)
        self._scores = None
        if not uncompiled() if compiled is None else compiled:
            self._scores = Scores(width, height, DARK)
            self._pixel = np.empty((width * height, 2), np.int32)  # untouched pages take no memory
            self._strength = np.empty(width * height, np.float32)

    def look(self, image: Grey) -> None:
        """Take the next image, contiguous (height, width), which must not change until its corners are found."""
        self._image = image
        if self._scores is not None:
            bound(self._scores, image.reshape(-1).data)

    def corners(self, threshold: int, parts: Parts, on_dark: int | None = None) -> Found:
        """Corners of parts of the image, part by part and row by row; 3 px or more inside the image.

        ``on_dark``: the threshold of pixels darker than ``DARK``, if it is lower.
        """
        on_dark = threshold if on_dark is None else min(on_dark, threshold)
        if self._scores is None:
            pixel, strength = self._by_opencv(on_dark, parts)
            kept = (self._image[pixel[:, 1], pixel[:, 0]] < DARK) | (strength >= threshold)
            return pixel[kept], strength[kept]
        pixel, strength = self._pixel, self._strength
        flat = self._image.reshape(-1).data
        count = find(
            self._scores, flat, threshold, on_dark, np.ascontiguousarray(parts).data, pixel.data, strength.data
        )
        return pixel[:count].copy(), strength[:count].copy()

    def _by_opencv(self, threshold: int, parts: Parts) -> Found:
        """Return the same, more slowly."""
        fast = cv2.FastFeatureDetector.create(threshold, True, cv2.FAST_FEATURE_DETECTOR_TYPE_9_16)
        pixel, strength = [np.empty((0, 2), np.int32)], [np.empty(0, np.float32)]
        for left, top, right, bottom in np.add(parts, (-_REACH_PX, -_REACH_PX, _REACH_PX, _REACH_PX)).tolist():
            if (found := fast.detect(self._image[top:bottom, left:right])) and left < right:
                pixel.append(np.array([one.pt for one in found], np.int32) + np.array((left, top), np.int32))
                strength.append(np.array([one.response for one in found], np.float32))
        return np.concatenate(pixel), np.concatenate(strength)
