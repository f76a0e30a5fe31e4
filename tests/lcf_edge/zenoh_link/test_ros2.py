"""For nodes under rmw_zenoh a session is one of them: its keys, its tokens, its hashes."""

import re
import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import xxhash
import zenoh
from rosbags.typesys.store import Typestore

from lcf_edge.config import Config, Publish, Zenoh
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.errors import PublishError
from lcf_edge.messages import Scene
from lcf_edge.zenoh_link import ATTACHMENT, ScenePublisher, opened_session
from lcf_edge.zenoh_link.link import Link
from lcf_edge.zenoh_link.ros2 import TYPE_HASHES, dds_type

PUBLISH = Publish(ros2=True, ros2_domain=7, robot="rover-3")
HASH = TYPE_HASHES["lcf_msgs/msg/Scene"]
TWINS = {
    "lcf/scene": "lcf_msgs/msg/Scene",
    "lcf/preview/compressed": "sensor_msgs/msg/CompressedImage",
    "lcf/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}


@pytest.fixture
def link(session: zenoh.Session) -> Iterator[Link]:
    link = Link(session, Config(publish=PUBLISH))
    yield link
    link.close()


@pytest.mark.parametrize("message", TYPE_HASHES)
def test_hashes_are_those_of_an_independent_implementation(ros: Typestore, message: str) -> None:
    assert ros.hash_rihs01(message) == TYPE_HASHES[message]


def test_types_are_named_as_dds_does() -> None:
    assert dds_type("lcf_msgs/msg/Scene") == "lcf_msgs::msg::dds_::Scene_"


def put_everything(link: Link, scene: Scene) -> None:
    link.put_scene(scene)
    link.put_preview(b"jpeg", time.time_ns())
    link.put_diagnostics([DeviceStatus("camera", Level.OK, "")], time.time_ns())


def test_every_sample_has_a_twin(
    link: Link, session: zenoh.Session, peer: Any, until_matched: Any, scene: Callable[..., Scene]
) -> None:
    peer.subscribe("**")
    until_matched(session, "lcf/scene")
    put_everything(link, scene())
    received = {sample.key: sample for sample in peer.receive("**", 6)}
    for key, message in TWINS.items():
        twin = received.pop(f"7/{key}/{dds_type(message)}/{TYPE_HASHES[message]}")
        plain = received.pop(key)
        assert (twin.payload, twin.attachment, twin.encoding) == (plain.payload, plain.attachment, plain.encoding)
        assert (twin.priority, twin.congestion_control) == (plain.priority, plain.congestion_control)
        assert ATTACHMENT.unpack(twin.attachment)[0] == 1
    assert not received


def test_a_node_announces_itself_its_publishers_and_its_subscription(
    link: Link, session: zenoh.Session, peer: Any
) -> None:
    assert link
    node = f"@ros2_lv/7/{session.zid()}/0"
    name = "%/%/lcf_edge_rover_3"
    qos = "2::,1:,:,:,,"  # best effort, the newest one, what else is the default

    def endpoint(number: int, kind: str, topic: str, message: str) -> str:
        return f"{node}/{number}/{kind}/{name}/{topic}/{dds_type(message)}/{TYPE_HASHES[message]}/{qos}"

    assert peer.tokens("@ros2_lv/7/**") == [
        f"{node}/0/NN/{name}",
        endpoint(1, "MP", "%lcf%scene", "lcf_msgs/msg/Scene"),
        endpoint(2, "MP", "%lcf%preview%compressed", "sensor_msgs/msg/CompressedImage"),
        endpoint(3, "MP", "%lcf%diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
        endpoint(4, "MS", "%lcf%speed", "nav_msgs/msg/Odometry"),
    ]


def test_the_gid_of_a_sample_is_that_of_the_token(
    link: Link, session: zenoh.Session, peer: Any, until_matched: Any, scene: Callable[..., Scene]
) -> None:
    """rmw_zenoh takes both halves of the token's XXH3, the low one first, as the processor has them."""
    peer.subscribe("lcf/scene")
    until_matched(session, "lcf/scene")
    link.put_scene(scene())
    (sample,) = peer.receive("lcf/scene")
    (token,) = peer.tokens("@ros2_lv/7/*/0/1/MP/**")
    high, low = divmod(xxhash.xxh3_128(token.encode()).intdigest(), 2**64)
    assert ATTACHMENT.unpack(sample.attachment)[2:] == (16, struct.pack("<QQ", low, high))


def test_without_it_there_are_neither_twins_nor_tokens(
    session: zenoh.Session, peer: Any, until_matched: Any, scene: Callable[..., Scene]
) -> None:
    link = Link(session, Config())
    peer.subscribe("**")
    until_matched(session, "lcf/scene")
    put_everything(link, scene())
    assert {sample.key for sample in peer.receive("**", 3)} == set(TWINS)
    assert peer.tokens("@ros2_lv/**") == []
    link.close()


def test_humble_knows_no_hashes(session: zenoh.Session, peer: Any) -> None:
    link = Link(session, Config(publish=Publish(ros2=True, ros2_type_hash="TypeHashNotSupported")))
    peer.subscribe("0/lcf/scene/**")
    tokens = peer.tokens("@ros2_lv/0/**")
    assert len(tokens) == 5
    assert all("/TypeHashNotSupported/" in token for token in tokens if "/NN/" not in token)
    link.close()


def test_a_replay_publishes_as_a_node_too(
    session: zenoh.Session, peer: Any, until_matched: Any, scene: Callable[..., Scene]
) -> None:
    publisher = ScenePublisher(session, PUBLISH)
    key = f"7/lcf/scene/lcf_msgs::msg::dds_::Scene_/{HASH}"
    peer.subscribe(key)
    until_matched(session, key)
    publisher.put(scene())
    assert len(peer.receive(key)) == 1
    assert len(peer.tokens("@ros2_lv/**")) == 2


@pytest.mark.parametrize(
    ("kind", "announced", "counted"),
    [
        ("nav_msgs/msg/Odometry", "nav_msgs::msg::dds_::Odometry_", "speed taken"),
        ("geometry_msgs/msg/TwistStamped", "geometry_msgs::msg::dds_::TwistStamped_", "speed taken"),
        ("geometry_msgs/msg/TwistStamped", "nav_msgs::msg::dds_::Odometry_", "speed wrong type"),
    ],
)
def test_a_node_sends_the_speed(
    link: Link, peer: Any, velocity: Callable[..., bytes], kind: str, announced: str, counted: str
) -> None:
    peer.put(f"7/lcf/speed/{announced}/RIHS01_0", velocity(kind=kind))
    peer.get("lcf/query/config")
    assert link.counts[counted] == 1


@pytest.mark.parametrize("prefix", ["3d/lcf", "lcf-edge", "größe", "a/1"])
def test_a_prefix_that_is_no_name_of_a_topic_is_refused(session: zenoh.Session, prefix: str) -> None:
    with pytest.raises(PublishError, match=re.escape(f"publish.prefix: {prefix!r}: with publish.ros2, letters")):
        Link(session, Config(publish=Publish(prefix=prefix, ros2=True)))


ROS_ROUTER = {"mode": "router", "routing__router__peers_failover_brokering": False, "scouting__gossip__enabled": True}


@pytest.mark.parametrize("options", [{"mode": "client"}, {"mode": "peer", "gossip": True}], ids=str)
def test_nodes_behind_the_router_of_ros_are_reached(
    start: Any, endpoint: str, until_matched: Any, scene: Callable[..., Scene], options: dict[str, Any]
) -> None:
    router = start(listen__endpoints=[endpoint], **ROS_ROUTER)
    router.subscribe("nothing")
    node = start(
        mode="peer",
        connect__endpoints=[endpoint],
        listen__endpoints=["tcp/127.0.0.1:0"],
        scouting__gossip__target={"router": ["router", "peer"], "peer": ["router"]},
        scouting__gossip__autoconnect_strategy={"peer": {"to_router": "always", "to_peer": "greater-zid"}},
    )
    node.subscribe("7/lcf/scene/**")
    with opened_session(Zenoh(connect=[endpoint], listen=[], **options)) as session:
        link = Link(session, Config(publish=PUBLISH))
        until_matched(session, f"7/lcf/scene/lcf_msgs::msg::dds_::Scene_/{HASH}")
        link.put_scene(scene())
        assert len(node.receive("7/lcf/scene/**")) == 1
        link.close()
