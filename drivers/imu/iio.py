"""IMUs that the kernel owns, through its Industrial I/O subsystem (``/sys/bus/iio``).

Linux, ``Documentation/ABI/testing/sysfs-bus-iio``. With a buffer (and trigger, if any) whole scans come from
``/dev/iio:deviceN`` with the kernel's stamps; without, values are polled. Some drivers expose gyro and accelerometer as
two devices (``lsm6dso_gyro``, ``lsm6dso_accel``; ``icm42688-gyro``, ``icm42688-accel``), which are polled together.
"""

import argparse
import errno
import math
import os
import select
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from drivers.by_hand import describe_imu, positive, watch
from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import (
    DeviceLostError,
    DeviceStalledError,
    DriverError,
)
from drivers.imu.iio_sysfs import (
    ACCEL,
    GYRO,
    STAMP,
    Channel,
    channel,
    driver_error,
    find,
    has,
    has_buffer,
    has_trigger,
    scan_of,
    set_ranges,
    set_rate,
    text_of,
    write_to,
)
from drivers.imu.settings import DEFAULT_SETTINGS, ImuSettings
from drivers.sample_clock import SampleClock
from drivers.samples import ImuSample

SYSFS = Path("/sys/bus/iio/devices")
DEV = Path("/dev")

BUFFER_SCANS = 256
BATCH_S = 0.015
STALL_S = 0.5
PATIENT_PERIODS = 10
TEMPERATURE_NS = 1_000_000_000
TRIES = 10  # consecutive reads that may fail


class Iio:
    """An open IMU. ``temperature_c``: of the die, NaN while unknown. ``rate_hz``: what was granted.

    ``device``: the chip's name as the kernel has it, ``iio:deviceN``, or "" for the first with a gyro. Rate and ranges
    are set to the closest on offer. Raises ``DeviceMissingError``, ``WrongDeviceError`` (no accelerometer),
    ``DeviceForbiddenError``, ``DeviceBusyError``, ``UnsupportedSettingError``, ``DeviceLostError``.
    """

    def __init__(
        self,
        device: str = "",
        settings: ImuSettings = DEFAULT_SETTINGS,
        root: Path = SYSFS,
        dev: Path = DEV,
        clock: Clock = SYSTEM_CLOCK,
    ) -> None:
        self.counts: Counter[str] = Counter()
        self.temperature_c = math.nan
        self._clock = clock
        gyro, accel = find(device, root)
        self.name = f"{text_of(gyro / 'name') or device} ({gyro.name})"
        self._folder = gyro
        self._look_at_ns = clock.monotonic_ns()
        node = dev / gyro.name
        file = _take(node, gyro) if gyro == accel and node.exists() and has_buffer(gyro) else None
        try:
            self.rate_hz = set_rate(gyro, accel, settings.rate_hz)
            set_ranges(gyro, accel, settings.gyro_range_dps, settings.accel_range_g)
            channels = {name: channel(gyro, name) for name in GYRO} | {name: channel(accel, name) for name in ACCEL}
            self._source: _Buffer | _Polled
            if file is not None and has_trigger(gyro, root):
                self._source = _Buffer(gyro, file, channels, self.rate_hz, clock)
            else:
                self._source = _Polled(gyro, accel, channels, self.rate_hz, clock, self.counts)
                _leave(file)
        except DriverError:
            _leave(file)
            raise

    def read(self) -> Sequence[ImuSample]:
        """Wait for samples and return them. Raises ``DeviceStalledError``, ``DeviceLostError``."""
        if self._clock.monotonic_ns() >= self._look_at_ns:
            self._look_at_ns = self._clock.monotonic_ns() + TEMPERATURE_NS
            self._look_at_temperature()
        return self._source.read()

    def close(self) -> None:
        """Close the device."""
        self._source.close()

    def _look_at_temperature(self) -> None:
        with suppress(OSError, ValueError):  # busy while the buffer runs, or not there
            raw = float(text_of(self._folder / "in_temp_raw"))
            scale = float(text_of(self._folder / "in_temp_scale") or 1.0)
            offset = float(text_of(self._folder / "in_temp_offset") or 0.0)
            self.temperature_c = (raw + offset) * scale / 1e3


