"""A queue between two threads, bounded in bytes: ``put`` never waits, what does not fit is counted."""

import threading
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Backlog(Generic[Item]):
    """Holds items in order. ``bytes``: what they take; ``dropped``: how many items did not fit.

    An empty backlog accepts an item of any size.
    """

    def __init__(self, limit_bytes: int) -> None:
        self.bytes = 0
        self.dropped = 0
        self.limit_bytes = limit_bytes
        self._items: deque[tuple[Item, int]] = deque()
        self._closed = False
        self._changed = threading.Condition()

    def put(self, item: Item, size_bytes: int, reserve_bytes: int = 0) -> bool:
        """Append an item if it leaves ``reserve_bytes`` free. Return whether it did."""
        with self._changed:
            fits = not self._items or self.bytes + size_bytes <= self.limit_bytes - reserve_bytes
            if fits:
                self._items.append((item, size_bytes))
                self.bytes += size_bytes
                self._changed.notify()
            else:
                self.dropped += 1
            return fits

    def take(self, max_bytes: int, timeout_s: float) -> list[Item]:
        """Remove and return items from the front: ``max_bytes`` at most, but at least one; empty: none in time."""
        with self._changed:
            self._changed.wait_for(lambda: self._items or self._closed, timeout_s)
            taken: list[Item] = []
            taken_bytes = 0
            while self._items and (not taken or taken_bytes + self._items[0][1] <= max_bytes):
                item, size_bytes = self._items.popleft()
                taken.append(item)
                taken_bytes += size_bytes
            self.bytes -= taken_bytes
            return taken

    def close(self) -> None:
        """End all waits; what it holds can still be taken."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def ended(self) -> bool:
        """Whether it is closed, and all was taken."""
        with self._changed:
            return self._closed and not self._items
