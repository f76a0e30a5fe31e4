"""The vehicle in this frame: focus of expansion, dimensions, motion."""

import math

from lcf_edge.config import Config
from lcf_edge.filter.flow import Pinhole

SLOWEST_MPS = 0.05  # a slower vehicle is at rest: its scene does not flow, and would bound all motion by 0
ASSUMED_WIDTHS_HZ = 4.0  # speed that is assumed where none is measured, in vehicle widths per second
LASTING_TURN_S = 0.3  # a turn that has lasted so long is no swerve
INFINITY = float("inf")
NAN = float("nan")


class Situation:
    """State of this frame that the experts share.

    ``focus_x``, ``focus_y``: O, px. ``horizon_y``: px. ``camera_height_m`` 0: unknown. ``speed_mps``: V_ν, NaN:
    unknown; then ``assumed_mps``, else the same, is a guess by the vehicle's width. ``scene_flow_pxps``: image speed at
    V_ν, or ``SLOWEST_MPS`` if more, of a point at the configured scene depth, one focal length from O, which gives the
    paper's bounds in V_ν a unit in the image; inf where V_ν is unknown. ``dt_s``: t_f. ``lasting_yaw_radps``: yaw rate,
    averaged over ``LASTING_TURN_S``. ``noise_px``: 1 sigma of an edge's position; ``corner_var``: variance of a
    corner's, px², at least ``least_corner_var``; ``excess``: factor by which this image leaves more than they explain.
    ``focus_var_x``, ``focus_var_y``: variance of O at one instant, px²; ``lasting_var_x``, ``lasting_var_y``: without
    the shaking of the heading. ``turn_share``: 1 sigma of the image motion by a turn, as a share of it.
    ``pitch_sigma_rad``: 1 sigma of the horizon as configured, ``horizon_sigma_rad``: by the flow where that is less.
    ``lever_m``: distance of the camera ahead of the axle. ``ground_is_still``: although at V_ν it must flow (``rest``).
    ``floor_mirrors``: it is glossy (``glossy_floor``).
    ``flow_is_seen``: enough of the static scene is in view to show its flow. ``is_blind``: it is not, and hardly an
    edge of the image is found again: something covers it.
    """

    def __init__(self, config: Config, pinhole: Pinhole) -> None:
        self.pinhole = pinhole
        self.scene_depth_m = config.filter.scene_depth_m
        self.camera_height_m = config.camera.height_m
        self.half_width_m, self.height_m = config.vehicle.half_width_m, config.vehicle.height_m
        self.horizon_s = config.vehicle.horizon_s
        self.pitch_sigma_rad = self.horizon_sigma_rad = config.filter.pitch_sigma_rad
        self.focus_x, self.focus_y, self.horizon_y = pinhole.cx, pinhole.cy, pinhole.cy
        self.ground_is_still = self.floor_mirrors = False
        self.flow_is_seen, self.is_blind = True, False
        self.ground_mps = NAN
        self.turn_share = self.lever_m = 0.0
        self.noise_px = config.filter.corner_noise_px
        self.least_corner_var = self.corner_var = self.noise_px * self.noise_px
        self.excess, self.focus_var_x, self.focus_var_y = 1.0, 0.0, 0.0
        self.lasting_var_x = self.lasting_var_y = 0.0
        self.dt_s, self.speed_mps, self.yaw_rate_radps, self.scene_flow_pxps = 1.0, NAN, 0.0, INFINITY
        self.assumed_mps = NAN
        self.lasting_yaw_radps = NAN


def follow(around: Situation, ray_x: float, ray_y: float, speed_mps: float, yaw_rate_radps: float, dt_s: float) -> None:
    """Take the heading, as x/z and y/z of its ray, and the motion of this frame."""
    around.focus_x = around.pinhole.cx + around.pinhole.fx * ray_x
    around.focus_y = around.horizon_y = around.pinhole.cy + around.pinhole.fy * ray_y
    around.dt_s, around.speed_mps, around.yaw_rate_radps = dt_s, speed_mps, yaw_rate_radps
    before = yaw_rate_radps if math.isnan(around.lasting_yaw_radps) else around.lasting_yaw_radps
    around.lasting_yaw_radps = before + (yaw_rate_radps - before) * min(dt_s / LASTING_TURN_S, 1.0)
    around.scene_flow_pxps = INFINITY
    around.assumed_mps = ASSUMED_WIDTHS_HZ * 2 * around.half_width_m
    if math.isfinite(speed_mps):
        around.assumed_mps = speed_mps
        around.scene_flow_pxps = max(math.fabs(speed_mps), SLOWEST_MPS) * around.pinhole.focal / around.scene_depth_m


def is_at_rest(around: Situation) -> bool:
    """Whether the vehicle is known to be at rest."""
    return math.fabs(around.speed_mps) < SLOWEST_MPS


def ground_range_m(around: Situation, y: float) -> float:
    """Range of the ground at image row ``y``, m; NaN at the horizon, above it, or where the height is unknown."""
    focal = around.pinhole.focal
    below = y - around.horizon_y
    if below > focal * around.pitch_sigma_rad and around.camera_height_m > 0:
        return around.camera_height_m * focal / max(below, 1.0)
    return NAN


def ground_inverse(around: Situation, y: float) -> float:
    """1/Z of the ground at image row ``y``, 1/m, from a known height; 0 at the horizon and above it.

    To compare another 1/Z with, near the horizon too, where ``ground_range_m`` gives no range for want of certainty.
    """
    return max(y - around.horizon_y, 0.0) / around.pinhole.fy / around.camera_height_m
