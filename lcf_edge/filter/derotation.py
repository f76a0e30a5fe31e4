"""Step 0: takes the camera's rotation out of all stored positions; the flow shows what the gyro missed.

Between two rotations that differ by more than the gates, the corners decide (``found_share``).
"""

import math

from lcf_edge.filter import flow, image_plane, least_squares, matching
from lcf_edge.filter.columns import CircleColumns, CornerColumns, EdgeColumns, PsiColumns
from lcf_edge.filter.flow import Homography, Pinhole
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.least_squares import NormalEquations
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.memory import doubles, integers
from lcf_edge.filter.settings import Settings

CORNER_SIGMA_PX = 0.7  # 1 sigma of a corner against its prediction
MIN_EDGES = 25  # for a correction of the rotation
MAX_EDGES = 200
ROUNDS = 3
WEAK_RAD = 1.0  # prior of the rotation by the flow alone
SCATTER = 0.17  # of edges with ordinary corner noise, see ``weigh``
MIN_SIGMA_PX = 0.15  # error common to all corners of a frame
MIN_SOUGHT = 15  # trusted edges in the image, to tell what share of them a rotation finds again
FOUND_PX = 6.0  # around where an edge must be then


def derotate_edges(edges: EdgeColumns, h: Homography, roll: float) -> None:
    """Apply H = K·R·K⁻¹ to all positions of the edges, also L'; β of rebels and chains turns too. ``roll``: rad."""
    for i in range(edges.count):
        flow.warp(h, edges.x[i], edges.y[i])
        edges.x[i], edges.y[i] = h.x, h.y
        flow.warp(h, edges.predicted_x[i], edges.predicted_y[i])
        edges.predicted_x[i], edges.predicted_y[i] = h.x, h.y
        if edges.own_way(i):
            flow.warp(h, edges.origin_x[i], edges.origin_y[i])
            edges.origin_x[i], edges.origin_y[i] = h.x, h.y
            edges.beta[i] += roll


def derotate_circles(circles: CircleColumns, h: Homography, roll: float) -> None:
    """Apply H = K·R·K⁻¹ to the centres of circles; their β turns with the image."""
    for c in range(circles.capacity):
        if circles.active[c]:
            flow.warp(h, circles.x[c], circles.y[c])
            circles.x[c], circles.y[c] = h.x, h.y
            circles.beta[c] += roll


def derotate_psi(psi: PsiColumns, h: Homography) -> None:
    """Apply H = K·R·K⁻¹ to the centres of ψ."""
    for p in range(psi.capacity):
        if psi.active[p]:
            flow.warp(h, psi.x[p], psi.y[p])
            psi.x[p], psi.y[p] = h.x, h.y


class OffLine:
    """Edges off their flow lines, which show the rotation that the gyro missed; one row each, at most ``MAX_EDGES``.

    ``row``: of the table of edges. ``pitch``, ``yaw``, ``roll``: px across the flow line for 1 rad about x, y and z;
    ``px``: distance from it. The solution: ``turn_x``, ``turn_y``, ``turn_z`` and ``sigma``, rad. ``alone``,
    ``alone_sigma``: (3,), the same rotation by the flow alone, without the gyro's prior, and its 1 sigma.
    """

    def __init__(self) -> None:
        self.count = 0
        self.row = integers(MAX_EDGES)
        self.pitch, self.yaw, self.roll, self.px = [doubles(MAX_EDGES) for _ in range(4)]
        self.turn_x = self.turn_y = self.turn_z = self.sigma = 0.0
        self.alone, self.alone_sigma = [doubles(3) for _ in range(2)]
        self.equations = NormalEquations()


def shows_rotation(edges: EdgeColumns, i: int, tr_s: float) -> bool:
    """Whether an edge may measure the rotation: trusted, normal, found."""
    return edges.corner[i] >= 0 and edges.trust[i] >= tr_s and not edges.own_way(i)


def measure_off_line(
    off: OffLine, edges: EdgeColumns, corners: CornerColumns, pinhole: Pinhole, settings: Settings
) -> bool:
    """Measure the distances of trusted normal edges from their flow lines, which do not depend on depth.

    Return whether there are enough of them.
    """
    off.count = 0
    telling = 0
    for i in range(edges.count):
        if shows_rotation(edges, i, settings.tr_s):
            telling += 1
    if telling < MIN_EDGES:
        return False
    stride = 1 + telling // MAX_EDGES
    telling = 0
    for i in range(edges.count):
        if shows_rotation(edges, i, settings.tr_s):
            if telling % stride == 0:
                off_line(off, edges, i, corners, pinhole)
            telling += 1
    return True


