"""Direction of travel in camera axes: how the camera is mounted, how it shakes, and what turns add.

A camera mounted L ahead of the axle that does not steer moves sideways at ω·L in a turn, so that O lies L·ω/V beside
the heading. L, the lever arm, is learnt together with the yaw of the mounting.
"""

import math

from lcf_edge.config import Camera
from lcf_edge.filter.flow_fit import FlowFit
from lcf_edge.filter.memory import Doubles
from lcf_edge.filter.situation import Situation

PITCH_MEMORY_S = 1.0  # faster shaking turns the camera, not the vehicle's direction of travel
YAW_MEMORY_S = 0.3
MOUNTING_SIGMA_RAD = 0.05  # of the configured mounting
SHAKE_SIGMA_RAD = 0.004  # of the heading about the mounting, from frame to frame
MOUNTING_DRIFT_RAD = 0.0005  # per √s
FIT_WINDOW_S = 0.7  # fits closer in time are not independent
MAX_MOUNTING_SIGMAS = 3.0  # largest shift that one fit may ask for
LEVER_WIDTHS = 1.0  # 1 sigma of the lever arm, half widths of the vehicle
LEVER_DRIFT = 0.1  # its growth in a second of turning, as wheels slip, half widths
MIN_SPEED_MPS = 0.1
MAX_CURVATURE = 2.0  # 1/m; beyond, it is a turn on the spot, where O is of no use
MIN_VARIANCE = 1e-12
STRAIGHT_RADPS = 0.03  # slower turns are negligible at any speed
INFINITY = float("inf")


class Heading:
    """Direction of travel of the camera, in its axes.

    ``ray_x``, ``ray_y``: x/z and y/z of the vehicle's heading now; ``aside_x``: what a turn adds to ``ray_x``;
    ``mounted_x``, ``mounted_y``: the same without shaking, by the mounting, with 1 sigma ``sigma_x``, ``sigma_y``, rad;
    ``lever_m``: lever arm from the axle ahead to the camera, with ``lever_sigma_m``; ``shared``: covariance of
    ``mounted_x`` and ``lever_m``, rad m. ``curvature``: ω/V, 1/m, 0 in a turn too slight to show.
    """

    def __init__(self, camera: Camera, half_width_m: float) -> None:
        self.mounted_x = self.ray_x = -math.tan(camera.yaw_rad)
        self.mounted_y = self.ray_y = math.tan(camera.pitch_rad)
        self.sigma_x = self.sigma_y = MOUNTING_SIGMA_RAD
        self.lever_m, self.shared, self.curvature, self.aside_x = camera.ahead_m, 0.0, 0.0, 0.0
        self.half_width_m = half_width_m
        self.lever_sigma_m = LEVER_WIDTHS * half_width_m


def turn_heading(heading: Heading, rotation: Doubles, yaw_rate_radps: float, dt_s: float) -> None:
    """Update the heading: shaking turns the camera alone, a turn of the vehicle both. ``rotation``: (1, 3, 3)."""
    x = rotation[0, 0, 0] * heading.ray_x + rotation[0, 0, 1] * heading.ray_y + rotation[0, 0, 2]
    y = rotation[0, 1, 0] * heading.ray_x + rotation[0, 1, 1] * heading.ray_y + rotation[0, 1, 2]
    z = rotation[0, 2, 0] * heading.ray_x + rotation[0, 2, 1] * heading.ray_y + rotation[0, 2, 2]
    shaken_x = x / z - yaw_rate_radps * dt_s  # a left turn moves the image to the right
    shaken_y = y / z
    heading.ray_x = heading.mounted_x + math.exp(-dt_s / YAW_MEMORY_S) * (shaken_x - heading.mounted_x)
    heading.ray_y = heading.mounted_y + math.exp(-dt_s / PITCH_MEMORY_S) * (shaken_y - heading.mounted_y)


def turn_aside(heading: Heading, speed_mps: float, yaw_rate_radps: float) -> None:
    """Set ``curvature`` and ``aside_x``: O lies L·ω/V beside the heading; nothing where the speed is unknown or 0."""
    heading.curvature = 0.0
    if math.fabs(speed_mps) > MIN_SPEED_MPS:
        curvature = min(max(yaw_rate_radps / speed_mps, -MAX_CURVATURE), MAX_CURVATURE)
        least = SHAKE_SIGMA_RAD / heading.half_width_m
        heading.curvature = curvature - min(max(curvature, -least), least)
    heading.aside_x = -heading.lever_m * heading.curvature


def focus_variance(sigma_rad: float) -> float:
    """Variance of O at one instant, rad²: of the mounting, or of O over a while, and of the shaking heading."""
    return sigma_rad * sigma_rad + SHAKE_SIGMA_RAD * SHAKE_SIGMA_RAD


def focus_sigma_rad(mounting_sigma_rad: float) -> float:
    """Prior sigma of O, rad: of the mounting, and of the shaking heading."""
    return math.sqrt(focus_variance(mounting_sigma_rad))


