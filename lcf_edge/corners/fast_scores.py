"""FAST-9: what makes a pixel a corner, and how strong it is (Rosten and Drummond, ECCV 2006).

Of the 16 pixels of a ring around it, 9 in a row are all brighter than it, or all darker, by more than a threshold. Its
score is the largest difference that all 9 of one such arc have; a corner's is above the threshold, and above those of
the 8 pixels around.

First ``bound`` gives each pixel of an image a score that its own cannot exceed, which takes no branch and is done for
many pixels at once. Then ``find`` takes the few for which it is above the threshold, puts their true scores in its
place, and says which are corners: for any number of parts of the image and thresholds.
"""

from typing import Any, TypeAlias

import numpy as np

from lcf_edge.filter.memory import integers, memory_of, octets

Column: TypeAlias = Any  # what [i] can be asked of: typed memory when compiled, else a memoryview
Grid: TypeAlias = Any  # and [i, j]

RING_PX = (
    (0, 3), (1, 3), (2, 2), (3, 1), (3, 0), (3, -1), (2, -2), (1, -3),
    (0, -3), (-1, -3), (-2, -2), (-3, -1), (-3, 0), (-3, 1), (-2, 2), (-1, 3),
)  # fmt: skip
REACH_PX = 3
BLOCK = 256  # pixels scored at once
LOW_BITS, HIGH_BITS, ONES = 0x7F7F7F7F7F7F7F7F, 0x8080808080808080, 0x0101010101010101  # of 8 octets in a word
PLACES = 0x0001020304050607  # times the lowest bit of an octet: which octet it is, in the highest one


