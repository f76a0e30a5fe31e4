"""All Zenoh traffic of one daemon."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import zenoh

from drivers.samples import SpeedSample
from lcf_edge.cdr import CdrError
from lcf_edge.config import Config
from lcf_edge.config.shown import shown
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.errors import PublishError
from lcf_edge.messages import Scene
from lcf_edge.zenoh_link.connections import Connections
from lcf_edge.zenoh_link.diagnostics import DiagnosticsPublisher
from lcf_edge.zenoh_link.own_gate import OwnGate
from lcf_edge.zenoh_link.preview import PreviewPublisher
from lcf_edge.zenoh_link.queryables import Answer, Queryables
from lcf_edge.zenoh_link.ros2 import Ros2Node
from lcf_edge.zenoh_link.scene import SCENE_ENCODING, ScenePublisher
from lcf_edge.zenoh_link.schema import SCHEMA_ENCODING, scene_schema
from lcf_edge.zenoh_link.session import MAX_SESSIONS, close_session, reason
from lcf_edge.zenoh_link.speed_input import SpeedInput
from lcf_edge.zenoh_link.standard_messages import LensFor, StandardMessages, lens_by_config

CONFIG_ENCODING = "application/toml"
LISTENING = frozenset({"auto", "odometry", "zenoh"})
"""Values of ``vehicle.speed_source`` with which the speed is listened for."""

_COUNTED = (
    "connections cut",
    "renewals",
    "renewals failed",
    *(f"{part} {what}" for part in ("scene", "preview", "diagnostics", "messages") for what in ("failed", "unfit")),
)


class Link:
    """Publishes, listens and answers on one session, which it closes at the end.

    No method waits for a peer or raises because of one; failures are counted in ``counts``. Each ``put`` may have a
    thread of its own. ``reopen``: opens another session like the first, for ``renew``. ``lens_for``: gives the lens of
    the images. ``gate``: before the session, closed with it. Raises ``PublishError`` when ``publish.prefix`` or
    ``publish.robot`` is no valid key.
    """

    def __init__(
        self,
        session: zenoh.Session,
        config: Config,
        reopen: Callable[[], zenoh.Session] | None = None,
        lens_for: LensFor = lens_by_config,
        gate: OwnGate | None = None,
    ) -> None:
        self.max_sessions = MAX_SESSIONS
        self._config = config
        self._config_text = shown(config)
        self._reopen = reopen
        self._lens_for = lens_for
        self._own: Counter[str] = Counter(dict.fromkeys(_COUNTED, 0))  # all keys at once: read meanwhile
        self._closed: Counter[str] = Counter()  # by sessions that are closed
        self._gate = gate
        self._connections = Connections() if gate is None else Connections(gate.received_bytes)
        self._parts: _Parts | None = None
        self._parts = self._declared(session)

    @property
    def counts(self) -> Counter[str]:
        """Counts so far, by part: ``scene sent``, ``speed stale``, ``query answered``, …"""
        parts = self._parts
        received = Counter({"bytes received": self._connections.received_bytes})
        gate = Counter[str]() if self._gate is None else self._gate.counts
        return self._own + self._closed + received + gate + (Counter() if parts is None else parts.counts)

    @property
    def sessions(self) -> int:
        """Others that are connected now."""
        parts = self._parts
        return 0 if parts is None else parts.sessions

    def charge(self, grown_mib: float) -> None:
        """Charge growth of the process's memory since the last call to peers that have sent something meanwhile."""
        self._connections.charge(grown_mib)

    @property
    def charged_mib(self) -> float:
        """Memory charged to peers so far, MiB."""
        return self._connections.charged_mib

    def cut(self, charge_mib: float) -> int:
        """Cut connections that are charged with that much, MiB, or more. Return how many."""
        number = self._connections.cut(charge_mib)
        self._own["connections cut"] += number
        return number

    def renew(self) -> bool:
        """Close the session with all that peers have declared on it, and open another; False: that failed.

        1.2 s at most. Without a session nothing is sent; another call tries again. Without ``reopen`` nothing happens.
        """
        if self._reopen is None:
            return True
        parts, self._parts = self._parts, None
        if parts is not None:
            parts.close()
            self._closed = self._closed + parts.counts
        try:
            self._parts = self._declared(self._reopen())
        except PublishError:
            self._own["renewals failed"] += 1
            return False
        self._own["renewals"] += 1
        return True

    def put_scene(self, scene: Scene) -> None:
        """Send one scene, whose stamp is of the system clock."""
        self._send("scene", lambda parts: parts.scene.put(scene))
        if self._parts is not None:
            self._send("messages", lambda parts: parts.messages.put(scene))

    def put_diagnostics(self, status: Sequence[DeviceStatus], stamp_ns: int) -> None:
        """Send one status a device, as of ``stamp_ns`` of the system clock."""
        self._send("diagnostics", lambda parts: parts.diagnostics.put(status, stamp_ns))
        if self._parts is not None:
            self._send("messages", lambda parts: parts.messages.put_transform(stamp_ns))

    def has_preview_subscriber(self) -> bool:
        """Whether somebody subscribes to previews, known within 0.2 s, and the next is due."""
        parts = self._parts
        return parts is not None and parts.preview.has_subscriber

    def put_preview(self, jpeg: bytes, stamp_ns: int) -> None:
        """Send one preview of the frame that was taken at ``stamp_ns`` of the system clock."""
        self._send("preview", lambda parts: parts.preview.put(jpeg, stamp_ns))

    def take_speeds(self) -> list[tuple[int, SpeedSample]]:
        """Speeds that arrived since the last call, oldest first: (monotonic ns of arrival, sample).

        The samples' own stamps are the sender's, of the system clock.
        """
        parts = self._parts
        return [] if parts is None or parts.speed is None else parts.speed.take()

    def show_config(self, config: Config) -> None:
        """Set the answer of ``query/config``."""
        self._config, self._config_text = config, shown(config)
        if self._parts is not None:
            self._parts.messages.config = config

    def close(self) -> None:
        """Stop listening and answering, then close session and gate; 1.4 s at most, may be called twice."""
        if self._parts is not None:
            self._parts.close()
        if self._gate is not None:
            self._gate.close()

    def _send(self, part: str, put: Callable[["_Parts"], object]) -> None:
        """Within, count data that do not fit a message, or a missing session, instead of raising."""
        parts = self._parts
        if parts is None:
            self._own[f"{part} failed"] += 1
            return
        try:
            put(parts)
        except CdrError:
            self._own[f"{part} unfit"] += 1

    def _declared(self, session: zenoh.Session) -> "_Parts":
        answers = {"scene": self._latest_scene, "config": self._shown_config, "schema": self._schema}
        return _Parts(session, self._config, answers, self._lens_for)

    def _latest_scene(self) -> tuple[bytes, str] | str:
        parts = self._parts
        latest = parts and parts.scene.latest
        return (latest, SCENE_ENCODING) if latest else "no scene yet"

    def _shown_config(self) -> tuple[bytes, str]:
        return self._config_text.encode(), CONFIG_ENCODING

    def _schema(self) -> tuple[bytes, str]:
        return scene_schema().encode(), SCHEMA_ENCODING


