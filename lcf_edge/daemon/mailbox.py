"""Queues between two threads: the newest item, or a fixed ring of samples. Every loss is counted."""

import threading
from collections import deque
from collections.abc import Sequence
from typing import Generic, Protocol, TypeVar

Item = TypeVar("Item")


class Stamped(Protocol):
    """A sample."""

    @property
    def stamp_ns(self) -> int:
        """When it was measured, ns."""
        ...


Sample = TypeVar("Sample", bound=Stamped)


class Newest(Generic[Item]):
    """Holds one item: the newest wins. ``overtaken``: how many were replaced before anybody took them."""

    def __init__(self) -> None:
        self.overtaken = 0
        self._item: Item | None = None
        self._closed = False
        self._arrived = threading.Condition()

    def put(self, item: Item) -> None:
        """Hold ``item`` in place of the previous one."""
        with self._arrived:
            self.overtaken += self._item is not None
            self._item = item
            self._arrived.notify()

    def take(self, timeout_s: float) -> Item | None:
        """Wait for an item and return it; None: timeout."""
        with self._arrived:
            self._arrived.wait_for(lambda: self._item is not None or self._closed, timeout_s)
            item, self._item = self._item, None
            return item

    def close(self) -> None:
        """End all waits."""
        with self._arrived:
            self._closed = True
            self._arrived.notify_all()


class SampleRing(Generic[Sample]):
    """Holds the latest ``capacity`` samples. ``overtaken``: how many were lost before anybody took them."""

    def __init__(self, capacity: int) -> None:
        self.overtaken = 0
        self._samples: deque[Sample] = deque(maxlen=capacity)
        self._capacity = capacity
        self._newest_ns: int | None = None
        self._arrived = threading.Condition()

    def put(self, samples: Sequence[Sample]) -> None:
        """Append samples, oldest first; the oldest ones are dropped to make room."""
        with self._arrived:
            self.overtaken += max(len(self._samples) + len(samples) - self._capacity, 0)
            self._samples.extend(samples)
            self._newest_ns = samples[-1].stamp_ns if samples else self._newest_ns
            self._arrived.notify()

    def wait_until(self, stamp_ns: int, timeout_s: float, silent_ns: int) -> bool:
        """Wait for a sample of ``stamp_ns`` or later; False: timeout.

        Does not wait when the newest is more than ``silent_ns`` older: the sensor is silent.
        """
        with self._arrived:
            newest_ns = self._newest_ns
            if newest_ns is None or newest_ns + silent_ns < stamp_ns:
                return False
            return self._arrived.wait_for(lambda: (self._newest_ns or 0) >= stamp_ns, timeout_s)

    def take(self) -> list[Sample]:
        """Remove and return all samples, oldest first."""
        with self._arrived:
            samples = list(self._samples)
            self._samples.clear()
            return samples
