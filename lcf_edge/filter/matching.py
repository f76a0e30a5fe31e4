"""Matching of corners and predicted edges, one to one: by position, through an index of cells, and by appearance."""

import math

import numpy as np

from lcf_edge.filter import image_plane, rounding
from lcf_edge.filter.columns import CornerColumns, EdgeColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.inputs import APPEARANCE_SAMPLES
from lcf_edge.filter.memory import Doubles, Integers, Words, doubles, integers, memory_of
from lcf_edge.filter.settings import Settings

CELL_SHIFT = 4  # cells of 16x16 px hold a few corners
DISTANCE_COST = 0.4  # grey levels per px, so that the nearest of similar corners wins
LIKENESS_FLOOR = 3.0  # grey levels of camera noise
WIDE_LIKENESS = 0.5  # factor of the allowed difference in a wide search
MEAN_GREY = 128  # of an appearance
MEAN_OF_SUM = 1 / 16.0  # over the samples of an appearance
ROUNDS = 2  # of mutual best choice


class CornerIndex:
    """Corners sorted by cell, row by row: those near a position are a few contiguous runs.

    The cost of a look-up depends on the corners found, not on the size of the gate or image. ``start``: of each cell's
    run. In sorted order: ``order``, row of the frame's corners, and copies of what a look-up needs, so that a run is
    contiguous in memory: ``x``, ``y`` (px of the input frame), ``appearance``. ``listed``: scratch. ``nbytes``: total
    size.
    """

    def __init__(self, width: int, height: int, capacity: int) -> None:
        self.columns = (width >> CELL_SHIFT) + 1
        self.rows = (height >> CELL_SHIFT) + 1
        self.start = integers(self.columns * self.rows + 1)
        self.order = integers(capacity)
        self.listed = integers(capacity + 1)
        self.x, self.y = doubles(capacity), doubles(capacity)
        appearance = np.zeros((capacity, APPEARANCE_SAMPLES), np.uint8)
        self.appearance, self.words = memory_of(appearance), memory_of(appearance.view(np.uint64))
        self.nbytes = 4 * (self.columns * self.rows + 1) + capacity * (4 + 4 + 8 + 8 + APPEARANCE_SAMPLES)


def take_corners(corners: CornerColumns, pixel: Integers, position: Doubles, words: Words) -> None:
    """Take the corners of a frame: all free, none taken.

    ``pixel``: int32 (n, 2). ``position``: float32 (n, 2). ``words``: appearances as uint64 (n, 2).
    """
    corners.count = len(pixel)
    for i in range(corners.count):
        corners.pixel_x[i], corners.pixel_y[i] = pixel[i, 0], pixel[i, 1]
        corners.x[i], corners.y[i] = position[i, 0], position[i, 1]
        corners.words[i, 0], corners.words[i, 1] = words[i, 0], words[i, 1]
        corners.free[i] = 1
        corners.taken[i] = 0


def cell_of(index: CornerIndex, x: int, y: int) -> int:
    """Number of the cell that holds a pixel."""
    return (y >> CELL_SHIFT) * index.columns + (x >> CELL_SHIFT)


def fill(index: CornerIndex, corners: CornerColumns) -> None:
    """Index the corners of a frame, by a stable counting sort."""
    cells = index.columns * index.rows
    for k in range(cells + 1):
        index.start[k] = 0
    for i in range(corners.count):
        index.start[cell_of(index, corners.pixel_x[i], corners.pixel_y[i]) + 1] += 1
    for k in range(cells):
        index.start[k + 1] += index.start[k]
    for i in range(corners.count):
        cell = cell_of(index, corners.pixel_x[i], corners.pixel_y[i])
        place = index.start[cell]
        index.start[cell] += 1  # holds the next free place until the loop ends
        index.order[place] = i
        index.x[place], index.y[place] = corners.pixel_x[i], corners.pixel_y[i]
        index.words[place, 0], index.words[place, 1] = corners.words[i, 0], corners.words[i, 1]
    for k in range(cells, 0, -1):
        index.start[k] = index.start[k - 1]
    index.start[0] = 0


def first_cell(middle: float, gate: float, cells: int) -> int:
    """First of ``cells`` rows or columns that the interval ``middle`` ± ``gate`` meets; ``cells``: none."""
    return min(rounding.whole(max(middle - gate, 0.0)) >> CELL_SHIFT, cells)


def last_cell(middle: float, gate: float, cells: int) -> int:
    """Last of ``cells`` rows or columns that the interval ``middle`` ± ``gate`` meets; -1: none."""
    return max(min(rounding.whole(middle + gate) >> CELL_SHIFT, cells - 1), -1)


def difference(edges: EdgeColumns, i: int, index: CornerIndex, place: int) -> float:
    """Mean absolute difference of two appearances, grey levels."""
    total = 0
    for k in range(16):  # APPEARANCE_SAMPLES, as a number: one vector instruction
        total += abs(edges.appearance[i, k] - index.appearance[place, k])
    return total * MEAN_OF_SUM


def contrast(edges: EdgeColumns, i: int) -> float:
    """Mean absolute deviation of an appearance from its mean, grey levels."""
    total = 0
    for k in range(16):  # APPEARANCE_SAMPLES
        total += abs(edges.appearance[i, k] - MEAN_GREY)
    return total * MEAN_OF_SUM


