"""EuRoC/ASL folders: ``mav0/cam0``, ``mav0/imu0`` and ``mav0/odom0`` with a ``data.csv`` each."""

import math
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

from drivers.samples import ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.errors import RecordingError
from lcf_edge.recording.read.decoding import read_image
from lcf_edge.recording.read.recording import MAX_STAMP_NS, Recording, Sample, UndecodedFrame, interleave
from lcf_edge.recording.read.sensor_yaml import Rotation, SensorYaml

MAX_ROW_CHARACTERS = 4096  # a longer row is malformed

T = TypeVar("T", UndecodedFrame, ImuSample, SpeedSample)


class _RowError(ValueError):
    """A row whose numbers cannot be used; the text says why, for counting."""


def is_asl_folder(path: Path) -> bool:
    """Whether ``path`` is ``mav0`` or the folder that holds it."""
    return any((folder / "cam0").is_dir() for folder in (path, path / "mav0"))


class AslRecording(Recording):
    """A folder in the EuRoC/ASL layout.

    ``T_BS`` of camera and IMU turn IMU samples into the camera's axes (R_BCᵀ R_BI), unless the configuration
    has ``imu.axes``, which are then applied to the samples as they are recorded. ``v_x`` and ``w_z`` of the
    odometry are the body's and pass unchanged. Raises ``RecordingError`` and ``OSError``.
    """

    def __init__(self, path: Path, config: Config) -> None:
        super().__init__(path)
        root = path if (path / "cam0").is_dir() else path / "mav0"
        self._cam, self._imu, self._odom = (root / name / "data.csv" for name in ("cam0", "imu0", "odom0"))
        if not self._cam.is_file():
            raise RecordingError(
                f"{self._cam}: missing; without stamps name the folder of images itself and set camera.fps"
            )
        self.frame_count = _row_count(self._cam)
        if not self.frame_count:
            raise RecordingError(f"{self._cam}: names no images; record it again")
        self.has_imu = self._has_rows(self._imu)
        self.has_speed = self._has_rows(self._odom)
        cam_yaml, imu_yaml = (csv.with_name("sensor.yaml") for csv in (self._cam, self._imu))
        cam = SensorYaml(cam_yaml) if cam_yaml.exists() else None
        self.lens = cam.lens() if cam else None
        self._warn_without_lens(config)
        self._axes: Rotation | None = None
        if self.has_imu and not config.imu.axes:
            if not imu_yaml.exists():
                self._warn(f"{imu_yaml}: missing, IMU axes are taken for the camera's; set imu.axes")
            elif cam:
                axes = cam.rotation().T @ SensorYaml(imu_yaml).rotation()
                self._axes = None if np.array_equal(axes, np.eye(3)) else axes

    def _items(self) -> Iterator[UndecodedFrame | Sample]:
        return interleave(
            self._rows(self._cam, "image", self._image),
            self._rows(self._imu, "imu", self._imu_sample) if self.has_imu else (),
            self._rows(self._odom, "speed", _speed_sample) if self.has_speed else (),
        )

    def _has_rows(self, csv: Path) -> bool:
        if not csv.parent.is_dir():
            return False
        if csv.is_file() and _row_count(csv):
            return True
        self._warn(f"{csv}: no samples there, going on without")
        return False

    def _rows(self, csv: Path, kind: str, parse: Callable[[list[str]], T]) -> Iterator[T]:
        def stray(line: int) -> None:
            self._skip(f"{kind} time that does not increase", f"{csv}:{line}")

        return increasing(self._parsed(csv, kind, parse), stray)

    def _parsed(self, csv: Path, kind: str, parse: Callable[[list[str]], T]) -> Iterator[tuple[int, T]]:
        """Yield line numbers and items of usable rows."""
        try:
            with csv.open(encoding="utf-8-sig", errors="replace") as file:
                for line, text in enumerate(iter(partial(file.readline, MAX_ROW_CHARACTERS), ""), 1):
                    row = text.strip()
                    if not row or row.startswith("#") or (line == 1 and row[0].isalpha()):
                        continue
                    try:
                        yield line, parse([field.strip() for field in row.split(",")])
                    except _RowError as error:
                        self._skip(f"{kind} row {error}", f"{csv}:{line}")
        except OSError as error:
            self._warn(f"{csv}: cannot be read ({error.strerror}), going on without the rest")

    def _image(self, fields: list[str]) -> UndecodedFrame:
        if len(fields) < 2 or not fields[1].isprintable() or Path(fields[1] or "/").name != fields[1]:
            raise _RowError("malformed")  # a path out of the folder, or an impossible name
        path = self._cam.with_name("data") / fields[1]
        return UndecodedFrame(_stamp_ns(fields[0]), str(path), partial(read_image, path))

    def _imu_sample(self, fields: list[str]) -> ImuSample:
        stamp_ns = _stamp_ns(fields[0])
        gyro_accel = np.reshape(_finite(fields[1:7], 6), (2, 3))
        if self._axes is not None:
            gyro_accel = gyro_accel @ self._axes.T
        (p, q, r), (x, y, z) = gyro_accel.tolist()
        return ImuSample(stamp_ns, (p, q, r), (x, y, z))


