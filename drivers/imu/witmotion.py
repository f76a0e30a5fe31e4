"""WitMotion IMUs (WT901, WT61C, HWT905 and relatives) that speak the maker's standard protocol.

Frames of 11 bytes: 0x55, a type, four little-endian int16, the low byte of the sum of all before it. An acceleration
(0x51, 16 g full scale) and the angular velocity (0x52, 2000 °/s full scale) that follows it are one sample; times,
angles and the rest are passed over. Source: WitMotion "WT901SDCL Datasheet" v20-0605, section 6.1, and "HWT905-TTL,
Protocol" at docs.wit-motion.com; ElettraSciComp's library (witmotion_IMU_QT, util.cpp) agrees. The module sends what
was set with the maker's own program, nothing is written to it; many leave the factory with 9600 baud and 10 Hz, which
is too slow here: set 115200 baud and 200 Hz.
"""

import math
import struct
import sys
from collections import Counter
from collections.abc import Sequence

from drivers.imu.serial_frames import Framer, Reading, Vector
from drivers.imu.serial_imu import SerialProtocol, run_by_hand
from drivers.samples import STANDARD_GRAVITY_MPS2

HEADER = 0x55
ACCELERATION = 0x51
ANGULAR_VELOCITY = 0x52
TYPES = range(0x50, 0x60)
FRAME_BYTES = 11
MPS2_PER_UNIT = 16 * STANDARD_GRAVITY_MPS2 / 32768
RADPS_PER_UNIT = math.radians(2000) / 32768
CLIPPED_UNITS = 32600  # the module takes its offsets off after its chip has clipped


class WitMotionParser:
    """Pairs accelerations with the angular velocities that follow them; see ``Parser``."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._framer = Framer(bytes([HEADER]), _length, _is_whole, self.counts)
        self._accel: tuple[int, int, int] | None = None
        self._lost = 0

    @property
    def frames(self) -> int:
        """See ``Parser``."""
        return self._framer.frames

    def feed(self, data: bytes) -> list[Reading]:
        """See ``Parser``."""
        return [reading for frame in self._framer.feed(data) if (reading := self._take(frame))]

    def _take(self, frame: bytes) -> Reading | None:
        x, y, z = struct.unpack_from("<3h", frame, 2)
        if frame[1] == ACCELERATION:
            if self._accel is not None:
                self._miss()
            self._accel = (x, y, z)
        elif frame[1] == ANGULAR_VELOCITY:
            if self._accel is not None:
                return self._pair(self._accel, (x, y, z))
            self._miss()
        return None

    def _miss(self) -> None:
        """Half a sample: the other half was lost."""
        self.counts["incomplete"] += 1
        self._lost += 1

    def _pair(self, accel: tuple[int, int, int], gyro: tuple[int, int, int]) -> Reading:
        clipped = max(map(abs, accel + gyro)) >= CLIPPED_UNITS
        reading = Reading(scaled(gyro, RADPS_PER_UNIT), scaled(accel, MPS2_PER_UNIT), clipped, self._lost)
        self._accel = None
        self._lost = 0
        return reading


def scaled(raw: tuple[int, int, int], unit: float) -> Vector:
    """Units of a frame to SI units."""
    return raw[0] * unit, raw[1] * unit, raw[2] * unit


def _length(start: bytes) -> int:
    if len(start) < 2:
        return 0
    return FRAME_BYTES if start[1] in TYPES else -1


def _is_whole(frame: bytes) -> bool:
    return sum(frame[:-1]) & 0xFF == frame[-1]


PROTOCOL = SerialProtocol(
    name="witmotion",
    bauds=(115200, 9600, 230400, 460800, 921600),
    parser=WitMotionParser,
    needs="acceleration and angular velocity",
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the driver by hand."""
    return run_by_hand(PROTOCOL, argv)


if __name__ == "__main__":
    sys.exit(main())
