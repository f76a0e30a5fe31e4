"""QMI8658 as registers (QMI8658A data sheet rev. A)."""

import math
import struct
from collections.abc import Mapping

from hil_mocks.i2c.chip import G_MPS2, SimulatedChip, counts
from hil_mocks.i2c.motion import Vector

POWER_ON = {0x00: 0x05, 0x01: 0x7C, 0x02: 0x20}
COMMAND_NS = 1_500_000


class Qmi8658(SimulatedChip):
    """QMI8658. A command takes time, and its end must be acknowledged.

    At power-on it is big-endian, and addresses do not auto-increment in a burst. Reading STATUSINT when there is a
    sample locks the data until its last byte has been read; without that, here, a burst is torn by a new sample.
    """

    address = 0x6B
    power_on = POWER_ON
    boot_ns = 15_000_000
    _done_at_ns: int | None = None  # of the command that runs
    _number = 0

    def power_up(self) -> None:
        """Also clears the sample counter and the command."""
        self._number, self._done_at_ns = 0, None
        self._gated, self._available, self._locked = True, False, False
        super().power_up()

    def brown_out(self) -> None:
        """Also reports that the reset is done."""
        super().brown_out()
        self.registers[0x4D] = 0x80

    def rate_hz(self) -> float:
        """Sample rate; 0 switched off."""
        odr = self.registers[0x04] & 15
        on = self.registers[0x08] & 3 == 3 and odr == self.registers[0x03] & 15
        return 7174.4 / 2**odr if on and odr <= 8 else 0.0

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """TIMESTAMP_L to GZ_H."""
        turn_radps = math.radians(16 << (self.registers[0x04] >> 4 & 7))
        force_mps2 = G_MPS2 * (2 << (self.registers[0x03] >> 4 & 3))
        self._number = (self._number + 1) % 2**24
        if self._locked:
            return {}
        self._available = True
        six = struct.Struct(f"{'>' if self.registers[0x02] & 0x20 else '<'}hhh")
        return {
            0x30: self._number.to_bytes(3, "little"),
            0x33: round(self.celsius * 256).to_bytes(2, "little", signed=True),
            0x35: six.pack(*counts(accel, force_mps2)),
            0x3B: six.pack(*counts(gyro, turn_radps)),
        }

    def push(self, packed: Mapping[int, bytes]) -> None:
        """Its FIFO is not simulated."""

    def clear_fifo(self) -> None:
        """Its FIFO is not simulated."""

    def _burst(self, register: int, length: int) -> bytes:
        done = self._done_at_ns is not None and self._clock.monotonic_ns() >= self._done_at_ns
        self.registers[0x2D] = self._available | self._locked << 1 | done << 7
        if not self.registers[0x02] & 0x40:
            return super()._burst(register, 1) * length
        data = super()._burst(register, length)
        in_step = self.registers[0x08] & 0x80 and not self._gated
        if register <= 0x2D < register + length and self._available:
            self._locked = bool(in_step)
        if register <= 0x40 < register + length:
            if self._available and not self._locked:  # torn: the last bytes are of another sample
                data = data[: 0x40 - register] + bytes([data[0x40 - register] ^ 0x40]) + data[0x41 - register :]
            self._available = self._locked = False
        return data

    def _set(self, register: int, value: int) -> None:
        if register == 0x60:
            if value == 0xB0:
                self._reset()
        elif register == 0x0A:
            self._done_at_ns = self._clock.monotonic_ns() + COMMAND_NS if value else None
            if value == 0x12 and not self.registers[0x08] & 3:
                self._gated = self.registers[0x0B] != 1
        elif register not in (0x00, 0x01):
            super()._set(register, value)
