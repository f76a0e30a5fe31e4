"""Bosch BMI088: a gyro and an accelerometer, each at an address of its own, with a clock and a FIFO of its own.

BMI088 data sheet, BST-BMI088-DS001 revision 1.9; Bosch's BMI08x_SensorAPI (bmi08x_defs.h) and PX4
(Bosch_BMI088_*_Registers.hpp) agree, but for the gyro's range of 250 °/s, which is 3 as Bosch and Linux (bmg160) have
it. Samples are the gyro's. To each the acceleration is put that was made at about the same time, counted back from the
newest of both: the clocks may differ, a sample's worth. A register is written here with its sensor in the high byte.
"""

import struct
import sys
from collections import deque
from collections.abc import Iterator, Mapping, Sequence

from drivers.errors import DeviceMissingError
from drivers.imu.fifo_imu import FifoImu, closest
from drivers.imu.i2c_bus import BLOCK_BYTES, TRIES, TransferError
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import MAX_COUNT, Counts, Range, Thermometer

CHIP_ID = 0x00  # of both
FIFO_STATUS = 0x0E  # 7 overrun, 6:0 frames
GYRO_RANGE = 0x0F
GYRO_BANDWIDTH = 0x10
GYRO_SOFTRESET = 0x14
GYRO_FIFO_CONFIG_1 = 0x3E  # 7:6 mode
GYRO_FIFO_DATA = 0x3F

ACCEL = 0x100
TEMP = ACCEL | 0x22
FIFO_LENGTH = ACCEL | 0x24  # 13:0
ACCEL_FIFO_DATA = ACCEL | 0x26  # a frame that was not read to its end comes again
ACC_CONF = ACCEL | 0x40  # 7:4 acc_bwp, 3:0 acc_odr
ACC_RANGE = ACCEL | 0x41
ACCEL_FIFO_CONFIG_0 = ACCEL | 0x48
ACCEL_FIFO_CONFIG_1 = ACCEL | 0x49
ACC_PWR_CONF = ACCEL | 0x7C
ACC_PWR_CTRL = ACCEL | 0x7D
ACC_SOFTRESET = ACCEL | 0x7E

RESET = 0xB6  # both
CLEAR_FIFO = 0xB0  # ACC_SOFTRESET
ALWAYS_SET = 0x80  # GYRO_BANDWIDTH
STREAM = 0x80  # GYRO_FIFO_CONFIG_1
OVERRUN = 0x80  # FIFO_STATUS
NORMAL_FILTER = 0xA0  # ACC_CONF
ACCEL_STREAM = 0x02  # ACCEL_FIFO_CONFIG_0
ACCEL_IN_FIFO = 0x50  # ACCEL_FIFO_CONFIG_1
ACTIVE = 0x00  # ACC_PWR_CONF
ACCEL_ON = 0x04  # ACC_PWR_CTRL
ACCEL_DATA = 0x84  # header of a frame, whose two lowest bits are the interrupts'
FRAME_BYTES = {ACCEL_DATA: 7, 0x40: 2, 0x44: 4, 0x48: 2, 0x50: 2}  # then: skipped, time, settings changed, dropped
RESET_S = 0.03  # of the gyro; the accelerometer 1 ms
ACCEL_START_S = 0.05
HISTORY = 64  # accelerations

ODR_HZ = {100.0: (7, 8), 200.0: (6, 9), 400.0: (3, 10)}  # the codes of gyro and accelerometer; the widest filters
GYRO_RANGES = {dps: Range(code, 2**15 / dps) for code, dps in enumerate((2000, 1000, 500, 250))}
ACCEL_RANGES = {  # 3, 6, 12 and 24 g, the least in which what is asked for has room
    2: Range(0, 2**15 / 3, MAX_COUNT),
    4: Range(1, 2**15 / 6, MAX_COUNT),
    8: Range(2, 2**15 / 12, MAX_COUNT),
    16: Range(3, 2**15 / 24, MAX_COUNT),
}

IDENTITIES = {0x0F: "BMI088"}  # of the gyro
ACCEL_IDENTITY = 0x1E
ACCEL_ADDRESSES = (0x18, 0x19)