def sideways_sigma_rad(heading: Heading) -> float:
    """1 sigma of O to the side, rad: of the mounting's yaw and of the lever arm in this turn."""
    lever_rad = heading.lever_sigma_m * heading.curvature
    variance = heading.sigma_x * heading.sigma_x + lever_rad * lever_rad - 2 * heading.curvature * heading.shared
    return math.sqrt(max(variance, MIN_VARIANCE))


def learn_mounting(heading: Heading, around: Situation, fit: FlowFit) -> None:
    """Update the Kalman filters of mounting and lever arm with the O of one frame's fit."""
    fx, fy, dt_s = around.pinhole.fx, around.pinhole.fy, around.dt_s
    shift_rad = unpulled(fit.focus_x / fx, fit.prior_x / fx, fit.focus_sigma_x / fx)
    noise = fit_noise(fit.prior_x / fx, fit.focus_sigma_x / fx, dt_s)
    learn_sideways(heading, shift_rad, noise if knows_curvature(around) else INFINITY, dt_s)
    gain = mounting_gain(heading.sigma_y, fit_noise(fit.prior_y / fy, fit.focus_sigma_y / fy, dt_s))
    step = gain * unpulled(fit.focus_y / fy, fit.prior_y / fy, fit.focus_sigma_y / fy)
    heading.mounted_y += step
    heading.ray_y += step
    heading.sigma_y = drifted(heading.sigma_y, gain, dt_s)


def knows_curvature(around: Situation) -> bool:
    """Whether ω/V is known: neither too tight a turn, nor a turn at an unknown speed."""
    turning = math.fabs(around.yaw_rate_radps)
    if math.fabs(around.speed_mps) > MIN_SPEED_MPS:
        return turning <= MAX_CURVATURE * math.fabs(around.speed_mps)
    return turning <= STRAIGHT_RADPS


def learn_sideways(heading: Heading, shift_rad: float, noise: float, dt_s: float) -> None:
    """Kalman update of the mounting's yaw x and the lever arm L by a sideways shift of O, Δx - ΔL·ω/V.

    ``noise``: variance of the shift, rad².
    """
    lever_variance = heading.lever_sigma_m * heading.lever_sigma_m
    of_x = heading.sigma_x * heading.sigma_x - heading.curvature * heading.shared
    of_lever = heading.shared - heading.curvature * lever_variance
    total = of_x - heading.curvature * of_lever + noise
    gain_x, gain_lever = of_x / total, of_lever / total
    heading.mounted_x += gain_x * shift_rad
    heading.ray_x += gain_x * shift_rad
    heading.lever_m += gain_lever * shift_rad
    variance = heading.sigma_x * heading.sigma_x - gain_x * of_x + MOUNTING_DRIFT_RAD * MOUNTING_DRIFT_RAD * dt_s
    heading.sigma_x = math.sqrt(max(variance, MIN_VARIANCE))
    drift_m = LEVER_DRIFT * heading.half_width_m if heading.curvature != 0 else 0.0
    lever_variance += drift_m * drift_m * dt_s - gain_lever * of_lever
    heading.lever_sigma_m = math.sqrt(max(lever_variance, MIN_VARIANCE))
    heading.shared -= gain_x * of_lever


def unpulled(shift_rad: float, prior_rad: float, sigma_rad: float) -> float:
    """Shift of O by the flow alone, without the pull of the fit's prior, rad; clamped to ``MAX_MOUNTING_SIGMAS``."""
    alone = shift_rad * prior_rad * prior_rad / max(prior_rad * prior_rad - sigma_rad * sigma_rad, MIN_VARIANCE)
    most = MAX_MOUNTING_SIGMAS * prior_rad
    return min(max(alone, -most), most)


def fit_noise(prior_rad: float, sigma_rad: float, dt_s: float) -> float:
    """Variance of one fit as a measurement of the mounting, rad²; infinite: it measures nothing.

    ``prior_rad``, ``sigma_rad``: 1 sigma of O before and after the fit. The heading shakes, too, and fits close in time
    are not independent.
    """
    information = 1 / max(sigma_rad * sigma_rad, MIN_VARIANCE) - 1 / (prior_rad * prior_rad)  # by the flow alone
    if information <= 0:
        return INFINITY
    return (1 / information + SHAKE_SIGMA_RAD * SHAKE_SIGMA_RAD) * max(1.0, FIT_WINDOW_S / dt_s)


def mounting_gain(mounting_rad: float, noise: float) -> float:
    """Kalman gain of one fit for a mounting with this sigma; ``noise``: ``fit_noise``."""
    return mounting_rad * mounting_rad / (mounting_rad * mounting_rad + noise)


def drifted(sigma_rad: float, gain: float, dt_s: float) -> float:
    """1 sigma of the mounting after an update and a frame interval, rad."""
    return math.sqrt((1 - gain) * sigma_rad * sigma_rad + MOUNTING_DRIFT_RAD * MOUNTING_DRIFT_RAD * dt_s)
