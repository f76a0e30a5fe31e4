"""TDK InvenSense ICM-42688-P and ICM-42605 (and ICM-42600, -42602, -42622).

ICM-42688-P data sheet, DS-000347 revision 1.6; ICM-42605 data sheet, DS-000292. Linux (inv_icm42600.h, _buffer.c) and
PX4 (InvenSense_ICM42688P_registers.hpp) agree. Only registers of bank 0 are used. A packet of the FIFO has a header,
the accelerometer, the gyro, a temperature of 8 bits and a time of 16; a sensor that has no data yet is -32768 in it.

By default the gyro changes its range by itself at 100 °/s (AFSR), and repeats a value for 1 to 2 ms at each change. The
bits that forbid it are in no data sheet, but ArduPilot's (#25370, where TDK says: in all of the family), Betaflight's
and PX4's.
"""

import struct
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress

from drivers.imu.fifo_imu import FifoImu, closest
from drivers.imu.i2c_bus import TransferError
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Counts, Range, Thermometer

DEVICE_CONFIG = 0x11
FIFO_CONFIG = 0x16  # 7:6 mode
TEMP_DATA = 0x1D
FIFO_COUNT = 0x2E
FIFO_DATA = 0x30
SIGNAL_PATH_RESET = 0x4B
INTF_CONFIG0 = 0x4C
INTF_CONFIG1 = 0x4D  # 7:6 AFSR
PWR_MGMT0 = 0x4E  # 3:2 gyro, 1:0 accelerometer
GYRO_CONFIG0 = 0x4F  # 7:5 GYRO_FS_SEL, 3:0 GYRO_ODR
ACCEL_CONFIG0 = 0x50  # 7:5 ACCEL_FS_SEL, 3:0 ACCEL_ODR
GYRO_ACCEL_CONFIG0 = 0x52  # 7:4 and 3:0, bandwidth of the filters
FIFO_CONFIG1 = 0x5F
WHO_AM_I = 0x75
REG_BANK_SEL = 0x76

SOFT_RESET = 0x01  # DEVICE_CONFIG
STREAM = 0x40  # FIFO_CONFIG
FLUSH_FIFO = 0x02  # SIGNAL_PATH_RESET
BIG_ENDIAN_IN_BYTES = 0x30  # INTF_CONFIG0: data and count; as at power-on
AFSR, NO_AFSR = 0xC0, 0x40  # INTF_CONFIG1
BOTH_LOW_NOISE = 0x0F  # PWR_MGMT0
HALF_THE_RATE = 0x00  # GYRO_ACCEL_CONFIG0
TEMP_GYRO_AND_ACCEL = 0x07  # FIFO_CONFIG1
KIND, BOTH = 0xE0, 0x60  # of a packet's header: 7 the FIFO is empty, 6 accelerometer, 5 gyro
NO_DATA = -0x8000
RESET_S = 0.002  # 1 ms

ODR_HZ = {12.5: 11, 25.0: 10, 50.0: 9, 100.0: 8, 200.0: 7, 500.0: 15, 1000.0: 6}
GYRO_RANGES = {250: Range(3, 131.0), 500: Range(2, 65.5), 1000: Range(1, 32.8), 2000: Range(0, 16.4)}
ACCEL_RANGES = {2: Range(3, 16384), 4: Range(2, 8192), 8: Range(1, 4096), 16: Range(0, 2048)}

IDENTITIES = {0x40: "ICM-42600", 0x41: "ICM-42602", 0x42: "ICM-42605", 0x46: "ICM-42622", 0x47: "ICM-42688-P"}


class Icm42688(FifoImu):
    """ICM-42688-P; see ``I2cImu``. ``counts["no_data"]``: packets in which a sensor had none."""

    chip = "ICM-42688-P"
    addresses = (0x68, 0x69)
    identity_register = WHO_AM_I
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(TEMP_DATA, "big", lsb_per_c=132.48, zero_c=25.0)
    fifo_register = FIFO_DATA
    fifo_bytes = 2048
    word_bytes = 16
    frame = struct.Struct(">B6h3x")

    def _identify(self, copy: int | None) -> str:
        with suppress(TransferError):  # another program may have left another bank selected
            self._bus.write(self.address, REG_BANK_SEL, b"\0", tries=1)
        return super()._identify(copy)

    def _granted_rate_hz(self, rate_hz: float) -> float:
        return closest(ODR_HZ, rate_hz)

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        odr = ODR_HZ[self.rate_hz]
        return {
            INTF_CONFIG0: BIG_ENDIAN_IN_BYTES,
            GYRO_CONFIG0: gyro_code << 5 | odr,
            ACCEL_CONFIG0: accel_code << 5 | odr,
            GYRO_ACCEL_CONFIG0: HALF_THE_RATE,
            FIFO_CONFIG1: TEMP_GYRO_AND_ACCEL,
            FIFO_CONFIG: STREAM,
            PWR_MGMT0: BOTH_LOW_NOISE,  # last: nothing may be written for 200 µs after it
        }

    def _reset(self) -> None:
        self._command_reset(DEVICE_CONFIG, SOFT_RESET)
        self._clock.sleep_s(RESET_S)
        others = self._read(INTF_CONFIG1, 1)[0] & ~AFSR
        self._write(INTF_CONFIG1, others | NO_AFSR)  # while the sensors are off, as the data sheet wants it

    def _fifo_level(self) -> int:
        return int.from_bytes(self._read(FIFO_COUNT, 2), "big")

    def _empty_fifo(self) -> None:
        self._write(SIGNAL_PATH_RESET, FLUSH_FIFO)

    def _frames(self, data: bytes) -> Iterator[tuple[Counts, Counts]]:
        for header, x, y, z, p, q, r in self.frame.iter_unpack(data):
            if header & KIND != BOTH or NO_DATA in (x, p):
                self.counts["no_data"] += 1
            else:
                yield (p, q, r), (x, y, z)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("icm42688", argv)


if __name__ == "__main__":
    sys.exit(main())
