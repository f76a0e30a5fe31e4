"""Aligns the gyro with the camera's rotation: axes and clock offset, estimated together.

For an offset τ the gyro's mean rates g over the camera's intervals, both less their means (so that a constant bias does
not matter), are rotated onto the camera's rates c by the best rotation R. Their correlation Σ cᵀ R g / √(Σ cᵀc Σ gᵀg)
is largest at the true τ.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from drivers.samples import ImuSample
from lcf_edge.calibrate.image_rotation import Turn
from lcf_edge.calibrate.result import CalibrationError
from lcf_edge.calibrate.rotations import best_rotation

Floats = npt.NDArray[np.float64]

SEARCH_S = 0.5  # to both sides

_MIN_TURNS = 40
_COARSE_S = 0.01
_FINE_S = 0.002
_FINE_REACH_S = 0.02
_RIVAL_FROM_S = 0.1  # from the best offset; nearer, the correlation has not fallen yet
_ITERATIONS = 3
_MAX_SIGMA_RADPS = 0.5  # 1 sigma of an interval's rate; beyond, its corners determine nothing
_MIN_CORRELATION = 0.8
_MIN_RATE_RADPS = 0.1  # root mean square
_OUTLIER = 3.0  # times the median error
_RIVAL = 0.97  # of the best correlation, somewhere else
_MAX_SATURATED = 0.01  # of the samples


@dataclass(frozen=True)
class Alignment:
    """The rotation and clock offset by which gyro and camera agree.

    ``offset_s``: camera time less IMU time. ``axes``: (3, 3), IMU's axes to the camera's. ``camera``, ``gyro``: (n, 3)
    rates of each interval in camera axes, rad/s, the gyro's turned and without its bias. ``weights``: (n,), of the
    robust fit. ``offsets_s``, ``correlations``: the coarse search.
    """

    offset_s: float
    offset_sigma_s: float
    correlation: float
    axes: Floats
    gyro_bias_radps: Floats  # in the IMU's axes
    times_s: Floats
    camera: Floats
    gyro: Floats
    weights: Floats
    offsets_s: Floats
    correlations: Floats

    @cached_property
    def residual_radps(self) -> float:
        """Difference between the camera's and the gyro's rates: weighted root mean square of one axis, rad/s."""
        squares = ((self.camera - self.gyro) ** 2).sum(axis=1)
        return float(np.sqrt(self.weights @ squares / self.weights.sum() / 3))

    @cached_property
    def axes_sigma_rad(self) -> float:
        """1 sigma of the rotation about its worst axis, rad; inf: the motion was about one axis only."""
        squares = self.gyro**2
        information = (
            np.diag(self.weights @ squares.sum(axis=1, keepdims=True) * np.ones(3))
            - (self.gyro * self.weights[:, None]).T @ self.gyro
        )
        least = float(np.linalg.eigvalsh(information)[0])
        return self.residual_radps / np.sqrt(least) if least > 0 else np.inf

    @cached_property
    def rates_radps(self) -> Floats:
        """Root mean square of the gyro's rates about each camera axis, (3,), rad/s."""
        rates: Floats = np.sqrt((self.gyro**2).mean(axis=0))
        return rates


class _Gyro:
    """Mean rates over any interval: samples are interpolated linearly and integrated."""

    def __init__(self, samples: Sequence[ImuSample], origin_ns: int) -> None:
        self._times_s = np.array([sample.stamp_ns - origin_ns for sample in samples]) * 1e-9
        rates = np.array([sample.gyro for sample in samples])
        steps = np.diff(self._times_s)[:, None] * (rates[1:] + rates[:-1]) / 2
        self._integral = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        self.first_s, self.last_s = float(self._times_s[0]), float(self._times_s[-1])

    def mean(self, starts_s: Floats, ends_s: Floats) -> Floats:
        """Return the mean rates of intervals, (n, 3), rad/s."""
        angles = [
            np.interp(ends_s, self._times_s, column) - np.interp(starts_s, self._times_s, column)
            for column in self._integral.T
        ]
        mean: Floats = np.stack(angles, axis=1) / (ends_s - starts_s)[:, None]
        return mean


