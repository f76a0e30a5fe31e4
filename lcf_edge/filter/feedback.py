"""Feedback: fully trusted normal circles become ψ, and ψ gives way to whatever breaks the flow."""

import math

from lcf_edge.filter import circles, image_plane, key_frames, lengths, normal_circles
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.columns import CircleColumns, EdgeColumns, PsiColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.key_frames import KeyFrames
from lcf_edge.filter.memory import integers, octets
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import Shape

PI = 3.141592653589793
SURE_BASELINE_S = 0.2  # history that distinguishes movers from the static scene
RECTANGLE_FITS = 0.6  # ψ is a rectangle if that has less than this share of the circle's area
MIN_PSI_FRAMES = 3.5
CIRCLE_MARGINS = 2.0  # margins between ψ and a rebel circle; for a rebel edge it is one
CIRCLE_SHAPE = int(Shape.CIRCLE)  # Ty
RECTANGLE_SHAPE = int(Shape.RECTANGLE)


class Candidates:
    """Normal circles, one row each.

    ``ignored``: under an active ψ. ``passing``: the vehicle passes it at a distance. ``ready``: may write ψ.
    ``members``: number of its edges; ``watched``: of those with a history of ``SURE_BASELINE_S``.
    """

    def __init__(self, capacity: int) -> None:
        self.ignored, self.passing, self.ready = [octets(capacity) for _ in range(3)]
        self.members, self.watched = [integers(capacity) for _ in range(2)]


def advance(psi: PsiColumns, normal: CircleColumns, around: Situation) -> None:
    """Move and grow ψ as its circle is predicted; ψ ends when it expires, or with its circle."""
    for p in range(psi.capacity):
        if not psi.active[p]:
            continue
        psi.life_s[p] -= around.dt_s
        if psi.life_s[p] <= 0 or psi.circle[p] < 0 or not normal.active[psi.circle[p]]:
            psi.active[p] = 0
        growth = psi.expansion[p] * around.dt_s
        psi.x[p] += (psi.x[p] - around.focus_x) * growth
        psi.y[p] += (psi.y[p] - around.focus_y) * growth
        psi.width[p] *= 1 + growth
        psi.height[p] *= 1 + growth


def mark_ignored(candidates: Candidates, psi: PsiColumns) -> None:
    """Mark the normal circles under an active ψ."""
    for c in range(candidates.ignored.shape[0]):
        candidates.ignored[c] = 0
    for p in range(psi.capacity):
        if psi.active[p] and psi.circle[p] >= 0:
            candidates.ignored[psi.circle[p]] = 1


def mark_ready(candidates: Candidates, normal: CircleColumns, around: Situation, settings: Settings) -> bool:
    """Mark normal circles at Tr_max that are passed at a distance and have no ψ; return whether there are any."""
    some = False
    for c in range(normal.capacity):
        candidates.passing[c] = 1 if normal_circles.passes_by(normal, c, around) else 0
        trusted = normal.active[c] != 0 and normal.trust[c] >= settings.tr_max
        candidates.ready[c] = 1 if trusted and candidates.passing[c] and not candidates.ignored[c] else 0
        if candidates.ready[c]:
            some = True
    return some


def keep_watched(candidates: Candidates, normal: CircleColumns, edges: EdgeColumns, keys: KeyFrames) -> None:
    """Keep only circles ready of whose edges most have a history of ``SURE_BASELINE_S``."""
    for c in range(normal.capacity):
        candidates.members[c] = candidates.watched[c] = 0
    for i in range(edges.count):
        c = edges.circle[i]
        if c >= 0 and not edges.rebel[i]:
            candidates.members[c] += 1
            if key_frames.has_history(edges, i, keys, SURE_BASELINE_S):
                candidates.watched[c] += 1
    for c in range(normal.capacity):
        if 2 * candidates.watched[c] <= candidates.members[c]:
            candidates.ready[c] = 0


def best_supported(candidates: Candidates, normal: CircleColumns) -> int:
    """The ready circle with the most edges, -1: none."""
    best = -1
    for c in range(normal.capacity):
        if candidates.ready[c] and (best < 0 or normal.support[c] > normal.support[best]):
            best = c
    return best


