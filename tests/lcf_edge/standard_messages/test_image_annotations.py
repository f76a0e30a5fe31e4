"""What Foxglove draws over the image."""

from collections.abc import Callable
from typing import Any

import pytest
from foxglove_schemas_protobuf.PointsAnnotation_pb2 import PointsAnnotation

from lcf_edge.messages import Scene
from lcf_edge.standard_messages.image_annotations import MESSAGE, encode_image_annotations
from lcf_edge.standard_messages.labels import GREEN, LIGHT_BLUE, ORANGE, RED, YELLOW

Fields = dict[str, float]


@pytest.fixture
def drawn(scene: Callable[..., Scene], walker: Fields, read: Callable[[bytes, str], Any]) -> Callable[..., Any]:
    """What is drawn of a walker with some fields changed."""
    return lambda **changed: read(encode_image_annotations(scene({**walker, **changed})), MESSAGE)


def rgba(colour: Any) -> tuple[float, ...]:
    return colour.r, colour.g, colour.b, colour.a


def test_the_stamp_is_that_of_the_image(drawn: Callable[..., Any]) -> None:
    stamp = drawn().timestamp
    assert stamp.sec * 10**9 + stamp.nanosec == 1_700_000_000_123_456_789


def test_so_is_that_of_each_annotation(drawn: Callable[..., Any]) -> None:
    """Programs that do not know the stamp of the whole message pair image and annotations by these."""
    message = drawn()
    stamps = {(one.timestamp.sec, one.timestamp.nanosec) for one in (*message.circles, *message.points, *message.texts)}
    assert stamps == {(message.timestamp.sec, message.timestamp.nanosec)}


def test_circles_lie_at_their_centre_in_pixels_that_begin_at_the_corner(drawn: Callable[..., Any]) -> None:
    """Our pixel 100 is from 100 to 101 for Foxglove, its centre 100.5."""
    normal, incoming, crossing, psi = drawn().circles
    assert (normal.position.x, normal.position.y, normal.diameter) == (100.5, 50.5, 20.0)
    assert [rgba(one.outline_color) for one in (normal, incoming, crossing, psi)] == [GREEN, RED, RED, YELLOW]
    assert (psi.position.x, psi.diameter, psi.fill_color.a) == (500.5, 80.0, 0.0)


def test_boxes_are_closed_lines_around_region_and_object(drawn: Callable[..., Any]) -> None:
    region, walker = drawn().points
    assert region.type == walker.type == PointsAnnotation.Type.LINE_LOOP
    assert [(point.x, point.y) for point in region.points] == [
        (590.5, 380.5),
        (610.5, 380.5),
        (610.5, 420.5),
        (590.5, 420.5),
    ]
    assert [rgba(one.outline_color) for one in (region, walker)] == [YELLOW, ORANGE]


def test_what_will_not_be_met_is_blue_and_what_is_not_seen_is_thin(drawn: Callable[..., Any]) -> None:
    _, box = drawn(probability=0.1, state=1).points
    assert (rgba(box.outline_color), box.thickness) == (LIGHT_BLUE, 1.0)
    assert drawn().points[1].thickness == 2.0


def test_texts_label_objects_and_rebels_outside_of_them(drawn: Callable[..., Any]) -> None:
    """The incoming rebel is inside the walker's box."""
    assert [text.text for text in drawn().texts] == ["crossing", "crossing 2.0 ±0.2 s 4.0 m"]
    assert next(text.text for text in drawn(x=600.0).texts) == "incoming 1.2 s"


def test_what_is_nowhere_is_not_drawn(drawn: Callable[..., Any]) -> None:
    message = drawn(x=float("nan"))
    assert len(message.points) == 1
    assert len(message.circles) == 4
