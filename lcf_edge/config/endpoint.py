"""Zenoh's endpoints, as ``tcp/127.0.0.1:7447``: what is wrong with one, because Zenoh would wait for it forever."""

import re

_WITH_PORTS = frozenset({"tcp", "udp", "tls", "quic", "ws"})
_MAX_PORT = 65535
_EXAMPLE = "write for example tcp/127.0.0.1:7447"


def bare(endpoint: str) -> str:
    """Return it without what follows ``#``, which may be a secret."""
    return endpoint.partition("#")[0]


def fault(endpoint: str) -> str:
    """Return what is wrong, with the remedy, without secrets; empty: nothing."""
    shown = bare(endpoint)
    protocol, slash, address = shown.partition("?")[0].partition("/")
    if not (protocol and slash and address):
        return f"{shown}: not an endpoint (protocol/address); {_EXAMPLE}"
    if protocol not in _WITH_PORTS:
        return ""
    host, colon, port = address.rpartition(":")
    if not host or (host.startswith("[") and not host.endswith("]")):
        return f"{shown}: {'no host' if colon and not host else 'no port'}; {_EXAMPLE}"
    if not re.fullmatch(r"[0-9]{1,5}", port) or int(port) > _MAX_PORT:
        return f"{shown}: invalid port; write a number up to {_MAX_PORT}"
    return ""
