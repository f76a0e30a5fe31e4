"""Ego-motion: how the camera turned and how fast the vehicle drove between two exposures.

Camera axes: x right, y down, z forward (taken for the vehicle's forward). With body rates ω the camera's
orientation follows Ṙ = R·[ω]×, so a direction that stands still turns by exp(-[ω]× dt) in the camera's axes.
No clock, no I/O; memory is two fixed rings of samples.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, cos, expm1, hypot, inf, isfinite, nan, sin, sqrt

import numpy as np
import numpy.typing as npt

from drivers.records import ImuSample, SpeedSample
from lcf_edge.config import Imu, Vehicle

Floats = npt.NDArray[np.float64]

IMU_CAPACITY = 1024
SPEED_CAPACITY = 256

# What no small vehicle does, and no stamp says.
_LARGEST_GYRO_RADPS = 40.0
_LARGEST_ACCEL_MPS2 = 200.0
_LARGEST_SPEED_MPS = 70.0
_LARGEST_STAMP_NS = 2**62
_RESTART_AFTER = 5  # samples in order, but behind the newest: then the newest was wrong

_GRAVITY_MPS2 = 9.81
_GAP_S = 0.05  # or five sample intervals: longer without a sample is a gap
_FRESH_S = 0.5  # older odometry is stale

# Standing still: both sensors quiet for this long, and nothing that says otherwise.
_REST_S = 0.5
_REST_GYRO_STD_RADPS = 0.01
_REST_ACCEL_STD_MPS2 = 0.1
_REST_GYRO_RADPS = 0.1  # also the largest bias that is learnt
_REST_GRAVITY_ERROR_MPS2 = 0.8
_REST_SPEED_MPS = 0.02
_REST_YAW_RADPS = 0.02
_BIAS_TIME_S = 5.0  # time constant of the average over later rests

# Rotation, 1 sigma of the rate where nothing measures it.
_SIGMA_HELD_RADPS = 0.05  # the last sample is held
_SIGMA_ODOMETRY_RADPS = 0.05  # odometry knows yaw alone
_SIGMA_UNKNOWN_RADPS = 0.1
_SIGMA_SATURATED_RADPS = 1.0  # how far beyond the end of its range the gyro turns

# Speed from the accelerometer.
_LEVEL_TIME_S = 30.0  # time constant of the accelerometer's pull on the gravity direction
_LEVEL_GRAVITY_ERROR_MPS2 = 0.03  # only while next to nothing but gravity acts
_SIGMA_ACCEL_MPS2 = 0.05  # 1 sigma of the forward acceleration just after a rest
_SIGMA_GAP_MPS2 = 3.0  # 1 sigma of the acceleration while no sample comes, or saturated ones
_SIGMA_ODOMETRY_MPS = 0.05
_SHAKE_S = 0.4  # a yaw rate that does not last this long is the camera shaking, not the vehicle turning
_SIGMA_LIMIT_MPS = 1.5  # beyond, the speed is unknown: about 7 s of driving with the default gyro noise


@dataclass(frozen=True, slots=True)
class EgoMotion:
    """Motion between the previous exposure and the present one."""

    dt_s: float
    rotation: Floats  # (3, 3), a direction in the previous camera axes → in the present ones
    rotation_sigma_rad: float  # 1 sigma of the rotation's angle
    speed_mps: float  # forward, mean over the interval, NaN: unknown
    yaw_rate_radps: float  # of the camera, turning left positive, mean over the interval
    path_yaw_rate_radps: float  # of the vehicle: odometry's, else the camera's without its shaking
    gravity_pitch_rad: float  # of the optical axis over the horizon, up positive, NaN: never stood still yet
    notes: tuple[str, ...]  # what degrades it; docs/replay.md lists them


@dataclass(frozen=True, slots=True)
class _Span:
    """From one exposure to the next."""

    start_ns: int
    end_ns: int

    @property
    def dt_s(self) -> float:
        return (self.end_ns - self.start_ns) * 1e-9


class EgoMotionEstimator:
    """Takes IMU and odometry samples; answers with the motion from each exposure to the next.

    ``refused`` counts the samples that were not used, or not trusted, by sensor and reason. ``gyro_bias_radps``: (3,),
    learnt while the vehicle stands still.
    """

    def __init__(self, imu: Imu, vehicle: Vehicle) -> None:
        self.refused: Counter[str] = Counter()
        self.gyro_bias_radps: Floats = np.zeros(3)
        self._vehicle = vehicle
        self._axes = np.array(imu.axes).T if imu.axes else None
        self._offset_ns = round(imu.time_offset_s * 1e9)
        self._noise_radps = imu.gyro_noise_radps
        self._imu = _Ring("imu", IMU_CAPACITY, 7, self.refused)  # gyro, specific force, whether saturated
        self._odometry = _Ring("speed", SPEED_CAPACITY, 2, self.refused)  # speed, yaw rate
        self._inertial = _InertialSpeed(imu.gyro_noise_radps)
        self._bias_known = False
        self._path_yaw_radps = 0.0
        self._stamp_ns: int | None = None

    def add_imu(self, sample: ImuSample) -> None:
        """Take a sample, in time order; one that is not finite, absurd or late is refused and counted."""
        values = (*sample.gyro, *sample.accel)
        if not all(map(isfinite, values)):
            self._imu.refuse("not finite")
        elif hypot(*sample.gyro) > _LARGEST_GYRO_RADPS or hypot(*sample.accel) > _LARGEST_ACCEL_MPS2:
            self._imu.refuse("out of range")
        else:
            if sample.saturated:
                self._imu.refuse("saturated")
            row = values if self._axes is None else (np.reshape(values, (2, 3)) @ self._axes).ravel()
            self._imu.add(sample.stamp_ns + self._offset_ns, (*row, sample.saturated))

    def add_speed(self, sample: SpeedSample) -> None:
        """Take a sample, in time order; one that is not finite, absurd or late is refused and counted."""
        if not isfinite(sample.speed_mps):
            self._odometry.refuse("not finite")
        elif abs(sample.speed_mps) > _LARGEST_SPEED_MPS or abs(sample.yaw_rate_radps) > _LARGEST_GYRO_RADPS:
            self._odometry.refuse("out of range")
        else:
            self._odometry.add(sample.stamp_ns, (sample.speed_mps, sample.yaw_rate_radps))

    def advance(self, stamp_ns: int) -> EgoMotion:
        """The motion over (previous stamp, ``stamp_ns``], from the samples taken so far.

        The first frame has no interval; neither has one whose stamp goes back, which is counted.

        ``rotation_sigma_rad`` is the sum of gyro noise · dt (what is left of the bias), gyro noise ·
        √(dt · sample interval) (white noise), and stated rates over what was held, missed, saturated or never
        measured.
        """
        notes: list[str] = []
        if self._stamp_ns is None:
            notes.append("first frame")
            self._stamp_ns = stamp_ns
        if stamp_ns < self._stamp_ns:
            self.refused["frame stamp goes back"] += 1
            stamp_ns = self._stamp_ns
        span = _Span(self._stamp_ns, stamp_ns)
        self._stamp_ns = self._imu.used_ns = self._odometry.used_ns = stamp_ns

        odometry_mps, odometry_yaw_radps = nan, nan
        if self._odometry.age_s(stamp_ns) <= _FRESH_S:
            odometry_mps, odometry_yaw_radps = _mean(*self._odometry.between(span)).tolist()
        period_s = self._imu.period_s()
        gap_limit_s = max(_GAP_S, 5 * period_s)
        if self._imu.covers(span, gap_limit_s):
            at_rest = self._learn_rest(span, gap_limit_s, odometry_mps)
            held_s, gap_s = self._imu.unmeasured_s(span, gap_limit_s)
            if gap_s > 0:
                notes.append("imu gap")
            times_s, values = self._imu.between(span)
            mean = _mean(times_s, values)
            saturated_s = float(mean[6]) * span.dt_s
            if saturated_s > 0:
                notes.append("imu saturated")
            values[:, :3] -= self.gyro_bias_radps
            rates, steps_s = values[:, :3], np.diff(times_s)
            rotation = _turned(-0.5 * (rates[1:] + rates[:-1]) * steps_s[:, None])
            yaw_rate_radps = float(self.gyro_bias_radps[1] - mean[1])
            sigma_rad = self._noise_radps * (span.dt_s + sqrt(span.dt_s * period_s))
            sigma_rad += _SIGMA_HELD_RADPS * held_s + _SIGMA_UNKNOWN_RADPS * gap_s
            sigma_rad += _SIGMA_SATURATED_RADPS * saturated_s
            if not at_rest:
                self._inertial.advance(span.dt_s, mean[3:6], rotation, gap_s + saturated_s)
        else:
            notes.append("no imu")
            yaw_rate_radps, sigma_rad = 0.0, _SIGMA_UNKNOWN_RADPS * span.dt_s
            if isfinite(odometry_yaw_radps):
                notes.append("rotation from odometry")
                yaw_rate_radps, sigma_rad = odometry_yaw_radps, _SIGMA_ODOMETRY_RADPS * span.dt_s
            rotation = _turned(np.array([[0.0, yaw_rate_radps * span.dt_s, 0.0]]))
            self._inertial.lose()
        speed_mps = self._choose_speed(span, odometry_mps, notes)
        pitch_rad = self._inertial.pitch_rad
        if isfinite(odometry_yaw_radps):
            self._path_yaw_radps = odometry_yaw_radps
        else:
            share = -expm1(-span.dt_s / _SHAKE_S)
            self._path_yaw_radps += share * (yaw_rate_radps - self._path_yaw_radps)
        return EgoMotion(
            span.dt_s,
            rotation,
            sigma_rad,
            speed_mps,
            yaw_rate_radps,
            self._path_yaw_radps,
            pitch_rad,
            tuple(notes),
        )

    def _learn_rest(self, span: _Span, gap_limit_s: float, odometry_mps: float) -> bool:
        """Whether the vehicle stands still; then the gyro's mean is its bias, the accelerometer's is up."""
        if not self._may_stand(span.end_ns, odometry_mps):
            return False
        window = self._imu.latest(span.end_ns, _REST_S, gap_limit_s)
        if window is None:
            return False
        mean = window.mean(axis=0)
        offset = window - mean
        variance = np.einsum("ij,ij->j", offset, offset) / len(window)
        gyro_radps, accel_mps2 = hypot(*mean[:3]), hypot(*mean[3:6])
        if (
            max(variance[:3]) > _REST_GYRO_STD_RADPS**2
            or max(variance[3:6]) > _REST_ACCEL_STD_MPS2**2
            or gyro_radps > _REST_GYRO_RADPS
            or abs(accel_mps2 - _GRAVITY_MPS2) > _REST_GRAVITY_ERROR_MPS2
        ):
            return False
        share = min(1.0, span.dt_s / _BIAS_TIME_S) if self._bias_known else 1.0
        self.gyro_bias_radps = self.gyro_bias_radps + share * (mean[:3] - self.gyro_bias_radps)
        self._bias_known = True
        self._inertial.rest(mean[3:6])
        return True

    def _may_stand(self, stamp_ns: int, odometry_mps: float) -> bool:
        """Odometry says that it stands; without odometry, the accelerometer does not say that it drives."""
        if not isfinite(odometry_mps):
            return self._inertial.may_stand()
        if abs(odometry_mps) > _REST_SPEED_MPS:
            return False
        window = self._odometry.latest(stamp_ns, _REST_S, inf)
        return window is not None and not (np.abs(window) > (_REST_SPEED_MPS, _REST_YAW_RADPS)).any()

    def _choose_speed(self, span: _Span, odometry_mps: float, notes: list[str]) -> float:
        """Mean speed over the interval by ``vehicle.speed_source``, m/s; NaN: unknown."""
        source, constant_mps = self._vehicle.speed_source, self._vehicle.speed_mps
        if source in ("auto", "odometry", "zenoh") and isfinite(odometry_mps):
            if self._odometry.age_s(span.end_ns) <= span.dt_s:  # not one that is only held
                self._inertial.correct(odometry_mps)
            return odometry_mps
        if source in ("auto", "constant") and constant_mps is not None:
            return constant_mps
        if source in ("auto", "imu") and isfinite(self._inertial.mean_mps):
            if self._inertial.sigma_mps > 0:
                notes.append("speed drifts")
            return self._inertial.mean_mps
        notes.append("no speed")
        return nan


class _InertialSpeed:
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
        self._gravity_mps2 = _GRAVITY_MPS2  # as this accelerometer shows it
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
        if self.sigma_mps > _SIGMA_LIMIT_MPS or abs(self._speed_mps) > _LARGEST_SPEED_MPS:
            self.mean_mps, self.sigma_mps = nan, inf
        if abs(hypot(*accel_mps2) - self._gravity_mps2) < _LEVEL_GRAVITY_ERROR_MPS2:
            up = up + min(1.0, dt_s / _LEVEL_TIME_S) * (accel_mps2 / self._gravity_mps2 - up)
        self._turn(up)

    def _turn(self, up: Floats) -> None:
        self._up = up / hypot(*up)
        self.pitch_rad = asin(max(-1.0, min(1.0, self._up[2])))


_Track = tuple[Floats, Floats]
"""Times (n,), s, the first 0 and the last dt, and values (n, columns) to be joined by straight lines."""


class _Ring:
    """The latest samples of one sensor, in time order; the oldest make room for new ones."""

    def __init__(self, sensor: str, capacity: int, columns: int, refused: Counter[str]) -> None:
        self.used_ns = _LARGEST_STAMP_NS  # samples up to here are not missed when they leave
        self._sensor = sensor
        self._refused = refused
        self._stamps_ns = np.zeros(capacity, np.int64)
        self._values = np.zeros((capacity, columns))
        self._count = 0
        self._behind = 0  # samples in order, but behind the newest
        self._behind_ns = 0

    def refuse(self, reason: str, count: int = 1) -> None:
        self._refused[f"{self._sensor} {reason}"] += count

    def add(self, stamp_ns: int, values: Sequence[float] | Floats) -> None:
        """Append a sample; a wrong stamp far ahead does not shut out all that follow (``_RESTART_AFTER``)."""
        if abs(stamp_ns) > _LARGEST_STAMP_NS:
            self.refuse("out of range")
            return
        if self._count and stamp_ns <= self._stamps_ns[self._count - 1]:
            self._behind = self._behind + 1 if stamp_ns > self._behind_ns else 1
            self._behind_ns = stamp_ns
            if self._behind < _RESTART_AFTER:
                self.refuse("stamp goes back")
                return
            self._count = 0
        self._behind = 0
        if self._count == len(self._stamps_ns):
            self._make_room()
        self._stamps_ns[self._count] = stamp_ns
        self._values[self._count] = values
        self._count += 1

    def _make_room(self) -> None:
        leaving = len(self._stamps_ns) // 4  # many at once, so that adding stays cheap
        missed = int(np.count_nonzero(self._stamps_ns[:leaving] > self.used_ns))
        if missed:
            self.refuse("overflow", missed)
        self._count -= leaving
        self._stamps_ns[: self._count] = self._stamps_ns[leaving:]
        self._values[: self._count] = self._values[leaving:]

    def age_s(self, now_ns: int) -> float:
        """Age of the latest sample that is not later than ``now_ns``; inf: none."""
        i = self._after(now_ns)
        return float(now_ns - self._stamps_ns[i - 1]) * 1e-9 if i else inf

    def period_s(self) -> float:
        """Median interval of the latest samples; 0: fewer than two."""
        intervals = np.sort(np.diff(self._stamps_ns[max(0, self._count - 17) : self._count]))
        return float(intervals[len(intervals) // 2]) * 1e-9 if len(intervals) else 0.0

    def covers(self, span: _Span, gap_limit_s: float) -> bool:
        """Whether a sample lies in ``span`` or nearer to it than the limit."""
        if not self._count:
            return False
        first_ns, last_ns = self._stamps_ns[0], self._stamps_ns[self._count - 1]
        return bool(max(first_ns - span.end_ns, span.start_ns - last_ns) <= gap_limit_s * 1e9)

    def unmeasured_s(self, span: _Span, gap_limit_s: float) -> tuple[float, float]:
        """Time of ``span`` for which a sample was held beyond the last (or first) one, and time in gaps."""
        around = slice(max(0, self._after(span.start_ns) - 1), self._after(span.end_ns) + 1)
        stamps_ns = self._stamps_ns[: self._count][around]
        intervals_ns = np.diff(stamps_ns)
        gap_ns = 0
        for i in np.flatnonzero(intervals_ns > gap_limit_s * 1e9):
            gap_ns += min(stamps_ns[i + 1], span.end_ns) - max(stamps_ns[i], span.start_ns)
        held_ns = max(0, stamps_ns[0] - span.start_ns) + max(0, span.end_ns - stamps_ns[-1])
        if held_ns > gap_limit_s * 1e9:
            return 0.0, float(gap_ns + held_ns) * 1e-9
        return float(held_ns) * 1e-9, float(gap_ns) * 1e-9

    def between(self, span: _Span) -> _Track:
        """Samples over ``span``, interpolated at both its ends, held where there is none beyond them."""
        first = self._after(span.start_ns)
        last = max(first, self._after(span.end_ns - 1))
        times_s, values = np.empty(last - first + 2), np.empty((last - first + 2, self._values.shape[1]))
        times_s[0], times_s[-1] = 0.0, span.dt_s
        times_s[1:-1] = (self._stamps_ns[first:last] - span.start_ns) * 1e-9
        values[0], values[-1] = self._at(span.start_ns, first), self._at(span.end_ns, last)
        values[1:-1] = self._values[first:last]
        return times_s, values

    def latest(self, now_ns: int, length_s: float, gap_limit_s: float) -> Floats | None:
        """Values (n, columns) of the last ``length_s``; None if they do not reach back or have gaps."""
        start_ns = now_ns - round(length_s * 1e9)
        first, last = max(0, self._after(start_ns) - 1), self._after(now_ns)
        stamps_ns = self._stamps_ns[first:last]
        if last - first < 3 or stamps_ns[0] > start_ns or np.diff(stamps_ns).max() > gap_limit_s * 1e9:
            return None
        return self._values[first:last]

    def _after(self, stamp_ns: int) -> int:
        """Row of the first sample later than ``stamp_ns``."""
        return int(np.searchsorted(self._stamps_ns[: self._count], stamp_ns, side="right"))

    def _at(self, stamp_ns: int, i: int) -> Floats:
        """Value between the rows ``i`` - 1 and ``i``, or at the end that is there."""
        if i in (0, self._count):
            held: Floats = self._values[max(0, i - 1)]
            return held
        before, after = self._stamps_ns[i - 1 : i + 1].tolist()
        share = (stamp_ns - before) / (after - before)
        between: Floats = (1 - share) * self._values[i - 1] + share * self._values[i]
        return between


def _mean(times_s: Floats, values: Floats) -> Floats:
    """Mean over time, along the first axis, of straight lines between the values."""
    if times_s[-1] <= 0:
        times_s = np.linspace(0.0, 1.0, len(times_s))
    mean: Floats = 0.5 * (np.diff(times_s) @ (values[1:] + values[:-1])) / times_s[-1]
    return mean


def _turned(vectors_rad: Floats) -> Floats:
    """Rotation (3, 3) by the rotation vectors (n, 3), one after the other; the exact exponential of each."""
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    for rx, ry, rz in vectors_rad.tolist():  # few: as quaternions in plain numbers they are quicker
        angle = sqrt(rx * rx + ry * ry + rz * rz)
        c, s = cos(angle / 2), sin(angle / 2) / angle if angle else 0.5
        a, b, d = s * rx, s * ry, s * rz
        w, x, y, z = (
            c * w - a * x - b * y - d * z,
            c * x + a * w + b * z - d * y,
            c * y + b * w + d * x - a * z,
            c * z + d * w + a * y - b * x,
        )
    scale = 2 / (w * w + x * x + y * y + z * z)
    return np.array(
        [
            [1 - scale * (y * y + z * z), scale * (x * y - w * z), scale * (x * z + w * y)],
            [scale * (x * y + w * z), 1 - scale * (x * x + z * z), scale * (y * z - w * x)],
            [scale * (x * z - w * y), scale * (y * z + w * x), 1 - scale * (x * x + y * y)],
        ]
    )
