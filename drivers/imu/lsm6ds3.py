"""ST LSM6DS3 and LSM6DS3TR-C.

LSM6DS3 data sheet DocID026899 revision 8, application note AN4650; LSM6DS3TR-C data sheet DocID030071 revision 3
(half the FIFO, finer thermometer, otherwise the same registers). Linux (st_lsm6dsx_core.c) agrees.
"""

import sys
from collections.abc import Mapping, Sequence

from drivers.imu.fifo_imu import FifoImu, closest
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Range, Thermometer

FIFO_CTRL3 = 0x08  # 5:3 DEC_FIFO_GYRO, 2:0 DEC_FIFO_XL
FIFO_CTRL4 = 0x09
FIFO_CTRL5 = 0x0A  # 6:3 ODR_FIFO, 2:0 FIFO_MODE
WHO_AM_I = 0x0F
CTRL1_XL = 0x10  # 7:4 ODR_XL, 3:2 FS_XL
CTRL2_G = 0x11  # 7:4 ODR_G, 3:2 FS_G
CTRL3_C = 0x12
OUT_TEMP_L = 0x20
FIFO_STATUS1 = 0x3A  # 11:0 DIFF_FIFO in words of 2 bytes, then flags
FIFO_DATA_OUT_L = 0x3E  # a burst goes to and fro between this and the next register

SW_RESET = 0x01  # CTRL3_C
STEADY_WORDS = 0x44  # BDU, IF_INC: no byte of another sample in a word; addresses count up in a burst
EVERY_SAMPLE = 0x09  # FIFO_CTRL3: of both sensors
CONTINUOUS = 0x06  # FIFO_MODE
OVER_RUN_OR_FULL = 0x6000  # of FIFO_STATUS1 and 2; the count may read 0 then
RESET_S = 0.05

ODR_HZ = {12.5: 1, 26.0: 2, 52.0: 3, 104.0: 4, 208.0: 5, 416.0: 6, 833.0: 7, 1660.0: 8}
GYRO_RANGES = {
    250: Range(0, 1 / 8.75e-3),
    500: Range(1, 1 / 17.5e-3),
    1000: Range(2, 1 / 35e-3),
    2000: Range(3, 1 / 70e-3),
}
ACCEL_RANGES = {
    2: Range(0, 1 / 0.061e-3),
    4: Range(2, 1 / 0.122e-3),
    8: Range(3, 1 / 0.244e-3),
    16: Range(1, 1 / 0.488e-3),
}

IDENTITIES = {0x69: "LSM6DS3", 0x6A: "LSM6DS3TR-C"}


class Lsm6ds3(FifoImu):
    """LSM6DS3; see ``I2cImu``."""

    chip = "LSM6DS3"
    addresses = (0x6A, 0x6B)
    identity_register = WHO_AM_I
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES  # its 250 is called 245
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(OUT_TEMP_L, "little", lsb_per_c=16, zero_c=25.0)
    fifo_register = FIFO_DATA_OUT_L
    fifo_bytes = 8192

    def _granted_rate_hz(self, rate_hz: float) -> float:
        return closest(ODR_HZ, rate_hz)

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        odr = ODR_HZ[self.rate_hz]
        return {
            CTRL3_C: STEADY_WORDS,
            CTRL1_XL: odr << 4 | accel_code << 2,
            CTRL2_G: odr << 4 | gyro_code << 2,
            FIFO_CTRL3: EVERY_SAMPLE,
            FIFO_CTRL4: 0,
        }

    def _reset(self) -> None:
        if self.model == "LSM6DS3TR-C":
            self.thermometer = Thermometer(OUT_TEMP_L, "little", lsb_per_c=256, zero_c=25.0)
            self.fifo_bytes = 4096
        self._write(FIFO_CTRL5, 0)  # a reset while the FIFO fills is not acknowledged (richcreations/imud#72)
        self._command_reset(CTRL3_C, SW_RESET)
        self._clock.sleep_s(RESET_S)

    def _fifo_level(self) -> int:
        status = int.from_bytes(self._read(FIFO_STATUS1, 2), "little")
        return self.fifo_bytes if status & OVER_RUN_OR_FULL else 2 * (status & 0xFFF)

    def _empty_fifo(self) -> None:
        self._write(FIFO_CTRL5, 0)
        self._write(FIFO_CTRL5, ODR_HZ[self.rate_hz] << 3 | CONTINUOUS)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("lsm6ds3", argv)


if __name__ == "__main__":
    sys.exit(main())
