"""The library that pages are served with, which an extra brings."""

from lcf_edge.errors import LcfError


def require_aiohttp(command: str) -> None:
    """Raise ``LcfError`` where it is missing, in the name of ``command``."""
    try:
        import aiohttp  # noqa: F401, PLC0415
    except ImportError as error:
        raise LcfError(f"{command}: aiohttp is missing; run pip install 'lcf-edge[view]'") from error
