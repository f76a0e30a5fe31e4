"""IMUs with a hardware FIFO, which is read about 60 times a second, so that a late wake-up loses nothing.

A read that failed halfway, or an overrun, has lost the alignment of frames: the FIFO is then flushed.
"""

import struct
from abc import abstractmethod
from collections.abc import Iterable, Iterator
from typing import ClassVar

from drivers.imu.i2c_bus import BLOCK_BYTES, TransferError
from drivers.imu.i2c_imu import Counts, I2cImu
from drivers.samples import ImuSample

BATCH_S = 0.015  # between reads, or one sample where that is longer
START_UP_S = 0.1  # gyros need up to 80 ms
GOLDEN = 0.618  # of a period: reads come at varying phases, so that some come right after a sample
CLOSELY = 1 / 8  # of a period, between polls for the first sample


class FifoImu(I2cImu):
    """A chip whose FIFO holds frames of gyro and accelerometer; see ``I2cImu``."""

    fifo_register: ClassVar[int]
    fifo_bytes: int  # how many it holds
    word_bytes: ClassVar[int] = 12  # the unit in which it is read
    frame: ClassVar[struct.Struct] = struct.Struct("<6h")
    gyro_first: ClassVar[bool] = True

    @abstractmethod
    def _fifo_level(self) -> int:
        """Return the bytes in the FIFO; ``fifo_bytes`` after an overrun."""

    @abstractmethod
    def _empty_fifo(self) -> None:
        """Flush the FIFO."""

    def _begin(self) -> None:
        self._clock.sleep_s(START_UP_S)
        self._empty_fifo()
        self._newest_ns = self._clock.monotonic_ns()
        self._phase = 0.0
        self._begins = True  # the next sample is the first after a gap

    def _wait(self) -> None:
        period_s = 1 / self._sample_clock.rate_hz
        if self._begins:
            self._clock.sleep_s(CLOSELY * period_s)
            return
        batch = max(round(BATCH_S / period_s), 1)
        self._phase = (self._phase + GOLDEN) % 1.0
        due_s = (self._newest_ns - self._clock.monotonic_ns()) / 1e9 + (batch + self._phase) * period_s
        self._clock.sleep_s(min(max(due_s, CLOSELY * period_s), (batch + 1) * period_s))

    def _samples(self) -> list[ImuSample]:
        level = self._fifo_level()
        now_ns = self._clock.monotonic_ns()
        if level > self.fifo_bytes - self.word_bytes:
            return self._lose("fifo_overflow")
        try:
            data = self._burst(level - level % self.word_bytes)
        except TransferError:
            return self._lose("fifo_broken")
        frames = list(self._frames(data))
        if not frames:
            return []
        made = round((now_ns - self._newest_ns) / 1e9 * self._sample_clock.rate_hz)
        lost = max(made - len(frames), 0) if self._begins else 0
        self._begins = False
        stamps_ns = self._sample_clock.stamps_ns(now_ns, len(frames), lost)
        self._newest_ns = stamps_ns[-1]
        to_sample = self._scale.sample
        return [to_sample(stamp_ns, *frame) for stamp_ns, frame in zip(stamps_ns, frames, strict=True)]

    def _lose(self, reason: str) -> list[ImuSample]:
        self.counts[reason] += 1
        self._begins = True
        self._empty_fifo()
        return []

    def _burst(self, length: int) -> bytes:
        """Read from the FIFO. Raises ``TransferError`` at the first fault: what was read is gone from the FIFO."""
        most = BLOCK_BYTES - BLOCK_BYTES % self.word_bytes
        parts = [self._read(self.fifo_register, min(most, length - at), tries=1) for at in range(0, length, most)]
        return b"".join(parts)

    def _frames(self, data: bytes) -> Iterator[tuple[Counts, Counts]]:
        """Yield gyro and accelerometer of each frame."""
        for a, b, c, d, e, f in self.frame.iter_unpack(data):
            yield ((a, b, c), (d, e, f)) if self.gyro_first else ((d, e, f), (a, b, c))


def closest(rates_hz: Iterable[float], rate_hz: float) -> float:
    """Return the closest rate."""
    return min(rates_hz, key=lambda offered_hz: abs(offered_hz - rate_hz))
