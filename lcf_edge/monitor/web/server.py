"""Serves browsers: the page, the updates over a WebSocket, the file of the last seconds, and a replay's controls.

A browser asks for each update when it has drawn the last one. So a slow one gets fewer updates but never old ones,
and nothing queues here; one that does not ask for ``SILENCE_S`` is disconnected. Previews are subscribed to only while
somebody looks.
"""

import asyncio
import logging
import os
import signal
import socket
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from importlib.resources import files
from typing import TYPE_CHECKING

import msgspec
from aiohttp import WSMsgType, web
from aiohttp.http_exceptions import HttpProcessingError

from lcf_edge.config.endpoint import bare
from lcf_edge.daemon.log import NoFlood
from lcf_edge.dates import utc
from lcf_edge.errors import LcfError
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.live.history import History
from lcf_edge.monitor.live.monitor import Monitor
from lcf_edge.monitor.replay.replayed import Command, Replayed
from lcf_edge.monitor.web.doorkeeper import BACKLOG, FAREWELL_S, LOGGER, REQUEST_WITHIN_S, Doorkeeper
from lcf_edge.monitor.web.guard import TOKEN, Guard
from lcf_edge.monitor.web.saving import mcap_parts
from lcf_edge.monitor.web.update import Audience

if TYPE_CHECKING:
    from lcf_edge.monitor.replay.player import Player

INTERVAL_S = 0.1  # between two updates for one browser
PULSE_S = 1.0  # an update is sent even without news
SILENCE_S = 10.0
MAX_BROWSERS = 16
MAX_LINE = 300  # characters of a log line, some chosen by strangers
MAX_SAVES_AT_ONCE = 2  # each holds the messages of its file
MAX_COMMAND_BYTES = 256

PAGE = {
    "index.html": "text/html",
    "page.css": "text/css",
    "page.js": "text/javascript",
    "player.js": "text/javascript",
    "picture.js": "text/javascript",
    "tables.js": "text/javascript",
    "topdown.js": "text/javascript",
    "traces.js": "text/javascript",
    "writing.js": "text/javascript",
    "icon.svg": "image/svg+xml",
}


async def serve(shown: DaemonAddress | Replayed, host: str, port: int, write_line: Callable[[str], None]) -> None:
    """Serve until SIGINT or SIGTERM; ``write_line`` hears the address. Raises ``PublishError``, ``LcfError``."""
    handler = _OneLine()
    handler.addFilter(NoFlood())
    for logger in (logging.getLogger("aiohttp"), logging.getLogger("asyncio"), LOGGER):
        logger.handlers[:] = [handler]
        logger.propagate = False
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, ended.set)
    guard = Guard(host)
    server = Server(shown)
    door = Doorkeeper()
    runner = web.AppRunner(
        server.application(guard, door),
        access_log=None,
        handle_signals=False,
        shutdown_timeout=1.0,
        keepalive_timeout=REQUEST_WITHIN_S,
        lingering_time=REQUEST_WITHIN_S,
    )
    listening: asyncio.Server | None = None
    try:
        await runner.setup()
        listening = await _listen(runner, door, host, port)
        write_line(f"open {_address(host, listening.sockets[0].getsockname()[1], guard.token)} (Ctrl-C ends)")
        await ended.wait()
    finally:
        if listening is not None:
            listening.close()
        await runner.cleanup()
        server.close()


async def _listen(runner: web.AppRunner, door: Doorkeeper, host: str, port: int) -> asyncio.Server:
    """Raises ``LcfError``."""
    assert runner.server is not None
    protocol = partial(door.protocol, runner.server)
    try:
        return await asyncio.get_running_loop().create_server(protocol, host, port, backlog=BACKLOG)
    except (OSError, OverflowError) as error:
        raise LcfError(_cannot_listen(error, host, port)) from error


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
        for name, kind in PAGE.items():
            path = "/" if name == "index.html" else f"/{name}"
            application.router.add_get(path, _sent(name, kind))
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


def _sent(name: str, kind: str) -> Callable[[web.Request], Awaitable[web.Response]]:
    """Send a file of the page."""
    body = (files("lcf_edge.monitor.web") / "page" / name).read_bytes()

    async def send(_: web.Request) -> web.Response:
        return web.Response(body=body, content_type=kind, charset="utf-8")

    return send


def _address(host: str, port: int, token: str | None) -> str:
    if token is None:
        return f"http://{f'[{host}]' if ':' in host else host}:{port}/"
    return f"http://{_own_address(host)}:{port}/?{TOKEN}={token}"


def _own_address(host: str) -> str:
    """Return the address by which others probably reach this machine; nothing is sent."""
    if host not in {"0.0.0.0", "::", ""}:
        return f"[{host}]" if ":" in host else host
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))
        return str(probe.getsockname()[0])
    return socket.gethostname()


def _cannot_listen(error: OSError | OverflowError, host: str, port: int) -> str:
    code = getattr(error, "errno", None) or 0  # negative for an unknown name, with its own text
    reason = os.strerror(code) if code > 0 else getattr(error, "strerror", None) or str(error)
    return f"view: {host}:{port}: cannot listen ({reason}); choose with --listen HOST and --port N"


class _OneLine(logging.StreamHandler):  # type: ignore[type-arg]
    """Logs aiohttp's complaints in one line each on standard error, without those about invalid HTTP."""

    def emit(self, record: logging.LogRecord) -> None:
        if not isinstance(_cause(record), HttpProcessingError):
            super().emit(record)

    def format(self, record: logging.LogRecord) -> str:
        cause = _cause(record)
        text = f"{record.getMessage()}{'' if cause is None else f': {cause!r}'}"
        return f"lcf-edge: warning: view: {' '.join(text.split())[:MAX_LINE]}"


def _cause(record: logging.LogRecord) -> BaseException | None:
    return record.exc_info[1] if record.exc_info else None
