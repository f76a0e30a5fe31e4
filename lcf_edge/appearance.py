"""What a corner looks like: 16 grey samples around it, by which it is known again in the next picture."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Grid: TypeAlias = Any  # what [i, j] can be asked of: typed memory when compiled, else a memoryview

BORDER_PX = 7  # no sample of a corner that far from the border lies outside the picture
RING_PX = (
    (4, 0), (3, 3), (0, 4), (-3, 3), (-4, 0), (-3, -3), (0, -4), (3, -3),
    (6, 2), (2, 6), (-2, 6), (-6, 2), (-6, -2), (-2, -6), (2, -6), (6, -2),
)  # fmt: skip
MEAN_GREY = 128

_RING = np.array(RING_PX, np.int32).data


def appearance(image: npt.NDArray[np.uint8], pixel: npt.NDArray[np.int32]) -> npt.NDArray[np.uint8]:
    """Grey samples around whole pixels; their mean is moved to 128, so that a change of light is no change.

    ``image``: uint8 (height, width). ``pixel``: int32 (n, 2), x and y, ``BORDER_PX`` or more from the border;
    whoever calls makes sure of that. Return uint8 (n, 16).
    """
    samples = np.empty((len(pixel), len(RING_PX)), np.uint8)
    sample(image.data, pixel.data, _RING, samples.data)
    return samples


def sample(image: Grid, pixel: Grid, ring: Grid, samples: Grid) -> None:
    """Fill ``samples``, uint8 (n, 16), with the grey values ``ring`` px from each pixel, mean moved to 128."""
    count = ring.shape[0]
    for i in range(pixel.shape[0]):
        x, y = pixel[i, 0], pixel[i, 1]
        total = 0
        for k in range(count):
            total += image[y + ring[k, 1], x + ring[k, 0]]
        shift = MEAN_GREY - total // count
        for k in range(count):
            grey = image[y + ring[k, 1], x + ring[k, 0]] + shift
            samples[i, k] = min(max(grey, 0), 255)
