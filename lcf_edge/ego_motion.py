"""Ego-motion: how the camera turned and how fast the vehicle drove between two exposures.

Camera axes: x right, y down, z forward (taken for the vehicle's forward). With body rates ω the camera's
orientation follows Ṙ = R·[ω]×, so a direction that stands still turns by exp(-[ω]× dt) in the camera's axes.
No clock, no I/O; memory is two fixed rings of samples.
"""

from collections import Counter
from dataclasses import dataclass, field
from math import cos, exp, expm1, hypot, inf, isfinite, nan, sin, sqrt

import numpy as np
import numpy.typing as npt

from drivers.records import ImuSample, SpeedSample
from lcf_edge.config import Imu, Vehicle
from lcf_edge.gyro_bias import GyroBias
from lcf_edge.inertial_speed import GRAVITY_MPS2, LARGEST_SPEED_MPS, InertialSpeed
from lcf_edge.sample_ring import Ring, Span, mean

Floats = npt.NDArray[np.float64]

IMU_CAPACITY = 1024
SPEED_CAPACITY = 256

# What no small vehicle does.
_LARGEST_GYRO_RADPS = 40.0
_LARGEST_ACCEL_MPS2 = 200.0

_GAP_S = 0.05  # or five sample intervals: longer without a sample is a gap
_FRESH_S = 0.5  # older odometry is stale

# Standing still, for this long.
_REST_S = 0.5
_REST_GYRO_STD_RADPS, _REST_ACCEL_STD_MPS2 = 0.01, 0.1  # when nothing but a quiet IMU tells it
_REST_GYRO_RADPS = 0.1  # then, the largest bias that is believed
_SHAKEN_GYRO_STD_RADPS, _SHAKEN_ACCEL_STD_MPS2 = 0.5, 5.0  # when odometry or the picture tells it: motors shake it
_REST_GRAVITY_ERROR_MPS2 = 0.8
_REST_SPEED_MPS = 0.02
_REST_YAW_RADPS = 0.02
_REST_TURN_RADPS = 0.02  # what the mean rate may differ within the rest, and from a known bias
_REST_SIGMA_RADPS = 1e-3  # 1 sigma of how still a rest is

# Rotation, 1 sigma of the rate where nothing measures it.
_SIGMA_HELD_RADPS = 0.05  # the last sample is held
_SIGMA_UNKNOWN_RADPS = 0.1  # at first: without a gyro, the flow soon shows how much it turns
_SIGMA_SATURATED_RADPS = 1.0  # how far beyond the end of its range the gyro turns
_GUESS_TIME_S = 0.5  # over which that is averaged
_GUESS_LEAST_RADPS, _GUESS_MOST_RADPS = 0.04, 2.0
_STUCK_S, _STUCK_SAMPLES = 0.1, 8  # a gyro that had noise, and repeats one value for so long and so often, is stuck
_NOISY_SHARE = 0.5  # of the samples, at most, are repeated by one with noise
_WANTED_SHARE = 0.5  # of the picture's uncertainty: a better known rotation gains nothing from it
_LAG_SHARE = 0.5  # of what the flow takes out, that may be left from before: tracks follow late
_TURN_SHARE = 0.05  # of the rate, that scale and time of the gyro, and the shaken focus, put into the difference
_ROLL_SHARE = 0.5  # roll moves the picture's edge by so much of what yaw moves it by

_SHAKE_S = 0.4  # a yaw rate that does not last this long is the camera shaking, not the vehicle turning


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


@dataclass(slots=True)
class _Interval:
    """What is measured over the interval between two exposures."""

    span: Span
    times_s: Floats  # (n,)
    rates_radps: Floats  # (n, 3), as the gyro, or in its place odometry, shows them
    measured: bool  # by a gyro that lives
    odometry_mps: float
    odometry_yaw_radps: float
    path_yaw_before_radps: float
    notes: list[str] = field(default_factory=list)


