"""One text line per sample, for your own microcontroller: ``docs/serial-imu.md`` describes it.

``time_us,gx,gy,gz,ax,ay,az`` in µs of the device's own clock, rad/s and m/s²; the time may be left out; ``,1`` at the
end of a line with time says that an axis was at the end of its range; ``*XX`` after all that is the exclusive or of the
characters before it, in two hexadecimal digits. Lines that begin with ``#`` are comments.
"""

import math
import re
import sys
from collections import Counter
from collections.abc import Sequence
from functools import reduce
from operator import xor

from drivers.imu.serial_frames import Reading
from drivers.imu.serial_imu import SerialProtocol, run_by_hand

MAX_LINE_BYTES = 200
TICK_HZ = 1e6
MAX_GYRO_RADPS = 70.0  # 4000 °/s; more is no IMU's
MAX_ACCEL_MPS2 = 320.0  # 32 g
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?"
LINE = re.compile(
    rf"(?:(?P<time>\d{{1,20}}),)?(?P<values>{NUMBER}(?:,{NUMBER}){{5}})(?(time)(?:,(?P<clipped>[01]))?)", re.ASCII
)


class CsvParser:
    """Parses lines; one that is damaged, too long or of another form than the one before it is refused.

    See ``Parser``; any line of printable characters is well formed. Data before the first end of line is skipped, as it
    may be part of a line.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.frames = 0
        self._rest = b""
        self._passing_over = True  # until the next end of a line
        self._form: object = None
        self._has_checksum = False
        self._lost = 0

    def feed(self, data: bytes) -> list[Reading]:
        """See ``Parser``."""
        *lines, rest = (self._rest + data).split(b"\n")
        readings = [reading for line in lines if (reading := self._line(line))]
        if len(rest) > MAX_LINE_BYTES and not self._passing_over:
            self._refuse()
            self._passing_over = True
        self._rest = b"" if self._passing_over else rest
        return readings

    def _line(self, line: bytes) -> Reading | None:
        if self._passing_over:
            self._passing_over = False
            return None
        if len(line) <= MAX_LINE_BYTES and (not line.strip() or line.lstrip().startswith(b"#")):
            return None
        reading = self._parsed(line.strip()) if len(line) <= MAX_LINE_BYTES else None
        if reading is None:
            self._refuse()
        return reading

    def _refuse(self) -> None:
        self.counts["bad_line"] += 1
        self._lost += 1

    def _parsed(self, line: bytes) -> Reading | None:
        body, star, checksum = line.partition(b"*")
        if star and checksum.upper() != b"%02X" % reduce(xor, body, 0):
            self.counts["bad_checksum"] += 1
            return None
        text = body.decode("ascii", "replace")
        self.frames += text.isascii() and text.isprintable()
        match = LINE.fullmatch(text.replace(" ", ""))
        if match is None or (self._has_checksum and not star):
            return None
        self._has_checksum = bool(star)
        form, self._form = self._form, (match["time"] is None, match["clipped"] is None)
        gx, gy, gz, ax, ay, az = map(float, match["values"].split(","))
        if form not in (None, self._form) or not _is_plausible((gx, gy, gz), (ax, ay, az)):
            return None
        ticks = int(match["time"]) if match["time"] else None
        reading = Reading((gx, gy, gz), (ax, ay, az), match["clipped"] == "1", self._lost, ticks)
        self._lost = 0
        return reading


def _is_plausible(gyro: tuple[float, ...], accel: tuple[float, ...]) -> bool:
    return max(map(math.fabs, gyro)) <= MAX_GYRO_RADPS and max(map(math.fabs, accel)) <= MAX_ACCEL_MPS2


PROTOCOL = SerialProtocol(
    name="csv",
    bauds=(115200, 9600, 57600, 230400, 460800, 921600),
    parser=CsvParser,
    needs="lines of time_us,gx,gy,gz,ax,ay,az",
    tick_hz=TICK_HZ,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the driver by hand."""
    return run_by_hand(PROTOCOL, argv)


if __name__ == "__main__":
    sys.exit(main())
