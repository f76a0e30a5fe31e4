"""Bosch BMI270: at every start it must be given the vendor's configuration file.

BMI270 data sheet, BST-BMI270-DS000-05 revision 1.3; Zephyr (bmi270.h) agrees. The file is the one that the Linux driver
takes, 8 KiB. The FIFO is that of the BMI160, but for frames that say that a sensor has no data (the values are those of
Bosch's BMI270_SensorAPI, bmi2_defs.h). The gyro's x leans towards z by a factor that each chip knows (GYR_CAS) and the
host takes out.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import DeviceLostError, DriverError
from drivers.imu.bmi160 import (
    CMD,
    FILTERED_FIFO,
    GYRO_AND_ACCEL,
    NO_TEMPERATURE,
    ODR_HZ,
    SOFT_RESET,
    Bmi160,
)
from drivers.imu.i2c_bus import BLOCK_BYTES, I2cBus
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Counts, Range, Thermometer
from drivers.imu.settings import DEFAULT_SETTINGS, ImuSettings

INTERNAL_STATUS = 0x21  # 3:0 message
TEMPERATURE = 0x22
FIFO_LENGTH = 0x24  # 13:0
FIFO_DATA = 0x26
FEAT_PAGE = 0x2F
GYR_CAS = 0x3C  # of feature page 0; 6:0 factor, signed
ACC_CONF = 0x40  # 7 filter for performance, 6:4 acc_bwp, 3:0 acc_odr
ACC_RANGE = 0x41
GYR_CONF = 0x42  # 7 filter for performance, 6 noise for performance, 5:4 gyr_bwp, 3:0 gyr_odr
GYR_RANGE = 0x43
FIFO_DOWNS = 0x45
FIFO_CONFIG_0 = 0x48
FIFO_CONFIG_1 = 0x49
INIT_CTRL = 0x59
INIT_ADDR = 0x5B  # two registers: bits 3:0 and 11:4 of the place in the file, in words of 2 bytes
INIT_DATA = 0x5E
PWR_CONF = 0x7C
PWR_CTRL = 0x7D

INIT_OK = 1  # INTERNAL_STATUS
AWAKE = 0x02  # PWR_CONF: no advanced power save, FIFO reads wake the chip
ALL_SENSORS = 0x0E  # PWR_CTRL: temperature, accelerometer, gyro
ACCEL_FILTER = 0xA0
GYRO_FILTER = 0xE0
NO_GYRO = (0x7F02, -0x8000)  # x and y in the FIFO while the sensor has no data
NO_ACCEL = (0x7F01, -0x8000)

FIRMWARE_BYTES = 8192
RESET_S = 0.01
AWAKE_S = 0.001
INIT_S = 0.15

IDENTITIES = {0x24: "BMI270"}
ACCEL_RANGES = {2: Range(0, 16384), 4: Range(1, 8192), 8: Range(2, 4096), 16: Range(3, 2048)}


class FirmwareError(DriverError):
    """The vendor's configuration file cannot be read, or is not one."""

    retry = False


class Bmi270(Bmi160):
    """BMI270; see ``I2cImu``. Takes the vendor's file from ``ImuSettings.firmware``. Raises ``FirmwareError``.

    ``counts["no_data"]``: frames in which a sensor had none.
    """

    chip = "BMI270"
    identities = IDENTITIES
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(TEMPERATURE, "little", lsb_per_c=512, zero_c=23.0, invalid=NO_TEMPERATURE)
    fifo_register = FIFO_DATA
    fifo_bytes = 2048

    def __init__(
        self, bus: I2cBus, address: int = 0, settings: ImuSettings = DEFAULT_SETTINGS, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        self._firmware = settings.firmware
        super().__init__(bus, address, settings, clock)

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        odr = ODR_HZ[self.rate_hz]
        return {
            PWR_CTRL: ALL_SENSORS,
            ACC_CONF: ACCEL_FILTER | odr,
            ACC_RANGE: accel_code,
            GYR_CONF: GYRO_FILTER | odr,
            GYR_RANGE: gyro_code,
            FIFO_DOWNS: FILTERED_FIFO,
            FIFO_CONFIG_0: 0,
            FIFO_CONFIG_1: GYRO_AND_ACCEL,
            PWR_CONF: AWAKE,
        }

    def _reset(self) -> None:
        firmware = self._read_firmware()
        self._command_reset(CMD, SOFT_RESET)
        self._clock.sleep_s(RESET_S)
        self._write(PWR_CONF, 0)
        self._clock.sleep_s(AWAKE_S)
        self._write(INIT_CTRL, 0)
        for place in range(0, FIRMWARE_BYTES, BLOCK_BYTES):
            word = place // 2
            self._write(INIT_ADDR, word & 0x0F, word >> 4)
            self._write(INIT_DATA, *firmware[place : place + BLOCK_BYTES])
        self._write(INIT_CTRL, 1)
        self._clock.sleep_s(INIT_S)
        status = self._read(INTERNAL_STATUS, 1)[0] & 0x0F
        if status != INIT_OK:
            raise DeviceLostError(
                f"{self.name}: refuses the configuration file (status {status}); is {self._firmware} for a BMI270?"
            )
        self._write(FEAT_PAGE, 0)
        factor = self._read(GYR_CAS, 1)[0] & 0x7F
        self._lean = (factor - 0x80 if factor & 0x40 else factor) / 512

    def _read_firmware(self) -> bytes:
        remedy = f"put Bosch's {DEFAULT_SETTINGS.firmware.name} there (see docs/imus.md) or set imu.firmware"
        try:
            with self._firmware.open("rb") as file:
                data = file.read(FIRMWARE_BYTES + 1)
        except OSError as error:
            raise FirmwareError(f"{self._firmware}: cannot be read ({error.strerror}); {remedy}") from error
        if len(data) != FIRMWARE_BYTES:
            raise FirmwareError(f"{self._firmware}: not the {FIRMWARE_BYTES} bytes that a BMI270 needs; {remedy}")
        return data

    def _fifo_level(self) -> int:
        return int.from_bytes(self._read(FIFO_LENGTH, 2), "little") & 0x3FFF

    def _frames(self, data: bytes) -> Iterator[tuple[Counts, Counts]]:
        for (x, y, z), accel in super()._frames(data):
            if (x, y) == NO_GYRO or accel[:2] == NO_ACCEL:
                self.counts["no_data"] += 1
            else:
                yield (round(x - self._lean * z), y, z), accel


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("bmi270", argv)


if __name__ == "__main__":
    sys.exit(main())
