"""The calibration board: how it is named, found in an image, and printed."""

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.calibrate.report import save_figure
from lcf_edge.errors import UsageError

Floats = npt.NDArray[np.float32]
Grey = npt.NDArray[np.uint8]

DEFAULT_BOARD = "checkerboard:9x6:25mm"
PRINT_SUFFIXES = (".png", ".pdf", ".svg")

_SPELLING = re.compile(
    r"(?P<kind>checkerboard|charuco):(?P<columns>\d{1,2})x(?P<rows>\d{1,2}):(?P<square>\d{1,3}(?:\.\d+)?)mm"
    r"(?::(?P<marker>\d{1,3}(?:\.\d+)?)mm)?(?::(?P<dictionary>[4-7]X[4-7]_(?:50|100|250|1000)))?"
)
_MIN_CORNERS = 8  # of a ChArUco board that is partly in the image
_MARKER_SHARE = 0.75  # of a square
_MM_PER_INCH = 25.4
_PIXELS_PER_SQUARE = 64  # eight for each bit of the usual markers
_PRINT_DPI = 300
_REFINE_PX = (2, 6)  # least and largest half window of the refinement
_REFINE_UNTIL = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 0.001)


@dataclass(frozen=True)
class Sighting:
    """A board in an image: corners, float32 (n, 2), px, their numbers (n,), and how sharp it is."""

    corners: Floats
    numbers: npt.NDArray[np.intp]
    edge_px: float  # from 10 to 90 % of an edge between two squares, median


