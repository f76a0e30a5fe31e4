"""Sums over some pixels of an image. NumPy would copy these pixels first, which takes longer than to add them up.

An ``image`` is uint8, row after row of ``width`` px.
"""

from typing import Any, TypeAlias

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview

FOURTH = 4


def compare(image: Column, width: int, height: int, samples: Column, others: Column) -> int:
    """Take every fourth pixel of every fourth row, and return the sum of absolute differences to others.

    ``samples``, written, and ``others``: uint8.
    """
    total, across = 0, (width + FOURTH - 1) // FOURTH
    for y in range((height + FOURTH - 1) // FOURTH):
        at, k = FOURTH * y * width, y * across
        for x in range(across):
            grey = image[at + 4 * x]  # FOURTH, as a number: many at once
            samples[k + x] = grey
            total += abs(grey - others[k + x])
    return total


def brightness(image: Column, width: int, height: int, step: int, least: int, into: Column) -> None:
    """The sum of every ``step``-th pixel of every ``step``-th row, and how many are ``least`` or brighter.

    ``into``: int32 (2,), written.
    """
    total, bright = 0, 0
    for y in range((height + step - 1) // step):
        at = y * step * width
        for _ in range((width + step - 1) // step):
            total += image[at]
            bright += image[at] >= least
            at += step
    into[0], into[1] = total, bright


def fine_share_of_rows(image: Column, width: int, height: int, first: int, between: int, far: int) -> float:
    """Mean square difference of neighbours in a row as a share of that of pixels ``far`` apart, which is at least 1.

    Of row ``first`` and every ``between``-th after it.
    """
    near_sum, far_sum = 0, 0
    lines = (height - first + between - 1) // between
    for line in range(lines):
        at = (first + line * between) * width
        near_sum += squares_along(image, at, at + 1, width - 1)
        far_sum += squares_along(image, at, at + far, width - far)
    return fine_share(near_sum, lines * (width - 1), far_sum, lines * (width - far))


def fine_share_of_columns(image: Column, width: int, height: int, first: int, between: int, far: int) -> float:
    """The same of column ``first`` and every ``between``-th after it, row by row as they lie in memory."""
    near_sum, far_sum = 0, 0
    lines = (width - first + between - 1) // between
    for y in range(height - 1):
        at = y * width + first
        near_sum += squares_across(image, at, at + width, lines, between)
        if y < height - far:
            far_sum += squares_across(image, at, at + far * width, lines, between)
    return fine_share(near_sum, lines * (height - 1), far_sum, lines * (height - far))


def squares_along(image: Column, at: int, other: int, count: int) -> int:
    """Sum of square differences of two runs of pixels."""
    total = 0
    for k in range(count):
        difference = image[other + k] - image[at + k]
        total += difference * difference
    return total


def squares_across(image: Column, at: int, other: int, count: int, between: int) -> int:
    """The same of pixels that stand ``between`` px apart."""
    total = 0
    for _ in range(count):
        difference = image[other] - image[at]
        total += difference * difference
        at += between
        other += between
    return total


def fine_share(near_sum: int, near_count: int, far_sum: int, far_count: int) -> float:
    """One mean as a share of the other, which is at least 1."""
    return float(near_sum) / near_count / max(float(far_sum) / far_count, 1.0)
