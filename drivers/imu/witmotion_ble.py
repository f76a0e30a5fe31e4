"""WitMotion's Bluetooth IMUs (WT9011DCL, WT901BLECL, BWT901BLE5.0) at a serial port: USB, or a Bluetooth adapter.

Frames of 20 bytes: 0x55 0x61, then little-endian int16 of acceleration (16 g full scale), angular velocity (2000 °/s)
and angle. 0x55 0x71 begins the reply to a question, as long, which is passed over. Sources: WitMotion's own SDK
(WitBluetooth_BWT901BLE5_0, device_model.py) and ctroncozo's witmotion_ble (protocol.py), which agree. There is no
checksum: a frame is recognised by those before and after it, and a wrong bit among its values is not noticed.
"""

import struct
import sys
from collections import Counter
from collections.abc import Sequence

from drivers.imu.serial_frames import Reading
from drivers.imu.serial_imu import SerialProtocol, run_by_hand
from drivers.imu.witmotion import CLIPPED_UNITS, MPS2_PER_UNIT, RADPS_PER_UNIT, scaled

VALUES, REPLY = b"\x55\x61", b"\x55\x71"
FRAME_BYTES = 20


class WitMotionBleParser:
    """Takes a frame for one when another came right before it; else it waits for the next. See ``Parser``."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.frames = 0
        self._rest = b""
        self._in_step = False  # a frame has just ended here

    def feed(self, data: bytes) -> list[Reading]:
        """See ``Parser``."""
        stream = self._rest + data
        at, readings = 0, []
        while len(stream) - at >= 2:
            if stream[at : at + 2] not in (VALUES, REPLY):
                at += self._skip()
                continue
            frame = stream[at : at + FRAME_BYTES]
            sure = self._in_step and VALUES not in frame[2:] and REPLY not in frame[2:]
            after = stream[at + FRAME_BYTES : at + FRAME_BYTES + 2]
            if len(frame) < FRAME_BYTES or not (sure or len(after) == 2):
                break
            if not sure and after not in (VALUES, REPLY):
                self.counts["bad_frame"] += 1
                at += self._skip()
                continue
            self.frames += 1
            self._in_step = True
            at += FRAME_BYTES
            if frame.startswith(VALUES):
                readings.append(_reading(frame))
        self._rest = stream[at:]
        return readings

    def _skip(self) -> int:
        self._in_step = False
        self.counts["skipped_bytes"] += 1
        return 1


def _reading(frame: bytes) -> Reading:
    x, y, z, p, q, r = struct.unpack_from("<6h", frame, 2)
    clipped = max(map(abs, (x, y, z, p, q, r))) >= CLIPPED_UNITS
    return Reading(scaled((p, q, r), RADPS_PER_UNIT), scaled((x, y, z), MPS2_PER_UNIT), clipped)


PROTOCOL = SerialProtocol(
    name="witmotion_ble",
    bauds=(115200, 9600, 230400, 460800, 921600),
    parser=WitMotionBleParser,
    needs="acceleration and angular velocity",
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the driver by hand."""
    return run_by_hand(PROTOCOL, argv)


if __name__ == "__main__":
    sys.exit(main())
