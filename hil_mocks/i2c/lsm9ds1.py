"""LSM9DS1 as registers (DocID025715 rev. 3), without its magnetometer."""

import math
import struct
from collections import deque
from collections.abc import Mapping

from hil_mocks.i2c.chip import G_MPS2, SimulatedChip, counts
from hil_mocks.i2c.motion import Vector

SIX = struct.Struct("<hhh")
POWER_ON = {0x0F: 0x68, 0x1E: 0x38, 0x1F: 0x38, 0x22: 0x04}
ODR_HZ = (0.0, 14.9, 59.5, 119.0, 238.0, 476.0, 952.0, 0.0)
FORCE_MG_PER_COUNT = (0.061, 0.732, 0.122, 0.244)  # by FS_XL: 2, 16, 4, 8 g
TURN_MDPS_PER_COUNT = (8.75, 17.5, 0.0, 70.0)  # by FS_G; the third is not there
FORCE_G = (2, 16, 4, 8)


class Lsm9ds1(SimulatedChip):
    """LSM9DS1: its x axis is opposite to that of the motion's right-handed axes.

    A sample leaves the FIFO when its accelerometer has been read, after its gyro.
    """

    address = 0x6A
    power_on = POWER_ON
    boot_ns = 15_000_000

    def rate_hz(self) -> float:
        """Sample rate, the gyro's; 0 switched off."""
        return ODR_HZ[self.registers[0x10] >> 5] if self.registers[0x20] >> 5 else 0.0

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """OUT_TEMP_L to OUT_Z_H_XL."""
        turn_radps = math.radians(TURN_MDPS_PER_COUNT[self.registers[0x10] >> 3 & 3]) / 1e3
        code = self.registers[0x20] >> 3 & 3
        force_mps2 = G_MPS2 * FORCE_MG_PER_COUNT[code] / 1e3
        most = min(32767, int(FORCE_G[code] * 1e3 / FORCE_MG_PER_COUNT[code]))
        return {
            0x15: round((self.celsius - 25) * 16).to_bytes(2, "little", signed=True),
            0x18: SIX.pack(*counts(_mirrored(gyro), turn_radps, 1)),
            0x28: SIX.pack(*counts(_mirrored(accel), force_mps2, 1, most=most)),
        }

    def push(self, packed: Mapping[int, bytes]) -> None:
        """Both sensors, while the FIFO is on and continuous; the oldest makes room."""
        if self.registers[0x23] & 0x02 and self.registers[0x2E] & 0xE0 == 0xC0:
            self._overrun |= len(self._fifo) == self._fifo.maxlen
            self._fifo.append((packed[0x18], packed[0x28]))

    def clear_fifo(self) -> None:
        """Empty it."""
        self._fifo: deque[tuple[bytes, bytes]] = deque(maxlen=32)
        self._overrun = False

    def _burst(self, register: int, length: int) -> bytes:
        self.registers[0x2F] = self._overrun << 6 | len(self._fifo)
        if self._fifo and (register, length) == (0x18, 6):
            return self._fifo[0][0]
        if self._fifo and (register, length) == (0x28, 6):
            return self._fifo.popleft()[1]
        return super()._burst(register, length)

    def _set(self, register: int, value: int) -> None:
        if register == 0x22 and value & 0x01:
            self._reset()
        elif register == 0x2E and not value & 0xE0:
            super()._set(register, value)
            self.clear_fifo()  # bypass
        elif register != 0x0F:
            super()._set(register, value)


def _mirrored(vector: Vector) -> Vector:
    return -vector[0], vector[1], vector[2]
