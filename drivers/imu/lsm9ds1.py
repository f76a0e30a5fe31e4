"""ST LSM9DS1, the IMU of the Sense HAT; its magnetometer is left alone.

LSM9DS1 data sheet, DocID025715 revision 3. PX4 (ST_LSM9DS1_Registers.hpp, LSM9DS1.cpp) and Adafruit's driver agree; the
thermometer is as in the data sheet and in ST's driver. Gyro and accelerometer have one FIFO of 32 samples, read each at
its own registers. Above 500 °/s there is only 2000, and 16 g is 0.732 mg for a count, not twice that of 8 g.

The axes of the chip are left-handed, though its rates turn by the right hand about each of them: PX4 turns z round, and
jremington's LSM9DS1-AHRS x, of both sensors. Here it is x, so that the axes are those of the magnetometer.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence

from drivers.imu.fifo_imu import FifoImu, closest
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import MAX_COUNT, Counts, Range, Thermometer

WHO_AM_I = 0x0F
CTRL_REG1_G = 0x10  # 7:5 ODR_G, of both; 4:3 FS_G
OUT_TEMP_L = 0x15
OUT_X_L_G = 0x18
CTRL_REG6_XL = 0x20  # 7:5 ODR_XL, 4:3 FS_XL
CTRL_REG8 = 0x22
CTRL_REG9 = 0x23
OUT_X_L_XL = 0x28
FIFO_CTRL = 0x2E  # 7:5 FMODE
FIFO_SRC = 0x2F  # 6 OVRN, 5:0 FSS

SW_RESET = 0x01  # CTRL_REG8
STEADY_WORDS = 0x44  # BDU, IF_ADD_INC
USE_FIFO = 0x02  # CTRL_REG9
CONTINUOUS = 0xC0  # FIFO_CTRL
OVERRUN = 0x40
RESET_S = 0.05
SENSOR_BYTES = 6

ODR_HZ = {14.9: 1, 59.5: 2, 119.0: 3, 238.0: 4, 476.0: 5, 952.0: 6}
WIDEST_GYRO = Range(3, 1 / 70e-3, end=int(2000 / 70e-3))
GYRO_RANGES = {250: Range(0, 1 / 8.75e-3), 500: Range(1, 1 / 17.5e-3), 1000: WIDEST_GYRO, 2000: WIDEST_GYRO}
ACCEL_RANGES = {
    2: Range(0, 1 / 0.061e-3),
    4: Range(2, 1 / 0.122e-3),
    8: Range(3, 1 / 0.244e-3),
    16: Range(1, 1 / 0.732e-3),
}

IDENTITIES = {0x68: "LSM9DS1"}


class Lsm9ds1(FifoImu):
    """LSM9DS1; see ``I2cImu``."""

    chip = "LSM9DS1"
    addresses = (0x6A, 0x6B)
    identity_register = WHO_AM_I
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES  # its 250 is called 245
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(OUT_TEMP_L, "little", lsb_per_c=16, zero_c=25.0)
    fifo_register = OUT_X_L_G
    fifo_bytes = 32 * 2 * SENSOR_BYTES

    def _granted_rate_hz(self, rate_hz: float) -> float:
        return closest(ODR_HZ, rate_hz)

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        odr = ODR_HZ[self.rate_hz]
        return {
            CTRL_REG8: STEADY_WORDS,
            CTRL_REG9: USE_FIFO,
            CTRL_REG6_XL: odr << 5 | accel_code << 3,
            CTRL_REG1_G: odr << 5 | gyro_code << 3,
        }

    def _reset(self) -> None:
        self._command_reset(CTRL_REG8, SW_RESET)
        self._clock.sleep_s(RESET_S)

    def _fifo_level(self) -> int:
        source = self._read(FIFO_SRC, 1)[0]
        return self.fifo_bytes if source & OVERRUN else (source & 0x3F) * 2 * SENSOR_BYTES

    def _empty_fifo(self) -> None:
        self._write(FIFO_CTRL, 0)
        self._write(FIFO_CTRL, CONTINUOUS)

    def _burst(self, length: int) -> bytes:
        parts = []
        for _ in range(length // (2 * SENSOR_BYTES)):
            parts += [self._read(register, SENSOR_BYTES, tries=1) for register in (OUT_X_L_G, OUT_X_L_XL)]
        return b"".join(parts)

    def _frames(self, data: bytes) -> Iterator[tuple[Counts, Counts]]:
        for (p, q, r), (x, y, z) in super()._frames(data):
            yield (min(-p, MAX_COUNT), q, r), (min(-x, MAX_COUNT), y, z)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("lsm9ds1", argv)


if __name__ == "__main__":
    sys.exit(main())
