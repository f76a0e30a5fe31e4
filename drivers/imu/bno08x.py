"""CEVA BNO080, BNO085 and BNO086 over I2C, with the rates of its gyro (UART-RVC gives angles only).

The protocol is in ``shtp``, with its sources; the transfers follow Adafruit's CircuitPython driver: first the header of
the next packet, then the whole packet, with its header again. The chip stretches the clock, which some masters do not
support (Raspberry Pi): they read wrong bits. So a header counts only if it is read twice the same, and a report only
within its range; a software bus (i2c-gpio) or the UART is better. The chip queues its packets, so it is polled about 60
times a second. While it boots it acknowledges nothing; it is never reset.
"""

import math
import sys
from collections.abc import Sequence
from contextlib import suppress

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import DeviceMissingError, DeviceStalledError, DriverError, UnsupportedSettingError
from drivers.imu.i2c_bus import NO_ANSWER, I2cBus, TransferError
from drivers.imu.i2c_chips import run_by_hand
from drivers.imu.i2c_imu import Range
from drivers.imu.serial_frames import Reading
from drivers.imu.settings import DEFAULT_SETTINGS, ImuSettings
from drivers.imu.shtp import CONTINUED, HEADER, RADPS_PER_UNIT, Hub, is_plausible
from drivers.sample_clock import SampleClock
from drivers.samples import ImuSample

BOOT_S = 0.5  # from the supply's coming up, 0.2 as a rule
BOOT_LOOK_S = 0.05
MAX_PACKETS = 64  # in one go
BATCH_S = 0.015
GOLDEN = 0.618  # of a period: polls come at varying phases, some of them right after a sample
STALL_S = 2.0

GYRO_RANGES = dict.fromkeys((250, 500, 1000, 2000), Range(0, math.radians(1) / RADPS_PER_UNIT))  # it has but one
ACCEL_RANGES = dict.fromkeys((2, 4, 8), Range(0, 9.80665 * 2**8))


class Bno08x:
    """A ``Device[ImuSample]``; owns the bus. ``rate_hz``: what was granted.

    Raises ``DeviceMissingError`` when no device answers at the address, ``UnsupportedSettingError`` for a range that it
    does not have, ``DeviceLostError`` when the bus fails; ``read`` also ``DeviceStalledError``.
    """

    chip = "BNO08x"
    addresses = (0x4A, 0x4B)
    gyro_ranges = GYRO_RANGES
    accel_ranges = ACCEL_RANGES

    def __init__(
        self, bus: I2cBus, address: int = 0, settings: ImuSettings = DEFAULT_SETTINGS, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        self.address = address or self.addresses[0]
        self.name = f"{self.chip} at 0x{self.address:02x} on {bus.path}"
        self.counts = bus.counts
        self._bus = bus
        self._clock = clock
        self._hub = Hub(settings.rate_hz, bus.counts)
        self._stamps: SampleClock | None = None
        self._heard = False
        self._phase = 0.0
        try:
            if settings.accel_range_g not in ACCEL_RANGES:
                offered = ", ".join(map(str, ACCEL_RANGES))
                raise UnsupportedSettingError(
                    f"{self.name}: has no range {settings.accel_range_g}; set imu.accel_range_g to one of {offered}"
                )
            self._meet()
        except DriverError:
            self.close()
            raise
        self._heard_ns = self._polled_ns = self._answered_ns = clock.monotonic_ns()

    @classmethod
    def recognised(cls, bus: I2cBus, address: int) -> str | None:
        """Return the model at an address; None: no such chip, or a silent one. Writes nothing."""
        header = bus.receive(address, HEADER.size, tries=2)
        return cls.chip if is_plausible(header) and bus.receive(address, HEADER.size, tries=2) == header else None

    @property
    def rate_hz(self) -> float:
        """The rate that the hub granted."""
        return self._hub.rate_hz

    def read(self) -> Sequence[ImuSample]:
        """See ``Device``."""
        self._wait()
        self._say()
        try:
            readings = self._listen()
            self._answered_ns = self._clock.monotonic_ns()
        except TransferError as error:
            silent_s = (self._clock.monotonic_ns() - self._answered_ns) / 1e9
            if error.number not in NO_ANSWER or silent_s > BOOT_S:
                raise
            readings = []  # it may boot
        now_ns = self._clock.monotonic_ns()
        if not readings:
            if now_ns - self._heard_ns > STALL_S * 1e9:
                raise DeviceStalledError(f"{self.name}: answers, but has no samples; switch its supply off and on")
            return []
        self._heard, self._heard_ns = True, now_ns
        if self._stamps is None:
            self._stamps = SampleClock(self._hub.rate_hz)
        stamps_ns = self._stamps.stamps_of_steps_ns(now_ns, [reading.lost + 1 for reading in readings])
        return [
            ImuSample(stamp_ns, reading.gyro, reading.accel, reading.saturated)
            for stamp_ns, reading in zip(stamps_ns, readings, strict=True)
        ]

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()

    def _meet(self) -> None:
        """Wait until it acknowledges its address. Raises ``DeviceMissingError``."""
        end_ns = self._clock.monotonic_ns() + round(BOOT_S * 1e9)
        while True:
            try:
                self._bus.receive(self.address, HEADER.size, tries=1)
            except TransferError as error:
                if error.number not in NO_ANSWER:
                    raise
                if self._clock.monotonic_ns() < end_ns:
                    self._clock.sleep_s(BOOT_LOOK_S)
                    continue
                there = ", ".join(f"0x{address:02x}" for address in self._bus.scan())
                none = "no device answers on this bus; check wiring"
                remedy = f"there is {there}; set imu.address" if there else none
                raise DeviceMissingError(
                    f"{self._bus.path}: no such chip at 0x{self.address:02x} ({self.chip}); {remedy}"
                ) from error
            return

    def _wait(self) -> None:
        period_s = 1 / self._hub.rate_hz
        self._phase = (self._phase + GOLDEN) % 1.0
        pause_s = max(BATCH_S, period_s) - period_s / 2 + self._phase * period_s
        self._clock.sleep_s(pause_s - (self._clock.monotonic_ns() - self._polled_ns) / 1e9)
        self._polled_ns = self._clock.monotonic_ns()

    def _say(self) -> None:
        for packet in self._hub.to_say(self._clock.monotonic_ns(), heard=self._heard):
            with suppress(TransferError):  # while it boots; sent again
                self._bus.send(self.address, packet, tries=2)
        self._heard = False

    def _listen(self) -> list[Reading]:
        readings: list[Reading] = []
        for _ in range(MAX_PACKETS):
            packet = self._packet()
            if packet is None:
                break
            readings += self._hub.take(packet)
        return readings

    def _packet(self) -> bytes | None:
        """Return the next packet; None: none, or malformed. Raises ``TransferError``."""
        header = self._bus.receive(self.address, HEADER.size)
        length = HEADER.unpack(header)[0] & ~CONTINUED
        if length == 0:
            return None
        if not is_plausible(header):
            self.counts["implausible"] += 1
            return None
        packet = self._bus.receive(self.address, length, tries=1)
        if HEADER.unpack_from(packet)[0] & ~CONTINUED != length or packet[2] != header[2]:
            self.counts["implausible"] += 1
            return None
        return packet


def main(argv: Sequence[str] | None = None) -> int:
    """Run the chip by hand."""
    return run_by_hand("bno08x", argv)


if __name__ == "__main__":
    sys.exit(main())
