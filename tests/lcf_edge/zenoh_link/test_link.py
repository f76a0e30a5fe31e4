"""What a daemon sends, as seen by a process that knows nothing of it."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
import zenoh
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from lcf_edge.config import Config, Publish, Vehicle, load
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.errors import PublishError
from lcf_edge.messages import Scene
from lcf_edge.zenoh_link import ATTACHMENT
from lcf_edge.zenoh_link.link import Link

PATIENCE_S = 20.0
STAMP_NS = 1_700_000_000_123_456_789
JPEG = b"\xff\xd8\xff\xe0 an image \xff\xd9"
STATUS = (
    DeviceStatus("camera", Level.OK, "30.0 frame/s", {"rate_hz": "30.0", "größe": "640x480"}),
    DeviceStatus("imu", Level.STALE, "nothing since 3 s"),
    DeviceStatus("a\0b\udcff", Level.ERROR, ""),
)
EVERYTHING = "lcf/**"

Send = Callable[[Link], None]


@pytest.fixture
def link(session: zenoh.Session) -> Iterator[Link]:
    link = Link(session, Config(publish=Publish(frame_id="eye", robot="seven")))
    yield link
    link.close()


def send_scene(scene: Callable[..., Scene]) -> Send:
    return lambda link: link.put_scene(scene(7))


def send_preview(_: Callable[..., Scene]) -> Send:
    return lambda link: link.put_preview(JPEG, STAMP_NS)


def send_diagnostics(_: Callable[..., Scene]) -> Send:
    return lambda link: link.put_diagnostics(STATUS, STAMP_NS)


@pytest.fixture
def received(
    link: Link, session: zenoh.Session, peer: Any, until_matched: Any, scene: Callable[..., Scene]
) -> Callable[..., Any]:
    """What the other process gets of one message."""

    def get(send: Callable[[Callable[..., Scene]], Send]) -> Any:
        peer.subscribe(EVERYTHING)
        until_matched(session, "lcf/scene")
        send(scene)(link)
        (sample,) = peer.receive(EVERYTHING)
        return sample

    return get


@pytest.mark.parametrize(
    ("send", "key", "message", "priority", "express"),
    [
        (send_scene, "lcf/scene", "lcf_msgs/msg/Scene", "REAL_TIME", True),
        (send_preview, "lcf/preview/compressed", "sensor_msgs/msg/CompressedImage", "BACKGROUND", False),
        (send_diagnostics, "lcf/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "DATA_LOW", False),
    ],
)
def test_each_message_has_its_key_its_type_and_its_quality_of_service(
    received: Callable[..., Any], ros: Typestore, send: Any, key: str, message: str, priority: str, express: bool
) -> None:
    sample = received(send)
    assert (sample.key, sample.encoding) == (key, f"application/cdr;{message}")
    assert (sample.congestion_control, sample.priority, sample.express) == ("DROP", priority, express)
    assert ATTACHMENT.unpack(sample.attachment)[0] == 1
    again = ros.serialize_cdr(ros.deserialize_cdr(sample.payload, message), message)
    assert bytes(again) == sample.payload, "to the last byte what another implementation writes"


def test_preview_is_a_compressed_image(received: Callable[..., Any], ros: Typestore) -> None:
    image: Any = ros.deserialize_cdr(received(send_preview).payload, "sensor_msgs/msg/CompressedImage")
    assert (image.header.frame_id, image.format, image.data.tobytes()) == ("eye", "jpeg", JPEG)
    assert image.header.stamp.sec * 10**9 + image.header.stamp.nanosec == STAMP_NS


def test_diagnostics_report_every_device(received: Callable[..., Any], ros: Typestore) -> None:
    array: Any = ros.deserialize_cdr(received(send_diagnostics).payload, "diagnostic_msgs/msg/DiagnosticArray")
    assert array.header.stamp.sec * 10**9 + array.header.stamp.nanosec == STAMP_NS
    assert [(one.name, one.level, one.message, one.hardware_id) for one in array.status] == [
        ("camera", 0, "30.0 frame/s", "seven"),
        ("imu", 3, "nothing since 3 s", "seven"),
        ("ab?", 2, "", "seven"),
    ]
    assert [(pair.key, pair.value) for pair in array.status[0].values] == list(STATUS[0].values.items())


def test_a_preview_is_wanted_only_while_somebody_looks(
    session: zenoh.Session, peer: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_ns = 10**12
    monkeypatch.setattr(time, "monotonic_ns", lambda: now_ns)
    link = Link(session, Config(publish=Publish(preview_hz=100.0)))
    looking, gone = threading.Event(), threading.Event()

    def on_match(status: zenoh.MatchingStatus) -> None:
        (looking if status.matching else gone).set()

    publisher = session.declare_publisher("lcf/preview/compressed")
    with publisher.declare_matching_listener(on_match):
        assert not link.has_preview_subscriber()
        peer.subscribe("lcf/preview/*")
        assert looking.wait(PATIENCE_S)
        assert not link.has_preview_subscriber()  # it was just asked
        now_ns += 200_000_000
        assert link.has_preview_subscriber()
        peer.end()
        assert gone.wait(PATIENCE_S)
        assert not link.has_preview_subscriber()
    link.close()


@pytest.mark.parametrize(("preview_hz", "times"), [(0.0, 0), (0.001, 1), (100.0, 2)])
def test_previews_keep_to_their_rate(
    session: zenoh.Session,
    peer: Any,
    until_matched: Any,
    monkeypatch: pytest.MonkeyPatch,
    preview_hz: float,
    times: int,
) -> None:
    now_ns = 10**12
    monkeypatch.setattr(time, "monotonic_ns", lambda: now_ns)
    link = Link(session, Config(publish=Publish(preview_hz=preview_hz)))
    peer.subscribe("lcf/preview/*")
    until_matched(session, "lcf/preview/compressed")
    wanted = 0
    for _ in range(10):  # 18 ms
        if link.has_preview_subscriber():
            wanted += 1
            link.put_preview(JPEG, STAMP_NS)
        now_ns += 2_000_000
    assert wanted == times
    assert len(peer.receive("lcf/preview/*", times)) == times
    link.close()


def test_queries_are_answered(link: Link, peer: Any, scene: Callable[..., Scene], ros: Typestore) -> None:
    assert peer.get("lcf/query/scene") == ["no scene yet"]
    link.put_scene(scene(1))
    link.put_scene(scene(2))
    (latest,) = peer.get("lcf/query/scene")
    message: Any = ros.deserialize_cdr(latest.payload, "lcf_msgs/msg/Scene")
    assert (latest.encoding, message.frame_seq) == ("application/cdr;lcf_msgs/msg/Scene", 2)
    assert link.counts["query answered"] == 1
    assert link.counts["query refused"] == 1


def test_the_effective_configuration_can_be_asked_for(link: Link, peer: Any, tmp_path: Any) -> None:
    path = tmp_path / "config.toml"
    for config in (Config(publish=Publish(frame_id="eye", robot="seven")), Config(vehicle=Vehicle(height_m=1.5))):
        link.show_config(config)
        (answer,) = peer.get("lcf/query/config")
        assert answer.encoding == "application/toml"
        path.write_bytes(answer.payload)
        assert load(path) == config


def test_the_message_definitions_can_be_asked_for(link: Link, peer: Any, ros: Typestore) -> None:
    assert link
    (answer,) = peer.get("lcf/query/schema")
    types = get_types_from_msg(answer.payload.decode(), "lcf_msgs/msg/Scene")
    ours = {
        name: types[name]
        for name in ("lcf_msgs/msg/Scene", "lcf_msgs/msg/Circle", "lcf_msgs/msg/PsiRegion", "lcf_msgs/msg/Object")
    }
    assert ours == {name: ros.fielddefs[name] for name in ours}
    assert {"std_msgs/msg/Header", "builtin_interfaces/msg/Time"} <= set(types)


def test_a_query_for_what_there_is_not_is_counted(link: Link, peer: Any) -> None:
    assert peer.get("lcf/query/nothing") == []
    assert link.counts["query unknown"] == 1


def test_who_is_connected_and_how_much_came_is_known(link: Link, peer: Any) -> None:
    assert peer.get("lcf/query/schema")
    assert link.sessions == 1
    link.charge(0.0)
    before = link.counts["bytes received"]
    peer.ask("put_blindly", key="lcf/nothing", payload=bytes(20_000).hex())
    assert peer.get("lcf/query/schema")
    link.charge(0.0)
    assert link.counts["bytes received"] > before + 20_000


def test_one_query_asks_for_everything(link: Link, peer: Any, scene: Callable[..., Scene]) -> None:
    link.put_scene(scene(1))
    names = {one.key for one in peer.get("lcf/query/*")}
    assert names == {"lcf/query/scene", "lcf/query/config", "lcf/query/schema"}


@pytest.mark.parametrize("change", [{"stamp_ns": 2**62}, {"seq": -1}, {"vehicle_speed": 1e300}], ids=str)
def test_what_does_not_fit_its_message_is_counted(link: Link, scene: Callable[..., Scene], change: Any) -> None:
    link.put_scene(replace(scene(), **change))
    link.put_preview(JPEG, 2**62)
    link.put_diagnostics(STATUS, 2**62)
    assert link.counts == {"scene unfit": 1, "preview unfit": 1, "diagnostics unfit": 1}


def test_after_the_end_nothing_is_raised_and_everything_counted(
    unattended: zenoh.Session, scene: Callable[..., Scene]
) -> None:
    link = Link(unattended, Config())
    link.put_scene(scene())
    link.close()
    link.put_scene(scene())
    link.put_diagnostics(STATUS, STAMP_NS)
    link.put_preview(JPEG, STAMP_NS)
    assert not link.has_preview_subscriber()
    assert link.take_speeds() == []
    assert link.counts == {"scene sent": 1, "scene failed": 1, "diagnostics failed": 1, "preview failed": 1}
    link.close()


@pytest.mark.parametrize(
    ("publish", "key"),
    [(Publish(prefix="a/*"), "prefix"), (Publish(prefix="/a"), "prefix"), (Publish(robot="a//b"), "robot")],
)
def test_a_name_that_is_no_key_is_refused(session: zenoh.Session, publish: Publish, key: str) -> None:
    with pytest.raises(PublishError, match=rf"^publish\.{key}: "):
        Link(session, Config(publish=publish))


def test_a_process_that_closes_its_link_ends() -> None:
    code = (
        "from lcf_edge.config import Config, Zenoh\n"
        "from lcf_edge.zenoh_link import open_session\n"
        "from lcf_edge.zenoh_link.link import Link\n"
        "Link(open_session(Zenoh(listen=[])), Config()).close()\n"
    )
    subprocess.run((sys.executable, "-c", code), check=True, timeout=60)
