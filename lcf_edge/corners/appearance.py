"""What a corner looks like: 16 grey samples around it, by which it is recognised in the next image."""

from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.filter.inputs import SAMPLES_PX

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview
Grid: TypeAlias = Any  # and [i, j]

BORDER_PX = 7  # corners this far from the border have all samples inside the image
MEAN_GREY = 128

_RING = np.array(SAMPLES_PX)


def smoothed(image: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """Each pixel of a (height, width) image as the mean, rounded, of 3x3: a shift below 1 px changes it little."""
    return np.asarray(cv2.blur(image, (3, 3)), np.uint8)


def appearance(smooth: npt.NDArray[np.uint8], pixel: npt.NDArray[np.int32]) -> npt.NDArray[np.uint8]:
    """Grey samples around whole pixels, shifted to a mean of 128, whatever the light.

    ``smooth``: what ``smoothed`` makes of the image. ``pixel``: int32 (n, 2), x and y, ``BORDER_PX`` or more from the
    border, which is not checked. Return uint8 (n, 16).
    """
    samples = np.empty((len(pixel), len(SAMPLES_PX)), np.uint8)
    sample(smooth.reshape(-1).data, pixel.data, (_RING @ (1, smooth.shape[1])).data, smooth.shape[1], samples.data)
    return samples


def sample(smooth: Column, pixel: Grid, ring: Column, width: int, samples: Grid) -> None:
    """Fill ``samples``, uint8 (n, 16), with the grey values around each pixel, mean moved to 128.

    ``smooth``: row after row of ``width`` px; ``ring``: how much farther on in it each of the samples lies.
    """
    for i in range(pixel.shape[0]):
        at = pixel[i, 1] * width + pixel[i, 0]
        total = 0
        for k in range(16):  # a constant, so that the compiler unrolls the loop
            grey = smooth[at + ring[k]]
            samples[i, k] = grey
            total += grey
        shift = MEAN_GREY - total // 16
        for k in range(16):
            grey = samples[i, k] + shift
            samples[i, k] = min(max(grey, 0), 255)
