"""Serves a page until its event is set; what aiohttp complains of becomes one line each on standard error."""

import asyncio
import logging
import os
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from pathlib import PurePath

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError

from lcf_edge.daemon.log import NoFlood
from lcf_edge.errors import LcfError
from lcf_edge.web.doorkeeper import BACKLOG, LOGGER, REQUEST_WITHIN_S, Doorkeeper
from lcf_edge.web.guard import TOKEN, Guard

MAX_LINE = 300  # characters of a log line, some chosen by strangers

_KINDS = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


@dataclass(frozen=True)
class Place:
    """Where to listen. ``command``: for whom; ``remedy``: which options of it choose another place.

    ``is_private``: other users of this machine are kept out as well.
    """

    host: str
    port: int
    command: str
    remedy: str
    is_private: bool = False


async def serve_at(
    place: Place,
    application: Callable[[Guard, Doorkeeper], web.Application],
    ended: asyncio.Event,
    write_address: Callable[[str], None],
) -> None:
    """Serve until ``ended`` is set; ``write_address`` hears the page's address. Raises ``LcfError``."""
    handler = _OneLine(place.command)
    handler.addFilter(NoFlood())
    for logger in (logging.getLogger("aiohttp"), logging.getLogger("asyncio"), LOGGER):
        logger.handlers[:] = [handler]
        logger.propagate = False
    guard = Guard(place.host, is_private=place.is_private)
    door = Doorkeeper()
    runner = web.AppRunner(
        application(guard, door),
        access_log=None,
        handle_signals=False,
        shutdown_timeout=1.0,
        keepalive_timeout=REQUEST_WITHIN_S,
        lingering_time=REQUEST_WITHIN_S,
    )
    listening: asyncio.Server | None = None
    try:
        await runner.setup()
        listening = await _listen(runner, door, place)
        write_address(_address(place.host, listening.sockets[0].getsockname()[1], guard.token))
        await ended.wait()
    finally:
        if listening is not None:
            listening.close()
        await runner.cleanup()


def add_page(application: web.Application, package: str) -> None:
    """Send the files in ``page`` of a package, and those that all pages have in common."""
    for owner in (__package__, package):
        for file in (files(owner) / "page").iterdir():
            path = "/" if file.name == "index.html" else f"/{file.name}"
            application.router.add_get(path, _sent(file.read_bytes(), _KINDS[PurePath(file.name).suffix]))


def _sent(body: bytes, kind: str) -> Callable[[web.Request], Awaitable[web.Response]]:
    async def send(_: web.Request) -> web.Response:
        return web.Response(body=body, content_type=kind, charset="utf-8")

    return send


async def _listen(runner: web.AppRunner, door: Doorkeeper, place: Place) -> asyncio.Server:
    """Raises ``LcfError``."""
    assert runner.server is not None
    protocol = partial(door.protocol, runner.server)
    try:
        return await asyncio.get_running_loop().create_server(protocol, place.host, place.port, backlog=BACKLOG)
    except (OSError, OverflowError) as error:
        raise LcfError(_cannot_listen(error, place)) from error


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


def _cannot_listen(error: OSError | OverflowError, place: Place) -> str:
    code = getattr(error, "errno", None) or 0  # negative for an unknown name, with its own text
    reason = os.strerror(code) if code > 0 else getattr(error, "strerror", None) or str(error)
    return f"{place.command}: {place.host}:{place.port}: cannot listen ({reason}); choose with {place.remedy}"


class _OneLine(logging.StreamHandler):  # type: ignore[type-arg]
    """Logs aiohttp's complaints in one line each on standard error, without those about invalid HTTP."""

    def __init__(self, command: str) -> None:
        super().__init__()
        self._command = command

    def emit(self, record: logging.LogRecord) -> None:
        if not isinstance(_cause(record), HttpProcessingError):
            super().emit(record)

    def format(self, record: logging.LogRecord) -> str:
        cause = _cause(record)
        text = f"{record.getMessage()}{'' if cause is None else f': {cause!r}'}"
        return f"lcf-edge: warning: {self._command}: {' '.join(text.split())[:MAX_LINE]}"


def _cause(record: logging.LogRecord) -> BaseException | None:
    return record.exc_info[1] if record.exc_info else None
