"""Zenoh's endpoints, as ``tcp/127.0.0.1:7447``: what is in them, and whether somebody is there."""

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
        """Whether what goes over it cannot be read on the way."""
        return self.protocol in _ENCRYPTED

    @property
    def datagrams(self) -> bool:
        """Whether it is on top of UDP; else of TCP."""
        return self.protocol in _DATAGRAMS

    @property
    def local(self) -> bool:
        """Whether only this computer can reach it."""
        try:
            return ipaddress.ip_address(self.host.partition("%")[0]).is_loopback
        except ValueError:
            return self.host == "localhost"


def parsed(endpoint: str) -> Endpoint | None:
    """The parts; None: it has no port, as ``unixsock-stream//run/lcf``."""
    found = _ENDPOINT.fullmatch(endpoint)
    return Endpoint(found["protocol"], found["host"], int(found["port"])) if found else None


def reachable_here(endpoint: str) -> str:
    """Where to connect on the same computer to what listens there."""
    return endpoint.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")


def is_open(endpoint: str) -> bool:
    """Whether somebody accepts there; what is on top of UDP cannot be tried so, and is taken for open."""
    parts = parsed(endpoint)
    if parts is None or parts.datagrams:
        return True
    try:
        socket.create_connection((parts.host, parts.port), CONNECT_S).close()
    except (OSError, OverflowError):  # the port is none
        return False
    return True
