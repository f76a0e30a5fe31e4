"""How many may be connected to the page, each of which takes a descriptor.

When as many are there as may be, the one that has waited longest without a request under way gives way to the new one;
where all have one, the new one is turned away.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable

from aiohttp import web

MOST_CONNECTIONS = 96  # 16 browsers with 6 each
BACKLOG = 32  # accepted at once; with the connections far below 256 descriptors
REQUEST_WITHIN_S = 5.0  # or it is let go, also between two requests

LOGGER = logging.getLogger(__name__)

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Doorkeeper:
    """Knows which connections have a request under way, and so which may be let go."""

    def __init__(self) -> None:
        self._busy: set[asyncio.BaseProtocol] = set()

    @web.middleware
    async def busy(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """While a request is handled its connection stays."""
        self._busy.add(request.protocol)
        try:
            return await handler(request)
        finally:
            self._busy.discard(request.protocol)

    def protocol(self, server: web.Server) -> asyncio.BaseProtocol:
        """Of the next connection to ``server``."""
        connections = [one for one in server.connections if one.transport is not None]
        if len(connections) < MOST_CONNECTIONS:
            return server()
        LOGGER.warning("more than %d connections; the longest idle are let go", MOST_CONNECTIONS)
        idle = next((one for one in connections if one not in self._busy), None)
        if idle is None:
            return _TurnedAway()
        idle.force_close()
        return server()


class _TurnedAway(asyncio.Protocol):
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        transport.close()
