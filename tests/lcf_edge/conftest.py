"""A rover for the tools that look at one: all that the daemon publishes, over real Zenoh, without a camera.

And another implementation of ROS 2 messages, which knows ours.
"""

import threading
import time
from collections.abc import Callable, Iterator
from functools import cached_property
from importlib.resources import files
from typing import Any

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.ImageAnnotations_pb2 import ImageAnnotations
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from lcf_edge.config import Config, Zenoh
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Cause, Kind, ObjectClass, ObjectState, Scene, Shape
from lcf_edge.zenoh_link import open_session
from lcf_edge.zenoh_link.link import Link

OF_OTHERS = {
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose",
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox2D bbox\nstring id"
    ),
    "vision_msgs/msg/Detection3D": (
        "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox3D bbox\nstring id"
    ),
    "vision_msgs/msg/Detection2DArray": "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
    "vision_msgs/msg/Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections",
    "nav2_msgs/msg/SpeedLimit": "std_msgs/Header header\nbool percentage\nfloat64 speed_limit",
}
"""Messages of vision_msgs 4 and nav2_msgs, which rosbags does not have."""

FRAME_S = 0.05
PATIENCE_S = 20.0

CIRCLES = np.zeros(5, CIRCLE)
CIRCLES["id"] = (7, 3, 9, 12, 15)
CIRCLES["kind"] = (Kind.NORMAL, Kind.REBEL, Kind.NORMAL, Kind.REBEL, Kind.NORMAL)
CIRCLES["cause"] = (Cause.NONE, Cause.LEADING, Cause.NONE, Cause.INCOMING, Cause.NONE)
CIRCLES["x"], CIRCLES["y"], CIRCLES["radius"] = (40, 90, 200, 150, 270), (60, 90, 150, 110, 80), (20, 15, 25, 30, 18)
CIRCLES["ttc"] = (np.inf, 3.5, np.inf, 1.25, np.inf)
CIRCLES["bearing"], CIRCLES["range"] = (-0.3, -0.2, 0.1, 0.05, 0.4), (np.nan, 6.5, np.nan, 2.5, np.nan)
CIRCLES["support"], CIRCLES["trust"], CIRCLES["lateral"] = 11, 4.0, np.nan

PSI = np.zeros(2, PSI_REGION)
PSI["id"], PSI["shape"] = (1, 2), (Shape.CIRCLE, Shape.RECTANGLE)
PSI["x"], PSI["y"], PSI["width"], PSI["height"] = (200, 280), (150, 200), 50, 40

OBJECTS = np.zeros(3, OBJECT)
for name in OBJECT.names[8:]:
    OBJECTS[name] = np.nan
OBJECTS["id"], OBJECTS["support"], OBJECTS["trust"] = (4, 2, 8), 21, 4.0
OBJECTS["class_id"] = ObjectClass.STANDING, ObjectClass.CROSSING, ObjectClass.CUTTING_IN
OBJECTS["state"] = ObjectState.SEEN, ObjectState.SEEN, ObjectState.HIDDEN
OBJECTS["x"], OBJECTS["y"], OBJECTS["width"], OBJECTS["height"] = (60, 150, 250), (120, 110, 130), (40, 70, 30), 90
OBJECTS["ttc"], OBJECTS["ttc_sigma"] = (0.75, 2.125, np.inf), (0.1, 0.25, np.nan)
OBJECTS["bearing"], OBJECTS["probability"] = (-0.3, 0.05, 0.35), (0.125, 0.97, 0.0)
OBJECTS["range"], OBJECTS["range_sigma"] = (1.5, 3.25, np.nan), (0.25, 0.5, np.nan)
OBJECTS["lateral"], OBJECTS["lateral_sigma"] = (-1.25, 0.125, np.nan), (0.125, 0.25, np.nan)
OBJECTS["v_forward"], OBJECTS["v_right"], OBJECTS["age"], OBJECTS["unseen"] = (
    (0.0, 0.1, 1.2),
    (0.0, 0.9, -0.4),
    1.5,
    0.0,
)

