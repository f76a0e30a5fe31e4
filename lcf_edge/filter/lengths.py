"""Lengths of offsets in the image; the .pxd beside it is a header for the compiled modules."""

import math


def of(dx: float, dy: float) -> float:
    """√(dx² + dy²)."""
    return math.sqrt(dx * dx + dy * dy)
