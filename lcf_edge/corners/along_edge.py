"""Corners that only mark a place along an edge: the grey values around them change in one direction alone.

FAST takes the steps of a slanting line for corners. They keep their place while the line passes, and so look like
something that drives ahead. The structure tensor around a corner, the sum of g gᵀ over the gradients g of its
surroundings, distinguishes them: along an edge, the smaller of its two eigenvalues is almost zero (Harris and
Stephens 1988; Shi and Tomasi 1994).
"""

import math
from typing import Any, TypeAlias

import numpy as np

from lcf_edge.filter.memory import memory_of

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview
Grid: TypeAlias = Any  # and [i, j]

REACH_PX = 3  # the surroundings are 7 by 7 px
BORDER_PX = REACH_PX + 2  # their gradients take one more, and a vector may go on into the row below
WITHIN = memory_of(np.array((1,) * 7 + (0,) * 9, np.int16))  # 1: a px of a vector lies in the surroundings


def keep_round(image: Column, width: int, within: Column, pixel: Grid, strength: Column, least: float) -> int:
    """Move the corners with a ``roundness`` of ``least`` or more to the front, in the same order. Return how many.

    ``image``: uint8, row after row of ``width`` px; ``within``: ``WITHIN``; ``pixel``: int32 (n, 2), x and y, at least
    ``BORDER_PX`` inside; ``strength``: float32 (n,).
    """
    kept = 0
    for i in range(pixel.shape[0]):
        if roundness(image, width, within, pixel[i, 0], pixel[i, 1]) >= least:
            pixel[kept, 0], pixel[kept, 1], strength[kept] = pixel[i, 0], pixel[i, 1], strength[i]
            kept += 1
    return kept


def roundness(image: Column, width: int, within: Column, x: int, y: int) -> float:
    """λ_min/λ_max of the structure tensor around a pixel.

    0: along an edge, or nothing at all; 1: the same in all directions. The gradients are those of Sobel: by plain
    differences the steps of a sharp slanting edge would count as much as a rounded corner.
    """
    xx = yy = xy = 0
    for v in range(y - REACH_PX, y + REACH_PX + 1):
        at = v * width + x - REACH_PX
        above, below = at - width, at + width
        for k in range(16):  # a constant: one vector, of which 7 px count
            before = image[above + k - 1] + 2 * image[at + k - 1] + image[below + k - 1]
            after = image[above + k + 1] + 2 * image[at + k + 1] + image[below + k + 1]
            upper = image[above + k - 1] + 2 * image[above + k] + image[above + k + 1]
            lower = image[below + k - 1] + 2 * image[below + k] + image[below + k + 1]
            gx, gy = within[k] * (after - before), within[k] * (lower - upper)
            xx += gx * gx
            yy += gy * gy
            xy += gx * gy
    mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    apart = math.sqrt(half * half + float(xy) * xy)
    return (mean - apart) / max(mean + apart, 1.0)
