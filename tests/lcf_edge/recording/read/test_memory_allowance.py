"""A library's memory is limited, however often it is called."""

import mmap

import pytest

from lcf_edge.recording.read.memory_allowance import MemoryAllowance

MIB = 2**20


def private(size: int) -> mmap.mmap:
    """Memory of this process alone, which its limit counts; freed when it is closed."""
    return mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)


def test_memory_beyond_the_allowance_is_refused() -> None:
    with pytest.raises(OSError, match="memory"), MemoryAllowance(64 * MIB).limited():
        private(256 * MIB)
    private(256 * MIB).close()  # and only within


def test_memory_kept_from_call_to_call_is_refused_in_the_end() -> None:
    allowance = MemoryAllowance(64 * MIB)
    kept = []
    for _ in range(2):
        with allowance.limited():
            kept.append(private(24 * MIB))
    with pytest.raises(OSError, match="memory"), allowance.limited():
        kept.append(private(24 * MIB))


def test_memory_that_the_caller_gives_back_can_be_used_again() -> None:
    allowance = MemoryAllowance(64 * MIB)
    for _ in range(100):
        with allowance.limited():
            image = private(16 * MIB)
        image.close()


def test_no_more_than_the_allowance_is_given_back() -> None:
    allowance = MemoryAllowance(64 * MIB)
    other = private(256 * MIB)
    with allowance.limited():
        pass
    other.close()
    with pytest.raises(OSError, match="memory"), allowance.limited():
        private(256 * MIB)
