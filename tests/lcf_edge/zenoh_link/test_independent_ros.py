"""Implementations that are not ours find the node, receive all that it publishes, and read every byte of it."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import zenoh
from pycdr2 import IdlStruct
from pycdr2.types import array, float32, int32, sequence, uint8, uint16, uint32, uint64
from rosbags.typesys.store import Typestore

from lcf_edge.cdr import encode_scene
from lcf_edge.config import Config, Publish
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.records import CIRCLE, PSI_REGION, Cause, Kind, Scene, Shape
from lcf_edge.zenoh_link.link import Link

TOPICS = {
    "/lcf/scene": "lcf_msgs/msg/Scene",
    "/lcf/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/lcf/preview/compressed": "sensor_msgs/msg/CompressedImage",
}
WITHIN = {
    "lcf_msgs/msg/Scene": ("lcf_msgs/msg/Circle", "lcf_msgs/msg/PsiRegion", "std_msgs/msg/Header"),
    "diagnostic_msgs/msg/DiagnosticArray": (
        "diagnostic_msgs/msg/DiagnosticStatus",
        "diagnostic_msgs/msg/KeyValue",
        "std_msgs/msg/Header",
    ),
    "sensor_msgs/msg/CompressedImage": ("std_msgs/msg/Header",),
}
STAMP_NS = 1_700_000_000_123_456_789


def a_scene() -> Scene:
    circle = np.zeros(1, CIRCLE)
    circle[0] = (5, Kind.REBEL, Cause.CROSSING, 11, 312.5, 201.0, 24.0, 1.5, 63.0, 4.0, 2.25, 0.25, -0.5, 3.25, np.nan)
    region = np.zeros(1, PSI_REGION)
    region[0] = (2, Shape.CIRCLE, 90.0, 240.0, 120.0, 120.0, 5.0)
    return Scene(STAMP_NS, 17, 640, 480, 1.5, circle, region)


def definition(ros: Typestore, name: str) -> str:
    """Without those of the types within it."""
    return ros.generate_msgdef(name, ros_version=2)[0].partition("=" * 80)[0]


@pytest.fixture
def node(ros: Typestore, endpoint: str, session: zenoh.Session) -> Iterator[subprocess.Popen[str]]:
    assert session
    port = endpoint.rpartition(":")[2]
    command = (sys.executable, str(Path(__file__).with_name("ros_node.py")), port, "7")
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin
        names = {kind: (*WITHIN[kind], "builtin_interfaces/msg/Time", kind) for kind in TOPICS.values()}
        topics = {
            topic: (kind, {name: definition(ros, name) for name in names[kind]}) for topic, kind in TOPICS.items()
        }
        process.stdin.write(json.dumps(topics) + "\n")
        process.stdin.flush()
        yield process
        process.kill()


def test_a_node_receives_scene_diagnostics_and_preview(
    node: subprocess.Popen[str], session: zenoh.Session, until_matched: Callable[[zenoh.Session, str], None]
) -> None:
    _, jpeg = cv2.imencode(".jpg", np.zeros((48, 64), np.uint8))
    link = Link(session, Config(publish=Publish(ros2=True, ros2_domain=7, robot="rover")))
    assert node.stdout
    keys = json.loads(node.stdout.readline())  # with the hashes that it finds itself
    topics = json.loads(node.stdout.readline())
    for key in keys.values():
        until_matched(session, key)
    link.put_scene(a_scene())
    link.put_diagnostics([DeviceStatus("camera", Level.WARN, "dark", {"rate_hz": "29.9"})], STAMP_NS)
    link.put_preview(jpeg.tobytes(), STAMP_NS)
    received = json.loads(node.stdout.readline())
    link.close()

    assert {topic: topics[topic] for topic in TOPICS} == {topic: [kind] for topic, kind in TOPICS.items()}
    stamp = {"sec": STAMP_NS // 10**9, "nanosec": STAMP_NS % 10**9}
    scene = received["/lcf/scene"]
    assert scene["header"]["stamp"] == stamp
    assert (scene["frame_seq"], scene["image_width"], scene["vehicle_speed"]) == (17, 640, 1.5)
    (circle,) = scene["circles"]
    assert (circle["id"], circle["cause"], circle["support"], circle["ttc"]) == (5, Cause.CROSSING, 11, 2.25)
    assert circle["lateral"] == "nan"
    assert scene["psi"][0]["width"] == 120.0
    (status,) = received["/lcf/diagnostics"]["status"]
    assert (status["name"], status["message"]) == ("camera", "dark")
    assert status["values"] == [{"key": "rate_hz", "value": "29.9"}]
    preview = received["/lcf/preview/compressed"]
    assert (preview["format"], preview["data"]) == ("jpeg", {"bytes": jpeg.size})


@dataclass
class Time(IdlStruct, typename="builtin_interfaces/msg/Time"):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs/msg/Header"):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Circle(IdlStruct, typename="lcf_msgs/msg/Circle"):
    id: uint32 = 0
    kind: uint8 = 0
    cause: uint8 = 0
    support: uint16 = 0
    numbers: array[float32, 11] = field(default_factory=list)  # x to lateral


@dataclass
class PsiRegion(IdlStruct, typename="lcf_msgs/msg/PsiRegion"):
    id: uint32 = 0
    shape: uint8 = 0
    numbers: array[float32, 5] = field(default_factory=list)  # x to trust


@dataclass
class SceneMessage(IdlStruct, typename="lcf_msgs/msg/Scene"):
    header: Header = field(default_factory=Header)
    frame_seq: uint64 = 0
    image_width: uint32 = 0
    image_height: uint32 = 0
    vehicle_speed: float32 = 0.0
    circles: sequence[Circle] = field(default_factory=list)
    psi: sequence[PsiRegion] = field(default_factory=list)


def test_another_cdr_library_reads_a_scene() -> None:
    scene = a_scene()
    message: Any = SceneMessage.deserialize(encode_scene(scene, "camera"))
    assert (message.header.stamp.sec, message.header.frame_id) == (STAMP_NS // 10**9, "camera")
    assert (message.frame_seq, message.image_width, message.image_height) == (17, 640, 480)
    (circle,) = message.circles
    assert (circle.id, circle.kind, circle.cause, circle.support) == (5, Kind.REBEL, Cause.CROSSING, 11)
    np.testing.assert_array_equal(circle.numbers, [scene.circles[0][name] for name in CIRCLE.names[4:]])
    (region,) = message.psi
    assert (region.id, region.shape) == (2, Shape.CIRCLE)
    np.testing.assert_array_equal(region.numbers, [90.0, 240.0, 120.0, 120.0, 5.0])


def test_it_writes_the_same_bytes() -> None:
    written = encode_scene(a_scene(), "camera")
    assert SceneMessage.deserialize(written).serialize() == written