class EgoMotionEstimator:
    """Takes IMU and odometry samples; answers with the motion from each exposure to the next.

    ``refused`` counts the samples that were not used, or not trusted, by sensor and reason. ``bias``: the gyro's,
    learnt at rest and from what the pictures show.
    """

    def __init__(self, imu: Imu, vehicle: Vehicle) -> None:
        self.refused: Counter[str] = Counter()
        self.bias = GyroBias()
        self._vehicle = vehicle
        self._axes = np.array(imu.axes).T if imu.axes else None
        self._offset_ns = round(imu.time_offset_s * 1e9)
        self._noise_radps = imu.gyro_noise_radps
        self._imu = Ring("imu", IMU_CAPACITY, 7, self.refused)  # gyro, specific force, whether saturated
        self._odometry = Ring("speed", SPEED_CAPACITY, 2, self.refused)  # speed, yaw rate
        self._inertial = InertialSpeed(imu.gyro_noise_radps)
        self._path_yaw_radps = 0.0
        self._guess_variance: Floats = np.full(3, _SIGMA_UNKNOWN_RADPS**2)  # of rates that no gyro measures
        self._noisy = False  # as a real gyro; made-up samples have no noise
        self._speed_mps = nan
        self._stamp_ns: int | None = None
        self._interval = _Interval(Span(0, 0), np.zeros(2), np.zeros((2, 3)), False, nan, nan, 0.0)
        self._error_radps: Floats = np.zeros(3)

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
        elif abs(sample.speed_mps) > LARGEST_SPEED_MPS or abs(sample.yaw_rate_radps) > _LARGEST_GYRO_RADPS:
            self._odometry.refuse("out of range")
        else:
            self._odometry.add(sample.stamp_ns, (sample.speed_mps, sample.yaw_rate_radps))

    def advance(self, stamp_ns: int, still: bool | None = None) -> EgoMotion:
        """The motion over (previous stamp, ``stamp_ns``], from the samples taken so far.

        ``still``: whether the picture has stood still for half a second, None: it does not tell. The first frame has
        no interval; neither has one whose stamp goes back, which is counted.

        ``rotation_sigma_rad``: the bias's sigma · dt, at least gyro noise · dt; besides, gyro noise · √(dt · sample
        interval) (white noise), and stated rates over what was held, missed or saturated. Without a gyro: by how much
        rates were lately guessed wrong.
        """
        notes: list[str] = []
        if self._stamp_ns is None:
            notes.append("first frame")
            self._stamp_ns = stamp_ns
        if stamp_ns < self._stamp_ns:
            self.refused["frame stamp goes back"] += 1
            stamp_ns = self._stamp_ns
        span = Span(self._stamp_ns, stamp_ns)
        self._stamp_ns = self._imu.used_ns = self._odometry.used_ns = stamp_ns

        odometry_mps, odometry_yaw_radps = nan, nan
        if self._odometry.age_s(stamp_ns) <= _FRESH_S:
            odometry_mps, odometry_yaw_radps = mean(*self._odometry.between(span)).tolist()
        interval = _Interval(
            span, _ends(span), np.zeros((2, 3)), False, odometry_mps, odometry_yaw_radps, self._path_yaw_radps
        )
        interval.notes += notes
        self._interval = interval
        gap_limit_s = max(_GAP_S, 5 * self._imu.period_s())
        if self._imu.covers(span, gap_limit_s):
            may_rest = still is not False and self._stands(stamp_ns, odometry_mps, still) is not False
            force_mps2, gap_s, sigma_radps = self._measure(interval, gap_limit_s, may_rest)
        else:
            interval.notes.append("no imu")
        if interval.measured:
            self.bias.advance(span.dt_s, np.full(3, sigma_radps), measured=True)
        else:
            self._guess(interval)
            self.bias.advance(span.dt_s, np.sqrt(self._guess_variance), measured=False)
        rests = interval.measured and self._learn_rest(span, gap_limit_s, odometry_mps, still)
        rotation = self._rotation()
        if not interval.measured:
            self._inertial.lose()
        elif not rests:
            self._inertial.advance(span.dt_s, force_mps2, rotation, gap_s)
        if interval.measured and not self.bias.known:
            interval.notes.append("gyro bias unknown")
        self._speed_mps = self._choose_speed(span, odometry_mps, interval.notes)
        return self._answer(rotation)

    def _measure(self, interval: _Interval, gap_limit_s: float, may_rest: bool) -> tuple[Floats, float, float]:
        """Take in the IMU's samples. Return specific force (3,), time without samples, s, and 1 sigma of the rates."""
        span, imu, period_s = interval.span, self._imu, self._imu.period_s()
        held_s, gap_s = imu.unmeasured_s(span, gap_limit_s)
        if gap_s > 0:
            interval.notes.append("imu gap")
        interval.times_s, values = imu.between(span)
        interval.rates_radps = values[:, :3]
        whole = mean(interval.times_s, values)
        saturated_s = float(whole[6]) * span.dt_s
        if saturated_s > 0:
            interval.notes.append("imu saturated")
        left_radps = sqrt(max(0.0, self._noise_radps**2 - self.bias.sigma_radps.max() ** 2))
        sigma_rad = left_radps * span.dt_s + self._noise_radps * sqrt(span.dt_s * period_s)
        sigma_rad += _SIGMA_HELD_RADPS * held_s + _SIGMA_UNKNOWN_RADPS * gap_s
        sigma_rad += _SIGMA_SATURATED_RADPS * saturated_s
        interval.measured = not self._stuck(span.end_ns, gap_limit_s, period_s, may_rest)
        if not interval.measured:
            interval.notes.append("gyro stuck")
        return whole[3:6], gap_s + saturated_s, sigma_rad / max(span.dt_s, 1e-9)

    def _guess(self, interval: _Interval) -> None:
        """Rates that no gyro measures: odometry's yaw, or else it goes on as it went."""
        interval.times_s, interval.rates_radps = _ends(interval.span), np.zeros((2, 3))
        if isfinite(interval.odometry_yaw_radps):
            interval.notes.append("rotation from odometry")
            interval.rates_radps[:, 1] = -interval.odometry_yaw_radps
        else:
            interval.rates_radps[:, 1] = -self._path_yaw_radps

    def wants_picture(self, sigma_rad: float) -> bool:
        """Whether a picture that tells the rotation to ``sigma_rad`` would help in the present interval."""
        interval = self._interval
        if not interval.measured or interval.span.dt_s == 0:
            return True
        return bool(self.bias.error_sigma_radps[:2].max() * interval.span.dt_s > _WANTED_SHARE * sigma_rad)

    def see_picture(self, turn_rad: Floats, sigma_rad: Floats) -> EgoMotion:
        """The motion of the present interval, knowing besides how the whole picture turned.

        A gyro that lives, and whose bias is known, is believed more than a picture that contradicts it; whatever else
        is said of the rotation is not. ``turn_rad``: rotation vector (3,) of directions, as in
        ``EgoMotion.rotation``; ``sigma_rad``: (3,).
        """
        interval, bias = self._interval, self.bias
        dt_s = interval.span.dt_s
        if dt_s == 0:
            return self._answer(self._rotation())
        error_radps, sigma_radps = mean(interval.times_s, interval.rates_radps) + turn_rad / dt_s, sigma_rad / dt_s
        trusted = interval.measured and bias.known
        if not (bias.see_picture(error_radps, sigma_radps) or trusted):
            bias.doubt()
            bias.see_picture(error_radps, sigma_radps)
            interval.notes.append("rotation from pictures")
        return self._answer(self._rotation())

    def correct(self, turn_rad: Floats, sigma_rad: Floats, expansion_hz: float = 0.0) -> None:
        """What the flow took out of the present interval besides: the bias learns from it.

        ``turn_rad``: rotation vector (3,) of directions, as in ``EgoMotion.rotation``; ``sigma_rad``: (3,).
        ``expansion_hz``: mean V/Z of what is seen.
        """
        interval = self._interval
        dt_s = interval.span.dt_s
        if dt_s == 0:
            return
        error_radps = self._error_radps + turn_rad / dt_s
        if interval.measured:
            rate_radps = hypot(*(mean(interval.times_s, interval.rates_radps) - error_radps))
            doubt_radps = hypot(_LAG_SHARE * hypot(*turn_rad) / dt_s, _TURN_SHARE * rate_radps)
            self.bias.see_flow(error_radps, np.hypot(sigma_rad / dt_s, doubt_radps), expansion_hz)
        else:
            self._follow_path(error_radps)
            kept = exp(-dt_s / _GUESS_TIME_S)
            variance = kept * self._guess_variance + (1 - kept) * error_radps**2
            self._guess_variance = np.clip(variance, _GUESS_LEAST_RADPS**2, _GUESS_MOST_RADPS**2)

    def _rotation(self) -> Floats:
        """Of directions, over the interval."""
        interval = self._interval
        rates = interval.rates_radps - self.bias.error_radps
        return _turned(-0.5 * (rates[1:] + rates[:-1]) * np.diff(interval.times_s)[:, None])

    def _answer(self, rotation: Floats) -> EgoMotion:
        interval, dt_s = self._interval, self._interval.span.dt_s
        self._error_radps = self.bias.error_radps
        sigma_x, sigma_y, sigma_z = self.bias.error_sigma_radps.tolist()
        yaw_rate_radps = self._follow_path(self._error_radps)
        return EgoMotion(
            dt_s,
            rotation,
            max(sigma_x, sigma_y, _ROLL_SHARE * sigma_z) * dt_s,
            self._speed_mps,
            yaw_rate_radps,
            self._path_yaw_radps,
            self._inertial.pitch_rad,
            tuple(interval.notes),
        )

    def _follow_path(self, error_radps: Floats) -> float:
        """The camera's yaw rate if the rates are mistaken by ``error_radps``; the path's follows it."""
        interval = self._interval
        yaw_rate_radps = float(error_radps[1] - mean(interval.times_s, interval.rates_radps)[1])
        if isfinite(interval.odometry_yaw_radps):
            self._path_yaw_radps = interval.odometry_yaw_radps
        else:
            before_radps = interval.path_yaw_before_radps
            share = -expm1(-interval.span.dt_s / _SHAKE_S)
            self._path_yaw_radps = before_radps + share * (yaw_rate_radps - before_radps)
        return yaw_rate_radps

    def _stuck(self, stamp_ns: int, gap_limit_s: float, period_s: float, may_rest: bool) -> bool:
        """Whether the gyro, which had noise, repeats one value; made-up samples may do so at rest, all six."""
        window = self._imu.latest(stamp_ns, max(_STUCK_S, _STUCK_SAMPLES * period_s), gap_limit_s)
        if window is None:
            return False
        same = window[1:] == window[:-1]
        repeated = same[:, :3].all(axis=1)
        self._noisy = self._noisy or bool(repeated.mean() < _NOISY_SHARE)
        if not (self._noisy and repeated.all()):
            return False
        return not (may_rest and same[:, 3:6].all() and self._near_bias(window[-1, :3]))

    def _near_bias(self, rate_radps: Floats) -> bool:
        """Whether a rate at rest may be this."""
        return bool((np.abs(rate_radps - self.bias.mean_radps) <= _REST_TURN_RADPS + 3 * self.bias.sigma_radps).all())

    def _learn_rest(self, span: Span, gap_limit_s: float, odometry_mps: float, still: bool | None) -> bool:
        """Whether the vehicle stands still; then the gyro's mean is its bias, the accelerometer's is up."""
        told = self._stands(span.end_ns, odometry_mps, still)
        window = self._imu.latest(span.end_ns, _REST_S, gap_limit_s) if told is not False else None
        if window is None:
            return False
        rows = len(window)
        at = window.mean(axis=0)
        offset = window - at
        std = np.sqrt(np.einsum("ij,ij->j", offset, offset) / rows)
        gyro_std, accel_std = max(std[:3].tolist()), max(std[3:6].tolist())
        if not self._near_bias(at[:3]):
            return False
        level = abs(hypot(*at[3:6]) - GRAVITY_MPS2) <= _REST_GRAVITY_ERROR_MPS2
        if told:
            halves = np.abs(window[: rows // 2, :3].mean(axis=0) - window[rows // 2 :, :3].mean(axis=0))
            steady = (halves <= _REST_TURN_RADPS + 3 * std[:3] * sqrt(4 / rows)).all()
            rests = steady and gyro_std <= _SHAKEN_GYRO_STD_RADPS and accel_std <= _SHAKEN_ACCEL_STD_MPS2
        else:
            quiet = gyro_std <= _REST_GYRO_STD_RADPS and accel_std <= _REST_ACCEL_STD_MPS2
            rests = quiet and level and (self.bias.known or hypot(*at[:3]) <= _REST_GYRO_RADPS)
        if not rests:
            return False
        rate_radps = at[:3]
        if self.bias.known:  # the window's other samples have been used
            rate_radps = mean(self._interval.times_s, self._interval.rates_radps)
            rows = len(self._interval.times_s)
        self.bias.see_rest(rate_radps, _REST_SIGMA_RADPS + 2 * gyro_std / sqrt(rows))
        if level:
            self._inertial.rest(at[3:6])
        return bool(level)

    def _stands(self, stamp_ns: int, odometry_mps: float, still: bool | None) -> bool | None:
        """Whether the picture or odometry says that it stands; None: it may."""
        if still:
            return True
        if isfinite(odometry_mps):
            if abs(odometry_mps) > _REST_SPEED_MPS:
                return False
            window = self._odometry.latest(stamp_ns, _REST_S, inf)
            return window is not None and not (np.abs(window) > (_REST_SPEED_MPS, _REST_YAW_RADPS)).any()
        if still is False and not self.bias.known:
            return False  # what moves in it may be others, but nothing else speaks for rest
        return None if self._inertial.may_stand() else False

    def _choose_speed(self, span: Span, odometry_mps: float, notes: list[str]) -> float:
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


def _ends(span: Span) -> Floats:
    """Times of both ends, s."""
    return np.array([0.0, span.dt_s])


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
