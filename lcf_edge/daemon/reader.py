"""One thread per device: keeps it open, passes on its data, and tracks its state."""

import threading
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from drivers.clock import Clock
from drivers.device import EXCESS, Device, KeptOpen
from drivers.errors import DriverError
from lcf_edge.daemon.clock import StoppableClock
from lcf_edge.daemon.log import LOGGER
from lcf_edge.daemon.mailbox import Stamped
from lcf_edge.meters import IntervalMeter

Record = TypeVar("Record", bound=Stamped)

_COUNTS_EACH_NS = 500_000_000


class Reader(threading.Thread, Generic[Record]):
    """Reads a device until ``clock`` is stopped; then closes it.

    ``name``: of the device's part in the program ("camera"). For others to read: ``error`` (why
    nothing comes; None: nothing is known to be wrong), ``away_since_ns`` (monotonic; None: it delivers), ``counts``,
    ``intervals``.
    """

    def __init__(
        self,
        name: str,
        open_device: Callable[[Clock], Device[Record]],
        deliver: Callable[[Sequence[Record]], object],
        clock: StoppableClock,
    ) -> None:
        super().__init__(name=name, daemon=True)  # a hanging driver does not keep the process alive
        self.error: DriverError | None = None
        self.away_since_ns: int | None = clock.monotonic_ns()
        self.counts: Counter[str] = Counter()
        self.intervals = IntervalMeter()
        self._device = KeptOpen(name, lambda: open_device(clock), clock)
        self._deliver = deliver
        self._clock = clock
        self._counted_ns = 0
        self._told_of_excess = False

    def run(self) -> None:
        """Read until stopped."""
        try:
            while not self._clock.stopped:
                records = self._device.read()
                if records:
                    self.intervals.add(record.stamp_ns for record in records)
                    self._deliver(records)
                self._notice(delivers=bool(records))
        finally:
            self._device.close()
            self.counts = self._device.counts

    def _notice(self, *, delivers: bool) -> None:
        now_ns = self._clock.monotonic_ns()
        error = self._device.error
        if delivers and self.away_since_ns is not None:
            self.error = self.away_since_ns = None
            LOGGER.info("%s: delivers", self.name)
        elif error is not None and str(error) != str(self.error):
            if self.away_since_ns is None:
                self.away_since_ns = now_ns
                self.intervals.restart()
            self.error = error
            LOGGER.error("%s: %s", self.name, error)
        elif now_ns - self._counted_ns < _COUNTS_EACH_NS:
            return
        self.counts, self._counted_ns = self._device.counts, now_ns
        if not self._told_of_excess and any(self.counts[name] for name in EXCESS):
            self._told_of_excess = True
            LOGGER.warning(
                "%s: sends more than any such device should; the excess is dropped and counted; check it", self.name
            )
