"""Watch a device from the command line: rate, jitter, errors and values once a second."""

import argparse
import math
import sys
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.device import Device
from drivers.errors import DriverError
from drivers.samples import Frame, ImuSample

REPORT_NS = 1_000_000_000


def watch(
    open_device: Callable[[], Device[Any]],
    seconds: float,
    describe: Callable[[Any], str],
    clock: Clock = SYSTEM_CLOCK,
) -> int:
    """Open a device, report on what it delivers for ``seconds``, and close it.

    ``describe``: the values of a record in a few words. Return the exit status: 1, with one line on stderr, when the
    device fails; 0 after an interrupt.
    """
    try:
        device = open_device()
        try:
            _report(device, seconds, describe, clock)
        except KeyboardInterrupt:
            sys.stdout.write("\n")
        finally:
            device.close()
    except DriverError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


def positive(text: str) -> float:
    """Parse a number above 0. Raises ``argparse.ArgumentTypeError``."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text}: write a number above 0")
    return number


def describe_imu(sample: ImuSample) -> str:
    """Format an inertial sample."""
    gyro = " ".join(f"{value:+8.4f}" for value in sample.gyro)
    accel = " ".join(f"{value:+8.3f}" for value in sample.accel)
    return f"gyro {gyro} rad/s  accel {accel} m/s²{'  saturated' * sample.saturated}"


def describe_frame(frame: Frame) -> str:
    """Format size and brightness of an image."""
    height, width = frame.image.shape
    return f"{width}x{height}, mean {frame.image.mean():.0f}"


def _report(device: Device[Any], seconds: float, describe: Callable[[Any], str], clock: Clock) -> None:
    begin_ns = report_ns = clock.monotonic_ns()
    records: list[Any] = []
    while clock.monotonic_ns() - begin_ns < seconds * 1e9:
        records += device.read()
        now_ns = clock.monotonic_ns()
        if now_ns - report_ns >= REPORT_NS:
            sys.stdout.write(_line(device, records, describe) + "\n")
            sys.stdout.flush()
            records = records[-1:]  # the next interval begins with it
            report_ns = now_ns


def _line(device: Device[Any], records: Sequence[Any], describe: Callable[[Any], str]) -> str:
    errors = " ".join(f"{reason} {count}" for reason, count in sorted(device.counts.items())) or "no errors"
    intervals_ms = [(later.stamp_ns - earlier.stamp_ns) / 1e6 for earlier, later in pairwise(records)]
    if not intervals_ms:
        return f"{device.name}: nothing came  {errors}"
    mean_ms = sum(intervals_ms) / len(intervals_ms)
    spread = f"{min(intervals_ms):.2f} to {max(intervals_ms):.2f} ms"
    return f"{1e3 / mean_ms:7.2f} Hz, every {spread}  {errors}  {describe(records[-1])}"
