"""Corners that only mark a place along an edge: the grey values around them change in one direction alone.

FAST takes the steps of a slanting line for corners. They keep station while the line passes by, and so look like
something that drives ahead. The structure tensor around a corner, the sum of g gᵀ over the gradients g of its
surroundings, tells them apart: of its two eigenvalues the smaller is next to nothing along an edge (Harris and
Stephens 1988; Shi and Tomasi 1994).
"""

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Grid: TypeAlias = Any  # what [i, j] can be asked of: typed memory when compiled, else a memoryview

REACH_PX = 3  # the surroundings are 7 by 7 px
BORDER_PX = REACH_PX + 1  # their gradients take one more


def roundness(image: npt.NDArray[np.uint8], pixel: npt.NDArray[np.int32]) -> npt.NDArray[np.float32]:
    """λ_min/λ_max of the structure tensor at each of the pixels (n, 2), x and y, at least ``BORDER_PX`` inside.

    0: along an edge, or nothing at all; 1: the same in all directions. The gradients are those of Sobel: by plain
    differences the steps of a sharp slanting edge would count as much as a rounded corner.
    """
    ratio = np.empty(len(pixel), np.float32)
    measure(image.data, pixel.data, ratio.data)
    return ratio


def measure(image: Grid, pixel: Grid, ratio: Grid) -> None:
    """Fill ``ratio``, float32 (n,); ``image``: uint8 (height, width), ``pixel``: int32 (n, 2)."""
    for i in range(pixel.shape[0]):
        ratio[i] = eigenvalue_ratio(image, pixel[i, 0], pixel[i, 1])


def eigenvalue_ratio(image: Grid, x: int, y: int) -> float:
    """λ_min/λ_max around one pixel."""
    xx = yy = xy = 0
    for v in range(y - REACH_PX, y + REACH_PX + 1):
        for u in range(x - REACH_PX, x + REACH_PX + 1):
            slanting = image[v + 1, u + 1] - image[v - 1, u - 1]
            other = image[v - 1, u + 1] - image[v + 1, u - 1]
            gx = 2 * (image[v, u + 1] - image[v, u - 1]) + slanting + other
            gy = 2 * (image[v + 1, u] - image[v - 1, u]) + slanting - other
            xx += gx * gx
            yy += gy * gy
            xy += gx * gy
    mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    apart = math.sqrt(half * half + float(xy) * xy)
    return (mean - apart) / max(mean + apart, 1.0)
