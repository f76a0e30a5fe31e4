"""Serves browsers: the page, the updates over a WebSocket, the file of the last seconds, and a replay's controls.

A browser asks for each update when it has drawn the last one. So a slow one gets fewer updates but never old ones,
and nothing queues here; one that does not ask for ``SILENCE_S`` is disconnected. Previews are subscribed to only while
somebody looks.
"""

import asyncio
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING

import msgspec
from aiohttp import WSMsgType, web

from lcf_edge.config.endpoint import bare
from lcf_edge.dates import utc
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.live.history import History
from lcf_edge.monitor.live.monitor import Monitor
from lcf_edge.monitor.replay.replayed import Command, Replayed
from lcf_edge.monitor.web.saving import mcap_parts
from lcf_edge.monitor.web.update import Audience
from lcf_edge.web.doorkeeper import FAREWELL_S, Doorkeeper
from lcf_edge.web.guard import Guard
from lcf_edge.web.serving import Place, add_page, serve_at

if TYPE_CHECKING:
    from lcf_edge.monitor.replay.player import Player

INTERVAL_S = 0.1  # between two updates for one browser
PULSE_S = 1.0  # an update is sent even without news
SILENCE_S = 10.0
MAX_BROWSERS = 16
MAX_SAVES_AT_ONCE = 2  # each holds the messages of its file
MAX_COMMAND_BYTES = 256


async def serve(shown: DaemonAddress | Replayed, host: str, port: int, write_line: Callable[[str], None]) -> None:
    """Serve until SIGINT or SIGTERM; ``write_line`` hears the address. Raises ``PublishError``, ``LcfError``."""
    place = Place(host, port, "view", "--listen HOST and --port N")
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    server = Server(shown)
    try:
        await serve_at(place, server.application, ended, lambda address: write_line(f"open {address} (Ctrl-C ends)"))
    finally:
        server.close()


class Server:
    """Serves one daemon, or a recording in place of it."""

    def __init__(self, shown: DaemonAddress | Replayed) -> None:
        self._history = History()
        self._loop = asyncio.get_running_loop()
        self._came = asyncio.Event()
        self._sockets: dict[web.WebSocketResponse, web.Request] = {}
        self._saving = 0
        self._wanting = asyncio.Lock()
        self._player: Player | None = None
        if isinstance(shown, DaemonAddress):
            self._place, self._prefix = bare(shown.endpoint), shown.prefix
            self._monitor: Monitor | Player = Monitor(shown, history=self._history, changed=self._changed)
        else:
            self._place, self._prefix = str(shown.path), ""
            self._monitor = self._player = shown.player(self._changed)
            self._player.start()

    def application(self, guard: Guard, door: Doorkeeper) -> web.Application:
        """Return the application with all routes."""
        application = web.Application(middlewares=[door.busy])
        guard.protect(application)
        add_page(application, __package__)
        application.router.add_get("/updates", self._updates)
        if self._player is None:
            application.router.add_get("/save", self._save)
        else:
            application.router.add_post("/player", self._obey)
        application.on_shutdown.extend((self._let_go, door.end))
        return application

    def close(self) -> None:
        """Unsubscribe, or end the replay."""
        self._monitor.close()

    def _changed(self) -> None:
        """Called in Zenoh's threads."""
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._came.set)

    async def _updates(self, request: web.Request) -> web.StreamResponse:
        if len(self._sockets) >= MAX_BROWSERS:
            raise web.HTTPServiceUnavailable(text=f"{MAX_BROWSERS} browsers are already connected\n")
        browser = web.WebSocketResponse(max_msg_size=64, compress=False, timeout=1.0)
        await browser.prepare(request)
        self._sockets[browser] = request
        try:
            await self._switch_preview()
            await self._send_updates(browser)
        except (TimeoutError, ConnectionError):  # it is gone: it neither asks nor reads
            _abort(request)
        finally:
            self._sockets.pop(browser)
            await self._switch_preview()
            await browser.close()
        return browser

    async def _send_updates(self, browser: web.WebSocketResponse) -> None:
        audience, last_s = Audience(), -INTERVAL_S
        while (await browser.receive(SILENCE_S)).type is WSMsgType.TEXT:
            await asyncio.sleep(last_s + INTERVAL_S - time.monotonic())
            if self._monitor.snapshot().version == audience.sent_version:
                self._came.clear()
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._came.wait(), PULSE_S)
            last_s = time.monotonic()
            async with asyncio.timeout(SILENCE_S):
                for part in audience.update(self._monitor, self._place):
                    await (browser.send_str(part) if isinstance(part, str) else browser.send_bytes(part))

    async def _obey(self, request: web.Request) -> web.Response:
        """Obey slider and buttons; only JSON, which no form on another page can send."""
        if request.content_type != "application/json" or (request.content_length or 0) > MAX_COMMAND_BYTES:
            raise web.HTTPBadRequest(text="a JSON command is required\n")
        try:
            command = msgspec.json.decode(await request.content.read(MAX_COMMAND_BYTES), type=Command)
        except msgspec.DecodeError:
            raise web.HTTPBadRequest(text="no such command\n") from None
        assert self._player is not None
        command.give(self._player)
        return web.Response(status=204)

    async def _switch_preview(self) -> None:
        async with self._wanting:
            await asyncio.to_thread(self._monitor.switch_preview, bool(self._sockets))

    async def _save(self, request: web.Request) -> web.StreamResponse:
        if self._saving >= MAX_SAVES_AT_ONCE:
            raise web.HTTPServiceUnavailable(text=f"{MAX_SAVES_AT_ONCE} recordings are already being saved\n")
        self._saving += 1
        try:
            return await self._saved(request)
        finally:
            self._saving -= 1

    async def _saved(self, request: web.Request) -> web.StreamResponse:
        now_ns = time.time_ns()
        messages = self._history.messages(now_ns)
        if not messages:
            raise web.HTTPNotFound(text="nothing arrived in the last seconds: there is nothing to save\n")
        name = f"lcf-edge-{utc(now_ns):%Y%m%dT%H%M%SZ}.mcap"
        response = web.StreamResponse(
            headers={
                "Content-Disposition": f'attachment; filename="{name}"',
                "Content-Type": "application/octet-stream",
            }
        )
        try:
            await response.prepare(request)
            for part in mcap_parts(messages, self._prefix):
                async with asyncio.timeout(SILENCE_S):
                    await response.write(part)
            await response.write_eof()
        except (TimeoutError, ConnectionError):  # it does not read, or has gone
            _abort(request)
        return response

    async def _let_go(self, _: web.Application) -> None:
        ends = [browser.close(code=1001, message=b"lcf-edge view ends") for browser in self._sockets]
        with suppress(TimeoutError):
            async with asyncio.timeout(FAREWELL_S):
                await asyncio.gather(*ends)
        for request in self._sockets.values():  # those that did not read it
            _abort(request)


def _abort(request: web.Request) -> None:
    """Drop the connection with all unsent data."""
    if request.transport is not None:
        request.transport.abort()
