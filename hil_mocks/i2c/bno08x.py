"""BNO08x behind its I2C: a hub that talks SHTP (1000-3535) and SH-2 (1000-3625), without registers."""

import struct
from collections import deque
from collections.abc import Mapping
from typing import ClassVar

from drivers.clock import Clock
from hil_mocks.i2c.chip import SimulatedChip, counts
from hil_mocks.i2c.motion import Motion, Vector

ANNOUNCEMENT = bytes(276 - 4)
ACCELEROMETER, GYRO = 1, 2
FASTEST_US = {ACCELEROMETER: 2000, GYRO: 2500}
MAX_PACKETS = 200  # in its queue


class Bno08x(SimulatedChip):
    """It identifies itself after booting, and then sends nothing until a sensor is enabled.

    A partially read packet is repeated, marked as a continuation.
    """

    address = 0x4A
    power_on: ClassVar[Mapping[int, int]] = {}
    boot_ns = 200_000_000

    def __init__(self, motion: Motion, clock: Clock, rate_error: float = 0.0, celsius: float = 31.5) -> None:
        super().__init__(motion, clock, rate_error, celsius)
        self._boots_until_ns = 0  # it was switched on long ago

    def power_up(self) -> None:
        """Disables all sensors, and boots."""
        self.intervals_us: dict[int, int] = {}
        self._numbers = [0] * 6
        self._report_numbers = {ACCELEROMETER: 0, GYRO: 0}
        self._packets: deque[tuple[int, bytes]] = deque(maxlen=MAX_PACKETS)
        self._read_bytes = 0  # of the first packet's cargo
        super().power_up()
        self._boots_until_ns = self._clock.monotonic_ns() + self.boot_ns
        self._packets += [(0, ANNOUNCEMENT), (1, b"\x01"), (2, b"\xf1" + bytes(15))]

    def rate_hz(self) -> float:
        """The gyro's rate; 0 until both sensors are enabled."""
        return 1e6 / self.intervals_us[GYRO] if len(self.intervals_us) == len(FASTEST_US) else 0.0

    def pack(self, gyro: Vector, accel: Vector) -> Mapping[int, bytes]:
        """The values of the two reports, Q8 m/s² and Q9 rad/s, kept where other chips have registers."""
        values = struct.Struct("<3h")
        return {
            0x00: values.pack(*counts(accel, 1.0, 2**8, most=20_083)),
            0x10: values.pack(*counts(gyro, 1.0, 2**9, most=17_872)),
        }

    def push(self, packed: Mapping[int, bytes]) -> None:
        """A packet with the base of time and both reports."""
        reports = b"".join(self._report(sensor, packed[at]) for sensor, at in ((ACCELEROMETER, 0x00), (GYRO, 0x10)))
        self._packets.append((3, b"\xfb" + bytes(4) + reports))

    def clear_fifo(self) -> None:
        """Do nothing: it has a queue of packets instead."""

    def receive(self, length: int) -> bytes:
        """Return bytes of the next packet; zeros if there is none."""
        self._refuse_while_booting()
        self._catch_up()
        if not self._packets:
            return bytes(length)
        channel, cargo = self._packets[0]
        left = cargo[self._read_bytes :]
        size = len(left) + 4 | (0x8000 if self._read_bytes else 0)
        data = struct.pack("<HBB", size, channel, self._numbers[channel])[:length] + left[: max(length - 4, 0)]
        self._read_bytes += max(min(length - 4, len(left)), 0)
        if self._read_bytes == len(cargo):
            self._packets.popleft()
            self._numbers[channel] = (self._numbers[channel] + 1) % 256
            self._read_bytes = 0
        return data.ljust(length, b"\0")

    def send(self, data: bytes) -> bytes:
        """A packet of the host's. Return nothing."""
        self._refuse_while_booting()
        self._catch_up()
        _, channel, _ = struct.unpack_from("<HBB", data)
        if channel == 2 and data[4] == 0xFD and data[5] in FASTEST_US:
            sensor, interval_us = data[5], max(struct.unpack_from("<I", data, 9)[0], FASTEST_US[data[5]])
            self.intervals_us[sensor] = interval_us
            self._packets.append((2, struct.pack("<BBBHIII", 0xFC, sensor, 0, 0, interval_us, 0, 0)))
        self._catch_up()
        return b""

    def _report(self, sensor: int, values: bytes) -> bytes:
        number = self._report_numbers[sensor]
        self._report_numbers[sensor] = (number + 1) % 256
        return bytes([sensor, number, 3, 0]) + values
