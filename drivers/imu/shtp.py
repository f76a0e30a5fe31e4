"""The protocol of a BNO08x, over any transport: SHTP packets with SH-2 messages.

CEVA "Sensor Hub Transport Protocol" (1000-3535), "SH-2 Reference Manual" (1000-3625) and "BNO08X Data Sheet"
(1000-3927); Adafruit's CircuitPython driver agrees. A packet is its length with these four bytes (little-endian, the
top bit: a continuation), channel, number, cargo. The hub sends nothing until a sensor is enabled, which it forgets when
it resets itself, and then announces that. Accelerometer and gyro send separate reports, each with its own numbers.
"""

import struct
from collections import Counter
from collections.abc import Iterator

from drivers.imu.serial_frames import Reading, Vector

HEADER = struct.Struct("<HBB")  # length, channel, number
CONTINUED = 0x8000
COMMAND, EXECUTABLE, CONTROL, REPORTS = 0, 1, 2, 3  # channels
CHANNELS = 6
MAX_PACKET_BYTES = 1024  # the longest, what it announces itself with, has some 280

RESET_COMPLETE = 1  # on EXECUTABLE
SET_FEATURE = struct.Struct("<BBBHIII")  # 0xFD, sensor, flags, sensitivity, interval µs, batch µs, configuration
SET_FEATURE_ID = 0xFD
FEATURE_RESPONSE_ID = 0xFC  # the same fields
ACCELEROMETER, GYRO = 0x01, 0x02  # calibrated; id, number, status, delay, three int16
REPORT = struct.Struct("<BBBB3h")
REPORT_BYTES = {ACCELEROMETER: 10, GYRO: 10, 0xFB: 5, 0xFA: 5}  # the last two: times

MPS2_PER_UNIT = 2.0**-8
RADPS_PER_UNIT = 2.0**-9
CLIPPED_ACCEL, MAX_ACCEL = 19_900, 21_000  # units; 8 g, less and more the offset that the hub takes off
CLIPPED_GYRO, MAX_GYRO = 17_700, 18_500  # 2000 °/s
FASTEST_HZ = 400.0
PATIENCE_NS = 700_000_000  # without a sample; then it is asked once more


class Hub:
    """The state of one connection: packets in, readings and replies out. Independent of transport and clock.

    Counts ``implausible`` reports, ``lost`` ones, and each ``chip_reset``. ``rate_hz``: as granted by the hub, once
    known.
    """

    def __init__(self, rate_hz: float, counts: Counter[str]) -> None:
        self._counts = counts
        self.packets = 0
        self.rate_hz = min(rate_hz, FASTEST_HZ)
        self._interval_us = round(1e6 / self.rate_hz)
        self._numbers = [0] * CHANNELS  # of the next packet that is sent
        self._accel: tuple[int, int, int] | None = None
        self._gyro_number: int | None = None
        self._ask_at_ns: int | None = None  # at once

    def take(self, packet: bytes) -> list[Reading]:
        """Take a whole packet from the hub."""
        self.packets += 1
        _, channel, _ = HEADER.unpack_from(packet)
        cargo = packet[HEADER.size :]
        if channel == EXECUTABLE and cargo[:1] == bytes([RESET_COMPLETE]):
            self._counts["chip_reset"] += self._gyro_number is not None  # else it was just switched on
            self._accel = self._gyro_number = self._ask_at_ns = None
        elif channel == CONTROL and cargo[:2] == bytes([FEATURE_RESPONSE_ID, GYRO]) and len(cargo) >= SET_FEATURE.size:
            interval_us = SET_FEATURE.unpack_from(cargo)[4]
            self.rate_hz = 1e6 / interval_us if 1000 <= interval_us <= 1_000_000 else self.rate_hz
        elif channel == REPORTS:
            return list(self._readings(cargo))
        return []

    def to_say(self, now_ns: int, *, heard: bool) -> list[bytes]:
        """Return the packets to send now. ``heard``: there was a sample since the last call."""
        if heard and self._ask_at_ns is not None:
            self._ask_at_ns = now_ns + PATIENCE_NS
        if self._ask_at_ns is not None and now_ns < self._ask_at_ns:
            return []
        self._ask_at_ns = now_ns + PATIENCE_NS
        return [self._set_feature(sensor) for sensor in (ACCELEROMETER, GYRO)]

    def _set_feature(self, sensor: int) -> bytes:
        number = self._numbers[CONTROL]
        self._numbers[CONTROL] = (number + 1) % 256
        cargo = SET_FEATURE.pack(SET_FEATURE_ID, sensor, 0, 0, self._interval_us, 0, 0)
        return HEADER.pack(HEADER.size + len(cargo), CONTROL, number) + cargo

    def _readings(self, cargo: bytes) -> Iterator[Reading]:
        at = 0
        while at < len(cargo):
            length = REPORT_BYTES.get(cargo[at], 0)
            if not length or at + length > len(cargo):
                self._counts["implausible"] += 1
                return
            if cargo[at] in (ACCELEROMETER, GYRO):
                sensor, number, _, _, x, y, z = REPORT.unpack_from(cargo, at)
                most = MAX_GYRO if sensor == GYRO else MAX_ACCEL
                if max(abs(x), abs(y), abs(z)) > most:
                    self._counts["implausible"] += 1
                elif sensor == ACCELEROMETER:
                    self._accel = (x, y, z)
                elif self._accel is not None:
                    yield self._reading(number, (x, y, z), self._accel)
            at += length

    def _reading(self, number: int, gyro: tuple[int, int, int], accel: tuple[int, int, int]) -> Reading:
        lost = 0 if self._gyro_number is None else (number - self._gyro_number - 1) % 256
        self._gyro_number = number
        self._counts["lost"] += lost
        clipped = max(map(abs, gyro)) >= CLIPPED_GYRO or max(map(abs, accel)) >= CLIPPED_ACCEL
        return Reading(_scaled(gyro, RADPS_PER_UNIT), _scaled(accel, MPS2_PER_UNIT), clipped, lost)


def is_plausible(header: bytes) -> bool:
    """Whether a packet can begin with this header."""
    length: int
    channel: int
    length, channel, _ = HEADER.unpack_from(header)
    return HEADER.size < length & ~CONTINUED <= MAX_PACKET_BYTES and channel < CHANNELS


def _scaled(raw: tuple[int, int, int], unit: float) -> Vector:
    return raw[0] * unit, raw[1] * unit, raw[2] * unit
