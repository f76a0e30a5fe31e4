"""``visualization_msgs/msg/MarkerArray``: objects as boxes with their velocity and a text, for RViz and Foxglove."""

from typing import NamedTuple

import numpy as np

from lcf_edge.cdr import Writer
from lcf_edge.messages import Scene
from lcf_edge.standard_messages.labels import Colour, colour_of, object_label
from lcf_edge.standard_messages.positions import Floats, Setup, placed, positions, sizes

MESSAGE = "visualization_msgs/msg/MarkerArray"

LIFETIME_NS = 500_000_000  # a marker that is not renewed goes
BOX_OPACITY = 0.5
TEXT_M = 0.25  # height of a capital
ARROW_M = (0.05, 0.12, 0.15)  # thickness of the shaft, of the head, length of the head

_ARROW, _CUBE, _TEXT = 0, 1, 9
_ADD, _DELETE_ALL = 0, 3
_SLOWEST_MPS = 0.05  # least speed with an arrow


class _Marker(NamedTuple):
    """The fields in which markers differ; m in the optical frame."""

    space: str
    number: int
    kind: int
    action: int
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: Colour = (0.0, 0.0, 0.0, 0.0)
    points: tuple[tuple[float, float, float], ...] = ()
    text: str = ""


def encode_markers(scene: Scene, setup: Setup) -> bytes:
    """Encode a marker that removes earlier ones, then box, text and velocity of each object of known range.

    An arrow is as long as the path of one second over ground. Raises ``CdrError``.
    """
    markers = [_Marker("", 0, _CUBE, _DELETE_ALL)]
    objects = placed(scene.objects)
    for thing, middle, size in zip(objects, positions(objects), sizes(objects, setup.lens), strict=True):
        markers += _of_object(thing, middle, size, setup)
    writer = Writer()
    writer.scalars("I", len(markers))
    for marker in markers:
        _write(writer, marker, scene.stamp_ns, setup.frame_id)
    return writer.payload()


def _of_object(thing: np.void, middle: Floats, size: Floats, setup: Setup) -> list[_Marker]:
    number, colour = int(thing["id"]) % 2**31, colour_of(thing)
    x, y, z = middle.tolist()
    width, height = size.tolist()
    if not np.isfinite((x, y, z, width, height)).all():
        return []
    box = _Marker("box", number, _CUBE, _ADD, (x, y, z), (width, height, width), (*colour[:3], BOX_OPACITY))
    above = (x, y - height / 2 - TEXT_M, z)
    text = _Marker("text", number, _TEXT, _ADD, above, (0.0, 0.0, TEXT_M), colour, text=object_label(thing))
    velocity = np.array((thing["v_forward"], -thing["v_right"], 0.0), np.float64)
    if not np.linalg.norm(velocity) > _SLOWEST_MPS:
        return [box, text]
    end = middle + setup.base_from_optical.T @ velocity
    tip = (float(end[0]), float(end[1]), float(end[2]))
    return [box, text, _Marker("velocity", number, _ARROW, _ADD, scale=ARROW_M, colour=colour, points=((x, y, z), tip))]


def _write(writer: Writer, marker: _Marker, stamp_ns: int, frame_id: str) -> None:
    writer.header(stamp_ns, frame_id)
    writer.string(marker.space)
    writer.scalars("3i", marker.number, marker.kind, marker.action)
    writer.scalars("10d", *marker.at, 0.0, 0.0, 0.0, 1.0, *marker.scale)
    writer.scalars("4f", *marker.colour)
    writer.scalars("iI?", *divmod(LIFETIME_NS, 1_000_000_000), True)  # it stays with the camera
    writer.scalars("I", len(marker.points))
    for point in marker.points:
        writer.scalars("3d", *point)
    writer.scalars("I", 0)  # a colour of each point: none
    writer.string("")  # texture: none,
    writer.header(0, "")  # nor an image of it
    writer.string("")
    writer.octets(b"")
    writer.scalars("I", 0)  # with places in it
    writer.string(marker.text)
    writer.string("")  # mesh: none,
    writer.string("")  # nor a file of it
    writer.octets(b"")
    writer.scalars("?", False)
