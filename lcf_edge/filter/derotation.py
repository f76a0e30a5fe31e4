"""Step 0: the camera's rotation is taken out of all that is stored; what the gyro missed, the flow tells."""

import math
from dataclasses import dataclass

import numpy as np

from lcf_edge.filter.flow import Matrix, Pinhole, carry
from lcf_edge.filter.tables import CircleTable, EdgeTable, Floats, PsiTable

CORNER_SIGMA_PX = 0.7  # 1 sigma of a corner against its prediction
LEAST_EDGES = 25  # that a correction of the rotation needs
MOST_EDGES = 200  # and that are enough
_ROUNDS = 3
_WEAK_RAD = 1.0  # prior for what the flow alone tells
_SCATTER = 0.17  # mean of q/(1 + q) over edges, q = (distance/2σ)², when they lie as corners should
_LEAST_SIGMA_PX = 0.15  # errors that corners of one frame share


@dataclass(frozen=True, slots=True)
class Residual:
    """The rotation that the flow alone shows to be missing, without the gyro's prior.

    ``turn_rad``: rotation vector (3,) of directions, as in ``Motion.rotation``; ``sigma_rad``: (3,), 1 sigma.
    """

    turn_rad: Matrix
    sigma_rad: Matrix


def derotate(
    pinhole: Pinhole,
    rotation: Matrix,
    edges: EdgeTable,
    circles: tuple[CircleTable, CircleTable],
    psi: PsiTable,
) -> None:
    """H = K·R·K⁻¹ on every stored image position; own directions turn with the picture."""
    h = pinhole.homography(rotation)
    n = edges.count
    roll = np.float32(math.atan2(rotation[1, 0], rotation[0, 0]))
    turned = edges.own_way().nonzero()[0]
    origin_x, origin_y = edges.origin_x.take(turned), edges.origin_y.take(turned)
    places = [(edges.x[:n], edges.y[:n]), (origin_x, origin_y)]
    places += [(table.x, table.y) for table in (*circles, psi)]
    x, y = carry(h, np.concatenate([x for x, _ in places]), np.concatenate([y for _, y in places]))
    start = 0
    for to_x, to_y in places:
        stop = start + len(to_x)
        to_x[:], to_y[:] = x[start:stop], y[start:stop]
        start = stop
    edges.origin_x[turned], edges.origin_y[turned] = origin_x, origin_y
    edges.beta[turned] += roll
    for table in circles:
        table.beta += roll


def missing_rotation(
    pinhole: Pinhole, x: Floats, y: Floats, off_px: Floats, cos: Floats, sin: Floats, prior_sigma_rad: float
) -> tuple[Matrix, float, Residual]:
    """The small rotation that puts edges back on their flow lines; and what stays uncertain of it, rad.

    ``x``, ``y``: corners, float32 (n,) px. ``off_px``: their distances from the flow lines (``line_distance``), which
    do not depend on depth. ``cos``, ``sin``: of β. Least squares, robust against what moves, with the
    gyro's uncertainty as prior. Return a first-order rotation (3, 3), as in ``Motion.rotation``, its sigma, and what
    the flow tells by itself; that is the less certain the more the edges scatter.
    """
    focal = np.float32(pinhole.focal)
    u = (x - np.float32(pinhole.cx)) * np.float32(1 / pinhole.fx)
    v = (y - np.float32(pinhole.cy)) * np.float32(1 / pinhole.fy)
    uv = u * v
    # px across the line for a rotation of 1 rad about x, y and z
    across = np.empty((3, len(x)), np.float32)
    across[0] = sin * uv - cos * (1 + v * v)
    across[1] = cos * uv - sin * (1 + u * u)
    across[2] = sin * v + cos * u
    across *= focal
    prior = np.eye(3) * (CORNER_SIGMA_PX / prior_sigma_rad) ** 2
    turn: Matrix = np.zeros(3)
    pull = turn
    information, outlying = prior, np.ones(len(x), np.float32)
    for _ in range(_ROUNDS):
        rest = off_px - turn.astype(np.float32) @ across
        rest *= np.float32(0.5 / CORNER_SIGMA_PX)
        outlying = 1 + rest * rest
        weighted = across / (outlying * outlying)
        information = (weighted @ across.T).astype(np.float64) + prior
        pull = (weighted @ off_px).astype(np.float64)
        turn = np.linalg.solve(information, pull).astype(np.float64)
    a, b, c = turn
    sigma = CORNER_SIGMA_PX * math.sqrt(np.diag(np.linalg.inv(information))[:2].max())  # of pitch and yaw
    alone = np.linalg.inv(information - prior + np.eye(3) * (CORNER_SIGMA_PX / _WEAK_RAD) ** 2)
    scatter = max(1.0, float(1 - np.mean(1 / outlying)) / _SCATTER) ** 2
    alone_sigma = scatter * np.hypot(CORNER_SIGMA_PX * np.sqrt(np.diag(alone)), _LEAST_SIGMA_PX / pinhole.focal)
    residual = Residual(alone @ pull, alone_sigma)
    return np.array([[1, -c, b], [c, 1, -a], [-b, a, 1]]), sigma, residual
