"""``foxglove_msgs/msg/ImageAnnotations``: circles, ψ and objects, to be drawn over the image.

Foxglove's pixels begin at the upper left corner of the first one; ours have their centres at whole numbers.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from lcf_edge.cdr import Writer
from lcf_edge.messages import Kind, ObjectState, Scene, Shape
from lcf_edge.standard_messages.labels import (
    GREEN,
    NOTHING,
    RED,
    SHADE,
    YELLOW,
    Colour,
    circle_label,
    colour_of,
    object_label,
)

MESSAGE = "foxglove_msgs/msg/ImageAnnotations"

CENTRE_PX = 0.5  # of our pixels, in Foxglove's
FONT_PX = 12.0
LETTERS_ABOVE_PX = 2.0

_LINE_LOOP = 2

Ring = tuple[float, float, float, Colour, float]
"""x, y, radius (px of the input frame), colour, thickness (px)."""
Box = tuple[float, float, float, float, Colour, float]
"""x, y of the middle, width, height (px of the input frame), colour, thickness (px)."""
Label = tuple[float, float, str, Colour]
"""x, y of the lower left corner (px of the input frame), text, colour."""


def encode_image_annotations(scene: Scene) -> bytes:
    """Encode what ``write_image_annotations`` writes. Raises ``CdrError``."""
    return write_image_annotations(scene).payload()


def write_image_annotations(scene: Scene) -> Writer:
    """Normal circles green, rebels red, ψ yellow; objects orange (will probably be met) or light blue, with text.

    The stamp is that of the scene. It comes first, as in messages that begin with a header; programs older than that
    field go by the stamp of each annotation, which is the same. What has no finite position is left out. Raises
    ``CdrError``.
    """
    rings, boxes, labels = _shapes(scene)
    writer = Writer()
    writer.stamp(scene.stamp_ns)
    writer.scalars("I", len(rings))
    for x, y, radius, colour, thickness in rings:
        writer.stamp(scene.stamp_ns)
        writer.scalars("12d", x + CENTRE_PX, y + CENTRE_PX, 2 * radius, thickness, *NOTHING, *colour)
        writer.scalars("I", 0)  # metadata: none
    writer.scalars("I", len(boxes))
    for x, y, width, height, colour, thickness in boxes:
        left, right = x + CENTRE_PX - width / 2, x + CENTRE_PX + width / 2
        top, bottom = y + CENTRE_PX - height / 2, y + CENTRE_PX + height / 2
        writer.stamp(scene.stamp_ns)
        writer.scalars("B", _LINE_LOOP)
        writer.scalars("I", 4)
        writer.scalars("12d", left, top, right, top, right, bottom, left, bottom, *colour)
        writer.scalars("I", 0)  # a colour of each line: none
        writer.scalars("5d", *NOTHING, thickness)
        writer.scalars("I", 0)
    writer.scalars("I", len(labels))
    for x, y, text, colour in labels:
        writer.stamp(scene.stamp_ns)
        writer.scalars("2d", x + CENTRE_PX, y + CENTRE_PX - LETTERS_ABOVE_PX)
        writer.string(text)
        writer.scalars("9d", FONT_PX, *colour, *SHADE)
        writer.scalars("I", 0)
    writer.scalars("I", 0)
    return writer


def _shapes(scene: Scene) -> tuple[list[Ring], list[Box], list[Label]]:
    rings: list[Ring] = []
    boxes: list[Box] = []
    labels: list[Label] = []
    circles = _somewhere(scene.circles, ("x", "y", "radius"))
    objects = _somewhere(scene.objects, ("x", "y", "width", "height"))
    for x, y, radius, kind in _rows(circles, "x", "y", "radius", "kind"):
        rings.append((x, y, radius, RED, 2.0) if kind == Kind.REBEL else (x, y, radius, GREEN, 1.0))
    for rebel in circles[circles["kind"] == Kind.REBEL]:
        if not _in_a_box(rebel, objects):
            x, y, radius = float(rebel["x"]), float(rebel["y"]), float(rebel["radius"])
            labels.append((x - radius, y - radius, circle_label(rebel), RED))
    regions = _somewhere(scene.psi, ("x", "y", "width", "height"))
    for x, y, width, height, shape in _rows(regions, "x", "y", "width", "height", "shape"):
        if shape == Shape.CIRCLE:
            rings.append((x, y, width / 2, YELLOW, 1.0))
        else:
            boxes.append((x, y, width, height, YELLOW, 1.0))
    for thing, (x, y, width, height) in zip(objects, _rows(objects, "x", "y", "width", "height"), strict=True):
        colour = colour_of(thing)
        boxes.append((x, y, width, height, colour, 2.0 if thing["state"] == ObjectState.SEEN else 1.0))
        labels.append((x - width / 2, y - height / 2, object_label(thing), colour))
    return rings, boxes, labels


def _somewhere(table: npt.NDArray[np.void], names: tuple[str, ...]) -> npt.NDArray[np.void]:
    """Return the rows in which all these numbers are finite."""
    return np.asarray(table[np.logical_and.reduce([np.isfinite(table[name]) for name in names])])


def _rows(table: npt.NDArray[np.void], *names: str) -> Iterator[tuple[Any, ...]]:
    """Return these fields of each row, as Python numbers."""
    return zip(*(table[name].tolist() for name in names), strict=True)


def _in_a_box(circle: np.void, objects: npt.NDArray[np.void]) -> bool:
    """Whether a circle lies in the box of an object, which has its own label."""
    across, down = np.abs(objects["x"] - circle["x"]), np.abs(objects["y"] - circle["y"])
    return bool(((2 * across <= objects["width"]) & (2 * down <= objects["height"])).any())
