"""TDK InvenSense MPU-9250 and MPU-9255: an MPU-6500 with a magnetometer beside it, which is left alone.

MPU-9250 Register Map and Descriptions, RM-MPU-9250A-00 revision 1.6; Product Specification, PS-MPU-9250A-01 revision
1.1. PX4 (InvenSense_MPU9250_registers.hpp) agrees; that 0x73 is an MPU-9255 is Linux's (inv_mpu_iio.h).
"""

import sys
from collections.abc import Sequence

from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.mpu6500 import Mpu6500

IDENTITIES = {0x71: "MPU-9250", 0x73: "MPU-9255"}


class Mpu9250(Mpu6500):
    """MPU-9250; see ``I2cImu``."""

    chip = "MPU-9250"
    identities = IDENTITIES


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("mpu9250", argv)


if __name__ == "__main__":
    sys.exit(main())
