"""BNO055 as registers (BST-BNO055-DS000-14 rev. 1.4), its first page."""

import math
import struct
from collections.abc import Mapping

from hil_mocks.i2c.chip import SimulatedChip, counts
from hil_mocks.i2c.motion import Vector

SIX = struct.Struct("<hhh")
POWER_ON = {0x00: 0xA0, 0x01: 0xFB, 0x02: 0x32, 0x03: 0x0F, 0x3B: 0x80, 0x3D: 0x10, 0x41: 0x24}
TO_CONFIG_S = 0.019
ALWAYS_WRITABLE = (0x07, 0x3D, 0x3F)  # PAGE_ID, OPR_MODE, SYS_TRIGGER; all else in the mode CONFIG only


class Bno055(SimulatedChip):
    """BNO055; samples in its fusion mode IMU only. It has no FIFO."""

    address = 0x28
    power_on = POWER_ON
    boot_ns = 650_000_000
    acknowledges_reset = False
    _switches_until_ns = 0

    def rate_hz(self) -> float:
        """100 Hz in the mode IMU."""
        return 100.0 if self.registers[0x3D] & 15 == 8 else 0.0

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """ACC_DATA, GYR_DATA, TEMP; m/s² and °/s, as UNIT_SEL = 0 asks."""
        return {
            0x08: SIX.pack(*counts(self._mapped(accel), 1.0, 100, most=3922)),
            0x14: SIX.pack(*counts(self._mapped(gyro), math.radians(1), 16, most=32000)),
            0x34: round(self.celsius).to_bytes(1, "little", signed=True),
        }

    def push(self, packed: Mapping[int, bytes]) -> None:
        """There is no FIFO."""

    def clear_fifo(self) -> None:
        """There is no FIFO."""

    def _set(self, register: int, value: int) -> None:
        if register == 0x3F and value & 0x20:
            self._reset()
        configurable = self.registers[0x3D] & 15 == 0 and self._clock.monotonic_ns() >= self._switches_until_ns
        if register > 0x03 and (register in ALWAYS_WRITABLE or configurable):
            if register == 0x3D and value & 15 == 0 and self.registers[0x3D] & 15:
                self._switches_until_ns = self._clock.monotonic_ns() + round(TO_CONFIG_S * 1e9)
            super()._set(register, value)
            if register == 0x3D:
                self.registers[0x39] = 5 if value & 15 == 8 else 0

    def _mapped(self, vector: Vector) -> Vector:
        """AXIS_MAP_CONFIG, without AXIS_MAP_SIGN."""
        axes = self.registers[0x41]
        return vector[axes & 3], vector[axes >> 2 & 3], vector[axes >> 4 & 3]
