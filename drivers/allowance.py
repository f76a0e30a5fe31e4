"""A rate limit: bounds what a device may cost, however much it sends."""


class Allowance:
    """A token bucket: ``per_s`` pass per second, and after a pause at most a second's worth at once."""

    def __init__(self, per_s: float) -> None:
        self._per_s = per_s
        self._left = per_s
        self._at_ns: int | None = None

    def take(self, count: int, now_ns: int) -> int:
        """Return how many of ``count`` may pass at ``now_ns`` (monotonic), and use them up."""
        if self._at_ns is not None:
            self._left = min(self._left + (now_ns - self._at_ns) / 1e9 * self._per_s, self._per_s)
        self._at_ns = now_ns
        passing = min(count, int(self._left))
        self._left -= passing
        return passing
