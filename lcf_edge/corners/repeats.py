"""Whether an image repeats the one before, as slow cameras and recorders at a fixed rate deliver them."""

import numpy as np
import numpy.typing as npt

from lcf_edge.corners.image_sums import compare

STEP_PX = 4  # of what ``compare`` takes, along rows and columns
MAX_CHANGE = 0.25  # mean grey levels; coding noise in a copy is less, camera noise more
MAX_SHARE = 0.05  # of the usual change
NOISY_SHARE = 0.45  # the same of copies with noise of their own, from a source that is known to make copies:
KNOWN_COPIES = 3.0  # so many have come between images that differ,
FORGET = 0.02  # each image makes it fewer by this share
MEMORY = 0.2  # share by which each new image changes the usual change
MAX_REPEAT_S = 0.25  # an image that stays longer shows a still scene

Grey = npt.NDArray[np.uint8]


class Repeats:
    """Follows the images of one camera. Keeps samples of the last new one."""

    def __init__(self) -> None:
        self._shape = 0, 0
        self._last = self._samples = np.empty(0, np.uint8)
        self._last_ns = 0
        self._usual = 0.0  # mean change from one new image to the next, grey levels
        self._copies = 0.0  # that have come lately
        self._is_alike = False  # whether the last image was like the new one before it
        self._changed_ns = 0  # since when there is no other

    def is_repeat(self, stamp_ns: int, image: Grey) -> bool:
        """Take an image, uint8 (height, width). Return whether it shows nothing since the last new one.

        Only while images change: if a camera without noise sees a still scene, all images are new.
        """
        height, width = image.shape
        first = self._shape != image.shape
        if first:
            self._shape = height, width
            self._last, self._samples = np.zeros((2, -(-height // STEP_PX) * -(-width // STEP_PX)), np.uint8)
        pixels = np.ascontiguousarray(image).reshape(-1)
        change = compare(pixels.data, width, height, self._samples.data, self._last.data) / self._samples.size
        if first:
            self._take(stamp_ns)
            return False
        is_alike = change < NOISY_SHARE * self._usual
        self._count_copies(stamp_ns, is_alike)
        same = change < min(MAX_CHANGE, MAX_SHARE * self._usual) or (is_alike and self._copies >= KNOWN_COPIES)
        if same and _is_soon(stamp_ns, self._last_ns):
            return True
        if not is_alike or not _is_soon(stamp_ns, self._changed_ns):
            self._usual = change if same else self._usual + MEMORY * (change - self._usual)
        self._take(stamp_ns)
        return False

    def _count_copies(self, stamp_ns: int, is_alike: bool) -> None:
        """Images that change little only for a moment, between others, are copies; at rest all change little."""
        self._copies *= 1 - FORGET
        if not is_alike:
            self._copies += self._is_alike and _is_soon(stamp_ns, self._changed_ns)
            self._changed_ns = stamp_ns
        self._is_alike = is_alike

    def _take(self, stamp_ns: int) -> None:
        self._last, self._samples, self._last_ns = self._samples, self._last, stamp_ns


def _is_soon(stamp_ns: int, before_ns: int) -> bool:
    return 0 <= stamp_ns - before_ns <= MAX_REPEAT_S * 1e9
