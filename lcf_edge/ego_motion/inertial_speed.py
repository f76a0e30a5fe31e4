"""Forward speed and pitch from the accelerometer alone, from one rest to the next. No clock, no I/O."""

from collections import deque
from collections.abc import Sequence
from math import hypot, inf, nan, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

GRAVITY_MPS2 = 9.81
MAX_SPEED_MPS = 70.0  # no small vehicle is faster
_LEVEL_TIME_S = 30.0  # time constant with which the gravity direction follows the accelerometer,
_LEVEL_GRAVITY_ERROR_MPS2 = 0.03  # if the force differs from gravity by no more than this
_SIGMA_ACCEL_MPS2 = 0.05  # 1 sigma of the forward acceleration just after a rest
_SIGMA_GAP_MPS2 = 3.0  # 1 sigma of the acceleration while no sample comes, or saturated ones
_SIGMA_ODOMETRY_MPS = 0.05
_ZERO_MPS = 0.15  # largest speed, with 2 sigma, that counts as 0
_LATE_S = 0.3  # delay with which the end of a rest is noticed
_SIGMA_LIMIT_MPS = 1.5  # beyond, the speed is unknown: about 7 s of driving with the default gyro noise


class _Moment(NamedTuple):
    """Measurements of one frame at rest, and gravity as known before."""

    dt_s: float
    accel_mps2: Sequence[float]
    rotation: Floats
    up: tuple[float, float, float] | None
    gravity_mps2: float


class InertialSpeed:
    """Forward speed from the accelerometer since the last rest; its uncertainty grows until it is unknown.

    The gravity direction is learnt at rest, propagated by the gyro, and slowly corrected by the accelerometer. The
    force along the camera's forward axis, projected into the horizontal plane, is then acceleration: f · h, h = (z -
    (z·up) up) / |…|, free of gravity. The end of a rest is noticed late: measurements of its last moments are kept and
    then integrated, with gravity from before them.
    """

    def __init__(self, gyro_noise_radps: float) -> None:
        self.mean_mps = nan  # over the last interval
        self.sigma_mps = inf
        self._speed_mps = 0.0
        self._up: tuple[float, float, float] | None = None  # unit vector in camera axes
        self._gravity_mps2 = GRAVITY_MPS2  # as this accelerometer measures it
        self._noise_radps = gyro_noise_radps
        self._since_rest_s = 0.0
        self._late: deque[_Moment] = deque()

    def may_stand(self) -> bool:
        """Whether the vehicle may be stationary, within the uncertainty; true while the speed is unknown."""
        return not self.sigma_mps <= _SIGMA_LIMIT_MPS or abs(self._speed_mps) <= 2 * self.sigma_mps

    def is_zero(self) -> bool:
        """Whether the speed is known to be about 0."""
        return abs(self._speed_mps) + 2 * self.sigma_mps <= _ZERO_MPS

    def rest(self, mean_mps2: Sequence[float], dt_s: float, accel_mps2: Sequence[float], rotation: Floats) -> None:
        """Zero-velocity update, with the mean specific force (3,) of the rest, and what ``advance`` takes."""
        late = self._late
        late.append(_Moment(dt_s, accel_mps2, rotation, self._up, self._gravity_mps2))
        while sum(each.dt_s for each in late) > _LATE_S:
            late.popleft()
        self._gravity_mps2 = hypot(*mean_mps2)
        self._turn(*mean_mps2)
        self._speed_mps = self.mean_mps = self.sigma_mps = self._since_rest_s = 0.0

    def correct(self, speed_mps: float) -> None:
        """Take the speed from another source, m/s."""
        if self._up is None:
            return
        self._speed_mps = speed_mps
        self.sigma_mps = min(self.sigma_mps, _SIGMA_ODOMETRY_MPS)

    def see_ground(self, error_mps: float, sigma_mps: float) -> None:
        """Correct the speed by the ground's: by how much it is too low, m/s, with 1 sigma."""
        if self._up is None or not self.sigma_mps < inf:
            return
        variance = self.sigma_mps**2
        gain = variance / (variance + sigma_mps**2)
        self._speed_mps += gain * error_mps
        self.sigma_mps = sqrt((1 - gain) * variance)

    def lose(self) -> None:
        """Make the speed unknown: nothing was measured."""
        self.mean_mps, self.sigma_mps, self._up = nan, inf, None
        self._late.clear()

    def advance(self, dt_s: float, accel_mps2: Sequence[float], rotation: Floats, gap_s: float) -> None:
        """Advance by ``dt_s`` with the mean specific force (3,) and the rotation (3, 3) over it."""
        late, self._late = self._late, deque()
        if late and late[0].up is not None:
            self._up, self._gravity_mps2 = late[0].up, late[0].gravity_mps2
            for each in late:
                self.advance(each.dt_s, each.accel_mps2, each.rotation, 0.0)
        if self._up is None:
            return
        ax, ay, az = accel_mps2
        before_x, before_y, before_z = self._up
        ux, uy, uz = (a * before_x + b * before_y + c * before_z for a, b, c in rotation.tolist())
        x, y, z = before_x + ux, before_y + uy, before_z + uz  # at the middle of the interval
        size = max(hypot(x, y, z), 1e-9)
        x, y, z = x / size, y / size, z / size
        along_up = x * ax + y * ay + z * az
        gained_mps = (az - z * along_up) / sqrt(max(1 - z * z, 0.01)) * dt_s
        self.mean_mps = self._speed_mps + gained_mps / 2
        self._speed_mps += gained_mps
        self._since_rest_s += dt_s
        tilt_rad = self._noise_radps * min(self._since_rest_s, _LEVEL_TIME_S)
        self.sigma_mps += (_SIGMA_ACCEL_MPS2 + tilt_rad * self._gravity_mps2) * dt_s + _SIGMA_GAP_MPS2 * gap_s
        if self.sigma_mps > _SIGMA_LIMIT_MPS or abs(self._speed_mps) > MAX_SPEED_MPS:
            self.mean_mps, self.sigma_mps = nan, inf
        if abs(hypot(*accel_mps2) - self._gravity_mps2) < _LEVEL_GRAVITY_ERROR_MPS2:
            share, gravity_mps2 = min(1.0, dt_s / _LEVEL_TIME_S), self._gravity_mps2
            ux += share * (ax / gravity_mps2 - ux)
            uy += share * (ay / gravity_mps2 - uy)
            uz += share * (az / gravity_mps2 - uz)
        self._turn(ux, uy, uz)

    def _turn(self, x: float, y: float, z: float) -> None:
        """Set the direction of up."""
        size = hypot(x, y, z)
        self._up = x / size, y / size, z / size