class Scores:
    """Scores of the pixels of an image, row after row, and work space. ``dark``: grey level below which a pixel is.

    ``plane``: uint8, of each pixel, or a bound of it; ``words``: the same memory, 8 pixels each; ``above``: int32,
    the pixels above a threshold; ``some``: int32, the words of a row that, or the next ones, have any; ``ring``: how
    much farther on each of the 16 lies. ``around``, ``least``, ``best``: of the pixels that are scored together those
    of the ring, uint8 (16, ``BLOCK``), and work space.
    """

    def __init__(self, width: int, height: int, dark: int) -> None:
        self.width, self.dark = width, dark
        words = np.zeros(width * height // 8 + 1, np.uint64)
        self.words, self.plane = memory_of(words), memory_of(words.view(np.uint8))
        self.above = integers(width * height)
        self.some = integers(width // 16 + 2)
        self.ring = memory_of(np.array(RING_PX) @ (1, width))
        self.around, self.least, self.best = octets(16, BLOCK), octets(16, BLOCK), octets(2, BLOCK)


def bound(scores: Scores, image: Column) -> None:
    """Give each pixel of an image, uint8, the most that its score can be.

    Each arc of 9 contains one of every two opposite pixels, so it cannot be brighter than the brighter of each pair.
    The last ``REACH_PX`` rows and columns have no meaning.
    """
    plane, down = scores.plane, scores.width
    for at in range(REACH_PX * down + REACH_PX, image.shape[0] - REACH_PX * down - REACH_PX):
        one, other = image[at - 3 * down], image[at + 3 * down]
        bright, dark = max(one, other), min(one, other)
        one, other = image[at - 3], image[at + 3]
        bright, dark = min(bright, max(one, other)), max(dark, min(one, other))
        one, other = image[at - 2 * down - 2], image[at + 2 * down + 2]
        bright, dark = min(bright, max(one, other)), max(dark, min(one, other))
        one, other = image[at - 2 * down + 2], image[at + 2 * down - 2]
        bright, dark = min(bright, max(one, other)), max(dark, min(one, other))
        grey = image[at]
        above, below = max(bright, grey) - grey, grey - min(dark, grey)  # in variables of 8 bits: 16 px at once
        plane[at] = max(above, below)


def find(
    scores: Scores, image: Column, threshold: int, on_dark: int, parts: Grid, pixel: Grid, strength: Column
) -> int:
    """Find the corners of parts of an image whose pixels have their ``bound``, part by part, row by row.

    ``on_dark``: at most ``threshold``, and enough for dark pixels. ``parts``: int32 (n, 4), left, top, right, bottom,
    px, the last two beyond it, at least ``REACH_PX`` inside. What lies outside of a part does not keep a pixel from
    being a corner. Written are ``pixel``, int32 (m, 2), x and y, and ``strength``, float32 (m,), the highest threshold
    with which it is a corner. Return how many there are.
    """
    found = 0
    for part in range(parts.shape[0]):
        left, top, right, bottom = parts[part, 0], parts[part, 1], parts[part, 2], parts[part, 3]
        least = threshold
        if on_dark < threshold and is_dark(scores, image, left, top, right, bottom):
            least = on_dark
        above = list_above(scores, least, left, top, right, bottom)
        start = corners = 0
        while start < above:
            corners = score_block(scores, image, least, start, min(start + BLOCK, above), corners)
            start += BLOCK
        y, row = top, top * scores.width
        for i in range(corners):
            at = scores.above[i]
            while at >= row + scores.width:
                y, row = y + 1, row + scores.width
            if scores.plane[at] <= threshold and image[at] >= scores.dark:
                continue
            if is_peak(scores, at - row, y, left, top, right, bottom):
                pixel[found, 0], pixel[found, 1] = at - row, y
                strength[found] = scores.plane[at] - 1
                found += 1
    return found


def is_dark(scores: Scores, image: Column, left: int, top: int, right: int, bottom: int) -> bool:
    """Whether any pixel of a part is dark."""
    for y in range(top, bottom):
        darkest = scores.dark
        for at in range(y * scores.width + left, y * scores.width + right):
            darkest = min(darkest, image[at])
        if darkest < scores.dark:
            return True
    return False


def list_above(scores: Scores, threshold: int, left: int, top: int, right: int, bottom: int) -> int:
    """List the pixels of a part that are above the threshold, or above 127, in ``above``. Return how many there are.

    Entries are written before it is known whether they stay: a branch that cannot be guessed would take longer.
    """
    count, add = 0, ONES * (127 - min(threshold, 127))
    for y in range(top, bottom):
        first, last = y * scores.width + left, y * scores.width + right
        hits = 0
        for w in range(first // 8, (last + 7) // 8, 2):
            word, next_word = scores.words[w], scores.words[w + 1]
            scores.some[hits] = w
            high = ((word & LOW_BITS) + add) | word | ((next_word & LOW_BITS) + add) | next_word
            hits += high & HIGH_BITS != 0  # one of the 16 is above min(threshold, 127)
        for k in range(hits):
            for w in range(scores.some[k], scores.some[k] + 2):
                word = scores.words[w]
                high = (((word & LOW_BITS) + add) | word) & HIGH_BITS
                while high:  # its highest bit is set in each octet that is above
                    lowest = high & -high
                    at = 8 * w + (((lowest >> 7) * PLACES >> 56) & 7)
                    scores.above[count] = at
                    count += (at >= first) & (at < last)
                    high ^= lowest
    return count


def score_block(scores: Scores, image: Column, threshold: int, start: int, end: int, corners: int) -> int:
    """Give the pixels from ``start`` to before ``end`` of ``above`` their scores.

    Those above the threshold move forward to ``corners``; return where the next ones go.
    """
    around, best, above, ring, count = scores.around, scores.best, scores.above, scores.ring, end - start
    for k in range(0, 16, 4):
        first, second, third, fourth = ring[k], ring[k + 1], ring[k + 2], ring[k + 3]
        for i in range(count):  # four at once: where they lie is read only once
            at = above[start + i]
            around[k, i], around[k + 1, i] = image[at + first], image[at + second]
            around[k + 2, i], around[k + 3, i] = image[at + third], image[at + fourth]
    brightest_arc(scores, count, 0)
    for k in range(16):
        for i in range(count):
            around[k, i] = 255 - around[k, i]
    brightest_arc(scores, count, 1)
    for i in range(count):
        at = above[start + i]
        grey = image[at]
        score = max(best[0, i] - grey, best[1, i] + grey - 255, 0)
        scores.plane[at] = score
        above[corners] = at
        corners += score > threshold
    return corners


def brightest_arc(scores: Scores, count: int, into: int) -> None:
    """The brightest arc's darkest pixel of each of ``count`` rings in ``around``, as a row of ``best``.

    Two arcs that begin one after the other share 8 pixels: the least of these, and the brighter one of both ends.
    """
    around, least, best = scores.around, scores.least, scores.best
    for i in range(count):
        best[into, i] = 0
    for k in range(0, 16, 2):
        for i in range(count):
            least[k, i] = min(around[k, i], around[k + 1, i])
    for k in range(0, 16, 2):
        for i in range(count):  # of 4
            least[k + 1, i] = min(least[k, i], least[(k + 2) % 16, i])
    for k in range(0, 16, 2):
        for i in range(count):
            eight = min(least[k + 1, i], least[(k + 5) % 16, i])
            ends = max(around[(k + 15) % 16, i], around[(k + 8) % 16, i])
            best[into, i] = max(best[into, i], min(eight, ends))


def is_peak(scores: Scores, x: int, y: int, left: int, top: int, right: int, bottom: int) -> bool:
    """Whether the score of a pixel of a part is above those of all 8 around that are in it."""
    at = y * scores.width + x
    score = scores.plane[at]
    if left < x < right - 1 and top < y < bottom - 1:  # true for nearly all
        above, below = at - scores.width, at + scores.width
        most = max(scores.plane[above - 1], scores.plane[above], scores.plane[above + 1], scores.plane[at - 1])
        most = max(scores.plane[below - 1], scores.plane[below], scores.plane[below + 1], scores.plane[at + 1], most)
        return bool(most < score)
    for v in range(max(y - 1, top), min(y + 2, bottom)):
        for u in range(max(x - 1, left), min(x + 2, right)):
            if scores.plane[v * scores.width + u] >= score and (u != x or v != y):
                return False
    return True