def free_row(psi: PsiColumns) -> int:
    """The first row not in use, -1: none."""
    for p in range(psi.capacity):
        if not psi.active[p]:
            return p
    return -1


def write_region(psi: PsiColumns, p: int, normal: CircleColumns, c: int, life_s: float, ids: Ids) -> None:
    """Write the ψ of a circle: with its centre and radius, or as a rectangle where that fits better."""
    width, height, diameter = normal.width[c], normal.height[c], 2 * normal.radius[c]
    psi.active[p] = 1
    psi.id[p] = circles.new_id(ids)
    psi.shape[p] = CIRCLE_SHAPE
    psi.width[p] = psi.height[p] = diameter
    if width * height < RECTANGLE_FITS * PI / 4 * diameter * diameter:
        psi.shape[p] = RECTANGLE_SHAPE
        psi.width[p], psi.height[p] = width, height
    psi.x[p], psi.y[p], psi.trust[p] = normal.x[c], normal.y[c], normal.trust[c]
    psi.expansion[p], psi.life_s[p], psi.circle[p] = normal.expansion[c], life_s, c


def write(
    psi: PsiColumns,
    normal: CircleColumns,
    edges: EdgeColumns,
    candidates: Candidates,
    keys: KeyFrames,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> int:
    """Write ψ for normal circles at Tr_max, best supported first; their trust falls back to Tr_s.

    Return how many did not fit.
    """
    mark_ignored(candidates, psi)
    if not mark_ready(candidates, normal, around, settings):
        return 0
    keep_watched(candidates, normal, edges, keys)
    evicted = 0
    life_s = max(settings.psi_life_s, MIN_PSI_FRAMES * around.dt_s)
    c = best_supported(candidates, normal)
    while c >= 0:
        p = free_row(psi)
        if p >= 0:
            write_region(psi, p, normal, c, life_s, ids)
            normal.trust[c] = settings.tr_s
        else:
            evicted += 1
        candidates.ready[c] = 0
        c = best_supported(candidates, normal)
    return evicted


def is_near(psi: PsiColumns, p: int, x: float, y: float, reach_px: float) -> bool:
    """Whether a point is within ``reach_px`` of a region."""
    dx, dy = math.fabs(x - psi.x[p]), math.fabs(y - psi.y[p])
    half_x, half_y = 0.5 * psi.width[p], 0.5 * psi.height[p]
    if psi.shape[p] == CIRCLE_SHAPE:
        return lengths.of(dx, dy) - half_x <= reach_px
    return lengths.of(max(dx - half_x, 0.0), max(dy - half_y, 0.0)) <= reach_px


def end_near(psi: PsiColumns, x: float, y: float, reach_px: float) -> None:
    """End the regions within ``reach_px`` of a point."""
    for p in range(psi.capacity):
        if psi.active[p] and is_near(psi, p, x, y, reach_px):
            psi.active[p] = 0


def end_aside(psi: PsiColumns, candidates: Candidates, plane: ImagePlane, margin_px: float) -> None:
    """End the regions that a turn brings onto the path, and those at the left or right side of the frame.

    At the sides new things appear.
    """
    for p in range(psi.capacity):
        if not psi.active[p]:
            continue
        reach = 0.5 * psi.width[p] + margin_px
        inside = image_plane.project(plane, psi.x[p] - reach, psi.y[p])
        inside = image_plane.project(plane, psi.x[p] + reach, psi.y[p]) and inside
        if not inside or not candidates.passing[max(psi.circle[p], 0)]:
            psi.active[p] = 0


def give_way(
    psi: PsiColumns,
    candidates: Candidates,
    edges: EdgeColumns,
    rebel: CircleColumns,
    plane: ImagePlane,
    margin_px: float,
) -> None:
    """End the ψ regions that come near a rebel edge, a chain of α, a rebel circle, the path or the frame's sides."""
    end_aside(psi, candidates, plane, margin_px)
    for i in range(edges.count):
        if edges.own_way(i):
            end_near(psi, edges.x[i], edges.y[i], margin_px)
    for c in range(rebel.capacity):
        if rebel.active[c]:
            end_near(psi, rebel.x[c], rebel.y[c], rebel.radius[c] + CIRCLE_MARGINS * margin_px)
