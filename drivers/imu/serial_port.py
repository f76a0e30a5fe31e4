"""A serial port with exclusive access, bounded reads and one-line errors."""

import errno
import os
import select
import termios
from contextlib import suppress
from pathlib import Path

import serial

from drivers.clock import Clock
from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    DriverError,
    UnsupportedSettingError,
    WrongDeviceError,
)

READ_S = 0.1
MAX_READ_BYTES = 4096
PORT_PATTERNS = ("serial/by-id/*", "ttyUSB*", "ttyACM*", "ttyAMA*", "ttyTHS*", "serial[0-9]*")


_FORBIDDEN = {
    errno.EACCES: "no permission; add the user to the group dialout and log in again",
    errno.EPERM: "the service may not open it; allow it in the unit (docs/install.md, Devices)",  # DeviceAllow
}


class SerialPort:
    """An open port: 8 data bits, no parity, 1 stop bit. Data received before opening is discarded.

    ``path``: such as /dev/ttyUSB0, or better /dev/serial/by-id/..., which survives a replug. Raises
    ``DeviceMissingError``, ``DeviceForbiddenError``, ``DeviceBusyError``, ``WrongDeviceError`` (no serial port) or
    ``UnsupportedSettingError`` (unsupported baud rate).
    """

    def __init__(self, path: str, baud: int) -> None:
        self.path = path
        self.baud = baud
        try:
            self._serial = serial.Serial(path, baud, timeout=0, exclusive=True)
        except (OSError, termios.error, ValueError) as error:
            raise _explained(error, path, baud) from error

    def read(self) -> bytes:
        """Return the data received, after waiting up to ``READ_S`` for some. Raises ``DeviceLostError``."""
        try:  # two system calls, where the library's own read takes several
            come, _, _ = select.select([self._serial], [], [], READ_S)
            data = os.read(self._serial.fileno(), MAX_READ_BYTES) if come else b""
        except OSError as error:
            raise self._lost() from error
        if come and not data:
            raise self._lost()
        return data

    def write(self, data: bytes, byte_pause_s: float, clock: Clock) -> None:
        """Send bytes, each on its own. Raises ``DeviceLostError``."""
        try:
            for byte in data:
                self._serial.write(bytes([byte]))
                clock.sleep_s(byte_pause_s)
        except OSError as error:
            raise self._lost() from error

    def _lost(self) -> DeviceLostError:
        return DeviceLostError(f"{self.path}: the serial port went away; plug the IMU in again")

    def close(self) -> None:
        """Close the port."""
        with suppress(OSError, termios.error):
            self._serial.close()


def ports(devices: Path = Path("/dev")) -> list[str]:
    """List the serial ports, those with persistent names first."""
    return [str(path) for pattern in PORT_PATTERNS for path in sorted(devices.glob(pattern))]


def _explained(error: Exception, path: str, baud: int) -> DriverError:
    code = error.errno if isinstance(error, OSError) else None
    if isinstance(error, ValueError):
        return UnsupportedSettingError(f"{path}: cannot do {baud} baud; set another imu.baud")
    if code in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        there = ", ".join(ports())
        found = f"there are {there}; set imu.port" if there else "there is no other; plug the IMU in"
        return DeviceMissingError(f"{path}: no such serial port; {found}")
    if code in _FORBIDDEN:
        return DeviceForbiddenError(f"{path}: {_FORBIDDEN[code]}")
    if code in (errno.EAGAIN, errno.EBUSY):
        return DeviceBusyError(f"{path}: another program has it open; stop that program (fuser {path} names it)")
    if code == errno.EIO:
        return DeviceLostError(f"{path}: the serial port does not answer; plug the IMU in again")
    return WrongDeviceError(f"{path}: is not a serial port; set imu.port")
