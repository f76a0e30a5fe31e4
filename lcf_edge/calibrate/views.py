"""Which images of a board are worth keeping, and where it should be held next."""

from collections import Counter
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from drivers.samples import Frame
from lcf_edge.calibrate.target import Sighting, Target

Floats = npt.NDArray[np.float64]

CELLS = (8, 6)  # across and down, of the coverage

_MAX_EDGE_PX = 5.0
_MAX_MOTION_PX = 1.0  # between two images of a film
_MAX_INTERVAL_S = 1.0  # a small computer takes nearly that long to find a board
_MIN_CORNER_SHIFT = 0.08  # of the image's width: least shift of the board's corners from any other view
_MIN_CORNER_SHIFT_OF_IMAGES = 0.01  # the same among single images, which the user chose
_SIDES = (("upper", "middle", "lower"), ("left", "middle", "right"))
_TILTED = 1.12  # least ratio of opposite sides of a tilted board
_MIN_TILTED = 0.5  # least share of the views


@dataclass
class Views:
    """Sightings of a board in images of one size; ``left_out`` counts the others by reason.

    ``film``: images follow each other closely, so that a board in motion is seen to move.
    """

    board: Target
    film: bool
    kept: list[Sighting] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    size: tuple[int, int] = (0, 0)  # width and height, px
    _outlines: list[Floats] = field(default_factory=list)
    _before: tuple[int, Sighting] | None = None

    def consider(self, frame: Frame) -> str:
        """Keep the view of ``frame`` and return "", or return the reason why it is not kept."""
        self.size = frame.image.shape[1], frame.image.shape[0]
        sighting = self.board.find(frame.image)
        before, self._before = self._before, None if sighting is None else (frame.stamp_ns, sighting)
        reason = "no board" if sighting is None else self._flaw(sighting, before, frame.stamp_ns)
        if reason:
            self.left_out[reason] += 1
        return reason

    def _flaw(self, sighting: Sighting, before: tuple[int, Sighting] | None, stamp_ns: int) -> str:
        if sighting.edge_px > _MAX_EDGE_PX:
            return "blurred"
        if self.film and not _stands(sighting, before, stamp_ns):
            return "moving"
        outline = self._outline(sighting)
        if outline is None:
            return "too few corners"
        news = min((np.hypot(*(outline - other).T).mean() for other in self._outlines), default=np.inf)
        if news < (_MIN_CORNER_SHIFT if self.film else _MIN_CORNER_SHIFT_OF_IMAGES) * self.size[0]:
            return "seen like this before"
        self.kept.append(sighting)
        self._outlines.append(outline)
        return ""

    def covered(self) -> npt.NDArray[np.bool_]:
        """Return, (rows, columns), the cells of the image in which a corner was seen."""
        sighting = np.zeros(CELLS[::-1], np.bool_)
        for view in self.kept:
            column, row = (np.clip(view.corners / self.size, 0, 0.999) * CELLS).astype(int).T
            sighting[row, column] = True
        return sighting

    def wish(self) -> str:
        """Return a prompt for the next view."""
        tilted = sum(_foreshortening(outline) > _TILTED for outline in self._outlines)
        if len(self.kept) >= 4 and tilted < _MIN_TILTED * len(self.kept):
            return "tilt it, by 30 to 45°, another way than before"
        views_in = np.zeros((3, 3), int)
        for view in self.kept:
            column, row = np.clip(view.corners.mean(axis=0) / self.size * 3, 0, 2.999).astype(int)
            views_in[row, column] += 1
        views_in[1, 1] += 1  # the middle needs no prompt
        row, column = np.unravel_index(np.argmin(views_in), views_in.shape)
        where = f"{_SIDES[0][row]} {_SIDES[1][column]}".replace("middle middle", "middle")
        return f"hold it in the {where} of the image, so near that it fills a third of it"

    def _outline(self, sighting: Sighting) -> Floats | None:
        """Return where the board's outer corners are, or would be, (4, 2) px; None: too few corners are seen."""
        places = self.board.places[:, :2]
        homography = np.asarray(cv2.findHomography(places[sighting.numbers], sighting.corners)[0])
        if homography.shape != (3, 3):
            return None
        (left, top), (right, bottom) = places.min(axis=0), places.max(axis=0)
        outer = np.array([[[left, top], [right, top], [right, bottom], [left, bottom]]], np.float64)
        outline = np.asarray(cv2.perspectiveTransform(outer, homography)[0], np.float64)
        return outline if np.abs(outline).max() < 10 * max(self.size) else None


def _stands(sighting: Sighting, before: tuple[int, Sighting] | None, stamp_ns: int) -> bool:
    """Whether the corners are where they were in the previous image."""
    if before is None or stamp_ns - before[0] > _MAX_INTERVAL_S * 1e9:
        return False
    _, now, then = np.intersect1d(sighting.numbers, before[1].numbers, return_indices=True)
    moved = sighting.corners[now] - before[1].corners[then]
    return bool(len(moved)) and float(np.median(np.hypot(*moved.T))) < _MAX_MOTION_PX


def _foreshortening(outline: Floats) -> float:
    """Return the largest ratio of opposite sides, the longer by the shorter."""
    sides = np.hypot(*(np.roll(outline, -1, axis=0) - outline).T)
    ratio = np.maximum(sides[:2], sides[2:]) / np.maximum(np.minimum(sides[:2], sides[2:]), 1e-6)
    return float(ratio.max())
