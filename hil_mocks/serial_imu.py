"""A serial IMU on a pseudo-terminal: the real driver opens it, and it fails as real ones do.

``SerialImuStandIn`` holds the terminal, speaks a protocol (``ENCODERS``) and plays a recording's samples. Its port is a
symbolic link that keeps its name while the terminal behind it changes with every replug, as /dev/serial/by-id does.
"""

import math
import os
import select
import struct
import termios
import threading
import tty
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Protocol

import numpy as np

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.imu import witmotion, xsens
from drivers.imu.bno08x_rvc import MPS2_PER_UNIT, RAD_PER_UNIT
from drivers.samples import ImuSample

Rotation = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
Fault = Callable[[bytes], bytes | None]
"""What a fault makes of a sample's bytes; None: the IMU is unplugged instead of sending it."""


class Encoder(Protocol):
    """An IMU that speaks a protocol: a sample in, its bytes out."""

    baud: int

    def __call__(self, sample: ImuSample) -> bytes:
        """The bytes of the next sample."""
        ...


class WitMotionEncoder:
    """Time, acceleration, angular velocity and angle frames, as a WT901 sends them by default."""

    baud = 115200

    def __call__(self, sample: ImuSample) -> bytes:
        """See ``Encoder``."""
        accel = [_int16(value / witmotion.MPS2_PER_UNIT) for value in sample.accel]
        gyro = [_int16(value / witmotion.RADPS_PER_UNIT) for value in sample.gyro]
        frames = [(0x50, (0, 0, 0, 0)), (0x51, (*accel, 2500)), (0x52, (*gyro, 2500)), (0x53, (0, 0, 0, 0))]
        return b"".join(_with_sum(struct.pack("<2B4h", 0x55, kind, *values), 0) for kind, values in frames)


class WitMotionBleEncoder:
    """Acceleration, angular velocity and angle in one frame, as a WT9011DCL sends them."""

    baud = 115200

    def __call__(self, sample: ImuSample) -> bytes:
        """See ``Encoder``."""
        accel = [_int16(value / witmotion.MPS2_PER_UNIT) for value in sample.accel]
        gyro = [_int16(value / witmotion.RADPS_PER_UNIT) for value in sample.gyro]
        return struct.pack("<2B9h", 0x55, 0x61, *accel, *gyro, 0, 0, 0)


class RvcEncoder:
    """Integrates the gyro's rates to an orientation, and sends it with the acceleration."""

    baud = 115200

    def __init__(self) -> None:
        self._turn: Rotation = np.eye(3)
        self._before: ImuSample | None = None
        self._number = 0

    def __call__(self, sample: ImuSample) -> bytes:
        """See ``Encoder``."""
        if self._before is not None:
            elapsed_s = (sample.stamp_ns - self._before.stamp_ns) / 1e9
            mean = (np.array(sample.gyro) + np.array(self._before.gyro)) / 2
            self._turn = self._turn @ _rotation(mean * elapsed_s)
        self._before = sample
        angles = [_int16(angle / RAD_PER_UNIT) for angle in yaw_pitch_roll(self._turn)]
        accel = [_int16(value / MPS2_PER_UNIT) for value in sample.accel]
        body = struct.pack("<B6h3x", self._number, *angles, *accel)
        self._number = (self._number + 1) % 256
        return _with_sum(b"\xaa\xaa" + body, 2)


class ShtpUartEncoder:
    """A BNO08x in UART-SHTP mode with its sensors enabled: time, accelerometer and gyro in one packet."""

    baud = 3_000_000

    def __init__(self) -> None:
        self._number = 0

    def __call__(self, sample: ImuSample) -> bytes:
        """See ``Encoder``."""
        accel = [_int16(value * 2**8) for value in sample.accel]
        gyro = [_int16(value * 2**9) for value in sample.gyro]
        cargo = b"\xfb" + bytes(4)
        for sensor, values in ((1, accel), (2, gyro)):
            cargo += struct.pack("<4B3h", sensor, self._number, 3, 0, *values)
        packet = shtp_packet(3, self._number, cargo)
        self._number = (self._number + 1) % 256
        return packet


def shtp_packet(channel: int, number: int, cargo: bytes) -> bytes:
    """A packet of a BNO08x in its frame."""
    packet = struct.pack("<HBB", len(cargo) + 4, channel, number) + cargo
    escaped = packet.replace(b"\x7d", b"\x7d\x5d").replace(b"\x7e", b"\x7d\x5e")
    return b"\x7e\x01" + escaped + b"\x7e"


