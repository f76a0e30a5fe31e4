"""Line expert: omit corners inside ψ, group the rest by λ."""

import math

from lcf_edge.filter import image_plane, matching
from lcf_edge.filter.columns import CircleColumns, CornerColumns, EdgeColumns, GroupColumns, PsiColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.settings import Settings
from lcf_edge.messages import Shape

MISSING_SHARE = 0.4  # of the edges under ψ, that may have no corner where predicted
NEW_SHARE = 0.4  # corners per edge that may lie where none is predicted
SPARE_CORNERS = 2
CIRCLE_SHAPE = int(Shape.CIRCLE)  # Ty


def holds(psi: PsiColumns, p: int, x: float, y: float) -> bool:
    """Whether a point lies inside a region (the paper's eq. for Ty 1, 2)."""
    dx, dy, reach = x - psi.x[p], y - psi.y[p], 0.5 * psi.width[p]
    if math.fabs(dx) >= reach or math.fabs(dy) >= 0.5 * psi.height[p]:
        return False
    return psi.shape[p] != CIRCLE_SHAPE or dx * dx + dy * dy < reach * reach


def psi_at(psi: PsiColumns, x: float, y: float) -> int:
    """Row of the listed ψ region that contains a point, px, -1: none. Where they overlap, the last."""
    for k in range(psi.live_count):
        p = psi.live[k]
        if holds(psi, p, x, y):
            return p
    return -1


def list_live(psi: PsiColumns) -> None:
    """List the rows in use, last first."""
    psi.live_count = 0
    for p in range(psi.capacity - 1, -1, -1):
        if psi.active[p]:
            psi.live[psi.live_count] = p
            psi.live_count += 1


def coincides(
    index: CornerIndex, plane: ImagePlane, corners: CornerColumns, x: float, y: float, reach_px: float
) -> bool:
    """Whether a corner under ψ lies within ``reach_px`` of a position, whatever its appearance; it is then expected.

    ``x``, ``y``: px of the ideal pinhole; the square around them is in the input frame.
    """
    if not image_plane.project(plane, x, y):
        return False
    u, v = plane.u, plane.v
    seen = False
    left, right = matching.first_cell(u, reach_px, index.columns), matching.last_cell(u, reach_px, index.columns)
    for row in range(matching.first_cell(v, reach_px, index.rows), matching.last_cell(v, reach_px, index.rows) + 1):
        for place in range(index.start[row * index.columns + left], index.start[row * index.columns + right + 1]):
            corner = index.order[place]
            beside = math.fabs(index.x[place] - u) > reach_px or math.fabs(index.y[place] - v) > reach_px
            if corners.psi[corner] >= 0 and not beside:
                seen = True
                corners.expected[corner] = 1
    return seen


def place_in_psi(
    psi: PsiColumns,
    index: CornerIndex,
    plane: ImagePlane,
    edges: EdgeColumns,
    corners: CornerColumns,
    reach_px: float,
) -> None:
    """Find the region of each corner and each L', and count missing and new corners of each region."""
    for p in range(psi.capacity):
        psi.edges[p] = psi.missing[p] = psi.new[p] = 0
    for k in range(corners.count):
        corners.psi[k] = psi_at(psi, corners.x[k], corners.y[k])
        corners.expected[k] = 0
    for i in range(edges.count):
        edges.psi[i] = -1 if edges.own_way(i) else psi_at(psi, edges.predicted_x[i], edges.predicted_y[i])
        if edges.psi[i] >= 0:
            psi.edges[edges.psi[i]] += 1
            if not coincides(index, plane, corners, edges.predicted_x[i], edges.predicted_y[i], reach_px):
                psi.missing[edges.psi[i]] += 1
    for k in range(corners.count):
        if corners.psi[k] >= 0 and not corners.expected[k]:
            psi.new[corners.psi[k]] += 1


