"""The equations of the Circle expert for edges: predict, classify (λ*1 to λ*5), update; numbers in, numbers out."""

import math

from lcf_edge.filter import flow

CORNER_NOISE_PX = 0.7  # a shorter displacement has no direction
MAX_DEVIATION_RAD = 0.5  # bound of DL

# λ*: how a corner relates to an estimated edge (section Edge Classifications)
BEYOND = 1  # outside the gate, but within the error span
FOLLOWS = 2  # in the gate, on the line, as predicted
DISAGREES = 3  # in the gate, on the line, but not in speed or direction
BREAKS = 4  # off the line
STAYS = 5  # near where the edge was, on the line

UNMATCHED = -1.0  # change of Tr of an edge without a corner


def trust_change(relation: int) -> float:
    """Change of Tr for λ*1 to λ*5."""
    if relation == FOLLOWS:
        return 1.0
    return 0.0 if relation == BREAKS else -1.0


def predict_speed(speed: float, expected_speed: float) -> float:
    """V' = ½(V + expected V) (section Edge Classifications, below eq. of E_n)."""
    return 0.5 * (speed + expected_speed)


def predict_place(place: float, speed: float, direction: float, dt_s: float) -> float:
    """L' = L + V'·t_f along β, for one coordinate, px. ``direction``: cos β or sin β."""
    return place + speed * dt_s * direction


def classify(
    moved_x: float,
    moved_y: float,
    ahead_x: float,
    ahead_y: float,
    cos: float,
    sin: float,
    speed: float,
    bl: float,
    delta_px: float,
    eps_beta_rad: float,
) -> int:
    """λ* of an edge and its corner, tested in the order 2, 3, 5, 1, 4, since λ*5 is a special case of λ*1.

    ``moved``: from L, where the edge was (derotated), to the corner, px. ``ahead``: from L' to the corner, px.
    ``speed``: V'. ``bl``: BL, px. ``delta_px``: δ. Speed agrees when the corner lies within BL/2 of L' along the line,
    direction when the corner moved along the flow within ``eps_beta_rad`` (displacements below corner noise have no
    direction).
    """
    if math.fabs(moved_y * cos - moved_x * sin) > delta_px:
        return BREAKS
    moved2 = moved_x * moved_x + moved_y * moved_y
    if ahead_x * ahead_x + ahead_y * ahead_y > bl * bl:
        return STAYS if moved2 <= bl * bl else BEYOND
    noise = max(CORNER_NOISE_PX, delta_px)
    onwards = moved_x * cos + moved_y * sin
    if speed < 0:
        onwards = -onwards
    if onwards < math.cos(eps_beta_rad) * math.sqrt(moved2) and moved2 > 4 * noise * noise:
        return DISAGREES
    if math.fabs(ahead_x * cos + ahead_y * sin) > max(0.5 * bl, noise):
        return DISAGREES
    return FOLLOWS


def update_position(trust: float, tr_cr: float, predicted: float, measured: float) -> float:
    """L = ((Tr - Tr_cr)·L' + L_edge) / ((Tr - Tr_cr) + 1) (eq. EnEstimation, first line), for one coordinate, px."""
    weight = max(trust - tr_cr, 0.0)
    return (weight * predicted + measured) / (weight + 1)


def share_of_corner(trust: float, tr_cr: float) -> float:
    """Share of the way from L' to its corner that an edge takes: 1 / ((Tr - Tr_cr) + 1)."""
    return 1 / (max(trust - tr_cr, 0.0) + 1)


def update_speed(trust: float, tr_cr: float, speed: float, along: float, dt_s: float) -> float:
    """V = V' ± distance/t_f, plus when the corner lies beyond L' along the line (eq. EnEstimation, second line).

    ``along``: px from L' to the corner along the line. The printed equation squares pixels and starts from V_ν; the
    residual along the line over t_f has the unit of a speed. It is weighted as the corner is in L,
    1/((Tr - Tr_cr) + 1): unweighted, V would have the corner noise of one frame divided by t_f.
    """
    return speed + along / (dt_s * (max(trust - tr_cr, 0.0) + 1))


def update_gate(
    bl: float, speed: float, predicted_speed: float, corr: float, dt_s: float, min_px: float, max_px: float
) -> float:
    """BL = ½(|V' - V|·t_f / Corr + BL) (eq. EnEstimation, third line), within [``min_px``, ``max_px``]."""
    target = math.fabs(predicted_speed - speed) * dt_s / corr
    return min(max(0.5 * (target + bl), min_px), max_px)


def update_deviation(deviation: float, turn: float) -> float:
    """DL follows the turn of β (eq. of DL), rad; ``turn``: Δβ.

    As printed, DL(k) = DL(k-1) - [Δβ - DL(k-1)], an error in DL doubles at every step; with the bracket's sign reversed
    and weighted by one half, the error halves.
    """
    return flow.wrap(deviation + 0.5 * flow.wrap(flow.wrap(turn) - deviation))


def bound_deviation(deviation: float) -> float:
    """Clamp DL to ±``MAX_DEVIATION_RAD``."""
    return min(max(deviation, -MAX_DEVIATION_RAD), MAX_DEVIATION_RAD)


def change_trust(trust: float, change: float, tr_max: float) -> float:
    """Tr + change, at most Tr_max."""
    return min(trust + change, tr_max)
