"""Corners that only mark a place along an edge: the grey values around them change in one direction alone.

FAST takes the steps of a slanting line for corners. They keep their place while the line passes, and so look like
something that drives ahead. The structure tensor around a corner, the sum of g gᵀ over the gradients g of its
surroundings, distinguishes them: along an edge, the smaller of its two eigenvalues is almost zero (Harris and
Stephens 1988; Shi and Tomasi 1994).
"""

import math
from typing import Any, TypeAlias

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview
Grid: TypeAlias = Any  # and [i, j]

REACH_PX = 3  # the surroundings are 7 by 7 px
BORDER_PX = REACH_PX + 1  # their gradients take one more


def keep_round(image: Column, width: int, pixel: Grid, strength: Column, least: float) -> int:
    """Move the corners with a ``roundness`` of ``least`` or more to the front, in the same order. Return how many.

    ``image``: uint8, row after row of ``width`` px; ``pixel``: int32 (n, 2), x and y, at least ``BORDER_PX`` inside;
    ``strength``: float32 (n,).
    """
    kept = 0
    for i in range(pixel.shape[0]):
        if roundness(image, width, pixel[i, 0], pixel[i, 1]) >= least:
            pixel[kept, 0], pixel[kept, 1], strength[kept] = pixel[i, 0], pixel[i, 1], strength[i]
            kept += 1
    return kept


def roundness(image: Column, width: int, x: int, y: int) -> float:
    """λ_min/λ_max of the structure tensor around a pixel.

    0: along an edge, or nothing at all; 1: the same in all directions. The gradients are those of Sobel: by plain
    differences the steps of a sharp slanting edge would count as much as a rounded corner. Each is the difference of
    two columns that are smoothed, or the smoothed difference within three: ``smooth`` and ``slope`` of each column
    serve for three pixels.
    """
    xx = yy = xy = 0
    for v in range(y - REACH_PX, y + REACH_PX + 1):
        start = v * width + x - REACH_PX
        above, below = image[start - 1 - width], image[start - 1 + width]
        smooth_before, slope_before = above + 2 * image[start - 1] + below, below - above
        above, below = image[start - width], image[start + width]
        smooth, slope = above + 2 * image[start] + below, below - above
        for k in range(start + 1, start + 2 * REACH_PX + 2):
            above, below = image[k - width], image[k + width]
            smooth_after, slope_after = above + 2 * image[k] + below, below - above
            gx, gy = smooth_after - smooth_before, slope_before + 2 * slope + slope_after
            xx += gx * gx
            yy += gy * gy
            xy += gx * gy
            smooth_before, smooth, slope_before, slope = smooth, smooth_after, slope, slope_after
    mean, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    apart = math.sqrt(half * half + float(xy) * xy)
    return (mean - apart) / max(mean + apart, 1.0)
