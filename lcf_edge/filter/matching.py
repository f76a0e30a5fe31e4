"""Corners and predicted edges find each other: by place through cells, by appearance, one to one."""

from dataclasses import dataclass

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
Indices = npt.NDArray[np.intp]


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
        left = np.maximum(x - gate, 0).astype(np.intp) >> CELL_SHIFT
        right = np.minimum((x + gate).astype(np.intp) >> CELL_SHIFT, self._columns - 1)
        top = np.maximum(y - gate, 0).astype(np.intp) >> CELL_SHIFT
        bottom = np.minimum((y + gate).astype(np.intp) >> CELL_SHIFT, self._rows - 1)
        who, row = _runs(top, bottom + 1 - top)
        base = row * self._columns
        first = self._start[base + left[who]]
        which, place = _runs(first, self._start[base + right[who] + 1] - first)
        return who[which], self._order[place]


def _runs(first: Indices, length: Indices) -> tuple[Indices, Indices]:
    """All numbers of the runs first, first + 1, … of each ``length``, and the run that each belongs to."""
    run = np.repeat(np.arange(len(length)), length)
    offset = first - np.cumsum(length) + length
    return run, offset[run] + np.arange(len(run))


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
    flat = np.full_like(appearance, 128)
    wanted = np.float32(LIKENESS_FLOOR) + np.float32(share) * difference(appearance, flat)
    return np.asarray(np.minimum(wanted, np.float32(most)))


def one_to_one(edge: Rows, corner: Rows, cost: Floats, edges: int, corners: int) -> Rows:
    """Pairs that choose each other, cheapest first; answers positions in the list of pairs.

    Rounds of mutual best choice: the pairs that are each other's cheapest are taken, then what is left chooses again.
    """
    taken: list[Rows] = []
    left = np.argsort(cost, kind="stable")
    best_of_edge = np.empty(edges, np.intp)
    best_of_corner = np.empty(corners, np.intp)
    for _ in range(_ROUNDS):
        if not len(left):
            break
        e, c = edge[left], corner[left]
        backwards = left[::-1]  # the cheapest is written last and stays
        best_of_edge[e[::-1]] = backwards
        best_of_corner[c[::-1]] = backwards
        mutual = (best_of_edge[e] == left) & (best_of_corner[c] == left)
        chosen = left[mutual]
        taken.append(chosen)
        free_edge = np.ones(edges, np.bool_)
        free_corner = np.ones(corners, np.bool_)
        free_edge[edge[chosen]] = False
        free_corner[corner[chosen]] = False
        left = left[free_edge[e] & free_corner[c]]
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

    @property
    def nbytes(self) -> int:
        """Bytes that the index occupies, for good."""
        return self._index.nbytes

    def in_frame(self, x: Floats, y: Floats) -> Mask:
        """Whether positions of the ideal pinhole lie in the picture; bool (n,)."""
        return self._in_picture(self._lens.distort(np.stack([x, y], axis=1)))

    def _in_picture(self, raw: Floats) -> Mask:
        x, y = raw[:, 0], raw[:, 1]
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
        among: Rows,
    ) -> Found:
        """One-to-one pairs of the ``wanted`` edges, looked for at (x, y), and the corners ``among`` those of a frame.

        ``x``, ``y``, ``gate``: float32 (n,) px. ``looks``: uint8 (n, 16). ``likely``: float32 (n,), see
        ``likeness_needed``.
        """
        pixel = corners.pixel[among]
        self._index.fill(pixel)
        raw = self._lens.distort(np.stack([x, y], axis=1))
        rows = np.flatnonzero(wanted & self._in_picture(raw))
        who, what = self._index.candidates(raw[rows, 0], raw[rows, 1], gate[rows])
        edge = rows[who]
        off = raw[edge] - pixel[what]
        away = np.hypot(off[:, 0], off[:, 1])
        near = np.flatnonzero(away <= gate[edge])
        edge, what, away = edge[near], what[near], away[near]
        unlike = difference(looks[edge], corners.appearance[among[what]])
        good = np.flatnonzero(unlike < likely[edge])
        edge, what = edge[good], what[good]
        cost = unlike[good] + np.float32(DISTANCE_COST) * away[good]
        best = one_to_one(edge, what, cost, len(x), len(pixel))
        return Found(edge[best], among[what[best]])

    def coincide(self, x: Floats, y: Floats, pixel: npt.NDArray[np.int32], reach_px: float) -> tuple[Mask, Mask]:
        """Which places have a corner within ``reach_px``, and which corners a place, whatever they look like.

        ``x``, ``y``: (n,) px; ``pixel``: (m, 2). Answers bool (n,) and bool (m,).
        """
        raw = self._lens.distort(np.stack([x, y], axis=1))
        inside = np.flatnonzero(self._in_picture(raw))
        self._index.fill(pixel)
        who, what = self._index.candidates(raw[inside, 0], raw[inside, 1], np.float32(reach_px))
        near = (np.abs(raw[inside[who]] - pixel[what]) <= reach_px).all(axis=1)
        place, corner = np.zeros(len(x), np.bool_), np.zeros(len(pixel), np.bool_)
        place[inside[who[near]]] = True
        corner[what[near]] = True
        return place, corner
