"""Line expert: omit what lies inside ψ, group the rest by λ."""

import numpy as np
import numpy.typing as npt

from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, Floats, PsiTable
from lcf_edge.records import Shape


def inside_psi(psi: PsiTable, x: Floats, y: Floats) -> npt.NDArray[np.int32]:
    """Row of the ψ region that holds each point, -1: none (the paper's eq. for Ty 0, 1, 2).

    ``x``, ``y``: float32 (n,) px. Answers int32 (n,). Where regions overlap, the last row.
    """
    rows = np.flatnonzero(psi.active)
    holder = np.full(len(x), NO_CIRCLE, np.int32)
    if not len(rows) or not len(x):
        return holder
    dx, dy = np.abs(x[:, None] - psi.x[rows]), np.abs(y[:, None] - psi.y[rows])
    half_width, half_height = 0.5 * psi.width[rows], 0.5 * psi.height[rows]
    inside = np.where(
        psi.shape[rows] == Shape.CIRCLE,
        dx * dx + dy * dy < half_width * half_width,
        (dx < half_width) & (dy < half_height),
    )
    last = len(rows) - 1 - np.argmax(inside[:, ::-1], axis=1)
    held = inside.any(axis=1)
    holder[held] = rows[last[held]]
    return holder


class Groups:
    """λ: the circles whose trust is above Tr_cr gather the corners around them (eq. 1).

    ``row``: rows of the circle table; ``x``, ``y``, ``bs`` (BS_λ, px), ``expansion`` (1/s), ``corr``: float32 (g,).
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._floats = np.zeros((5, capacity), np.float32)
        self._row = np.zeros(capacity, np.int32)
        self.count = 0

    @property
    def nbytes(self) -> int:
        """Bytes that the table occupies, for good."""
        return self._floats.nbytes + self._row.nbytes

    @property
    def x(self) -> Floats:
        """Centre, px."""
        return self._floats[0, : self.count]

    @property
    def y(self) -> Floats:
        """Centre, px."""
        return self._floats[1, : self.count]

    @property
    def bs(self) -> Floats:
        """BS_λ, px."""
        return self._floats[2, : self.count]

    @property
    def row(self) -> npt.NDArray[np.int32]:
        """Row of the normal circle behind each group; -1: a rebel circle's."""
        return self._row[: self.count]

    def collect(self, normal: CircleTable, rebel: CircleTable, tr_cr: float) -> int:
        """λ ← C_n and C_r above Tr_cr, the least trusted first; answers how many found no place."""
        rows_n = np.flatnonzero(normal.active & (normal.trust > tr_cr))
        rows_r = np.flatnonzero(rebel.active & (rebel.trust > tr_cr))
        trust = np.concatenate([normal.trust[rows_n], rebel.trust[rows_r]])
        order = np.argsort(trust, kind="stable")
        kept = order[max(0, len(order) - self.capacity) :]
        self.count = len(kept)
        for field, name in enumerate(("x", "y", "radius")):
            both = np.concatenate([getattr(normal, name)[rows_n], getattr(rebel, name)[rows_r]])
            self._floats[field, : self.count] = both[kept]
        owner = np.concatenate([rows_n, np.full(len(rows_r), NO_CIRCLE)])
        self._row[: self.count] = owner[kept]
        return len(order) - len(kept)

    def assign(self, x: Floats, y: Floats) -> npt.NDArray[np.int32]:
        """Group that holds each point (eq. 1: |L_λ - Edge| < BS_λ), the most trusted of several; -1: none."""
        best = np.full(len(x), NO_CIRCLE, np.int32)
        if not self.count or not len(x):
            return best
        near = np.square(x[:, None] - self.x) + np.square(y[:, None] - self.y) < np.square(self.bs)
        last = self.count - 1 - np.argmax(near[:, ::-1], axis=1)
        held = near[np.arange(len(x)), last]
        best[held] = last[held]
        return best

