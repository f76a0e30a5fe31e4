"""The offset between the clocks of camera and IMU."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from lcf_edge.calibrate import report
from lcf_edge.calibrate.alignment import Alignment, align
from lcf_edge.calibrate.compare import Watched, watch
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.result import CalibrationError, Result
from lcf_edge.calibrate.sources import SensorSource
from lcf_edge.config import Config

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MAX_SIGMA_S = 0.004


def calibrate_time(source: SensorSource, config: Config, seconds: float | None, guide: Guide) -> Result:
    """``imu.time_offset_s``. Raises ``CalibrationError``."""
    watched = watch(source, config, seconds, guide)
    alignment = align(watched.turns, watched.samples, config.imu.time_offset_s)
    if alignment.offset_sigma_s > _MAX_SIGMA_S:
        raise CalibrationError(
            f"camera and imu: the offset is only known to {1000 * alignment.offset_sigma_s:.1f} ms; turn more briskly, "
            "or for longer"
        )
    findings = (
        f"{len(alignment.camera)} intervals between images, {len(watched.samples)} inertial samples",
        f"turned {_rates(alignment)} about the camera's x, y, z (root mean square)",
        f"offset: {1000 * alignment.offset_s:.1f} ± {1000 * alignment.offset_sigma_s:.1f} ms (camera less IMU time)",
        f"correlation: {alignment.correlation:.3f}; 50 ms beside: {beside(alignment):.3f}",
        *guessed(watched),
    )
    return Result(findings, "imu", {"time_offset_s": round(alignment.offset_s, 4)}, painter(alignment))


def beside(alignment: Alignment, by_s: float = 0.05) -> float:
    """Return the correlation beside the peak, a measure of its sharpness."""
    both = [alignment.offset_s - by_s, alignment.offset_s + by_s]
    return float(np.interp(both, alignment.offsets_s, alignment.correlations).max())


def guessed(watched: Watched) -> tuple[str, ...]:
    """Return a line for the user if the lens is only guessed."""
    return ("the lens is guessed; better: lcf-edge calibrate camera first",) if watched.guessed else ()


def _rates(alignment: Alignment) -> str:
    return ", ".join(f"{rate:.2f}" for rate in alignment.rates_radps) + " rad/s"


def painter(alignment: Alignment) -> "Callable[[Figure], None]":
    """Return a function that plots both rates over time, and the correlation over the offset."""

    def paint(figure: "Figure") -> None:
        grid = figure.add_gridspec(3, 2, width_ratios=(3, 2))
        for row, name in enumerate(("x (nods)", "y (turns)", "z (rolls)")):
            axes = figure.add_subplot(grid[row, 0])
            axes.plot(alignment.times_s, alignment.gyro[:, row], color=report.RED, linewidth=1, label="gyro, aligned")
            axes.plot(alignment.times_s, alignment.camera[:, row], ".", color=report.BLUE, markersize=3, label="camera")
            axes.set_ylabel(f"{name}\nrad/s")
            report.plain(axes, "rates about the camera's axes" if row == 0 else "")
            if row == 0:
                axes.legend(loc="upper right", fontsize=8)
        axes.set_xlabel("s")
        axes = figure.add_subplot(grid[:, 1])
        axes.plot(1000 * alignment.offsets_s, alignment.correlations, color=report.BLUE)
        axes.axvline(1000 * alignment.offset_s, color=report.RED, linewidth=1)
        axes.set_xlabel("camera time less IMU time, ms")
        report.plain(axes, f"correlation, best {alignment.correlation:.3f} at {1000 * alignment.offset_s:.1f} ms")

    return paint
