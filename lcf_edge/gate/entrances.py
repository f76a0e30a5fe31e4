"""How the gate tells parties from strangers, and how it reaches the daemon for them."""

import asyncio
import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from lcf_edge.gate.certificates import ROVER_NAME, Certificates, common_name
from lcf_edge.gate.zenoh_batches import GREETINGS, LENGTH_BYTES, is_greeting
from lcf_edge.tallies import Place, Tallies

HANDSHAKE_S = 5.0
DIAL_S = 2.0
PIECE_BYTES = 2**16
MAX_OF_ONE_NAME = 8  # connections of one common name
MAX_OF_ONE_USER = 16
MAX_PARTIES = 32  # connections in all
CONNECTIONS = Path("/proc/self/net")  # the unit hides /proc/net

Stream = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@dataclass(frozen=True, slots=True)
class Party:
    """Who is no stranger any more. ``greeted``: batches that have passed already. ``place``: where it is counted."""

    stream: Stream
    name: str
    inner: Stream | None = None
    greeted: int = 0
    place: Place | None = None

    def leave(self) -> None:
        """Cut both connections: closing would wait 30 s for a farewell, and hold a descriptor meanwhile."""
        for _, writer in filter(None, (self.stream, self.inner)):
            writer.transport.abort()
        if self.place is not None:
            self.place.leave()


class DaemonAwayError(OSError):
    """The daemon does not answer."""


class Entrance(Protocol):
    """Raises ``OSError`` or ``IncompleteReadError`` for strangers, ``DaemonAwayError`` when the daemon is away."""

    max_of_one_name: int
    stranger: str
    """What those are counted as who stay one."""

    async def meet(self, connection: socket.socket, greeted: Callable[[], object]) -> Party:
        """Return who came; until then it is a stranger. ``greeted``: called when it has said how it greets."""
        ...

    def knows(self, name: str) -> bool:
        """Whether the daemon has a place for that name."""
        ...

    async def dial(self, party: Party) -> Stream:
        """Return its connection to the daemon."""
        ...


class ByCertificate:
    """Of those on the network, by TLS."""

    max_of_one_name = MAX_OF_ONE_NAME
    stranger = "no certificate"

    def __init__(self, certificates: Certificates, daemon_port: int) -> None:
        self._certificates, self._daemon_port = certificates, daemon_port

    async def meet(self, connection: socket.socket, _greeted: Callable[[], object]) -> Party:
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

    async def dial(self, party: Party) -> Stream:
        """Connect to the daemon's TLS port."""
        context = self._certificates.parties[party.name]
        async with asyncio.timeout(DIAL_S):
            return await asyncio.open_connection(
                "127.0.0.1", self._daemon_port, ssl=context, server_hostname=ROVER_NAME, limit=PIECE_BYTES
            )


class ByUser:
    """Of programs on this computer, by the user who runs them. ``tallies``: where they are counted."""

    max_of_one_name = MAX_OF_ONE_USER
    stranger = "no session"

    def __init__(self, path: Path, tallies: Tallies | None = None) -> None:
        self._path, self._tallies = path, tallies or Tallies()

    async def meet(self, connection: socket.socket, greeted: Callable[[], object]) -> Party:
        """Return who has opened a session with the daemon."""
        stream = await asyncio.open_connection(sock=connection, limit=PIECE_BYTES)
        party = Party(stream, "")
        try:
            async with asyncio.timeout(HANDSHAKE_S):
                said = await _greeting(stream[0])
                greeted()
                name = _user(connection)
                place = self._tallies.take()
                party = Party(stream, name, None, GREETINGS, place)
                inner = await self._connected(place)
                party = Party(stream, party.name, inner, GREETINGS, place)
                await _exchange(said, party.stream, inner)
                await _exchange(await _batch(stream[0]), party.stream, inner)
        except BaseException:
            party.leave()
            raise
        return party

    def knows(self, _: str) -> bool:
        """Every user."""
        return True

    async def dial(self, party: Party) -> Stream:
        """It has one."""
        assert party.inner is not None
        return party.inner

    async def _connected(self, place: Place) -> Stream:
        """Connect to the daemon's Unix socket, from an address by which it knows the place."""
        connection = socket.socket(socket.AF_UNIX)
        try:
            connection.setblocking(False)
            connection.bind(place.address)
            await asyncio.get_running_loop().sock_connect(connection, str(self._path))
        except OSError as error:
            connection.close()
            raise DaemonAwayError from error
        except BaseException:
            connection.close()
            raise
        return await asyncio.open_unix_connection(sock=connection, limit=PIECE_BYTES)


async def _batch(reader: asyncio.StreamReader) -> bytes:
    """Return the next one, with its length."""
    length = await reader.readexactly(LENGTH_BYTES)
    return length + await reader.readexactly(int.from_bytes(length, "little"))


async def _greeting(reader: asyncio.StreamReader) -> bytes:
    """Return the first batch. Raises ``OSError`` for what is none of Zenoh's."""
    said = await _batch(reader)
    if not is_greeting(said):
        raise OSError("nothing of Zenoh's")
    await asyncio.sleep(0)  # whose farewell has come as well is nobody for the daemon
    if reader.at_eof() or reader.exception() is not None:
        raise OSError("gone")
    return said


async def _exchange(said: bytes, outer: Stream, inner: Stream) -> None:
    """Pass on a greeting, and the answer to it."""
    inner[1].write(said)
    outer[1].write(await _batch(inner[0]))


def _user(connection: socket.socket) -> str:
    """Return who is at the other end, on this computer."""
    ends = [_as_listed(end[0], end[1]) for end in (connection.getpeername(), connection.getsockname())]
    table = CONNECTIONS / ("tcp6" if connection.family == socket.AF_INET6 else "tcp")
    with suppress(OSError), table.open(encoding="ascii") as lines:
        return next((f"user {parts[7]}" for parts in map(str.split, lines) if parts[1:3] == ends), "an unknown user")
    return "an unknown user"


def _as_listed(host: str, port: int) -> str:
    """As in /proc/net/tcp and tcp6: words of 32 bits, each as the processor has it."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    words = struct.iter_unpack("=I", socket.inet_pton(family, host.partition("%")[0]))
    return "".join(f"{word:08X}" for (word,) in words) + f":{port:04X}"
