"""Errors of the camera's rotation and of O, fitted to all edges over the window of key frames.

The gyro's error in one frame hardly shows; over the window it does. A stationary edge that was seen t seconds ago, r px
from the focus, and has moved outward by μ·r since, lies off its flow line by

    drift = t·(a·ω) + μ·(sin β·ΔO_x - cos β·ΔO_y) + noise

with ω the error of the rotation rate, a the px across the flow for a rotation of 1 rad about each axis, and ΔO the
error of the focus. Least squares over edges from all over the image, robust against movers, gives ω and ΔO with their
covariance; a second fit gives each key frame seen by enough edges a rotation of its own, which it keeps when those
edges are gone. The residuals after that (``scale_px``) are the noise that edges are judged by. How a turn moves the
image depends on the lens; where that is guessed, the residuals grow with the motion by the turn, by a learnt share of
it (``turn_share``).
"""

import math

from lcf_edge.filter import baselines as lines
from lcf_edge.filter import flow, key_frames, least_squares, lengths, rounding, situation
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.inputs import KEYS
from lcf_edge.filter.key_frames import KeyFrames
from lcf_edge.filter.least_squares import NormalEquations
from lcf_edge.filter.memory import doubles, integers
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation

MIN_EDGES = 15
MAX_EDGES = 320
MIN_ELAPSED_S = 0.15  # shorter histories show nothing
MIN_R_PX = 6.0  # nearer to the focus there is no flow line
TURN_SHARE = 0.03  # error of the image motion by a turn, as a share of it, before it is learnt
TURN_MEMORY_S = 2.0  # time constant of learning it
MIN_TURN_PX = 4.0  # image motion by a turn that an edge needs to show that,
MIN_TURNED = 12  # and edges that need it
COLUMNS = 8  # cells of the image, whose edges count for no more than ``CELL_EDGES`` each
ROWS = 6
CELL_EDGES = 6.0
SCALE_CELL_EDGES = 16.0  # and for the noise than this: a near body full of corners moves by itself
NOISE_MEMORY_S = 1.0  # time constant of learning the noise of corners,
MAX_EXCESS = 4.0  # and of its variance the most that one image says
NOISE_PX = 0.6  # 1 sigma of the drift of a stationary edge
RATE_SIGMA_RADPS = 0.03  # least prior sigma of ω over a window of ``WINDOW_S``, less over longer ones
WINDOW_S = 0.75
ROUNDS = 8
NARROWING = 0.7  # factor of the outlier width from round to round,
MIN_WIDTH_PX = 0.7  # its minimum,
FIRST_WIDTH = 3.0  # and its start, in median drifts
SLOT_EDGES = 10  # edges for a key frame's own rotation,
UNSURE_SLOT_EDGES = 5  # and where the gyro's bias leaves that uncertain by more than
UNSURE_PX = 2.0
UNSURE_SIGMAS = 2.0  # of that uncertainty, the outlier width to begin with
SLOT_ROUNDS = 4
SLOT_WIDTH_PX = 1.0  # outlier width in the end,
SLOT_NARROWING = 0.5  # and its factor from round to round
SLOT_SHARE = 0.3  # prior sigma of a key frame's own rotation, as a share of that of ω,
SLOT_SIGMA_RAD = 0.002  # plus this
DOUBTED_PX = 1.5  # image motion by it from which older edges are asked
SCALE_SHARE = 0.35  # quantile of the residuals that gives the scale: movers do not reach it;
SCALE_SIGMAS = 0.4538  # of a normal distribution it lies at this many sigmas
BINS = 256  # of the histogram of residuals,
BIN_PX = 0.05  # and their width
UNKNOWNS = 5
FOCUS_X = 3
FOCUS_Y = 4


