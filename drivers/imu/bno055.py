"""Bosch BNO055 in its fusion mode IMU, the one in which data sheet and chip agree on the gyro's scale.

BNO055 data sheet, BST-BNO055-DS000-14 revision 1.4; Linux (bno055.c) agrees on registers, times and weights. In the
modes without fusion the gyro's counts follow the range (2^15 counts, as the Linux driver found), not the 16 counts for
1 °/s of table 3-22. Fusion means 100 Hz, 4 g and 2000 °/s, whatever is asked, and a gyro whose bias the chip takes out.

There is no FIFO: the registers are polled, and repeated values are dropped. The chip stretches the clock; bus masters
that do not support that (Raspberry Pi) read bytes with a flipped top bit. So a jump counts only if two reads agree; a
software bus (i2c-gpio) or a slower clock avoids the problem.

A reset takes 650 ms, in which the chip acknowledges nothing, often not even the reset itself. So at start it is not
reset but switched to CONFIG, the mode in which it takes settings; only a system error requires a reset.
"""

import struct
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress

from drivers.errors import DeviceLostError
from drivers.imu.i2c_bus import TransferError
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Counts, I2cImu, Range, Thermometer
from drivers.samples import ImuSample

CHIP_ID = 0x00
PAGE_ID = 0x07
ACC_DATA = 0x08  # then magnetometer, then gyro
TEMP = 0x34
SYS_STATUS = 0x39
UNIT_SEL = 0x3B
OPR_MODE = 0x3D  # 3:0
PWR_MODE = 0x3E
SYS_TRIGGER = 0x3F
AXIS_MAP_CONFIG = 0x41
AXIS_MAP_SIGN = 0x42

RESET = 0x20  # SYS_TRIGGER
SI_AND_DEGREES = 0x00  # UNIT_SEL: m/s², °/s, °C
CONFIG_MODE = 0x00  # OPR_MODE
IMU_MODE = 0x08
CHIP_AXES = 0x24  # AXIS_MAP_CONFIG: x, y, z as they are
SYSTEM_ERROR = 1  # SYS_STATUS
BOOT_S = 0.65  # from a reset until it is in CONFIG
MAX_BOOT_S = 1.0
BOOT_LOOK_S = 0.05
TO_CONFIG_S = 0.02  # 19 ms from any mode
SWITCH_S = 0.03  # to a mode with fusion

RATE_HZ = 100.0
DATA = struct.Struct("<3h6x3h")
GYRO_RANGE = Range(0, 16.0, end=32000)
ACCEL_RANGE = Range(0, 980.665, end=3922)  # 100 counts for 1 m/s²
READS = 3  # of one sample, until two agree
JUMP = 100  # counts from one sample to the next, 6 °/s or 1 m/s²; the flips are of 128 and of 32768

PERIOD_NS = round(1e9 / RATE_HZ)
CLOSELY_S = 0.125 / RATE_HZ  # between polls for the first sample after a gap
POLL_S = 0.618 / RATE_HZ  # sees every sample, at varying delays
MAX_REPEAT_NS = 30_000_000  # then a repeated value counts as a sample: at perfect rest

IDENTITIES = {0xA0: "BNO055"}
GYRO_RANGES = dict.fromkeys((250, 500, 1000, 2000), GYRO_RANGE)
ACCEL_RANGES = dict.fromkeys((2, 4), ACCEL_RANGE)


