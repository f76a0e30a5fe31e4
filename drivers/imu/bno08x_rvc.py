"""BNO080/085/086 in UART-RVC mode (PS0 high, PS1 low): 115200 baud, 100 frames a second, no command needed.

Frames of 19 bytes: 0xAA 0xAA, an index, yaw, pitch and roll in 0.01°, acceleration x, y, z in mg (all little-endian
int16), three reserved bytes, the low byte of the sum of all after the header. Source: Hillcrest "BNO080 Datasheet"
1000-3927, October 2017, section 1.3.5.2 (the same in CEVA's BNO08X data sheet); Adafruit's CircuitPython driver agrees.

There is no gyro in a frame: the rates are the turn between two frames, over the time between them. So a sample is of
the middle between its two frames (its acceleration is their mean), and a rate comes in steps of 1 °/s (0.01° in 10 ms);
the steps cancel when the rates are integrated, which is what they are for: a turn is right to 0.01° over any interval.

The angles are ``Rz(-yaw) Rx(pitch) Ry(roll)``: yaw grows clockwise, pitch is about x, roll about y. The data sheet's
text swaps the two axes, but its own example frame does not (pitch -1.10°, roll 20.85°, acceleration -0.371, -0.020,
0.977 g); the way of yaw is not in it, those who use the chip as a compass do.
"""

import math
import struct
import sys
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from drivers.imu.serial_frames import Framer, Reading, Vector
from drivers.imu.serial_imu import SerialProtocol, run_by_hand
from drivers.samples import STANDARD_GRAVITY_MPS2

HEADER = b"\xaa\xaa"
FRAME_BYTES = 19
RATE_HZ = 100.0
RAD_PER_UNIT = math.radians(0.01)
MPS2_PER_UNIT = STANDARD_GRAVITY_MPS2 / 1000
MAX_SPAN = 10  # frames; a turn over more says little about the rate
GYRO_RANGE_RADPS = math.radians(2000)
ACCEL_RANGE_UNITS = 7900  # ±8 g, less the offset that the chip takes off

Quaternion = tuple[float, float, float, float]  # w, x, y, z


class RvcFrame(NamedTuple):
    """What a frame says."""

    number: int  # 0 to 255, then again from 0
    turn: Quaternion  # of the chip, in the axes it had when it was started
    accel: Vector  # m/s²
    clipped: bool  # acceleration at the end of its range


class RvcParser:
    """Turns the angles of successive frames into rates; see ``Parser``."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._framer = Framer(HEADER, lambda _: FRAME_BYTES, _is_whole, self.counts)
        self._before: RvcFrame | None = None
        self._lost = 0

    @property
    def frames(self) -> int:
        """See ``Parser``."""
        return self._framer.frames

    def feed(self, data: bytes) -> list[Reading]:
        """See ``Parser``."""
        return [reading for frame in self._framer.feed(data) if (reading := self._take(decode(frame)))]

    def _take(self, frame: RvcFrame) -> Reading | None:
        before, self._before = self._before, frame
        if before is None:
            return None
        span = (frame.number - before.number) % 256
        if span == 0:
            self.counts["repeated"] += 1
            return None
        if span > 1:
            self.counts["lost"] += span - 1
            self._lost += span - 1
        if span > MAX_SPAN:
            self._lost += 1
            return None
        gyro = _scaled(_turn(before.turn, frame.turn), RATE_HZ / span)
        accel = _scaled(_sum(before.accel, frame.accel), 0.5)
        clipped = before.clipped or frame.clipped or max(map(abs, gyro)) >= GYRO_RANGE_RADPS
        reading = Reading(gyro, accel, clipped, self._lost, spans=span)
        self._lost = 0
        return reading


def decode(frame: bytes) -> RvcFrame:
    """A whole frame of ``FRAME_BYTES``."""
    number, yaw, pitch, roll, *accel = struct.unpack_from("<B6h", frame, 2)
    turn = _product(
        _product(_about(3, -yaw * RAD_PER_UNIT), _about(1, pitch * RAD_PER_UNIT)), _about(2, roll * RAD_PER_UNIT)
    )
    x, y, z = accel
    clipped = max(abs(x), abs(y), abs(z)) >= ACCEL_RANGE_UNITS
    return RvcFrame(number, turn, _scaled((x, y, z), MPS2_PER_UNIT), clipped)


def _is_whole(frame: bytes) -> bool:
    return sum(frame[2:-1]) & 0xFF == frame[-1]


def _about(axis: int, angle_rad: float) -> Quaternion:
    """The turn about one axis: 1 x, 2 y, 3 z."""
    sine = math.sin(angle_rad / 2)
    return math.cos(angle_rad / 2), sine * (axis == 1), sine * (axis == 2), sine * (axis == 3)


def _product(p: Quaternion, q: Quaternion) -> Quaternion:
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


def _turn(before: Quaternion, after: Quaternion) -> Vector:
    """Rotation vector that takes ``before`` to ``after``, in the axes of the body, rad; the shorter way round."""
    w, x, y, z = _product((before[0], -before[1], -before[2], -before[3]), after)
    sine = math.sqrt(x * x + y * y + z * z)
    if sine == 0.0:
        return 0.0, 0.0, 0.0
    return _scaled((x, y, z), 2 * math.atan2(math.copysign(sine, w), abs(w)) / sine)


def _scaled(vector: Vector, by: float) -> Vector:
    return vector[0] * by, vector[1] * by, vector[2] * by


def _sum(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


PROTOCOL = SerialProtocol(
    name="bno08x_rvc", bauds=(115200,), parser=RvcParser, needs="successive angles", rate_hz=RATE_HZ
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the driver by hand."""
    return run_by_hand(PROTOCOL, argv)


if __name__ == "__main__":
    sys.exit(main())
