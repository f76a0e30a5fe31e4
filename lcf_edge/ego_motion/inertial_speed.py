"""Forward speed from the accelerometer, corrected by the ground in view or odometry. No clock, no I/O."""

from collections import deque
from collections.abc import Sequence
from math import hypot, inf, nan, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcf_edge.ego_motion.speed_and_rate import SpeedAndRate

Floats = npt.NDArray[np.float64]

GRAVITY_MPS2 = 9.81
MAX_SPEED_MPS = 70.0  # no small vehicle is faster
_LEVEL_TIME_S = 30.0  # time constant with which the gravity direction follows the accelerometer,
_LEVEL_GRAVITY_ERROR_MPS2 = 0.03  # if the force differs from gravity by no more than this
_SIGMA_REST_MPS2 = 0.05  # 1 sigma of the accelerometer's error just after a rest,
_SIGMA_BEGIN_MPS2 = 1.0  # and where up was found while driving: it includes the acceleration then
_BEGIN_S = 0.3  # over which it is found,
_BEGIN_GRAVITY_ERROR_MPS2 = 0.8  # if the mean force differs from gravity by no more than this
_TILT_TIME_S = 8.0  # the gyro's noise adds up over this time to an error of up
_SIGMA_GAP_MPS2 = 3.0  # 1 sigma of the acceleration while no sample comes, or saturated ones
_SIGMA_ODOMETRY_MPS = 0.05
_ZERO_MPS = 0.15  # largest speed, with 2 sigma, that counts as 0
_LATE_S = 0.3  # delay with which the end of a rest is noticed
_SIGMA_LIMIT_MPS = 1.5  # beyond, the speed is unknown: about 7 s of driving with the default gyro noise
_REMEMBERED_S = 3.0  # longest window of which a mean speed can be taken


class _Moment(NamedTuple):
    """Measurements of one frame before up is known, or at rest, with up as known before."""

    dt_s: float
    accel_mps2: Sequence[float]
    rotation: Floats
    up: tuple[float, float, float] | None = None
    gravity_mps2: float = GRAVITY_MPS2


