"""The latest of everything that a daemon publishes, and whether it is present."""

import math
import threading
import time
import tomllib
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import Enum
from typing import Any

import zenoh

from lcf_edge.cdr import (
    CdrError,
    CompressedImage,
    DiagnosticArray,
    decode_compressed_image,
    decode_diagnostics,
    decode_scene,
)
from lcf_edge.errors import PublishError
from lcf_edge.messages import Scene
from lcf_edge.meters import IntervalMeter
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.live.history import History, ReceivedMessage
from lcf_edge.monitor.live.traces import Point, Traces
from lcf_edge.zenoh_link.diagnostics import DIAGNOSTICS
from lcf_edge.zenoh_link.preview import PREVIEW
from lcf_edge.zenoh_link.publisher import ATTACHMENT
from lcf_edge.zenoh_link.scene import SCENE
from lcf_edge.zenoh_link.session import close_session, open_session, reason
from lcf_edge.zenoh_link.topics import ZenohTopic

MAX_ROBOTS = 32  # listed by name; without access rules, anybody can claim names
MAX_NAME = 64  # characters of a name

_JOINED = 64  # latest scenes, among which an image's scene is looked for
_MAX_CONFIG_BYTES = 2**16
_ANSWER_S = 5.0
_FARTHEST = 1e3  # m and s
_PAUSE_NS = 1_000_000_000  # without scenes; then the rate begins anew
_LARGEST_LATENCY_S = 60.0  # beyond, a recording is played


class Presence(Enum):
    """Whether a daemon is present, by its liveliness token."""

    SOUGHT = "sought"  # not found yet
    THERE = "there"
    AWAY = "away"


@dataclass(frozen=True, slots=True)
class Preview:
    """A preview, and the scene of the same frame if that was received too."""

    image: CompressedImage
    received_ns: int
    scene: Scene | None


@dataclass(frozen=True, slots=True)
class Ahead:
    """The space ahead that a vehicle will sweep, by its configuration."""

    half_width_m: float
    horizon_s: float


@dataclass(frozen=True, slots=True)
class Replay:
    """Playback position of a recording shown in place of a daemon; seconds after its first image."""

    position_s: float
    length_s: float  # as far as it is known
    start_s: float  # of the part that is played
    playing: bool
    speed: float
    alarms_s: tuple[float, ...]  # beginning of each, as far as known
    searched: bool  # whether all are known


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The state at one moment; times are of this machine's system clock, ns."""

    version: int  # counts what came
    presence: Presence
    since_ns: int  # of the presence
    robots: tuple[str, ...]
    scene: Scene | None
    scene_received_ns: int
    rate_hz: float  # of scenes; NaN: unknown
    latency_s: float  # from the frame's stamp to its being sent; NaN: unknown, or a recording
    diagnostics: DiagnosticArray | None
    diagnostics_received_ns: int
    preview: Preview | None
    broken: int  # payloads that do not match their key
    replay: Replay | None = None  # None: a daemon
    ahead: Ahead | None = None  # None: not known

    def scene_age_s(self, now_ns: int) -> float:
        """Time since the latest scene was received, s; infinite: none yet."""
        return math.inf if self.scene is None else max(now_ns - self.scene_received_ns, 0) / 1e9


