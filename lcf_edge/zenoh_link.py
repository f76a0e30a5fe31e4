"""The link to the outside: a Zenoh session, the publisher of scenes, and a subscriber.

By default a session is a peer that listens on loopback only: nobody is scouted, no gossip, no shared memory
(which would cost 27 MB). Close every session (each is a context manager): a process that ends with one open
may hang.
"""

import hashlib
import json
import re
import struct
import threading
import time
from collections.abc import Generator

import zenoh

from lcf_edge import config
from lcf_edge.cdr import decode_scene, encode_scene
from lcf_edge.errors import PublishError
from lcf_edge.records import Scene

SCENE_ENCODING = "application/cdr;lcf_msgs/msg/Scene"
ATTACHMENT = struct.Struct("<qqB16s")
"""Attachment of rmw_zenoh, 33 bytes: sequence number, source time (ns), length of the gid (16), gid."""

_QUIET = ("scouting/multicast/enabled", "scouting/gossip/enabled", "transport/shared_memory/enabled")


def open_session(options: config.Zenoh) -> zenoh.Session:
    """Open a session; use it as a context manager, so that it is closed.

    ``options.config_file`` is read first; ``mode``, ``connect`` and ``listen`` go on top of it, where an
    empty list leaves the file's. Raises ``PublishError`` that names the endpoint or the file.
    """
    settings = _settings(options)
    try:
        return zenoh.open(settings)
    except zenoh.ZError as error:
        raise PublishError(_remedy(str(error), options)) from error


def _settings(options: config.Zenoh) -> zenoh.Config:
    try:
        settings = zenoh.Config.from_file(options.config_file) if options.config_file else zenoh.Config()
    except zenoh.ZError as error:
        reason = _reason(str(error))
        raise PublishError(
            f"{options.config_file}: no valid Zenoh configuration ({reason}); mend zenoh.config_file"
        ) from error
    untouched = zenoh.Config()
    for key in _QUIET:
        if settings.get_json(key) == untouched.get_json(key):
            settings.insert_json5(key, "false")
    settings.insert_json5("mode", json.dumps(options.mode))
    for name, endpoints in (("connect", options.connect), ("listen", options.listen)):
        if endpoints or not options.config_file:
            try:
                settings.insert_json5(f"{name}/endpoints", json.dumps(endpoints))
            except zenoh.ZError as error:
                wrong = f"zenoh.{name}: {', '.join(endpoints)}: {_reason(str(error))}"
                raise PublishError(f"{wrong}; write for example tcp/127.0.0.1:7447") from error
    return settings


def _remedy(message: str, options: config.Zenoh) -> str:
    """Zenoh's message as one line that says what to do."""
    bound = re.search(r"bound to ([^\s,\]]+):", message)
    endpoint = bound[1] if bound else ", ".join(options.listen + options.connect) or options.config_file
    if "Address already in use" in message:
        return f"{endpoint}: already in use; stop the other program or set zenoh.listen to another port"
    return f"{endpoint}: {_reason(message)}; check zenoh.listen and zenoh.connect"


def _reason(message: str) -> str:
    """The innermost reason, without the places in Zenoh's own source."""
    text = re.sub(r"\s+at /\S+", "", message).replace("\n", " ")
    inner = re.search(r"\[([^\]]+ \(os error \d+\))", text)
    return (inner[1] if inner else text).strip(" .!]")


def scene_key(prefix: str) -> str:
    """Key under which scenes go out."""
    return f"{prefix}/scene"


class ScenePublisher:
    """Puts each scene on ``<prefix>/scene``: CDR, dropped on congestion, express, real-time priority.

    A liveliness token ``<prefix>/@alive/<robot>`` tells that it is there. It lives as long as its session. Raises
    ``PublishError`` when ``publish.prefix`` or ``publish.robot`` is no valid key.
    """

    def __init__(self, session: zenoh.Session, publish: config.Publish) -> None:
        self.key = scene_key(publish.prefix)
        self.sent = 0
        self._frame_id = publish.frame_id
        # A gid names one publisher: the same for its whole life, different for every other.
        self._gid = hashlib.blake2b(f"{session.zid()}/{self.key}".encode(), digest_size=16).digest()
        for name in ("prefix", "robot"):
            value = getattr(publish, name)
            if set("*$#?") & set(value) or not value:
                raise PublishError(f"publish.{name}: {value!r}: a key to publish on has no wildcards")
        try:
            self._publisher = session.declare_publisher(
                self.key,
                encoding=zenoh.Encoding(SCENE_ENCODING),
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.REAL_TIME,
                express=True,
            )
            self._alive = session.liveliness().declare_token(f"{publish.prefix}/@alive/{publish.robot}")
        except zenoh.ZError as error:
            raise PublishError(f"publish.prefix: {publish.prefix}: {_reason(str(error))}") from error

    def put(self, scene: Scene) -> int:
        """Send one scene; answers with the bytes of its payload."""
        payload = encode_scene(scene, self._frame_id)
        self.sent += 1
        attachment = ATTACHMENT.pack(self.sent, time.time_ns(), len(self._gid), self._gid)
        self._publisher.put(payload, attachment=attachment)
        return len(payload)

    def wait_for_subscriber(self, timeout_s: float) -> bool:
        """Wait until somebody subscribes; False when nobody did in time."""
        matched = threading.Event()
        with self._publisher.declare_matching_listener(lambda status: matched.set() if status.matching else None):
            return matched.wait(timeout_s)


def scenes(endpoint: str, key: str = "lcf/scene", *, kept: int = 64) -> Generator[Scene, None, None]:
    """Subscribe to a running pipeline: yields each scene until interrupted.

    Connects to ``endpoint`` (for example ``tcp/127.0.0.1:7447``) now or as soon as somebody listens there,
    and again when the connection was lost. Of scenes not yet asked for the newest ``kept`` wait. Raises
    ``PublishError`` for a bad endpoint or key, ``CdrError`` for a payload that is no scene.
    """
    with open_session(config.Zenoh(connect=[endpoint], listen=[])) as session:
        try:
            subscriber = session.declare_subscriber(key, zenoh.handlers.RingChannel(kept))
        except zenoh.ZError as error:
            raise PublishError(f"{key}: {_reason(str(error))}") from error
        for sample in subscriber:
            yield decode_scene(sample.payload.to_bytes())
