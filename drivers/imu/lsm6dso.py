"""ST LSM6DSO and LSM6DSOX, which have the same identity: an LSM6DS3 with another FIFO.

LSM6DSO data sheet DS12140 revision 2; LSM6DSOX data sheet DS12814 revision 3; Linux (st_lsm6dsx_core.c and _buffer.c)
agrees. Each word of the FIFO has a tag that says which sensor it is of and, by a count of two bits, of which moment.
The LSM6DSO32 says the same of itself too, but its counts of acceleration are worth twice as much: only gravity at rest
distinguishes them.
"""

import struct
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from drivers.errors import WrongDeviceError
from drivers.imu.gravity import Gravity
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Counts, Thermometer
from drivers.imu.lsm6ds3 import (
    CONTINUOUS,
    CTRL1_XL,
    CTRL2_G,
    CTRL3_C,
    FIFO_STATUS1,
    ODR_HZ,
    OUT_TEMP_L,
    STEADY_WORDS,
    Lsm6ds3,
)
from drivers.samples import ImuSample

FIFO_CTRL3 = 0x09  # 7:4 BDR_GY, 3:0 BDR_XL
FIFO_CTRL4 = 0x0A  # 2:0 FIFO_MODE
CTRL9_XL = 0x18
FIFO_DATA_OUT_TAG = 0x78  # 7:3 TAG_SENSOR, 2:1 TAG_CNT; a burst goes round to here after the 6 bytes of data

NO_I3C = 0xE2  # CTRL9_XL: I3C_disable, else as at power-on: what passes on the wire might be taken for I3C
GYRO, ACCEL = 1, 2  # TAG_SENSOR
OVER_RUN_OR_FULL = 0x6800  # FIFO_OVR_IA, FIFO_FULL_IA, FIFO_OVR_LATCHED; of FIFO_STATUS1 and 2

MIN_GRAVITY, MAX_GRAVITY = 0.75, 1.35  # g; one chip taken for the other measures a half or two

IDENTITIES = {0x6C: "LSM6DSO or LSM6DSOX"}


class Lsm6dso(Lsm6ds3):
    """LSM6DSO or LSM6DSOX; see ``I2cImu``. ``counts["unpaired"]``: words whose other half never came.

    Reading raises ``WrongDeviceError`` when what is measured at rest is not about 1 g.
    """

    chip = "LSM6DSO"
    identities = IDENTITIES
    thermometer = Thermometer(OUT_TEMP_L, "little", lsb_per_c=256, zero_c=25.0)
    fifo_register = FIFO_DATA_OUT_TAG
    fifo_bytes = 512 * 7
    word_bytes = 7
    frame = struct.Struct("<B3h")
    twin: ClassVar[tuple[str, float] | None] = ("lsm6dso32", 0.5)
    """The driver of a chip that says the same of itself, and what that would measure at rest, g."""
    _gravity: Gravity | None = None

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        odr = ODR_HZ[self.rate_hz]
        return {
            CTRL9_XL: NO_I3C,
            CTRL3_C: STEADY_WORDS,
            CTRL1_XL: odr << 4 | accel_code << 2,
            CTRL2_G: odr << 4 | gyro_code << 2,
            FIFO_CTRL3: odr << 4 | odr,
        }

    def _fifo_level(self) -> int:
        status = int.from_bytes(self._read(FIFO_STATUS1, 2), "little")
        return self.fifo_bytes if status & OVER_RUN_OR_FULL else self.word_bytes * (status & 0x3FF)

    def _empty_fifo(self) -> None:
        self._write(FIFO_CTRL4, 0)
        self._write(FIFO_CTRL4, CONTINUOUS)
        self._halves: dict[int, Counts] = {}  # of the sample that is coming, by sensor
        self._moment = 0

    def _samples(self) -> list[ImuSample]:
        samples = super()._samples()
        if self.twin is not None:
            self._compare_gravity(samples, *self.twin)
        return samples

    def _compare_gravity(self, samples: Sequence[ImuSample], driver: str, expected_g: float) -> None:
        if self._gravity is None:
            self._gravity = Gravity(self.rate_hz)
        gravity = self._gravity.measured_g(samples)
        if gravity is not None and not MIN_GRAVITY <= gravity <= MAX_GRAVITY:
            is_twin = MIN_GRAVITY <= gravity / expected_g <= MAX_GRAVITY
            remedy = f"set imu.driver to {driver}" if is_twin else "its accelerometer is broken; take another board"
            raise WrongDeviceError(f"{self.name}: measures {gravity:.2f} g at rest instead of 1 g; {remedy}")

    def _frames(self, data: bytes) -> Iterator[tuple[Counts, Counts]]:
        for tag, x, y, z in self.frame.iter_unpack(data):
            moment = tag & 0x06
            if moment != self._moment:
                if self._halves:
                    self.counts["unpaired"] += 1
                self._halves.clear()
                self._moment = moment
            self._halves[tag >> 3] = (x, y, z)
            if GYRO in self._halves and ACCEL in self._halves:
                yield self._halves[GYRO], self._halves[ACCEL]
                self._halves.clear()


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("lsm6dso", argv)


if __name__ == "__main__":
    sys.exit(main())
