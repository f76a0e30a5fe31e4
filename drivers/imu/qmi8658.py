"""QST QMI8658 (A and C), the IMU of Waveshare's rover boards.

QMI8658A data sheet, 13-52-25 revision A; lewisxhe's SensorLib and IniterWorker's qmi8658 (command.rs) agree. The chip
numbers its samples, and one burst reads number, temperature, accelerometer and gyro: so the registers are polled, and
what was missed is known. Its FIFO is left alone: reading it takes a command each time, and it takes in nothing
meanwhile. The burst begins with STATUSINT, which locks the data within 12 µs, half a byte at 400 kHz, until the last of
them was read (section 13). A QMI8658C samples 5 % faster (its data sheet, as in photon-circus's ph-qmi8658), which the
stamps follow.
"""

import struct
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress

from drivers.errors import DeviceLostError
from drivers.imu.fifo_imu import closest
from drivers.imu.i2c_bus import TransferError
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import I2cImu, Range, Thermometer
from drivers.samples import ImuSample

WHO_AM_I = 0x00
CTRL1 = 0x02
CTRL2 = 0x03  # 6:4 aFS, 3:0 aODR
CTRL3 = 0x04  # 6:4 gFS, 3:0 gODR
CTRL5 = 0x06  # low-pass filters: 6:5 and 2:1 width, 4 and 0 on
CTRL7 = 0x08  # 7 syncSample, 1 gyro, 0 accelerometer
CTRL8 = 0x09
CTRL9 = 0x0A  # commands
CAL1_L = 0x0B
STATUSINT = 0x2D  # then 2 of status, 3 of sample number, temperature, accelerometer, gyro
TEMP = 0x33
RESET_RESULT = 0x4D
RESET = 0x60

ADDRESSES_COUNT_UP = 0x40  # CTRL1, little-endian
WIDEST_FILTERS = 0x77  # CTRL5: 13.37 % of the rate
BOTH_IN_STEP = 0x83  # CTRL7
DONE_IN_STATUSINT = 0x80  # CTRL8: says when a command is done
AHB_CLOCK_GATING = 0x12  # CTRL9; with 1 in CAL1_L it is off, as the lock wants it
ACKNOWLEDGE = 0x00
DONE, AVAILABLE = 0x80, 0x01  # STATUSINT
RESET_NOW = 0xB0
RESET_DONE = 0x80
RESET_S = 0.02  # 15 ms, in which it acknowledges nothing
MAX_RESET_S = 2.0  # the data sheet of the QMI8658C speaks of 1.75 s
RESET_LOOK_S = 0.005
COMMAND_LOOK_S = 0.001
COMMAND_LOOKS = 100
START_UP_S = 0.17  # of the gyro 150 ms, then three samples

DATA = struct.Struct("<B2xHB2x3h3h")
NUMBERS = 2**24
POLL = 0.97  # of a period: every sample is seen, at varying delays

ODR_HZ = {28.025: 8, 56.05: 7, 112.1: 6, 224.2: 5, 448.4: 4, 896.8: 3}  # with both sensors on
# What is called 512 °/s is asked for as 500, and so on.
GYRO_RANGES = {
    250: Range(4, 128, end=32767),
    500: Range(5, 64, end=32767),
    1000: Range(6, 32, end=32767),
    2000: Range(7, 16, end=32767),
}
ACCEL_RANGES = {2: Range(0, 16384), 4: Range(1, 8192), 8: Range(2, 4096), 16: Range(3, 2048)}

IDENTITIES = {0x05: "QMI8658"}


class Qmi8658(I2cImu):
    """QMI8658; see ``I2cImu``. ``counts["lost"]``: samples not read in time."""

    chip = "QMI8658"
    addresses = (0x6B, 0x6A)
    identity_register = WHO_AM_I
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(TEMP, "little", lsb_per_c=256, zero_c=0.0)

    def _granted_rate_hz(self, rate_hz: float) -> float:
        return closest(ODR_HZ, rate_hz)

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:
        odr = ODR_HZ[self.rate_hz]
        return {
            CTRL1: ADDRESSES_COUNT_UP,
            CTRL2: accel_code << 4 | odr,
            CTRL3: gyro_code << 4 | odr,
            CTRL5: WIDEST_FILTERS,
            CTRL8: DONE_IN_STATUSINT,
            CTRL7: BOTH_IN_STEP,
        }

    def _reset(self) -> None:
        self._command_reset(RESET, RESET_NOW)
        self._await_reset()
        self._write(CTRL8, DONE_IN_STATUSINT)
        self._write(CAL1_L, 1)
        self._command(AHB_CLOCK_GATING)

    def _await_reset(self) -> None:
        end_ns = self._clock.monotonic_ns() + round(MAX_RESET_S * 1e9)
        self._clock.sleep_s(RESET_S)
        while self._clock.monotonic_ns() < end_ns:
            with suppress(TransferError):
                if self._read(RESET_RESULT, 1, tries=1)[0] == RESET_DONE:
                    return
            self._clock.sleep_s(RESET_LOOK_S)
        raise DeviceLostError(f"{self.name}: does not come back from a reset; switch its supply off and on")

    def _begin(self) -> None:
        self._clock.sleep_s(START_UP_S)
        self._polled_ns = self._clock.monotonic_ns()
        self._number: int | None = None  # of the newest sample

    def _command(self, command: int) -> None:
        """Execute a CTRL9 command and wait for its end. Raises ``DeviceLostError``."""
        for value, done in ((command, DONE), (ACKNOWLEDGE, 0)):
            self._write(CTRL9, value)
            for _ in range(COMMAND_LOOKS):
                if self._read(STATUSINT, 1)[0] & DONE == done:
                    break
                self._clock.sleep_s(COMMAND_LOOK_S)
            else:
                raise DeviceLostError(f"{self.name}: does not execute a command; switch its supply off and on")

    def _wait(self) -> None:
        due_ns = self._polled_ns + POLL * 1e9 / self._sample_clock.rate_hz
        self._clock.sleep_s((due_ns - self._clock.monotonic_ns()) / 1e9)

    def _samples(self) -> list[ImuSample]:
        self._polled_ns = self._clock.monotonic_ns()
        status, low, high, x, y, z, p, q, r = DATA.unpack(self._read(STATUSINT, DATA.size))
        now_ns = self._clock.monotonic_ns()
        if not status & AVAILABLE:  # nothing new, or it came during the burst: not locked, it is read next time
            return []
        number = high << 16 | low
        before, self._number = self._number, number
        made = 0 if before is None else (number - before) % NUMBERS
        if made == 0 or made > self.rate_hz:  # more: its numbers began anew
            return []
        self.counts["lost"] += made - 1
        (stamp_ns,) = self._sample_clock.stamps_ns(now_ns, 1, made - 1)
        return [self._scale.sample(stamp_ns, (p, q, r), (x, y, z))]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("qmi8658", argv)


if __name__ == "__main__":
    sys.exit(main())
