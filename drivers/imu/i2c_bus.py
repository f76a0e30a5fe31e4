"""A Linux I2C bus (``/dev/i2c-N``): register transfers with retries, counts of failures, and typed errors.

Registers are accessed by SMBus byte and block transfers, which every adapter and ``i2c-stub`` supports; chips without
registers get plain bytes. The kernel's error numbers: ENXIO, EREMOTEIO and often EIO mean no acknowledge, EAGAIN lost
arbitration, ETIMEDOUT a line held low or a clock stretched too long (Linux, ``Documentation/i2c/fault-codes.rst``).
"""

import errno
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Protocol, TypeVar

import smbus2

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    UnsupportedSettingError,
)

BLOCK_BYTES = 32  # the limit of an SMBus transfer
TRIES = 5
TIMEOUT_TRIES = 2  # that a timeout counts for, as the kernel has already waited a second
FIRST_PAUSE_S = 0.001  # doubled after each failure
ADDRESSES = range(0x08, 0x78)  # the others are reserved

NO_ANSWER = (errno.ENXIO, errno.EREMOTEIO, errno.EIO)
REASONS = {
    errno.ENXIO: "nack",
    errno.EREMOTEIO: "nack",
    errno.EAGAIN: "arbitration_lost",
    errno.ETIMEDOUT: "timeout",
}
"""Names in ``counts``; everything else is ``io_error``."""

Answer = TypeVar("Answer")


class Smbus(Protocol):
    """The part of ``smbus2.SMBus`` in use; each transfer raises ``OSError``."""

    def read_byte(self, i2c_addr: int, /) -> int:
        """One byte, without naming a register."""
        ...

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int, /) -> list[int]:
        """1 to 32 bytes from a register on."""
        ...

    def write_byte_data(self, i2c_addr: int, register: int, value: int, /) -> None:
        """One register."""
        ...

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: list[int], /) -> None:
        """1 to 32 bytes from a register on."""
        ...

    def i2c_rdwr(self, *messages: smbus2.i2c_msg) -> None:
        """Plain transfers of 1 to 8192 bytes per message; data read is then in the message."""
        ...

    def close(self) -> None:
        """Close the bus."""
        ...


class TransferError(DeviceLostError):
    """A transfer failed as often as it was tried; ``number`` is the last ``errno``."""

    def __init__(self, text: str, number: int) -> None:
        super().__init__(text)
        self.number = number


class I2cBus:
    """A bus. ``counts``: failed transfers by reason.

    ``smbus``: does the transfers; if not given, ``/dev/i2c-<number>`` under ``dev`` is opened. Raises
    ``DeviceMissingError``, ``DeviceForbiddenError`` or ``DeviceLostError``.
    """

    def __init__(
        self, number: int, smbus: Smbus | None = None, clock: Clock = SYSTEM_CLOCK, dev: Path = Path("/dev")
    ) -> None:
        self.path = dev / f"i2c-{number}"
        self.counts: Counter[str] = Counter()
        self._clock = clock
        self._closed = False
        self._smbus = _open(self.path) if smbus is None else smbus

    def read(self, address: int, register: int, length: int, tries: int = TRIES) -> bytes:
        """Read 1 to 32 bytes from ``register`` on. Raises ``TransferError``."""
        return bytes(
            self._try(address, tries, lambda: self._smbus.read_i2c_block_data(address, register, length)),
        )

    def write(self, address: int, register: int, data: bytes, tries: int = TRIES) -> None:
        """Write 1 to 32 bytes from ``register`` on. Raises ``TransferError``."""
        if len(data) == 1:
            self._try(address, tries, lambda: self._smbus.write_byte_data(address, register, data[0]))
        else:
            self._try(address, tries, lambda: self._smbus.write_i2c_block_data(address, register, list(data)))

    def receive(self, address: int, length: int, tries: int = TRIES) -> bytes:
        """Read 1 to 8192 bytes from a chip without registers. Raises ``TransferError``."""
        message = smbus2.i2c_msg.read(address, length)
        self._try(address, tries, lambda: self._smbus.i2c_rdwr(message))
        return bytes(message)

    def send(self, address: int, data: bytes, tries: int = TRIES) -> None:
        """Write 1 to 8192 bytes to a chip without registers. Raises ``TransferError``."""
        message = smbus2.i2c_msg.write(address, data)
        self._try(address, tries, lambda: self._smbus.i2c_rdwr(message))

    def scan(self, addresses: Iterable[int] = ADDRESSES) -> list[int]:
        """Return the addresses that acknowledge or that a kernel driver owns; stops early when the bus hangs."""
        found = []
        for address in addresses:
            try:
                self._smbus.read_byte(address)
            except OSError as error:
                if error.errno == errno.ETIMEDOUT:
                    break
                if error.errno != errno.EBUSY:
                    continue
            found.append(address)
        return found

    def close(self) -> None:
        """Close the bus; never raises."""
        self._closed = True
        with suppress(OSError):
            self._smbus.close()

    def _try(self, address: int, tries: int, transfer: Callable[[], Answer]) -> Answer:
        if self._closed:
            raise DeviceLostError(f"{self.path}: is closed; open it again")
        left, pause_s = tries, FIRST_PAUSE_S
        while True:
            try:
                return transfer()
            except OSError as error:
                number = error.errno or errno.EIO
            where = f"0x{address:02x} on {self.path}"
            if number == errno.EBUSY:
                raise DeviceBusyError(
                    f"{where}: a kernel driver owns it; set imu.driver to iio, or unbind the kernel's driver"
                )
            if number == errno.EOPNOTSUPP:
                raise UnsupportedSettingError(f"{where}: this bus has no I2C block transfers; use another bus")
            reason = REASONS.get(number, "io_error")
            self.counts[reason] += 1
            left -= TIMEOUT_TRIES if number == errno.ETIMEDOUT else 1
            if left <= 0 or number == errno.ENODEV:
                raise TransferError(f"{where}: {reason} until given up; check wiring, supply and pull-ups", number)
            self._clock.sleep_s(pause_s)
            pause_s *= 2


def _open(path: Path) -> Smbus:
    smbus = smbus2.SMBus()
    try:
        smbus.open(str(path))
    except FileNotFoundError as error:
        there = ", ".join(sorted(map(str, path.parent.glob("i2c-*"))))
        remedy = f"there is {there}; set imu.bus" if there else "this computer has none; enable I2C and load i2c-dev"
        raise DeviceMissingError(f"{path}: no such bus; {remedy}") from error
    except PermissionError as error:
        raise DeviceForbiddenError(f"{path}: no permission; add the user to the group i2c") from error
    except OSError as error:
        smbus.close()  # it may have got as far as a file that is no bus
        raise DeviceLostError(f"{path}: cannot be opened ({error.strerror}); is it an I2C bus?") from error
    return smbus
