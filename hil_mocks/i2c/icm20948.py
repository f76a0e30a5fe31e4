"""ICM-20948 as registers (DS-000189 rev. 1.3); a register's bank is its high byte, as REG_BANK_SEL holds it."""

import math
import struct
from collections.abc import Mapping

from hil_mocks.i2c.chip import G_MPS2, SimulatedChip, counts
from hil_mocks.i2c.motion import Vector

SIX = struct.Struct(">hhh")
FIFO_BYTES = 512
POWER_ON = {0x00: 0xEA, 0x05: 0x40, 0x06: 0x41, 0x2001: 0x01, 0x2014: 0x01}


class Icm20948(SimulatedChip):
    """ICM-20948."""

    address = 0x68
    power_on = POWER_ON
    boot_ns = 100_000_000

    def rate_hz(self) -> float:
        """Sample rate; 0 asleep."""
        asleep = self.registers[0x06] & 0x40
        return 0.0 if asleep else 1125 / (1 + self.registers[0x2000])

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """ACCEL_XOUT_H to TEMP_OUT_L."""
        turn_radps = math.radians(250 << (self.registers[0x2001] >> 1 & 3))
        force_mps2 = G_MPS2 * (2 << (self.registers[0x2014] >> 1 & 3))
        warmth = round((self.celsius - 21) * 333.87)
        return {
            0x2D: SIX.pack(*counts(accel, force_mps2)),
            0x33: SIX.pack(*counts(gyro, turn_radps, 250 * 131)),
            0x39: warmth.to_bytes(2, "big", signed=True),
        }

    def push(self, packed: Mapping[int, bytes]) -> None:
        """What FIFO_EN_2 asks for, in the order of the registers."""
        if not self.registers[0x03] & 0x40 or self.registers[0x68]:
            return
        requested = self.registers[0x67]
        for bits, register in ((0x10, 0x2D), (0x0E, 0x33), (0x01, 0x39)):
            if requested & bits == bits:
                self._fifo += packed[register]
        del self._fifo[: max(len(self._fifo) - FIFO_BYTES, 0)]

    def clear_fifo(self) -> None:
        """Empty it."""
        self._fifo = bytearray()

    def _burst(self, register: int, length: int) -> bytes:
        self.registers[0x70:0x72] = len(self._fifo).to_bytes(2, "big")
        banked = self._banked(register)
        if banked != 0x72:
            return super()._burst(banked, length)
        data = bytes(self._fifo[:length])
        del self._fifo[:length]
        return data.ljust(length, b"\xff")

    def _set(self, register: int, value: int) -> None:
        banked = self._banked(register)
        if banked == 0x06 and value & 0x80:
            self._reset()
        elif banked == 0x68 and value & 0x1F:
            self.clear_fifo()
            super()._set(banked, value)
        elif banked:
            super()._set(banked, value)

    def _banked(self, register: int) -> int:
        """REG_BANK_SEL is the same register in every bank."""
        return register if register == 0x7F else (self.registers[0x7F] & 0x30) << 8 | register
