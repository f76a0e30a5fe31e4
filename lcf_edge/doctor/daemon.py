"""The daemon that runs already, asked over Zenoh instead of opening its devices a second time."""

import queue
from dataclasses import dataclass

import msgspec
import zenoh

from lcf_edge import config
from lcf_edge.cdr import CdrError, decode_diagnostics
from lcf_edge.config import Config
from lcf_edge.config.endpoint import bare
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.doctor.endpoints import is_open, reachable_here
from lcf_edge.errors import LcfError
from lcf_edge.zenoh_link.diagnostics import DIAGNOSTICS
from lcf_edge.zenoh_link.session import opened_session

ANSWER_S = 3.0  # diagnostics come once a second
_ANY_PORT = "tcp/127.0.0.1:0"


@dataclass(frozen=True, slots=True)
class Daemon:
    """``statuses``: its latest diagnostics, by name. ``scene``: "" when it has one, else why not."""

    endpoint: str
    statuses: dict[str, DeviceStatus]
    scene: str


def ask(configured: Config) -> Daemon | None:
    """The daemon at ``zenoh.listen``; None: nobody listens there, or no daemon answers within ``ANSWER_S``."""
    endpoints = [endpoint for endpoint in map(reachable_here, configured.zenoh.listen) if is_open(endpoint)]
    if not endpoints:
        return None
    options = msgspec.structs.replace(
        configured.zenoh, mode="peer", connect=endpoints, listen=[_ANY_PORT], gossip=False
    )
    try:
        return _ask_at(options, configured.publish.prefix, ", ".join(map(bare, endpoints)))
    except (LcfError, zenoh.ZError):  # these certificates or this file do not work
        return None


def _ask_at(options: config.Zenoh, prefix: str, endpoint: str) -> Daemon | None:
    heard: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
    with opened_session(options) as session:
        session.declare_subscriber(DIAGNOSTICS.key(prefix), heard.put)
        try:
            message = decode_diagnostics(heard.get(timeout=ANSWER_S).payload.to_bytes())
        except (queue.Empty, CdrError):
            return None
        return Daemon(endpoint, {status.name: status for status in message.status}, _scene(session, prefix))


def _scene(session: zenoh.Session, prefix: str) -> str:
    for reply in session.get(f"{prefix}/query/scene", timeout=ANSWER_S):
        return "" if reply.ok is not None else (reply.err.payload.to_string() if reply.err else "no answer")
    return "no answer"
