"""What a rendered drive is: vehicle motion, camera, sensors and the boxes that stand and move in the world.

World axes: x right, y down, z forward at the start; the ground is y = 0. Headings turn left positive, in
rad, and are 0 along z. Times are seconds from the first image.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
LensModel = Literal["none", "radial-tangential", "equidistant"]
Axis = Literal["pitch", "roll", "yaw", "heave"]

START_NS = 1_700_000_000_000_000_000
"""Stamp of the first image, ns."""


def stamp_ns(time_s: float) -> int:
    """Stamp of a time of the drive."""
    return START_NS + round(time_s * 1e9)


@dataclass(frozen=True)
class Profile:
    """A quantity over time: straight lines between knots (time s, value), constant before and after."""

    knots: tuple[tuple[float, float], ...]

    @cached_property
    def _columns(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Knot times, values, integral up to each knot, slope after each knot."""
        times, values = np.array(self.knots, dtype=np.float64).T
        steps = np.diff(times)
        integral = np.concatenate([[0.0], np.cumsum(steps * (values[1:] + values[:-1]) / 2)])
        return times, values, integral, np.append(np.diff(values) / steps, 0.0)

    def at(self, time_s: Floats) -> Floats:
        """Value at each time."""
        times, values, _, _ = self._columns
        return np.interp(time_s, times, values)

    def slope(self, time_s: Floats) -> Floats:
        """Change per second at each time."""
        times, _, _, slopes = self._columns
        knot = np.searchsorted(times, time_s, side="right") - 1
        return np.where(knot < 0, 0.0, slopes[np.maximum(knot, 0)])

    def integral(self, time_s: Floats) -> Floats:
        """Exact integral from the first knot to each time."""
        times, values, integral, _ = self._columns
        knot = np.maximum(np.searchsorted(times, time_s, side="right") - 1, 0)
        since = time_s - times[knot]
        return integral[knot] + values[knot] * since + self.slope(time_s) * since**2 / 2


@dataclass(frozen=True, slots=True)
class Shake:
    """One sine of the vibration: rad for an angle, m for heave (up positive)."""

    axis: Axis
    amplitude: float
    frequency_hz: float
    phase_rad: float


@dataclass(frozen=True, slots=True)
class Paint:
    """How a surface looks: everything follows from the seed."""

    seed: int
    contrast: float = 1.0
    feature_m: float = 0.15  # size of its larger marks
    grey: float = 128.0  # in the mean
    tile_m: float = 0.0  # the marks repeat at this distance; 0: they do not


@dataclass(frozen=True, slots=True)
class Box:
    """A cuboid that stands on the ground; it moves along straight lines between the knots of its path."""

    name: str
    width_m: float  # across its heading
    height_m: float
    length_m: float  # along its heading
    path: tuple[tuple[float, float, float], ...]  # (time s, x m, z m); one knot: it stands still
    heading_rad: float = 0.0
    paint: Paint = Paint(0)
    sway_m: float = 0.0  # by which its top swings along x
    sway_hz: float = 0.0

    def top_offset(self, time_s: float) -> float:
        """By how much its top hangs over along x, m."""
        return self.sway_m * math.sin(2 * math.pi * (self.sway_hz * time_s + self.heading_rad))

    def _segment(self, time_s: float) -> int:
        return sum(time_s >= knot[0] for knot in self.path[1:-1])

    def position(self, time_s: float) -> Floats:
        """Centre of its footprint (x, z) in m; the end segments go on beyond the path."""
        since_s, x, z = self.path[self._segment(time_s)]
        middle: Floats = np.array([x, z]) + self.velocity(time_s) * (time_s - since_s)
        return middle

    def velocity(self, time_s: float) -> Floats:
        """(x, z) in m/s."""
        if len(self.path) == 1:
            return np.zeros(2)
        segment = self._segment(time_s)
        (t0, x0, z0), (t1, x1, z1) = self.path[segment : segment + 2]
        return np.array([x1 - x0, z1 - z0]) / (t1 - t0)

    def footprint(self, time_s: float) -> Floats:
        """(4, 2) corners (x, z) in m: back left, back right, front right, front left."""
        sine, cosine = math.sin(self.heading_rad), math.cos(self.heading_rad)
        right = np.array([cosine, sine]) * self.width_m / 2
        ahead = np.array([-sine, cosine]) * self.length_m / 2
        corners: Floats = np.array([-right - ahead, right - ahead, right + ahead, ahead - right])
        corners += self.position(time_s)
        return corners


