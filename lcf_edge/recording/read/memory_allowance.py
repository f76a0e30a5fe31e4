"""A memory limit for a library that has none."""

import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_STATM = Path("/proc/self/statm")
_DATA = 5  # its field: pages of memory that can be written


class MemoryAllowance:
    """Bytes for all that is called within ``limited`` together; memory beyond is refused.

    What the process gives back in between counts as given back by it: images are freed by whoever was given them. For
    work in the calling thread, by code that copes with failing allocations.
    """

    def __init__(self, allowed_bytes: int) -> None:
        self._allowed_bytes = self._left_bytes = allowed_bytes
        self._after_bytes = 0  # of the process, when ``limited`` was left

    @contextmanager
    def limited(self) -> Iterator[None]:
        """Within, limit the process to what is left."""
        before_bytes = _data_bytes()
        given_back_bytes = max(self._after_bytes - before_bytes, 0)
        self._left_bytes = min(self._left_bytes + given_back_bytes, self._allowed_bytes)
        soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
        limits = [before_bytes + max(self._left_bytes, 0), *(one for one in (soft, hard) if one >= 0)]
        resource.setrlimit(resource.RLIMIT_DATA, (min(limits), hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
            self._after_bytes = _data_bytes()
            self._left_bytes -= self._after_bytes - before_bytes


def _data_bytes() -> int:
    return int(_STATM.read_text(encoding="ascii").split()[_DATA]) * os.sysconf("SC_PAGE_SIZE")
