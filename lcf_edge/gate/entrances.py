"""How the gate tells parties from strangers, and how it reaches the daemon for them."""

import asyncio
import socket
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from lcf_edge.gate.certificates import ROVER_NAME, Certificates, common_name
from lcf_edge.gate.zenoh_batches import LENGTH_BYTES

HANDSHAKE_S = 5.0
PIECE_BYTES = 2**16
MAX_OF_ONE_NAME = 8  # connections of one common name
MAX_PARTIES = 32  # connections in all
CONNECTIONS = Path("/proc/net/tcp")

Stream = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@dataclass(frozen=True, slots=True)
class Party:
    """Who is no stranger any more. ``said``: what it has said already."""

    stream: Stream
    name: str
    said: bytes = b""


class Entrance(Protocol):
    """Raises ``OSError`` or ``IncompleteReadError`` for strangers, and when the daemon is away."""

    most_of_one_name: int
    stranger: str
    """What those are counted as who stay one."""

    async def meet(self, connection: socket.socket) -> Party:
        """Return who came; until then it is a stranger."""
        ...

    def knows(self, name: str) -> bool:
        """Whether the daemon has a place for that name."""
        ...

    async def dial(self, name: str) -> Stream:
        """Connect to the daemon."""
        ...


class ByCertificate:
    """Of those on the network, by TLS."""

    most_of_one_name = MAX_OF_ONE_NAME
    stranger = "no certificate"

    def __init__(self, certificates: Certificates, daemon_port: int) -> None:
        self._certificates, self._daemon_port = certificates, daemon_port

    async def meet(self, connection: socket.socket) -> Party:
        """Return who has shown a certificate."""
        loop = asyncio.get_running_loop()
        reader = asyncio.StreamReader(PIECE_BYTES)
        protocol = asyncio.StreamReaderProtocol(reader)
        transport, _ = await loop.connect_accepted_socket(
            lambda: protocol, connection, ssl=self._certificates.server, ssl_handshake_timeout=HANDSHAKE_S
        )
        writer = asyncio.StreamWriter(transport, protocol, reader, loop)
        return Party((reader, writer), common_name(writer.get_extra_info("ssl_object")))

    def knows(self, name: str) -> bool:
        """Whether the daemon has a certificate of that name."""
        return name in self._certificates.parties

    async def dial(self, name: str) -> Stream:
        """Connect to the daemon's TLS port."""
        context = self._certificates.parties[name]
        return await asyncio.open_connection(
            "127.0.0.1", self._daemon_port, ssl=context, server_hostname=ROVER_NAME, limit=PIECE_BYTES
        )


class ByUser:
    """Of programs on this computer, by the user who runs them."""

    most_of_one_name = MAX_PARTIES
    stranger = "said nothing"

    def __init__(self, path: Path) -> None:
        self._path = path

    async def meet(self, connection: socket.socket) -> Party:
        """Return who has said something."""
        reader, writer = await asyncio.open_connection(sock=connection, limit=PIECE_BYTES)
        try:
            async with asyncio.timeout(HANDSHAKE_S):
                length = await reader.readexactly(LENGTH_BYTES)
                said = length + await reader.readexactly(int.from_bytes(length, "little"))
            return Party((reader, writer), f"user {_user(connection)}", said)
        except BaseException:
            writer.transport.abort()
            raise

    def knows(self, _: str) -> bool:
        """Every user."""
        return True

    async def dial(self, _: str) -> Stream:
        """Connect to the daemon's Unix socket."""
        return await asyncio.open_unix_connection(self._path, limit=PIECE_BYTES)


def _user(connection: socket.socket) -> str:
    """Return the number of the user at the other end, on this computer."""
    ends = [_as_listed(*end) for end in (connection.getpeername(), connection.getsockname())]
    with CONNECTIONS.open(encoding="ascii") as lines:
        return next((parts[7] for parts in map(str.split, lines) if parts[1:3] == ends), "unknown")


def _as_listed(host: str, port: int) -> str:
    return f"{struct.unpack('=I', socket.inet_aton(host))[0]:08X}:{port:04X}"
