"""What all simulated chips share: registers, a clock of their own, samples at the rate that is set, a FIFO."""

import errno
import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

from drivers.clock import Clock
from hil_mocks.i2c.motion import Motion, Vector

G_MPS2 = 9.80665
MAX_BACKLOG = 4096  # samples; more than any FIFO holds

Counts = tuple[int, int, int]


class SimulatedChip(ABC):
    """A chip's registers. ``rate_error``: share by which its clock is too fast. ``celsius``: die temperature.

    Its time advances when it is accessed. ``power_up`` sets the state after a reset, ``brown_out`` resets it and takes
    the time to boot. ``resets``: number of resets. ``acknowledges_reset``: whether it acknowledges the command for one.
    """

    address: ClassVar[int]
    power_on: ClassVar[Mapping[int, int]]  # registers that are not 0
    boot_ns: ClassVar[int] = 0  # after a reset; it acknowledges nothing meanwhile
    acknowledges_reset = True
    resets = 0
    _boots_until_ns = 0

    def __init__(self, motion: Motion, clock: Clock, rate_error: float = 0.0, celsius: float = 31.5) -> None:
        self.rate_error = rate_error
        self.celsius = celsius
        self.made_ns: list[int] = []  # when each sample was made, for those who want to know
        self._motion = motion
        self._clock = clock
        self._begin_ns = clock.monotonic_ns()
        self.power_up()

    @property
    def places(self) -> "Mapping[int, SimulatedChip]":
        """Its devices on a bus, by address; some chips are two."""
        return {self.address: self}

    def power_up(self) -> None:
        """All registers at their power-on values."""
        self.registers = bytearray(0x10000)  # of all pages
        for register, value in self.power_on.items():
            self.registers[register] = value
        self._next_ns: float | None = None  # when the next sample is made
        self._period_ns = 0.0
        self.clear_fifo()

    def brown_out(self) -> None:
        """Reset by itself, and boot."""
        self.resets += 1
        self.power_up()
        self._boots_until_ns = self._clock.monotonic_ns() + self.boot_ns

    def read(self, register: int, length: int) -> bytes:
        """A burst of bytes from a register on."""
        self._refuse_while_booting()
        self._catch_up()
        return self._burst(register, length)

    def receive(self, length: int) -> bytes:
        """Bytes without a register; only chips that have none know more than zeros."""
        return bytes(length)

    def send(self, data: bytes) -> bytes:  # noqa: ARG002
        """Bytes without a register. Return nothing."""
        return b""

    def write(self, register: int, data: bytes) -> bytes:
        """Write a burst of bytes from a register on."""
        self._refuse_while_booting()
        self._catch_up()
        for at, value in enumerate(data):
            self._set(register + at, value)
        self._catch_up()  # what was set takes effect now
        return b""

    # What a chip does its own way.

    @abstractmethod
    def rate_hz(self) -> float:
        """Sample rate by the registers; 0: not sampling."""

    @abstractmethod
    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """The data registers for a sample, at the ranges that are set: from register → bytes."""

    @abstractmethod
    def push(self, packed: Mapping[int, bytes]) -> None:
        """Put a packed sample into the FIFO."""

    @abstractmethod
    def clear_fifo(self) -> None:
        """Empty it."""

    def not_acknowledged(self) -> OSError:
        """Return the error of a transfer that the chip does not acknowledge."""
        return OSError(errno.EREMOTEIO, os.strerror(errno.EREMOTEIO))

    def _reset(self) -> None:
        """Reset on command."""
        self.brown_out()
        if not self.acknowledges_reset:
            raise self.not_acknowledged()

    def _refuse_while_booting(self) -> None:
        if self._clock.monotonic_ns() < self._boots_until_ns:
            raise self.not_acknowledged()

    def _burst(self, register: int, length: int) -> bytes:
        return bytes(self.registers[register : register + length])

    def _set(self, register: int, value: int) -> None:
        self.registers[register] = value

    def _catch_up(self) -> None:
        """Make the samples that were due since the last access."""
        rate_hz = self.rate_hz() * (1 + self.rate_error)
        now_ns = self._clock.monotonic_ns()
        if not rate_hz:
            self._next_ns = None
            return
        period_ns = 1e9 / rate_hz
        if self._next_ns is None or period_ns != self._period_ns:
            self._next_ns, self._period_ns = now_ns + period_ns, period_ns
        self._next_ns = max(self._next_ns, now_ns - MAX_BACKLOG * period_ns)
        while self._next_ns <= now_ns:
            self.made_ns.append(round(self._next_ns))
            packed = self.pack(*self._motion((self._next_ns - self._begin_ns) / 1e9))
            for register, data in packed.items():
                self.registers[register : register + len(data)] = data
            self.push(packed)
            self._next_ns += period_ns


def counts(vector: Vector, full_scale: float, full_counts: float = 32768, most: int = 32767) -> Counts:
    """Convert a vector to counts, ``full_counts`` at ``full_scale`` (same unit): rounded, clipped at ``most``."""
    x, y, z = (min(max(round(value / full_scale * full_counts), -most - 1), most) for value in vector)
    return x, y, z