class XsensEncoder:
    """MTData2 with packet counter, sample time, acceleration, rate of turn and status.

    ``form``: 0 float32, 1 fixed 12.20, 2 fixed 16.32, 3 float64. ``wrap``: after how many ticks of 0.1 ms the sample
    time goes on from 0; 864,000,000 in the MTi-10 and 100 series.
    """

    baud = 115200

    def __init__(self, form: int = 0, wrap: int = 2**32) -> None:
        self._form = form
        self._wrap = wrap
        self._packet = 0

    def __call__(self, sample: ImuSample) -> bytes:
        """See ``Encoder``."""
        ticks = sample.stamp_ns // 100_000 % self._wrap
        items = [
            (xsens.PACKET_COUNTER, struct.pack(">H", self._packet)),
            (xsens.SAMPLE_TIME_FINE, struct.pack(">I", ticks)),
            (xsens.ACCELERATION | self._form, self._numbers(sample.accel)),
            (xsens.RATE_OF_TURN | self._form, self._numbers(sample.gyro)),
            (xsens.STATUS_WORD, struct.pack(">I", 3 | sample.saturated << 12 | sample.saturated << 19)),
        ]
        self._packet = (self._packet + 1) % 65536
        return mtdata2(b"".join(struct.pack(">HB", kind, len(value)) + value for kind, value in items))

    def _numbers(self, values: Iterable[float]) -> bytes:
        if self._form == 0:
            return struct.pack(">3f", *values)
        if self._form == 1:
            return struct.pack(">3i", *(round(value * 2**20) for value in values))
        if self._form == 2:
            fixed = [round(value * 2**32) for value in values]
            return b"".join(struct.pack(">Ih", number & 0xFFFFFFFF, number >> 32) for number in fixed)
        return struct.pack(">3d", *values)


