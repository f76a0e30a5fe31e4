"""Whole numbers from others, as C converts them; the .pxd beside it is a header that serves the compiled modules."""


def whole(x: float) -> int:
    """Towards zero."""
    return int(x)
