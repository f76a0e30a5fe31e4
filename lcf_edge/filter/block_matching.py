"""Block matching: pieces of the downscaled image, compared with those of an earlier one.

Pixels are stored repacked, so that those of a piece are contiguous: for each column the ``WINDOW`` px to the right of
it, row by row.
"""

import numpy as np

from lcf_edge.filter import rounding
from lcf_edge.filter.inputs import KEYS
from lcf_edge.filter.memory import Bytes, Words, integers, memory_of, octets

WINDOW = 8  # side of a piece, px of the downscaled image ("small px")
PIXELS = 64  # of a piece, 2**6
STEP = 4  # small px from piece to piece
LIGHTER = 7  # the light on a piece may change by one part in so many
NO_WORLD = 100_000  # grey levels, more than the texture of a piece


class Blocks:
    """The downscaled image, ``width`` by ``height``, and earlier ones. ``count``: images so far, at most 2.

    Pixels, row-major: ``now``; ``kept``, of the key frames one after the other, ``keys`` of them so far; ``hidden``, 0
    where the world is seen. Repacked: ``pieces``, ``pieces_last``, of this image and the last one, and ``then``, of the
    image that is searched; ``words``, ``words_last``, ``words_then``: the same memory, one row of a piece in each word.

    ``columns`` by ``rows`` pieces: ``rough``, texture of each. ``block``: texture of each ``STEP`` by ``STEP`` px.
    """

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.columns, self.rows = max((width - WINDOW) // STEP + 1, 0), max((height - WINDOW) // STEP + 1, 0)
        self.now, self.kept = octets(width * height), octets(KEYS * width * height)
        self.hidden = octets(width * height)
        words = np.zeros((3, max(width - WINDOW + 1, 0) * height), np.uint64)
        self.words, self.words_last, self.words_then = memory_of(words[0]), memory_of(words[1]), memory_of(words[2])
        self.pieces, self.then = memory_of(words[0].view(np.uint8)), memory_of(words[2].view(np.uint8))
        self.rough, self.block = integers(self.columns * self.rows), integers((self.columns + 1) * (self.rows + 1))
        self.count = self.keys = 0


def take(blocks: Blocks, small: Bytes) -> None:
    """Take the next downscaled image, row-major."""
    now, pixels = blocks.now, blocks.width * blocks.height
    for k in range(pixels):
        now[k] = small[k]
    for k in range(blocks.words.shape[0]):
        blocks.words_last[k] = blocks.words[k]
    lay_out(blocks, blocks.now, 0, blocks.words)
    blocks.count = min(blocks.count + 1, 2)


def has_image(blocks: Blocks) -> bool:
    """Whether an image was taken."""
    return blocks.count > 0


def grey(blocks: Blocks, x: float, y: float) -> int:
    """Returns the grey of this image, small px."""
    column, row = min(rounding.whole(x), blocks.width - 1), min(rounding.whole(y), blocks.height - 1)
    return blocks.now[row * blocks.width + column]


def hide(blocks: Blocks, hidden: Bytes) -> None:
    """Set where no world is seen: 1, else 0; row-major."""
    for k in range(blocks.width * blocks.height):
        blocks.hidden[k] = hidden[k]


def lay_out(blocks: Blocks, picture: Bytes, first: int, words: Words) -> None:
    """Repack an image that begins at ``first``."""
    for y in range(blocks.height):
        word = 0
        for x in range(blocks.width):
            grey = picture[first + y * blocks.width + x]
            word = word >> 8 | grey << 56
            if x >= WINDOW - 1:
                words[(x - WINDOW + 1) * blocks.height + y] = word


def keep(blocks: Blocks, slot: int) -> None:
    """Store this image as that of the key frame in ``slot``."""
    blocks.keys = min(blocks.keys + 1, KEYS)
    now, kept, pixels = blocks.now, blocks.kept, blocks.width * blocks.height
    first = slot * pixels
    for k in range(pixels):
        kept[first + k] = now[k]


def look_back(blocks: Blocks) -> None:
    """Search in the last image."""
    for k in range(blocks.words.shape[0]):
        blocks.words_then[k] = blocks.words_last[k]


def look_farther_back(blocks: Blocks, slot: int) -> None:
    """Search in the image of the key frame in ``slot``."""
    lay_out(blocks, blocks.kept, slot * blocks.width * blocks.height, blocks.words_then)


def roughen(blocks: Blocks) -> None:
    """Measure the texture of each piece: the sum of absolute differences of neighbouring pixels.

    It is negative where a part of the piece is hidden.
    """
    across = blocks.columns + 1
    for b in range(across * (blocks.rows + 1)):
        total = 0
        for row in range(STEP):
            here = (STEP * (b // across) + row) * blocks.width + STEP * (b % across)
            below = here + blocks.width if here + blocks.width + STEP <= blocks.width * blocks.height else here
            for k in range(STEP - 1):
                total += abs(blocks.now[here + k] - blocks.now[here + k + 1])
            for k in range(STEP):
                total += abs(blocks.now[here + k] - blocks.now[below + k])
                total -= NO_WORLD * blocks.hidden[here + k]
        blocks.block[b] = total
    for k in range(blocks.columns * blocks.rows):
        b = k // blocks.columns * across + k % blocks.columns
        blocks.rough[k] = blocks.block[b] + blocks.block[b + 1]
        blocks.rough[k] += blocks.block[b + across] + blocks.block[b + across + 1]


def difference(blocks: Blocks, here: int, x: int, y: int, most: int) -> int:
    """Sum of absolute differences between the piece that begins at ``here`` in ``pieces`` and that at (x, y) then.

    Above ``most`` outside the image.
    """
    if x < 0 or x > blocks.width - WINDOW or y < 0 or y > blocks.height - WINDOW:
        return most + 1
    total, there = 0, WINDOW * (x * blocks.height + y)
    for k in range(PIXELS):
        total += abs(blocks.pieces[here + k] - blocks.then[there + k])
    return total


def shape_difference(blocks: Blocks, here: int, x: int, y: int, most: int) -> int:
    """The same in the light of then: less what lamps, exposure or vignetting made of the mean since."""
    if x < 0 or x > blocks.width - WINDOW or y < 0 or y > blocks.height - WINDOW:
        return most + 1
    total, now, before, there = 0, 0, 0, WINDOW * (x * blocks.height + y)
    for k in range(PIXELS):
        now += blocks.pieces[here + k]
        before += blocks.then[there + k]
    light = before // (LIGHTER * PIXELS)
    light = min(max((now - before + PIXELS // 2) >> 6, -light), light)
    for k in range(PIXELS):
        total += abs(blocks.pieces[here + k] - blocks.then[there + k] - light)
    return total