class CsvEncoder:
    """Lines with time and checksum, either of which can be left out."""

    baud = 115200

    def __init__(self, *, time: bool = True, checksum: bool = True) -> None:
        self._time = time
        self._checksum = checksum

    def __call__(self, sample: ImuSample) -> bytes:
        """See ``Encoder``."""
        fields = [f"{value:.6f}" for value in sample.gyro + sample.accel]
        if self._time:
            fields = [str(sample.stamp_ns // 1000 % 2**32), *fields, str(int(sample.saturated))]
        line = ",".join(fields).encode()
        return line + (b"*%02X" % reduce(xor, line, 0) if self._checksum else b"") + b"\r\n"


ENCODERS: dict[str, Callable[[], Encoder]] = {
    "witmotion": WitMotionEncoder,
    "witmotion_ble": WitMotionBleEncoder,
    "bno08x_rvc": RvcEncoder,
    "bno08x_uart": ShtpUartEncoder,
    "xsens": XsensEncoder,
    "csv": CsvEncoder,
}


class SerialImuStandIn:
    """Plugged in from the start; ``port`` is what the driver opens.

    ``link``: where the symbolic link is made; nothing may be there. ``faults``: what happens to the bytes of the sample
    with that number, counted over all plugging. Samples are sent by hand (``send``) or in true time (``play``).
    """

    def __init__(
        self, encoder: Encoder, samples: Iterable[ImuSample], link: Path, faults: Mapping[int, Fault] | None = None
    ) -> None:
        self.sent = 0  # samples, those that a fault swallowed included
        self._encoder = encoder
        self._samples = iter(samples)
        self._link = link
        self._faults = dict(faults or {})
        self._ends: tuple[int, int] | None = None
        self._hands = threading.RLock()  # a test may pull at what plays
        self._pulled_by_fault = False
        self._stop = threading.Event()
        self._player: threading.Thread | None = None
        self.plug()

    @property
    def port(self) -> str:
        """The path at which it appears when plugged in."""
        return str(self._link)

    def plug(self) -> None:
        """Appear, with a new terminal behind the old name."""
        with self._hands:
            self._pulled_by_fault = False
            if self._ends is None:
                self._ends = os.openpty()
                tty.setraw(self._ends[1])
                os.set_blocking(self._ends[0], False)
                self._link.symlink_to(os.ttyname(self._ends[1]))

    def unplug(self) -> None:
        """Hang up and vanish."""
        with self._hands:
            if self._ends is not None:
                ends, self._ends = self._ends, None
                self._link.unlink(missing_ok=True)
                for end in ends:
                    os.close(end)

    def send(self, count: int = 1) -> int:
        """Send the next samples. Return how many there were."""
        for done in range(count):
            sample = next(self._samples, None)
            if sample is None:
                return done
            self._send(sample)
        return count

    def send_bytes(self, data: bytes) -> None:
        """Send bytes as the device would at its own baud rate; if not read in time they are lost, as on a real line."""
        with self._hands, suppress(BlockingIOError):
            if self._ends is None:
                return
            master = self._ends[0]
            heard = heard_at(data, self._encoder.baud, _baud(master) or self._encoder.baud)
            while heard and select.select([], [master], [], 0.0)[1]:
                heard = heard[os.write(master, heard) :]

    def heard(self) -> bytes:
        """Return what the host has sent since the last call."""
        with self._hands, suppress(BlockingIOError):
            if self._ends is not None:
                return os.read(self._ends[0], 65536)
        return b""

    def play(self, clock: Clock = SYSTEM_CLOCK) -> None:
        """Send all samples at the times between their stamps, from a thread of its own, until ``close``."""
        self._player = threading.Thread(target=self._play, args=(clock,), name="serial IMU", daemon=True)
        self._player.start()

    def wait(self) -> None:
        """Wait until playing has ended."""
        if self._player is not None:
            self._player.join()

    def close(self) -> None:
        """Stop playing and vanish; may be called twice."""
        self._stop.set()
        self.wait()
        self.unplug()

    def _send(self, sample: ImuSample) -> None:
        data: bytes | None = self._encoder(sample)
        fault = self._faults.get(self.sent)
        if fault is not None and data is not None:
            data = fault(data)
        self.sent += 1
        if data is None:
            self.unplug()
            self._pulled_by_fault = True
        else:
            if self._pulled_by_fault:
                self.plug()
            self.send_bytes(data)

    def _play(self, clock: Clock) -> None:
        begun_ns = first_ns = None
        for sample in self._samples:
            now_ns = clock.monotonic_ns()
            if begun_ns is None or first_ns is None:
                begun_ns, first_ns = now_ns, sample.stamp_ns
            if self._stop.wait((begun_ns + sample.stamp_ns - first_ns - now_ns) / 1e9):
                return
            self._send(sample)


def garbage(count: int, seed: int = 0) -> Fault:
    """That many random bytes come before the sample."""
    return lambda data: np.random.default_rng(seed).bytes(count) + data


def flipped_bits(count: int = 1, seed: int = 0) -> Fault:
    """That many bits are flipped."""

    def flip(data: bytes) -> bytes:
        bits = np.unpackbits(np.frombuffer(data, np.uint8))
        bits[np.random.default_rng(seed).choice(len(bits), count, replace=False)] ^= 1
        return np.packbits(bits).tobytes()

    return flip


def cut_short(share: float = 0.5) -> Fault:
    """Only the beginning of the sample arrives."""
    return lambda data: data[: int(len(data) * share)]


def silent(_: bytes) -> bytes:
    """Nothing arrives."""
    return b""


def unplugged(_: bytes) -> None:
    """The IMU is unplugged; the first sample without this fault plugs it in again."""


def heard_at(data: bytes, sent_baud: int, read_baud: int) -> bytes:
    """Return the bytes that a receiver at ``read_baud`` gets of those sent at ``sent_baud``, 8N1 without pauses.

    The line is sampled in the middle of each bit that the receiver expects, as a UART does; a missing stop bit is not
    reported, as by Linux.
    """
    if sent_baud == read_baud or not data:
        return data
    bits = np.unpackbits(np.frombuffer(data, np.uint8)[:, None], axis=1, bitorder="little")
    line = np.pad(bits, ((0, 0), (1, 1)), constant_values=((0, 0), (0, 1))).ravel()
    line = np.append(line, np.ones(10, np.uint8))  # the line rests
    lows = np.flatnonzero(line == 0)
    ratio = sent_baud / read_baud
    middles = ratio * np.arange(1.5, 9.5)
    heard = bytearray()
    at = 0.0  # bit of the sender at which the receiver stands; it waits for the line to go low
    while (next_low := int(np.searchsorted(lows, at))) < len(lows):
        start = int(lows[next_low])
        eight = line[np.minimum(start + middles, len(line) - 1).astype(int)]
        heard += np.packbits(eight, bitorder="little").tobytes()
        at = start + 9.5 * ratio
    return bytes(heard)


def _baud(terminal: int) -> int | None:
    """Return the baud rate set at a terminal; None: not a common one."""
    code = termios.tcgetattr(terminal)[5]
    return next((baud for baud in _BAUDS if getattr(termios, f"B{baud}") == code), None)


_BAUDS = [int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()]


def yaw_pitch_roll(turn: Rotation) -> tuple[float, float, float]:
    """The angles that a BNO08x reports for ``turn`` = Rz(-yaw) Rx(pitch) Ry(roll), rad."""
    pitch = math.asin(min(max(turn[2, 1], -1.0), 1.0))
    return math.atan2(turn[0, 1], turn[1, 1]), pitch, math.atan2(-turn[2, 0], turn[2, 2])


def mtdata2(data: bytes) -> bytes:
    """An Xsens message with these data."""
    length = bytes([len(data)]) if len(data) < 0xFF else b"\xff" + struct.pack(">H", len(data))
    message = b"\xff\x36" + length + data
    return b"\xfa" + message + bytes([-sum(message) & 0xFF])


def still(rate_hz: float, start_ns: int = 0) -> Iterator[ImuSample]:
    """Samples of an IMU that is level and at rest, without end."""
    number = 0
    while True:
        yield ImuSample(start_ns + round(number * 1e9 / rate_hz), (0.0, 0.0, 0.0), (0.0, 0.0, 9.80665))
        number += 1


def _int16(value: float) -> int:
    return min(max(round(value), -32768), 32767)


def _with_sum(frame: bytes, begin: int) -> bytes:
    return frame + bytes([sum(frame[begin:]) & 0xFF])


def _rotation(vector: Rotation) -> Rotation:
    """Rodrigues' formula: the rotation by a rotation vector, rad."""
    x, y, z = vector
    cross: Rotation = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = float(np.linalg.norm(vector))
    by_sine, by_cosine = float(np.sinc(angle / np.pi)), float(np.sinc(angle / 2 / np.pi)) ** 2 / 2
    turn: Rotation = np.eye(3) + by_sine * cross + by_cosine * cross @ cross
    return turn