class FlowFit:
    """The fit of one frame.

    ``count``: edges used, 0: too few for a fit. ``focus_x``, ``focus_y``: ΔO, px; ``focus_sigma_x``, ``focus_sigma_y``:
    1 sigma of it, and before the fit ``prior_x``, ``prior_y``. ``turn_share``: 1 sigma of the image motion by a turn,
    as a share of it, learnt from frame to frame. ``scale_px``: 1 sigma of the residuals apart from that;
    ``place_var``: their mean variance by the edges' places, px².

    One row per edge: ``drift``, px; ``turned``: image motion across the flow by the turn, px; ``pitch``, ``yaw``,
    ``roll``: a; ``elapsed_s``; ``on_x``, ``on_y``: derivative of the drift by ΔO; ``share``: weight by its cell;
    ``slot``; ``cell``; ``rest``: residual, px; ``row``: of the table of edges.
    """

    def __init__(self) -> None:
        self.count = 0
        self.focus_x = self.focus_y = self.scale_px = self.place_var = 0.0
        self.focus_sigma_x = self.focus_sigma_y = self.prior_x = self.prior_y = 0.0
        rows = MAX_EDGES + 1  # the last to try
        self.drift, self.pitch, self.yaw, self.roll = [doubles(rows) for _ in range(4)]
        self.elapsed_s, self.on_x, self.on_y, self.share = [doubles(rows) for _ in range(4)]
        self.turned, self.rest = [doubles(rows) for _ in range(2)]
        self.turn_share = TURN_SHARE
        self.slot, self.cell, self.row = [integers(rows) for _ in range(3)]
        self.cells = integers(COLUMNS * ROWS)
        self.bins = doubles(BINS)
        self.equations = NormalEquations()


def shows_flow(edges: EdgeColumns, i: int, keys: KeyFrames, around: Situation, settings: Settings) -> bool:
    """Whether an edge shows the flow: found in this frame, trusted, and seen for long enough.

    Own parts do not; but from a vehicle at rest everything stationary looks like one.
    """
    return (
        edges.matched[i] != 0
        and edges.trust[i] >= settings.tr_new
        and (situation.is_at_rest(around) or not edges.is_own_part(i))
        and key_frames.has_history(edges, i, keys, MIN_ELAPSED_S)
    )


def gather(
    fit: FlowFit, edges: EdgeColumns, keys: KeyFrames, baselines: Baselines, around: Situation, settings: Settings
) -> None:
    """Gather the edges that show the flow, evenly thinned to at most ``MAX_EDGES``."""
    fit.count = 0
    telling, place_var = 0, 0.0
    for i in range(edges.count):
        if shows_flow(edges, i, keys, around, settings):
            telling += 1
    stride = 1 + telling // MAX_EDGES
    telling = 0
    for c in range(COLUMNS * ROWS):
        fit.cells[c] = 0
    for i in range(edges.count):
        if shows_flow(edges, i, keys, around, settings):
            if telling % stride == 0:
                note(fit, edges, i, key_frames.oldest_key(edges, i, keys) % KEYS, baselines, around.pinhole)
                place_var += edges.variance_across[i] + around.corner_var
            telling += 1
    for k in range(fit.count):
        fit.cells[fit.cell[k]] += 1
    for k in range(fit.count):
        fit.share[k] = min(1.0, CELL_EDGES / fit.cells[fit.cell[k]])
    fit.place_var = place_var * stride / max(telling, 1)


def note(fit: FlowFit, edges: EdgeColumns, i: int, slot: int, baselines: Baselines, pinhole: Pinhole) -> None:
    """Add edge ``i`` in the next row: its drift since the key frame in ``slot``, and its derivative by each unknown."""
    x = lines.then_x(baselines, slot, edges.key_x[i, slot], edges.key_y[i, slot])
    y = lines.then_y(baselines, slot, edges.key_x[i, slot], edges.key_y[i, slot])
    dx, dy = x - baselines.focus_x[slot], y - baselines.focus_y[slot]
    r = lengths.of(dx, dy)
    if r <= MIN_R_PX:
        return
    k = fit.count
    cos, sin = dx / r, dy / r
    moved_x, moved_y = edges.x[i] - x, edges.y[i] - y
    mu = (moved_x * cos + moved_y * sin) / r
    fit.drift[k] = flow.line_distance(moved_x, moved_y, cos, sin)
    turned_x, turned_y = x - edges.key_x[i, slot], y - edges.key_y[i, slot]
    fit.turned[k] = math.fabs(flow.line_distance(turned_x, turned_y, cos, sin))
    fit.pitch[k] = lines.turn_px(pinhole, 0, x, y, -sin, cos)
    fit.yaw[k] = lines.turn_px(pinhole, 1, x, y, -sin, cos)
    fit.roll[k] = lines.turn_px(pinhole, 2, x, y, -sin, cos)
    fit.elapsed_s[k], fit.slot[k], fit.row[k] = baselines.elapsed_s[slot], slot, i
    fit.on_x[k], fit.on_y[k] = mu * sin, -mu * cos
    column = min(max(0.5 * x / pinhole.cx * COLUMNS, 0.0), COLUMNS - 1.0)
    row = min(max(0.5 * y / pinhole.cy * ROWS, 0.0), ROWS - 1.0)
    fit.cell[k] = rounding.whole(row) * COLUMNS + rounding.whole(column)
    fit.count += 1