class Monitor:
    """Subscribes to the daemon of ``address`` in Zenoh's threads, now or once it is there, and again after a loss.

    Previews are received only while they are wanted (``switch_preview``); otherwise none are drawn. ``changed`` is
    called in those threads after each message; it must be quick. ``history`` keeps the messages. Raises
    ``PublishError`` for an invalid address.
    """

    def __init__(
        self,
        address: DaemonAddress,
        *,
        history: History | None = None,
        changed: Callable[[], None] = lambda: None,
    ) -> None:
        self.traces = Traces()
        self._prefix = address.prefix
        self._history = history
        self._changed = changed
        self._lock = threading.RLock()
        self._robots: set[str] = set()
        self._presence, self._since_ns = Presence.SOUGHT, time.time_ns()
        self._scene: Scene | None = None
        self._scenes: deque[Scene] = deque(maxlen=_JOINED)
        self._diagnostics: DiagnosticArray | None = None
        self._preview: Preview | None = None
        self._scene_ns = self._diagnostics_ns = 0
        self._intervals = IntervalMeter()
        self._latency_s = math.nan
        self._version = self._broken = 0
        self._ahead: Ahead | None = None
        self._preview_subscriber: Any = None
        self._wanting = threading.Lock()
        self._session = open_session(address.zenoh())
        try:
            self._declare()
        except zenoh.ZError as error:
            self.close()
            raise PublishError(f"{address.prefix}: {reason(error)}; name another prefix") from error

    def snapshot(self) -> Snapshot:
        """Return the current state."""
        with self._lock:
            return Snapshot(
                self._version,
                self._presence,
                self._since_ns,
                tuple(sorted(self._robots)),
                self._scene,
                self._scene_ns,
                self._rate_hz(time.time_ns()),
                self._latency_s,
                self._diagnostics,
                self._diagnostics_ns,
                self._preview,
                self._broken,
                ahead=self._ahead,
            )

    def switch_preview(self, on: bool) -> None:
        """Subscribe to previews, or unsubscribe."""
        with self._wanting:
            if on and self._preview_subscriber is None:
                self._preview_subscriber = self._subscribe(PREVIEW, self._take_preview)
            elif not on and self._preview_subscriber is not None:
                with suppress(zenoh.ZError):  # the session is closed
                    self._preview_subscriber.undeclare()
                self._preview_subscriber = None
                with self._lock:
                    self._preview = None

    def close(self) -> None:
        """Close the session; may be called twice."""
        self._changed = lambda: None
        close_session(self._session)

    def _declare(self) -> None:
        self._subscribers = [
            self._subscribe(SCENE, self._take_scene),
            self._subscribe(DIAGNOSTICS, self._take_diagnostics),
            self._session.liveliness().declare_subscriber(
                f"{self._prefix}/@alive/*", zenoh.handlers.Callback(self._take_token, indirect=False), history=True
            ),
        ]

    def _subscribe(self, topic: ZenohTopic, take: Callable[[bytes, zenoh.Sample], None]) -> Any:
        def receive(sample: zenoh.Sample) -> None:
            with self._unless_broken():
                payload = topic.payload(sample)
                take(payload, sample)
                if self._history is not None:
                    self._history.add(ReceivedMessage(topic.name, time.time_ns(), payload))

        handler: Any = zenoh.handlers.Callback(receive, indirect=False)  # no queue in between
        return self._session.declare_subscriber(topic.key(self._prefix), handler)

    @contextmanager
    def _unless_broken(self) -> Iterator[None]:
        """Take something in and report it; count what is broken."""
        with self._lock:
            self._version += 1
            try:
                yield
            except CdrError:
                self._broken += 1
        self._changed()

    def _take_scene(self, payload: bytes, sample: zenoh.Sample) -> None:
        scene = decode_scene(payload)
        last_ns = self._intervals.last_ns
        if last_ns is not None and not 0 < scene.stamp_ns - last_ns < _PAUSE_NS:
            self._intervals.restart()
        self._intervals.add([scene.stamp_ns])
        self._latency_s = _latency_s(scene, sample)
        self._scene, self._scene_ns = scene, time.time_ns()
        self._scenes.append(scene)

    def _take_diagnostics(self, payload: bytes, _: zenoh.Sample) -> None:
        self._diagnostics = decode_diagnostics(payload)
        self._diagnostics_ns = time.time_ns()
        rate_hz = self._rate_hz(self._diagnostics_ns)
        self.traces.add(Point.of(self._diagnostics_ns, self._scene if rate_hz else None, rate_hz, self._diagnostics))

    def _take_preview(self, payload: bytes, _: zenoh.Sample) -> None:
        image = decode_compressed_image(payload)
        scene = next((scene for scene in self._scenes if scene.stamp_ns == image.header.stamp_ns), None)
        self._preview = Preview(image, time.time_ns(), scene)

    def _take_token(self, sample: zenoh.Sample) -> None:
        robot = str(sample.key_expr).rpartition("/")[2][:MAX_NAME]
        with self._unless_broken():
            if sample.kind == zenoh.SampleKind.DELETE:
                self._robots.discard(robot)
            elif len(self._robots) < MAX_ROBOTS:
                self._robots.add(robot)
            presence = Presence.THERE if self._robots else Presence.AWAY
            if presence is not self._presence:
                self._presence, self._since_ns = presence, time.time_ns()
                if presence is Presence.THERE:  # in its own thread: this one is Zenoh's, and must not wait
                    threading.Thread(target=self._ask_what_is_ahead, name="configuration", daemon=True).start()

    def _ask_what_is_ahead(self) -> None:
        """Ask a daemon that has appeared; without an answer it stays unknown."""

        def take(reply: zenoh.Reply) -> None:
            if reply.ok is not None and len(reply.ok.payload) <= _MAX_CONFIG_BYTES:
                with self._lock:
                    self._ahead = _ahead(reply.ok.payload.to_bytes())

        handler: Any = zenoh.handlers.Callback(take, indirect=False)
        with suppress(zenoh.ZError):  # the session is closed
            self._session.get(f"{self._prefix}/query/config", handler, timeout=_ANSWER_S)

    def _rate_hz(self, now_ns: int) -> float:
        """Rate of scenes; 0: they stopped."""
        if self._scene is None or now_ns - self._scene_ns > _PAUSE_NS:
            return 0.0
        return self._intervals.rate_hz


def _ahead(toml: bytes) -> Ahead | None:
    """Read it from a configuration; None: not in it."""
    try:
        vehicle = tomllib.loads(toml.decode())["vehicle"]
        half_width_m, horizon_s = float(vehicle["half_width_m"]), float(vehicle["horizon_s"])
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, KeyError, TypeError, ValueError, RecursionError):
        return None
    if not (0 < half_width_m < _FARTHEST and 0 < horizon_s < _FARTHEST):
        return None
    return Ahead(half_width_m, horizon_s)


def _latency_s(scene: Scene, sample: zenoh.Sample) -> float:
    """Latency by the sender's clock alone, s: the attachment has the time of sending.

    NaN for a recording that is played: its stamps are of when it was made.
    """
    attachment = sample.attachment
    if attachment is None or len(attachment) != ATTACHMENT.size:
        return math.nan
    sent_ns: int = ATTACHMENT.unpack(attachment.to_bytes())[1]
    latency_s = (sent_ns - scene.stamp_ns) / 1e9
    return latency_s if abs(latency_s) < _LARGEST_LATENCY_S else math.nan
