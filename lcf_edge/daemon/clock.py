"""Two clocks: one for devices, whose waits a stop cuts short, and the system's, whose steps are noticed."""

import threading
import time
from collections.abc import Callable

STEP_NS = 1_000_000
"""The two clocks run at the same rate; a larger change of the difference between them is a step."""

_TRIES = 5
_GOOD_BRACKET_NS = 20_000


class StoppableClock:
    """``CLOCK_MONOTONIC`` for drivers; after ``stop`` every wait ends at once."""

    def __init__(self) -> None:
        self._stopped = threading.Event()

    def monotonic_ns(self) -> int:
        """Return the time now, ns."""
        return time.monotonic_ns()

    def sleep_s(self, seconds: float) -> None:
        """Wait, unless stopped."""
        self._stopped.wait(max(seconds, 0.0))

    def stop(self) -> None:
        """End all waits, also future ones."""
        self._stopped.set()

    @property
    def stopped(self) -> bool:
        """Whether ``stop`` was called."""
        return self._stopped.is_set()


class SystemTime:
    """Times of the monotonic clock as those of the system clock (``CLOCK_REALTIME``), and back.

    The offset between the two is constant until somebody sets the system clock or the machine sleeps; it is held, so
    that intervals between stamps stay exact, and measured again at each ``notice``. ``steps``: how often it changed.
    """

    def __init__(
        self, monotonic_ns: Callable[[], int] = time.monotonic_ns, system_ns: Callable[[], int] = time.time_ns
    ) -> None:
        self.steps = 0
        self._monotonic_ns = monotonic_ns
        self._system_ns = system_ns
        self._offset_ns, _ = self._measured()

    def notice(self) -> int:
        """Return the step of the system clock since the last call, ns; 0: none."""
        offset_ns, error_ns = self._measured()
        step_ns = offset_ns - self._offset_ns
        if abs(step_ns) <= STEP_NS + error_ns:
            return 0
        self._offset_ns = offset_ns
        self.steps += 1
        return step_ns

    def system_ns(self, monotonic_ns: int) -> int:
        """Convert a monotonic time, ns, to the system clock."""
        return monotonic_ns + self._offset_ns

    def monotonic_ns(self, system_ns: int) -> int:
        """Convert a time of the system clock, ns, to the monotonic one."""
        return system_ns - self._offset_ns

    def _measured(self) -> tuple[int, int]:
        """Return the offset and its largest error, ns, from the closest of a few readings of both clocks."""
        best = (0, 2**63)
        for _ in range(_TRIES):
            before_ns = self._monotonic_ns()
            system_ns = self._system_ns()
            bracket_ns = self._monotonic_ns() - before_ns
            best = min(best, (system_ns - before_ns - bracket_ns // 2, bracket_ns), key=lambda found: found[1])
            if best[1] < _GOOD_BRACKET_NS:
                break
        return best
