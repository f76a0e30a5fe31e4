"""Places in ROS: points, boxes and arrows lie where the object is, in the frame that the message names."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Camera, Config, Publish, Vehicle
from lcf_edge.lens import Lens
from lcf_edge.messages import OBJECT, Scene
from lcf_edge.standard_messages import camera_transform, detections, markers, point_cloud
from lcf_edge.standard_messages.positions import Setup, positions, quaternion

Fields = dict[str, float]
Read = Callable[[bytes, str], Any]
Angle = st.floats(-1.5, 1.5)


def points_of(message: Any) -> np.ndarray[Any, Any]:
    assert [(field.name, field.offset, field.datatype) for field in message.fields] == [
        ("x", 0, 7),
        ("y", 4, 7),
        ("z", 8, 7),
        ("probability", 12, 7),
    ]
    assert (message.height, message.point_step, message.row_step) == (1, 16, 16 * message.width)
    return message.data.view(np.float32).reshape(-1, 4)


@given(Angle, st.floats(-1.4, 1.4), st.floats(0.1, 100))
def test_the_lens_gives_bearing_and_elevation_of_the_place(bearing: float, across: float, ahead_m: float) -> None:
    """What is there in the optical frame is seen under these angles, by the lens's own formula."""
    thing = np.zeros(1, OBJECT)
    thing["range"], thing["bearing"], thing["elevation"] = ahead_m, bearing, across
    ((x, y, z),) = positions(thing)
    unit = Lens(2, 2, 1.0, 1.0, 0.0, 0.0)
    seen = unit.bearing(x / z, y / z)
    assert z == pytest.approx(ahead_m, rel=1e-5)
    assert seen == (pytest.approx(bearing, abs=1e-4), pytest.approx(across, abs=1e-4))


def test_points_lie_across_what_will_be_met(
    scene: Callable[..., Scene], walker: Fields, setup: Setup, read: Read
) -> None:
    """2 m at most 5 cm apart, in three rows, at the object's range."""
    message = read(point_cloud.encode_point_cloud(scene(walker), setup), point_cloud.MESSAGE)
    assert message.header.frame_id == "front_optical"
    points = points_of(message)
    met = points[points[:, 3] > 0]
    assert (met[:, 2] == 4.0).all()
    assert (met[:, 0].min(), met[:, 0].max()) == (pytest.approx(0.0, abs=1e-6), pytest.approx(2.0))
    assert np.diff(np.unique(met[:, 0])).max() <= point_cloud.SPACING_M + 1e-6
    np.testing.assert_allclose(np.unique(met[:, 1]), (0.0, 0.5, 1.0), atol=1e-6)


@pytest.mark.parametrize("changed", [{"probability": 0.4}, {"range": np.nan}])
def test_nothing_is_marked_for_what_passes_or_has_no_place(
    scene: Callable[..., Scene], walker: Fields, setup: Setup, read: Read, changed: Fields
) -> None:
    message = read(point_cloud.encode_point_cloud(scene({**walker, **changed}), setup), point_cloud.MESSAGE)
    points = points_of(message)
    assert not points[:, 3].any()
    assert (points[:, 2] == point_cloud.CLEAR_M).all()


def test_the_far_points_span_the_image_and_are_level(setup: Setup, scene: Callable[..., Scene], read: Read) -> None:
    """Level on the vehicle, however the camera is tilted: an obstacle layer drops what is too high or low."""
    points = points_of(read(point_cloud.encode_point_cloud(scene(), setup), point_cloud.MESSAGE))[:, :3]
    on_vehicle = points @ setup.base_from_optical.T
    np.testing.assert_allclose(on_vehicle[:, 2], 0.0, atol=1e-4)
    left, right = points[0, 0] / points[0, 2], points[-1, 0] / points[-1, 2]
    assert (left, right) == (pytest.approx(-319.5 / 500), pytest.approx(319.5 / 500))
    assert np.diff(points[:, 0]).max() < 0.4  # m at 30 m: less than a cell of 5 cm within 4 m


def test_markers_first_remove_those_of_before(scene: Callable[..., Scene], setup: Setup, read: Read) -> None:
    (only,) = read(markers.encode_markers(scene(), setup), markers.MESSAGE).markers
    assert only.action == only.DELETEALL


