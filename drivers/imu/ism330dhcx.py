"""ST ISM330DHCX and LSM6DSR (and LSM6DSRX), which have the same identity: an LSM6DSO of the same ranges.

ISM330DHCX data sheet DS13012 revision 7, LSM6DSR data sheet DS12569; Linux (st_lsm6dsx_core.c) has all of them in one
table with the LSM6DSO, and PX4's registers of the LSM6DSR (ST_LSM6DSR_Registers.hpp) agree. What is I3C_disable in an
LSM6DSR is DEVICE_CONF in an ISM330DHCX, which is to be 1 too.
"""

import sys
from collections.abc import Sequence

from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.lsm6dso import Lsm6dso

IDENTITIES = {0x6B: "ISM330DHCX or LSM6DSR"}


class Ism330dhcx(Lsm6dso):
    """ISM330DHCX or LSM6DSR; see ``Lsm6dso``."""

    chip = "ISM330DHCX"
    identities = IDENTITIES
    twin = None


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("ism330dhcx", argv)


if __name__ == "__main__":
    sys.exit(main())
