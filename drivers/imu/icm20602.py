"""TDK InvenSense ICM-20602 and ICM-20600, and the MPU-6886 of M5Stack's boards: an MPU-6500 with another FIFO.

ICM-20602 data sheet, DS-000176 revision 1.0; ICM-20600 data sheet, DS-000184; MPU-6886 data sheet (DS-000193, as
M5Stack publishes it). PX4 (InvenSense_ICM20602_registers.hpp) and Linux (inv_mpu_core.c) agree: a frame of the FIFO
always has the temperature between accelerometer and gyro, 14 bytes, and the FIFO holds 1008 bytes.

After hours an ICM-20602 may change the offset of its accelerometer's y by itself, as ArduPilot has seen (#16593): the
offsets are compared with those that it had at first, and given back.
"""

import struct
import sys
from collections.abc import Iterable, Iterator, Sequence

from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Counts
from drivers.imu.mpu6050 import GYRO_CLOCK, PWR_MGMT_1
from drivers.imu.mpu6500 import ICM_THERMOMETER, Mpu6500

ACCEL_OFFSETS = (0x77, 0x7A, 0x7D)  # x, y, z; two registers each
GYRO_AND_ACCEL = 0x18  # FIFO_EN: 4 gyro, 3 accelerometer; either brings the temperature

IDENTITIES = {0x11: "ICM-20600", 0x12: "ICM-20602", 0x19: "MPU-6886"}


class Icm20602(Mpu6500):
    """ICM-20602; see ``I2cImu``."""

    chip = "ICM-20602"
    identities = IDENTITIES
    thermometer = ICM_THERMOMETER
    fifo_bytes = 1008
    fifo_content = GYRO_AND_ACCEL
    word_bytes = 14
    frame = struct.Struct(">7h")
    _offsets: tuple[bytes, ...] = ()  # that the maker measured

    def _reset(self) -> None:
        super()._reset()
        self._write(PWR_MGMT_1, GYRO_CLOCK)
        self._offsets = self._offsets or tuple(self._read(register, 2) for register in ACCEL_OFFSETS)
        for register, offset in zip(ACCEL_OFFSETS, self._offsets, strict=True):
            self._write(register, *offset)

    def _not_held(self) -> Iterable[int]:
        offsets = zip(ACCEL_OFFSETS, self._offsets, strict=True)
        return [*super()._not_held(), *(register for register, offset in offsets if self._read(register, 2) != offset)]

    def _frames(self, data: bytes) -> Iterator[tuple[Counts, Counts]]:
        for x, y, z, _, p, q, r in self.frame.iter_unpack(data):
            yield (p, q, r), (x, y, z)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("icm20602", argv)


if __name__ == "__main__":
    sys.exit(main())