def test_markers_are_box_text_and_velocity(
    scene: Callable[..., Scene], walker: Fields, setup: Setup, read: Read
) -> None:
    _, box, text, arrow = read(markers.encode_markers(scene(walker), setup), markers.MESSAGE).markers
    assert [(one.type, one.action, one.id) for one in (box, text, arrow)] == [
        (box.CUBE, box.ADD, 9),
        (box.TEXT_VIEW_FACING, box.ADD, 9),
        (box.ARROW, box.ADD, 9),
    ]
    assert len({one.ns for one in (box, text, arrow)}) == 3  # or one would replace the other
    assert all(one.header.frame_id == "front_optical" and one.frame_locked for one in (box, text, arrow))
    place = box.pose.position
    assert (place.x, place.y, place.z) == (pytest.approx(1.0), pytest.approx(0.5), pytest.approx(4.0))
    assert (box.scale.x, box.scale.y) == (pytest.approx(2.0), pytest.approx(1.0))
    assert text.text == "crossing 2.0 ±0.2 s 4.0 m"
    start, end = (np.array((point.x, point.y, point.z)) for point in arrow.points)
    np.testing.assert_allclose(setup.base_from_optical @ (end - start), (0.0, 1.0, 0.0), atol=1e-6)  # left, in ROS


def test_detections_in_the_image(scene: Callable[..., Scene], walker: Fields, setup: Setup, read: Read) -> None:
    """Also of what has no range."""
    message = read(
        detections.encode_detections_2d(scene({**walker, "range": np.nan}), setup), "vision_msgs/msg/Detection2DArray"
    )
    (detection,) = message.detections
    box = detection.bbox
    assert (box.center.position.x, box.center.position.y, box.size_x, box.size_y) == (300.0, 210.0, 250.0, 125.0)
    (result,) = detection.results
    assert (result.hypothesis.class_id, result.hypothesis.score, detection.id) == ("crossing", 0.8, "9")


def test_detections_in_space(scene: Callable[..., Scene], walker: Fields, setup: Setup, read: Read) -> None:
    """With the covariance of the place: most along the line of sight."""
    message = read(
        detections.encode_detections_3d(scene(walker, {"range": np.nan}), setup), "vision_msgs/msg/Detection3DArray"
    )
    (detection,) = message.detections
    place = detection.bbox.center.position
    assert (place.x, place.y, place.z) == (pytest.approx(1.0), pytest.approx(0.5), pytest.approx(4.0))
    covariance = detection.results[0].pose.covariance.reshape(6, 6)[:3, :3]
    np.testing.assert_allclose(covariance, covariance.T)
    values, vectors = np.linalg.eigh(covariance)
    sight = np.array((1.0, 0.5, 4.0)) / np.linalg.norm((1.0, 0.5, 4.0))
    assert abs(vectors[:, -1] @ sight) > 0.99
    assert np.sqrt(values[-1]) == pytest.approx(0.5 * np.linalg.norm((1.0, 0.5, 4.0)) / 4.0, rel=0.01)


def test_the_camera_sits_where_the_configuration_says(read: Read) -> None:
    """Right and up of lcf become left and up of ROS."""
    config = Config(
        camera=Camera(ahead_m=0.5, left_m=-0.25, height_m=0.75, pitch_rad=0.1, yaw_rad=0.2),
        publish=Publish(frame_id="front", base_frame="base_footprint"),
        vehicle=Vehicle(horizon_s=3.0),
    )
    setup = Setup.from_config(config, Lens(640, 480, 500.0, 500.0, 319.5, 239.5))
    assert (setup.horizon_s, setup.max_trust) == (3.0, 5.0)
    (transform,) = read(camera_transform.encode_camera_transform(5, setup), camera_transform.MESSAGE).transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("base_footprint", "front")
    moved, turned = transform.transform.translation, transform.transform.rotation
    assert (moved.x, moved.y, moved.z) == (0.5, -0.25, 0.75)
    axis = rotated((turned.x, turned.y, turned.z, turned.w), np.array((0.0, 0.0, 1.0)))  # where the camera looks
    assert np.arctan2(axis[1], axis[0]) == pytest.approx(-0.2)  # to the right: negative about z
    assert np.arcsin(axis[2]) == pytest.approx(0.1)  # up
    right = rotated((turned.x, turned.y, turned.z, turned.w), np.array((1.0, 0.0, 0.0)))
    assert right[2] == pytest.approx(0.0, abs=1e-12)  # it does not roll
    assert right[1] < 0


def rotated(turn: tuple[float, ...], vector: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """By a quaternion x, y, z, w, as in any textbook."""
    axis, w = np.array(turn[:3]), turn[3]
    across = np.cross(axis, vector)
    return np.asarray(vector + 2 * (w * across + np.cross(axis, across)))


@given(Angle, Angle, st.sampled_from([0, 1, 2]))
def test_quaternions_turn_as_their_matrices_do(pitch: float, yaw: float, axis: int) -> None:
    lens = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
    matrix = Setup(lens, pitch_rad=pitch, yaw_rad=yaw).base_from_optical
    unit = np.eye(3)[axis]
    np.testing.assert_allclose(rotated(quaternion(matrix), unit), matrix @ unit, atol=1e-9)
