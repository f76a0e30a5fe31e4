"""A second look: an edge whose corner was not found again is looked for in the picture itself.

What makes a corner is a peak among its neighbours. Blur, noise or a stronger neighbour takes the peak away, though the
place looks as before. From L' the search goes, a pixel at a time, to where the picture looks more like the edge. Along
a line all places look alike: what does not look different in every direction is not taken.
"""

import math

from lcf_edge.filter import image_plane, matching, rounding
from lcf_edge.filter.columns import CornerColumns, EdgeColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.inputs import APPEARANCE_SAMPLES, SAMPLES_PX
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.memory import Bytes, integers
from lcf_edge.filter.settings import Settings

REACH_PX = 6  # a search goes so far at most
BORDER_PX = 7  # from there to the border: all samples of all places are inside the picture
HOPELESS = 3.0  # times the difference that is still the same corner; with more at L' no search begins
LIKENESS = 0.6  # what the detector does not see must be more alike, by this factor
LEAST_RISE_GREY = 0.5  # of the difference, for a pixel to both sides in any direction
ROUNDNESS = 0.35  # of the rises: that in the flattest direction, as a share of that in the steepest
ROOT_HALF = 0.7  # pixels on the diagonal lie farther apart
CLOSE_PX = 2.0  # to a corner that another edge has found; it would be found twice
ALIKE_PX = 32.0  # to a corner that looks the same; it may as well be that one
MEAN_GREY = 128


class SecondLook:
    """Work space.

    ``ring``: how much farther on in the picture each sample lies. ``grey``: samples of one place. ``x``, ``y``: the
    place that a search found, px of the frame; ``beside``, ``below``: how much farther on the corner is, px;
    ``unlike``: sum of the grey differences there.
    """

    def __init__(self, width: int) -> None:
        self.ring, self.grey = integers(APPEARANCE_SAMPLES), integers(APPEARANCE_SAMPLES)
        for k, (right, down) in enumerate(SAMPLES_PX):
            self.ring[k] = down * width + right
        self.x = self.y = self.unlike = 0
        self.beside = self.below = 0.0


def difference(look: SecondLook, smooth: Bytes, at: int, edges: EdgeColumns, i: int) -> int:
    """Sum of the absolute grey differences between a place in the picture and an edge, both with their mean at 128."""
    total = 0
    for k in range(16):  # APPEARANCE_SAMPLES, as a number: the compiler unrolls the loop
        look.grey[k] = smooth[at + look.ring[k]]
        total += look.grey[k]
    shift = MEAN_GREY - total // 16
    away = 0
    for k in range(16):
        away += abs(min(max(look.grey[k] + shift, 0), 255) - edges.appearance[i, k])
    return away


def descend(look: SecondLook, smooth: Bytes, width: int, edges: EdgeColumns, i: int) -> None:
    """From ``x``, ``y`` to the place around which all others are less like the edge."""
    for _ in range(REACH_PX):
        x, y, before = look.x, look.y, look.unlike
        for down in range(-1, 2):
            for right in range(-1, 2):
                away = difference(look, smooth, (y + down) * width + x + right, edges, i)
                if away < look.unlike:
                    look.unlike, look.x, look.y = away, x + right, y + down
        if look.unlike == before:
            break


def is_round(look: SecondLook, smooth: Bytes, width: int, edges: EdgeColumns, i: int) -> bool:
    """Whether the places around the one that was found look different in every direction; where between them it is."""
    at, twice = look.y * width + look.x, 2 * look.unlike
    left, right = difference(look, smooth, at - 1, edges, i), difference(look, smooth, at + 1, edges, i)
    above, below = difference(look, smooth, at - width, edges, i), difference(look, smooth, at + width, edges, i)
    falling = difference(look, smooth, at - width - 1, edges, i) + difference(look, smooth, at + width + 1, edges, i)
    rising = difference(look, smooth, at + width - 1, edges, i) + difference(look, smooth, at - width + 1, edges, i)
    across, down = 1.0 * (left + right - twice), 1.0 * (above + below - twice)
    fall, rise = ROOT_HALF * (falling - twice), ROOT_HALF * (rising - twice)
    flattest = min(across, down, fall, rise)
    if flattest < LEAST_RISE_GREY * APPEARANCE_SAMPLES:
        return False
    if flattest < ROUNDNESS * max(across, down, fall, rise):
        return False
    # the difference rises by as much for each pixel on either side
    look.beside = 0.5 * (left - right) / max(left - look.unlike, right - look.unlike)
    look.below = 0.5 * (above - below) / max(above - look.unlike, below - look.unlike)
    return True


