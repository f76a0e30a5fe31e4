"""What the parsers of serial protocols share: cutting a stream of bytes into frames, and what they find."""

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
    spans: int = 0  # periods that the values are the mean of, up to now; 0: they are of now


class Parser(Protocol):
    """Bytes in, readings out, the same however the bytes are split; knows no port and no time.

    ``counts``: what was refused, by reason. ``frames``: how many were well formed, also those that gave no reading.
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
        """What to send to the IMU now, asking for samples at this rate."""
        ...


class Framer:
    """Cuts frames out of a stream, and finds the next one after damage by looking for ``header`` byte by byte.

    ``length`` gives the length of a frame from its first bytes: 0 when more are needed, -1 when no frame begins so.
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
        """What is kept of a frame whose end has not come yet."""
        return len(self._buffer)

    def feed(self, data: bytes) -> Iterator[bytes]:
        """The frames that ``data`` completes."""
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
        """Where the next header begins, or could begin at the very end of what has come."""
        begin = stream.find(self._header, start)
        if begin >= 0:
            return begin
        partial = range(max(start, len(stream) - len(self._header) + 1), len(stream))
        return next((at for at in partial if self._header.startswith(stream[at:])), len(stream))
