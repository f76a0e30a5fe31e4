"""Whether an image repeats the one before, as slow cameras and recorders at a fixed rate deliver them."""

import numpy as np
import numpy.typing as npt

from lcf_edge.corners.image_sums import compare

STEP_PX = 4  # of what ``compare`` takes, along rows and columns
MAX_CHANGE = 0.25  # mean grey levels; coding noise in a copy is less, camera noise more
MAX_SHARE = 0.05  # of the usual change
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
        same = change < min(MAX_CHANGE, MAX_SHARE * self._usual)
        if same and 0 <= stamp_ns - self._last_ns <= MAX_REPEAT_S * 1e9:
            return True
        self._usual = change if same else self._usual + MEMORY * (change - self._usual)
        self._take(stamp_ns)
        return False

    def _take(self, stamp_ns: int) -> None:
        self._last, self._samples, self._last_ns = self._samples, self._last, stamp_ns
