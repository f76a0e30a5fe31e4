"""ST LSM6DSV32X: an LSM6DSV of twice the acceleration, with the same identity.

The codes and weights of its ranges are those of ST's own driver (lsm6dsv32x_reg.h); Zephyr (dt-bindings/sensor/
lsm6dsv32x.h) has the same ranges, and the gyro's codes.
"""

import sys
from collections.abc import Sequence

from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Range
from drivers.imu.lsm6dsv import Lsm6dsv

IDENTITIES = {0x70: "LSM6DSV32X"}
ACCEL_RANGES = {
    4: Range(0, 1 / 0.122e-3),
    8: Range(1, 1 / 0.244e-3),
    16: Range(2, 1 / 0.488e-3),
    32: Range(3, 1 / 0.976e-3),
}


class Lsm6dsv32(Lsm6dsv):
    """LSM6DSV32X; see ``Lsm6dsv``."""

    chip = "LSM6DSV32X"
    identities = IDENTITIES
    accel_ranges = ACCEL_RANGES
    twin = ("lsm6dsv", 2.0)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("lsm6dsv32", argv)


if __name__ == "__main__":
    sys.exit(main())
