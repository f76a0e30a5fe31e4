"""Who has a device or a port open, as far as ``/proc`` lets this user see."""

import os
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from lcf_edge.doctor.endpoints import Endpoint
from lcf_edge.doctor.finding import Finding, fail

_LISTENS = "0A"  # TCP_LISTEN
_DAEMON = [(name, command) for name in ("lcf-edge", "lcf_edge") for command in ("run", "record")]


@dataclass(frozen=True, slots=True)
class Process:
    """``files``: what it has open; None: another user's process, of which only root may know."""

    pid: int
    name: str
    is_daemon: bool  # it is ``lcf-edge run`` or ``record``
    files: frozenset[str] | None

    def __str__(self) -> str:
        return f"{self.name}, process {self.pid}"


def processes(proc: Path) -> Iterator[Process]:
    """Return all processes but this one."""
    for folder in sorted(proc.glob("[0-9]*")):
        try:
            words = (folder / "cmdline").read_bytes().decode(errors="replace").split("\0")
        except OSError:  # it has ended
            continue
        names = [Path(word).name for word in words]
        daemon = next((command for program, command in pairwise(names) if (program, command) in _DAEMON), None)
        name = f"lcf-edge {daemon}" if daemon else names[0] or "a thread of the kernel"
        if int(folder.name) != os.getpid():
            yield Process(int(folder.name), name, daemon is not None, _open_files(folder))


def holders(path: Path, proc: Path) -> list[Process]:
    """Return the processes known to have ``path`` open."""
    return [process for process in processes(proc) if str(path) in (process.files or ())]


def in_use(subject: str, path: Path, proc: Path) -> Finding:
    """Return the finding about a device that another program has open."""
    found = holders(path.resolve(), proc)
    if found:
        return fail(subject, f"{path}: in use by {' and '.join(map(str, found))}", f"kill {found[0].pid}")
    return fail(subject, f"{path}: in use by another user's program", f"sudo fuser -v {shlex.quote(str(path))}")


def daemon_with(path: Path, proc: Path) -> Process | None:
    """Return the daemon that has ``path`` open, or may have it."""
    daemons = (process for process in processes(proc) if process.is_daemon)
    return next((process for process in daemons if process.files is None or str(path) in process.files), None)


def listening(endpoint: Endpoint, proc: Path) -> Process | None:
    """Return the process that listens on a port, if this user may know it: a daemon rather than its gate."""
    sockets = {f"socket:[{inode}]" for inode in _inodes(endpoint, proc)}
    found = [process for process in processes(proc) if sockets & (process.files or set())]
    return min(found, key=lambda process: not process.is_daemon, default=None)


def _open_files(folder: Path) -> frozenset[str] | None:
    try:
        return frozenset(str(link.readlink()) for link in (folder / "fd").iterdir())
    except PermissionError:
        return None
    except OSError:  # it has ended, or closed a file
        return frozenset()


def _inodes(endpoint: Endpoint, proc: Path) -> Iterator[str]:
    """Return inodes of the sockets on a port, any address (Linux, ``Documentation/networking/proc_net_tcp.rst``)."""
    kind = "udp" if endpoint.datagrams else "tcp"
    for table in (proc / "net" / kind, proc / "net" / f"{kind}6"):
        lines = table.read_text(encoding="ascii").splitlines()[1:] if table.exists() else []
        for _, local, _, state, *rest in map(str.split, lines):
            if int(local.rpartition(":")[2], 16) == endpoint.port and (endpoint.datagrams or state == _LISTENS):
                yield rest[5]
