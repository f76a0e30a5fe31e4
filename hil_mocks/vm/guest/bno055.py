"""Lets the registers of a BNO055 live on an ``i2c-stub``: ``python -m hil_mocks.vm.guest.bno055 BUS SAMPLES.csv``.

A line of the file is one sample of 10 ms: rad/s and m/s² of x, y, z. They come again and again.
"""

import itertools
import math
import struct
import sys
import time
from collections.abc import Iterator

import numpy as np
import smbus2

ADDRESS = 0x28
CHIP_ID, ACC_DATA, GYRO_DATA, TEMPERATURE = 0x00, 0x08, 0x14, 0x34
PERIOD_S = 0.01


def counts(samples: Iterator[list[float]]) -> Iterator[tuple[bytes, bytes]]:
    """Accelerometer and gyro as the chip has them: 1/100 m/s² and 1/16 °/s, little-endian."""
    for gyro_and_accel in samples:
        gyro = (round(math.degrees(rate) * 16) for rate in gyro_and_accel[:3])
        accel = (round(100 * force) for force in gyro_and_accel[3:])
        yield struct.pack("<3h", *accel), struct.pack("<3h", *gyro)


def main(bus_number: int, path: str) -> None:
    """Write until somebody ends it."""
    rows = np.loadtxt(path, delimiter=",").tolist()
    with smbus2.SMBus(bus_number) as bus:
        bus.write_byte_data(ADDRESS, TEMPERATURE, 21)
        bus.write_byte_data(ADDRESS, CHIP_ID, 0xA0)
        due_s = time.monotonic()
        for accel, gyro in counts(itertools.cycle(rows)):
            bus.write_i2c_block_data(ADDRESS, ACC_DATA, list(accel + bytes(6) + gyro))
            due_s += PERIOD_S
            time.sleep(max(due_s - time.monotonic(), 0))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
