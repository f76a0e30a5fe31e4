"""``lcf-edge gate``: stands in front of the daemon's TLS port."""
# ruff: noqa: PLC0415

import os
from collections.abc import Callable
from pathlib import Path

from lcf_edge.errors import LcfError


def gate(tls: Path, host: str, port: int, daemon_port: int, tell: Callable[[str], None]) -> None:
    """Let parties through to the daemon on this machine until a signal ends it. Raises ``LcfError``."""
    import asyncio
    import socket

    from lcf_edge.daemon import log
    from lcf_edge.gate.certificates import Certificates
    from lcf_edge.gate.gate import BACKLOG, serve

    certificates = Certificates(tls)
    log.start("info")
    try:
        listening = socket.create_server(
            (host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET, backlog=BACKLOG
        )
    except (OSError, OverflowError) as error:
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else str(error)
        raise LcfError(
            f"gate: {host}:{port}: cannot be listened on ({reason}); choose with --listen, --port"
        ) from error
    with listening:
        names = ", ".join(sorted(certificates.parties))
        tell(f"tls/{host}:{listening.getsockname()[1]} leads to tls/127.0.0.1:{daemon_port} for {names}")
        asyncio.run(serve(listening, ("127.0.0.1", daemon_port), certificates))
