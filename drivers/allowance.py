"""So much of something in a second: what a device may cost, however much it sends."""


class Allowance:
    """Lets ``per_s`` a second pass, and after a pause at most a second's worth at once (a token bucket)."""

    def __init__(self, per_s: float) -> None:
        self._per_s = per_s
        self._left = per_s
        self._at_ns: int | None = None

    def take(self, count: int, now_ns: int) -> int:
        """Return how many of ``count`` pass at ``now_ns``, of a monotonic clock; they are used up."""
        if self._at_ns is not None:
            self._left = min(self._left + (now_ns - self._at_ns) / 1e9 * self._per_s, self._per_s)
        self._at_ns = now_ns
        passing = min(count, int(self._left))
        self._left -= passing
        return passing
