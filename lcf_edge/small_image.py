"""A downscaled image: halved until little of it is left, so that noise averages out and only outlines stay."""

from math import log2
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

AREA_PX = 4800  # of a small image, about

Grey = npt.NDArray[np.uint8]


class SmallImage:
    """For images of one size. ``side``: px of the image for each small px; ``width``, ``height``: small px."""

    def __init__(self, width: int, height: int) -> None:
        halvings = max(0, round(log2(width * height / AREA_PX) / 2))
        self._halvings = halvings if min(width, height) >= 2 * 2**halvings else 0
        self.side = 2**self._halvings
        self.width, self.height = width // self.side, height // self.side

    def of(self, image: Grey) -> Grey:
        """Return an image, uint8 (height, width), downscaled, less what fills no small px at its right and bottom."""
        small: npt.NDArray[Any] = image[: self.height * self.side, : self.width * self.side]
        for _ in range(self._halvings):
            small = cv2.resize(small, (small.shape[1] // 2, small.shape[0] // 2), interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(small)
