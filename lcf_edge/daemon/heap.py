"""Keeps resident memory small: one heap for all threads, and nothing that only startup needed."""

import ctypes
import re
from collections.abc import Iterator
from pathlib import Path

_M_ARENA_MAX = -8  # glibc, malloc.h
_MADV_DONTNEED = 4  # Linux, mman-common.h
_MAPPING = re.compile(
    r"^([0-9a-f]+)-([0-9a-f]+) r-[x-]p \S+ \S+ \S+ +/.*?^Anonymous: +(\d+) kB$", re.MULTILINE | re.DOTALL
)
"""In ``smaps``, a private read-only mapping of a file: begin, end, and how much of it was written nevertheless."""


def use_one_heap() -> bool:
    """Call before the process has threads: glibc would give each thread a heap, which never shrinks.

    Return whether the C library has such a setting.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # not in every C library
    return mallopt is not None and mallopt(_M_ARENA_MAX, 1) == 1


def trim() -> None:
    """Give free memory back to the system, where the C library can; 1 ms."""
    release = getattr(ctypes.CDLL(None), "malloc_trim", None)  # musl has none, and returns memory by itself
    if release is not None:
        release(0)


def leave_start(smaps: Path = Path("/proc/self/smaps")) -> None:
    """Release free memory, and code and constants of libraries; pages in use are loaded again on demand."""
    trim()
    advise = ctypes.CDLL(None).madvise
    for start, length in as_in_files(smaps.read_text("utf-8", "replace")):
        advise(ctypes.c_void_p(start), ctypes.c_size_t(length), _MADV_DONTNEED)


def as_in_files(smaps: str) -> Iterator[tuple[int, int]]:
    """Yield address and length of every read-only mapping that is unchanged from its file."""
    for start, end, written_kib in _MAPPING.findall(smaps):
        if written_kib == "0":
            yield int(start, 16), int(end, 16) - int(start, 16)
