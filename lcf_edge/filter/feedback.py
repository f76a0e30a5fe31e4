"""Feedback: circles that are fully trusted become ψ, and ψ gives way to whatever breaks the flow."""

import numpy as np

from lcf_edge.config import Filter
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.matching import Matcher
from lcf_edge.filter.tables import CircleTable, EdgeTable, Mask, PsiTable
from lcf_edge.records import Shape

RECTANGLE_FITS = 0.6  # a rectangle around the members of less than this share of the circle's area fits better
PSI_LEAST_FRAMES = 3.5
MARGIN_PX = 12.0  # kept between ψ and anything that breaks the flow


class Feedback:
    """Writes, moves and ends ψ regions."""

    def __init__(self, settings: Filter, matcher: Matcher) -> None:
        self._settings = settings
        self._matcher = matcher
        self._ids = Ids()

    def ignored(self, psi: PsiTable, circles: CircleTable) -> Mask:
        """Normal circles under an active ψ; bool (capacity,)."""
        under = np.zeros(circles.capacity, np.bool_)
        under[psi.circle[psi.active & (psi.circle >= 0)]] = True
        return under

    def ready(self, psi: PsiTable, circles: CircleTable) -> Mask:
        """Normal circles at Tr_max that have no ψ; bool (capacity,)."""
        return circles.active & (circles.trust >= self._settings.tr_max) & ~self.ignored(psi, circles)

    def write(self, psi: PsiTable, circles: CircleTable, ready: Mask, dt_s: float) -> int:
        """Normal circles write ψ, their trust falls back to Tr_s; answers evictions.

        ``ready``: bool (capacity,), those at Tr_max that may be ignored.
        """
        settings = self._settings
        rows = np.flatnonzero(ready)
        places = np.flatnonzero(~psi.active)[: len(rows)]
        evicted = len(rows) - len(places)
        rows = rows[np.argsort(-circles.support[rows], kind="stable")][: len(places)]
        width, height = circles.width[rows], circles.height[rows]
        diameter = 2 * circles.radius[rows]
        rectangle = width * height < RECTANGLE_FITS * np.pi / 4 * diameter * diameter
        psi.active[places] = True
        psi.shape[places] = np.where(rectangle, Shape.RECTANGLE, Shape.CIRCLE)
        psi.x[places], psi.y[places] = circles.x[rows], circles.y[rows]
        psi.width[places] = np.where(rectangle, width, diameter)
        psi.height[places] = np.where(rectangle, height, diameter)
        psi.trust[places] = circles.trust[rows]
        psi.expansion[places] = circles.expansion[rows]
        psi.life_s[places] = max(settings.psi_life_s, PSI_LEAST_FRAMES * dt_s)
        psi.circle[places] = rows
        psi.id[places] = self._ids.take(len(places))
        circles.trust[rows] = settings.tr_s
        return evicted

    def advance(self, psi: PsiTable, circles: CircleTable, focus: tuple[float, float], dt_s: float) -> None:
        """ψ moves with its circle's prediction and grows with it, and expires."""
        psi.life_s -= np.float32(dt_s)
        orphan = ~circles.active[np.maximum(psi.circle, 0)] | (psi.circle < 0)
        psi.active &= (psi.life_s > 0) & ~orphan
        growth = psi.expansion * np.float32(dt_s)
        psi.x += (psi.x - np.float32(focus[0])) * growth
        psi.y += (psi.y - np.float32(focus[1])) * growth
        psi.width *= 1 + growth
        psi.height *= 1 + growth

    def give_way(self, psi: PsiTable, passing: Mask, edges: EdgeTable, rebel: CircleTable) -> None:
        """End the ψ regions that come near a rebel edge, a chain of α, a rebel circle or the sides of the frame.

        At the sides appears what nobody has seen yet. ``passing``: bool (circles,), normal circles that the vehicle
        still passes at a distance: in a turn, what was beside the path may come to lie on it.
        """
        if not psi.active.any():
            return
        psi.active &= passing.take(psi.circle, mode="clip")
        reach = psi.width / 2 + np.float32(MARGIN_PX)
        psi.active &= self._matcher.in_frame(psi.x - reach, psi.y) & self._matcher.in_frame(psi.x + reach, psi.y)
        n = edges.count
        breaking = edges.rebel[:n] | (edges.links[:n] > 0)
        x = np.concatenate([edges.x[:n][breaking], rebel.x[rebel.active]])
        y = np.concatenate([edges.y[:n][breaking], rebel.y[rebel.active]])
        edge_reach = np.full(np.count_nonzero(breaking), np.float32(MARGIN_PX))
        reach = np.concatenate([edge_reach, rebel.radius[rebel.active] + np.float32(2 * MARGIN_PX)])
        dx, dy = np.abs(x[:, None] - psi.x), np.abs(y[:, None] - psi.y)
        from_circle = np.hypot(dx, dy) - psi.width / 2
        from_rectangle = np.hypot(np.maximum(dx - psi.width / 2, 0), np.maximum(dy - psi.height / 2, 0))
        away = np.where(psi.shape == Shape.CIRCLE, from_circle, from_rectangle)
        psi.active &= ~(away <= reach[:, None]).any(axis=0)
