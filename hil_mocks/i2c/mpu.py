"""MPU-6050, MPU-6500 and MPU-9250 as registers (RM-MPU-6000A-00 rev. 4.2, RM-MPU-6500A-00 rev. 2.1)."""

import math
import struct
from collections.abc import Mapping
from typing import ClassVar

from hil_mocks.i2c.chip import G_MPS2, SimulatedChip, counts
from hil_mocks.i2c.motion import Vector

SIX = struct.Struct(">hhh")


class Mpu6050(SimulatedChip):
    """MPU-6050. When its FIFO overflows, the oldest bytes are lost, not the oldest samples."""

    address = 0x68
    power_on: ClassVar[Mapping[int, int]] = {0x6B: 0x40, 0x75: 0x68}
    boot_ns = 100_000_000
    fifo_bytes = 1024
    lsb_per_c, zero_c = 340.0, 36.53

    def rate_hz(self) -> float:
        """Sample rate; 0 asleep."""
        if self.registers[0x6B] & 0x40:
            return 0.0
        filtered = self.registers[0x1A] & 7 not in (0, 7)
        return (1000 if filtered else 8000) / (1 + self.registers[0x19])

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """ACCEL_XOUT_H to GYRO_ZOUT_L."""
        turn_radps = math.radians(250 << (self.registers[0x1B] >> 3 & 3))
        force_mps2 = G_MPS2 * (2 << (self.registers[0x1C] >> 3 & 3))
        warmth = round((self.celsius - self.zero_c) * self.lsb_per_c)
        return {
            0x3B: SIX.pack(*counts(accel, force_mps2)),
            0x41: warmth.to_bytes(2, "big", signed=True),
            0x43: SIX.pack(*counts(gyro, turn_radps, 250 * 131)),
        }

    def push(self, packed: Mapping[int, bytes]) -> None:
        """What FIFO_EN asks for, in the order of the registers."""
        if not self.registers[0x6A] & 0x40:
            return
        requested = self.registers[0x23]
        for bits, register in ((0x08, 0x3B), (0x80, 0x41), (0x70, 0x43)):
            if requested & bits == bits:
                self._fifo += packed[register]
        del self._fifo[: max(len(self._fifo) - self.fifo_bytes, 0)]

    def clear_fifo(self) -> None:
        """Empty it."""
        self._fifo = bytearray()

    def _burst(self, register: int, length: int) -> bytes:
        self.registers[0x72:0x74] = len(self._fifo).to_bytes(2, "big")
        if register != 0x74:
            return super()._burst(register, length)
        data = bytes(self._fifo[:length])
        del self._fifo[:length]
        return data.ljust(length, b"\xff")

    def _set(self, register: int, value: int) -> None:
        if register == 0x6B and value & 0x80:
            self._reset()
        elif register == 0x6A:
            if value & 0x04:
                self.clear_fifo()
            super()._set(register, value & ~0x07)  # the reset bits clear themselves
        elif register != 0x75:
            super()._set(register, value)


class Mpu6500(Mpu6050):
    """MPU-6500."""

    power_on: ClassVar[Mapping[int, int]] = {0x6B: 0x01, 0x75: 0x70}
    fifo_bytes = 512
    lsb_per_c, zero_c = 333.87, 21.0


class Mpu9250(Mpu6500):
    """MPU-9250."""

    power_on: ClassVar[Mapping[int, int]] = {0x6B: 0x01, 0x75: 0x71}


class Icm20602(Mpu6500):
    """ICM-20602: what FIFO_EN asks for comes with the temperature, in frames of 14 bytes.

    What is added to the accelerations, 0.98 mg a unit and 15 bits, is right as it comes from the maker.
    """

    power_on: ClassVar[Mapping[int, int]] = {0x1A: 0x80, 0x6B: 0x41, 0x75: 0x12, 0x78: 0x46, 0x7A: 0x0B, 0x7D: 0x11}
    fifo_bytes = 1008
    lsb_per_c, zero_c = 326.8, 25.0

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """With the offsets."""
        x, y, z = (value + self._added_mps2(at) for value, at in zip(accel, (0x77, 0x7A, 0x7D), strict=True))
        return super().pack(gyro, (x, y, z))

    def _added_mps2(self, register: int) -> float:
        now = int.from_bytes(self.registers[register : register + 2], "big", signed=True)
        made = int.from_bytes(bytes(self.power_on.get(register + low, 0) for low in (0, 1)), "big", signed=True)
        return (now - made) / 2 * 0.98e-3 * G_MPS2

    def push(self, packed: Mapping[int, bytes]) -> None:
        """4 GYRO_FIFO_EN, 3 ACCEL_FIFO_EN; nothing else is known to it."""
        if not self.registers[0x6A] & 0x40:
            return
        requested = self.registers[0x23]
        for bits, register in ((0x08, 0x3B), (0x18, 0x41), (0x10, 0x43)):
            if requested & bits:
                self._fifo += packed[register]
        del self._fifo[: max(len(self._fifo) - self.fifo_bytes, 0)]


class Icm20689(Mpu6500):
    """ICM-20689, as boards have it that are sold with an MPU-6050. ACCEL_CONFIG_2 has the size of its FIFO."""

    power_on: ClassVar[Mapping[int, int]] = {0x1D: 0x80, 0x6B: 0x40, 0x75: 0x98}
    lsb_per_c, zero_c = 326.8, 25.0

    def push(self, packed: Mapping[int, bytes]) -> None:
        """7:6 FIFO_SIZE: 512, 1024, 2048 or 4096 bytes."""
        self.fifo_bytes = 512 << (self.registers[0x1D] >> 6)
        super().push(packed)
