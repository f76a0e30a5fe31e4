"""LSM6DS3, LSM6DSO (DocID026899 rev. 8, DS12140 rev. 2) and LSM6DSV (lsm6dsv16x_reg.h) as registers."""

import math
import struct
from abc import abstractmethod
from collections import deque
from collections.abc import Mapping
from typing import ClassVar

from hil_mocks.i2c.chip import G_MPS2, SimulatedChip, counts
from hil_mocks.i2c.motion import Vector

SIX = struct.Struct("<hhh")
ODR_HZ = (0.0, 12.5, 26.0, 52.0, 104.0, 208.0, 416.0, 833.0, 1660.0)
FORCE_MG_PER_COUNT = (0.061, 0.488, 0.122, 0.244)  # by FS_XL: 2, 16, 4, 8 g
TURN_MDPS_PER_COUNT = (8.75, 17.5, 35.0, 70.0)  # by FS_G


class Lsm6(SimulatedChip):
    """Common parts. A reset while the FIFO fills is neither acknowledged nor executed."""

    address = 0x6A
    boot_ns = 15_000_000
    lsb_per_c: float
    force_mg_per_count = FORCE_MG_PER_COUNT

    def rate_hz(self) -> float:
        """Sample rate; 0 switched off."""
        return min(ODR_HZ[self.registers[0x10] >> 4], ODR_HZ[self.registers[0x11] >> 4])

    def per_count(self) -> tuple[float, float]:
        """What a count is worth: m°/s, mg."""
        force_mg = self.force_mg_per_count[self.registers[0x10] >> 2 & 3]
        return TURN_MDPS_PER_COUNT[self.registers[0x11] >> 2 & 3], force_mg

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """OUT_TEMP_L to OUTZ_H_XL."""
        turn_mdps, force_mg = self.per_count()
        turn_radps, force_mps2 = math.radians(turn_mdps) / 1e3, G_MPS2 * force_mg / 1e3
        warmth = round((self.celsius - 25) * self.lsb_per_c)
        return {
            0x20: warmth.to_bytes(2, "little", signed=True),
            0x22: SIX.pack(*counts(gyro, turn_radps, 1)),
            0x28: SIX.pack(*counts(accel, force_mps2, 1)),
        }

    def _set(self, register: int, value: int) -> None:
        if register == 0x12 and value & 0x01:
            if self.registers[self.mode_register] & 7:
                raise self.not_acknowledged()
            self._reset()
        elif register == self.mode_register and not value & 7:
            super()._set(register, value)
            self.clear_fifo()  # bypass
        elif register != 0x0F:
            super()._set(register, value)

    @property
    @abstractmethod
    def mode_register(self) -> int:
        """2:0 FIFO_MODE."""


class Lsm6ds3(Lsm6):
    """LSM6DS3: a FIFO of words of 2 bytes, gyro before accelerometer."""

    power_on: ClassVar[Mapping[int, int]] = {0x0F: 0x69, 0x12: 0x04}
    fifo_bytes = 8192
    lsb_per_c = 16.0
    mode_register = 0x0A

    def push(self, packed: Mapping[int, bytes]) -> None:
        """Both sensors, undecimated."""
        if self.registers[0x0A] & 7 != 6 or not self.registers[0x0A] >> 3:
            return
        for bits, register in ((0x08, 0x22), (0x01, 0x28)):
            if self.registers[0x08] & bits:
                self._fifo += packed[register]
        if len(self._fifo) > self.fifo_bytes:
            del self._fifo[: len(self._fifo) - self.fifo_bytes]
            self._overrun = True

    def clear_fifo(self) -> None:
        """Empty it."""
        self._fifo = bytearray()
        self._overrun = False

    def _burst(self, register: int, length: int) -> bytes:
        full = len(self._fifo) + 12 > self.fifo_bytes
        words = 0 if full else len(self._fifo) // 2  # the count runs over too
        flags = self._overrun << 14 | full << 13 | (not self._fifo) << 12
        self.registers[0x3A:0x3C] = (flags | words).to_bytes(2, "little")
        if register != 0x3E:
            return super()._burst(register, length)
        data = bytes(self._fifo[:length])
        del self._fifo[:length]
        return data.ljust(length, b"\x00")


