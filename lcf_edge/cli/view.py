"""``lcf-edge view``: a page for a browser that shows a running daemon, or a recording."""
# ruff: noqa: PLC0415

from collections.abc import Callable

from lcf_edge.errors import LcfError
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.replay.replayed import Replayed


def view(shown: DaemonAddress | Replayed, host: str, port: int, write_line: Callable[[str], None]) -> None:
    """Serve the page until a signal ends it.

    Raises ``PublishError``, ``RecordingError``, and ``LcfError`` without the extra ``view``.
    """
    try:
        import aiohttp  # noqa: F401
    except ImportError as error:
        raise LcfError("view: aiohttp is missing; run pip install 'lcf-edge[view]'") from error
    import asyncio

    from lcf_edge.monitor.web.server import serve

    asyncio.run(serve(shown, host, port, write_line))
