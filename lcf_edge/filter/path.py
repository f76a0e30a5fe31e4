"""The vehicle's path over the ground: an arc by speed and yaw rate, or a straight line.

Points are given relative to the camera, right and ahead; the arc is that of the axle behind it.
"""

import math

from lcf_edge.filter.situation import Situation

INFINITY = float("inf")
MIN_CURVATURE = 1e-3  # 1/m; below, the path is straight
MIN_SPEED_MPS = 0.05  # below, the yaw rate does not define a path
SMALL_TURN_RAD = 0.4  # turns up to this may be noise, or soon be over;
TURN_LASTS_S = 3.0  # no turn can be relied upon for longer


def arc_radius_m(yaw_rate_radps: float, around: Situation) -> float:
    """Radius of the path at a yaw rate, m, positive to the left; infinite: straight."""
    speed = around.assumed_mps
    least = MIN_CURVATURE * max(math.fabs(speed), MIN_SPEED_MPS)
    if math.fabs(yaw_rate_radps) < least:
        return INFINITY
    return speed / yaw_rate_radps


def miss_at(yaw_rate_radps: float, right_m: float, ahead_m: float, around: Situation) -> float:
    """Lateral miss: distance of a point from the path at a yaw rate, m, right positive."""
    radius = arc_radius_m(yaw_rate_radps, around)
    if not math.isfinite(radius):
        return right_m
    before_axle_m = ahead_m + around.lever_m
    distance = math.sqrt((right_m + radius) * (right_m + radius) + before_axle_m * before_axle_m) - math.fabs(radius)
    return -distance if radius < 0 else (distance if radius > 0 else 0.0)


def miss(right_m: float, ahead_m: float, around: Situation) -> float:
    """Lateral miss: distance of a point from the vehicle's path, m, right positive."""
    return miss_at(around.yaw_rate_radps, right_m, ahead_m, around)


def least_miss(right_m: float, ahead_m: float, around: Situation) -> float:
    """Lateral miss of a point, m, right positive; where the turn until there, or in ``TURN_LASTS_S``, is small, the
    least between arc and straight line.
    """
    arc_m = miss(right_m, ahead_m, around)
    until_s = ahead_m / max(around.assumed_mps, MIN_SPEED_MPS)
    turn_rad = math.fabs(around.yaw_rate_radps) * min(until_s, TURN_LASTS_S)
    if not turn_rad < SMALL_TURN_RAD:
        return arc_m
    if right_m * arc_m < 0:
        return 0.0
    return right_m if math.fabs(right_m) < math.fabs(arc_m) else arc_m


def way_to(right_m: float, ahead_m: float, around: Situation) -> float:
    """Distance along the path until a point is abeam, m."""
    radius = arc_radius_m(around.yaw_rate_radps, around)
    if not math.isfinite(radius):
        return ahead_m
    outside = right_m + radius if radius > 0 else (-right_m - radius if radius < 0 else 0.0)
    to_axle, already = math.atan2(ahead_m + around.lever_m, outside), math.atan2(around.lever_m, math.fabs(radius))
    return math.fabs(radius) * (to_axle - already)
