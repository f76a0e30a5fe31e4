"""``lcf-edge calibrate``: measure, report, and write what was found."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcf_edge.calibrate import config_file
from lcf_edge.calibrate.by_camera import calibrate_by_camera
from lcf_edge.calibrate.camera import Model, calibrate_camera
from lcf_edge.calibrate.foe import calibrate_foe
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.mask import Polygon, calibrate_mask, given_mask
from lcf_edge.calibrate.motions import calibrate_motions
from lcf_edge.calibrate.report import check_report, save_report
from lcf_edge.calibrate.rest import calibrate_rest
from lcf_edge.calibrate.result import Result
from lcf_edge.calibrate.sources import LiveSource, RecordedSource, SensorSource
from lcf_edge.calibrate.target import PRINT_SUFFIXES, Target
from lcf_edge.calibrate.time_offset import calibrate_time
from lcf_edge.config import DEFAULT_PATH, Config
from lcf_edge.web.library import require_aiohttp

SNAP_BY_HAND_DEG = 15.0  # a motion by hand is no more accurate


@dataclass(frozen=True)
class Task:
    """Options common to all calibrations: source and destination. ``file``: configuration; None: the usual one."""

    config: Config
    file: Path | None
    recording: Path | None
    report: Path | None
    write: bool
    seconds: float | None = None


def camera(task: Task, board: str, model: Model, views: int) -> list[str]:
    """The lens. Raises ``LcfError``."""
    pattern = Target.parse(board)
    return _calibrate(task, lambda source, guide: calibrate_camera(source, pattern, model, views, guide), imu=False)


def print_board(board: str, path: Path) -> list[str]:
    """Write the board to a file. Raises ``LcfError``."""
    pattern = Target.parse(board)
    check_report(path, PRINT_SUFFIXES)
    width_mm, height_mm = pattern.print_to(path)
    size = f"{width_mm:.0f} x {height_mm:.0f} mm"
    return [f"{path}: {pattern.name}, {size}; print it at 100 %, and glue it onto something flat"]


def imu_by_motions(task: Task, snap_deg: float | None) -> list[str]:
    """Axes by motions, and noise. Raises ``LcfError``."""
    snap_rad = np.radians(SNAP_BY_HAND_DEG if snap_deg is None else snap_deg)
    return _calibrate(task, lambda source, guide: calibrate_motions(source, task.config, snap_rad, guide), camera=False)


def imu_by_camera(task: Task, snap_deg: float | None) -> list[str]:
    """Axes by the camera. Raises ``LcfError``."""
    snap_rad = np.radians(snap_deg or 0.0)
    return _calibrate(
        task, lambda source, guide: calibrate_by_camera(source, task.config, task.seconds, snap_rad, guide)
    )


def imu_at_rest(task: Task) -> list[str]:
    """Noise, bias and gravity. Raises ``LcfError``."""
    return _calibrate(task, lambda source, guide: calibrate_rest(source, task.seconds, guide), camera=False)


def foe(task: Task) -> list[str]:
    """Mounting. Raises ``LcfError``."""
    return _calibrate(task, lambda source, guide: calibrate_foe(source, task.config, task.seconds, guide), imu=False)


def time(task: Task) -> list[str]:
    """Offset between the clocks. Raises ``LcfError``."""
    return _calibrate(task, lambda source, guide: calibrate_time(source, task.config, task.seconds, guide))


def mask_drawn(task: Task, polygons: list[Polygon] | None, port: int) -> list[str]:
    """Own parts in view as drawn on a page; ``polygons``: already drawn, px. Raises ``LcfError``, ``DriverError``."""
    require_aiohttp("calibrate mask")
    from lcf_edge.calibrate.drawing.server import drawn_mask  # noqa: PLC0415

    return _calibrate(
        task,
        lambda source, guide: drawn_mask(source, task.config, polygons or [], task.seconds, port, guide),
        imu=False,
    )


def mask(task: Task, polygons: list[Polygon] | None) -> list[str]:
    """Own parts in view: as given, px, or what never moves. Raises ``LcfError``."""
    if polygons:
        return _calibrate(task, lambda source, guide: given_mask(source, task.config, polygons, guide), imu=False)
    return _calibrate(task, lambda source, guide: calibrate_mask(source, task.config, task.seconds, guide), imu=False)


def _calibrate(
    task: Task, measure: Callable[[SensorSource, Guide], Result], *, camera: bool = True, imu: bool = True
) -> list[str]:
    """Findings as comments, then the lines of the configuration: the whole is TOML."""
    file = task.file or DEFAULT_PATH
    if task.report:
        check_report(task.report)
    if task.write:
        config_file.check_writable(file)
    guide = Guide()
    source: SensorSource
    if task.recording:
        source = RecordedSource(task.recording, task.config, guide, imu=imu)
    else:
        source = LiveSource(task.config, camera=camera, imu=imu)
    try:
        result = measure(source, guide)
    finally:
        guide.end()
    if task.report:
        save_report(result, task.report)
    if task.write:
        config_file.write(file, result.table, result.values)
    lines = [f"# {finding}" for finding in result.findings]
    lines += config_file.as_toml(result.table, result.values).splitlines()
    return lines + [f"# written to {file}"] * task.write
