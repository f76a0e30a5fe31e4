"""Whether the vehicle is stationary, by the image: the ground, which must flow when it drives, does not."""

import math

from lcf_edge.filter import baselines as lines
from lcf_edge.filter import key_frames, lengths
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.inputs import KEYS
from lcf_edge.filter.key_frames import KeyFrames
from lcf_edge.filter.situation import Situation

MIN_BASELINE_S = 0.2  # motion over less time is lost in noise
MIN_STILL_S = 0.25  # a repeated image is no rest
MIN_EDGES = 25
MIN_GROUND_EDGES = 8
MIN_FLOW_PX = 3.0  # least flow of the ground, expected at the measured speed, to judge by
STILL_PX = 0.5  # more than half of the edges move less than this,
STILL_GROUND_PX = 1.0  # and of those on the ground more than half less than this,
STILL_SHARE = 0.3  # and than this share of what is expected


class RestTest:
    """Counts of one frame: ``edges`` with a history, ``still`` of them; on the ground ``ground``, ``still_ground``.

    ``stands``: the verdict, ``still_s``: for how long the evidence has lasted. ``measured_mps``: speed by IMU, odometry
    or configuration; NaN: unknown.
    """

    def __init__(self) -> None:
        self.edges = self.still = self.ground = self.still_ground = 0
        self.stands = False
        self.still_s = 0.0
        self.measured_mps = 0.0


def latest_key(keys: KeyFrames) -> int:
    """Number of the latest key frame that is ``MIN_BASELINE_S`` old, -1: none."""
    number = keys.number - 1
    while number >= 0 and number >= keys.number - KEYS:
        if keys.elapsed_s[number % KEYS] >= MIN_BASELINE_S:
            return number
        number -= 1
    return -1


def look(test: RestTest, edges: EdgeColumns, i: int, slot: int, baselines: Baselines, around: Situation) -> None:
    """Count one edge: its motion since a key frame, against the expected flow of the ground there."""
    key_x, key_y = edges.key_x[i, slot], edges.key_y[i, slot]
    x, y = lines.then_x(baselines, slot, key_x, key_y), lines.then_y(baselines, slot, key_x, key_y)
    way = lengths.of(edges.x[i] - x, edges.y[i] - y)
    r = lengths.of(x - baselines.focus_x[slot], y - baselines.focus_y[slot])
    focal = around.pinhole.focal
    below = max(edges.y[i] - around.horizon_y - focal * around.pitch_sigma_rad, 0.0)
    driven_m = math.fabs(test.measured_mps) * baselines.elapsed_s[slot]
    expected = r * driven_m * below / (around.camera_height_m * focal)
    test.edges += 1
    if way < STILL_PX:
        test.still += 1
    if expected > MIN_FLOW_PX:
        test.ground += 1
        if way < min(STILL_GROUND_PX, STILL_SHARE * expected):
            test.still_ground += 1


def measure(test: RestTest, edges: EdgeColumns, keys: KeyFrames, baselines: Baselines, around: Situation) -> None:
    """Set ``stands`` and ``Situation.ground_is_still``. Without ground in sight rest lasts until the image moves."""
    stood, looked_s = test.stands, test.still_s
    test.stands = around.ground_is_still = False
    test.still_s = 0.0
    test.edges = test.still = test.ground = test.still_ground = 0
    number = latest_key(keys)
    known = math.isfinite(test.measured_mps) and test.measured_mps != 0 and around.camera_height_m > 0
    if number < 0 or not known:
        return
    for i in range(edges.count):
        # at rest everything stays in place, and is no own part for that
        seen = edges.matched[i] != 0 and (stood or not edges.is_own_part(i))
        if seen and key_frames.oldest_key(edges, i, keys) <= number:
            look(test, edges, i, number % KEYS, baselines, around)
    shows_ground = test.ground >= MIN_GROUND_EDGES
    around.ground_is_still = shows_ground and 2 * test.still_ground > test.ground
    if test.edges >= MIN_EDGES and 2 * test.still > test.edges:
        if around.ground_is_still or (stood and not shows_ground):
            test.still_s = looked_s + around.dt_s
        test.stands = test.still_s >= MIN_STILL_S
