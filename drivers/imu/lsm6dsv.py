"""ST LSM6DSV, LSM6DSV16X and LSM6DSV16B, which have the same identity: an LSM6DSO with other rates, ranges and places.

Linux (st_lsm6dsx_core.c) and ST's own driver (lsm6dsv16x_reg.h) agree. The FIFO has 256 words without compression. I3C
cannot be switched off without I2C. The LSM6DSV32X says the same of itself too, but its counts of acceleration are worth
twice as much: as with an LSM6DSO32, only gravity at rest distinguishes them.
"""

import sys
from collections.abc import Mapping, Sequence

from drivers.imu.fifo_imu import closest
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Range
from drivers.imu.lsm6ds3 import CTRL1_XL, CTRL2_G, CTRL3_C, STEADY_WORDS
from drivers.imu.lsm6dso import FIFO_CTRL3, OVER_RUN_OR_FULL, Lsm6dso

CTRL6 = 0x15  # 3:0 FS_G
CTRL8 = 0x17  # 1:0 FS_XL
FIFO_STATUS1 = 0x1B  # 8:0 DIFF_FIFO, then flags

ODR_HZ = {15.0: 3, 30.0: 4, 60.0: 5, 120.0: 6, 240.0: 7, 480.0: 8, 960.0: 9, 1920.0: 10}  # of sensors and FIFO
GYRO_RANGES = {
    250: Range(1, 1 / 8.75e-3),
    500: Range(2, 1 / 17.5e-3),
    1000: Range(3, 1 / 35e-3),
    2000: Range(4, 1 / 70e-3),
}
ACCEL_RANGES = {
    2: Range(0, 1 / 0.061e-3),
    4: Range(1, 1 / 0.122e-3),
    8: Range(2, 1 / 0.244e-3),
    16: Range(3, 1 / 0.488e-3),
}

IDENTITIES = {0x70: "LSM6DSV"}


class Lsm6dsv(Lsm6dso):
    """LSM6DSV; see ``Lsm6dso``."""

    chip = "LSM6DSV"
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES
    accel_ranges = ACCEL_RANGES
    fifo_bytes = 256 * 7
    twin = ("lsm6dsv32", 0.5)

    def _granted_rate_hz(self, rate_hz: float) -> float:
        return closest(ODR_HZ, rate_hz)

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        odr = ODR_HZ[self.rate_hz]
        return {
            CTRL3_C: STEADY_WORDS,
            CTRL6: gyro_code,
            CTRL8: accel_code,
            CTRL1_XL: odr,
            CTRL2_G: odr,
            FIFO_CTRL3: odr << 4 | odr,
        }

    def _fifo_level(self) -> int:
        status = int.from_bytes(self._read(FIFO_STATUS1, 2), "little")
        return self.fifo_bytes if status & OVER_RUN_OR_FULL else self.word_bytes * (status & 0x1FF)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("lsm6dsv", argv)


if __name__ == "__main__":
    sys.exit(main())
