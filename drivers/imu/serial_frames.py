"""What the parsers of serial protocols share: splitting a byte stream into frames, and the readings in them."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Reading:
    """One inertial sample of a protocol, in the chip's axes."""

    gyro: Vector  # rad/s
    accel: Vector  # m/s²
    saturated: bool = False
    lost: int = 0  # samples known to be missing before this one
    ticks: int | None = None  # of the device's own clock, where the protocol has it
    spans: int = 0  # periods up to now over which the values are averaged; 0: instantaneous


class Parser(Protocol):
    """Bytes in, readings out, however the bytes are split; independent of port and time.

    ``counts``: refused data by reason. ``frames``: number of well-formed frames, including those without a reading.
    Memory is bounded.
    """

    counts: Counter[str]

    @property
    def frames(self) -> int:
        """Well-formed frames so far."""
        ...

    def feed(self, data: bytes) -> list[Reading]:
        """Take the next bytes of the stream; return the readings that they complete, oldest first."""
        ...


@runtime_checkable
class Talker(Parser, Protocol):
    """A parser whose IMU must be configured to send."""

    def to_say(self, rate_hz: float, now_ns: int) -> list[bytes]:
        """Return what to send to the IMU now, to request samples at this rate."""
        ...


class Framer:
    """Splits a stream into frames, and resynchronises after damage by searching for ``header`` byte by byte.

    ``length`` returns the length of a frame from its first bytes: 0 when more are needed, -1 when they begin no frame.
    ``is_whole`` checks it. Counts ``skipped_bytes`` and ``bad_frame``; ``frames`` are the good ones.
    """

    def __init__(
        self,
        header: bytes,
        length: Callable[[bytes], int],
        is_whole: Callable[[bytes], bool],
        counts: Counter[str],
    ) -> None:
        self._header = header
        self._length = length
        self._is_whole = is_whole
        self._counts = counts
        self._buffer = bytearray()
        self.frames = 0

    @property
    def held_bytes(self) -> int:
        """Bytes kept of an incomplete frame."""
        return len(self._buffer)

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Yield the frames that ``data`` completes."""
        stream = bytes(self._buffer) + data
        start = 0
        while (begin := self._find(stream, start)) < len(stream):
            self._skip(begin - start)
            start = begin
            length = self._length(stream[start : start + 8])
            if length == 0 or 0 < len(stream) - start < length:
                break
            frame = stream[start : start + length]
            if length > 0 and self._is_whole(frame):
                self.frames += 1
                yield frame
                start += length
            else:
                self._counts["bad_frame"] += 1
                self._skip(1)
                start += 1
        else:
            self._skip(len(stream) - start)
            start = len(stream)
        self._buffer[:] = stream[start:]

    def _skip(self, count: int) -> None:
        if count:
            self._counts["skipped_bytes"] += count

    def _find(self, stream: bytes, start: int) -> int:
        """Return where the next header begins, or may begin at the end of the data so far."""
        begin = stream.find(self._header, start)
        if begin >= 0:
            return begin
        partial = range(max(start, len(stream) - len(self._header) + 1), len(stream))
        return next((at for at in partial if self._header.startswith(stream[at:])), len(stream))
