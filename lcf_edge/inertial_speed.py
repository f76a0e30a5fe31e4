"""Forward speed and pitch by the accelerometer alone, from one rest to the next. No clock, no I/O."""

from math import asin, hypot, inf, nan, sqrt

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

GRAVITY_MPS2 = 9.81
LARGEST_SPEED_MPS = 70.0  # no small vehicle is faster
_LEVEL_TIME_S = 30.0  # time constant of the accelerometer's pull on the gravity direction
_LEVEL_GRAVITY_ERROR_MPS2 = 0.03  # only while next to nothing but gravity acts
_SIGMA_ACCEL_MPS2 = 0.05  # 1 sigma of the forward acceleration just after a rest
_SIGMA_GAP_MPS2 = 3.0  # 1 sigma of the acceleration while no sample comes, or saturated ones
_SIGMA_ODOMETRY_MPS = 0.05
_SIGMA_LIMIT_MPS = 1.5  # beyond, the speed is unknown: about 7 s of driving with the default gyro noise


class InertialSpeed:
    """Forward speed by the accelerometer, from the last rest on; its uncertainty grows until it is unknown.

    The gravity direction is learnt at rest and turned along by the gyro, with a slow pull towards the
    accelerometer. What acts along the camera's forward, laid into the horizontal plane, is then acceleration:
    f · h, h = (z - (z·up) up) / |…|, free of gravity.
    """

    def __init__(self, gyro_noise_radps: float) -> None:
        self.mean_mps = nan  # over the last interval
        self.sigma_mps = inf
        self.pitch_rad = nan
        self._speed_mps = 0.0
        self._up: Floats | None = None  # unit vector in camera axes
        self._gravity_mps2 = GRAVITY_MPS2  # as this accelerometer shows it
        self._noise_radps = gyro_noise_radps
        self._since_rest_s = 0.0

    def may_stand(self) -> bool:
        """Whether standing still lies within the uncertainty; once all is unknown, it may."""
        return not self.sigma_mps <= _SIGMA_LIMIT_MPS or abs(self._speed_mps) <= 2 * self.sigma_mps

    def rest(self, accel_mps2: Floats) -> None:
        """Zero-velocity update, with the mean specific force (3,)."""
        self._gravity_mps2 = hypot(*accel_mps2)
        self._turn(accel_mps2)
        self._speed_mps = self.mean_mps = self.sigma_mps = self._since_rest_s = 0.0

    def correct(self, speed_mps: float) -> None:
        """Another source knows the speed."""
        if self._up is None:
            return
        self._speed_mps = speed_mps
        self.sigma_mps = min(self.sigma_mps, _SIGMA_ODOMETRY_MPS)

    def lose(self) -> None:
        """Nothing was measured."""
        self.mean_mps, self.sigma_mps, self.pitch_rad, self._up = nan, inf, nan, None

    def advance(self, dt_s: float, accel_mps2: Floats, rotation: Floats, gap_s: float) -> None:
        """Go on by ``dt_s`` with the mean specific force (3,) and the rotation (3, 3) over it."""
        if self._up is None:
            return
        up = rotation @ self._up
        half_way = self._up + up
        x, y, z = (half_way / max(hypot(*half_way), 1e-9)).tolist()
        along_up = x * accel_mps2[0] + y * accel_mps2[1] + z * accel_mps2[2]
        gained_mps = float(accel_mps2[2] - z * along_up) / sqrt(max(1 - z * z, 0.01)) * dt_s
        self.mean_mps = self._speed_mps + gained_mps / 2
        self._speed_mps += gained_mps
        self._since_rest_s += dt_s
        tilt_rad = self._noise_radps * min(self._since_rest_s, _LEVEL_TIME_S)
        self.sigma_mps += (_SIGMA_ACCEL_MPS2 + tilt_rad * self._gravity_mps2) * dt_s + _SIGMA_GAP_MPS2 * gap_s
        if self.sigma_mps > _SIGMA_LIMIT_MPS or abs(self._speed_mps) > LARGEST_SPEED_MPS:
            self.mean_mps, self.sigma_mps = nan, inf
        if abs(hypot(*accel_mps2) - self._gravity_mps2) < _LEVEL_GRAVITY_ERROR_MPS2:
            up = up + min(1.0, dt_s / _LEVEL_TIME_S) * (accel_mps2 / self._gravity_mps2 - up)
        self._turn(up)

    def _turn(self, up: Floats) -> None:
        self._up = up / hypot(*up)
        self.pitch_rad = asin(max(-1.0, min(1.0, self._up[2])))
