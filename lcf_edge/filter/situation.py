"""The vehicle at this instant: where it heads in the picture, what it is, how it moves."""

import math
from dataclasses import dataclass

import numpy as np

from lcf_edge.config import Camera, Config
from lcf_edge.filter.flow import Matrix, Pinhole
from lcf_edge.filter.inputs import Motion
from lcf_edge.filter.tables import Floats

PITCH_MEMORY_S = 1.0  # shaking faster than this turns the camera, not the way of the vehicle
YAW_MEMORY_S = 0.3


@dataclass(frozen=True, slots=True)
class Situation:
    """``focus``: O, px. ``horizon_y``: px. ``camera_height_m`` 0: unknown. ``speed_mps`` NaN: unknown.

    ``scene_flow_pxps``: image speed that V_ν gives a point at the configured depth of the scene, one focal length from
    O, so that the paper's bounds in V_ν have a unit in the picture; inf where V_ν is unknown. ``noise_px``: 1 sigma of
    an edge's position. ``delta_px``: δ over a chain of key frames.
    """

    pinhole: Pinhole
    focus: tuple[float, float]
    horizon_y: float
    camera_height_m: float
    half_width_m: float
    height_m: float
    horizon_s: float
    speed_mps: float
    yaw_rate_radps: float
    scene_flow_pxps: float
    noise_px: float
    delta_px: float
    focus_sigma_px: float
    ground_margin: float
    pitch_sigma_rad: float

    def ground_range_m(self, y: Floats) -> Floats:
        """Range at which the ground is seen at image rows ``y``, px; NaN at the horizon, above it, or unknown."""
        focal = self.pinhole.focal
        below = y - self.horizon_y
        seen = (below > focal * self.pitch_sigma_rad) & (self.camera_height_m > 0)
        return np.where(seen, self.camera_height_m * focal / np.maximum(below, 1), np.nan)


class Heading:
    """The direction of travel in the camera's axes: the mounting, and on top of it how the camera shakes."""

    def __init__(self, pinhole: Pinhole, camera: Camera) -> None:
        self._pinhole = pinhole
        self._mounted = np.array([-math.tan(camera.yaw_rad), math.tan(camera.pitch_rad), 1.0])
        self._ray = self._mounted.copy()  # third component 1

    @property
    def forward(self) -> Matrix:
        """Unit vector (3,), camera axes."""
        return np.asarray(self._ray / np.linalg.norm(self._ray))

    @property
    def focus(self) -> tuple[float, float]:
        """O: where the vehicle is heading, px."""
        pinhole = self._pinhole
        return pinhole.cx + pinhole.fx * float(self._ray[0]), pinhole.cy + pinhole.fy * float(self._ray[1])

    def turn(self, motion: Motion) -> None:
        """Shaking turns the camera and not the heading, a turn of the vehicle both."""
        shaken = motion.rotation @ self._ray
        shaken /= shaken[2]
        shaken[0] -= motion.yaw_rate_radps * motion.dt_s  # a left turn moves the picture to the right
        keep = np.exp(-motion.dt_s / np.array([YAW_MEMORY_S, PITCH_MEMORY_S, 1.0]))
        self._ray = self._mounted + keep * (shaken - self._mounted)


def situation(config: Config, pinhole: Pinhole, heading: Heading, motion: Motion) -> Situation:
    """What the experts need to know about this frame."""
    settings, vehicle = config.filter, config.vehicle
    focus, speed = heading.focus, motion.speed_mps
    return Situation(
        pinhole=pinhole,
        focus=focus,
        horizon_y=focus[1],
        camera_height_m=config.camera.height_m,
        half_width_m=vehicle.half_width_m,
        height_m=vehicle.height_m,
        horizon_s=vehicle.horizon_s,
        speed_mps=speed,
        yaw_rate_radps=motion.yaw_rate_radps,
        scene_flow_pxps=abs(speed) * pinhole.focal / settings.scene_depth_m if math.isfinite(speed) else math.inf,
        noise_px=settings.edge_noise_px,
        delta_px=settings.delta_rebel_px,
        focus_sigma_px=settings.focus_sigma_px,
        ground_margin=settings.ground_margin,
        pitch_sigma_rad=settings.pitch_sigma_rad,
    )
