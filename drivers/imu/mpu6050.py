"""TDK InvenSense MPU-6050 (and MPU-6000, the IMU of the MPU-9150).

MPU-6000/MPU-6050 Register Map and Descriptions, RM-MPU-6000A-00 revision 4.2; Product Specification, PS-MPU-6000A-00
revision 3.4. PX4 (InvenSense_MPU6000_registers.hpp) agrees, Linux (inv_mpu_core.c) on rates and filters.
"""

import struct
import sys
from collections.abc import Mapping, Sequence
from typing import ClassVar

from drivers.imu.fifo_imu import FifoImu
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Range, Thermometer

SMPLRT_DIV = 0x19
CONFIG = 0x1A  # 2:0 DLPF_CFG
GYRO_CONFIG = 0x1B  # 4:3 FS_SEL
ACCEL_CONFIG = 0x1C  # 4:3 AFS_SEL
FIFO_EN = 0x23
TEMP_OUT = 0x41
USER_CTRL = 0x6A
PWR_MGMT_1 = 0x6B
PWR_MGMT_2 = 0x6C
FIFO_COUNT = 0x72
FIFO_R_W = 0x74
WHO_AM_I = 0x75

GYRO_AND_ACCEL = 0x78  # FIFO_EN: three axes of the gyro, accelerometer
USE_FIFO = 0x40  # USER_CTRL
RESET_FIFO = 0x04
DEVICE_RESET = 0x80  # PWR_MGMT_1
GYRO_CLOCK = 0x01  # steadier than the internal oscillator; also wakes the chip

INTERNAL_HZ = 1000  # with the low-pass filter on
FILTERS_HZ = {1: 184, 2: 92, 3: 41, 4: 20, 5: 10, 6: 5}  # DLPF_CFG: the narrower of gyro and accelerometer
RESET_S = 0.1

IDENTITIES = {0x68: "MPU-6050"}
GYRO_RANGES = {250: Range(0, 131.0), 500: Range(1, 65.5), 1000: Range(2, 32.8), 2000: Range(3, 16.4)}
ACCEL_RANGES = {2: Range(0, 16384), 4: Range(1, 8192), 8: Range(2, 4096), 16: Range(3, 2048)}


class Mpu6050(FifoImu):
    """MPU-6050; see ``I2cImu``."""

    chip = "MPU-6050"
    addresses = (0x68, 0x69)
    identity_register = WHO_AM_I
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(TEMP_OUT, "big", lsb_per_c=340, zero_c=36.53)
    fifo_register = FIFO_R_W
    fifo_bytes = 1024
    fifo_content: ClassVar[int] = GYRO_AND_ACCEL
    frame = struct.Struct(">6h")
    gyro_first = False

    def _granted_rate_hz(self, rate_hz: float) -> float:
        self._divider = min(max(round(INTERNAL_HZ / rate_hz), 1), 256)
        return INTERNAL_HZ / self._divider

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        return {
            PWR_MGMT_1: GYRO_CLOCK,
            PWR_MGMT_2: 0,
            SMPLRT_DIV: self._divider - 1,
            CONFIG: self._filter(),
            GYRO_CONFIG: gyro_code << 3,
            ACCEL_CONFIG: accel_code << 3,
        }

    def _filter(self) -> int:
        """The widest that leaves nothing above half the rate, as far as there is one."""
        return min((code for code, width_hz in FILTERS_HZ.items() if width_hz <= self.rate_hz / 2), default=6)

    def _reset(self) -> None:
        self._command_reset(PWR_MGMT_1, DEVICE_RESET)
        self._clock.sleep_s(RESET_S)

    def _fifo_level(self) -> int:
        return int.from_bytes(self._read(FIFO_COUNT, 2), "big")

    def _empty_fifo(self) -> None:
        self._write(FIFO_EN, 0)
        self._write(USER_CTRL, RESET_FIFO)
        self._write(USER_CTRL, USE_FIFO)
        self._write(FIFO_EN, self.fifo_content)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("mpu6050", argv)


if __name__ == "__main__":
    sys.exit(main())