def end_surprised(psi: PsiColumns) -> None:
    """End the ψ regions with too many missing or new corners.

    This check costs a few look-ups, and nothing crosses ψ unseen.
    """
    for p in range(psi.capacity):
        if psi.missing[p] > MISSING_SHARE * psi.edges[p] + SPARE_CORNERS:
            psi.active[p] = 0
        if psi.new[p] > NEW_SHARE * psi.edges[p] + SPARE_CORNERS:
            psi.active[p] = 0


def hold(edges: EdgeColumns, psi: PsiColumns, key_number: int, tr_s: float) -> None:
    """Hold the edges under ψ: predicted without being matched.

    Their history restarts, and they are trusted at most Tr_s, so that their corners soon correct them.
    """
    for i in range(edges.count):
        p = edges.psi[i]
        if p >= 0 and psi.active[p]:
            edges.held[i] = 1
            edges.born_key[i] = key_number
            edges.trust[i] = min(edges.trust[i], tr_s)


def omit(
    psi: PsiColumns,
    index: CornerIndex,
    plane: ImagePlane,
    edges: EdgeColumns,
    corners: CornerColumns,
    key_number: int,
    settings: Settings,
) -> int:
    """Omit the corners inside ψ, hold the edges under it; return how many corners are omitted.

    Regions with too many missing or new corners end first.
    """
    for i in range(edges.count):
        edges.held[i] = 0
    for k in range(corners.count):
        corners.omitted[k] = 0
    list_live(psi)
    if psi.live_count == 0:
        return 0
    place_in_psi(psi, index, plane, edges, corners, settings.bl_min_px)
    end_surprised(psi)
    hold(edges, psi, key_number, settings.tr_s)
    omitted = 0
    for k in range(corners.count):
        p = corners.psi[k]
        if p >= 0 and psi.active[p]:
            corners.omitted[k] = 1
            corners.free[k] = 0
            omitted += 1
    return omitted


def insert_group(groups: GroupColumns, circles: CircleColumns, c: int, row: int) -> bool:
    """Insert a circle by its trust; a full table drops the least trusted. Return whether one did not fit."""
    trust = circles.trust[c]
    full = groups.count == groups.capacity
    if full:
        if trust < groups.trust[0]:
            return True
        for k in range(groups.count - 1):
            copy_group(groups, k + 1, k)
    else:
        groups.count += 1
    k = groups.count - 1
    while k > 0 and groups.trust[k - 1] > trust:
        copy_group(groups, k - 1, k)
        k -= 1
    groups.x[k], groups.y[k], groups.bs[k] = circles.x[c], circles.y[c], circles.radius[c]
    groups.trust[k], groups.row[k] = trust, row
    return full


def copy_group(groups: GroupColumns, source: int, target: int) -> None:
    """Copy a row."""
    groups.x[target], groups.y[target], groups.bs[target] = groups.x[source], groups.y[source], groups.bs[source]
    groups.trust[target], groups.row[target] = groups.trust[source], groups.row[source]


def collect(groups: GroupColumns, normal: CircleColumns, rebel: CircleColumns, tr_cr: float) -> int:
    """λ ← C_n and C_r above Tr_cr, least trusted first; return how many did not fit."""
    groups.count = 0
    evicted = 0
    for c in range(normal.capacity):
        if normal.active[c] and normal.trust[c] > tr_cr and insert_group(groups, normal, c, c):
            evicted += 1
    for c in range(rebel.capacity):
        if rebel.active[c] and rebel.trust[c] > tr_cr and insert_group(groups, rebel, c, -1):
            evicted += 1
    return evicted


def group_at(groups: GroupColumns, x: float, y: float) -> int:
    """Group that contains a point (eq. 1: |L_λ - Edge| < BS_λ), the most trusted of several; -1: none."""
    for g in range(groups.count - 1, -1, -1):
        dx, dy = x - groups.x[g], y - groups.y[g]
        if dx * dx + dy * dy < groups.bs[g] * groups.bs[g]:
            return g
    return -1


def circle_at(groups: GroupColumns, x: float, y: float) -> int:
    """Row of the normal circle of the group that contains a point, -1: none."""
    g = group_at(groups, x, y)
    return groups.row[g] if g >= 0 else -1