def _take(node: Path, folder: Path) -> int:
    """Open the character device, which only one program can, and stop a buffer that a killed one left running."""
    try:
        file = os.open(node, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise driver_error(error, node) from error
    try:
        write_to(folder / "buffer/enable", "0")
    except DriverError:
        os.close(file)
        raise
    return file


def _leave(file: int | None) -> None:
    if file is not None:
        os.close(file)


class _Scale:
    """Converts raw counts of the six channels to a sample."""

    def __init__(self, channels: Mapping[str, Channel]) -> None:
        ordered = [channels[name] for name in (*GYRO, *ACCEL)]
        self._scale = [channel.scale for channel in ordered]
        self._offset = [channel.offset for channel in ordered]
        self._end = [channel.end for channel in ordered]

    def sample(self, stamp_ns: int, counts: Sequence[float]) -> ImuSample:
        p, q, r, x, y, z = ((n + o) * s for n, o, s in zip(counts, self._offset, self._scale, strict=True))
        saturated = any(not -end <= n < end for n, end in zip(counts, self._end, strict=True))
        return ImuSample(stamp_ns, (p, q, r), (x, y, z), saturated)


class _Polled:
    """Polls the six values one after the other, at the device's rate."""

    def __init__(
        self,
        gyro: Path,
        accel: Path,
        channels: Mapping[str, Channel],
        rate_hz: float,
        clock: Clock,
        counts: Counter[str],
    ) -> None:
        self._scale = _Scale(channels)
        self._period_ns = round(1e9 / rate_hz)
        self._clock = clock
        self._counts = counts
        self._name = gyro.name
        self._failed = 0
        self._due_ns = clock.monotonic_ns()
        self._files: list[int] = []
        try:
            for path in [gyro / f"{name}_raw" for name in GYRO] + [accel / f"{name}_raw" for name in ACCEL]:
                self._files.append(os.open(path, os.O_RDONLY | os.O_CLOEXEC))
        except OSError as error:
            self.close()
            raise driver_error(error, path) from error

    def read(self) -> list[ImuSample]:
        now_ns = self._clock.monotonic_ns()
        self._clock.sleep_s((self._due_ns - now_ns) / 1e9)
        self._due_ns = max(self._due_ns + self._period_ns, now_ns)
        stamp_ns = self._clock.monotonic_ns()
        try:
            counts = [float(os.pread(file, 32, 0)) for file in self._files]
        except (OSError, ValueError) as error:
            self._failed += 1
            self._counts["io_error"] += 1
            gone = isinstance(error, OSError) and error.errno in (errno.ENODEV, errno.ENOENT, errno.EBADF)
            if gone or self._failed >= TRIES:
                raise DeviceLostError(
                    f"{self._name}: can no longer be read ({error}); is the chip still connected?"
                ) from error
            return []
        self._failed = 0
        return [self._scale.sample(stamp_ns, counts)]

    def close(self) -> None:
        while self._files:
            os.close(self._files.pop())


class _Buffer:
    """Reads whole scans from the character device."""

    def __init__(self, folder: Path, file: int, channels: Mapping[str, Channel], rate_hz: float, clock: Clock) -> None:
        self._folder = folder
        self._name = folder.name
        self._scale = _Scale(channels)
        self._clock = clock
        self._patience_s = max(STALL_S, PATIENT_PERIODS / rate_hz)
        self._sample_clock = SampleClock(rate_hz)
        self._rest = b""
        self._file: int | None = file
        with suppress(OSError):
            (folder / "current_timestamp_clock").write_text("monotonic")
        self._stamped = text_of(folder / "current_timestamp_clock") == "monotonic" and has(folder, STAMP)
        elements = (*GYRO, *ACCEL, *([STAMP] if self._stamped else []))
        for switch in (folder / "scan_elements").glob("*_en"):
            write_to(switch, str(int(switch.name.removesuffix("_en") in elements)))
        self._scan = scan_of(folder, elements)
        write_to(folder / "buffer/length", str(BUFFER_SCANS))
        watermark = folder / "buffer/watermark"
        if watermark.exists():
            write_to(watermark, str(max(round(BATCH_S * rate_hz), 1)))
        write_to(folder / "buffer/enable", "1")

    def read(self) -> list[ImuSample]:
        if self._file is None:
            raise DeviceLostError(f"{self._name}: is closed; open it again")
        if not select.select([self._file], [], [], self._patience_s)[0]:
            raise DeviceStalledError(f"{self._name}: no scan for {self._patience_s:g} s; does its interrupt work?")
        now_ns = self._clock.monotonic_ns()
        try:
            data = self._rest + os.read(self._file, BUFFER_SCANS * self._scan.type.itemsize)
        except OSError as error:
            raise DeviceLostError(f"{self._name}: can no longer be read ({error.strerror})") from error
        if len(data) == len(self._rest):
            raise DeviceLostError(f"{self._name}: is gone; is the chip still connected?")
        whole = len(data) - len(data) % self._scan.type.itemsize
        self._rest = data[whole:]
        scans = np.frombuffer(data[:whole], self._scan.type)
        columns = [self._scan.column(scans, name) for name in (*GYRO, *ACCEL)]
        stamps_ns = scans[STAMP].tolist() if self._stamped else self._sample_clock.stamps_ns(now_ns, len(scans))
        rows = zip(*columns, strict=True)
        return [self._scale.sample(stamp_ns, row) for stamp_ns, row in zip(stamps_ns, rows, strict=True)]

    def close(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None
        with suppress(OSError):
            (self._folder / "buffer/enable").write_text("0")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the device by hand."""
    parser = argparse.ArgumentParser(prog="python -m drivers.imu.iio")
    parser.add_argument("device", nargs="?", default="", help="the chip's name or iio:deviceN (the first with a gyro)")
    parser.add_argument("--rate", type=positive, default=DEFAULT_SETTINGS.rate_hz, help="Hz (%(default)s)")
    parser.add_argument("--gyro-range", type=int, default=DEFAULT_SETTINGS.gyro_range_dps, help="°/s (%(default)s)")
    parser.add_argument("--accel-range", type=int, default=DEFAULT_SETTINGS.accel_range_g, help="g (%(default)s)")
    parser.add_argument("--seconds", type=positive, default=10.0, help="how long (%(default)s)")
    arguments = parser.parse_args(argv)
    settings = ImuSettings(arguments.rate, arguments.gyro_range, arguments.accel_range)
    return watch(lambda: Iio(arguments.device, settings), arguments.seconds, describe_imu)


if __name__ == "__main__":
    sys.exit(main())
