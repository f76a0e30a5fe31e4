"""TDK InvenSense MPU-6500: an MPU-6050 with another thermometer, half the FIFO and a filter of the accelerometer's own.

MPU-6500 Register Map and Descriptions, RM-MPU-6500A-00 revision 2.1; Product Specification, PS-MPU-6500A-01
revision 1.3.
"""

import sys
from collections.abc import Mapping, Sequence

from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Thermometer
from drivers.imu.mpu6050 import TEMP_OUT, Mpu6050

ACCEL_CONFIG_2 = 0x1D  # 2:0 A_DLPF_CFG, the same codes as DLPF_CFG

IDENTITIES = {0x70: "MPU-6500"}


class Mpu6500(Mpu6050):
    """MPU-6500; see ``I2cImu``."""

    chip = "MPU-6500"
    identities = IDENTITIES
    thermometer = Thermometer(TEMP_OUT, "big", lsb_per_c=333.87, zero_c=21.0)
    fifo_bytes = 512

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        return {**super()._registers(gyro_code, accel_code), ACCEL_CONFIG_2: self._filter()}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("mpu6500", argv)


if __name__ == "__main__":
    sys.exit(main())
