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

    For work in the calling thread, by code that copes with failing allocations.
    """

    def __init__(self, allowed_bytes: int) -> None:
        self._left_bytes = allowed_bytes

    @contextmanager
    def limited(self) -> Iterator[None]:
        """Within, limit the process to what is left."""
        before_bytes = _data_bytes()
        soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
        limits = [before_bytes + max(self._left_bytes, 0), *(one for one in (soft, hard) if one >= 0)]
        resource.setrlimit(resource.RLIMIT_DATA, (min(limits), hard))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
            self._left_bytes -= _data_bytes() - before_bytes


def _data_bytes() -> int:
    return int(_STATM.read_text(encoding="ascii").split()[_DATA]) * os.sysconf("SC_PAGE_SIZE")