class Bno055(I2cImu):
    """BNO055; see ``I2cImu``. ``counts["implausible"]``: reads that were refused."""

    chip = "BNO055"
    addresses = (0x28, 0x29)
    identity_register = CHIP_ID
    identities = IDENTITIES
    gyro_ranges = GYRO_RANGES
    accel_ranges = ACCEL_RANGES
    thermometer = Thermometer(TEMP, "little", lsb_per_c=1, zero_c=0.0, size=1)

    def _granted_rate_hz(self, rate_hz: float) -> float:  # noqa: ARG002
        return RATE_HZ

    def _registers(self, gyro_code: int, accel_code: int) -> Mapping[int, int]:  # noqa: ARG002
        return {
            PAGE_ID: 0,
            PWR_MODE: 0,
            UNIT_SEL: SI_AND_DEGREES,
            AXIS_MAP_CONFIG: CHIP_AXES,
            AXIS_MAP_SIGN: 0,
        }

    def _reset(self) -> None:
        self._write(PAGE_ID, 0)
        if self._read(SYS_STATUS, 1)[0] == SYSTEM_ERROR:
            self._reboot()
        self._write(OPR_MODE, CONFIG_MODE)
        self._clock.sleep_s(TO_CONFIG_S)

    def _reboot(self) -> None:
        """Reset the chip and wait until it identifies itself. Raises ``DeviceLostError``."""
        self._command_reset(SYS_TRIGGER, RESET)
        end_ns = self._clock.monotonic_ns() + round(MAX_BOOT_S * 1e9)
        self._clock.sleep_s(BOOT_S)
        while self._clock.monotonic_ns() < end_ns:
            with suppress(TransferError):
                if self._read(CHIP_ID, 1, tries=1)[0] in self.identities:
                    return
            self._clock.sleep_s(BOOT_LOOK_S)
        raise DeviceLostError(f"{self.name}: does not come back from a reset; switch its supply off and on")

    def _begin(self) -> None:
        self._write(OPR_MODE, IMU_MODE)
        self._clock.sleep_s(SWITCH_S)
        self._believed: tuple[int, ...] = ()
        self._newest_ns = self._changed_ns = self._polled_ns = self._clock.monotonic_ns()
        self._unsure = True  # how many samples there were since the newest

    def _settings_hold(self) -> bool:
        in_mode = self._read(OPR_MODE, 1)[0] & 0x0F == IMU_MODE
        return in_mode and self._read(SYS_STATUS, 1)[0] != SYSTEM_ERROR and super()._settings_hold()

    def _wait(self) -> None:
        pause_s = CLOSELY_S if self._unsure else POLL_S
        self._clock.sleep_s(pause_s - (self._clock.monotonic_ns() - self._polled_ns) / 1e9)

    def _samples(self) -> list[ImuSample]:
        late_ns, self._polled_ns = self._polled_ns + PERIOD_NS, self._clock.monotonic_ns()
        counts = self._believable()
        now_ns = self._clock.monotonic_ns()
        if not any(counts):  # refused, or the chip does not run
            self._unsure = True
            return []
        if self._polled_ns > late_ns and not self._unsure:  # unknown which of the missed samples this is
            self._unsure = True
            self._believed, self._changed_ns = counts, now_ns
            return []
        if counts == self._believed:
            if now_ns - self._changed_ns < MAX_REPEAT_NS:
                return []
            self._unsure = True
        made = round((now_ns - self._newest_ns) / 1e9 * self._sample_clock.rate_hz) if self._unsure else 1
        self._unsure = False
        self._believed, self._changed_ns = counts, now_ns
        (self._newest_ns,) = self._sample_clock.stamps_ns(now_ns, 1, max(made - 1, 0))
        return [self._scale.sample(self._newest_ns, *_halves(counts))]

    def _believable(self) -> tuple[int, ...]:
        """Return accelerometer and gyro; nothing if the reads contradict each other and the last sample."""
        before = self._believed
        for refused in range(READS):
            counts = self._poll()
            if _close(counts, self._believed):
                if refused:
                    self.counts["implausible"] += refused
                return counts
            if _close(counts, before):
                return counts  # it did jump
            before = counts
        self.counts["implausible"] += READS
        return ()

    def _poll(self) -> tuple[int, ...]:
        return DATA.unpack(self._read(ACC_DATA, DATA.size))


def _close(counts: tuple[int, ...], others: tuple[int, ...]) -> bool:
    """Whether one can follow the other."""
    return bool(others) and all(abs(one - other) < JUMP for one, other in zip(counts, others, strict=True))


def _halves(counts: tuple[int, ...]) -> tuple[Counts, Counts]:
    """Gyro and accelerometer."""
    a, b, c, x, y, z = counts
    return (x, y, z), (a, b, c)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("bno055", argv)


if __name__ == "__main__":
    sys.exit(main())
