"""Corners that are a single pixel of the sensor, hot, stuck or dead: they keep their place while the world passes.

Such a pixel differs from the eight around it by much of what it differs from the ring that makes it a corner. Fine
texture does so as well, but does not stay at one pixel, image after image.
"""

from typing import Any, TypeAlias

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview
Grid: TypeAlias = Any  # and [i, j]

ALONE_SHARE = 0.7  # of the strength of a corner, by which a single pixel differs from those around it,
ALONE_GREY = 10  # and grey levels: noise differs by less
IMAGES = 5  # in which a pixel stands alone before it is hot;
MISSED = 2  # images between two of them, at most
SINGLES = 4093, 3  # shape of the table of pixels that stood alone; a prime, over which columns and rows spread


def keep_cool(singles: Grid, number: int, image: Column, width: int, pixel: Grid, strength: Column) -> int:
    """Move the corners that are no hot pixels to the front, in the same order. Return how many.

    ``singles``: int32 of shape ``SINGLES``, at first 0, written: which pixel, the last image that it stood alone in,
    and in how many. Another pixel takes a row over once it is out of date. ``number``: of the image, from 1, of which
    parts may be given one after the other; ``image``: uint8, row after row of ``width`` px; ``pixel``: int32 (n, 2),
    x and y, not at the border; ``strength``: float32 (n,).
    """
    kept = 0
    for i in range(pixel.shape[0]):
        at = pixel[i, 1] * width + pixel[i, 0]
        if stands_alone(image, width, at, strength[i]) and is_hot(singles, number, at):
            continue
        pixel[kept, 0], pixel[kept, 1], strength[kept] = pixel[i, 0], pixel[i, 1], strength[i]
        kept += 1
    return kept


def stands_alone(image: Column, width: int, at: int, strength: float) -> bool:
    """Whether a pixel is brighter than all eight around it, or darker, as a defect is."""
    grey, most, least = image[at], 0, 255
    for row in range(-1, 2):
        middle = at + row * width
        for beside in range(middle - 1, middle + 2):
            if beside != at:
                most, least = max(most, image[beside]), min(least, image[beside])
    return bool(max(grey - most, least - grey) >= max(ALONE_SHARE * strength, ALONE_GREY))


def is_hot(singles: Grid, number: int, at: int) -> bool:
    """Note that a pixel stands alone in this image. Return whether it has done so in enough."""
    row = at % singles.shape[0]
    images = singles[row, 2]
    current = images > 0 and number - singles[row, 1] <= MISSED + 1
    if current and singles[row, 0] != at:
        return False
    if not current:
        images = 1
    elif singles[row, 1] < number:
        images += 1
    singles[row, 0], singles[row, 1], singles[row, 2] = at, number, images
    return bool(images >= IMAGES)
