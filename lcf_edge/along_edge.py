"""Corners that only mark a place along an edge: the grey values around them change in one direction alone.

FAST takes the steps of a slanting line for corners. They keep station while the line passes by, and so look like
something that drives ahead. The structure tensor around a corner, the sum of g gᵀ over the gradients g of its
surroundings, tells them apart: of its two eigenvalues the smaller is next to nothing along an edge (Harris and
Stephens 1988; Shi and Tomasi 1994).
"""

import numpy as np
import numpy.typing as npt

REACH_PX = 3  # the surroundings are 7 by 7 px
BORDER_PX = REACH_PX + 1  # their gradients take one more


def roundness(image: npt.NDArray[np.uint8], pixel: npt.NDArray[np.int32]) -> npt.NDArray[np.float32]:
    """λ_min/λ_max of the structure tensor at each of the pixels (n, 2), x and y, at least ``BORDER_PX`` inside.

    0: along an edge, or nothing at all; 1: the same in all directions. The gradients are those of Sobel: by plain
    differences the steps of a sharp slanting edge would count as much as a rounded corner.
    """
    across = np.arange(-BORDER_PX, BORDER_PX + 1)
    width = image.shape[1]
    window = (across[:, None] * width + across).astype(np.int32).ravel()
    base = pixel[:, 1] * np.int32(width) + pixel[:, 0]
    grey = image.reshape(-1).take(base[:, None] + window).astype(np.float32)
    grey = grey.reshape(-1, len(across), len(across))
    down = grey[:, :-2] + 2 * grey[:, 1:-1] + grey[:, 2:]
    along = grey[:, :, :-2] + 2 * grey[:, :, 1:-1] + grey[:, :, 2:]
    gx, gy = down[:, :, 2:] - down[:, :, :-2], along[:, 2:] - along[:, :-2]
    xx, xy, yy = (np.einsum("ijk,ijk->i", one, other) for one, other in ((gx, gx), (gx, gy), (gy, gy)))
    mean, apart = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return np.asarray((mean - apart) / np.maximum(mean + apart, 1), np.float32)
