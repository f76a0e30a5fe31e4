"""What a corner looks like: 16 grey samples around it, by which it is recognised in the next image."""

from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview
Grid: TypeAlias = Any  # and [i, j]

BORDER_PX = 7  # no sample of a corner that far from the border lies outside the picture
RING_PX = (
    (4, 0), (3, 3), (0, 4), (-3, 3), (-4, 0), (-3, -3), (0, -4), (3, -3),
    (6, 2), (2, 6), (-2, 6), (-6, 2), (-6, -2), (-2, -6), (2, -6), (6, -2),
)  # fmt: skip
MEAN_GREY = 128
MEAN_PX = 3  # side of the square that a sample is the mean of: less than a px of shift changes it little

_RING = np.array(RING_PX)


def appearance(image: npt.NDArray[np.uint8], pixel: npt.NDArray[np.int32]) -> npt.NDArray[np.uint8]:
    """Grey samples around whole pixels, each the mean of a square; their mean is 128, whatever the light.

    ``image``: uint8 (height, width). ``pixel``: int32 (n, 2), x and y, ``BORDER_PX`` or more from the border;
    the caller makes sure of that. Return uint8 (n, 16).
    """
    samples = np.empty((len(pixel), len(RING_PX)), np.uint8)
    width = image.shape[1]
    smooth = cv2.blur(image, (MEAN_PX, MEAN_PX))
    sample(smooth.reshape(-1).data, width, pixel.data, (_RING @ (1, width)).data, samples.data)
    return samples


def sample(image: Column, width: int, pixel: Grid, ring: Column, samples: Grid) -> None:
    """Fill ``samples``, uint8 (n, 16), with the grey values around each pixel, mean moved to 128.

    ``image``: row after row of ``width`` px; ``ring``: how much farther on in it each of the samples lies.
    """
    for i in range(pixel.shape[0]):
        at = pixel[i, 1] * width + pixel[i, 0]
        total = 0
        for k in range(16):  # as a number, so that the compiler unrolls it
            total += image[at + ring[k]]
        shift = MEAN_GREY - total // 16
        for k in range(16):
            grey = image[at + ring[k]] + shift
            samples[i, k] = min(max(grey, 0), 255)
