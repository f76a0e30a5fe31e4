"""``lcf-edge gate``: stands in front of the daemon."""
# ruff: noqa: PLC0415

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from lcf_edge.errors import LcfError

if TYPE_CHECKING:
    from lcf_edge.gate.entrances import Entrance

DAEMON_PORT = 7448


def gate(tls: Path | None, host: str | None, port: int, to: str | None, write_line: Callable[[str], None]) -> None:
    """Pass authorised parties through to the daemon on this machine until a signal ends it. Raises ``LcfError``."""
    import asyncio
    import socket

    from lcf_edge.daemon import log
    from lcf_edge.gate.gate import BACKLOG, Gate, serve

    entrance, leads = _by_user(host, to) if tls is None else _by_certificate(tls, to)
    host = host or ("127.0.0.1" if tls is None else "0.0.0.0")
    log.start("info")
    try:
        listening = socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET, backlog=BACKLOG
        )
    except (OSError, OverflowError) as error:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise LcfError(f"gate: {host}:{port}: cannot listen ({reason}); choose with --listen, --port") from error
    with listening:
        write_line(f"{'tls' if tls else 'tcp'}/{host}:{listening.getsockname()[1]} leads to {leads}")
        asyncio.run(serve([listening], Gate(entrance)))


def _by_certificate(tls: Path, to: str | None) -> "tuple[Entrance, str]":
    from lcf_edge.gate.certificates import Certificates
    from lcf_edge.gate.entrances import ByCertificate

    certificates = Certificates(tls)
    try:
        port = DAEMON_PORT if to is None else int(to)
    except ValueError as error:
        raise LcfError(f"gate: --to {to}: with --tls the daemon's port is needed") from error
    names = ", ".join(sorted(certificates.parties))
    return ByCertificate(certificates, port), f"tls/127.0.0.1:{port} for {names}"


def _by_user(host: str | None, to: str | None) -> "tuple[Entrance, str]":
    from lcf_edge.gate.entrances import ByUser

    if to is None or "/" not in to or (host or "127.").partition(".")[0] != "127":
        raise LcfError("gate: without --tls it listens on 127.0.0.1 only, and needs --to with the daemon's Unix socket")
    return ByUser(Path(to)), f"unixsock-stream/{to} for programs on this computer"
