"""Open connections, and how much of the daemon's memory each is charged with.

Zenoh keeps what peers declare, has no limit for it, and does not report who declared what. So whenever the memory of
the process has grown, the connections that have sent data meanwhile are charged with it, each by its share, but with no
more than its bytes can have caused. TCP counts bytes, and so does a gate; other Unix sockets do not: the unexplained
rest is charged to all of them equally.
"""

import os
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress

_DESCRIPTORS = "/proc/self/fd"
MAX_PER_BYTE = 128
"""Bytes of memory that one byte received can take: a key that is declared takes 1.5 kB, by 20 bytes at least."""

_MIB = 2**20
_TCP_INFO_BYTES = 192
_RECEIVED = slice(128, 136)  # tcpi_bytes_received of struct tcp_info, linux/tcp.h

Connection = int
"""The inode number of its socket."""


class Connections:
    """The connections that others have made to this process. Totals of all: ``charged_mib``, ``received_bytes``.

    ``received_from``: what a gate has counted from the address of a Unix socket; None: it is none of a gate's.
    """

    def __init__(self, received_from: Callable[[str | bytes], int | None] = lambda _: None) -> None:
        self._received_from = received_from
        self.charged_mib = 0.0
        self.received_bytes = 0
        self._received: dict[Connection, int] = {}  # bytes, at the last look
        self._charges_mib: dict[Connection, float] = {}

    def charge(self, grown_mib: float) -> None:
        """Charge connections for growth of memory since the last call, in proportion to their bytes (0: no growth)."""
        try:
            received = {number: self._bytes_received(one) for number, one in _accepted()}
        except OSError:  # no descriptor is left to look with: the next look counts this one's
            return
        silent = [number for number, count in received.items() if count is None]
        counts = {number: count for number, count in received.items() if count is not None}
        brought = {number: max(count - self._received.get(number, 0), 0) for number, count in counts.items()}
        self._received = counts
        self._charges_mib = {number: self._charges_mib.get(number, 0.0) for number in received}
        total = sum(brought.values())
        self.received_bytes += total
        explained_mib = min(grown_mib, total * MAX_PER_BYTE / _MIB)
        for number, count in brought.items():
            self._lay(number, explained_mib * count / max(total, 1))
        for number in silent:
            self._lay(number, (grown_mib - explained_mib) / len(silent))

    def _bytes_received(self, one: socket.socket) -> int | None:
        """None: unknown."""
        if one.family == socket.AF_UNIX:
            return self._received_from(one.getpeername())
        info = one.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _TCP_INFO_BYTES)
        return int.from_bytes(info[_RECEIVED], sys.byteorder)

    def _lay(self, number: Connection, charge_mib: float) -> None:
        self.charged_mib += charge_mib
        self._charges_mib[number] += charge_mib

    def cut(self, charge_mib: float) -> int:
        """Shut down connections that are charged with that much or more. Return how many."""
        guilty = {number for number, charge in self._charges_mib.items() if charge >= charge_mib}
        cut = 0
        with suppress(OSError):  # no descriptor is left to look with
            for number, one in _accepted():
                if number in guilty:
                    with suppress(OSError):  # it has just ended by itself
                        one.shutdown(socket.SHUT_RDWR)
                    cut += 1
                    del self._charges_mib[number]
        return cut


def _accepted() -> Iterator[tuple[Connection, socket.socket]]:
    """Every connection to a port or path on which this process listens; each socket is a copy, closed after its turn.

    Raises ``OSError`` when there is no descriptor left.
    """
    places = {_place(one) for one in _sockets() if one.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)}
    for one in _sockets():
        with suppress(OSError):  # not connected, or no longer
            one.getpeername()
            if _place(one) in places:
                yield os.fstat(one.fileno()).st_ino, one


def _place(one: socket.socket) -> int | str | bytes:
    """Return what it was connected to: a port, or the path of a Unix socket."""
    name: tuple[str, int] | str | bytes = one.getsockname()
    return name[1] if isinstance(name, tuple) else name


def _sockets() -> Iterator[socket.socket]:
    for number in os.listdir(_DESCRIPTORS):  # noqa: PTH208  # called often; pathlib takes twice the time
        one = _stream_socket(number)
        if one is not None:
            with one:
                yield one


def _stream_socket(number: str) -> socket.socket | None:
    """Return a copy of a descriptor if it is a stream socket, else None."""
    try:
        if not os.readlink(f"{_DESCRIPTORS}/{number}").startswith("socket:"):  # noqa: PTH115
            return None
        copy = os.dup(int(number))
    except OSError:  # closed meanwhile, or none is left for the copy
        return None
    try:
        one = socket.socket(fileno=copy)
    except OSError:
        os.close(copy)
        return None
    if one.family in {socket.AF_INET, socket.AF_INET6, socket.AF_UNIX} and one.type == socket.SOCK_STREAM:
        return one
    one.close()
    return None