@dataclass(frozen=True)
class Target:
    """A checkerboard by its inner corners, or a ChArUco board by its squares."""

    kind: Literal["checkerboard", "charuco"]
    columns: int
    rows: int
    square_m: float
    marker_m: float = 0.0
    dictionary: str = "4X4_250"

    @classmethod
    def parse(cls, text: str) -> "Target":
        """Parse ``checkerboard:9x6:25mm`` or ``charuco:8x6:30mm[:22mm[:5X5_100]]``. Raises ``UsageError``."""
        found = _SPELLING.fullmatch(text)
        if found is None:
            raise UsageError(
                f"--board {text}: write it as {DEFAULT_BOARD} (inner corners) or charuco:8x6:28mm (squares)"
            )
        columns, rows, square = int(found["columns"]), int(found["rows"]), float(found["square"]) / 1000
        marker = float(found["marker"]) / 1000 if found["marker"] else _MARKER_SHARE * square
        if min(columns, rows) < 3 or square <= 0:
            raise UsageError(f"--board {text}: a board has at least 3x3 and squares that are not empty")
        dictionary = found["dictionary"] or cls.dictionary
        if found["kind"] == "checkerboard":
            return cls("checkerboard", columns, rows, square)
        if not 0 < marker < square:
            raise UsageError(f"--board {text}: markers must be smaller than the squares")
        if not hasattr(cv2.aruco, f"DICT_{dictionary}") or columns * rows // 2 > int(dictionary.split("_")[1]):
            raise UsageError(f"--board {text}: the dictionary {dictionary} has no markers for so many squares")
        return cls("charuco", columns, rows, square, marker, dictionary)

    @property
    def name(self) -> str:
        """Name of the board, as ``parse`` reads it."""
        text = f"{self.kind}:{self.columns}x{self.rows}:{1000 * self.square_m:g}mm"
        return text + (f":{1000 * self.marker_m:g}mm:{self.dictionary}" if self.kind == "charuco" else "")

    @property
    def corner_columns(self) -> int:
        """Inner corners in a row."""
        return self.columns if self.kind == "checkerboard" else self.columns - 1

    @cached_property
    def places(self) -> Floats:
        """Return the places of all corners on the board, (n, 3), m."""
        count = self.columns * self.rows if self.kind == "checkerboard" else (self.columns - 1) * (self.rows - 1)
        row, column = np.divmod(np.arange(count), self.corner_columns)
        return (np.stack([column, row, np.zeros(count)], axis=1) * self.square_m).astype(np.float32)

    def find(self, image: Grey) -> Sighting | None:
        """Return the board found in an image (height, width); None: there is none."""
        corners, numbers = self._find_checkerboard(image) if self.kind == "checkerboard" else self._find_charuco(image)
        if len(corners) < min(_MIN_CORNERS, len(self.places)):
            return None
        return Sighting(corners, numbers, self._edge_px(image, corners, numbers))

    def draw(self, pixels_per_square: int) -> Grey:
        """Return an image of the board without margin."""
        if self.kind == "charuco":
            size = (self.columns * pixels_per_square, self.rows * pixels_per_square)
            return np.asarray(self._charuco.generateImage(size), np.uint8)
        dark = np.indices((self.rows + 1, self.columns + 1)).sum(axis=0) % 2 == 0
        squares = np.where(dark, 0, 255).repeat(pixels_per_square, axis=0).repeat(pixels_per_square, axis=1)
        return squares.astype(np.uint8)

    def print_to(self, path: Path) -> tuple[float, float]:
        """Write it in true size with a white margin of half a square. Return width and height in mm.

        Raises ``UsageError``, ``SinkError``.
        """
        from matplotlib.figure import Figure  # noqa: PLC0415

        drawn = self.draw(_PIXELS_PER_SQUARE)
        margin = (_PIXELS_PER_SQUARE // 2,) * 4
        image = cv2.copyMakeBorder(drawn, *margin, cv2.BORDER_CONSTANT, value=255)
        height_mm, width_mm = (1000 * self.square_m * side / _PIXELS_PER_SQUARE for side in image.shape[:2])
        figure = Figure(figsize=(width_mm / _MM_PER_INCH, height_mm / _MM_PER_INCH), dpi=_PRINT_DPI)
        axes = figure.add_axes((0, 0, 1, 1))
        axes.imshow(image, cmap="gray", vmin=0, vmax=255, interpolation="nearest", aspect="auto")
        axes.set_axis_off()
        axes.text(
            0.01, 0.01, f"{self.name}, print at 100 %", fontsize=7, color="0.4", transform=axes.transAxes, va="bottom"
        )
        save_figure(figure, path)
        return width_mm, height_mm

    @cached_property
    def _charuco(self) -> cv2.aruco.CharucoBoard:
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{self.dictionary}"))
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square_m, self.marker_m, dictionary)

    @cached_property
    def _detector(self) -> cv2.aruco.CharucoDetector:
        return cv2.aruco.CharucoDetector(self._charuco)

    def _find_checkerboard(self, image: Grey) -> tuple[Floats, npt.NDArray[np.intp]]:
        flags = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY
        found, corners = cv2.findChessboardCornersSB(image, (self.columns, self.rows), flags=flags)
        if not found:
            return np.empty((0, 2), np.float32), np.empty(0, np.intp)
        grid = corners.reshape(self.rows, self.columns, 2)
        side_px = min(float(np.hypot(*np.moveaxis(np.diff(grid, axis=axis), 2, 0)).min()) for axis in (0, 1))
        window = int(np.clip(side_px / 4, *_REFINE_PX))
        cv2.cornerSubPix(image, corners, (window, window), (-1, -1), _REFINE_UNTIL)  # halves the noise of the search
        return np.asarray(corners, np.float32).reshape(-1, 2), np.arange(len(self.places))

    def _find_charuco(self, image: Grey) -> tuple[Floats, npt.NDArray[np.intp]]:
        corners, numbers, _, _ = self._detector.detectBoard(image)
        found = np.asarray(numbers)  # an array of None where there is no board
        if found.ndim == 0:
            return np.empty((0, 2), np.float32), np.empty(0, np.intp)
        return np.asarray(corners, np.float32).reshape(-1, 2), found.reshape(-1).astype(np.intp)

    def _edge_px(self, image: Grey, corners: Floats, numbers: npt.NDArray[np.intp]) -> float:
        """Median width of the edges between neighbouring corners of a row, across their middles."""
        at = {int(number): corner for number, corner in zip(numbers, corners, strict=True)}
        pairs = [
            (at[number], at[number + 1])
            for number in at
            if number + 1 in at and (number + 1) % self.corner_columns != 0
        ]
        if not pairs:
            return 0.0
        ends = np.array(pairs)
        middle, along = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
        length = np.hypot(*along.T)
        across = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
        # ChArUco markers begin an eighth of a square from the edge.
        offsets = np.linspace(-1, 1, 81) * np.median(length) * (0.4 if self.kind == "checkerboard" else 0.11)
        points = (middle[:, None] + across[:, None] * offsets[:, None]).astype(np.float32)
        profile = cv2.remap(image, points[..., 0], points[..., 1], cv2.INTER_LINEAR).astype(np.float64)
        profile *= np.where(profile[:, -1] < profile[:, 0], -1, 1)[:, None]
        low, high = profile.min(axis=1, keepdims=True), profile.max(axis=1, keepdims=True)
        share = (profile - low) / np.maximum(high - low, 1)
        between = ((share > 0.1) & (share < 0.9)).sum(axis=1)
        return float(np.median(between) * (offsets[1] - offsets[0]))
