"""``lcf-edge view``: a page for a browser that shows a running daemon, or a recording."""
# ruff: noqa: PLC0415

from collections.abc import Callable

from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.replay.replayed import Replayed
from lcf_edge.web.library import require_aiohttp


def view(shown: DaemonAddress | Replayed, host: str, port: int, write_line: Callable[[str], None]) -> None:
    """Serve the page until a signal ends it.

    Raises ``PublishError``, ``RecordingError``, and ``LcfError`` without the extra ``view``.
    """
    require_aiohttp("view")
    import asyncio

    from lcf_edge.monitor.web.server import serve

    asyncio.run(serve(shown, host, port, write_line))
