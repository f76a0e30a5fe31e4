"""The vehicle at this instant: where it heads in the picture, what it is, how it moves."""

import math

from lcf_edge.config import Camera, Config
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.memory import Doubles

PITCH_MEMORY_S = 1.0  # shaking faster than this turns the camera, not the way of the vehicle
YAW_MEMORY_S = 0.3
INFINITY = float("inf")
NAN = float("nan")


class Heading:
    """The direction of travel in the camera's axes: the mounting, and on top of it how the camera shakes.

    ``ray_x``, ``ray_y``: x/z and y/z of it, now; ``mounted_x``, ``mounted_y``: at rest.
    """

    def __init__(self, camera: Camera) -> None:
        self.mounted_x = self.ray_x = -math.tan(camera.yaw_rad)
        self.mounted_y = self.ray_y = math.tan(camera.pitch_rad)


def turn_heading(heading: Heading, rotation: Doubles, yaw_rate_radps: float, dt_s: float) -> None:
    """Shaking turns the camera and not the heading, a turn of the vehicle both. ``rotation``: (1, 3, 3)."""
    x = rotation[0, 0, 0] * heading.ray_x + rotation[0, 0, 1] * heading.ray_y + rotation[0, 0, 2]
    y = rotation[0, 1, 0] * heading.ray_x + rotation[0, 1, 1] * heading.ray_y + rotation[0, 1, 2]
    z = rotation[0, 2, 0] * heading.ray_x + rotation[0, 2, 1] * heading.ray_y + rotation[0, 2, 2]
    shaken_x = x / z - yaw_rate_radps * dt_s  # a left turn moves the picture to the right
    shaken_y = y / z
    heading.ray_x = heading.mounted_x + math.exp(-dt_s / YAW_MEMORY_S) * (shaken_x - heading.mounted_x)
    heading.ray_y = heading.mounted_y + math.exp(-dt_s / PITCH_MEMORY_S) * (shaken_y - heading.mounted_y)


class Situation:
    """What the experts need to know about this frame.

    ``focus_x``, ``focus_y``: O, px. ``horizon_y``: px. ``camera_height_m`` 0: unknown. ``speed_mps``: V_ν, NaN:
    unknown. ``scene_flow_pxps``: image speed that V_ν gives a point at the configured depth of the scene, one focal
    length from O, so that the paper's bounds in V_ν have a unit in the picture; inf where V_ν is unknown. ``dt_s``:
    t_f.
    """

    def __init__(self, config: Config, pinhole: Pinhole) -> None:
        self.pinhole = pinhole
        self.scene_depth_m = config.filter.scene_depth_m
        self.camera_height_m = config.camera.height_m
        self.half_width_m, self.height_m = config.vehicle.half_width_m, config.vehicle.height_m
        self.horizon_s = config.vehicle.horizon_s
        self.pitch_sigma_rad = config.filter.pitch_sigma_rad
        self.focus_x, self.focus_y, self.horizon_y = pinhole.cx, pinhole.cy, pinhole.cy
        self.dt_s, self.speed_mps, self.yaw_rate_radps, self.scene_flow_pxps = 1.0, NAN, 0.0, INFINITY


def follow(around: Situation, heading: Heading, speed_mps: float, yaw_rate_radps: float, dt_s: float) -> None:
    """Take the heading and the motion of this frame."""
    around.focus_x = around.pinhole.cx + around.pinhole.fx * heading.ray_x
    around.focus_y = around.horizon_y = around.pinhole.cy + around.pinhole.fy * heading.ray_y
    around.dt_s, around.speed_mps, around.yaw_rate_radps = dt_s, speed_mps, yaw_rate_radps
    around.scene_flow_pxps = INFINITY
    if math.isfinite(speed_mps):
        around.scene_flow_pxps = math.fabs(speed_mps) * around.pinhole.focal / around.scene_depth_m


def ground_range_m(around: Situation, y: float) -> float:
    """Range at which the ground is seen at image row ``y``, px; NaN at the horizon, above it, or unknown."""
    focal = around.pinhole.focal
    below = y - around.horizon_y
    if below > focal * around.pitch_sigma_rad and around.camera_height_m > 0:
        return around.camera_height_m * focal / max(below, 1.0)
    return NAN
