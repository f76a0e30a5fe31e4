"""The bus: chips at their addresses, and bus faults."""

import errno
import os
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import smbus2

from drivers.clock import Clock
from hil_mocks.i2c.chip import SimulatedChip

READ = 0x0001  # of a message's flags
HANG_S = 1.0  # after which Linux aborts a transfer
BLOCK_BYTES = 32
OVERHEAD_BYTES = 3  # address, register, address again
CLOCKS_PER_BYTE = 9


@dataclass(slots=True)
class Fault:
    """A fault of the next transfers (of one register, if given)."""

    left: int
    number: int = 0  # errno; 0: the transfer succeeds with ``changed`` data
    register: int | None = None
    changed: Callable[[bytes], bytes] = bytes


Transfer = Callable[[SimulatedChip], bytes]


class SimulatedBus:
    """Replaces ``smbus2.SMBus``. ``transfers``: their number; ``closed``: whether the bus was closed.

    ``speed_hz``: clock of the bus; 0: transfers take no time.
    """

    def __init__(self, clock: Clock, chips: Mapping[int, SimulatedChip], speed_hz: float = 0.0) -> None:
        self.chips = dict(chips)
        self.speed_hz = speed_hz
        self.owned_by_kernel: set[int] = set()
        self.hanging = False  # a line is held low
        self.transfers = 0
        self.closed = False
        self._clock = clock
        self._faults: deque[Fault] = deque()

    def open(self, bus: str) -> None:
        """As smbus2; this bus exists under any name."""

    def fail(self, number: int, times: int = 1, register: int | None = None) -> None:
        """Make the next transfers (of a register) fail with this ``errno``; faults apply one after the other."""
        self._faults.append(Fault(times, number, register))

    def flip(self, at: int, mask: int = 0x80, times: int = 1, register: int | None = None) -> None:
        """Invert bits of byte ``at`` in the next reads (of a register)."""

        def changed(data: bytes) -> bytes:
            return data[:at] + bytes([data[at] ^ mask]) + data[at + 1 :]

        self._faults.append(Fault(times, register=register, changed=changed))

    def read_byte(self, i2c_addr: int, /) -> int:
        """One byte; here always of register 0."""
        return self._transfer(i2c_addr, 0, lambda chip: chip.read(0, 1))[0]

    def read_i2c_block_data(self, i2c_addr: int, register: int, length: int, /) -> list[int]:
        """1 to 32 bytes from a register on."""
        if not 1 <= length <= BLOCK_BYTES:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        return list(self._transfer(i2c_addr, register, lambda chip: chip.read(register, length)))

    def write_byte_data(self, i2c_addr: int, register: int, value: int, /) -> None:
        """One register."""
        self.write_i2c_block_data(i2c_addr, register, [value])

    def write_i2c_block_data(self, i2c_addr: int, register: int, data: list[int], /) -> None:
        """1 to 32 bytes from a register on."""
        if not 1 <= len(data) <= BLOCK_BYTES:
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        self._transfer(i2c_addr, register, lambda chip: chip.write(register, bytes(data)))

    def i2c_rdwr(self, *messages: smbus2.i2c_msg) -> None:
        """Bytes without a register."""
        for message in messages:
            transfer = _receiving(message.len) if message.flags & READ else _sending(bytes(message))
            for at, value in enumerate(self._transfer(message.addr, 0, transfer)):
                message.buf[at] = bytes([value])

    def close(self) -> None:
        """Close the bus."""
        self.closed = True

    def _transfer(self, address: int, register: int, transfer: Transfer) -> bytes:
        self.transfers += 1
        if self.hanging:
            self._clock.sleep_s(HANG_S)
            self._refuse(errno.ETIMEDOUT)
        if address in self.owned_by_kernel:
            self._refuse(errno.EBUSY)
        fault = self._fault(register)
        if fault and fault.number:
            if fault.number == errno.ETIMEDOUT:
                self._clock.sleep_s(HANG_S)
            self._refuse(fault.number)
        if address not in self.chips:
            self._refuse(errno.EREMOTEIO)
        answer = transfer(self.chips[address])
        if self.speed_hz:
            self._clock.sleep_s((len(answer) + OVERHEAD_BYTES) * CLOCKS_PER_BYTE / self.speed_hz)
        return fault.changed(answer) if fault else answer

    def _fault(self, register: int) -> Fault | None:
        if not self._faults or self._faults[0].register not in (None, register):
            return None
        fault = self._faults[0]
        fault.left -= 1
        if not fault.left:
            self._faults.popleft()
        return fault

    def _refuse(self, number: int) -> None:
        raise OSError(number, os.strerror(number))


def _receiving(length: int) -> Transfer:
    return lambda chip: chip.receive(length)


def _sending(data: bytes) -> Transfer:
    return lambda chip: chip.send(data)