def increasing(rows: Iterable[tuple[int, T]], stray: Callable[[int], None]) -> Iterator[T]:
    """Yield items of ``rows`` (line, item) whose stamps increase; ``stray`` is called with the line of others.

    Where time steps back, the wrong row may be this one, or the one before it if that is far ahead: the row after
    them decides. So one wrong stamp costs one row.
    """
    waiting: tuple[int, T] | None = None
    doubted: tuple[int, T] | None = None  # earlier than the held one, later than what was delivered
    delivered_ns = -1
    for line, item in rows:
        if waiting and doubted:
            if item.stamp_ns > waiting[1].stamp_ns:
                stray(doubted[0])
            else:
                stray(waiting[0])
                waiting = doubted
            doubted = None
        if waiting is None:
            waiting = line, item
        elif item.stamp_ns > waiting[1].stamp_ns:
            yield waiting[1]
            delivered_ns = waiting[1].stamp_ns
            waiting = line, item
        elif delivered_ns < item.stamp_ns < waiting[1].stamp_ns:
            doubted = line, item
        else:
            stray(line)
    if doubted:
        stray(doubted[0])
    if waiting:
        yield waiting[1]


def _speed_sample(fields: list[str]) -> SpeedSample:
    stamp_ns = _stamp_ns(fields[0])
    speed_mps, yaw_rate_radps = _numbers(fields[1:3], 2)
    if not math.isfinite(speed_mps) or math.isinf(yaw_rate_radps):  # a yaw rate of NaN is an unknown one
        raise _RowError("with NaN or inf")
    return SpeedSample(stamp_ns, speed_mps, yaw_rate_radps)


def _stamp_ns(field: str) -> int:
    try:
        stamp_ns = int(field)
    except ValueError as error:
        raise _RowError("malformed") from error
    if not 0 <= stamp_ns <= MAX_STAMP_NS:
        raise _RowError("malformed")
    return stamp_ns


def _numbers(fields: list[str], count: int) -> list[float]:
    try:
        numbers = list(map(float, fields))
    except ValueError as error:
        raise _RowError("malformed") from error
    if len(numbers) != count:
        raise _RowError("malformed")
    return numbers


def _finite(fields: list[str], count: int) -> list[float]:
    numbers = _numbers(fields, count)
    if not all(map(math.isfinite, numbers)):
        raise _RowError("with NaN or inf")
    return numbers


def _row_count(csv: Path) -> int:
    with csv.open("rb") as file:
        return sum(row[:1].isdigit() for row in iter(partial(file.readline, MAX_ROW_CHARACTERS), b""))
