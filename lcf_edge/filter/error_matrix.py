"""The error matrix: variances of an edge's place and speed, and of its motion since a key frame.

Along its direction an edge has place and speed, whose covariance is propagated by the gains with which a corner
corrects them (eq. EnEstimation); across it has a place alone. Its motion since a key frame is uncertain by its place
then and now, by the rotation since, and by the focus of expansion.
"""

import math

from lcf_edge.filter import baselines as lines
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.situation import Situation

MAX_FOCUS_SHARE = 0.5  # of an error of the focus, that shows in the motion of an edge; near the focus μ is unbounded


class MotionError:
    """Covariance of an edge's motion since a key frame, image axes, px²: ``xx``, ``xy``, ``yy``."""

    def __init__(self) -> None:
        self.xx = self.xy = self.yy = 0.0


def start(edges: EdgeColumns, i: int, corner_var: float, speed_var: float) -> None:
    """An edge is where a corner was found. ``corner_var``: px². ``speed_var``: of its V, (px/s)²."""
    edges.variance_along[i] = edges.variance_across[i] = corner_var
    edges.covariance_speed[i], edges.variance_speed[i] = 0.0, speed_var


def predict(edges: EdgeColumns, i: int, dt_s: float) -> None:
    """L' = L + V·t_f. An error of the rotation shifts all edges alike, and is found with them: ``of_rotation``."""
    turned = edges.covariance_speed[i] + dt_s * edges.variance_speed[i]
    edges.variance_along[i] += dt_s * (edges.covariance_speed[i] + turned)
    edges.covariance_speed[i] = turned


def correct(edges: EdgeColumns, i: int, share: float, corner_var: float, dt_s: float) -> None:
    """L and V take ``share`` of the way from L' to the corner, and of that over t_f."""
    left, per_s = 1 - share, share / dt_s
    along, mixed = edges.variance_along[i], edges.covariance_speed[i]
    edges.variance_along[i] = left * left * along + share * share * corner_var
    edges.covariance_speed[i] = left * (mixed - per_s * along) + share * per_s * corner_var
    edges.variance_speed[i] += per_s * (per_s * (along + corner_var) - 2 * mixed)
    edges.variance_across[i] = left * left * edges.variance_across[i] + share * share * corner_var


def of_rotation(
    error: MotionError,
    baselines: Baselines,
    edges: EdgeColumns,
    i: int,
    slot: int,
    x: float,
    y: float,
    around: Situation,
) -> None:
    """By the rotation since the key frame in ``slot``, at which an edge was at (x, y), px, derotated to now.

    By the key frame's own rotation, by the rate that all share, and by a share of the turn.
    """
    own = baselines.sigma_px[slot]
    error.xx = error.yy = own * own
    error.xy = 0.0
    if baselines.is_fitted:
        add_rate(error, baselines, slot, x, y, around)
    across, down = around.turn_share * (x - edges.key_x[i, slot]), around.turn_share * (y - edges.key_y[i, slot])
    error.xx += across * across
    error.xy += across * down
    error.yy += down * down


def add_rate(error: MotionError, baselines: Baselines, slot: int, x: float, y: float, around: Situation) -> None:
    """By the rotation rate, which all key frames share: J·Σ·Jᵀ, J: image motion for 1 rad about each axis."""
    time2 = baselines.elapsed_s[slot] * baselines.elapsed_s[slot]
    for i in range(3):
        baselines.turned_x[i] = lines.turn_px(around.pinhole, i, x, y, 1.0, 0.0)
        baselines.turned_y[i] = lines.turn_px(around.pinhole, i, x, y, 0.0, 1.0)
    for i in range(3):
        for j in range(3):
            covariance = time2 * baselines.rate_covariance[i, j]
            error.xx += baselines.turned_x[i] * covariance * baselines.turned_x[j]
            error.xy += baselines.turned_x[i] * covariance * baselines.turned_y[j]
            error.yy += baselines.turned_y[i] * covariance * baselines.turned_y[j]


def add_places(error: MotionError, edges: EdgeColumns, i: int, around: Situation) -> float:
    """By an edge's place now, and then, when it was not known better than its corner.

    Return the part of that in one direction, 1 sigma, px.
    """
    along = around.excess * (edges.variance_along[i] + around.corner_var)
    across = around.excess * (edges.variance_across[i] + around.corner_var)
    cos, sin = edges.cos[i], edges.sin[i]
    error.xx += across + cos * cos * (along - across)
    error.xy += cos * sin * (along - across)
    error.yy += across + sin * sin * (along - across)
    return math.sqrt(0.5 * (along + across))


def add_focus(error: MotionError, mu: float, cos: float, sin: float, around: Situation) -> float:
    """By the focus of expansion, from which an edge has moved by a share μ of its distance.

    Nothing stationary goes towards it: there, it moves by none. Return the part in the direction (cos, sin) that lasts,
    px²: the heading shakes, which key frames see differently.
    """
    share = min(max(mu, 0.0), MAX_FOCUS_SHARE)
    error.xx += share * share * around.focus_var_x
    error.yy += share * share * around.focus_var_y
    return share * share * (cos * cos * around.lasting_var_x + sin * sin * around.lasting_var_y)


def variance(error: MotionError, cos: float, sin: float) -> float:
    """In a direction, px²."""
    return max(cos * cos * error.xx + 2 * cos * sin * error.xy + sin * sin * error.yy, 0.0)
