"""Text as a mask, in one size, put together from an image of the letters.

OpenCV 5 could draw text too, but its fonts take 8 MiB of memory. ``letters.png`` holds printable ASCII as OpenCV
draws it: a white dot in the first row begins each letter, which reaches ``_OVERLAP_PX`` into its neighbours. The sign ±
is composed of them, and so is the zero, whose stroke in OpenCV's font makes it look like Ø.
"""

from functools import cache
from importlib.resources import files

import cv2
import numpy as np
import numpy.typing as npt

Mask = npt.NDArray[np.uint8]
"""(height, width), 255 where ink is."""

LETTERS = [chr(code) for code in range(32, 127)]
HEIGHT_PX = 15

_OVERLAP_PX = 2
_BAR_ROW, _UNDER_ROW = 7, 11  # of the plus, and where ± has a second one
_UNKNOWN = "?"


def lettering(text: str) -> Mask:
    """The text on one line, ``HEIGHT_PX`` high; what is neither printable ASCII nor ± becomes a question mark."""
    cells = [_cells().get(letter, _cells()[_UNKNOWN]) for letter in text]
    widths = [cell.shape[1] - _OVERLAP_PX for cell in cells]
    line = np.zeros((HEIGHT_PX, sum(widths) + _OVERLAP_PX), np.uint8)
    left = 0
    for cell, width in zip(cells, widths, strict=True):
        place = line[:, left : left + width + _OVERLAP_PX]
        np.maximum(place, cell, out=place)
        left += width
    return line


@cache
def _cells() -> dict[str, Mask]:
    packed = np.frombuffer((files("lcf_edge.sinks") / "letters.png").read_bytes(), np.uint8)
    image = np.asarray(cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE), np.uint8)
    starts = np.flatnonzero(image[0])
    cells: dict[str, Mask] = dict(zip(LETTERS, np.split(image[1:], starts[1:], axis=1), strict=True))
    height, width = cells["0"].shape
    narrow = np.asarray(cv2.resize(cells["O"], (width - 1, height), interpolation=cv2.INTER_AREA), np.uint8)
    cells["0"] = np.pad(narrow, ((0, 0), (0, 1)))
    plus = cells["+"]
    cells["±"] = np.roll(plus, -1, axis=0)
    cells["±"][_UNDER_ROW] = plus[_BAR_ROW]
    return cells
