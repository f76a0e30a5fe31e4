"""Whole numbers from others, as C converts them. Compiled by ``c_rounding.pxd``."""


def whole(x: float) -> int:
    """Towards zero."""
    return int(x)
