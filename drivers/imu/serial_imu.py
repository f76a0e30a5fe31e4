"""A free-running IMU at a serial port: port, parser and sample clock together."""

import argparse
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from drivers.allowance import Allowance
from drivers.by_hand import describe_imu, positive, watch
from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.device import Device
from drivers.errors import DeviceLostError, DeviceStalledError, WrongDeviceError
from drivers.imu import registry
from drivers.imu.serial_frames import Parser, Reading, Talker
from drivers.imu.serial_port import SerialPort
from drivers.imu.settings import ImuSettings
from drivers.sample_clock import SampleClock
from drivers.samples import ImuSample

FIRST_BYTE_S = 4.0  # many boards reset when their port is opened
STALLED_S = 1.0
MAX_NOISE_BYTES = 4096  # without a reading: another baud rate, or another device
FRAMES_BY_CHANCE = 3  # that noise can imitate
TICKS = 2**32  # after which the counters of most devices wrap
MAX_PAUSE_S = 1.0  # of the device's own clock; more means that it restarted
MAX_BYTES_PER_S = 200_000  # 2000 lines of 100 bytes, over USB at any baud rate
MAX_LINE_SHARE = 1.25 / 10  # bytes per second and baud, of faster lines
MAX_SAMPLES_PER_S = 2500  # the fastest IMUs send 2000
MAX_READS_PER_S = 1000  # then several pieces are read at once
EXCESS_PAUSE_S = 0.01  # meanwhile the kernel buffers 4096 bytes or more


@dataclass(frozen=True, slots=True)
class SerialProtocol:
    """The protocol of a family of IMUs. ``bauds``: those in use, the default first."""

    name: str
    bauds: tuple[int, ...]
    parser: Callable[[], Parser]
    needs: str  # what must be switched on in the IMU, for the user
    rate_hz: float | None = None  # where it is fixed
    tick_hz: float | None = None  # of the device's own clock, where readings may carry its time
    wraps: tuple[int, ...] = (TICKS,)  # ticks after which that wraps to 0, by series
    byte_pause_s: float = 0.0  # that the IMU needs between the bytes sent to it