class _Parts:
    """All that is declared on one session. Raises ``PublishError`` when a key is not valid."""

    def __init__(
        self, session: zenoh.Session, config: Config, answers: Mapping[str, Answer], lens_for: LensFor
    ) -> None:
        publish = config.publish
        self._session = session
        try:
            self._ros2 = ros2 = Ros2Node(session, publish) if publish.ros2 else None  # lives as long as this reference
            self.scene = ScenePublisher(session, publish, ros2)
            self.preview = PreviewPublisher(session, publish, ros2)
            self.diagnostics = DiagnosticsPublisher(session, publish, ros2)
            self.messages = StandardMessages(session, config, ros2, lens_for)
            listens = config.vehicle.speed_source in LISTENING
            self.speed = SpeedInput(session, publish, ros2) if listens else None
            self._queryables = Queryables(session, publish.prefix, answers)
        except zenoh.ZError as error:
            raise PublishError(f"publish.prefix: {publish.prefix}: {reason(error)}") from error

    @property
    def counts(self) -> Counter[str]:
        """Counts of all parts, by part."""
        parts: dict[str, Counter[str]] = {
            "scene": self.scene.counts,
            "preview": self.preview.counts,
            "diagnostics": self.diagnostics.counts,
            "messages": self.messages.counts,
            "query": self._queryables.counts,
        }
        if self.speed is not None:
            parts["speed"] = self.speed.counts
        return Counter({f"{part} {what}": n for part, ns in parts.items() for what, n in ns.items()})

    @property
    def sessions(self) -> int:
        """Others that are connected now."""
        info: Any = self._session.info
        try:
            if hasattr(info, "transports"):
                return len(list(info.transports()))
            return len([*info.peers_zid(), *info.routers_zid()])  # Zenoh before 1.8 does not list clients
        except zenoh.ZError:  # it is closed
            return 0

    def close(self) -> None:
        """Stop listening and answering, then close the session."""
        self._queryables.close()
        if self.speed is not None:
            self.speed.close()
        close_session(self._session)