def shows_turn(fit: FlowFit, k: int) -> bool:
    """Whether a turn moved an edge by at least its residual: with a larger one it is a mover."""
    return fit.turned[k] >= max(MIN_TURN_PX, math.fabs(fit.rest[k]))


def quantile(fit: FlowFit, share: float, only_turned: bool, turn_share: float) -> float:
    """Quantile of |``rest``|, px, from a histogram; at most ``BINS``·``BIN_PX``.

    Over all edges or those that show a turn, each residual reduced by what ``turn_share`` explains of it. The edges of
    one cell count for no more than ``SCALE_CELL_EDGES``.
    """
    for b in range(BINS):
        fit.bins[b] = 0.0
    counted = 0.0
    for k in range(fit.count):
        if not only_turned or shows_turn(fit, k):
            more = turn_share * fit.turned[k] / NOISE_PX
            rest = math.fabs(fit.rest[k]) / math.sqrt(1 + more * more)
            one = min(1.0, SCALE_CELL_EDGES / fit.cells[fit.cell[k]])
            fit.bins[rounding.whole(min(rest / BIN_PX, BINS - 1.0))] += one
            counted += one
    rank = share * counted
    below = 0.0
    for b in range(BINS):
        if fit.bins[b] > 0 and below + fit.bins[b] >= rank:
            return BIN_PX * (b + (rank - below) / fit.bins[b])
        below += fit.bins[b]
    return BIN_PX * BINS


def weight_of(rest_px: float, width_px: float) -> float:
    """Weight of an edge by its residual (Geman and McClure): movers hardly count."""
    ratio = rest_px / width_px
    outlying = 1 + ratio * ratio
    return 1 / (outlying * outlying)


def set_row(fit: FlowFit, k: int) -> None:
    """Set the row of the normal equations for an edge."""
    t = fit.elapsed_s[k]
    fit.equations.row[0], fit.equations.row[1], fit.equations.row[2] = t * fit.pitch[k], t * fit.yaw[k], t * fit.roll[k]
    fit.equations.row[FOCUS_X], fit.equations.row[FOCUS_Y] = fit.on_x[k], fit.on_y[k]


def explained(fit: FlowFit) -> float:
    """Drift that the solution explains, of the edge whose row was set, px."""
    drift = 0.0
    for i in range(fit.equations.unknowns):
        drift += fit.equations.row[i] * fit.equations.solution[i]
    return drift


def rate_sigma(fit: FlowFit, baselines: Baselines, focal: float) -> float:
    """Prior sigma of ω, rad/s: by the gyro's accumulated uncertainty, with a lower bound."""
    longest, sigma = WINDOW_S, 0.0
    for k in range(fit.count):
        t = fit.elapsed_s[k]
        longest = max(longest, t)
        sigma = max(sigma, baselines.sigma_px[fit.slot[k]] / focal / t)
    return max(RATE_SIGMA_RADPS * WINDOW_S / longest, sigma)


def solve(fit: FlowFit, sigma_radps: float) -> None:
    """Solve for ω and ΔO by reweighted least squares; the outlier width narrows from round to round."""
    for k in range(fit.count):
        fit.rest[k] = fit.drift[k]
    width = max(1.0, FIRST_WIDTH * quantile(fit, 0.5, False, 0.0))
    for turn in range(ROUNDS):
        least_squares.begin(fit.equations, UNKNOWNS)
        for i in range(3):
            least_squares.add_prior(fit.equations, i, NOISE_PX * NOISE_PX / (sigma_radps * sigma_radps))
        least_squares.add_prior(fit.equations, FOCUS_X, NOISE_PX * NOISE_PX / (fit.prior_x * fit.prior_x))
        least_squares.add_prior(fit.equations, FOCUS_Y, NOISE_PX * NOISE_PX / (fit.prior_y * fit.prior_y))
        for k in range(fit.count):
            set_row(fit, k)
            if turn > 0:
                fit.rest[k] = fit.drift[k] - explained(fit)  # by the round before
            least_squares.add(fit.equations, fit.share[k] * weight_of(fit.rest[k], width), fit.drift[k])
        least_squares.solve(fit.equations)
        width = max(MIN_WIDTH_PX, NARROWING * width)
    for k in range(fit.count):
        set_row(fit, k)
        fit.rest[k] = fit.drift[k] - explained(fit)