STATUS = (
    DeviceStatus("camera", Level.OK, "delivers", {"rate_hz": "20.00", "age_s": "0.012"}),
    DeviceStatus("imu", Level.ERROR, "away since 2026-01-01T00:00:00Z: unplugged", {"rate_hz": "nan"}),
    DeviceStatus(
        "pipeline",
        Level.OK,
        "runs",
        {"latency_p50_ms": "3.10", "latency_p99_ms": "8.20", "psi_fill": "2/32", "objects_fill": "3/24"},
    ),
    DeviceStatus("memory", Level.OK, "within the budget", {"resident_mib": "71.5", "budget_mib": "96"}),
)


class Rover:
    """Publishes a frame each ``FRAME_S`` and its health with each, as long as it is there.

    ``objects``, ``circles``, ``status``, ``silent`` (no scenes) may be changed meanwhile. ``unseen``: frames since a
    preview was wanted; ``seq``: of the newest scene.
    """

    def __init__(self, endpoint: str) -> None:
        self.endpoint = endpoint
        self.objects, self.circles, self.status, self.silent = OBJECTS, CIRCLES, STATUS, False
        self.previews = self.unseen = self.seq = 0
        self._changed = threading.Condition()
        self._leaves = threading.Event()
        self.come()

    def come(self) -> None:
        """Begin, also again."""
        self._leaves.clear()
        self.link = Link(open_session(Zenoh(listen=[self.endpoint])), Config())
        self._thread = threading.Thread(target=self._publish, name="rover")
        self._thread.start()

    def leave(self) -> None:
        """Be away."""
        self._leaves.set()
        self._thread.join()
        self.link.close()

    def wait_for(self, happened: Callable[[], object]) -> None:
        """Look with every frame until it ``happened``."""
        with self._changed:
            assert self._changed.wait_for(lambda: bool(happened()), PATIENCE_S)

    def _publish(self) -> None:
        while not self._leaves.wait(FRAME_S):
            stamp_ns = time.time_ns() - 3_000_000
            if not self.silent:
                self.seq += 1
                tables = self.circles, PSI
                self.link.put_scene(Scene(stamp_ns, self.seq, 320, 240, 1.5, *tables, objects=self.objects))
            self.link.put_diagnostics(self.status, stamp_ns)
            self.unseen += 1
            if self.link.has_preview_subscriber():
                self.link.put_preview(self._jpeg, stamp_ns)
                self.previews += 1
                self.unseen = 0
            with self._changed:
                self._changed.notify_all()

    @cached_property
    def _jpeg(self) -> bytes:
        """Two panels: the left one blue, the right one grey."""
        panels = np.full((240, 640, 3), 90, np.uint8)
        panels[:, :320] = (160, 40, 20)
        return cv2.imencode(".jpg", panels)[1].tobytes()


@pytest.fixture(scope="session")
def rover_at() -> type[Rover]:
    """A rover that publishes at an endpoint, until it leaves."""
    return Rover


@pytest.fixture
def rover(endpoint: str) -> Iterator[Rover]:
    rover = Rover(endpoint)
    yield rover
    rover.leave()


def foxglove_definitions(message: Any) -> dict[str, str]:
    """ROS definitions, by name, of a message of Foxglove's own package and of all that it is made of."""
    kinds = {"double": "float64", "string": "string", "enum": "uint8"}
    found: dict[str, str] = {}
    lines = []
    for field in message.fields:
        if field.message_type is None:
            kind = next(ros for name, ros in kinds.items() if field.type == getattr(field, f"TYPE_{name.upper()}"))
        elif field.message_type.name == "Timestamp":
            kind = "builtin_interfaces/Time"
        else:
            kind = f"foxglove_msgs/{field.message_type.name}"
            found |= foxglove_definitions(field.message_type)
        lines.append(f"{kind}{'[]' if field.is_repeated else ''} {field.name}")
    return found | {f"foxglove_msgs/msg/{message.name}": "\n".join(lines)}


@pytest.fixture(scope="session")
def ros() -> Typestore:
    """An independent implementation of ROS 2 messages, which knows ours by their definitions alone."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    for name in ("Circle", "PsiRegion", "Object", "Scene"):
        text = (files("lcf_edge") / "msg" / f"{name}.msg").read_text(encoding="utf-8")
        store.register(get_types_from_msg(text, f"lcf_msgs/msg/{name}"))
    for name, text in {**OF_OTHERS, **foxglove_definitions(ImageAnnotations.DESCRIPTOR)}.items():
        store.register(get_types_from_msg(text, name))
    return store
