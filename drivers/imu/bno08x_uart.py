"""CEVA BNO080, BNO085 and BNO086 in UART-SHTP mode (PS1 high, PS0 low): 3,000,000 baud, and the rates of its gyro.

"BNO08X Data Sheet" (1000-3927), section 1.2.3; Adafruit's CircuitPython driver (uart.py) agrees. A packet of ``shtp``
is put between two bytes 0x7E, after a byte 0x01; 0x7E and 0x7D in it become 0x7D and the byte with bit 5 inverted.
Frames of the other kind, 0x00, tell how much the hub can take, and are passed over. There is no checksum: a packet is
recognised by its length, a report by its range. The hub wants 100 µs between the bytes that it is sent.
"""

import sys
from collections import Counter
from collections.abc import Iterator, Sequence

from drivers.imu.serial_frames import Reading
from drivers.imu.serial_imu import SerialProtocol, run_by_hand
from drivers.imu.shtp import CONTINUED, HEADER, MAX_PACKET_BYTES, Hub, is_plausible

FLAG, ESCAPE, INVERTED = 0x7E, 0x7D, 0x20
SHTP, BUFFER_STATUS = 0x01, 0x00
MAX_FRAME_BYTES = 2 * (MAX_PACKET_BYTES + 1)  # every byte escaped
BYTE_PAUSE_S = 100e-6


class ShtpUartParser:
    """Takes packets out of their frames; see ``Parser`` and ``Talker``."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.frames = 0
        self._rest = b""
        self._hub: Hub | None = None
        self._heard = False

    def feed(self, data: bytes) -> list[Reading]:
        """See ``Parser``."""
        *frames, rest = (self._rest + data).split(bytes([FLAG]))
        readings = [reading for frame in frames if frame for reading in self._take(frame)]
        if len(rest) > MAX_FRAME_BYTES:
            self.counts["skipped_bytes"] += len(rest) - 1
            rest = rest[:1]  # of no frame that is whole
        self._rest = rest
        self._heard = self._heard or bool(readings)
        return readings

    def to_say(self, rate_hz: float, now_ns: int) -> list[bytes]:
        """See ``Talker``."""
        heard, self._heard = self._heard, False
        return [framed(packet) for packet in self._hub_at(rate_hz).to_say(now_ns, heard=heard)]

    def _take(self, frame: bytes) -> Iterator[Reading]:
        kind, packet = frame[0], _unescaped(frame[1:])
        whole = packet is not None and len(packet) >= HEADER.size and is_plausible(packet)
        if kind == BUFFER_STATUS and len(frame) <= 1 + 2 * 2:
            self.frames += 1
        elif kind == SHTP and packet and whole and HEADER.unpack_from(packet)[0] & ~CONTINUED == len(packet):
            self.frames += 1
            yield from self._hub_at().take(packet)
        else:
            self.counts["bad_frame"] += 1

    def _hub_at(self, rate_hz: float = 200.0) -> Hub:
        if self._hub is None:
            self._hub = Hub(rate_hz, self.counts)
        return self._hub


def framed(packet: bytes) -> bytes:
    """A packet as it goes over the line."""
    body = b"".join(bytes([ESCAPE, byte ^ INVERTED]) if byte in (FLAG, ESCAPE) else bytes([byte]) for byte in packet)
    return bytes([FLAG, SHTP]) + body + bytes([FLAG])


def _unescaped(data: bytes) -> bytes | None:
    """None: it ends within an escape."""
    first, *parts = data.split(bytes([ESCAPE]))
    if not all(parts):
        return None
    return first + b"".join(bytes([part[0] ^ INVERTED]) + part[1:] for part in parts)


PROTOCOL = SerialProtocol(
    name="bno08x_uart",
    bauds=(3_000_000,),
    parser=ShtpUartParser,
    needs="accelerometer and gyro; is it in the mode UART-SHTP (PS1 high, PS0 low)?",
    byte_pause_s=BYTE_PAUSE_S,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the driver by hand."""
    return run_by_hand(PROTOCOL, argv)


if __name__ == "__main__":
    sys.exit(main())
