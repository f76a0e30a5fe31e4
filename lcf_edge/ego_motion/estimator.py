"""Ego-motion: how the camera turned and how fast the vehicle drove between two exposures.

Camera axes: x right, y down, z forward (assumed to be the vehicle's forward). With body rates ω the camera's
orientation follows Ṙ = R·[ω]×, so a fixed direction turns by exp(-[ω]× dt) in the camera's axes.
No clock, no I/O; memory is two fixed rings of samples.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice
from math import exp, hypot, inf, isfinite, nan, sqrt

import numpy as np
import numpy.typing as npt

from drivers.samples import ImuSample, SpeedSample
from lcf_edge.config import Imu, Vehicle
from lcf_edge.ego_motion.ground_belief import GroundBelief
from lcf_edge.ego_motion.gyro_bias import GyroBias
from lcf_edge.ego_motion.inertial_speed import GRAVITY_MPS2, MAX_SPEED_MPS, InertialSpeed
from lcf_edge.ego_motion.path_yaw import PathYaw
from lcf_edge.ego_motion.sample_ring import Ring, Span, Track, Window
from lcf_edge.filter.ground_speed import GroundSpeed
from lcf_edge.filter.inputs import UNKNOWN, Motion

Floats = npt.NDArray[np.float64]

IMU_CAPACITY = 1024
SPEED_CAPACITY = 256
MIN_DT_S = 5e-3  # of a first frame, or of two with one stamp

# Beyond what any small vehicle does.
_MAX_GYRO_RADPS = 40.0
_MAX_ACCEL_MPS2 = 200.0

_GAP_S = 0.05  # or five sample intervals, if longer; more without a sample is a gap
_FRESH_S = 0.5  # older odometry is stale

# At rest, for this long.
_REST_NS = 500_000_000
_REST_GYRO_STD_RADPS, _REST_ACCEL_STD_MPS2 = 0.01, 0.1  # where only a quiet IMU indicates rest,
_NOISELESS_MPS2 = 1e-9  # though not one simulated without noise, quiet at any steady speed, if the image moves
_REST_GYRO_RADPS = 0.1  # and the largest bias that is accepted then
_SHAKEN_GYRO_STD_RADPS, _SHAKEN_ACCEL_STD_MPS2 = 0.5, 5.0  # where odometry or the image indicates it: motors vibrate
_REST_GRAVITY_ERROR_MPS2 = 0.8
_REST_SPEED_MPS = 0.02
_REST_YAW_RADPS = 0.02
_REST_TURN_RADPS = 0.02  # largest difference of the mean rate within the rest, and from a known bias
_REST_SIGMA_RADPS = 1e-3  # 1 sigma of the true rate at rest

# Rotation, 1 sigma of the rate where nothing measures it.
_SIGMA_HELD_RADPS = 0.05  # the last sample is held
_SIGMA_LACKING_RADPS = 0.0175  # of an axis that the gyro lacks, 1 °/s: on wheels, a vehicle hardly pitches or rolls
_SIGMA_UNKNOWN_RADPS = 0.1  # at first: without a gyro, the flow soon shows how much it turns
_SIGMA_SATURATED_RADPS = 1.0  # of the rate beyond the gyro's full scale
_GUESS_TIME_S = 0.5  # averaging time of the sigma of a guess
_GUESS_MIN_RADPS, _GUESS_MAX_RADPS = 0.04, 2.0
_STUCK_S, _STUCK_SAMPLES = 0.1, 8  # a gyro that had noise, and repeats one value this long and this often, is stuck
_NOISY_SHARE = 0.5  # largest share of repeated samples of a gyro with noise
_SILENT_SAMPLES = 16  # an axis that is exactly 0 while another has shown this many other values is not measured
_MIN_BIAS_SHARE = 0.5  # of the image's uncertainty: a rotation known better than that gains nothing from it
_LAG_SHARE = 0.5  # of the correction by the flow that may belong to earlier intervals: tracks lag
_TURN_SHARE = 0.05  # of the rate: error by the gyro's scale and time, and a shaken focus
_ROLL_SHARE = 0.5  # roll moves the image's edge by this share of what yaw does

_SUPPORTS_S = 1.0  # for which the ground seen last still corrects the speed by the accelerometer
_DRIVES_S = 0.5  # an object that comes close to a stationary vehicle may cause flow too, but not for this long


@dataclass(frozen=True, slots=True)
class EgoMotion:
    """Motion between the previous exposure and the present one."""

    dt_s: float
    rotation: Floats  # (3, 3), a direction in the previous camera axes → in the present ones
    rotation_sigma_rad: float  # 1 sigma of the rotation's angle
    speed_mps: float  # forward, mean over the interval, NaN: unknown
    yaw_rate_radps: float  # of the camera, turning left positive, mean over the interval
    path_yaw_rate_radps: float  # of the vehicle: odometry's, else the camera's without its shaking
    rate_radps: tuple[float, float, float]  # by the gyro at the end of the interval, NaN: not measured
    notes: tuple[str, ...]  # what degrades it; docs/replay.md lists them

    def to_motion(self) -> Motion:
        """Return it as a step of the filter takes it."""
        dt_s = max(self.dt_s, MIN_DT_S)
        path_radps = self.path_yaw_rate_radps
        return Motion(dt_s, self.rotation, self.rotation_sigma_rad, self.speed_mps, path_radps, self.rate_radps)


@dataclass(slots=True)
class _Interval:
    """Measurements over the interval between two exposures."""

    span: Span
    rates: Track  # of the gyro, or of odometry in its place, in the first columns
    measured: bool  # by a working gyro,
    odometry_mps: float
    odometry_yaw_radps: float
    notes: list[str] = field(default_factory=list)
    axes: Sequence[bool] = (False, False, False)  # which of its axes
    rests: bool = False  # without a gyro, by odometry that measures no turn either
    mean_radps: Sequence[float] = (0.0, 0.0, 0.0)  # of the rates


class EgoMotionEstimator:
    """Takes IMU and odometry samples; gives the motion from each exposure to the next.

    ``refused`` counts the samples that were not used, or not trusted, by sensor and reason. ``bias``: the gyro's,
    learnt at rest and from what the images show.
    """

    def __init__(self, imu: Imu, vehicle: Vehicle) -> None:
        self.refused: Counter[str] = Counter()
        self.bias = GyroBias()
        self._vehicle = vehicle
        self._axes = imu.axes
        self._offset_ns = round(imu.time_offset_s * 1e9)
        self._noise_radps = imu.gyro_noise_radps
        self._imu = Ring("imu", IMU_CAPACITY, 7, self.refused)  # gyro, specific force, whether saturated
        self._odometry = Ring("speed", SPEED_CAPACITY, 2, self.refused)  # speed, yaw rate
        self._inertial = InertialSpeed(imu.gyro_noise_radps)
        self._ground = GroundBelief()
        self._ground_s = inf  # since the ground last showed the speed
        self._drove_ns: int | None = None  # when the image last showed that it drives,
        self._driven_s = 0.0  # and for how long it has
        self._path_yaw = PathYaw()
        self._guess_variance = [_SIGMA_UNKNOWN_RADPS**2] * 3  # of rates that no gyro measures
        self._noisy = False  # as a real gyro; synthetic samples have no noise
        self._turned = [0, 0, 0]  # samples other than 0, by axis
        self._speed_mps = nan
        self._stamp_ns: int | None = None
        self._began_ns = 0  # of the first frame
        self._samples = Track(IMU_CAPACITY + 2, self._imu.columns)
        self._speeds = Track(SPEED_CAPACITY + 2, self._odometry.columns)
        self._guessed = Track(2, 3)
        self._latest = Track(2, self._imu.columns)
        self._window = Window()
        self._interval = _Interval(Span(0, 0), self._guessed, False, nan, nan)
        self._error_radps = [0.0, 0.0, 0.0]

    def add_imu(self, sample: ImuSample) -> None:
        """Take a sample, in time order; one that is not finite, absurd or late is refused and counted."""
        gyro: Sequence[float] = sample.gyro
        accel: Sequence[float] = sample.accel
        if hypot(*gyro) <= _MAX_GYRO_RADPS and hypot(*accel) <= _MAX_ACCEL_MPS2:  # NaN is not
            if sample.saturated:
                self._imu.refuse("saturated")
            if self._axes:
                gyro, accel = _in_camera_axes(self._axes, gyro), _in_camera_axes(self._axes, accel)
            for k, rate in enumerate(gyro):
                self._turned[k] += rate != 0
            self._imu.add(sample.stamp_ns + self._offset_ns, (*gyro, *accel, sample.saturated))
        else:
            self._imu.refuse("out of range" if all(map(isfinite, (*gyro, *accel))) else "not finite")

    def add_speed(self, sample: SpeedSample) -> None:
        """Take a sample, in time order; one that is not finite, absurd or late is refused and counted."""
        if not isfinite(sample.speed_mps):
            self._odometry.refuse("not finite")
        elif abs(sample.speed_mps) > MAX_SPEED_MPS or abs(sample.yaw_rate_radps) > _MAX_GYRO_RADPS:
            self._odometry.refuse("out of range")
        else:
            self._odometry.add(sample.stamp_ns, (sample.speed_mps, sample.yaw_rate_radps))

    def advance(self, stamp_ns: int, still: bool | None = None) -> EgoMotion:
        """Return the motion over (previous stamp, ``stamp_ns``], from the samples so far.

        ``still``: whether the image has been stationary for half a second, None: unknown. The first frame has
        no interval; neither has one whose stamp goes back, which is counted.

        ``rotation_sigma_rad`` combines the bias's sigma · dt, at least gyro noise · dt; white noise,
        gyro noise · √(dt · sample interval); and fixed rates over times held, missing or saturated. Without a gyro: the
        recent error of guessed rates.
        """
        notes: list[str] = []
        if self._stamp_ns is None:
            notes.append("first frame")
            self._stamp_ns = self._began_ns = stamp_ns
        if stamp_ns < self._stamp_ns:
            self.refused["frame stamp goes back"] += 1
            stamp_ns = self._stamp_ns
        span = Span(self._stamp_ns, stamp_ns)
        self._stamp_ns = self._imu.used_ns = self._odometry.used_ns = stamp_ns

        odometry_mps, odometry_yaw_radps = nan, nan
        if self._odometry.age_s(stamp_ns) <= _FRESH_S:
            self._odometry.between(span, self._speeds)
            odometry_mps, odometry_yaw_radps = self._speeds.mean()
        interval = _Interval(span, self._guessed, False, odometry_mps, odometry_yaw_radps, notes)
        self._interval = interval
        self._path_yaw.advance(span.dt_s)
        gap_limit_s = max(_GAP_S, 5 * self._imu.period_s())
        if self._imu.covers(span, gap_limit_s):
            may_rest = still is not False and self._stands(stamp_ns, odometry_mps, still) is not False
            force_mps2, gap_s, sigmas_radps = self._measure(interval, gap_limit_s, may_rest)
        else:
            interval.notes.append("no imu")
        if interval.measured:
            self.bias.advance(span.dt_s, sigmas_radps, interval.axes)
        else:
            self._guess(interval)
            interval.rests = abs(odometry_mps) <= _REST_SPEED_MPS and abs(odometry_yaw_radps) <= _REST_YAW_RADPS
            variances = [_REST_TURN_RADPS**2] * 3 if interval.rests else self._guess_variance
            self.bias.advance(span.dt_s, [sqrt(variance) for variance in variances], interval.axes)
        rest_mps2 = self._learn_rest(span, gap_limit_s, odometry_mps, still) if interval.measured else None
        rotation = self._rotation()
        if not interval.measured:
            self._inertial.lose()
        elif rest_mps2 is not None:
            self._inertial.rest(rest_mps2, span.dt_s, force_mps2, rotation)
        else:
            self._inertial.advance(span.dt_s, force_mps2, rotation, gap_s)
        if interval.measured and not self.bias.known:
            interval.notes.append("gyro bias unknown")
        self._ground.advance(span.dt_s)
        self._ground_s += span.dt_s
        if still:
            self._ground.stand()
        self._speed_mps = self._choose_speed(span, odometry_mps, interval.notes)
        return self._answer(rotation)

    def _measure(
        self, interval: _Interval, gap_limit_s: float, may_rest: bool
    ) -> tuple[list[float], float, list[float]]:
        """Take in samples. Return specific force (3,), time without samples, s, and 1 sigma of the rates (3,)."""
        span, imu, period_s = interval.span, self._imu, self._imu.period_s()
        held_s, gap_s = imu.held_s(span), imu.gap_s(span, gap_limit_s)
        if held_s > gap_limit_s:
            held_s, gap_s = 0.0, gap_s + held_s
        if gap_s > 0:
            interval.notes.append("imu gap")
        imu.between(span, self._samples)
        whole = self._samples.mean()
        interval.rates, interval.mean_radps = self._samples, whole[:3]
        saturated_s = whole[6] * span.dt_s
        if saturated_s > 0:
            interval.notes.append("imu saturated")
        left_radps = sqrt(max(0.0, self._noise_radps**2 - max(self.bias.sigmas()) ** 2))
        sigma_rad = left_radps * span.dt_s + self._noise_radps * sqrt(span.dt_s * period_s)
        sigma_rad += _SIGMA_HELD_RADPS * held_s + _SIGMA_UNKNOWN_RADPS * gap_s
        sigma_rad += _SIGMA_SATURATED_RADPS * saturated_s
        interval.measured = not self._stuck(span.end_ns, gap_limit_s, period_s, may_rest)
        if not interval.measured:
            interval.notes.append("gyro stuck")
            return whole[3:6], gap_s + saturated_s, []
        interval.axes = self._measured_axes()
        if not all(interval.axes):
            interval.notes.append("gyro lacks an axis")
        sigma_radps = sigma_rad / max(span.dt_s, 1e-9)
        sigmas_radps = [sigma_radps if measured else _SIGMA_LACKING_RADPS for measured in interval.axes]
        return whole[3:6], gap_s + saturated_s, sigmas_radps

    def _measured_axes(self) -> list[bool]:
        """Whether the gyro measures each axis: drivers of a gyro for yaw alone report 0 for the others."""
        return [turned > 0 or max(self._turned) < _SILENT_SAMPLES for turned in self._turned]

    def _guess(self, interval: _Interval) -> None:
        """Guess the rates without a gyro: odometry's yaw rate, or else the last rates."""
        yaw_radps = self._path_yaw.rate_radps
        if isfinite(interval.odometry_yaw_radps):
            interval.notes.append("rotation from odometry")
            yaw_radps = interval.odometry_yaw_radps
        interval.rates, interval.mean_radps = self._guessed, (0.0, -yaw_radps, 0.0)
        self._guessed.hold(interval.span.dt_s, interval.mean_radps)

    def needs_image_rotation(self, sigma_rad: float) -> bool:
        """Whether the rotation from the images, with ``sigma_rad``, would help in the present interval."""
        interval = self._interval
        if interval.rests:
            return False  # somebody who passes close by would be taken for a turn
        if not interval.measured or interval.span.dt_s == 0:
            return True
        return max(self.bias.error_sigmas()[:2]) * interval.span.dt_s > _MIN_BIAS_SHARE * sigma_rad

    def add_image_rotation(self, turn_rad: Floats, sigma_rad: Floats) -> EgoMotion:
        """Return the motion of the present interval, using the rotation of the whole image as well.

        A working gyro with a known bias prevails over an image that contradicts it; any other source of the rotation
        does not. ``turn_rad``: rotation vector (3,) of directions, as in ``EgoMotion.rotation``; ``sigma_rad``: (3,).
        """
        interval, bias = self._interval, self.bias
        dt_s = interval.span.dt_s
        if dt_s == 0:
            return self._answer(self._rotation())
        error_radps, sigma_radps = self._less_rates(turn_rad), [sigma / dt_s for sigma in sigma_rad.tolist()]
        trusted = interval.measured and bias.known
        if not (bias.add_image_rotation(error_radps, sigma_radps) or trusted):
            bias.doubt()
            bias.add_image_rotation(error_radps, sigma_radps)
            interval.notes.append("rotation from pictures")
        return self._answer(self._rotation())

    def _less_rates(self, turn_rad: Floats) -> list[float]:
        """Return the rates less those of the image over the present interval, (3,) rad/s."""
        interval = self._interval
        both = zip(interval.mean_radps, turn_rad.tolist(), strict=True)
        return [mean + turned / interval.span.dt_s for mean, turned in both]

    def correct(self, turn_rad: Floats, sigma_rad: Floats, expansion_hz: float = 0.0) -> None:
        """Take the correction of the present interval's rotation by the flow, from which the bias is learnt.

        ``turn_rad``: rotation vector (3,) of directions, as in ``EgoMotion.rotation``; ``sigma_rad``: (3,).
        ``expansion_hz``: mean V/Z of the scene.
        """
        interval = self._interval
        dt_s = interval.span.dt_s
        if dt_s == 0:
            return
        turned_rad = turn_rad.tolist()
        error_radps = [error + turn / dt_s for error, turn in zip(self._error_radps, turned_rad, strict=True)]
        if interval.measured:
            rate_radps = hypot(*(mean - error for mean, error in zip(interval.mean_radps, error_radps, strict=True)))
            doubt_radps = hypot(_LAG_SHARE * hypot(*turned_rad) / dt_s, _TURN_SHARE * rate_radps)
            sigma_radps = [hypot(sigma / dt_s, doubt_radps) for sigma in sigma_rad.tolist()]
            self.bias.see_flow(error_radps, sigma_radps, expansion_hz)
        else:
            self._follow_path(error_radps)
            kept = exp(-dt_s / _GUESS_TIME_S)
            for k, error in enumerate(error_radps):
                variance = kept * self._guess_variance[k] + (1 - kept) * error**2
                self._guess_variance[k] = min(max(variance, _GUESS_MIN_RADPS**2), _GUESS_MAX_RADPS**2)

    def see_ground(self, ground: GroundSpeed) -> None:
        """Take the speed from the flow of the ground in the present interval, where nothing else measures it.

        Windows overlap, so only the new part of each counts.
        """
        interval = self._interval
        if isfinite(interval.odometry_mps) or not isfinite(ground.speed_mps) or interval.span.dt_s == 0:
            return
        self._ground.see(ground, interval.span.dt_s)
        again = max(ground.elapsed_s / interval.span.dt_s, 1.0)
        self._inertial.see_mean(ground.speed_mps, ground.sigma_mps * sqrt(again), ground.elapsed_s)
        self._ground_s = 0.0

    def see_driving(self, drives: bool) -> None:
        """Take whether the flow of the present image shows that the vehicle drives.

        A quiet IMU does not indicate rest then: at a steady speed on a smooth floor it is as quiet. Nor is the inertial
        speed known if the vehicle was assumed to be at rest.
        """
        if not drives:
            self._driven_s = 0.0
            return
        self._drove_ns = self._stamp_ns
        self._driven_s += self._interval.span.dt_s
        if self._driven_s >= _DRIVES_S and self._inertial.is_zero():
            self._inertial.lose()

    def _rotation(self) -> Floats:
        """Return the rotation of directions over the interval, (3, 3)."""
        rotation = np.empty((3, 3))
        x, y, z = self.bias.errors()
        self._interval.rates.turn(x, y, z, rotation)
        return rotation

    def _answer(self, rotation: Floats) -> EgoMotion:
        interval, dt_s = self._interval, self._interval.span.dt_s
        self._error_radps = self.bias.errors()
        sigma_x, sigma_y, sigma_z = self.bias.error_sigmas()
        yaw_rate_radps = self._follow_path(self._error_radps)
        return EgoMotion(
            dt_s,
            rotation,
            max(sigma_x, sigma_y, _ROLL_SHARE * sigma_z) * dt_s,
            self._speed_mps,
            yaw_rate_radps,
            self._path_yaw.rate_radps,
            self._rate_at_end(),
            tuple(interval.notes),
        )

    def _rate_at_end(self) -> tuple[float, float, float]:
        """Return the gyro's rates at the end of the interval, NaN: not measured."""
        if not self._interval.measured:
            return UNKNOWN
        end_ns = self._interval.span.end_ns
        self._imu.between(Span(end_ns, end_ns), self._latest)
        x, y, z, *_ = self._latest.mean()
        return x, y, z

    def _follow_path(self, error_radps: Sequence[float]) -> float:
        """Return the camera's yaw rate, given the error of the rates; the path's yaw rate follows it."""
        interval = self._interval
        yaw_rate_radps = error_radps[1] - interval.mean_radps[1]
        if isfinite(interval.odometry_yaw_radps):
            self._path_yaw.see_odometry(interval.odometry_yaw_radps)
        else:
            self._path_yaw.see_camera(yaw_rate_radps)
        return yaw_rate_radps

    def _stuck(self, stamp_ns: int, gap_limit_s: float, period_s: float, may_rest: bool) -> bool:
        """Whether a gyro that had noise repeats one value; synthetic samples may do so at rest, in all six columns."""
        imu, window = self._imu, self._window
        if not imu.find_latest(window, stamp_ns, round(max(_STUCK_S, _STUCK_SAMPLES * period_s) * 1e9), gap_limit_s):
            return False
        pairs = window.last - window.first - 1
        repeated = imu.repeats(window, 0, 3)
        self._noisy = self._noisy or repeated < _NOISY_SHARE * pairs
        if not (self._noisy and repeated == pairs):
            return False
        return not (may_rest and imu.repeats(window, 3, 6) == pairs and self._near_bias(imu.newest(window)))

    def _near_bias(self, rate_radps: Sequence[float]) -> bool:
        """Whether a mean rate, the first three values, agrees with the bias."""
        known = zip(rate_radps, self.bias.means(), self.bias.sigmas(), strict=False)
        return all(abs(rate - mean) <= _REST_TURN_RADPS + 3 * sigma for rate, mean, sigma in known)

    def _learn_rest(
        self, span: Span, gap_limit_s: float, odometry_mps: float, still: bool | None
    ) -> list[float] | None:
        """If the vehicle is at rest, learn the bias from the gyro's mean; return the mean specific force (3,), up."""
        stands = self._stands(span.end_ns, odometry_mps, still)
        if stands is False or not self._imu.find_latest(self._window, span.end_ns, _REST_NS, gap_limit_s):
            return None
        imu, first, last = self._imu, self._window.first, self._window.last
        rows = last - first
        at = imu.average(first, last)
        std = imu.deviation(self._window, at)
        gyro_std, accel_std = max(std[:3]), max(std[3:6])
        if not self._near_bias(at[:3]):
            return None
        level = abs(hypot(*at[3:6]) - GRAVITY_MPS2) <= _REST_GRAVITY_ERROR_MPS2
        if stands:
            halves = zip(imu.average(first, first + rows // 2), imu.average(first + rows // 2, last), std, strict=True)
            steady = all(
                abs(one - other) <= _REST_TURN_RADPS + 3 * sigma * sqrt(4 / rows)
                for one, other, sigma in islice(halves, 3)
            )
            rests = steady and gyro_std <= _SHAKEN_GYRO_STD_RADPS and accel_std <= _SHAKEN_ACCEL_STD_MPS2
        else:
            quiet = gyro_std <= _REST_GYRO_STD_RADPS and accel_std <= _REST_ACCEL_STD_MPS2
            simulated = still is False and accel_std < _NOISELESS_MPS2
            rests = quiet and level and not simulated and (self.bias.known or hypot(*at[:3]) <= _REST_GYRO_RADPS)
        if not rests:
            return None
        rate_radps = at[:3]
        if self.bias.known:  # the window's other samples were used before
            rate_radps = list(self._interval.mean_radps)
            rows = self._interval.rates.count
        self.bias.see_rest(rate_radps, _REST_SIGMA_RADPS + 2 * gyro_std / sqrt(rows))
        return at[3:6] if level else None

    def _stands(self, stamp_ns: int, odometry_mps: float, still: bool | None) -> bool | None:
        """Whether image or odometry shows that the vehicle is stationary; None: undecided."""
        if still:
            return True
        if isfinite(odometry_mps):
            if abs(odometry_mps) > _REST_SPEED_MPS:
                return False
            odometry, window = self._odometry, self._window
            return (
                odometry.find_latest(window, stamp_ns, _REST_NS, inf)
                and odometry.largest(window, 0) <= _REST_SPEED_MPS
                and not odometry.largest(window, 1) > _REST_YAW_RADPS  # False for NaN
            )
        drove = self._drove_ns is not None and stamp_ns - self._drove_ns < _REST_NS
        just_begun = stamp_ns - self._began_ns < _REST_NS  # images could not show yet that it drives
        if drove or just_begun or (still is False and not self.bias.known):
            return False  # others may move, but nothing else indicates rest
        return None if self._inertial.may_stand() else False

    def _choose_speed(self, span: Span, odometry_mps: float, notes: list[str]) -> float:
        """Return the mean speed over the interval by ``vehicle.speed_source``, m/s; NaN: unknown."""
        source, constant_mps = self._vehicle.speed_source, self._vehicle.speed_mps
        if source in ("auto", "odometry", "zenoh") and isfinite(odometry_mps):
            if self._odometry.age_s(span.end_ns) <= span.dt_s:  # not just held from before
                self._inertial.see_odometry(odometry_mps, span.dt_s)
            return odometry_mps
        if source in ("auto", "constant") and constant_mps is not None:
            return constant_mps
        if source in ("auto", "imu") and isfinite(self._inertial.mean_mps):
            if self._inertial.sigma_mps > 0 and self._ground_s > _SUPPORTS_S:
                notes.append("speed drifts")
            elif self._inertial.sigma_mps > 0:
                notes.append("speed from ground")
            return self._inertial.mean_mps
        if source in ("auto", "imu") and isfinite(self._ground.speed_mps):
            notes.append("speed from ground")
            return self._ground.speed_mps
        notes.append("no speed")
        return nan


def _in_camera_axes(axes: Sequence[Sequence[float]], vector: Sequence[float]) -> tuple[float, ...]:
    """``axes``: (3, 3), of ``imu.axes``."""
    x, y, z = vector
    return tuple(row[0] * x + row[1] * y + row[2] * z for row in axes)
