"""Zenoh's endpoints, as ``tcp/127.0.0.1:7447``: their parts, and whether somebody listens."""

import ipaddress
import re
import socket
from dataclasses import dataclass

CONNECT_S = 1.5

_ENCRYPTED = frozenset({"tls", "quic"})
_DATAGRAMS = frozenset({"udp", "quic"})
_ENDPOINT = re.compile(r"(?P<protocol>\w+)/\[?(?P<host>[^\]#?]*?)\]?:(?P<port>\d+)(?:[#?].*)?")


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A protocol, a host and a port."""

    protocol: str
    host: str
    port: int

    @property
    def encrypted(self) -> bool:
        """Whether it is encrypted."""
        return self.protocol in _ENCRYPTED

    @property
    def datagrams(self) -> bool:
        """Whether it uses UDP, else TCP."""
        return self.protocol in _DATAGRAMS

    @property
    def local(self) -> bool:
        """Whether only this computer can reach it."""
        try:
            return ipaddress.ip_address(self.host.partition("%")[0]).is_loopback
        except ValueError:
            return self.host == "localhost"


def parsed(endpoint: str) -> Endpoint | None:
    """Parse an endpoint; None: it has no port, as ``unixsock-stream//run/lcf``."""
    found = _ENDPOINT.fullmatch(endpoint)
    return Endpoint(found["protocol"], found["host"], int(found["port"])) if found else None


def reachable_here(endpoint: str) -> str:
    """Return where to connect on the same computer to what listens there."""
    return endpoint.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")


def is_open(endpoint: str) -> bool:
    """Whether somebody accepts connections there; UDP cannot be tried like that, and counts as open."""
    parts = parsed(endpoint)
    if parts is None or parts.datagrams:
        return True
    try:
        socket.create_connection((parts.host, parts.port), CONNECT_S).close()
    except (OSError, OverflowError):  # an invalid port
        return False
    return True
