"""How fast a party may speak: reading what it says takes the gate's time, which is everybody's."""

from collections.abc import Callable

MAX_PER_S = 2000  # messages of one connection; a speed comes a hundred times a second
AT_ONCE = 200


class Pace:
    """Of one connection."""

    def __init__(self, now_s: Callable[[], float]) -> None:
        self._now_s = now_s
        self._due_s = now_s()

    def wait_s(self, messages: int) -> float:
        """Return how long to wait before more is read, after so many messages."""
        now_s = self._now_s()
        self._due_s = max(self._due_s, now_s - AT_ONCE / MAX_PER_S) + messages / MAX_PER_S
        return max(self._due_s - now_s, 0.0)
