"""A Zenoh session: opened so that nothing leaves the machine unasked, closed in bounded time.

By default a session is a peer that listens on loopback only: no scouting, no gossip, no shared memory
(which would cost 27 MB), few sessions, small messages.
"""

import json
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress

import zenoh

from lcf_edge import config
from lcf_edge.config.endpoint import bare, fault
from lcf_edge.errors import PublishError
from lcf_edge.zenoh_link import admission

CLOSING_S = 1.0  # a frozen peer would hold up the closing for 10 s

MAX_MESSAGE_BYTES = 2**20
"""Larger incoming messages are dropped before they are put together; nothing that is published is this large."""

MAX_SESSIONS = 32
"""Largest number of sessions; each takes some 160 kB. Zenoh does not report whom it refuses."""

_SECRET = re.compile(r"(\b[\w-]+/[^\s#]+)#\S*[^\s:]")
"""What an endpoint carries, in Zenoh's messages."""

_UNLESS_THE_FILE_SAYS = {
    "scouting/multicast/enabled": "false",
    "scouting/delay": "0",  # ms; nobody is scouted, so nobody is waited for
    "transport/shared_memory/enabled": "false",
    "transport/link/rx/max_message_size": str(MAX_MESSAGE_BYTES),
    "transport/unicast/max_sessions": str(MAX_SESSIONS),
    "transport/unicast/accept_timeout": "2000",  # ms; a silent connection takes one of 100 places
}


def open_session(options: config.Zenoh, publish: config.Publish | None = None) -> zenoh.Session:
    """Open a session; close it with ``close_session``, or use ``opened_session``.

    ``options.config_file`` is read first; the keys override it, but an empty list leaves the file's. ``publish``:
    what a daemon publishes, which then accepts only what it needs; None: accept everything. Raises
    ``PublishError`` that names the endpoint or the file.
    """
    settings = _settings(options, admission.settings(options, publish) if publish else {})
    try:
        return zenoh.open(settings)
    except zenoh.ZError as error:
        raise PublishError(_remedy(error, options)) from error


def close_session(session: zenoh.Session, timeout_s: float = CLOSING_S) -> bool:
    """Close a session; False when a frozen peer held it up, then it is closed when the process ends."""

    def close() -> None:
        with suppress(zenoh.ZError):  # it took too long
            session.close()  # type: ignore[no-untyped-call]

    thread = threading.Thread(target=close, name="zenoh close", daemon=True)
    thread.start()
    thread.join(timeout_s)
    return not thread.is_alive()


@contextmanager
def opened_session(options: config.Zenoh) -> Iterator[zenoh.Session]:
    """An open session that is closed at the end, in bounded time. Raises ``PublishError``."""
    session = open_session(options)
    try:
        yield session
    finally:
        close_session(session)


def reason(error: zenoh.ZError) -> str:
    """Return the innermost reason, without positions in Zenoh's source."""
    return _reason(str(error))


def _reason(said: str) -> str:
    text = re.sub(r"\s+at /\S+", "", said).replace("\n", " ")
    inner = re.search(r"\[([^\]]+ \(os error \d+\))", text)
    return (inner[1] if inner else text).strip(" .!]")


def _settings(options: config.Zenoh, admitted: Mapping[str, str]) -> zenoh.Config:
    try:
        settings = zenoh.Config.from_file(options.config_file) if options.config_file else zenoh.Config()
    except zenoh.ZError as error:
        raise PublishError(
            f"{options.config_file}: no valid Zenoh configuration ({reason(error)}); fix it, or name another"
        ) from error
    untouched = zenoh.Config()
    for key, value in {**_UNLESS_THE_FILE_SAYS, **admitted}.items():
        if settings.get_json(key) == untouched.get_json(key):
            _insert(settings, key, value)
    settings.insert_json5("scouting/gossip/enabled", json.dumps(options.gossip))
    settings.insert_json5("mode", json.dumps(options.mode))
    for name, endpoints in (("connect", options.connect), ("listen", options.listen)):
        for wrong in filter(None, map(fault, endpoints)):  # Zenoh would try to connect to it forever
            raise PublishError(f"zenoh.{name}: {wrong}")
        key = f"{name}/endpoints"
        if endpoints or settings.get_json(key) == untouched.get_json(key):  # else Zenoh listens on all interfaces
            try:
                settings.insert_json5(key, json.dumps(endpoints))
            except zenoh.ZError as error:
                shown = ", ".join(map(bare, endpoints))
                raise PublishError(
                    f"zenoh.{name}: {shown}: what follows ? or # cannot be read; write key=value"
                ) from error
    return settings


def _insert(settings: zenoh.Config, key: str, value: str) -> None:
    """Insert a setting. Raises ``PublishError`` for the prefix, the only part that can be invalid."""
    try:
        settings.insert_json5(key, value)
    except zenoh.ZError as error:
        raise PublishError(f"publish.prefix: no valid key ({reason(error)})") from error


def _remedy(error: zenoh.ZError, options: config.Zenoh) -> str:
    """Return Zenoh's message as one line that says what to do, without the secrets of endpoints."""
    said = _SECRET.sub(r"\1", str(error))
    bound = re.search(r"bound to ([^\s,\]]+):", said)
    endpoint = bound[1] if bound else ", ".join(map(bare, options.listen + options.connect)) or options.config_file
    if "Address already in use" in said:
        return f"{endpoint}: already in use; stop the other program or set zenoh.listen to another port"
    if "Unable to connect" in said:
        return f"{endpoint}: nobody answers; start the router first, or set zenoh.mode to peer, which waits for it"
    return f"{endpoint}: {_reason(said)}; check zenoh.listen and zenoh.connect"
