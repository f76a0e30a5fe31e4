"""The daemon's own gate: a process in front of its plain TCP ports on loopback, which any local program can reach.

Zenoh has no limits for the keys that others declare: two of them end the daemon. So the session listens on a Unix
socket that only this user can reach, and the gate admits others to it.
"""

import ipaddress
import os
import re
import shutil
import socket
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import mkdtemp

import msgspec

from lcf_edge.config import Publish, Zenoh
from lcf_edge.errors import PublishError
from lcf_edge.tallies import Tallies
from lcf_edge.zenoh_link.topics import STANDARD

RESTART_S = 1.0
ENDS_WITHIN_S = 1.0
BACKLOG = 1024  # as that of lcf_edge.gate
_OWN = ("scene", "preview/compressed", "diagnostics", "speed", "query/scene", "query/config", "query/schema")
_LONGEST_PATH = 80  # a Unix socket's is 107 bytes
_TCP = re.compile(r"tcp/\[?(?P<host>[^\]#?/]+)\]?:(?P<port>\d+)")


def gated(options: Zenoh, publish: Publish) -> list[str]:
    """Return the endpoints that get a gate.

    None for a daemon that connects to others or is to be discovered by them: a gate would block part of that traffic.
    """
    simple = options.mode == "peer" and not options.connect and not options.gossip and not publish.ros2
    return [endpoint for endpoint in options.listen if options.gate and simple and _address(endpoint)]


def behind(options: Zenoh, publish: Publish, endpoint: str) -> Zenoh:
    """Return the options of a session that listens at ``endpoint`` in place of those that get a gate."""
    own = set(gated(options, publish))
    others = [one for one in options.listen if one not in own]
    return msgspec.structs.replace(options, listen=[endpoint, *others])


def _address(endpoint: str) -> tuple[str, int] | None:
    """Return host and port of a plain TCP endpoint on loopback, else None."""
    found = _TCP.fullmatch(endpoint)
    if found is None:
        return None
    host, port = ("127.0.0.1" if found["host"] == "localhost" else found["host"]), int(found["port"])
    with suppress(ValueError):
        return (host, port) if ipaddress.ip_address(host).is_loopback else None
    return None


class OwnGate:
    """Listens at ``endpoints``, and leads to ``endpoint``, in a folder of its own.

    A gate that ends is started again; meanwhile the ports stay, and clients wait. ``report`` gets messages for an
    operator. Raises ``PublishError`` for a port that cannot be listened on.
    """

    def __init__(self, endpoints: Sequence[str], prefix: str, report: Callable[[str], object]) -> None:
        self._report = report
        self._prefix = prefix
        self._restarts = 0
        self._ended = threading.Event()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._mind, name="gate", daemon=True)
        self._sockets: list[socket.socket] = []
        try:
            for endpoint in endpoints:
                self._sockets.append(_listening(endpoint))
        except PublishError:
            self._close_sockets()
            raise
        self._tallies = Tallies()
        self._folder = Path(mkdtemp(prefix="lcf-edge-", dir=_place()))
        self._path = self._folder / "zenoh"
        self.endpoint = f"unixsock-stream/{self._path}"

    def start(self) -> None:
        """Once the session listens."""
        self._thread.start()

    @property
    def counts(self) -> Counter[str]:
        """``gate refused``, ``gate restarts``."""
        return Counter({"gate refused": self._tallies.refused, "gate restarts": self._restarts})

    def received_bytes(self, address: str | bytes) -> int | None:
        """Return how much has come from an address; None: it is not of the gate's."""
        return self._tallies.received(address)

    def close(self) -> None:
        """End it, within ``ENDS_WITHIN_S``; may be called twice."""
        if self._ended.is_set():
            return
        self._ended.set()
        process = self._process
        if process is not None and process.stdin is not None:
            process.stdin.close()
        if self._thread.ident is not None:
            self._thread.join(ENDS_WITHIN_S)
        if self._thread.is_alive() and process is not None:
            process.kill()
            self._thread.join(ENDS_WITHIN_S)
        self._close_sockets()
        self._tallies.close()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _close_sockets(self) -> None:
        for one in self._sockets:
            one.close()

    def _mind(self) -> None:
        while not self._ended.is_set():
            try:
                self._process = self._started()
            except OSError as error:
                self._report(f"the gate cannot be started ({error.strerror}); tried again")
            else:
                status = self._process.wait()
                if self._ended.is_set():
                    return
                self._report(f"the gate has ended with status {status}; started again")
            self._restarts += 1
            self._ended.wait(RESTART_S)

    def _started(self) -> "subprocess.Popen[bytes]":
        sockets = [one.fileno() for one in self._sockets]
        own_keys = [f"{self._prefix}/{rest}" for rest in ("**", "@alive/*", "@alive/**", "query/*", *_OWN)]
        own_keys += [topic.key(self._prefix) for topic in STANDARD]
        return subprocess.Popen(
            (
                *(sys.executable, "-P", "-m", "lcf_edge.gate.own", "--tallies", str(self._tallies.descriptor)),
                *("--to", str(self._path), "--own-keys", "**", *own_keys, "--listening", *map(str, sockets)),
            ),
            pass_fds=(*sockets, self._tallies.descriptor),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=sys.stderr,
            env=_environment(),
        )


def _environment() -> dict[str, str]:
    """So that it finds this program, and nothing of the folder in which the daemon was started."""
    here = str(Path(__file__).parents[2])
    kept = {name: value for name, value in os.environ.items() if name not in {"NOTIFY_SOCKET", "WATCHDOG_USEC"}}
    return kept | {"PYTHONPATH": os.pathsep.join(filter(None, (here, os.environ.get("PYTHONPATH"))))}


def _listening(endpoint: str) -> socket.socket:
    address = _address(endpoint)
    assert address is not None
    family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
    try:
        return socket.create_server(address, family=family, backlog=BACKLOG)
    except OSError as error:
        if "already in use" in str(error):
            remedy = "already in use; stop the other program or set zenoh.listen to another port"
        else:
            remedy = f"{error.strerror}; check zenoh.listen and zenoh.connect"
        raise PublishError(f"{endpoint}: {remedy}") from error


def _place() -> str | None:
    """Where temporary files are, unless the path would be too long."""
    return "/tmp" if len(os.environ.get("TMPDIR", "")) > _LONGEST_PATH else None