class SerialImu:
    """A ``Device[ImuSample]``. Rate and ranges are those set in the IMU itself; nothing is written but to a ``Talker``.

    Raises what ``SerialPort`` raises; ``read`` also ``DeviceStalledError``, and ``WrongDeviceError`` when there are
    bytes but no readings. Counts what the parser refuses, ``restarted`` when the device's clock began anew, and
    ``excess_bytes`` and ``excess_samples``: dropped, since no IMU sends so much (``MAX_BYTES_PER_S``,
    ``MAX_SAMPLES_PER_S``).
    """

    def __init__(
        self, protocol: SerialProtocol, port: str, baud: int = 0, rate_hz: float = 200.0, clock: Clock = SYSTEM_CLOCK
    ) -> None:
        self.name = f"{protocol.name} at {port}"
        self._protocol = protocol
        self._clock = clock
        self._parser = protocol.parser()
        self._talker = self._parser if isinstance(self._parser, Talker) else None
        self.counts: Counter[str] = self._parser.counts
        self._rate_hz = protocol.rate_hz or rate_hz
        self._stamps: SampleClock | None = None
        self._unit_hz = self._rate_hz  # what the clock counts: samples, or ticks of the device's own clock
        self._ticks: int | None = None
        self._noise_bytes = 0
        self._frames = 0  # when there last was a reading
        self._port = SerialPort(port, baud or protocol.bauds[0])
        self._reads = Allowance(MAX_READS_PER_S)
        self._bytes = Allowance(max(MAX_BYTES_PER_S, MAX_LINE_SHARE * self._port.baud))
        self._samples = Allowance(MAX_SAMPLES_PER_S)
        self._passed_over = 0  # samples since the last that was within the allowance
        self._heard_ns = clock.monotonic_ns()
        self._patience_s = FIRST_BYTE_S
        try:
            self._say()
        except DeviceLostError:
            self.close()
            raise

    def read(self) -> list[ImuSample]:
        """See ``Device``."""
        self._say()
        data = self._port.read()
        now_ns = self._clock.monotonic_ns()
        if not data:
            self._complain_of_silence(now_ns)
            return []
        self._heard_ns = now_ns
        self._patience_s = STALLED_S
        data = self._slowed(data, now_ns)
        readings = self._parser.feed(data)
        if not readings:
            self._complain_of_noise(len(data))
            return []
        self._noise_bytes = 0
        self._frames = self._parser.frames
        readings = self._newest(readings, now_ns)
        stamps_ns = self._stamps_ns(now_ns, readings)
        return [self._sample(reading, stamp_ns) for reading, stamp_ns in zip(readings, stamps_ns, strict=True)]

    def close(self) -> None:
        """See ``Device``."""
        self._port.close()

    def _slowed(self, data: bytes, now_ns: int) -> bytes:
        """Return the data within the allowance; pause where there was more, so that the pipeline gets its turn."""
        within = self._bytes.take(len(data), now_ns)
        if within < len(data):
            self.counts["excess_bytes"] += len(data) - within
            self._clock.sleep_s(EXCESS_PAUSE_S)
        elif not self._reads.take(1, now_ns):
            self._clock.sleep_s(1 / MAX_READS_PER_S)
            self._reads.take(1, self._clock.monotonic_ns())
        return data[:within]

    def _newest(self, readings: Sequence[Reading], now_ns: int) -> list[Reading]:
        """Return as many readings as the allowance permits; the first of them counts those skipped."""
        within = self._samples.take(len(readings), now_ns)
        excess, kept = readings[: len(readings) - within], list(readings[len(readings) - within :])
        if excess:
            self.counts["excess_samples"] += len(excess)
            self._passed_over += sum(reading.lost + 1 for reading in excess)
        if kept and self._passed_over:
            kept[0] = replace(kept[0], lost=kept[0].lost + self._passed_over)
            self._passed_over = 0
        return kept

    def _say(self) -> None:
        if self._talker is not None:
            for data in self._talker.to_say(self._rate_hz, self._clock.monotonic_ns()):
                self._port.write(data, self._protocol.byte_pause_s, self._clock)

    def _complain_of_silence(self, now_ns: int) -> None:
        silent_s = (now_ns - self._heard_ns) / 1e9
        if silent_s > self._patience_s:
            raise DeviceStalledError(
                f"{self.name}: silent for {silent_s:.1f} s; check its power and wiring, and that it sends by itself"
            )

    def _complain_of_noise(self, count: int) -> None:
        self._noise_bytes += count
        if self._noise_bytes <= MAX_NOISE_BYTES:
            return
        if self._parser.frames - self._frames > FRAMES_BY_CHANCE:
            raise WrongDeviceError(f"{self.name}: frames, but no sample in them; make it send {self._protocol.needs}")
        default = ", ".join(map(str, self._protocol.bauds))
        raise WrongDeviceError(
            f"{self.name}: {self._noise_bytes} bytes at {self._port.baud} baud and no valid frame; "
            f"usual are {default}: set imu.baud, or imu.driver if it is another IMU"
        )

    def _stamps_ns(self, now_ns: int, readings: Sequence[Reading]) -> list[int]:
        if not readings:
            return []
        if self._stamps is None:  # the first reading shows whether the device sends its own time
            self._unit_hz = (self._protocol.tick_hz if readings[0].ticks is not None else None) or self._rate_hz
            self._stamps = SampleClock(self._unit_hz)
        steps = [self._step(reading) for reading in readings]
        if 0 in steps:
            self.counts["restarted"] += 1
            self._stamps.restart()
        step_by_rate = max(round(self._unit_hz / self._rate_hz), 1)
        return self._stamps.stamps_of_steps_ns(now_ns, [step or step_by_rate for step in steps])

    def _step(self, reading: Reading) -> int:
        """Return clock units since the last reading; 0: unknown, as the device's clock restarted."""
        if self._unit_hz != self._protocol.tick_hz or reading.ticks is None:
            return round((reading.lost + 1) * self._unit_hz / self._rate_hz)
        before, self._ticks = self._ticks, reading.ticks
        if before is None:
            return 1
        step = min((reading.ticks - before) % wrap for wrap in self._protocol.wraps)  # short with the right one
        return step if step <= MAX_PAUSE_S * self._unit_hz else 0

    def _sample(self, reading: Reading, stamp_ns: int) -> ImuSample:
        gyro = reading.gyro
        if reading.spans and self._stamps:  # the device assumed its nominal period
            scale = self._stamps.rate_hz / self._rate_hz
            gyro = gyro[0] * scale, gyro[1] * scale, gyro[2] * scale
            stamp_ns -= round(reading.spans / self._stamps.rate_hz / 2 * 1e9)
        return ImuSample(stamp_ns, gyro, reading.accel, reading.saturated)


def open_port(
    driver: str, port: str, baud: int, settings: ImuSettings, clock: Clock = SYSTEM_CLOCK
) -> Device[ImuSample]:
    """Open the IMU at a serial port.

    ``driver``: a serial one of the registry. ``baud``: 0 for the protocol's default. ``settings``: only the rate is
    used, as the initial estimate; serial IMUs send as they were set up. Raises what ``SerialImu`` raises.
    """
    return SerialImu(registry.DRIVERS[driver].load(), port, baud, settings.rate_hz, clock)


def run_by_hand(protocol: SerialProtocol, argv: Sequence[str] | None) -> int:
    """Run the command line of a protocol: open a port, print its samples."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", default="/dev/ttyUSB0")
    parser.add_argument("--baud", type=int, default=0, help=f"0: {protocol.bauds[0]}")
    parser.add_argument("--rate", type=positive, default=ImuSettings().rate_hz, help="that was set in the IMU, Hz")
    parser.add_argument("--seconds", type=positive, default=10.0)
    arguments = parser.parse_args(argv)
    return watch(
        lambda: SerialImu(protocol, arguments.port, arguments.baud, arguments.rate), arguments.seconds, describe_imu
    )
