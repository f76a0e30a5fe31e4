"""Everything that goes over Zenoh for one daemon."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import zenoh

from drivers.records import SpeedSample
from lcf_edge.cdr import CdrError
from lcf_edge.config import Config
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.errors import PublishError
from lcf_edge.records import Scene
from lcf_edge.shown_config import shown
from lcf_edge.zenoh_link.diagnostics import DiagnosticsPublisher
from lcf_edge.zenoh_link.preview import PreviewPublisher
from lcf_edge.zenoh_link.queryables import Queryables
from lcf_edge.zenoh_link.ros2 import Ros2Node
from lcf_edge.zenoh_link.scene import SCENE_ENCODING, ScenePublisher
from lcf_edge.zenoh_link.schema import SCHEMA_ENCODING, scene_schema
from lcf_edge.zenoh_link.session import close_session, reason
from lcf_edge.zenoh_link.speed_input import SpeedInput

CONFIG_ENCODING = "application/toml"
LISTENING = frozenset({"auto", "odometry", "zenoh"})
"""Values of ``vehicle.speed_source`` with which the speed is listened for."""


class Link:
    """Publishes, listens and answers on one session, which it closes in the end.

    No method waits for a peer or raises because of one; what went wrong is in ``counts``. Each ``put`` may have a
    thread of its own. Raises ``PublishError`` when ``publish.prefix`` or ``publish.robot`` is no valid key.
    """

    def __init__(self, session: zenoh.Session, config: Config) -> None:
        self._session = session
        self._config_text = shown(config)
        self._unfit: Counter[str] = Counter(scene=0, preview=0, diagnostics=0)
        publish = config.publish
        try:
            self._ros2 = ros2 = Ros2Node(session, publish) if publish.ros2 else None  # there while it is kept
            self._scene = ScenePublisher(session, publish, ros2)
            self._preview = PreviewPublisher(session, publish, ros2)
            self._diagnostics = DiagnosticsPublisher(session, publish, ros2)
            listens = config.vehicle.speed_source in LISTENING
            self._speed = SpeedInput(session, publish, ros2) if listens else None
            answers = {"scene": self._latest_scene, "config": self._config, "schema": self._schema}
            self._queryables = Queryables(session, publish.prefix, answers)
        except zenoh.ZError as error:
            raise PublishError(f"publish.prefix: {publish.prefix}: {reason(error)}") from error

    @property
    def counts(self) -> Counter[str]:
        """What happened so far, by part: ``scene sent``, ``speed stale``, ``query answered``, …"""
        parts: dict[str, Counter[str]] = {
            "scene": self._scene.counts,
            "preview": self._preview.counts,
            "diagnostics": self._diagnostics.counts,
            "query": self._queryables.counts,
        }
        if self._speed is not None:
            parts["speed"] = self._speed.counts
        counts = Counter({f"{part} {what}": n for part, ns in parts.items() for what, n in ns.items()})
        return counts + Counter({f"{part} unfit": n for part, n in self._unfit.items()})

    def put_scene(self, scene: Scene) -> None:
        """Send one scene, whose stamp is of the system clock."""
        with self._unless_unfit("scene"):
            self._scene.put(scene)

    def put_diagnostics(self, status: Sequence[DeviceStatus], stamp_ns: int) -> None:
        """Send one status a device, as of ``stamp_ns`` of the system clock."""
        with self._unless_unfit("diagnostics"):
            self._diagnostics.put(status, stamp_ns)

    def preview_wanted(self) -> bool:
        """Somebody looks at previews, and the next one is due by ``publish.preview_hz``. Takes 2 µs."""
        return self._preview.wanted

    def put_preview(self, jpeg: bytes, stamp_ns: int) -> None:
        """Send one preview of the frame that was taken at ``stamp_ns`` of the system clock."""
        with self._unless_unfit("preview"):
            self._preview.put(jpeg, stamp_ns)

    def take_speeds(self) -> list[tuple[int, SpeedSample]]:
        """Speeds that arrived since the last call, oldest first: (monotonic ns of arrival, sample).

        The samples' own stamps are the sender's, of the system clock.
        """
        return [] if self._speed is None else self._speed.take()

    def show_config(self, config: Config) -> None:
        """What ``query/config`` answers from now on."""
        self._config_text = shown(config)

    def close(self) -> None:
        """Listen and answer no more, then close the session; 1.2 s at most, may be called twice."""
        self._queryables.close()
        if self._speed is not None:
            self._speed.close()
        close_session(self._session)

    @contextmanager
    def _unless_unfit(self, part: str) -> Iterator[None]:
        """Counts what does not fit its message instead of raising it."""
        try:
            yield
        except CdrError:
            self._unfit[part] += 1

    def _latest_scene(self) -> tuple[bytes, str] | str:
        latest = self._scene.latest
        return "no scene yet" if latest is None else (latest, SCENE_ENCODING)

    def _config(self) -> tuple[bytes, str]:
        return self._config_text.encode(), CONFIG_ENCODING

    def _schema(self) -> tuple[bytes, str]:
        return scene_schema().encode(), SCHEMA_ENCODING
