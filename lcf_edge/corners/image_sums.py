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


def fine_share(image: Column, first: int, lines: int, between: int, step: int, length: int, far: int) -> float:
    """Mean square difference of neighbours as a share of that of pixels ``far`` apart; of the latter at least 1.

    Of ``lines`` lines that begin ``between`` px after each other, each of ``length`` pixels ``step`` px apart.
    """
    near_sum, far_sum = 0, 0
    for line in range(lines):
        at = first + line * between
        for _ in range(length - far):
            near, away = image[at + step] - image[at], image[at + far * step] - image[at]
            near_sum += near * near
            far_sum += away * away
            at += step
        for _ in range(far - 1):
            near = image[at + step] - image[at]
            near_sum += near * near
            at += step
    near_mean = float(near_sum) / (lines * (length - 1))
    return near_mean / max(float(far_sum) / (lines * (length - far)), 1.0)
