"""Names for what the loops take besides numbers and tables: typed memory when compiled, ``memoryview`` when not."""

from typing import Any, TypeAlias

Bytes: TypeAlias = Any
"""Of uint8."""

Integers: TypeAlias = Any
"""Of int32."""

Words: TypeAlias = Any
"""Of uint64."""

Doubles: TypeAlias = Any
"""Of float64, or of float32 where that is said."""
