"""Bosch BMI160.

BMI160 data sheet, BST-BMI160-DS000-07 revision 0.8; Linux (bmi160_core.c) agrees on all but the FIFO, which it does not
use, and Bosch's BMI160_SensorAPI (bmi160_defs.h) on that. The FIFO runs without headers: frames of gyro, then
accelerometer, in the order of the data registers; a frame that was not read to its end comes again, so bursts end with
a frame.
"""

import sys
from collections.abc import Mapping, Sequence

from drivers.errors import DeviceLostError
from drivers.imu.fifo_imu import FifoImu, closest
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Range, Thermometer

CHIP_ID = 0x00
PMU_STATUS = 0x03  # 5:4 accelerometer, 3:2 gyro
TEMPERATURE = 0x20
FIFO_LENGTH = 0x22  # 10:0
FIFO_DATA = 0x24
ACC_CONF = 0x40  # 6:4 acc_bwp, 3:0 acc_odr
ACC_RANGE = 0x41
GYR_CONF = 0x42  # 5:4 gyr_bwp, 3:0 gyr_odr
GYR_RANGE = 0x43
FIFO_DOWNS = 0x45
FIFO_CONFIG_1 = 0x47
CMD = 0x7E

SOFT_RESET = 0xB6  # CMD
FLUSH_FIFO = 0xB0
ACCEL_NORMAL = 0x11
GYRO_NORMAL = 0x15
BOTH_NORMAL = 0x14  # PMU_STATUS
NORMAL_FILTER = 0x20  # of both CONF
FILTERED_FIFO = 0x88  # FIFO_DOWNS
GYRO_AND_ACCEL = 0xC0  # FIFO_CONFIG_1, without headers

ODR_HZ = {25.0: 6, 50.0: 7, 100.0: 8, 200.0: 9, 400.0: 10, 800.0: 11, 1600.0: 12}
GYRO_RANGES = {dps: Range(code, 2**15 / dps) for code, dps in enumerate((2000, 1000, 500, 250))}
NO_TEMPERATURE = -0x8000
RESET_S = 0.02
ACCEL_START_S = 0.005
GYRO_START_S = 0.085

IDENTITIES = {0xD1: "BMI160"}
ACCEL_RANGES = {2: Range(3, 16384), 4: Range(5, 8192), 8: Range(8, 4096), 16: Range(12, 2048)}


class Bmi160(FifoImu):
    """BMI160; see ``I2cImu``."""

    chip = "BMI160"
    addresses = (0x68, 0x69)
    identity_register = CHIP_ID
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(TEMPERATURE, "little", lsb_per_c=512, zero_c=23.0, invalid=NO_TEMPERATURE)
    fifo_register = FIFO_DATA
    fifo_bytes = 1024

    def _granted_rate_hz(self, rate_hz: float) -> float:
        return closest(ODR_HZ, rate_hz)

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        odr = ODR_HZ[self.rate_hz]
        return {
            ACC_CONF: NORMAL_FILTER | odr,
            ACC_RANGE: accel_code,
            GYR_CONF: NORMAL_FILTER | odr,
            GYR_RANGE: gyro_code,
            FIFO_DOWNS: FILTERED_FIFO,
            FIFO_CONFIG_1: GYRO_AND_ACCEL,
        }

    def _reset(self) -> None:
        self._command_reset(CMD, SOFT_RESET)
        self._clock.sleep_s(RESET_S)
        for command, pause_s in ((ACCEL_NORMAL, ACCEL_START_S), (GYRO_NORMAL, GYRO_START_S)):
            self._write(CMD, command)
            self._clock.sleep_s(pause_s)
        if self._read(PMU_STATUS, 1)[0] & 0x3C != BOTH_NORMAL:
            raise DeviceLostError(f"{self.name}: does not wake; switch its supply off and on")

    def _fifo_level(self) -> int:
        return int.from_bytes(self._read(FIFO_LENGTH, 2), "little") & 0x7FF

    def _empty_fifo(self) -> None:
        self._write(CMD, FLUSH_FIFO)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("bmi160", argv)


if __name__ == "__main__":
    sys.exit(main())