@dataclass(frozen=True, slots=True)
class Lamp:
    """A bright rectangle in the ceiling."""

    x_m: float
    z_m: float
    width_m: float
    length_m: float


@dataclass(frozen=True, slots=True)
class Shadow:
    """A rectangle of the ground that gets less light: of the vehicle itself, or of something that is not in sight."""

    right_m: float  # of its middle, beside the vehicle
    ahead_m: float
    width_m: float
    length_m: float
    share: float  # of the light that is missing
    velocity_mps: float = 0.0  # to the right; it passes ``right_m`` in the middle of the drive


@dataclass(frozen=True, slots=True)
class Drop:
    """A drop of water on the lens: out of focus, it shows the scene upside down; or dirt, which is dark."""

    x_px: float
    y_px: float
    radius_px: float
    is_dirt: bool = False


@dataclass(frozen=True, slots=True)
class Lens:
    """The camera: pinhole with an optional distortion of the finished image (OpenCV's coefficients)."""

    width: int = 640
    height: int = 480
    focal_px: float = 500.0
    model: LensModel = "none"
    distortion: tuple[float, ...] = ()
    vignetting: float = 0.0  # light lost in the image's corners, 0..1

    @property
    def matrix(self) -> Floats:
        """K; pixel centres are whole numbers."""
        cx, cy = (self.width - 1) / 2, (self.height - 1) / 2
        return np.array([[self.focal_px, 0.0, cx], [0.0, self.focal_px, cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, slots=True)
class SensorNoise:
    """What is wrong with the sensors; the defaults are a calibrated MPU-6050 and wheel odometry."""

    gyro_bias_radps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gyro_radps: float = 0.003  # 1 sigma a sample
    accel_bias_mps2: tuple[float, float, float] = (0.0, 0.0, 0.0)
    accel_mps2: float = 0.06
    speed_scale: float = 1.0
    speed_mps: float = 0.01
    yaw_rate_radps: float = 0.005
    image: float = 2.0  # grey levels


@dataclass(frozen=True)
class Drive:
    """A drive, whole: the same drive renders to the same bytes."""

    kind: str
    seed: int
    seconds: float
    fps: float
    speed: Profile  # m/s
    yaw_rate: Profile  # rad/s, left positive
    boxes: tuple[Box, ...]
    lens: Lens = Lens()
    noise: SensorNoise = SensorNoise()
    shakes: tuple[Shake, ...] = ()
    gain: Profile = field(default=Profile(((0.0, 1.0),)))  # of the exposure
    exposure_s: float = 0.0  # motion blur over this time
    readout_s: float = 0.0  # from the first row to the last, the stamp in the middle (rolling shutter)
    shadows: tuple[Shadow, ...] = ()
    sharpening: float = 0.0  # by the camera: this times what a smoother image lacks is added
    camera_height_m: float = 0.5
    camera_ahead_m: float = 0.0  # of the axle, which moves along the heading
    camera_pitch_rad: float = 0.0  # positive: looks up
    ground: Paint = Paint(0)
    sky: Paint = Paint(1)
    lamps: tuple[Lamp, ...] = ()
    ceiling_m: float = 3.0  # where they hang
    gloss: float = 0.0  # share of their light that the floor mirrors
    own_parts: tuple[tuple[tuple[float, float], ...], ...] = ()  # polygons of the vehicle in the image, px
    drops: tuple[Drop, ...] = ()
    half_width_m: float = 0.6  # of the vehicle
    horizon_s: float = 4.0  # contact later than this is no threat yet