def off_line(off: OffLine, edges: EdgeColumns, i: int, corners: CornerColumns, pinhole: Pinhole) -> None:
    """Add one edge: its distance from the flow line, and the derivative of that by a small rotation, px/rad."""
    k, corner = off.count, edges.corner[i]
    off.row[k] = i
    x, y, cos, sin = corners.x[corner], corners.y[corner], edges.cos[i], edges.sin[i]
    u, v = (x - pinhole.cx) / pinhole.fx, (y - pinhole.cy) / pinhole.fy
    off.pitch[k] = pinhole.focal * (sin * u * v - cos * (1 + v * v))
    off.yaw[k] = pinhole.focal * (cos * u * v - sin * (1 + u * u))
    off.roll[k] = pinhole.focal * (sin * v + cos * u)
    off.px[k] = flow.line_distance(x - edges.predicted_x[i], y - edges.predicted_y[i], cos, sin)
    off.count += 1


def missing_rotation(off: OffLine, focal: float, prior_sigma_rad: float) -> None:
    """Solve for the small rotation that puts edges back on their flow lines, and its uncertainty.

    Least squares, robust against movers, with the gyro's uncertainty as prior: (Σ w·aᵀa + prior)·turn = Σ w·a·px,
    a = (pitch, yaw, roll) of an edge, w = 1/(1 + (rest/2σ)²)². The sigma of the flow alone grows with the scatter of
    the edges.
    """
    prior = CORNER_SIGMA_PX / prior_sigma_rad
    prior = prior * prior
    off.turn_x = off.turn_y = off.turn_z = 0.0
    scatter = 0.0
    for _ in range(ROUNDS):
        scatter = weigh(off, prior)
        least_squares.solve(off.equations)
        off.turn_x, off.turn_y = off.equations.solution[0], off.equations.solution[1]
        off.turn_z = off.equations.solution[2]
    weak = CORNER_SIGMA_PX / WEAK_RAD
    for i in range(3):
        off.equations.matrix[i, i] += weak * weak - prior
    least_squares.solve(off.equations)
    for i in range(3):
        off.alone[i] = off.equations.solution[i]
    least_squares.invert(off.equations)
    inflation = max(1.0, scatter / SCATTER)
    shared = MIN_SIGMA_PX / focal
    for i in range(3):
        variance = CORNER_SIGMA_PX * CORNER_SIGMA_PX * off.equations.inverse[i, i] + shared * shared
        off.alone_sigma[i] = inflation * inflation * math.sqrt(variance)
        off.equations.matrix[i, i] += prior - weak * weak
    least_squares.factorise(off.equations)
    least_squares.invert(off.equations)
    off.sigma = CORNER_SIGMA_PX * math.sqrt(max(off.equations.inverse[0, 0], off.equations.inverse[1, 1]))


def weigh(off: OffLine, prior: float) -> float:
    """Add all edges to the normal equations, weighted by their residuals after the rotation so far.

    Return the mean of q/(1 + q), q = (rest/2σ)²: their scatter.
    """
    scatter = 0.0
    least_squares.begin(off.equations, 3)
    for i in range(3):
        least_squares.add_prior(off.equations, i, prior)
    for k in range(off.count):
        a, b, c, px = off.pitch[k], off.yaw[k], off.roll[k], off.px[k]
        rest = (px - (off.turn_x * a + off.turn_y * b + off.turn_z * c)) * (0.5 / CORNER_SIGMA_PX)
        outlying = 1 + rest * rest
        off.equations.row[0], off.equations.row[1], off.equations.row[2] = a, b, c
        least_squares.add(off.equations, 1 / (outlying * outlying), px)
        scatter += 1 - 1 / outlying
    return scatter / max(off.count, 1)


def found_share(
    index: CornerIndex,
    plane: ImagePlane,
    edges: EdgeColumns,
    corners: CornerColumns,
    h: Homography,
    dt_s: float,
    settings: Settings,
) -> float:
    """Share of the trusted normal edges found again if H = K·R·K⁻¹ is the camera's rotation; 0: too few edges.

    Of the edges found in the last frame, found now are those with a corner like them within ``FOUND_PX`` of where H and
    V put them.
    """
    sought, found = 0, 0
    for i in range(edges.count):
        if not shows_rotation(edges, i, settings.tr_s):
            continue
        way = edges.speed[i] * dt_s
        flow.warp(h, edges.x[i] + way * edges.cos[i], edges.y[i] + way * edges.sin[i])
        if not image_plane.project(plane, h.x, h.y):
            continue
        sought += 1
        most = matching.likeness_needed(matching.contrast(edges, i), settings)
        for k in range(matching.list_near(index, corners, plane.u, plane.v, FOUND_PX)):
            if matching.difference(edges, i, index, index.listed[k]) < most:
                found += 1
                break
    return found * 1.0 / sought if sought >= MIN_SOUGHT else 0.0
