"""Implementations that are not ours find the node, receive all that it publishes, and read every byte of it."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import zenoh
from rosbags.typesys.store import Typestore

from lcf_edge.config import Config, Publish
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Cause, Kind, ObjectClass, ObjectState, Scene, Shape
from lcf_edge.zenoh_link.link import Link

TOPICS = {
    "/lcf/scene": "lcf_msgs/msg/Scene",
    "/lcf/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/lcf/preview/compressed": "sensor_msgs/msg/CompressedImage",
    "/lcf/annotations": "foxglove_msgs/msg/ImageAnnotations",
    "/lcf/points": "sensor_msgs/msg/PointCloud2",
    "/lcf/markers": "visualization_msgs/msg/MarkerArray",
    "/lcf/detections": "vision_msgs/msg/Detection2DArray",
    "/lcf/detections_3d": "vision_msgs/msg/Detection3DArray",
    "/lcf/speed_limit": "geometry_msgs/msg/TwistStamped",
    "/lcf/nav2_speed_limit": "nav2_msgs/msg/SpeedLimit",
    "/tf_static": "tf2_msgs/msg/TFMessage",
}
EVERYTHING = Publish(
    ros2=True,
    ros2_domain=7,
    robot="rover",
    annotations=True,
    points=True,
    markers=True,
    detections=True,
    speed_limit=True,
    transform=True,
)
STAMP_NS = 1_700_000_000_123_456_789


def a_scene() -> Scene:
    circle = np.zeros(1, CIRCLE)
    circle[0] = (5, Kind.REBEL, Cause.CROSSING, 11, 312.5, 201.0, 24.0, 1.5, 63.0, 4.0, 2.25, 0.25, -0.5, 3.25, np.nan)
    region = np.zeros(1, PSI_REGION)
    region[0] = (2, Shape.CIRCLE, 90.0, 240.0, 120.0, 120.0, 5.0)
    numbers = np.arange(24.0)
    numbers[10] = np.nan  # the range
    thing = np.array([(9, ObjectClass.CUTTING_IN, ObjectState.HIDDEN, 21, *numbers)], OBJECT)
    return Scene(STAMP_NS, 17, 640, 480, 1.5, circle, region, objects=thing)


def definitions(ros: Typestore, name: str) -> dict[str, str]:
    """Of a type, and of each type within it."""
    first, *others = ros.generate_msgdef(name, ros_version=2)[0].split("=" * 80 + "\n")
    parts = (other.removeprefix("MSG: ").partition("\n") for other in others)
    return {**{kind.replace("/", "/msg/"): text for kind, _, text in parts}, name: first}


@pytest.fixture
def node(ros: Typestore, endpoint: str, session: zenoh.Session) -> Iterator[subprocess.Popen[str]]:
    assert session
    port = endpoint.rpartition(":")[2]
    command = (sys.executable, str(Path(__file__).with_name("ros_node.py")), port, "7")
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin
        topics = {topic: (kind, definitions(ros, kind)) for topic, kind in TOPICS.items()}
        process.stdin.write(json.dumps(topics) + "\n")
        process.stdin.flush()
        yield process
        process.kill()


def test_a_node_receives_all_that_is_published(
    node: subprocess.Popen[str], session: zenoh.Session, until_matched: Callable[[zenoh.Session, str], None]
) -> None:
    _, jpeg = cv2.imencode(".jpg", np.zeros((48, 64), np.uint8))
    link = Link(session, Config(publish=EVERYTHING))
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
    (thing,) = scene["objects"]
    assert (thing["id"], thing["class_id"], thing["state"]) == (9, ObjectClass.CUTTING_IN, ObjectState.HIDDEN)
    assert (thing["ttc"], thing["ttc_sigma"], thing["range"], thing["unseen"]) == (4.0, 5.0, "nan", 23.0)
    (status,) = received["/lcf/diagnostics"]["status"]
    assert (status["name"], status["message"]) == ("camera", "dark")
    assert status["values"] == [{"key": "rate_hz", "value": "29.9"}]
    preview = received["/lcf/preview/compressed"]
    assert (preview["format"], preview["data"]) == ("jpeg", {"bytes": jpeg.size})
    texts = [text["text"] for text in received["/lcf/annotations"]["texts"]]
    assert texts == ["crossing 2.2 s", "cutting in 4.0 ±5.0 s"]
    assert received["/lcf/annotations"]["timestamp"] == stamp
    cloud = received["/lcf/points"]
    assert (cloud["header"], cloud["point_step"]) == ({"stamp": stamp, "frame_id": "camera"}, 16)
    assert cloud["data"] == {"bytes": 16 * cloud["width"]}
    assert [marker["action"] for marker in received["/lcf/markers"]["markers"]] == [3]  # its range is not known
    (detection,) = received["/lcf/detections"]["detections"]
    assert (detection["id"], detection["results"][0]["hypothesis"]["class_id"]) == ("9", "cutting_in")
    assert received["/lcf/detections_3d"]["detections"] == []
    assert received["/lcf/speed_limit"]["twist"]["linear"]["x"] == 0.0
    assert received["/lcf/nav2_speed_limit"]["speed_limit"] == 0.001
    (transform,) = received["/tf_static"]["transforms"]
    assert (transform["header"]["frame_id"], transform["child_frame_id"]) == ("base_link", "camera")
    assert transform["transform"]["translation"] == {"x": 0.0, "y": 0.0, "z": 0.3}
