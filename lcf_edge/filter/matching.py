"""Corners and predicted edges find each other: by place through cells, by appearance, one to one."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.filter.inputs import APPEARANCE_SAMPLES, Corners
from lcf_edge.filter.tables import Floats, Mask, Rows
from lcf_edge.lens import Lens

CELL_SHIFT = 3  # cells of 8x8 px hold a corner or two
DISTANCE_COST = 0.4  # grey levels a px, so that of equal looks the nearest wins
LIKENESS_FLOOR = 3.0  # grey levels of camera noise
_ROUNDS = 2

Pairs = tuple[Rows, Rows]
Indices = npt.NDArray[np.signedinteger[Any]]


class CornerIndex:
    """Corners sorted by cell, row after row: those near a place are a few runs of neighbours in that order.

    What a look-up costs follows from the corners that it finds, not from the size of the gate or of the picture.
    """

    def __init__(self, width: int, height: int) -> None:
        self._columns = (width >> CELL_SHIFT) + 1
        self._rows = (height >> CELL_SHIFT) + 1
        self._start = np.zeros(self._columns * self._rows + 1, np.intp)  # of each cell's run
        self._order = np.empty(0, np.intp)

    @property
    def nbytes(self) -> int:
        """Bytes that the index occupies, for good."""
        return self._start.nbytes

    def fill(self, pixel: npt.NDArray[np.int32]) -> None:
        """Enter the corners of a frame; ``pixel``: int32 (n, 2), inside it."""
        cell = (pixel[:, 1] >> CELL_SHIFT) * self._columns + (pixel[:, 0] >> CELL_SHIFT)
        self._order = np.argsort(cell, kind="stable")
        np.cumsum(np.bincount(cell, minlength=len(self._start) - 1), out=self._start[1:])

    def candidates(self, x: Floats, y: Floats, gate: Floats | np.float32) -> Pairs:
        """All (place, corner) pairs whose cells meet the square of half side ``gate`` around each place.

        ``x``, ``y``: float32 (n,) px of the input frame, inside it. ``gate``: px, float32 (n,) or one for all.
        """
        left = np.maximum(x - gate, 0).astype(np.int32) >> CELL_SHIFT
        right = np.minimum((x + gate).astype(np.int32) >> CELL_SHIFT, self._columns - 1)
        top = np.maximum(y - gate, 0).astype(np.int32) >> CELL_SHIFT
        bottom = np.minimum((y + gate).astype(np.int32) >> CELL_SHIFT, self._rows - 1)
        who, row = _runs(top, bottom + 1 - top)
        base = row * self._columns
        first = self._start.take(base + left.take(who))
        which, place = _runs(first, self._start.take(base + right.take(who) + 1) - first)
        return who.take(which), self._order.take(place)


def _runs(first: Indices, length: Indices) -> tuple[Indices, Indices]:
    """All numbers of the runs first, first + 1, … of each ``length``, and the run that each belongs to."""
    run = np.arange(len(length)).repeat(length)
    offset = first - length.cumsum() + length
    return run, offset.take(run) + np.arange(len(run))


def difference(one: npt.NDArray[np.uint8], other: npt.NDArray[np.uint8]) -> Floats:
    """Mean absolute grey difference of appearances; uint8 (n, 16) each, float32 (n,)."""
    if not len(one):
        return np.empty(0, np.float32)
    total = cv2.reduce(cv2.absdiff(one, other), 1, cv2.REDUCE_SUM, dtype=cv2.CV_32F)
    return np.asarray(total, np.float32)[:, 0] / APPEARANCE_SAMPLES


def likeness_needed(appearance: npt.NDArray[np.uint8], most: float, share: float) -> Floats:
    """Largest difference at which an appearance still counts as the same: a share of its own contrast.

    ``appearance``: uint8 (n, 16), mean at 128. A faint corner must look more alike than a strong one, else it is taken
    for its neighbours. Answers float32 (n,), at most ``most`` grey levels.
    """
    if not len(appearance):
        return np.empty(0, np.float32)
    contrast = cv2.reduce(cv2.absdiff(appearance, np.full_like(appearance, 128)), 1, cv2.REDUCE_SUM, dtype=cv2.CV_32F)[
        :, 0
    ]
    wanted = np.float32(LIKENESS_FLOOR) + np.float32(share / APPEARANCE_SAMPLES) * contrast
    return np.asarray(np.minimum(wanted, np.float32(most)))


def one_to_one(edge: Rows, corner: Rows, cost: Floats, edges: int, corners: int) -> Rows:
    """Pairs that choose each other, cheapest first; answers positions in the list of pairs.

    Rounds of mutual best choice: the pairs that are each other's cheapest are taken, then what is left chooses again.
    """
    taken: list[Rows] = []
    left = cost.argsort(kind="stable")
    best_of_edge = np.empty(edges, np.intp)
    best_of_corner = np.empty(corners, np.intp)
    used_edge = np.zeros(edges, np.bool_)
    used_corner = np.zeros(corners, np.bool_)
    for _ in range(_ROUNDS):
        if not len(left):
            break
        e, c = edge.take(left), corner.take(left)
        backwards = left[::-1]  # the cheapest is written last and stays
        best_of_edge[e[::-1]] = backwards
        best_of_corner[c[::-1]] = backwards
        mutual = ((best_of_edge.take(e) == left) & (best_of_corner.take(c) == left)).nonzero()[0]
        taken.append(left.take(mutual))
        used_edge[e.take(mutual)] = True
        used_corner[c.take(mutual)] = True
        left = left[~(used_edge.take(e) | used_corner.take(c))]
    return np.concatenate(taken) if taken else np.empty(0, np.intp)


@dataclass(frozen=True, slots=True)
class Found:
    """Pairs of an edge and its corner, one to one; int (pairs,) rows of each table."""

    edge: Rows
    corner: Rows


class Matcher:
    """Finds the corners of predicted edges. Places are px of the ideal pinhole, the look-up is in the input frame."""

    def __init__(self, lens: Lens) -> None:
        self._lens = lens
        self._index = CornerIndex(lens.width, lens.height)
        self._x = self._y = np.empty(0, np.float32)  # of the frame's corners, px of the input frame

    @property
    def nbytes(self) -> int:
        """Bytes that the index occupies, for good."""
        return self._index.nbytes

    def fill(self, pixel: npt.NDArray[np.int32]) -> None:
        """Take the corners of a frame; int32 (n, 2)."""
        self._index.fill(pixel)
        self._x, self._y = np.ascontiguousarray(pixel.T).astype(np.float32)

    def in_frame(self, x: Floats, y: Floats) -> Mask:
        """Whether positions of the ideal pinhole lie in the picture; bool (n,)."""
        return self._in_picture(*self._lens.distort_xy(x, y))

    def _in_picture(self, x: Floats, y: Floats) -> Mask:
        return np.asarray((x >= 0) & (y >= 0) & (x <= self._lens.width - 1) & (y <= self._lens.height - 1))

    def pair(
        self,
        x: Floats,
        y: Floats,
        looks: npt.NDArray[np.uint8],
        gate: Floats,
        likely: Floats,
        wanted: Mask,
        corners: Corners,
        free: Mask,
    ) -> Found:
        """One-to-one pairs of the ``wanted`` edges, looked for at (x, y), and the ``free`` corners of the frame.

        ``x``, ``y``, ``gate``: float32 (n,) px. ``looks``: uint8 (n, 16). ``likely``: float32 (n,), see
        ``likeness_needed``. ``wanted``: bool (n,); ``free``: bool (corners,).
        """
        raw_x, raw_y = self._lens.distort_xy(x, y)
        rows = (wanted & self._in_picture(raw_x, raw_y)).nonzero()[0]
        raw_x, raw_y, gate = raw_x.take(rows), raw_y.take(rows), gate.take(rows)
        who, what = self._index.candidates(raw_x, raw_y, gate)
        dx, dy = self._x.take(what), self._y.take(what)
        dx -= raw_x.take(who)
        dy -= raw_y.take(who)
        away2 = dx * dx + dy * dy
        near = ((away2 <= (gate * gate).take(who)) & free.take(what)).nonzero()[0]
        edge, what = rows.take(who.take(near)), what.take(near)
        unlike = difference(looks.take(edge, axis=0), corners.appearance.take(what, axis=0))
        good = (unlike < likely.take(edge)).nonzero()[0]
        edge, what = edge.take(good), what.take(good)
        cost = unlike.take(good) + np.float32(DISTANCE_COST) * np.sqrt(away2.take(near.take(good)))
        best = one_to_one(edge, what, cost, len(x), len(free))
        return Found(edge.take(best), what.take(best))

    def coincide(self, x: Floats, y: Floats, corners: Rows, reach_px: float) -> tuple[Mask, Mask]:
        """Which places have a corner within ``reach_px``, and which corners a place, whatever they look like.

        ``x``, ``y``: (n,) px; ``corners``: rows of the frame's, (m,). Answers bool (n,) and bool (m,).
        """
        raw_x, raw_y = self._lens.distort_xy(x, y)
        inside = self._in_picture(raw_x, raw_y).nonzero()[0]
        raw_x, raw_y = raw_x.take(inside), raw_y.take(inside)
        who, what = self._index.candidates(raw_x, raw_y, np.float32(reach_px))
        wanted = np.zeros(len(self._x), np.bool_)
        wanted[corners] = True
        near = (np.abs(raw_x.take(who) - self._x.take(what)) <= reach_px) & wanted.take(what)
        near &= np.abs(raw_y.take(who) - self._y.take(what)) <= reach_px
        place, corner = np.zeros(len(x), np.bool_), np.zeros(len(self._x), np.bool_)
        place[inside.take(who[near])] = True
        corner[what[near]] = True
        return place, corner.take(corners)
