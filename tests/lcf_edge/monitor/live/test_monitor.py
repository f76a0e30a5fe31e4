"""What is known of a rover: all of it, as it comes, and that it is away."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest
import zenoh

from lcf_edge.cdr import encode_scene
from lcf_edge.config import Config, Zenoh
from lcf_edge.errors import PublishError
from lcf_edge.messages import CIRCLE, PSI_REGION, Scene
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.live.history import History
from lcf_edge.monitor.live.monitor import MAX_NAME, MAX_ROBOTS, Ahead, Monitor, Presence, Snapshot
from lcf_edge.zenoh_link import opened_session
from lcf_edge.zenoh_link.publisher import ATTACHMENT

PATIENCE_S = 20.0
NOBODY = "tcp/127.0.0.1:1"


class Watched:
    """A monitor whose changes can be waited for."""

    def __init__(self, endpoint: str) -> None:
        self._changed = threading.Condition()
        self.history = History()
        self.monitor = Monitor(DaemonAddress(endpoint), history=self.history, changed=self._notify)

    def _notify(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def until(self, known: Callable[[Snapshot], object]) -> Snapshot:
        with self._changed:
            assert self._changed.wait_for(lambda: bool(known(self.monitor.snapshot())), PATIENCE_S)
        return self.monitor.snapshot()


@pytest.fixture
def watched(endpoint: str) -> Iterator[Watched]:
    watched = Watched(endpoint)
    yield watched
    watched.monitor.close()


def test_it_knows_the_newest_of_everything(rover: Any, watched: Watched) -> None:
    snapshot = watched.until(lambda known: known.scene and known.scene.seq > 10 and known.diagnostics and known.robots)
    assert snapshot.presence is Presence.THERE
    assert snapshot.robots == ("rover",)
    assert snapshot.scene
    assert snapshot.scene.circles.tobytes() == rover.circles.tobytes()
    assert 0.003 <= snapshot.latency_s < PATIENCE_S  # the rover's frames are 3 ms old when they are sent
    assert 0 < snapshot.rate_hz <= 30
    assert snapshot.scene_age_s(time.time_ns()) < PATIENCE_S
    assert snapshot.diagnostics
    assert snapshot.diagnostics.status == rover.status
    assert snapshot.diagnostics.hardware_id == "rover"
    assert snapshot.broken == 0


@pytest.mark.usefixtures("rover")
def test_it_asks_the_daemon_what_it_takes_of_the_way(watched: Watched) -> None:
    vehicle = Config().vehicle
    assert watched.until(lambda known: known.ahead).ahead == Ahead(vehicle.half_width_m, vehicle.horizon_s)


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"\xff\xfe",
        b"[vehicle",
        b"vehicle = 3",
        b"[vehicle]\nhorizon_s = 4.0",
        b'[vehicle]\nhalf_width_m = "wide"\nhorizon_s = 4.0',
        b"[vehicle]\nhalf_width_m = nan\nhorizon_s = 4.0",
        b"[vehicle]\nhalf_width_m = 0.3\nhorizon_s = 1e9",
        b"a = " + b"[" * 5000,
        b"#" * 100_000,
    ],
)
def test_an_answer_that_is_no_configuration_leaves_it_unknown(endpoint: str, answer: bytes) -> None:
    answered = threading.Event()

    def give(query: zenoh.Query) -> None:
        query.reply("lcf/query/config", answer)
        query.drop()
        answered.set()

    with opened_session(Zenoh(listen=[endpoint])) as session:
        session.declare_queryable("lcf/query/config", give)
        token = session.liveliness().declare_token("lcf/@alive/rover")
        watched = Watched(endpoint)
        try:
            assert answered.wait(PATIENCE_S)
            snapshot = watched.until(lambda known: known.presence is Presence.THERE)
            assert snapshot.ahead is None
        finally:
            watched.monitor.close()
            token.undeclare()


def test_images_come_only_while_they_are_wanted_and_with_their_scene(rover: Any, watched: Watched) -> None:
    watched.until(lambda known: known.scene)
    assert rover.previews == 0
    watched.monitor.switch_preview(True)
    snapshot = watched.until(lambda known: known.preview and known.preview.scene)
    assert snapshot.preview
    assert bytes(snapshot.preview.image.data[:3]) == b"\xff\xd8\xff"  # JPEG
    assert snapshot.preview.scene
    assert snapshot.preview.scene.stamp_ns == snapshot.preview.image.header.stamp_ns
    watched.monitor.switch_preview(False)
    rover.wait_for(lambda: rover.unseen > 20)  # one in four would be due
    assert watched.monitor.snapshot().preview is None


def test_who_claims_to_be_many_rovers_does_not_fill_its_memory(endpoint: str) -> None:
    with opened_session(Zenoh(listen=[endpoint])) as session:
        watched = Watched(endpoint)
        names = [f"{n}-{'x' * 1000}" for n in range(4 * MAX_ROBOTS)]
        tokens = [session.liveliness().declare_token(f"lcf/@alive/{name}") for name in names]
        snapshot = watched.until(lambda known: known.version == len(names))  # nothing else comes
        assert len(snapshot.robots) == MAX_ROBOTS
        assert all(len(name) == MAX_NAME for name in snapshot.robots)
        for token in tokens:
            token.undeclare()  # type: ignore[no-untyped-call]
        assert watched.until(lambda known: not known.robots).presence is Presence.AWAY
        watched.monitor.close()


def test_it_knows_since_when_the_rover_is_away_and_that_it_came_back(rover: Any, watched: Watched) -> None:
    watched.until(lambda known: known.presence is Presence.THERE and known.scene)
    before_ns = time.time_ns()
    rover.leave()
    away = watched.until(lambda known: known.presence is Presence.AWAY)
    assert before_ns <= away.since_ns <= time.time_ns()
    assert away.scene  # the last one
    rover.come()
    back = watched.until(lambda known: known.presence is Presence.THERE and known.scene is not away.scene)
    assert back.since_ns > away.since_ns


def test_nobody_there_yet(watched: Watched) -> None:
    snapshot = watched.monitor.snapshot()
    assert snapshot.presence is Presence.SOUGHT
    assert snapshot.rate_hz == 0
    assert math.isinf(snapshot.scene_age_s(time.time_ns()))


def test_what_is_no_message_is_counted_and_not_kept(endpoint: str) -> None:
    with opened_session(Zenoh(listen=[endpoint])) as session, closing(Watched(endpoint).monitor) as monitor:
        watched_keys = ("lcf/scene", "lcf/diagnostics", "lcf/preview/compressed")
        monitor.switch_preview(True)
        publishers = [session.declare_publisher(key) for key in watched_keys]
        deadline_s = time.monotonic() + PATIENCE_S
        while monitor.snapshot().broken < 3 and time.monotonic() < deadline_s:
            for publisher in publishers:
                publisher.put(b"\0\1\0\0" + b"\xff" * 40)
        assert monitor.snapshot().broken >= 3
        assert monitor.snapshot().scene is None


def test_a_scene_too_large_to_be_ours_is_not_kept(endpoint: str) -> None:
    crowd = Scene(1, 1, 640, 480, 1.5, np.zeros(10_000, CIRCLE), np.zeros(0, PSI_REGION))
    with opened_session(Zenoh(listen=[endpoint])) as session, closing(Watched(endpoint).monitor) as monitor:
        publisher = session.declare_publisher("lcf/scene")
        deadline_s = time.monotonic() + PATIENCE_S
        while not monitor.snapshot().broken and time.monotonic() < deadline_s:
            publisher.put(encode_scene(crowd, "camera"))
        assert monitor.snapshot().broken
        assert monitor.snapshot().scene is None


@pytest.mark.parametrize(("age_s", "is_live"), [(0.02, True), (30.0, True), (95e6, False), (-95e6, False)])
def test_a_recording_that_is_played_has_no_latency(endpoint: str, age_s: float, is_live: bool) -> None:
    sent_ns = time.time_ns()
    scene = Scene(sent_ns - round(age_s * 1e9), 1, 640, 480, 1.5, np.zeros(0, CIRCLE), np.zeros(0, PSI_REGION))
    with opened_session(Zenoh(listen=[endpoint])) as session, closing(Watched(endpoint).monitor) as monitor:
        publisher = session.declare_publisher("lcf/scene")
        deadline_s = time.monotonic() + PATIENCE_S
        while monitor.snapshot().scene is None and time.monotonic() < deadline_s:
            publisher.put(encode_scene(scene, "camera"), attachment=ATTACHMENT.pack(1, sent_ns, 16, bytes(16)))
        latency_s = monitor.snapshot().latency_s
    assert latency_s == pytest.approx(age_s) if is_live else math.isnan(latency_s)


@pytest.mark.usefixtures("rover")
def test_points_hold_the_figures_of_each_moment(watched: Watched) -> None:
    watched.until(lambda known: known.version > 20)
    points = watched.monitor.traces.since(0)
    assert len(points) > 3
    last = points[-1]
    assert (last.latency_p50_ms, last.latency_p99_ms) == (3.1, 8.2)
    assert (last.resident_mib, last.budget_mib, last.temperature_c) == (71.5, 96.0, None)
    assert (last.rebels, last.normals, last.psi) == (2, 3, 2)
    assert last.objects == 3
    assert last.fill == {"psi": (2, 32), "objects": (3, 24)}
    assert watched.monitor.traces.since(last.at_ns - 1) == [last]


@pytest.mark.usefixtures("rover")
def test_the_history_has_payloads_as_they_were_sent(watched: Watched) -> None:
    watched.until(lambda known: known.version > 10)
    messages = watched.history.messages(time.time_ns())
    assert {message.topic for message in messages} == {"scene", "diagnostics"}
    assert all(message.payload.startswith(b"\0\1\0\0") for message in messages)


@pytest.mark.parametrize(
    ("address", "part"),
    [
        (DaemonAddress("nonsense"), "nonsense"),
        (DaemonAddress(NOBODY, prefix="a//b"), "a//b"),
        (DaemonAddress(NOBODY, config_file="/no/such.json5"), "/no/such.json5"),
    ],
)
def test_an_address_that_is_none_is_refused(address: DaemonAddress, part: str) -> None:
    with pytest.raises(PublishError, match=part):
        Monitor(address)


def test_tokens_of_another_prefix_are_not_ours(endpoint: str, watched: Watched) -> None:
    with opened_session(Zenoh(listen=[endpoint])) as session:
        other: Any = session.liveliness().declare_token("other/@alive/rover")
        mine: Any = session.liveliness().declare_token("lcf/@alive/second")
        snapshot = watched.until(lambda known: known.presence is Presence.THERE)
        assert snapshot.robots == ("second",)
        mine.undeclare()
        watched.until(lambda known: known.presence is Presence.AWAY)
        other.undeclare()
