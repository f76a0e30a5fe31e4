"""What a corner looks like: 16 grey samples around it, by which it is recognised in the next image."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview
Grid: TypeAlias = Any  # and [i, j]

BORDER_PX = 7  # corners this far from the border have all samples inside the image
RING_PX = (
    (4, 0), (3, 3), (0, 4), (-3, 3), (-4, 0), (-3, -3), (0, -4), (3, -3),
    (6, 2), (2, 6), (-2, 6), (-6, 2), (-6, -2), (-2, -6), (2, -6), (6, -2),
)  # fmt: skip
MEAN_GREY = 128
NOISE = 3  # grey levels
ALIKE_SHARE = 0.6  # of the contrast; at half of it one is taken for the other

_RING = np.array(RING_PX)


def appearance(image: npt.NDArray[np.uint8], pixel: npt.NDArray[np.int32]) -> npt.NDArray[np.uint8]:
    """Grey samples around whole pixels, each the mean of a square; shifted to a mean of 128, whatever the light.

    ``image``: uint8 (height, width). ``pixel``: int32 (n, 2), x and y, ``BORDER_PX`` or more from the border,
    which is not checked. Return uint8 (n, 16).
    """
    samples = np.empty((len(pixel), len(RING_PX)), np.uint8)
    width = image.shape[1]
    flat = np.ascontiguousarray(image).reshape(-1)
    sample(flat.data, width, pixel.data, (_RING @ (1, width)).data, samples.data)
    return samples


def mean_around(image: Column, width: int, at: int) -> int:
    """The mean, rounded, of a pixel and the 8 around it: a shift below 1 px changes it little."""
    above, below = at - width, at + width
    total = image[above - 1] + image[above] + image[above + 1] + image[at - 1] + image[at] + image[at + 1]
    total += image[below - 1] + image[below] + image[below + 1]
    mean: int = (total + 4) // 9
    return mean


def sample(image: Column, width: int, pixel: Grid, ring: Column, samples: Grid) -> None:
    """Fill ``samples``, uint8 (n, 16), with the grey values around each pixel, mean moved to 128.

    ``image``: row after row of ``width`` px; ``ring``: how much farther on in it each of the samples lies.
    """
    for i in range(pixel.shape[0]):
        at = pixel[i, 1] * width + pixel[i, 0]
        total = 0
        for k in range(16):  # a constant, so that the compiler unrolls the loop
            grey = mean_around(image, width, at + ring[k])
            samples[i, k] = grey
            total += grey
        shift = MEAN_GREY - total // 16
        for k in range(16):
            grey = samples[i, k] + shift
            samples[i, k] = min(max(grey, 0), 255)


def look_alike(samples: Grid, i: int, k: int) -> bool:
    """Whether two appearances differ by less than noise and a share of the higher one's contrast."""
    differences = one = other = 0
    for s in range(16):
        differences += abs(samples[i, s] - samples[k, s])
        one += abs(samples[i, s] - MEAN_GREY)
        other += abs(samples[k, s] - MEAN_GREY)
    return bool(differences < 16 * NOISE + ALIKE_SHARE * max(one, other))
