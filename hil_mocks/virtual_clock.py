"""A clock that advances only by sleeping on it: minutes of a device's life pass instantly and reproducibly."""


class VirtualClock:
    """``drivers.clock.Clock`` that a test advances."""

    def __init__(self, now_ns: int = 1_000_000_000_000) -> None:
        self._now_ns = now_ns

    def monotonic_ns(self) -> int:
        """Now, ns."""
        return self._now_ns

    def sleep_s(self, seconds: float) -> None:
        """Advance the time."""
        self._now_ns += max(round(seconds * 1e9), 0)
