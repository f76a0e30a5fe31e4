"""Whether the image stands still: corners are where they were half a second ago. No clock, no I/O."""

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[np.int32]

_APART_S = 0.5
_MIN_CORNERS = 40  # fewer do not decide
_NEAR_PX = 1  # motors shake corners by as much
_CELL_PX = 2
_SHARE = 0.7  # of the corners; others flicker, or are on moving things


class Stillness:
    """For images of one size. Keeps where corners were, half a second to a second ago, in cells of 2 px."""

    def __init__(self, width: int, height: int) -> None:
        self._shape = (height + 2 * _NEAR_PX) // _CELL_PX + 1, (width + 2 * _NEAR_PX) // _CELL_PX + 1
        self._marks: list[tuple[int, npt.NDArray[np.bool_]]] = []  # when, and which cells are near a corner

    def look(self, stamp_ns: int, pixel: Pixels) -> bool | None:
        """Take the corners of a frame, (n, 2) px. Return whether they stand still, None: undecided."""
        if len(pixel) < _MIN_CORNERS or (self._marks and stamp_ns < self._marks[-1][0]):
            self._marks.clear()
            return None
        x, y = np.ascontiguousarray(pixel.T) + _NEAR_PX
        if not self._marks or stamp_ns - self._marks[-1][0] >= _APART_S * 1e9:
            near = np.zeros(self._shape, np.bool_)
            for down in (-_NEAR_PX, 0, _NEAR_PX):
                for right in (-_NEAR_PX, 0, _NEAR_PX):
                    near[(y + down) // _CELL_PX, (x + right) // _CELL_PX] = True
            self._marks = [*self._marks[-1:], (stamp_ns, near)]
        then_ns, near = self._marks[0]
        if stamp_ns - then_ns < _APART_S * 1e9:
            return None
        return bool(np.count_nonzero(near[y // _CELL_PX, x // _CELL_PX]) >= _SHARE * len(pixel))