def suits_older(fit: FlowFit, k: int, edges: EdgeColumns, baselines: Baselines, pinhole: Pinhole) -> bool:
    """Whether the solution, as key frame ``k``'s own rotation, suits most of the edges that are older than that, too.

    Those seen since then alone may all lie on one body that moves.
    """
    count, better, asked = fit.count, 0, 0
    for j in range(count):
        if fit.elapsed_s[j] > baselines.elapsed_s[k]:
            note(fit, edges, fit.row[j], k, baselines, pinhole)
            if fit.count > count:
                fit.count = count
                asked += 1
                turned = fit.equations.solution[0] * fit.pitch[count] + fit.equations.solution[1] * fit.yaw[count]
                turned += fit.equations.solution[2] * fit.roll[count]
                better += 1 if math.fabs(fit.drift[count] - turned) < math.fabs(fit.drift[count]) else -1
    return 2 * better >= -asked


def turn_slot(
    fit: FlowFit,
    k: int,
    edges: EdgeColumns,
    keys: KeyFrames,
    baselines: Baselines,
    pinhole: Pinhole,
    sigma_rad: float,
    width: float,
) -> None:
    """Fit key frame ``k``'s own rotation to the residuals, and keep it there. ``width``: first outlier width, px."""
    fit.equations.solution[0] = fit.equations.solution[1] = fit.equations.solution[2] = 0.0
    for _ in range(SLOT_ROUNDS):
        least_squares.begin(fit.equations, 3)
        for i in range(3):
            least_squares.add_prior(fit.equations, i, NOISE_PX * NOISE_PX / (sigma_rad * sigma_rad))
        turn_x, turn_y, turn_z = fit.equations.solution[0], fit.equations.solution[1], fit.equations.solution[2]
        for j in range(fit.count):
            if fit.slot[j] == k:
                fit.equations.row[0], fit.equations.row[1], fit.equations.row[2] = fit.pitch[j], fit.yaw[j], fit.roll[j]
                left = fit.rest[j] - (turn_x * fit.pitch[j] + turn_y * fit.yaw[j] + turn_z * fit.roll[j])
                least_squares.add(fit.equations, weight_of(left, width), fit.rest[j])
        least_squares.solve(fit.equations)
        width = max(SLOT_WIDTH_PX, SLOT_NARROWING * width)
    turn_x, turn_y, turn_z = fit.equations.solution[0], fit.equations.solution[1], fit.equations.solution[2]
    is_large = max(math.fabs(turn_x), math.fabs(turn_y)) * pinhole.focal > DOUBTED_PX
    if is_large and not suits_older(fit, k, edges, baselines, pinhole):
        return
    for j in range(fit.count):
        if fit.slot[j] == k:
            fit.rest[j] -= turn_x * fit.pitch[j] + turn_y * fit.yaw[j] + turn_z * fit.roll[j]
    lines.turn(baselines, k, pinhole, turn_x, turn_y, turn_z)
    least_squares.invert(fit.equations)
    left_rad = NOISE_PX * math.sqrt(max(fit.equations.inverse[0, 0], fit.equations.inverse[1, 1]))
    baselines.sigma_px[k] = left_rad * pinhole.focal
    key_frames.learn(keys, k, turn_x, turn_y, turn_z, left_rad)


def slot_edges(fit: FlowFit, k: int) -> int:
    """Number of edges whose history begins at key frame ``k``."""
    edges = 0
    for j in range(fit.count):
        if fit.slot[j] == k:
            edges += 1
    return edges


