"""What normal and rebel circles share: newborn trust, identities, places in the table, the blend of two circles."""

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Filter
from lcf_edge.filter.edge_equations import update_position
from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, EdgeTable, Floats, Mask, Rows

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


def claim(edges: EdgeTable, circles: CircleTable, number: int, tr_new: float, rebel: bool) -> tuple[Rows, int]:
    """Rows for newborn circles: free ones first, then those of circles trusted less than a newborn.

    Answers the rows (perhaps fewer than asked) and how many circles, old or new, found no place.
    """
    free = np.flatnonzero(~circles.active)[:number]
    weak = np.flatnonzero(circles.active & (circles.trust < tr_new))
    weak = weak[np.argsort(circles.trust[weak], kind="stable")][: number - len(free)]
    circles.active[weak] = False
    release(edges, circles, rebel)
    rows = np.concatenate([free, weak])
    circles.active[rows] = True
    return rows, number - len(free)


def radius_of(spread: Floats, most_px: float) -> Floats:
    """R in px from the mean squared distance of the members from their centre."""
    return np.clip(RADIUS_SIGMAS * np.sqrt(spread), RADIUS_LEAST_PX, most_px).astype(np.float32)


def blend(
    circles: CircleTable,
    rows: Mask | Rows,
    settings: Filter,
    x: Floats,
    y: Floats,
    radius: Floats,
) -> None:
    """The circle predicted and the circle that its edges show, weighed by trust (as eq. EnEstimation)."""
    trust = circles.trust[rows]
    for column, seen in ((circles.x, x), (circles.y, y), (circles.radius, radius)):
        column[rows] = update_position(trust, settings.tr_cr, column[rows], seen)
