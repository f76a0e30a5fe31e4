"""What sources deliver: frames, inertial samples, speeds.

SI units. An IMU's samples are in its own axes; ``imu.axes`` maps them to the camera's: x right, y down, z forward.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

STANDARD_GRAVITY_MPS2 = 9.80665  # the g of data sheets


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame: an image with its stamp and number."""

    stamp_ns: int  # start of exposure
    seq: int  # image counter of the source; gaps are dropped images
    image: npt.NDArray[np.uint8]  # (height, width) luminance


@dataclass(frozen=True, slots=True)
class ImuSample:
    """One inertial sample."""

    stamp_ns: int
    gyro: tuple[float, float, float]  # rad/s
    accel: tuple[float, float, float]  # m/s², specific force: at rest it points away from the ground
    saturated: bool = False  # an axis was at full scale


@dataclass(frozen=True, slots=True)
class SpeedSample:
    """One reading of the vehicle's own odometry."""

    stamp_ns: int
    speed_mps: float  # forward positive
    yaw_rate_radps: float  # turning left positive (z up), NaN: unknown
