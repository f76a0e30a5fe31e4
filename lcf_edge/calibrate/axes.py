"""The IMU's axes in camera axes: the value to write, snapped to exact ones where they are close."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lcf_edge.calibrate.result import Result
from lcf_edge.calibrate.rotations import angle_rad, in_words, nearest_exact
from lcf_edge.config import Config

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = npt.NDArray[np.float64]


def snapped(axes: Floats, snap_rad: float) -> tuple[Floats, tuple[str, ...]]:
    """Return ``axes``, or the exact ones if they are within ``snap_rad``; and a line for the user about it."""
    exact, off_rad = nearest_exact(axes)
    where = f"{np.degrees(off_rad):.1f}° from exact axes (IMU: {in_words(exact)})"
    if off_rad <= snap_rad:
        return exact, (f"axes: measured {where}; taken as exact (--snap 0 keeps what was measured)",)
    return axes, (f"axes: measured {where}; kept as measured (--snap {np.ceil(np.degrees(off_rad)):.0f} takes those)",)


def axes_result(
    axes: Floats, findings: tuple[str, ...], extra: dict[str, float], config: Config, paint: "Callable[[Figure], None]"
) -> Result:
    """Return the result for ``imu.axes``, with a line about the configured ones."""
    rows: list[list[float]] = (axes.round(6) + 0.0).tolist()
    if config.imu.axes:
        off_deg = np.degrees(angle_rad(np.array(config.imu.axes), axes))
        findings += (f"the configured axes are {off_deg:.1f}° from these",)
    return Result(findings, "imu", {"axes": rows, **extra}, paint)
