"""Line expert: omit what lies inside ψ, group the rest by λ."""

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Filter
from lcf_edge.filter.edge_equations import Estimate
from lcf_edge.filter.inputs import Corners
from lcf_edge.filter.matching import Matcher
from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, EdgeTable, Floats, Mask, PsiTable, Rows
from lcf_edge.records import Shape

MISSING_SHARE = 0.4  # of the edges under ψ may have no corner where they are predicted
NEW_SHARE = 0.4  # and so many corners, for each edge, may lie where none is
SPARE_CORNERS = 2


def inside_psi(psi: PsiTable, x: Floats, y: Floats) -> npt.NDArray[np.int32]:
    """Row of the ψ region that holds each point, -1: none (the paper's eq. for Ty 0, 1, 2).

    ``x``, ``y``: float32 (n,) px. Answers int32 (n,). Where regions overlap, the last row.
    """
    rows = psi.active.nonzero()[0]
    holder = np.full(len(x), NO_CIRCLE, np.int32)
    if not len(rows) or not len(x):
        return holder
    reach_x, reach_y = 0.5 * psi.width.take(rows), 0.5 * psi.height.take(rows)
    left, right = psi.x.take(rows) - reach_x, psi.x.take(rows) + reach_x
    # Most points are in no region's box: those go no farther.
    point, region = ((x[:, None] > left) & (x[:, None] < right)).nonzero()
    row = rows.take(region)
    dx, dy = x.take(point) - psi.x.take(row), y.take(point) - psi.y.take(row)
    round_ = psi.shape.take(row) == Shape.CIRCLE
    reach = reach_x.take(region)
    inside = (np.abs(dy) < reach_y.take(region)) & (~round_ | (dx * dx + dy * dy < reach * reach))
    holder[point[inside]] = row[inside]
    return holder


def end_surprised(
    psi: PsiTable,
    holder_of_edge: npt.NDArray[np.int32],
    seen: Mask,
    holder_of_corner: npt.NDArray[np.int32],
    expected: Mask,
) -> None:
    """End the ψ regions whose corners are not where the edges under them let expect.

    ``holder_of_edge``, ``holder_of_corner``: rows of ψ. ``seen``: bool, edges that have a corner where they are
    predicted. ``expected``: bool, corners where an edge is predicted. This look in passing costs a few places in an
    index, and lets nothing walk through ψ unseen.
    """
    edges = np.bincount(holder_of_edge, minlength=psi.capacity)
    missing = np.bincount(holder_of_edge[~seen], minlength=psi.capacity)
    new = np.bincount(holder_of_corner[~expected], minlength=psi.capacity)
    psi.active &= (missing <= MISSING_SHARE * edges + SPARE_CORNERS) & (new <= NEW_SHARE * edges + SPARE_CORNERS)


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

    def circle_at(self, x: Floats, y: Floats) -> Rows:
        """Row of the normal circle behind the group that holds each point, -1: none."""
        group = self.assign(x, y)
        if not self.count:
            return group.astype(np.intp)
        return np.where(group >= 0, self.row[np.maximum(group, 0)], NO_CIRCLE)


class LineExpert:
    """Omits the corners inside ψ, and looks there in passing whether all is as predicted."""

    def __init__(self, settings: Filter, matcher: Matcher, edges: EdgeTable, psi: PsiTable) -> None:
        self._settings = settings
        self._matcher = matcher
        self._edges = edges
        self._psi = psi

    def omit(self, corners: Corners, x: Floats, y: Floats, estimate: Estimate, key_number: int) -> Mask:
        """Corners inside ψ, bool (corners,); edges under ψ are held: predicted without being matched.

        ``x``, ``y``: corners, px. ``estimate``: E' of all edges. Regions where corners are not where, or not as many
        as, the edges let expect, end first.
        """
        edges, n, psi = self._edges, self._edges.count, self._psi
        edges.held[:n] = False
        if not psi.active.any():
            return np.zeros(len(corners), np.bool_)
        both = inside_psi(psi, np.concatenate([x, estimate.x]), np.concatenate([y, estimate.y]))
        of_corner, of_edge = both[: len(corners)], both[len(corners) :]
        of_edge[edges.own_way()] = NO_CIRCLE
        held, inside = (of_edge != NO_CIRCLE).nonzero()[0], (of_corner != NO_CIRCLE).nonzero()[0]
        seen, expected = self._matcher.coincide(
            estimate.x.take(held), estimate.y.take(held), inside, self._settings.bl_min_px
        )
        end_surprised(psi, of_edge.take(held), seen, of_corner.take(inside), expected)
        held = held[psi.active.take(of_edge.take(held))]
        edges.held[held] = True
        # What is only predicted is no history, and is trusted like its circle, so that its corner soon corrects it.
        edges.born_key[held] = key_number
        edges.trust[held] = np.minimum(edges.trust[held], self._settings.tr_s)
        return np.asarray((of_corner != NO_CIRCLE) & psi.active.take(of_corner, mode="clip"))
