"""The IMU's axes from comparing its gyro with the camera's rotation."""

import numpy as np

from lcf_edge.calibrate.alignment import align
from lcf_edge.calibrate.axes import axes_result, snapped
from lcf_edge.calibrate.compare import Watched, watch
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.result import CalibrationError, Result
from lcf_edge.calibrate.sources import SensorSource
from lcf_edge.calibrate.time_offset import guessed, painter
from lcf_edge.config import Config

_MAX_SIGMA_RAD = np.radians(1.0)
_MAX_LAG_S = 0.01  # largest clock offset beyond the configured one


def calibrate_by_camera(
    source: SensorSource, config: Config, seconds: float | None, snap_rad: float, guide: Guide
) -> Result:
    """``imu.axes``. Raises ``CalibrationError``."""
    return axes_of(watch(source, config, seconds, guide), config, snap_rad)


def axes_of(watched: Watched, config: Config, snap_rad: float) -> Result:
    """``imu.axes`` from what was watched. Raises ``CalibrationError``."""
    alignment = align(watched.turns, watched.samples, config.imu.time_offset_s)
    sigma_rad = alignment.axes_sigma_rad
    if sigma_rad > _MAX_SIGMA_RAD:
        turned = dict(zip(("x: nod", "y: turn", "z: roll"), alignment.rates_radps.tolist(), strict=True))
        least = sorted(turned, key=lambda axis: turned[axis])[:2]
        raise CalibrationError(
            f"imu: the axes are only known to {np.degrees(sigma_rad):.1f}°, it turned about too few of them; turn more "
            f"about the camera's {' and '.join(least)}"
        )
    axes, words = snapped(alignment.axes, snap_rad)
    findings = (
        f"{len(alignment.camera)} intervals between images, {len(watched.samples)} inertial samples",
        f"correlation: {alignment.correlation:.3f}; left over: {alignment.residual_radps:.3f} rad/s of an axis, where "
        f"{', '.join(f'{rate:.2f}' for rate in alignment.rates_radps)} rad/s were turned about x, y, z",
        *words,
        f"uncertainty: ± {np.degrees(sigma_rad):.2f}°",
        "gyro bias: "
        + ", ".join(f"{bias:.4f}" for bias in alignment.gyro_bias_radps)
        + " rad/s (estimated while it runs)",
        *guessed(watched),
    )
    if abs(alignment.offset_s - config.imu.time_offset_s) > _MAX_LAG_S:
        lag_ms = 1000 * alignment.offset_s
        findings += (f"the clocks are {lag_ms:.0f} ms apart, which is not configured: run lcf-edge calibrate time",)
    return axes_result(axes, findings, {}, config, painter(alignment))
