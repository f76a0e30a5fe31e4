"""ST LSM6DSO32 and LSM6DSO32X: an LSM6DSO of twice the acceleration, with the same identity.

LSM6DSO32 data sheet DS13159; the codes and weights of its ranges as in ST's and in Adafruit's driver.
"""

import sys
from collections.abc import Sequence

from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Range
from drivers.imu.lsm6dso import Lsm6dso

IDENTITIES = {0x6C: "LSM6DSO32"}
ACCEL_RANGES = {
    4: Range(0, 1 / 0.122e-3),
    8: Range(2, 1 / 0.244e-3),
    16: Range(3, 1 / 0.488e-3),
    32: Range(1, 1 / 0.976e-3),
}


class Lsm6dso32(Lsm6dso):
    """LSM6DSO32; see ``Lsm6dso``."""

    chip = "LSM6DSO32"
    identities = IDENTITIES
    accel_ranges = ACCEL_RANGES
    twin = ("lsm6dso", 2.0)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("lsm6dso32", argv)


if __name__ == "__main__":
    sys.exit(main())
