"""Limits the connections to the page, each of which takes a descriptor.

At the limit, the one that has been idle longest gives way to the new one; if all have a request under way, the new one
is turned away. At the end no request is left to the server's own time limit: aiohttp (3.14) fails when a request ends
just at that moment.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable

from aiohttp import web

MAX_CONNECTIONS = 96  # 16 browsers with 6 each
BACKLOG = 32  # accepted at once; together far below 256 descriptors
REQUEST_WITHIN_S = 5.0  # or the connection is closed, also between two requests
FAREWELL_S = 1.0  # for requests under way when the server ends, then they are cancelled

LOGGER = logging.getLogger(__name__)

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Doorkeeper:
    """Knows which connections have a request under way, and so which may be closed."""

    def __init__(self) -> None:
        self._busy: set[asyncio.BaseProtocol] = set()
        self._under_way: set[asyncio.Task[object]] = set()  # requests whose answers are not sent completely

    @web.middleware
    async def busy(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """While a request is handled its connection stays."""
        self._busy.add(request.protocol)
        if (task := asyncio.current_task()) is not None:
            self._under_way.add(task)
            task.add_done_callback(self._under_way.discard)
        try:
            return await handler(request)
        finally:
            self._busy.discard(request.protocol)

    async def end(self, _: web.Application) -> None:
        """Wait for the requests under way, and cancel those that do not end."""
        for cancelled in (False, True):
            for task in self._under_way if cancelled else ():
                task.cancel()
            if self._under_way:
                await asyncio.wait(self._under_way, timeout=FAREWELL_S)

    def protocol(self, server: web.Server) -> asyncio.BaseProtocol:
        """Return the protocol of the next connection to ``server``."""
        connections = [one for one in server.connections if one.transport is not None]
        if len(connections) < MAX_CONNECTIONS:
            return server()
        LOGGER.warning("more than %d connections; closing those idle longest", MAX_CONNECTIONS)
        idle = next((one for one in connections if one not in self._busy), None)
        if idle is None:
            return _TurnedAway()
        idle.force_close()
        return server()


class _TurnedAway(asyncio.Protocol):
    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        transport.close()
