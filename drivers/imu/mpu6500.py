"""TDK InvenSense MPU-6500: an MPU-6050 with another thermometer, half the FIFO and a filter of the accelerometer's own.

MPU-6500 Register Map and Descriptions, RM-MPU-6500A-00 revision 2.1; Product Specification, PS-MPU-6500A-01 revision
1.3; PX4 (InvenSense_MPU6500_registers.hpp) agrees. The MPU-6515 and MPU-6880 differ in what they say of themselves
alone, as Linux has it (inv_mpu_iio.h); 0x72 is said by copies. 0x98 is the ICM-20689, found on many boards that are
sold with an MPU-6050: its thermometer is another (ICM-20689 data sheet, DS-000143, and Linux), and no more than 512
bytes of its FIFO are used. The ICM-20608-G (DS-000081), ICM-20609 (DS-000103) and IAM-20680 are like it, as Linux has
it and PX4's ICM20608G driver.
"""

import sys
from collections.abc import Mapping, Sequence

from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Thermometer
from drivers.imu.mpu6050 import TEMP_OUT, Mpu6050

ACCEL_CONFIG_2 = 0x1D  # 2:0 A_DLPF_CFG, the same codes as DLPF_CFG

IDENTITIES = {
    0x70: "MPU-6500",
    0x72: "MPU-6500 (a copy)",
    0x74: "MPU-6515",
    0x78: "MPU-6880",
    0x98: "ICM-20689",
    0xA6: "ICM-20609",
    0xA9: "IAM-20680",
    0xAE: "ICM-20608-D",
    0xAF: "ICM-20608-G",
}
ICM_THERMOMETER = Thermometer(TEMP_OUT, "big", lsb_per_c=326.8, zero_c=25.0)


class Mpu6500(Mpu6050):
    """MPU-6500; see ``I2cImu``."""

    chip = "MPU-6500"
    identities = IDENTITIES
    thermometer = Thermometer(TEMP_OUT, "big", lsb_per_c=333.87, zero_c=21.0)
    fifo_bytes = 512

    def _reset(self) -> None:
        if self.model.startswith(("ICM", "IAM")):
            self.thermometer = ICM_THERMOMETER
        super()._reset()

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        return {**super()._registers(gyro_code, accel_code), ACCEL_CONFIG_2: self._filter()}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("mpu6500", argv)


if __name__ == "__main__":
    sys.exit(main())
