"""Memory of the loops: typed when they are compiled, a ``memoryview`` when not.

A ``memoryview`` yields Python's own numbers, which neither wrap nor round, so that both give the same bytes.
"""

from typing import Any, TypeAlias

import numpy as np

Bytes: TypeAlias = Any
"""Of uint8."""

Integers: TypeAlias = Any
"""Of int32."""

Words: TypeAlias = Any
"""Of uint64."""

Doubles: TypeAlias = Any
"""Of float64, or of float32 where that is said."""


def memory_of(array: Any) -> Any:
    """The memory of an array; bool as uint8."""
    whole: Any = np.ascontiguousarray(array)
    return memoryview(whole.view(np.uint8) if whole.dtype == np.bool_ else whole)


def doubles(*shape: int) -> Doubles:
    """Zeros."""
    return memory_of(np.zeros(shape, np.float64))


def integers(*shape: int) -> Integers:
    """Zeros."""
    return memory_of(np.zeros(shape, np.int32))


def octets(*shape: int) -> Bytes:
    """Zeros."""
    return memory_of(np.zeros(shape, np.uint8))
