"""Xsens MTi (1, 10 and 100 series; the 600 series speaks the same) that send MTData2 messages over a serial port.

A message is 0xFA, bus 0xFF, MID 0x36, a length (0xFF: two more bytes of length), data, and a byte that makes the sum of
all after 0xFA a multiple of 256. The data are big-endian items of identifier, length, value; the low bits of an
identifier say the format. Source: Xsens "MT Low Level Communication Protocol Documentation" (MT0101P, revision 2019.A);
ETH's driver for ROS (ethzasl_xsens_driver, mtdef.py) agrees. Wanted are RateOfTurn and Acceleration in one message,
best with SampleTimeFine, PacketCounter and StatusWord. The IMU sends what was set with the maker's MT Manager; nothing
is written to it.
"""

import math
import struct
import sys
from collections import Counter
from collections.abc import Iterator, Sequence

from drivers.imu.serial_frames import Framer, Reading, Vector
from drivers.imu.serial_imu import SerialProtocol, run_by_hand

HEADER = b"\xfa\xff\x36"
EXTENDED = 0xFF
MAX_DATA_BYTES = 2048

PACKET_COUNTER = 0x1020
SAMPLE_TIME_FINE = 0x1060
ACCELERATION = 0x4020
RATE_OF_TURN = 0x8020
STATUS_WORD = 0xE020
TYPE_MASK = 0xFFF0
FORMAT_MASK = 0x0003  # 0 float32, 1 fixed 12.20, 2 fixed 16.32, 3 float64

SAMPLE_TIME_HZ = 10_000.0
SAMPLE_TIME_WRAPS = (2**32, 864_000_000)  # MTi-1 and 600 series; MTi-10 and 100 series: after a day
CLIPPED = 0x3F00  # StatusWord: an axis of the accelerometer (bits 8 to 10) or gyro (11 to 13) is out of range
MAX_GAP = 1000  # packets; more means that the counter began anew


class XsensParser:
    """Takes the inertial items out of MTData2 messages; see ``Parser``."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._framer = Framer(HEADER, _length, _is_whole, self.counts)
        self._packet: int | None = None
        self._lost = 0

    @property
    def frames(self) -> int:
        """See ``Parser``."""
        return self._framer.frames

    def feed(self, data: bytes) -> list[Reading]:
        """See ``Parser``."""
        return [reading for message in self._framer.feed(data) if (reading := self._take(message))]

    def _take(self, message: bytes) -> Reading | None:
        items = dict(_items(message))
        self._count_packet(items.get(PACKET_COUNTER))
        gyro, accel = (_vector(items.get(kind)) for kind in (RATE_OF_TURN, ACCELERATION))
        if gyro is None or accel is None:
            self.counts["incomplete"] += 1
            return None
        ticks = _unsigned(items.get(SAMPLE_TIME_FINE), 4)
        status = _unsigned(items.get(STATUS_WORD), 4) or 0
        reading = Reading(gyro, accel, bool(status & CLIPPED), self._lost, ticks)
        self._lost = 0
        return reading

    def _count_packet(self, item: tuple[int, bytes] | None) -> None:
        packet = _unsigned(item, 2)
        if packet is not None and self._packet is not None:
            missing = (packet - self._packet - 1) % 65536
            if 0 < missing <= MAX_GAP:
                self.counts["lost"] += missing
                self._lost += missing
        self._packet = packet


def _length(start: bytes) -> int:
    if len(start) < 4 or (start[3] == EXTENDED and len(start) < 6):
        return 0
    if start[3] != EXTENDED:
        return 4 + start[3] + 1
    data_bytes = int.from_bytes(start[4:6], "big")
    return 6 + data_bytes + 1 if EXTENDED <= data_bytes <= MAX_DATA_BYTES else -1


def _is_whole(message: bytes) -> bool:
    return sum(message[1:]) & 0xFF == 0


def _items(message: bytes) -> Iterator[tuple[int, tuple[int, bytes]]]:
    """Type, and format with value, of each item; stops where one would reach beyond the message."""
    at = 6 if message[3] == EXTENDED else 4
    end = len(message) - 1
    while at + 3 <= end:
        identifier, length = struct.unpack_from(">HB", message, at)
        at += 3 + length
        if at > end:
            return
        yield identifier & TYPE_MASK, (identifier & FORMAT_MASK, message[at - length : at])


def _unsigned(item: tuple[int, bytes] | None, length: int) -> int | None:
    if item is None or len(item[1]) != length:
        return None
    return int.from_bytes(item[1], "big")


def _vector(item: tuple[int, bytes] | None) -> Vector | None:
    """Three finite numbers, or None."""
    if item is None:
        return None
    form, value = item
    if len(value) != 3 * (4, 4, 6, 8)[form]:
        return None
    if form == 0:
        x, y, z = struct.unpack(">3f", value)
    elif form == 1:
        x, y, z = (number / 2**20 for number in struct.unpack(">3i", value))
    elif form == 2:  # the 32 bits after the point come first
        after_x, whole_x, after_y, whole_y, after_z, whole_z = struct.unpack(">IhIhIh", value)
        x, y, z = whole_x + after_x / 2**32, whole_y + after_y / 2**32, whole_z + after_z / 2**32
    else:
        x, y, z = struct.unpack(">3d", value)
    return (x, y, z) if math.isfinite(x) and math.isfinite(y) and math.isfinite(z) else None


PROTOCOL = SerialProtocol(
    name="xsens",
    bauds=(115200, 230400, 460800, 921600, 2_000_000),
    parser=XsensParser,
    needs="RateOfTurn and Acceleration in one message",
    tick_hz=SAMPLE_TIME_HZ,
    wraps=SAMPLE_TIME_WRAPS,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the driver by hand."""
    return run_by_hand(PROTOCOL, argv)


if __name__ == "__main__":
    sys.exit(main())
