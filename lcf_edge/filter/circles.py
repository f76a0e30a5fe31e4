"""What normal and rebel circles share: newborn trust, identities, places in the table, the blend of two circles."""

from typing import Any

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Filter
from lcf_edge.filter.edge_equations import update_position
from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, EdgeTable, Floats, Rows

RADIUS_SIGMAS = 1.5  # R of a circle, in rms distances of its members
RADIUS_LEAST_PX = 6.0
EXTENT_SIGMAS = 3.6  # full width of the members, in standard deviations


def newborn_trust(settings: Filter) -> float:
    """Tr of everything new: ½(Tr_cr + Tr_s)."""
    return 0.5 * (settings.tr_cr + settings.tr_s)


class Ids:
    """Identities for newborn circles: never 0, as good as never twice."""

    def __init__(self) -> None:
        self._next = 1

    def take(self, number: int) -> npt.NDArray[np.uint32]:
        """The next ``number`` identities."""
        ids = (np.arange(self._next, self._next + number) - 1) % 0xFFFFFFFF + 1
        self._next = (self._next + number - 1) % 0xFFFFFFFF + 1
        return ids.astype(np.uint32)


def release(edges: EdgeTable, circles: CircleTable, rebel: bool) -> None:
    """Edges forget circles that are no more."""
    n = edges.count
    circle = edges.circle[:n]
    gone = (circle >= 0) & (edges.rebel[:n] == rebel) & ~circles.active.take(circle, mode="clip")
    circle[gone] = NO_CIRCLE


def claim(edges: EdgeTable, circles: CircleTable, number: int, settings: Filter, rebel: bool) -> tuple[Rows, int]:
    """Rows for newborn circles: free ones first, then those of circles trusted less than a newborn.

    Answers the rows (perhaps fewer than asked) and how many circles, old or new, found no place.
    """
    rows = free = (~circles.active).nonzero()[0][:number]
    if number > len(free):
        weak = (circles.active & (circles.trust < newborn_trust(settings))).nonzero()[0]
        weak = weak[np.argsort(circles.trust[weak], kind="stable")][: number - len(free)]
        circles.active[weak] = False
        release(edges, circles, rebel)
        rows = np.concatenate([free, weak])
    circles.active[rows] = True
    return rows, number - len(free)


class Members:
    """Edges gathered into groups, and what a circle takes from them.

    ``label``: int (k,), group of each edge, 0 to ``groups`` - 1; a group may be empty. ``x``, ``y``: px.
    Per group, float32 (groups,): ``size``, ``centre_x``, ``centre_y``, ``spread`` (mean squared distance, px²),
    ``width``, ``height`` (extent, px).
    """

    def __init__(self, label: Rows, groups: int, x: Floats, y: Floats) -> None:
        self.label = label
        self._groups = groups
        self.size = np.bincount(label, minlength=groups)
        self._safe = np.maximum(self.size, 1).astype(np.float32)
        self.centre_x, self.centre_y = self.mean(x), self.mean(y)
        off_x, off_y = x - self.centre_x.take(label), y - self.centre_y.take(label)
        variance_x, variance_y = self.mean(off_x * off_x), self.mean(off_y * off_y)
        self.spread = variance_x + variance_y
        self.width = np.float32(EXTENT_SIGMAS) * np.sqrt(variance_x)
        self.height = np.float32(EXTENT_SIGMAS) * np.sqrt(variance_y)

    def mean(self, values: npt.NDArray[Any]) -> Floats:
        """Mean of a value of the edges, (k,), over each group; 0 for an empty one."""
        return (np.bincount(self.label, values, minlength=self._groups) / self._safe).astype(np.float32)

    def radius(self, most_px: float) -> Floats:
        """R that holds most of each group, px."""
        reach = np.float32(RADIUS_SIGMAS) * np.sqrt(self.spread)
        return np.asarray(np.minimum(np.maximum(reach, np.float32(RADIUS_LEAST_PX)), np.float32(most_px)))


def blend(circles: CircleTable, rows: Rows, members: Members, groups: Rows, settings: Filter) -> None:
    """The circle predicted and the circle that its edges show, weighed by trust (as eq. EnEstimation).

    ``rows``: of the table; ``groups``: the group of members of each.
    """
    trust = circles.trust[rows]
    for column, seen in (
        (circles.x, members.centre_x),
        (circles.y, members.centre_y),
        (circles.radius, members.radius(settings.bs_px)),
    ):
        column[rows] = update_position(trust, settings.tr_cr, column[rows], seen[groups])
    describe(circles, rows, members, groups)


def describe(circles: CircleTable, rows: Rows, members: Members, groups: Rows) -> None:
    """Support and extent of circles, from their members."""
    circles.support[rows] = members.size[groups]
    circles.width[rows], circles.height[rows] = members.width[groups], members.height[groups]


def give_birth(circles: CircleTable, rows: Rows, members: Members, groups: Rows, settings: Filter, ids: Ids) -> None:
    """Newborn circles from their members: Tr = ½(Tr_cr + Tr_s), no time to contact yet."""
    circles.x[rows], circles.y[rows] = members.centre_x[groups], members.centre_y[groups]
    circles.radius[rows] = members.radius(settings.bs_px)[groups]
    describe(circles, rows, members, groups)
    circles.trust[rows] = newborn_trust(settings)
    circles.id[rows] = ids.take(len(rows))
    circles.corr[rows] = 1
    circles.cause[rows] = 0
    circles.ttc[rows], circles.range[rows], circles.lateral[rows] = np.inf, np.nan, np.nan
