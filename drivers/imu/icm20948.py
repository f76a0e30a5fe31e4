"""TDK InvenSense ICM-20948; its magnetometer is left alone.

ICM-20948 Datasheet, DS-000189 revision 1.3; PX4 (InvenSense_ICM20948_registers.hpp) and SparkFun's library
(ICM_20948_REGISTERS.h) agree. Registers lie in four banks: here the high byte of a register is what REG_BANK_SEL holds.
The ranges are those of the MPU-6050.
"""

import struct
import sys
from collections.abc import Mapping, Sequence

from drivers.imu.fifo_imu import FifoImu
from drivers.imu.i2c_bus import TRIES
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Thermometer
from drivers.imu.mpu6050 import ACCEL_RANGES, GYRO_RANGES

WHO_AM_I = 0x00
USER_CTRL = 0x03
PWR_MGMT_1 = 0x06
PWR_MGMT_2 = 0x07
TEMP_OUT = 0x39
FIFO_EN_2 = 0x67
FIFO_RST = 0x68
FIFO_COUNT = 0x70
FIFO_R_W = 0x72
REG_BANK_SEL = 0x7F  # in every bank
GYRO_SMPLRT_DIV = 0x2000
GYRO_CONFIG_1 = 0x2001  # 5:3 GYRO_DLPFCFG, 2:1 GYRO_FS_SEL, 0 GYRO_FCHOICE: filter on
ODR_ALIGN_EN = 0x2009
ACCEL_SMPLRT_DIV_1 = 0x2010  # 3:0, the divider's high bits
ACCEL_SMPLRT_DIV_2 = 0x2011
ACCEL_CONFIG = 0x2014  # as GYRO_CONFIG_1

DEVICE_RESET = 0x80  # PWR_MGMT_1
BEST_CLOCK = 0x01  # also wakes the chip
USE_FIFO = 0x40  # USER_CTRL
GYRO_AND_ACCEL = 0x1E  # FIFO_EN_2
RESET_ALL = 0x1F  # FIFO_RST

INTERNAL_HZ = 1125
FILTERS_HZ = {1: 246, 2: 120, 3: 51, 4: 24, 5: 12, 6: 6}  # DLPFCFG: the wider of gyro and accelerometer, rounded
RESET_S = 0.1

IDENTITIES = {0xEA: "ICM-20948"}


class Icm20948(FifoImu):
    """ICM-20948; see ``I2cImu``."""

    chip = "ICM-20948"
    addresses = (0x68, 0x69)
    identity_register = WHO_AM_I
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(TEMP_OUT, "big", lsb_per_c=333.87, zero_c=21.0)
    fifo_register = FIFO_R_W
    fifo_bytes = 512
    frame = struct.Struct(">6h")
    gyro_first = False
    _bank: int | None = None  # selected; None: unknown

    def _granted_rate_hz(self, rate_hz: float) -> float:
        self._divider = min(max(round(INTERNAL_HZ / rate_hz), 1), 256)
        return INTERNAL_HZ / self._divider

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        filters = min((code for code, width_hz in FILTERS_HZ.items() if width_hz <= self.rate_hz / 2), default=6)
        return {
            PWR_MGMT_1: BEST_CLOCK,
            PWR_MGMT_2: 0,
            GYRO_SMPLRT_DIV: self._divider - 1,
            GYRO_CONFIG_1: filters << 3 | gyro_code << 1 | 1,
            ODR_ALIGN_EN: 1,
            ACCEL_SMPLRT_DIV_1: 0,
            ACCEL_SMPLRT_DIV_2: self._divider - 1,
            ACCEL_CONFIG: filters << 3 | accel_code << 1 | 1,
        }

    def _reset(self) -> None:
        self._command_reset(PWR_MGMT_1, DEVICE_RESET)
        self._clock.sleep_s(RESET_S)

    def _fifo_level(self) -> int:
        return int.from_bytes(self._read(FIFO_COUNT, 2), "big") & 0x1FFF

    def _empty_fifo(self) -> None:
        self._write(FIFO_EN_2, 0)
        self._write(FIFO_RST, RESET_ALL)
        self._write(FIFO_RST, 0)
        self._write(USER_CTRL, USE_FIFO)
        self._write(FIFO_EN_2, GYRO_AND_ACCEL)

    def _read(self, register: int, length: int, tries: int = TRIES) -> bytes:
        return super()._read(self._select(register), length, tries)

    def _write(self, register: int, *values: int, tries: int = TRIES) -> None:
        super()._write(self._select(register), *values, tries=tries)

    def _select(self, register: int) -> int:
        """The register's place in its bank, which is selected first."""
        bank = register >> 8
        if bank != self._bank:
            self._bank = None
            super()._write(REG_BANK_SEL, bank)
            self._bank = bank
        return register & 0xFF


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("icm20948", argv)


if __name__ == "__main__":
    sys.exit(main())
