"""What a source delivers: pictures, inertial samples, speeds.

SI units and the camera's axes: x right, y down, z forward.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture."""

    stamp_ns: int  # start of exposure
    seq: int  # counts pictures of the source, gaps tell drops
    image: npt.NDArray[np.uint8]  # (height, width) luminance


@dataclass(frozen=True, slots=True)
class ImuSample:
    """One inertial sample."""

    stamp_ns: int
    gyro: tuple[float, float, float]  # rad/s
    accel: tuple[float, float, float]  # m/s², specific force: at rest it points away from the ground


@dataclass(frozen=True, slots=True)
class SpeedSample:
    """One reading of the vehicle's own odometry."""

    stamp_ns: int
    speed_mps: float  # forward positive
    yaw_rate_radps: float  # turning left positive (z up), NaN: unknown