class Lsm6dsTrC(Lsm6ds3):
    """LSM6DS3TR-C."""

    power_on: ClassVar[Mapping[int, int]] = {0x0F: 0x6A, 0x12: 0x04}
    fifo_bytes = 4096
    lsb_per_c = 256.0


class Lsm6dso(Lsm6):
    """LSM6DSO: a FIFO of tagged words of 7 bytes."""

    power_on: ClassVar[Mapping[int, int]] = {0x0F: 0x6C, 0x12: 0x04, 0x18: 0xE0}
    lsb_per_c = 256.0
    mode_register = 0x0A
    status_register = 0x3A
    fifo_words = 512
    _moment = 0

    @property
    def listens_to_i3c(self) -> bool:
        """CTRL9_XL: until I3C_disable is set."""
        return not self.registers[0x18] & 0x02

    def push(self, packed: Mapping[int, bytes]) -> None:
        """Both sensors at the rates of FIFO_CTRL3."""
        if self.registers[0x0A] & 7 != 6:
            return
        self._moment = (self._moment + 1) % 4
        for sensor, rate, register in ((1, self.registers[0x09] >> 4, 0x22), (2, self.registers[0x09] & 15, 0x28)):
            if rate:
                tag = sensor << 3 | self._moment << 1
                tag |= tag.bit_count() & 1  # even parity
                self._overrun |= len(self._fifo) == self._fifo.maxlen
                self._fifo.append(bytes([tag]) + packed[register])

    def clear_fifo(self) -> None:
        """Empty it."""
        self._fifo: deque[bytes] = deque(maxlen=self.fifo_words)
        self._overrun = False

    def _burst(self, register: int, length: int) -> bytes:
        full = len(self._fifo) == self._fifo.maxlen
        flags = self._overrun << 14 | full << 13 | self._overrun << 11
        at = self.status_register
        self.registers[at : at + 2] = (flags | len(self._fifo)).to_bytes(2, "little")
        if register != 0x78:
            return super()._burst(register, length)
        words = [self._fifo.popleft() for _ in range(min(-(-length // 7), len(self._fifo)))]
        return b"".join(words).ljust(length, b"\x00")[:length]


class Ism330dhcx(Lsm6dso):
    """ISM330DHCX: an LSM6DSO with another identity. I3C_disable is called DEVICE_CONF there."""

    power_on: ClassVar[Mapping[int, int]] = {0x0F: 0x6B, 0x12: 0x04, 0x18: 0xE0}


class Lsm6dso32(Lsm6dso):
    """LSM6DSO32: an LSM6DSO whose codes mean 4, 32, 8, 16 g, with the same identity."""

    force_mg_per_count = (0.122, 0.976, 0.244, 0.488)


class Lsm6dsv(Lsm6dso):
    """LSM6DSV: the rates are the low bits of their registers, the ranges have registers of their own."""

    power_on: ClassVar[Mapping[int, int]] = {0x0F: 0x70, 0x12: 0x44}
    status_register = 0x1B
    fifo_words = 256
    min_force_mg = 0.061  # by FS_XL: this, twice, four, eight times as much

    def rate_hz(self) -> float:
        """Sample rate; 0 switched off. Each code but the first two is twice the one before."""
        code = min(self.registers[0x10] & 15, self.registers[0x11] & 15)
        return 7.5 * 2 ** (code - 2) if code > 1 else 1.875 * code

    def per_count(self) -> tuple[float, float]:
        """What a count is worth: m°/s, mg."""
        return 4.375 * 2 ** (self.registers[0x15] & 15), self.min_force_mg * 2 ** (self.registers[0x17] & 3)


class Lsm6dsv32(Lsm6dsv):
    """LSM6DSV32X: an LSM6DSV of twice the acceleration, with the same identity."""

    min_force_mg = 0.122