class Bmi088(FifoImu):
    """BMI088; see ``I2cImu``. The address is the gyro's; the accelerometer is looked for."""

    chip = "BMI088"
    addresses = (0x68, 0x69)
    identity_register = CHIP_ID
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(TEMP, "big", lsb_per_c=256, zero_c=23.0)
    fifo_register = GYRO_FIFO_DATA
    fifo_bytes = 100 * 6
    word_bytes = 6
    frame = struct.Struct("<3h")

    def _granted_rate_hz(self, rate_hz: float) -> float:
        return closest(ODR_HZ, rate_hz)

    def _identify(self, copy: int | None) -> str:
        model = super()._identify(copy)
        for address in ACCEL_ADDRESSES:
            try:
                if self._bus.read(address, CHIP_ID, 1, tries=2)[0] == ACCEL_IDENTITY:
                    self._accel_address = address
                    return model
            except TransferError:
                continue
        raise DeviceMissingError(f"{self.name}: its accelerometer is neither at 0x18 nor at 0x19; check the wiring")

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        gyro_odr, accel_odr = ODR_HZ[self.rate_hz]
        return {
            ACC_CONF: NORMAL_FILTER | accel_odr,
            ACC_RANGE: accel_code,
            ACCEL_FIFO_CONFIG_0: ACCEL_STREAM,
            ACCEL_FIFO_CONFIG_1: ACCEL_IN_FIFO,
            GYRO_RANGE: gyro_code,
            GYRO_BANDWIDTH: ALWAYS_SET | gyro_odr,
            GYRO_FIFO_CONFIG_1: STREAM,
        }

    def _reset(self) -> None:
        self._command_reset(ACC_SOFTRESET, RESET)
        self._command_reset(GYRO_SOFTRESET, RESET)
        self._clock.sleep_s(RESET_S)
        self._write(ACC_PWR_CONF, ACTIVE)
        self._write(ACC_PWR_CTRL, ACCEL_ON)
        self._clock.sleep_s(ACCEL_START_S)

    def _fifo_level(self) -> int:
        status = self._read(FIFO_STATUS, 1)[0]
        return self.fifo_bytes if status & OVERRUN else self.word_bytes * (status & 0x7F)

    def _empty_fifo(self) -> None:
        self._accelerations: deque[Counts] = deque(maxlen=HISTORY)
        self._write(ACC_SOFTRESET, CLEAR_FIFO)
        self._write(GYRO_FIFO_CONFIG_1, STREAM)  # clears it

    def _burst(self, length: int) -> bytes:
        """The gyro's FIFO; then the accelerometer's, so that there is an acceleration for every sample."""
        gyro = super()._burst(length)
        level = int.from_bytes(self._read(FIFO_LENGTH, 2), "little") & 0x3FFF
        most = BLOCK_BYTES - BLOCK_BYTES % FRAME_BYTES[ACCEL_DATA]
        for at in range(0, level, most):
            self._accelerations += _accelerations(self._read(ACCEL_FIFO_DATA, min(most, level - at), tries=1))
        return gyro

    def _frames(self, data: bytes) -> Iterator[tuple[Counts, Counts]]:
        turns = list(self.frame.iter_unpack(data))
        newest = len(self._accelerations) - 1
        if newest >= 0:
            for age, (p, q, r) in zip(range(len(turns) - 1, -1, -1), turns, strict=True):
                yield (p, q, r), self._accelerations[max(newest - age, 0)]

    def _read(self, register: int, length: int, tries: int = TRIES) -> bytes:
        return self._bus.read(self._address_of(register), register & 0xFF, length, tries)

    def _write(self, register: int, *values: int, tries: int = TRIES) -> None:
        self._bus.write(self._address_of(register), register & 0xFF, bytes(values), tries)

    def _address_of(self, register: int) -> int:
        return self._accel_address if register & ACCEL else self.address


def _accelerations(burst: bytes) -> Iterator[Counts]:
    """What the frames of one burst of the accelerometer's FIFO hold, oldest first, up to one that was cut short."""
    at = 0
    while at < len(burst):
        kind = burst[at] & 0xFC
        length = FRAME_BYTES.get(kind, len(burst))
        if kind == ACCEL_DATA and at + length <= len(burst):
            x, y, z = struct.unpack_from("<3h", burst, at + 1)
            yield x, y, z
        at += length


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("bmi088", argv)


if __name__ == "__main__":
    sys.exit(main())
