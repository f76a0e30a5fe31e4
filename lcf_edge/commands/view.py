"""``lcf-edge view``: a page for a browser, of what a running daemon sees."""
# ruff: noqa: PLC0415

from collections.abc import Callable

from lcf_edge.errors import LcfError
from lcf_edge.live.source import Source


def view(source: Source, host: str, port: int, tell: Callable[[str], None]) -> None:
    """Serve the page until a signal ends it. Raises ``PublishError``, and ``LcfError`` without the extra ``view``."""
    try:
        import aiohttp  # noqa: F401
    except ImportError as error:
        raise LcfError("view: aiohttp is missing; run pip install 'lcf-edge[view]'") from error
    import asyncio

    from lcf_edge.view.server import serve

    asyncio.run(serve(source, host, port, tell))
