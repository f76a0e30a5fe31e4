"""The published topics: names, types and settings."""

from dataclasses import dataclass

import zenoh

from lcf_edge.cdr import CdrError
from lcf_edge.standard_messages import (
    camera_transform,
    detections,
    image_annotations,
    markers,
    point_cloud,
    speed_limit,
)


@dataclass(frozen=True, slots=True)
class ZenohTopic:
    """A published topic."""

    name: str  # "scene"
    message: str  # "lcf_msgs/msg/Scene"
    priority: zenoh.Priority
    express: bool = False
    max_bytes: int = 2**17  # of a payload; a scene has some 60 a circle
    is_global: bool = False  # not under the prefix
    is_lasting: bool = False  # for ROS 2: late subscribers get the last one

    def key(self, prefix: str) -> str:
        """The key of its samples."""
        return self.name if self.is_global else f"{prefix}/{self.name}"

    @property
    def encoding(self) -> str:
        """The encoding of its samples."""
        return f"application/cdr;{self.message}"

    def payload(self, sample: zenoh.Sample) -> bytes:
        """Return the payload of a sample. Raises ``CdrError`` if it is larger than any of this topic."""
        if len(sample.payload) > self.max_bytes:
            raise CdrError(f"{self.name}: {len(sample.payload)} bytes are too many")
        return sample.payload.to_bytes()


ANNOTATIONS = ZenohTopic("annotations", image_annotations.MESSAGE, zenoh.Priority.DATA)
POINTS = ZenohTopic("points", point_cloud.MESSAGE, zenoh.Priority.DATA_HIGH)
MARKERS = ZenohTopic("markers", markers.MESSAGE, zenoh.Priority.DATA)
DETECTIONS_2D = ZenohTopic("detections", detections.MESSAGE_2D, zenoh.Priority.DATA_HIGH)
DETECTIONS_3D = ZenohTopic("detections_3d", detections.MESSAGE_3D, zenoh.Priority.DATA_HIGH)
SPEED_LIMIT = ZenohTopic("speed_limit", speed_limit.MESSAGE, zenoh.Priority.DATA_HIGH, express=True)
NAV2_SPEED_LIMIT = ZenohTopic("nav2_speed_limit", speed_limit.NAV2_MESSAGE, zenoh.Priority.DATA_HIGH, express=True)
TRANSFORM = ZenohTopic("tf_static", camera_transform.MESSAGE, zenoh.Priority.DATA_LOW, is_global=True, is_lasting=True)

STANDARD = (ANNOTATIONS, POINTS, MARKERS, DETECTIONS_2D, DETECTIONS_3D, SPEED_LIMIT, NAV2_SPEED_LIMIT, TRANSFORM)
"""Those of ``standard_messages``."""