class InertialSpeed:
    """Forward speed from the accelerometer: a Kalman filter of it and of the accelerometer's error.

    Up, the direction of gravity, is learnt at rest, or at first from the mean force; it is propagated by the gyro, and
    slowly corrected by the accelerometer. The force along the camera's forward axis, projected into the horizontal
    plane, is then acceleration: f · h, h = (z - (z·up) up) / |…|, free of gravity. What a wrong up leaves in it is the
    error. The end of a rest is noticed late: measurements of its last moments are kept and then integrated, with
    up from before them, if that was known.
    """

    def __init__(self, gyro_noise_radps: float) -> None:
        self.mean_mps = nan  # over the last interval
        self._state = SpeedAndRate()  # rate: what the accelerometer does not measure, its error with the sign reversed
        self._up: tuple[float, float, float] | None = None  # unit vector in camera axes
        self._gravity_mps2 = GRAVITY_MPS2  # as this accelerometer measures it
        self._noise_radps = gyro_noise_radps
        self._late: deque[_Moment] = deque()
        self._gains: deque[tuple[float, float]] = deque()  # of the last frames: time, s, and measured gain of speed

    @property
    def sigma_mps(self) -> float:
        """1 sigma of the speed, infinite: unknown."""
        return self._state.sigma_mps

    def may_stand(self) -> bool:
        """Whether the vehicle may be stationary, within the uncertainty; true while the speed is unknown."""
        return not self.sigma_mps <= _SIGMA_LIMIT_MPS or abs(self._state.speed_mps) <= 2 * self.sigma_mps

    def is_zero(self) -> bool:
        """Whether the speed is known to be about 0."""
        return abs(self._state.speed_mps) + 2 * self.sigma_mps <= _ZERO_MPS

    def rest(self, mean_mps2: Sequence[float], dt_s: float, accel_mps2: Sequence[float], rotation: Floats) -> None:
        """Zero-velocity update, with the mean specific force (3,) of the rest, and what ``advance`` takes."""
        late = self._late
        up = self._up if self.sigma_mps < inf else None
        late.append(_Moment(dt_s, accel_mps2, rotation, up, self._gravity_mps2))
        while sum(each.dt_s for each in late) > _LATE_S:
            late.popleft()
        self._gravity_mps2 = hypot(*mean_mps2)
        self._turn(*mean_mps2)
        self.mean_mps = 0.0
        self._state.begin(0.0, 0.0, _SIGMA_REST_MPS2)
        self._remember(dt_s, 0.0)

    def lose(self) -> None:
        """Make the speed unknown: nothing was measured."""
        self.mean_mps, self._up = nan, None
        self._state.lose()
        self._late.clear()
        self._gains.clear()

    def advance(self, dt_s: float, accel_mps2: Sequence[float], rotation: Floats, gap_s: float) -> None:
        """Advance by ``dt_s`` with the mean specific force (3,) and the rotation (3, 3) over it."""
        if self._up is None:
            self._begin(_Moment(dt_s, accel_mps2, rotation))
            return
        late, self._late = self._late, deque()
        if late and late[0].up is not None:
            self._up, self._gravity_mps2 = late[0].up, late[0].gravity_mps2
            for _ in late:
                self._gains.pop()
            for each in late:
                self.advance(each.dt_s, each.accel_mps2, each.rotation, 0.0)
        ax, ay, az = accel_mps2
        before_x, before_y, before_z = self._up
        ux, uy, uz = (a * before_x + b * before_y + c * before_z for a, b, c in rotation.tolist())
        x, y, z = before_x + ux, before_y + uy, before_z + uz  # at the middle of the interval
        size = max(hypot(x, y, z), 1e-9)
        x, y, z = x / size, y / size, z / size
        along_up = x * ax + y * ay + z * az
        measured_mps = (az - z * along_up) / sqrt(max(1 - z * z, 0.01)) * dt_s
        self._remember(dt_s, measured_mps)
        gained_mps = measured_mps + self._state.rate_mps2 * dt_s
        self.mean_mps = self._state.speed_mps + gained_mps / 2 if self.sigma_mps < inf else nan
        self._state.speed_mps += gained_mps
        self._doubt(dt_s, gap_s)
        if abs(hypot(*accel_mps2) - self._gravity_mps2) < _LEVEL_GRAVITY_ERROR_MPS2:
            share, gravity_mps2 = min(1.0, dt_s / _LEVEL_TIME_S), self._gravity_mps2
            ux += share * (ax / gravity_mps2 - ux)
            uy += share * (ay / gravity_mps2 - uy)
            uz += share * (az / gravity_mps2 - uz)
        self._turn(ux, uy, uz)

    def see_odometry(self, speed_mps: float, dt_s: float) -> None:
        """Take the mean speed over the last ``dt_s`` by odometry."""
        self.see_mean(speed_mps, _SIGMA_ODOMETRY_MPS, dt_s)

    def see_mean(self, speed_mps: float, sigma_mps: float, window_s: float) -> None:
        """Take the mean speed over the last ``window_s``, with 1 sigma; ignored if less than half is remembered."""
        left_s, gained_mps, sum_m = window_s, 0.0, 0.0
        for dt_s, measured_mps in reversed(self._gains):
            part_s = min(left_s, dt_s)
            part_mps = measured_mps * part_s / max(dt_s, 1e-9)
            sum_m += (gained_mps + part_mps / 2) * part_s
            gained_mps += part_mps
            left_s -= part_s
            if left_s <= 0:
                break
        seen_s = window_s - left_s
        if self._up is None or seen_s <= window_s / 2:
            return
        since_mps = sum_m / seen_s * (window_s / seen_s)  # by how much it is faster now, by the accelerometer
        self._state.see(speed_mps + since_mps, sigma_mps, window_s / 2)

    def _begin(self, moment: _Moment) -> None:
        """Find up from the mean force of the first moments; the speed is not known by that."""
        late = self._late
        late.append(moment)
        if sum(each.dt_s for each in late) < _BEGIN_S:
            return
        mean_mps2 = [sum(each.accel_mps2[k] for each in late) / len(late) for k in range(3)]
        if abs(hypot(*mean_mps2) - GRAVITY_MPS2) > _BEGIN_GRAVITY_ERROR_MPS2:
            late.popleft()
            return
        self._gravity_mps2 = GRAVITY_MPS2
        self._turn(*mean_mps2)
        self._state.begin(0.0, inf, _SIGMA_BEGIN_MPS2)
        self._late = deque()
        for each in late:
            self.advance(each.dt_s, each.accel_mps2, each.rotation, 0.0)

    def _remember(self, dt_s: float, measured_mps: float) -> None:
        """Keep what the accelerometer measured in a frame."""
        self._gains.append((dt_s, measured_mps))
        while sum(dt_s for dt_s, _ in self._gains) > _REMEMBERED_S:
            self._gains.popleft()

    def _doubt(self, dt_s: float, gap_s: float) -> None:
        """Let the uncertainty of a frame accrue."""
        state, tilted_mps2 = self._state, self._noise_radps * self._gravity_mps2
        state.advance(dt_s)
        state.rate_var += tilted_mps2**2 * _TILT_TIME_S * dt_s
        state.sigma_mps = hypot(state.sigma_mps, _SIGMA_GAP_MPS2 * gap_s)
        if state.sigma_mps > _SIGMA_LIMIT_MPS or abs(state.speed_mps) > MAX_SPEED_MPS:
            self.mean_mps = nan
            state.lose()

    def _turn(self, x: float, y: float, z: float) -> None:
        """Set the direction of up."""
        size = hypot(x, y, z)
        self._up = x / size, y / size, z / size
