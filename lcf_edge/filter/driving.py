"""Whether the vehicle drives, by the image: most of the scene flows outward, left and right of O."""

import math

from lcf_edge.filter import lengths, rebel_detection, situation
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.situation import Situation

MIN_BASELINE_S = 0.15  # motion over less time is lost in noise
MOVES_SIGMAS = 3.0
MIN_R_SHARE = 0.1  # of the focal length; closer to O the flow is too small
MIN_A_SIDE = 8  # edges that flow outward left of O, and right of it
FLOW_SHARE = 0.6  # of all edges
MAX_ASTRAY = 0.2  # edges that move otherwise, as a share of those that flow
MAX_DRIFT_SHARE = 0.5  # of the outward motion; with more an edge is astray


class DrivingTest:
    """What one frame shows. ``drives``: the verdict.

    ``edges``: those away from O with a history, and own parts; of these ``left`` and ``right`` of O flow outward,
    ``astray`` move otherwise.
    """

    def __init__(self) -> None:
        self.edges = self.left = self.right = self.astray = 0
        self.drives = False


def is_away(edges: EdgeColumns, i: int, around: Situation) -> bool:
    """Whether an edge is far enough from O to flow."""
    r = lengths.of(edges.x[i] - around.focus_x, edges.y[i] - around.focus_y)
    return r >= MIN_R_SHARE * around.pinhole.focal


def look(
    test: DrivingTest, verdicts: Verdicts, j: int, edges: EdgeColumns, baselines: Baselines, around: Situation
) -> None:
    """Count one edge."""
    i, slot = verdicts.row[j], verdicts.slot[j]
    if not is_away(edges, i, around) or baselines.elapsed_s[slot] < MIN_BASELINE_S:
        return
    test.edges += 1
    outward, drift = verdicts.outward[j], math.fabs(verdicts.drift[j])
    if baselines.depth_m[slot] < 0 and situation.is_at_rest(around):
        outward = -outward  # the sign of a speed of about 0 is no reverse
    if lengths.of(outward, drift) < MOVES_SIGMAS * rebel_detection.sigma_px(verdicts, j):
        return
    if drift > MAX_DRIFT_SHARE * outward:
        test.astray += 1
    elif edges.x[i] < around.focus_x:
        test.left += 1
    else:
        test.right += 1


def measure(test: DrivingTest, verdicts: Verdicts, edges: EdgeColumns, baselines: Baselines, around: Situation) -> None:
    """Set ``drives``. An object approaching a parked vehicle flows outward too, but its surroundings are stationary.

    Edges that have not moved for long count as own parts and are not judged, but they are evidence of rest.
    """
    test.edges = test.left = test.right = test.astray = 0
    for i in range(edges.count):
        test.edges += edges.matched[i] != 0 and edges.is_own_part(i) and is_away(edges, i, around)
    for j in range(verdicts.count):
        look(test, verdicts, j, edges, baselines, around)
    flow = test.left + test.right
    test.drives = (
        min(test.left, test.right) >= MIN_A_SIDE
        and flow >= FLOW_SHARE * test.edges
        and test.astray <= MAX_ASTRAY * flow
    )
