"""Corners and predicted edges find each other: by place through cells, by appearance, one to one."""

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.filter.inputs import APPEARANCE_SAMPLES
from lcf_edge.filter.tables import Floats, Rows

CELL_SHIFT = 1  # cells of 2x2 px: FAST with non-maximum suppression leaves at most one corner in each
GATES_PX = (4, 8, 14, 26, 50)  # a prediction is looked for in the smallest of these that holds its gate
DISTANCE_COST = 0.4  # grey levels a px, so that of equal looks the nearest wins
LIKENESS_FLOOR = 3.0  # grey levels of camera noise
_ROUNDS = 3

Pairs = tuple[Rows, Rows]


class CornerIndex:
    """Every corner of a frame in a half-resolution picture of row numbers."""

    def __init__(self, width: int, height: int) -> None:
        self._margin = (GATES_PX[-1] >> CELL_SHIFT) + 2
        self._columns = (width >> CELL_SHIFT) + 1 + 2 * self._margin
        rows = (height >> CELL_SHIFT) + 1 + 2 * self._margin
        self._cells = np.full((rows, self._columns), -1, np.int16)
        self._flat = self._cells.reshape(-1)
        self._width, self._height = width, height
        self._near = self._disc(2)
        self._offsets = [self._disc(radius) for radius in GATES_PX]

    @property
    def nbytes(self) -> int:
        """Bytes that the index occupies, for good."""
        return self._cells.nbytes + sum(o.nbytes for o in self._offsets)

    def _disc(self, radius_px: int) -> npt.NDArray[np.int32]:
        """Cell offsets that cover a disc around any position in the centre cell, nearest first."""
        reach = (radius_px >> CELL_SHIFT) + 1
        v, u = np.mgrid[-reach : reach + 1, -reach : reach + 1]
        near = np.hypot(u, v) * 2 <= radius_px + 1.5
        u, v = u[near], v[near]
        order = np.argsort(u * u + v * v, kind="stable")
        return (v * self._columns + u)[order].astype(np.int32)

    def fill(self, pixel: npt.NDArray[np.int32]) -> None:
        """Enter the corners; ``pixel``: int32 (n, 2), n < 32768."""
        self._flat.fill(-1)
        self._flat[self._cell(pixel[:, 0], pixel[:, 1])] = np.arange(len(pixel), dtype=np.int16)

    def _cell(self, x: npt.NDArray[np.int32], y: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        cell = ((y >> CELL_SHIFT) + self._margin) * self._columns + (x >> CELL_SHIFT) + self._margin
        return cell.astype(np.int32, copy=False)

    def candidates(self, x: Floats, y: Floats, gate: Floats) -> Pairs:
        """All (prediction, corner) pairs whose cells lie within each prediction's gate.

        ``x``, ``y``: float32 (n,) px of the input frame, inside it. ``gate``: float32 (n,) px.
        """
        cell = self._cell(np.rint(x).astype(np.int32), np.rint(y).astype(np.int32))
        size = np.searchsorted(np.asarray(GATES_PX[:-1], np.float32), gate)
        who: list[Rows] = []
        what: list[Rows] = []
        for gate_class in np.unique(size):
            rows = np.flatnonzero(size == gate_class)
            found = self._flat[cell[rows, None] + self._offsets[gate_class]]
            hits = np.flatnonzero(found.reshape(-1) >= 0)
            who.append(rows[hits // len(self._offsets[gate_class])])
            what.append(found.reshape(-1)[hits].astype(np.intp))
        if not who:
            return np.empty(0, np.intp), np.empty(0, np.intp)
        return np.concatenate(who), np.concatenate(what)


    def any_near(self, raw: Floats) -> npt.NDArray[np.bool_]:
        """Whether a corner lies within about 3 px of each point; float32 (n, 2) px, NaN or outside: no."""
        x, y = raw[:, 0], raw[:, 1]
        inside = (x >= 0) & (y >= 0) & (x <= self._width - 1) & (y <= self._height - 1)
        cell = self._cell(np.rint(x[inside]).astype(np.int32), np.rint(y[inside]).astype(np.int32))
        found = np.zeros(len(raw), np.bool_)
        found[inside] = (self._flat[cell[:, None] + self._near] >= 0).any(axis=1)
        return found


def difference(
    one: npt.NDArray[np.uint8], other: npt.NDArray[np.uint8]
) -> Floats:
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
    return np.minimum(np.float32(LIKENESS_FLOOR) + np.float32(share) * difference(appearance, flat), np.float32(most))


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
