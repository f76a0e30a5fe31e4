"""A clock that only moves when somebody sleeps on it: minutes of a device's life pass at once, the same every time."""


class VirtualClock:
    """``drivers.clock.Clock`` that a test turns by hand."""

    def __init__(self, now_ns: int = 1_000_000_000_000) -> None:
        self._now_ns = now_ns

    def monotonic_ns(self) -> int:
        """Now, ns."""
        return self._now_ns

    def sleep_s(self, seconds: float) -> None:
        """Time passes."""
        self._now_ns += max(round(seconds * 1e9), 0)