def apply(
    fit: FlowFit, edges: EdgeColumns, keys: KeyFrames, baselines: Baselines, pinhole: Pinhole, sigma_radps: float
) -> None:
    """Correct the baselines by ω and ΔO, and set their remaining uncertainty."""
    turn_x, turn_y, turn_z = fit.equations.solution[0], fit.equations.solution[1], fit.equations.solution[2]
    fit.focus_x, fit.focus_y = fit.equations.solution[FOCUS_X], fit.equations.solution[FOCUS_Y]
    least_squares.invert(fit.equations)
    fit.scale_px = quantile(fit, SCALE_SHARE, False, fit.turn_share) / SCALE_SIGMAS
    variance = max(NOISE_PX, fit.scale_px) * max(NOISE_PX, fit.scale_px)
    fit.focus_sigma_x = NOISE_PX * math.sqrt(fit.equations.inverse[FOCUS_X, FOCUS_X])
    fit.focus_sigma_y = NOISE_PX * math.sqrt(fit.equations.inverse[FOCUS_Y, FOCUS_Y])
    for i in range(3):
        for j in range(3):
            baselines.rate_covariance[i, j] = variance * fit.equations.inverse[i, j]
    baselines.is_fitted = True
    for k in range(KEYS):
        t = baselines.elapsed_s[k]
        baselines.focus_x[k] += fit.focus_x
        baselines.focus_y[k] += fit.focus_y
        lines.turn(baselines, k, pinhole, t * turn_x, t * turn_y, t * turn_z)
        unsure_rad = keys.rate_sigma_radps * t
        unsure_px = unsure_rad * pinhole.focal
        if slot_edges(fit, k) >= (UNSURE_SLOT_EDGES if unsure_px > UNSURE_PX else SLOT_EDGES):
            own_rad = max(baselines.sigma_px[k] / pinhole.focal, unsure_rad if unsure_px > UNSURE_PX else 0.0)
            sigma_rad = max(SLOT_SHARE * sigma_radps * t + SLOT_SIGMA_RAD, own_rad)
            width = max(SLOT_WIDTH_PX, UNSURE_SIGMAS * unsure_px)
            turn_slot(fit, k, edges, keys, baselines, pinhole, sigma_rad, width)
    fit.scale_px = quantile(fit, SCALE_SHARE, False, fit.turn_share) / SCALE_SIGMAS


def learn_turn_share(fit: FlowFit, dt_s: float) -> None:
    """Learn ``turn_share`` from the residuals, beyond noise, of the edges that a turn moved."""
    turned, way2 = 0, 0.0
    for k in range(fit.count):
        if shows_turn(fit, k):
            turned += 1
            way2 += fit.turned[k] * fit.turned[k]
    if turned < MIN_TURNED:
        return
    off_px = quantile(fit, SCALE_SHARE, True, 0.0) / SCALE_SIGMAS
    turn2 = max(off_px * off_px - NOISE_PX * NOISE_PX, 0.0) * turned / way2
    gain = 1 - math.exp(-dt_s / TURN_MEMORY_S)
    fit.turn_share = math.sqrt(fit.turn_share * fit.turn_share + gain * (turn2 - fit.turn_share * fit.turn_share))


def learn_corner_noise(fit: FlowFit, around: Situation) -> None:
    """Learn ``corner_var`` from the residuals, against what the places of the edges explain of them."""
    excess = fit.scale_px * fit.scale_px / fit.place_var
    gain = 1 - math.exp(-around.dt_s / NOISE_MEMORY_S)
    learnt = around.corner_var * (1 + gain * (min(excess, MAX_EXCESS) - 1))
    around.corner_var = max(learnt, around.least_corner_var)
    around.excess = max(excess, 1.0)
    around.noise_px = math.sqrt(0.5 * fit.place_var * around.excess)


def measure(
    fit: FlowFit,
    edges: EdgeColumns,
    keys: KeyFrames,
    baselines: Baselines,
    around: Situation,
    settings: Settings,
) -> None:
    """Fit this frame and correct the baselines. ``prior_x``, ``prior_y`` must be set."""
    fit.focus_x = fit.focus_y = fit.scale_px = 0.0
    fit.focus_sigma_x, fit.focus_sigma_y = fit.prior_x, fit.prior_y
    gather(fit, edges, keys, baselines, around, settings)
    if fit.count < MIN_EDGES:
        fit.count = 0
        return
    sigma_radps = rate_sigma(fit, baselines, around.pinhole.focal)
    solve(fit, sigma_radps)
    apply(fit, edges, keys, baselines, around.pinhole, sigma_radps)
    learn_turn_share(fit, around.dt_s)
    learn_corner_noise(fit, around)
