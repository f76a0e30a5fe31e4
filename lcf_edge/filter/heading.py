"""Where the vehicle heads in the camera's axes: how the camera is mounted, and how it shakes."""

import math

from lcf_edge.config import Camera
from lcf_edge.filter.flow_fit import FlowFit
from lcf_edge.filter.memory import Doubles
from lcf_edge.filter.situation import Situation

PITCH_MEMORY_S = 1.0  # shaking faster than this turns the camera, not the way of the vehicle
YAW_MEMORY_S = 0.3
MOUNTING_SIGMA_RAD = 0.05  # by which the configured mounting may be wrong
SHAKE_SIGMA_RAD = 0.004  # and by which the heading differs from it from frame to frame
MOUNTING_DRIFT_RAD = 0.0005  # in a second
FIT_WINDOW_S = 0.7  # fits nearer to each other in time tell the same
MAX_MOUNTING_SIGMAS = 3.0  # that one fit may ask for
LEVER_WIDTHS = 2.0  # half widths of the vehicle by which the camera may sit before the axle
MIN_SPEED_MPS = 0.1
MIN_VARIANCE = 1e-12


class Heading:
    """The direction of travel in the camera's axes: the mounting, and on top of it how the camera shakes.

    ``ray_x``, ``ray_y``: x/z and y/z of it, now; ``mounted_x``, ``mounted_y``: at rest, with 1 sigma of that,
    ``sigma_x``, ``sigma_y``, rad.
    """

    def __init__(self, camera: Camera) -> None:
        self.mounted_x = self.ray_x = -math.tan(camera.yaw_rad)
        self.mounted_y = self.ray_y = math.tan(camera.pitch_rad)
        self.sigma_x = self.sigma_y = MOUNTING_SIGMA_RAD


def turn_heading(heading: Heading, rotation: Doubles, yaw_rate_radps: float, dt_s: float) -> None:
    """Shaking turns the camera and not the heading, a turn of the vehicle both. ``rotation``: (1, 3, 3)."""
    x = rotation[0, 0, 0] * heading.ray_x + rotation[0, 0, 1] * heading.ray_y + rotation[0, 0, 2]
    y = rotation[0, 1, 0] * heading.ray_x + rotation[0, 1, 1] * heading.ray_y + rotation[0, 1, 2]
    z = rotation[0, 2, 0] * heading.ray_x + rotation[0, 2, 1] * heading.ray_y + rotation[0, 2, 2]
    shaken_x = x / z - yaw_rate_radps * dt_s  # a left turn moves the picture to the right
    shaken_y = y / z
    heading.ray_x = heading.mounted_x + math.exp(-dt_s / YAW_MEMORY_S) * (shaken_x - heading.mounted_x)
    heading.ray_y = heading.mounted_y + math.exp(-dt_s / PITCH_MEMORY_S) * (shaken_y - heading.mounted_y)


def focus_sigma_rad(mounting_sigma_rad: float) -> float:
    """1 sigma of O before the flow tells, rad: of the mounting, and of how the heading shakes."""
    return math.sqrt(mounting_sigma_rad * mounting_sigma_rad + SHAKE_SIGMA_RAD * SHAKE_SIGMA_RAD)


def learn_mounting(heading: Heading, around: Situation, fit: FlowFit) -> None:
    """Kalman filter over the mounting: what a frame's fit tells of O, slowly.

    In a turn O lies ω·L/V beside the heading, the camera sitting L before the axle, which nobody has measured.
    """
    turning = math.fabs(around.yaw_rate_radps) / max(math.fabs(around.speed_mps), MIN_SPEED_MPS)
    if not math.isfinite(turning):
        turning = math.fabs(around.yaw_rate_radps)
    aside = LEVER_WIDTHS * around.half_width_m * turning
    fx, fy, dt_s = around.pinhole.fx, around.pinhole.fy, around.dt_s
    gain = mounting_gain(heading.sigma_x, fit.prior_x / fx, fit.focus_sigma_x / fx, aside, dt_s)
    step = gain * unpulled(fit.focus_x / fx, fit.prior_x / fx, fit.focus_sigma_x / fx)
    heading.mounted_x += step
    heading.ray_x += step
    heading.sigma_x = drifted(heading.sigma_x, gain, dt_s)
    gain = mounting_gain(heading.sigma_y, fit.prior_y / fy, fit.focus_sigma_y / fy, 0.0, dt_s)
    step = gain * unpulled(fit.focus_y / fy, fit.prior_y / fy, fit.focus_sigma_y / fy)
    heading.mounted_y += step
    heading.ray_y += step
    heading.sigma_y = drifted(heading.sigma_y, gain, dt_s)


def unpulled(shift_rad: float, prior_rad: float, sigma_rad: float) -> float:
    """Shift of O that the flow alone tells, without the pull of the fit's prior, rad; no more than a few sigmas."""
    alone = shift_rad * prior_rad * prior_rad / max(prior_rad * prior_rad - sigma_rad * sigma_rad, MIN_VARIANCE)
    most = MAX_MOUNTING_SIGMAS * prior_rad
    return min(max(alone, -most), most)


def mounting_gain(mounting_rad: float, prior_rad: float, sigma_rad: float, aside_rad: float, dt_s: float) -> float:
    """Kalman gain of one fit. All 1 sigma: of the mounting, of O before and after the fit, of O aside in a turn."""
    information = 1 / max(sigma_rad * sigma_rad, MIN_VARIANCE) - 1 / (prior_rad * prior_rad)  # by the flow alone
    if information <= 0:
        return 0.0
    noise = 1 / information + SHAKE_SIGMA_RAD * SHAKE_SIGMA_RAD + aside_rad * aside_rad
    noise *= max(1.0, FIT_WINDOW_S / dt_s)
    return mounting_rad * mounting_rad / (mounting_rad * mounting_rad + noise)


def drifted(sigma_rad: float, gain: float, dt_s: float) -> float:
    """1 sigma of the mounting after a fit and a frame interval, rad."""
    return math.sqrt((1 - gain) * sigma_rad * sigma_rad + MOUNTING_DRIFT_RAD * MOUNTING_DRIFT_RAD * dt_s)
