"""``vision_msgs/msg/Detection2DArray`` and ``Detection3DArray`` (version 4: from Humble on): objects as detections."""

import numpy as np

from lcf_edge.cdr import Writer
from lcf_edge.messages import Scene
from lcf_edge.standard_messages.labels import class_name
from lcf_edge.standard_messages.positions import Floats, Setup, placed, positions, sizes

MESSAGE_2D = "vision_msgs/msg/Detection2DArray"
MESSAGE_3D = "vision_msgs/msg/Detection3DArray"

_NO_POSE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def encode_detections_2d(scene: Scene, setup: Setup) -> bytes:
    """Encode each box, px of the input frame; class by name, score: trust / largest trust. Raises ``CdrError``."""
    writer = Writer()
    writer.header(scene.stamp_ns, setup.frame_id)
    writer.scalars("I", len(scene.objects))
    for thing in scene.objects:
        writer.header(scene.stamp_ns, setup.frame_id)
        _hypothesis(writer, thing, setup.max_trust, np.zeros(3), np.zeros((6, 6)))
        writer.scalars("5d", *(float(thing[name]) for name in ("x", "y")), 0.0, thing["width"], thing["height"])
        writer.string(str(thing["id"]))
    return writer.payload()


def encode_detections_3d(scene: Scene, setup: Setup) -> bytes:
    """Encode objects of known range, m in the camera's optical frame, as deep as wide. Raises ``CdrError``."""
    objects = placed(scene.objects)
    writer = Writer()
    writer.header(scene.stamp_ns, setup.frame_id)
    writer.scalars("I", len(objects))
    for thing, middle, size in zip(objects, positions(objects), sizes(objects, setup.lens), strict=True):
        writer.header(scene.stamp_ns, setup.frame_id)
        _hypothesis(writer, thing, setup.max_trust, middle, _covariance(thing, middle))
        writer.scalars("7d", *middle, *_NO_POSE[3:])
        writer.scalars("3d", size[0], size[1], size[0])
        writer.string(str(thing["id"]))
    return writer.payload()


def _hypothesis(writer: Writer, thing: np.void, max_trust: float, middle: Floats, covariance: Floats) -> None:
    """The only hypothesis."""
    writer.scalars("I", 1)
    writer.string(class_name(thing))
    writer.scalars("d", min(max(float(thing["trust"]) / max_trust, 0.0), 1.0))
    writer.scalars("7d", *middle, *_NO_POSE[3:])
    writer.scalars("36d", *covariance.ravel())


def _covariance(thing: np.void, middle: Floats) -> Floats:
    """(6, 6): of the position, m²; the orientation is unknown, which ROS writes as zeros."""
    ahead = middle[2]
    spreads = [(middle / ahead, thing["range_sigma"])]  # along the line of sight
    spreads.append((np.array((ahead * (1 + (middle[0] / ahead) ** 2), 0.0, 0.0)), thing["bearing_sigma"]))
    spreads.append((np.array((0.0, ahead * (1 + (middle[1] / ahead) ** 2), 0.0)), thing["elevation_sigma"]))
    covariance = np.zeros((6, 6))
    for way, sigma in spreads:
        if np.isfinite(sigma):
            covariance[:3, :3] += np.outer(way, way) * float(sigma) ** 2
    return covariance