def likeness_needed(own_contrast: float, settings: Settings) -> float:
    """Largest mean difference at which an appearance is still the same, by its own contrast, grey levels.

    A faint corner must match more closely than a strong one, or it would be confused with its neighbours.
    """
    return min(LIKENESS_FLOOR + settings.appearance_share * own_contrast, settings.appearance_max)


def list_near(index: CornerIndex, corners: CornerColumns, x: float, y: float, gate: float) -> int:
    """List the free corners within ``gate`` of (x, y), px; return how many."""
    count, gate2 = 0, gate * gate
    left, right = first_cell(x, gate, index.columns), last_cell(x, gate, index.columns)
    for row in range(first_cell(y, gate, index.rows), last_cell(y, gate, index.rows) + 1):
        for place in range(index.start[row * index.columns + left], index.start[row * index.columns + right + 1]):
            dx, dy = index.x[place] - x, index.y[place] - y
            index.listed[count] = place  # no branch: it would be mispredicted
            count += (dx * dx + dy * dy <= gate2) & corners.free[index.order[place]]
    return count


def choose(
    index: CornerIndex, edges: EdgeColumns, i: int, corners: CornerColumns, x: float, y: float, gate: float, most: float
) -> None:
    """Choose the best free corner for an edge within ``gate`` of (x, y), px, and offer the edge to each corner.

    ``most``: largest mean difference of the appearances, grey levels.
    """
    for k in range(list_near(index, corners, x, y, gate)):
        place = index.listed[k]
        corner = index.order[place]
        dx, dy = index.x[place] - x, index.y[place] - y
        far = DISTANCE_COST * math.sqrt(dx * dx + dy * dy)
        edge_has_better = edges.best[i] >= 0 and far >= edges.cost[i]
        if edge_has_better and corners.edge[corner] >= 0 and far >= corners.cost[corner]:
            continue  # even if identical
        unlike = difference(edges, i, index, place)
        if unlike >= most:
            continue
        cost = unlike + far
        if edges.best[i] < 0 or cost < edges.cost[i]:
            edges.best[i], edges.cost[i] = corner, cost
        if corners.edge[corner] < 0 or cost < corners.cost[corner]:
            corners.edge[corner], corners.cost[corner] = i, cost


def gate_px(edges: EdgeColumns, i: int, slack_px: float, wide: bool, settings: Settings) -> float:
    """Radius of the gate around an edge, px: BL, or, if ``wide``, how far it may have leapt."""
    gate = edges.bl[i] + slack_px
    if not wide:
        return gate
    leap = settings.leap_px if edges.trust[i] < settings.tr_s else settings.bl0_px
    return max(gate, leap + slack_px)


def choose_all(
    index: CornerIndex,
    plane: ImagePlane,
    edges: EdgeColumns,
    corners: CornerColumns,
    slack_px: float,
    wide: bool,
    settings: Settings,
    again: bool,
) -> int:
    """Let every edge without a corner choose; return how many did.

    They search near L', or, if ``wide``, farther around L. ``again``: only those that found something before.
    """
    for k in range(corners.count):
        corners.edge[k] = -1
    choosing = 0
    for i in range(edges.count):
        nothing_there = again and edges.best[i] < 0
        edges.best[i] = -1
        if edges.corner[i] >= 0 or edges.held[i] or nothing_there or (wide and edges.own_way(i)):
            continue
        x = edges.x[i] if wide else edges.predicted_x[i]
        y = edges.y[i] if wide else edges.predicted_y[i]
        if not image_plane.project(plane, x, y):
            continue
        most = likeness_needed(contrast(edges, i), settings) * (WIDE_LIKENESS if wide else 1.0)
        gate = gate_px(edges, i, slack_px, wide, settings)
        choose(index, edges, i, corners, plane.u, plane.v, gate, most)
        choosing += 1
    return choosing


def take_mutual(edges: EdgeColumns, corners: CornerColumns) -> int:
    """Match the pairs that chose each other, whose corners are then no longer free; return how many."""
    pairs = 0
    for i in range(edges.count):
        corner = edges.best[i]
        if corner >= 0 and corners.edge[corner] == i:
            edges.corner[i] = corner
            edges.best[i] = -1
            corners.free[corner] = 0
            pairs += 1
    return pairs


def look(
    index: CornerIndex,
    plane: ImagePlane,
    edges: EdgeColumns,
    corners: CornerColumns,
    slack_px: float,
    wide: bool,
    settings: Settings,
) -> int:
    """Rounds of mutual best choice, near L', or, if ``wide``, farther around L; return the number of pairs."""
    pairs = 0
    for turn in range(ROUNDS):
        if not choose_all(index, plane, edges, corners, slack_px, wide, settings, turn > 0):
            break
        pairs += take_mutual(edges, corners)
    return pairs


def find(
    index: CornerIndex,
    plane: ImagePlane,
    edges: EdgeColumns,
    corners: CornerColumns,
    slack_px: float,
    settings: Settings,
) -> int:
    """Match edges and corners: first near L', then, for the rest, near L.

    Sets ``edges.corner``; returns the number of pairs. ``slack_px``: uncertainty of the camera's rotation.
    """
    for i in range(edges.count):
        edges.corner[i] = -1
    pairs = look(index, plane, edges, corners, slack_px, False, settings)
    return pairs + look(index, plane, edges, corners, slack_px, True, settings)