def is_doubtful(
    look: SecondLook, index: CornerIndex, edges: EdgeColumns, i: int, corners: CornerColumns, settings: Settings
) -> bool:
    """Whether a corner close by is another edge's, or omitted; or one around looks like this edge, as where things
    repeat.
    """
    u, v = 1.0 * look.x, 1.0 * look.y
    most = matching.likeness_needed(matching.contrast(edges, i), settings)
    left, right = matching.first_cell(u, ALIKE_PX, index.columns), matching.last_cell(u, ALIKE_PX, index.columns)
    for row in range(matching.first_cell(v, ALIKE_PX, index.rows), matching.last_cell(v, ALIKE_PX, index.rows) + 1):
        for place in range(index.start[row * index.columns + left], index.start[row * index.columns + right + 1]):
            across, down = math.fabs(index.x[place] - u), math.fabs(index.y[place] - v)
            if across <= CLOSE_PX and down <= CLOSE_PX:
                if not corners.free[index.order[place]]:
                    return True
            elif across <= ALIKE_PX and down <= ALIKE_PX and matching.difference(edges, i, index, place) < most:
                return True
    return False


def search(look: SecondLook, smooth: Bytes, plane: ImagePlane, edges: EdgeColumns, i: int, settings: Settings) -> bool:
    """Whether the picture shows an edge within BL of L'; where."""
    if not image_plane.project(plane, edges.predicted_x[i], edges.predicted_y[i]):
        return False
    look.x, look.y = rounding.whole(plane.u + 0.5), rounding.whole(plane.v + 0.5)
    margin = BORDER_PX + REACH_PX
    is_inside = margin <= look.x < plane.width - margin and margin <= look.y < plane.height - margin
    if not is_inside:
        return False
    most = LIKENESS * APPEARANCE_SAMPLES * matching.likeness_needed(matching.contrast(edges, i), settings)
    look.unlike = difference(look, smooth, look.y * plane.width + look.x, edges, i)
    if look.unlike > HOPELESS * most:
        return False
    descend(look, smooth, plane.width, edges, i)
    right, down = look.x - plane.u, look.y - plane.v
    return (
        look.unlike < most
        and right * right + down * down <= edges.bl[i] * edges.bl[i]
        and is_round(look, smooth, plane.width, edges, i)
    )


def enter(look: SecondLook, plane: ImagePlane, edges: EdgeColumns, i: int, corners: CornerColumns) -> None:
    """What was found becomes a corner of the frame, and the edge's own. It keeps the look that the detector saw."""
    x, y = edges.predicted_x[i], edges.predicted_y[i]
    image_plane.project(plane, x, y)
    u, v = plane.u, plane.v
    image_plane.project(plane, x + 1, y)
    right_u, right_v = plane.u - u, plane.v - v
    image_plane.project(plane, x, y + 1)
    down_u, down_v = plane.u - u, plane.v - v
    determinant = right_u * down_v - down_u * right_v
    right, down = look.x + look.beside - u, look.y + look.below - v
    k = corners.count
    corners.count += 1
    corners.pixel_x[k], corners.pixel_y[k] = look.x, look.y
    corners.x[k] = x + (down_v * right - down_u * down) / determinant
    corners.y[k] = y + (right_u * down - right_v * right) / determinant
    corners.words[k, 0], corners.words[k, 1] = edges.words[i, 0], edges.words[i, 1]
    corners.free[k] = corners.omitted[k] = 0
    corners.taken[k] = 1
    edges.corner[i] = k


def find(
    look: SecondLook,
    smooth: Bytes,
    index: CornerIndex,
    plane: ImagePlane,
    edges: EdgeColumns,
    corners: CornerColumns,
    settings: Settings,
) -> int:
    """Look for all edges that have no corner, while there is room for more; return how many were found.

    After ``leaps.find``. ``smooth``: the frame, row after row, as in ``Corners``.
    """
    found = 0
    for i in range(edges.count):
        if corners.count >= corners.capacity:
            break
        if edges.corner[i] >= 0 or edges.held[i] or not search(look, smooth, plane, edges, i, settings):
            continue
        if not is_doubtful(look, index, edges, i, corners, settings):
            enter(look, plane, edges, i, corners)
            found += 1
    return found
