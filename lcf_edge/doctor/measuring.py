"""Reading a device for a while."""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from statistics import pstdev
from typing import Generic, Protocol, TypeVar

from drivers.clock import Clock
from drivers.device import Device


class Stamped(Protocol):
    """What a device delivers."""

    @property
    def stamp_ns(self) -> int:
        """When it was measured, ns."""
        ...


Record = TypeVar("Record", bound=Stamped)


@dataclass(frozen=True, slots=True)
class Measured(Generic[Record]):
    """The records that came, oldest first, and the counts meanwhile."""

    name: str
    records: list[Record]
    counts: Counter[str]

    @property
    def rate_hz(self) -> float:
        """Rate, records a second; NaN: fewer than two came."""
        if len(self.records) < 2:
            return math.nan
        return (len(self.records) - 1) / max((self.records[-1].stamp_ns - self.records[0].stamp_ns) / 1e9, 1e-9)

    @property
    def jitter_s(self) -> float:
        """1 sigma of the interval between two records, s."""
        return pstdev(self._intervals_s) if len(self.records) > 2 else math.nan

    @property
    def longest_s(self) -> float:
        """The longest interval between two records, s."""
        return max(self._intervals_s, default=math.nan)

    @property
    def steps_back(self) -> int:
        """How often a stamp was not after the one before."""
        return sum(interval_s <= 0 for interval_s in self._intervals_s)

    @property
    def _intervals_s(self) -> list[float]:
        stamps_ns = [record.stamp_ns for record in self.records]
        return [(later - earlier) / 1e9 for earlier, later in pairwise(stamps_ns)]

    def summary(self) -> str:
        """Rate and jitter in words, as far as they are known."""
        if math.isnan(self.rate_hz):
            return "only one came"
        jitter = "" if math.isnan(self.jitter_s) else f", jitter {1e3 * self.jitter_s:.1f} ms"
        return f"{self.rate_hz:.1f}/s{jitter}"


def measure(
    open_device: Callable[[], Device[Record]], seconds: float, clock: Clock, settling_s: float = 0.0
) -> Measured[Record]:
    """Open a device, read it, close it. Raises ``DriverError``.

    ``settling_s``: records this soon after the first are discarded, as while a camera adjusts its exposure. Without any
    record, wait until the device fails, three times ``seconds`` at most.
    """
    device = open_device()
    try:
        records: list[Record] = []
        end_ns = clock.monotonic_ns() + round(3e9 * (seconds + settling_s))
        first_ns: int | None = None
        while (now_ns := clock.monotonic_ns()) < end_ns:
            read = device.read()
            if read and first_ns is None:
                first_ns = now_ns
                end_ns = now_ns + round(1e9 * (seconds + settling_s))
            if first_ns is not None and now_ns - first_ns >= settling_s * 1e9:
                records += read
        return Measured(device.name, records, +device.counts)
    finally:
        device.close()
