"""``lcf-edge foxglove``: the output of a running daemon, for the Foxglove app."""
# ruff: noqa: PLC0415

import signal
import threading
from collections.abc import Callable
from contextlib import closing

from lcf_edge.errors import LcfError
from lcf_edge.monitor.live.daemon_address import DaemonAddress

HOST = "127.0.0.1"


def foxglove(address: DaemonAddress, port: int, write_line: Callable[[str], None]) -> None:
    """Serve until a signal ends it. Raises ``PublishError``, and ``LcfError`` without the extra ``foxglove``."""
    try:
        import foxglove as _  # noqa: F401
    except ImportError as error:
        raise LcfError("foxglove: foxglove-sdk is missing; run pip install 'lcf-edge[foxglove]'") from error
    from lcf_edge.monitor.foxglove.relay import Relay

    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    with closing(Relay(address, HOST, port)) as relay:
        write_line(f"open a connection to ws://{HOST}:{relay.port} in Foxglove (Ctrl-C ends)")
        ended.wait()
