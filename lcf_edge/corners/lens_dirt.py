"""Drops and dirt on the lens: small regions that stay in place in the image while the camera turns.

In the downscaled image the grey gradient of every pixel is averaged over images between which the camera has turned.
Where the image stays as it is, the mean is as long as the root mean square; where the world passes, gradients change
and point anywhere. What is upright or level may stay as well: it is long. What reaches the border is a part of the
vehicle.
"""

import math

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.lens import Lens
from lcf_edge.small_image import SmallImage

Grey = npt.NDArray[np.uint8]

MEMORY = 30  # images
MIN_IMAGES = 10
APART = 3.0  # small px by which the camera must turn from one image to the next
STILL = 0.8  # least ratio of the mean gradient to the root mean square
TEXTURED = 6.0  # root mean square of the gradients, grey levels over 2 small px
MAX_SHARE = 0.2  # of the textured pixels; if more are still, the camera has not turned
MIN_SIDE, MIN_AREA = 4, 20  # of a region, small px
MAX_ASPECT = 3.0
MIN_FILLED = 0.35  # of its bounding box
MARGIN = 2  # small px around a region, where its rim blends into the world
SURE, MOST = 2, 4  # times found, more often than not found


class LensDirt:
    """``is_seen``: whether there is some. ``hidden``: where, uint8 of the downscaled image, 0: the world is seen there.

    ``visible``: uint8 (height, width) of the input image, 0 on own parts.
    """

    def __init__(self, lens: Lens, visible: Grey | None) -> None:
        size = SmallImage(lens.width, lens.height)
        self.is_seen = False
        self.hidden: Grey = np.zeros((size.height, size.width), np.uint8)
        self._side = size.side
        self._focal = math.sqrt(lens.fx * lens.fy) / size.side
        self._sums = np.zeros((3, size.height, size.width), np.float32)  # of gradients across and down, of squares
        self._images = 0.0
        self._turned = np.eye(3)  # since the last image that was taken
        self._times = 0  # that a region was found
        self._world = np.ones((size.height, size.width), np.bool_)
        if visible is not None:
            self._world = cv2.erode(size.of(visible), np.ones((3, 3), np.uint8)) == 255

    def look(self, small: Grey, rotation: npt.NDArray[np.float64], still: bool | None) -> None:
        """Take a frame's downscaled image, and the rotation (3, 3) of directions since the last frame.

        ``still``: whether the image has been stationary; then what seems to be a turn is an error of the gyro.
        """
        self._turned = rotation @ self._turned
        if still or math.hypot(*self._turned[:2, 2]) * self._focal < APART:
            return
        self._turned = np.eye(3)
        self._add(small)
        if self._images >= MIN_IMAGES:
            found = self._find()
            self._times = min(self._times + 1, MOST) if found.any() else max(self._times - 1, 0)
            self.is_seen = self._times >= (1 if self.is_seen else SURE)
            if not self.is_seen:
                self.hidden[:] = 0
            elif found.any():
                self.hidden[:] = found

    def shows_world(self, pixel: npt.NDArray[np.int32]) -> npt.NDArray[np.bool_]:
        """Return whether corners, (n, 2) px of the input image, are beside the dirt."""
        height, width = self.hidden.shape
        across, down = (np.minimum(pixel // self._side, (width - 1, height - 1))).T
        beside: npt.NDArray[np.bool_] = self.hidden[down, across] == 0
        return beside

    def _add(self, small: Grey) -> None:
        kept = 1 - 1 / MEMORY
        grey, (across, down, squares) = small.astype(np.float32), self._sums
        self._sums *= kept
        self._images = kept * self._images + 1
        dx, dy = grey[1:-1, 2:] - grey[1:-1, :-2], grey[2:, 1:-1] - grey[:-2, 1:-1]
        across[1:-1, 1:-1] += dx
        down[1:-1, 1:-1] += dy
        squares[1:-1, 1:-1] += dx * dx + dy * dy

    def _find(self) -> Grey:
        """Return where there is dirt now, as ``hidden``."""
        across, down, squares = self._sums
        textured = squares > TEXTURED * TEXTURED * self._images
        textured &= self._world
        still = across * across + down * down > STILL * STILL * self._images * squares
        still &= textured
        dirt = np.zeros(still.shape, np.uint8)
        if np.count_nonzero(still) > MAX_SHARE * np.count_nonzero(textured):
            return dirt
        _, regions, stats, _ = cv2.connectedComponentsWithStats(still.view(np.uint8))
        height, width = still.shape
        for number, (left, top, wide, high, area) in enumerate(stats.tolist()):
            inside = left > 1 and top > 1 and left + wide < width - 1 and top + high < height - 1
            compact = max(wide, high) <= MAX_ASPECT * min(wide, high) and area >= MIN_FILLED * wide * high
            if number > 0 and inside and compact and min(wide, high) >= MIN_SIDE and area >= MIN_AREA:
                dirt[regions == number] = 1  # region 0 is all that is not still
        return np.asarray(cv2.dilate(dirt, np.ones((2 * MARGIN + 1, 2 * MARGIN + 1), np.uint8)), np.uint8)
