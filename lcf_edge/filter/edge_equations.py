"""The equations of the Circle expert for edges: predict, classify (λ*1 to λ*5), update; whole arrays, no state."""

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from lcf_edge.filter.flow import line_distance, wrap
from lcf_edge.filter.tables import Floats, Rows

CORNER_NOISE_PX = 0.7  # below this a displacement has no direction


class Relation(IntEnum):
    """λ*: how a corner relates to an estimated edge (section Edge Classifications)."""

    BEYOND = 1  # outside the gate, but within the error span
    FOLLOWS = 2  # in the gate, on the line, as predicted
    DISAGREES = 3  # in the gate, on the line, but not in speed or direction
    BREAKS = 4  # off the line
    STAYS = 5  # near where the edge was, on the line


TRUST_CHANGE = np.array([0, -1, +1, -1, 0, -1], np.float32)
"""Change of Tr for λ*1 to λ*5; index 0 is unused (no match is -1 as well, see ``UNMATCHED``)."""

UNMATCHED = np.float32(-1)


@dataclass(frozen=True, slots=True)
class Estimate:
    """Predicted edges E'; float32 (n,): L' (``x``, ``y``, px), V' (``speed``, px/s), and the direction taken (``cos``,
    ``sin`` of β)."""

    x: Floats
    y: Floats
    speed: Floats
    cos: Floats
    sin: Floats

    def take(self, rows: Rows) -> "Estimate":
        """Some of them."""
        return Estimate(*(column.take(rows) for column in (self.x, self.y, self.speed, self.cos, self.sin)))


def predict(
    x: Floats, y: Floats, cos: Floats, sin: Floats, speed: Floats, expected_speed: Floats, dt_s: float
) -> Estimate:
    """L' = L + V'·t_f along β; V' = ½(V + expected V) (section Edge Classifications, below eq. of E_n)."""
    halfway = np.float32(0.5) * (speed + expected_speed)
    step = halfway * np.float32(dt_s)
    return Estimate(x + step * cos, y + step * sin, halfway, cos, sin)


def classify(
    x: Floats,
    y: Floats,
    estimate: Estimate,
    corner_x: Floats,
    corner_y: Floats,
    bl: Floats,
    delta_px: float,
    eps_beta_rad: float,
) -> npt.NDArray[np.int8]:
    """λ* class of each pair of an edge and a corner, int8 (n,), in the order 2, 3, 5, 1, 4: λ*5
    is a part of λ*1 and would never come after it.

    ``x``, ``y``: L, where the edge was (derotated), px. ``bl``: BL, px. All float32 (n,). ``delta_px``: δ.
    Speed agrees when the corner lies within half of BL of L' along the line, direction when the corner moved along
    the flow within ``eps_beta_rad`` (displacements below corner noise have none).
    """
    cos, sin = estimate.cos, estimate.sin
    ahead_x, ahead_y = corner_x - estimate.x, corner_y - estimate.y
    moved_x, moved_y = corner_x - x, corner_y - y
    bl2 = bl * bl
    in_gate = ahead_x * ahead_x + ahead_y * ahead_y <= bl2
    moved2 = moved_x * moved_x + moved_y * moved_y
    on_line = np.abs(line_distance(moved_x, moved_y, cos, sin)) <= np.float32(delta_px)
    onwards = moved_x * cos + moved_y * sin
    onwards = np.where(estimate.speed < 0, -onwards, onwards)
    noise = np.float32(max(CORNER_NOISE_PX, delta_px))
    agrees = onwards >= np.float32(math.cos(eps_beta_rad)) * np.sqrt(moved2)
    agrees |= moved2 <= 4 * noise * noise
    agrees &= np.abs(ahead_x * cos + ahead_y * sin) <= np.maximum(np.float32(0.5) * bl, noise)
    relation = np.full(len(x), Relation.BREAKS, np.int8)
    relation[on_line] = Relation.BEYOND
    relation[on_line & (moved2 <= bl2)] = Relation.STAYS
    on_line &= in_gate
    relation[on_line] = Relation.DISAGREES
    relation[on_line & agrees] = Relation.FOLLOWS
    return relation


def update_position(trust: Floats, tr_cr: float, predicted: Floats, measured: Floats) -> Floats:
    """L = ((Tr - Tr_cr)·L' + L_edge) / ((Tr - Tr_cr) + 1) (eq. EnEstimation, first line); any coordinate, px."""
    weight = np.maximum(trust - np.float32(tr_cr), 0)
    return np.asarray((weight * predicted + measured) / (weight + 1))


def update_speed(
    trust: Floats, tr_cr: float, estimate: Estimate, corner_x: Floats, corner_y: Floats, dt_s: float
) -> Floats:
    """V = V' ± distance/t_f, plus when the corner lies beyond L' along the line (eq. EnEstimation, second line).

    The printed equation squares pixels and starts from V_ν; the residual along the line has the unit of a speed. It
    enters with the weight that the corner has in L, 1/((Tr - Tr_cr) + 1): with its full weight the corner noise of
    one frame, divided by t_f, would be the noise of V.
    """
    along = (corner_x - estimate.x) * estimate.cos + (corner_y - estimate.y) * estimate.sin
    weight = np.maximum(trust - np.float32(tr_cr), 0) + 1
    return np.asarray(estimate.speed + along / (np.float32(dt_s) * weight))


def update_gate(
    bl: Floats,
    speed: Floats,
    estimate_speed: Floats,
    corr: Floats,
    dt_s: float,
    least_px: float,
    most_px: float,
) -> Floats:
    """BL = ½(|V' - V|·t_f / Corr + BL) (eq. EnEstimation, third line), kept within [least, most] px."""
    wanted = np.abs(estimate_speed - speed) * np.float32(dt_s) / corr
    return np.minimum(np.maximum(np.float32(0.5) * (wanted + bl), np.float32(least_px)), np.float32(most_px))


def update_deviation(deviation: Floats, beta: Floats, beta_before: Floats) -> Floats:
    """DL follows the turn of β (eq. of DL), rad.

    As printed, DL(k) = DL(k-1) - [Δβ - DL(k-1)], an error in DL doubles at every step; with the sign of the bracket
    turned and half its weight it halves.
    """
    return wrap(deviation + np.float32(0.5) * wrap(wrap(beta - beta_before) - deviation))


def change_trust(trust: Floats, change: Floats | np.float32, tr_max: float) -> Floats:
    """Tr + change, at most Tr_max."""
    return np.asarray(np.minimum(trust + change, np.float32(tr_max)))