class _Comparison:
    """Compares camera and gyro at any offset between their clocks, with the weights of the robust fit."""

    def __init__(self, turns: Sequence[Turn], samples: Sequence[ImuSample], around_s: float) -> None:
        origin_ns = turns[0].start_ns
        self._gyro = _Gyro(samples, origin_ns)
        starts_s = np.array([turn.start_ns - origin_ns for turn in turns]) * 1e-9
        ends_s = np.array([turn.end_ns - origin_ns for turn in turns]) * 1e-9
        inside = starts_s - around_s - SEARCH_S >= self._gyro.first_s
        inside &= ends_s - around_s + SEARCH_S <= self._gyro.last_s
        self._starts_s, self._ends_s = starts_s[inside], ends_s[inside]
        self.times_s = (self._starts_s + self._ends_s) / 2
        self.camera = np.array([turn.rate_radps for turn in turns])[inside]
        self.weights = np.ones(len(self.camera))

    def rates(self, offset_s: float) -> Floats:
        """Return the gyro's mean rates in its own axes, (n, 3), rad/s."""
        return self._gyro.mean(self._starts_s - offset_s, self._ends_s - offset_s)

    def fit(self, offset_s: float) -> tuple[float, Floats]:
        """Return the largest correlation at this offset, and the rotation (3, 3) that gives it."""
        c, g = self._less_mean(self.camera), self._less_mean(self.rates(offset_s))
        rotation, together = best_rotation((c * self.weights[:, None]).T @ g)
        size = np.sqrt((self.weights @ (c * c).sum(axis=1)) * (self.weights @ (g * g).sum(axis=1)))
        return together / max(float(size), 1e-12), rotation

    def scan(self, around_s: float, reach_s: float, step_s: float) -> tuple[Floats, Floats]:
        """Return offsets, s, and the correlation at each."""
        steps = round(reach_s / step_s)
        offsets_s: Floats = around_s + step_s * np.arange(-steps, steps + 1, dtype=np.float64)
        return offsets_s, np.array([self.fit(offset_s)[0] for offset_s in offsets_s.tolist()])

    def turned(self, offset_s: float, rotation: Floats) -> tuple[Floats, Floats]:
        """Return the gyro's bias in its own axes, and its rates without that in the camera's axes, rad/s."""
        rates = self.rates(offset_s)
        bias = self.weights @ (rates - self.camera @ rotation) / self.weights.sum()
        return bias, (rates - bias) @ rotation.T

    def weigh(self, offset_s: float) -> None:
        """Down-weight intervals that do not fit."""
        _, gyro = self.turned(offset_s, self.fit(offset_s)[1])
        errors = np.sqrt(((self.camera - gyro) ** 2).sum(axis=1))
        self.weights = 1 / (1 + (errors / (_OUTLIER * max(float(np.median(errors)), 1e-6))) ** 2)

    def peak(self, around_s: float) -> float:
        """Return the offset, s, at which the correlation is largest, by fitting a parabola."""
        for _ in range(2):
            offsets_s, correlations = self.scan(around_s, _FINE_REACH_S, _FINE_S)
            square, slope, _ = np.polyfit(offsets_s - around_s, correlations, 2)
            step_s = -slope / (2 * square) if square < 0 else 0.0
            around_s += float(np.clip(step_s, -_FINE_REACH_S, _FINE_REACH_S))
        return around_s

    def _less_mean(self, values: Floats) -> Floats:
        less: Floats = values - self.weights @ values / self.weights.sum()
        return less


def align(turns: Sequence[Turn], samples: Sequence[ImuSample], around_s: float = 0.0) -> Alignment:
    """Return the alignment, searched within ``SEARCH_S`` of ``around_s``. Raises ``CalibrationError``."""
    turns = [turn for turn in turns if turn.sigma_radps < _MAX_SIGMA_RADPS]
    _refuse_few(turns, samples)
    both = _Comparison(turns, samples, around_s)
    if len(both.camera) < _MIN_TURNS:
        raise CalibrationError(
            "camera and imu: their stamps hardly overlap; record for longer, or set imu.time_offset_s nearer"
        )
    for _ in range(_ITERATIONS):
        offsets_s, correlations = both.scan(around_s, SEARCH_S, _COARSE_S)
        best = int(np.argmax(correlations))
        both.weigh(float(offsets_s[best]))
    _refuse_still(both.rates(float(offsets_s[best])))
    _refuse_doubtful(offsets_s, correlations, best, around_s)
    offset_s = both.peak(float(offsets_s[best]))
    correlation, rotation = both.fit(offset_s)
    bias, gyro = both.turned(offset_s, rotation)
    slopes = (both.rates(offset_s + _FINE_S) - both.rates(offset_s - _FINE_S)) / (2 * _FINE_S)
    squares = ((both.camera - gyro) ** 2).sum(axis=1) / 3
    sigma_s = np.sqrt(both.weights @ squares / both.weights.sum() / (both.weights @ (slopes**2).sum(axis=1)))
    return Alignment(
        offset_s,
        float(sigma_s),
        correlation,
        rotation,
        bias,
        both.times_s,
        both.camera,
        gyro,
        both.weights,
        offsets_s,
        correlations,
    )


def _refuse_few(turns: Sequence[Turn], samples: Sequence[ImuSample]) -> None:
    if len(turns) < _MIN_TURNS or len(samples) < _MIN_TURNS:
        raise CalibrationError(
            f"camera and imu: rotation seen in {len(turns)} intervals between images, {len(samples)} inertial "
            f"samples; {_MIN_TURNS} of each are needed: record for longer, facing something with corners"
        )
    saturated = sum(sample.saturated for sample in samples)
    if saturated > _MAX_SATURATED * len(samples):
        raise CalibrationError(
            f"imu: {saturated} of {len(samples)} samples were at the end of the range; turn more slowly, or raise "
            "imu.gyro_range_dps"
        )


def _refuse_still(rates: Floats) -> None:
    moving_radps = float(np.sqrt(((rates - rates.mean(axis=0)) ** 2).sum(axis=1).mean()))
    if moving_radps < _MIN_RATE_RADPS:
        raise CalibrationError(
            f"imu: it turned too little, {moving_radps:.3f} rad/s (root mean square), {_MIN_RATE_RADPS:g} are "
            "needed; turn to and fro, briskly and unevenly"
        )


def _refuse_doubtful(offsets_s: Floats, correlations: Floats, best: int, around_s: float) -> None:
    if correlations[best] < _MIN_CORRELATION:
        raise CalibrationError(
            f"camera and imu: their rotations do not agree (correlation {correlations[best]:.2f}, "
            f"{_MIN_CORRELATION:g} is needed); turn in place before something far away and still, with good light"
        )
    if best in {0, len(offsets_s) - 1}:
        raise CalibrationError(
            f"camera and imu: their clocks are apart by more than {SEARCH_S:g} s around {around_s:g} s; set "
            "imu.time_offset_s nearer"
        )
    far = np.abs(offsets_s - offsets_s[best]) > _RIVAL_FROM_S
    if correlations[far].max() > _RIVAL * correlations[best]:
        raise CalibrationError(
            "camera and imu: several offsets between their clocks fit, the motion is too slow or repeats too evenly; "
            "turn briskly, at uneven intervals"
        )
