"""The clock of the drivers: the system's monotonic one, or one that a test controls."""

import time
from typing import Protocol


class Clock(Protocol):
    """Time that never goes back."""

    def monotonic_ns(self) -> int:
        """Now, ns."""
        ...

    def sleep_s(self, seconds: float) -> None:
        """Wait."""
        ...


class SystemClock:
    """``CLOCK_MONOTONIC``."""

    def monotonic_ns(self) -> int:
        """Now, ns."""
        return time.monotonic_ns()

    def sleep_s(self, seconds: float) -> None:
        """Wait; a time that is over passes at once."""
        time.sleep(max(seconds, 0.0))


SYSTEM_CLOCK = SystemClock()
