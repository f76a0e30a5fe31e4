"""Conversion to integers, as in C; the .pxd beside it is a header for the compiled modules."""


def whole(x: float) -> int:
    """Truncate towards zero."""
    return int(x)
