"""The vehicle's speed from the flow of the ground below the horizon.

The ground at a row b px below the horizon lies at Z = h·f/b. A point on it that has moved outward by μ of its distance
from O in a time T gives V = μ·Z/T. A point above the ground is nearer than the ground in its row and gives more; one
farther off, or moving along, gives less. Points on the ground plane agree in rows near and far, those on a wall only
in some rows.
"""

import math

from lcf_edge.filter import rebel_detection, rounding
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.memory import integers
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.situation import Situation

BINS = 60  # of the speed, spaced logarithmically
SLOWEST_MPS = 0.05
BIN_RATIO = 0.125  # width of a bin, of ln(speed)
SPREAD = 0.15  # within which points on the ground agree, of ln(speed)
MIN_EDGES = 12
MIN_SHARE = 0.3  # of the edges below the horizon, that must agree
MIN_BELOW = 0.06  # least b/f; higher rows are too near the horizon to have a range
OUTWARD_SIGMAS = 3.0  # by which outward motion must exceed its noise
MIN_ROWS = 0.15  # least standard deviation of ln(b) of those that agree; a wall has less
SLOPE_SIGMA_RAD = 0.02  # 1 sigma of the ground's slope and the camera's pitch together
MIN_SIGMA = 0.06  # of ln(speed)
NAN = float("nan")


class GroundSpeed:
    """``speed_mps``: V from the ground, mean over the window, NaN: unknown; ``sigma_mps``: 1 sigma of it.

    ``elapsed_s``: length of the window. ``votes``: (BINS,).
    """

    def __init__(self) -> None:
        self.speed_mps = self.sigma_mps = NAN
        self.elapsed_s = 0.0
        self.votes = integers(BINS)
        self.count = 0
        self.below = self.rows = self.squares = self.sum = self.elapsed = 0.0


def says_mps(verdicts: Verdicts, j: int, edges: EdgeColumns, baselines: Baselines, around: Situation) -> float:
    """V from one edge, if it lies on the ground, m/s; 0: unknown."""
    below = edges.y[verdicts.row[j]] - around.horizon_y
    if below < MIN_BELOW * around.pinhole.focal:
        return 0.0
    slot = verdicts.slot[j]
    outward = verdicts.outward[j] if baselines.depth_m[slot] >= 0 else -verdicts.outward[j]  # reversing
    if outward < OUTWARD_SIGMAS * rebel_detection.sigma_px(verdicts, j) or verdicts.r[j] <= 0:
        return 0.0
    range_m = around.camera_height_m * around.pinhole.focal / below
    return outward / verdicts.r[j] * range_m / baselines.elapsed_s[slot]


def bin_of(speed_mps: float) -> int:
    """Bin of a speed, -1: none."""
    if not speed_mps > SLOWEST_MPS:
        return -1
    k = rounding.whole(math.log(speed_mps / SLOWEST_MPS) / BIN_RATIO)
    return k if k < BINS else -1


def fullest(ground: GroundSpeed) -> int:
    """The bin with the most votes in it and its neighbours, -1: too few."""
    most = best = -1
    for k in range(1, BINS - 1):
        votes = ground.votes[k - 1] + ground.votes[k] + ground.votes[k + 1]
        if votes > most:
            most, best = votes, k
    return best if most >= MIN_EDGES and most >= MIN_SHARE * ground.count else -1


def measure(
    ground: GroundSpeed, edges: EdgeColumns, verdicts: Verdicts, baselines: Baselines, around: Situation
) -> None:
    """Measure the speed in this frame."""
    ground.speed_mps = ground.sigma_mps = NAN
    if not around.camera_height_m > 0:
        return
    ground.count = 0
    for k in range(BINS):
        ground.votes[k] = 0
    for j in range(verdicts.count):
        k = bin_of(says_mps(verdicts, j, edges, baselines, around))
        if k >= 0:
            ground.votes[k] += 1
            ground.count += 1
    best = fullest(ground)
    if best < 0:
        return
    middle = math.log(SLOWEST_MPS) + (best + 0.5) * BIN_RATIO
    n = 0
    ground.below = ground.rows = ground.squares = ground.sum = ground.elapsed = 0.0
    for j in range(verdicts.count):
        says = says_mps(verdicts, j, edges, baselines, around)
        if says > SLOWEST_MPS and math.fabs(math.log(says) - middle) < SPREAD:
            slot = verdicts.slot[j]
            n += 1
            ground.sum += math.log(says)
            below = edges.y[verdicts.row[j]] - around.horizon_y
            ground.below += below
            ground.rows += math.log(below)
            ground.squares += math.log(below) * math.log(below)
            ground.elapsed += baselines.elapsed_s[slot]
    if n < MIN_EDGES or ground.squares / n - (ground.rows / n) * (ground.rows / n) < MIN_ROWS * MIN_ROWS:
        return
    ground.speed_mps = math.exp(ground.sum / n)
    tilt = SLOPE_SIGMA_RAD * around.pinhole.focal / (ground.below / n)
    ground.sigma_mps = ground.speed_mps * math.sqrt(MIN_SIGMA * MIN_SIGMA + tilt * tilt)
    ground.elapsed_s = ground.elapsed / n
