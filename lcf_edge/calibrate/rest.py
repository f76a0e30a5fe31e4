"""The gyro and the accelerometer at rest: bias, noise, gravity."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from drivers.samples import ImuSample
from lcf_edge.calibrate import report
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.result import CalibrationError, Result
from lcf_edge.calibrate.sources import SensorSource, for_a_while
from lcf_edge.config import Config, Vehicle
from lcf_edge.ego_motion.estimator import EgoMotionEstimator

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]

LIVE_S = 10.0
GRAVITY_MPS2 = 9.81

_MIN_S = 3.0
_MIN_SAMPLES = 100
_PIECE_S = 0.5
_MOVED_RADPS = 0.02  # largest difference of the mean of a part from that of the whole
_MOVED_MPS2 = 0.2
_QUIET_RADPS = 0.05  # 1 sigma of a sample; more is motion, not noise
_QUIET_MPS2 = 0.5
_GRAVITY_ERROR = 0.08  # relative; beyond, the daemon does not recognise rest
_GRAVITY_DOUBT = 0.02
_MIN_NOISE_RADPS = 0.001
_FRAME_NS = 50_000_000


@dataclass(frozen=True)
class Rest:
    """Statistics of samples at rest, in the IMU's axes.

    ``bias_radps``, ``noise_radps`` (1 sigma of a sample), ``wander_radps`` (of means over half a second),
    ``force_mps2`` (specific, so it points up), ``shake_mps2`` (1 sigma): (3,) each.
    """

    seconds: float
    samples: int
    bias_radps: Floats
    noise_radps: Floats
    wander_radps: Floats
    force_mps2: Floats
    shake_mps2: Floats

    @property
    def gravity_mps2(self) -> float:
        """Magnitude of gravity as this accelerometer measures it, m/s²."""
        return float(np.linalg.norm(self.force_mps2))

    @property
    def gyro_noise_radps(self) -> float:
        """``imu.gyro_noise_radps``: noise and wander of its worst axis, rounded up to two digits."""
        worst = max(float(np.hypot(self.noise_radps, self.wander_radps).max()), _MIN_NOISE_RADPS)
        step = 10.0 ** (np.floor(np.log10(worst)) - 1)
        return float(f"{ceil(worst / step - 1e-6) * step:.2g}")

    def findings(self) -> tuple[str, ...]:
        """Return lines for the user."""
        off = self.gravity_mps2 / GRAVITY_MPS2 - 1
        doubt = "; more than expected of a good accelerometer" if abs(off) > _GRAVITY_DOUBT else ""
        return (
            f"at rest: {self.seconds:.1f} s, {self.samples} samples, {self.samples / self.seconds:.0f} Hz",
            f"gyro bias: {_three(self.bias_radps)} rad/s (needs no key: the daemon estimates it)",
            f"gyro noise: {_three(self.noise_radps)} rad/s a sample; the bias wandered by "
            f"{self.wander_radps.max():.4f} rad/s",
            f"gravity: {self.gravity_mps2:.3f} m/s², {off:+.1%} of {GRAVITY_MPS2}{doubt}; "
            f"noise {self.shake_mps2.max():.3f} m/s²",
        )


def calibrate_rest(source: SensorSource, seconds: float | None, guide: Guide) -> Result:
    """``imu.gyro_noise_radps``. Raises ``CalibrationError``."""
    if source.live:
        seconds = seconds or LIVE_S
        guide.say(f"Let the vehicle stand for {seconds:g} s: hands off, motors off.")
    samples: list[ImuSample] = []
    for item in for_a_while(source.items(), seconds, ImuSample):
        if isinstance(item, ImuSample):
            samples.append(item)
            guide.progress(f"{(item.stamp_ns - samples[0].stamp_ns) * 1e-9:.0f} s at rest")
    guide.end()
    rest = measure(samples)
    return Result(rest.findings(), "imu", {"gyro_noise_radps": rest.gyro_noise_radps}, painter(samples, rest))


def measure(samples: Sequence[ImuSample]) -> Rest:
    """Measure samples taken at rest. Raises ``CalibrationError`` when they are too few or were not at rest."""
    seconds = (samples[-1].stamp_ns - samples[0].stamp_ns) * 1e-9 if samples else 0.0
    if seconds < _MIN_S or len(samples) < _MIN_SAMPLES:
        raise CalibrationError(
            f"imu: {len(samples)} samples in {seconds:.1f} s; {_MIN_SAMPLES} in {_MIN_S:g} s are needed at least"
        )
    if any(sample.saturated for sample in samples):
        raise CalibrationError("imu: samples at the end of its range while at rest; check wiring, chip and ranges")
    gyro = np.array([sample.gyro for sample in samples])
    accel = np.array([sample.accel for sample in samples])
    count = max(int(seconds / _PIECE_S), 1)
    gyro_means, accel_means = (
        np.array([piece.mean(axis=0) for piece in np.array_split(values, count)]) for values in (gyro, accel)
    )
    bias, force = gyro.mean(axis=0), accel.mean(axis=0)
    noise, shake = (
        np.sqrt(np.mean([piece.var(axis=0) for piece in np.array_split(values, count)], axis=0))
        for values in (gyro, accel)
    )
    moved = np.abs(gyro_means - bias).max() > _MOVED_RADPS or np.abs(accel_means - force).max() > _MOVED_MPS2
    if moved or noise.max() > _QUIET_RADPS or shake.max() > _QUIET_MPS2:
        raise CalibrationError(
            f"imu: it moved while it should rest (gyro up to {np.abs(gyro_means - bias).max():.3f} rad/s off its mean, "
            f"noise {noise.max():.3f} rad/s and {shake.max():.2f} m/s²); hands off, motors off, then try again"
        )
    rest = Rest(seconds, len(samples), bias, noise, gyro_means.std(axis=0), force, shake)
    off = rest.gravity_mps2 / GRAVITY_MPS2 - 1
    if abs(off) > _GRAVITY_ERROR:
        raise CalibrationError(
            f"imu: gravity shows as {rest.gravity_mps2:.2f} m/s², {off:+.0%} of {GRAVITY_MPS2}; check "
            "imu.accel_range_g and the unit that the IMU sends"
        )
    _refuse_unrecognised(samples, rest)
    return rest


def _refuse_unrecognised(samples: Sequence[ImuSample], rest: Rest) -> None:
    """Raise ``CalibrationError`` if the daemon would not recognise this as rest, and learn neither bias nor gravity."""
    estimator = EgoMotionEstimator(Config().imu, Vehicle())
    next_ns = samples[0].stamp_ns
    for sample in samples:
        estimator.add_imu(sample)
        if sample.stamp_ns >= next_ns:
            estimator.advance(sample.stamp_ns)
            next_ns += _FRAME_NS
    if not estimator.bias.known:
        raise CalibrationError(
            "imu: too noisy for the daemon to see that it is at rest (bias "
            f"{np.linalg.norm(rest.bias_radps):.3f} rad/s, noise {rest.noise_radps.max():.3f} rad/s and "
            f"{rest.shake_mps2.max():.2f} m/s²); motors off, fix the IMU more firmly, or lower imu.rate_hz"
        )


def painter(samples: Sequence[ImuSample], rest: Rest) -> "Callable[[Figure], None]":
    """Return a function that plots gyro and accelerometer over time."""

    def paint(figure: "Figure") -> None:
        times_s = np.array([sample.stamp_ns - samples[0].stamp_ns for sample in samples]) * 1e-9
        gyro = np.array([sample.gyro for sample in samples])
        accel = np.array([sample.accel for sample in samples]) - rest.force_mps2
        for axes, values, title in zip(
            figure.subplots(2, 1, sharex=True),
            (gyro, accel),
            ("gyro at rest, rad/s; lines: bias", f"accelerometer less its mean of {rest.gravity_mps2:.2f} m/s²"),
            strict=True,
        ):
            for column, colour, name in zip(values.T, report.AXIS_COLOURS, "xyz", strict=True):
                axes.plot(times_s, column, ".", color=colour, markersize=2, label=name)
                axes.axhline(column.mean(), color=colour, linewidth=1)
            report.plain(axes, title)
            axes.legend(loc="upper right", fontsize=8)
        axes.set_xlabel("s")

    return paint


def _three(values: Floats) -> str:
    return ", ".join(f"{value:.4f}" for value in values)
