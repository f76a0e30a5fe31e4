"""BNO055 as registers (BST-BNO055-DS000-14 rev. 1.4), its first page."""

import math
import struct
from collections.abc import Mapping

from hil_mocks.i2c.chip import SimulatedChip, counts
from hil_mocks.i2c.motion import Vector

SIX = struct.Struct("<hhh")
POWER_ON = {0x00: 0xA0, 0x01: 0xFB, 0x02: 0x32, 0x03: 0x0F, 0x3B: 0x80, 0x3D: 0x10}


class Bno055(SimulatedChip):
    """BNO055; samples in its fusion mode IMU only. It has no FIFO."""

    address = 0x28
    power_on = POWER_ON

    def rate_hz(self) -> float:
        """100 Hz in the mode IMU."""
        return 100.0 if self.registers[0x3D] & 15 == 8 else 0.0

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """ACC_DATA, GYR_DATA, TEMP; m/s² and °/s, as UNIT_SEL = 0 asks."""
        return {
            0x08: SIX.pack(*counts(accel, 1.0, 100, most=3922)),
            0x14: SIX.pack(*counts(gyro, math.radians(1), 16, most=32000)),
            0x34: round(self.celsius).to_bytes(1, "little", signed=True),
        }

    def push(self, packed: Mapping[int, bytes]) -> None:
        """There is no FIFO."""

    def clear_fifo(self) -> None:
        """There is no FIFO."""

    def _set(self, register: int, value: int) -> None:
        if register == 0x3F and value & 0x20:
            self.power_up()
        elif register > 0x03:
            super()._set(register, value)
            if register == 0x3D:
                self.registers[0x39] = 5 if value & 15 == 8 else 0
