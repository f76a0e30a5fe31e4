"""File descriptors in reserve, so that devices and files can be opened even if peers use up all others."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

RESERVED = 24
LENT = 12  # at a time: a device or a file needs two or three, a camera of libcamera nine


class Reserve:
    """Holds ``RESERVED`` descriptors back, of which some are lent while a device or a file is opened.

    ``short``: at the last ``check`` no others were left. ``shortages``: how often that began.
    """

    def __init__(self) -> None:
        self.short = False
        self.shortages = 0
        self._lock = threading.Lock()
        self._open: list[int] = []
        self._borrowers = 0
        self._fill()

    @contextmanager
    def lent(self) -> Iterator[None]:
        """Within, a few descriptors are free, even if all others are used up; refill the reserve when possible."""
        with self._lock:
            self._borrowers += 1
            for number in self._open[:LENT]:
                os.close(number)
            del self._open[:LENT]
        try:
            yield
        finally:
            with self._lock:
                self._borrowers -= 1
                self._fill()

    def check(self) -> None:
        """Check whether all descriptors that are not reserved are used up."""
        with self._lock:
            if not self._borrowers:
                self._fill()
            short = not _one_is_free()
        self.shortages += short and not self.short
        self.short = short

    def close(self) -> None:
        """Release the reserve; it is not used again."""
        with self._lock:
            while self._open:
                os.close(self._open.pop())

    def _fill(self) -> None:
        with suppress(OSError):  # none is left; the next check tries again
            while len(self._open) < RESERVED:
                self._open.append(os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC))


def _one_is_free() -> bool:
    try:
        os.close(os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC))
    except OSError:
        return False
    return True
