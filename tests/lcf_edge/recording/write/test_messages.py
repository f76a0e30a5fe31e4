"""What is recorded is what an independent decoder reads, under definitions that are those of ROS 2."""

import math
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.cdr import restamped
from lcf_edge.config import Config, Imu, Publish, Record
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.lens import Lens
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Scene
from lcf_edge.recording.write.messages import CAMERA_INFO, IMAGES, SCENE, TOPICS, Encoder, FrameAndScene, Statuses
from lcf_edge.recording.write.schemas import schema

DEFAULT = Config()
IMAGE = np.random.default_rng(1).integers(0, 256, (24, 32), np.uint8)
TABLES = np.ones(2, CIRCLE), np.ones(1, PSI_REGION)
SEEN = FrameAndScene(Frame(5, 7, IMAGE), Scene(5, 7, 32, 24, 1.5, *TABLES, objects=np.ones(3, OBJECT)))


def decoded(ros: Any, record: Any, config: Config = DEFAULT, lens: Lens | None = None) -> dict[str, Any]:
    """Messages of a record by topic."""
    messages = Encoder(config, lambda *_: lens).encode(record)
    return {message.topic.name: ros.deserialize_cdr(message.payload, message.topic.message) for message in messages}


@pytest.mark.parametrize("name", sorted({topic.message for topic in TOPICS} - {SCENE.message}))
def test_definitions_are_those_of_ros(ros: Any, name: str) -> None:
    ours = get_typestore(Stores.EMPTY)
    ours.register(get_types_from_msg(schema(name).decode(), name))
    assert ours.hash_rihs01(name) == ros.hash_rihs01(name)


def test_inertial_samples(ros: Any) -> None:
    message = decoded(ros, ImuSample(5, (0.1, -0.2, 0.3), (1.0, -9.81, 2.0)))["imu"]
    gyro, accel = message.angular_velocity, message.linear_acceleration
    assert (gyro.x, gyro.y, gyro.z, accel.x, accel.y, accel.z) == (0.1, -0.2, 0.3, 1.0, -9.81, 2.0)
    assert message.orientation_covariance[0] == -1  # there is none
    assert not message.angular_velocity_covariance.any()


@pytest.mark.parametrize(
    ("axes", "frame_id"), [([], "front"), ([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]], "imu")]
)
def test_samples_stay_in_their_own_axes_and_the_frame_says_so(ros: Any, axes: list[list[float]], frame_id: str) -> None:
    config = Config(imu=Imu(axes=axes), publish=Publish(frame_id="front"))
    message = decoded(ros, ImuSample(5, (0.1, 0.2, 0.3), (0.0, 0.0, 9.81)), config)["imu"]
    assert message.header.frame_id == frame_id
    assert (message.angular_velocity.x, message.linear_acceleration.z) == (0.1, 9.81)


def test_speeds(ros: Any) -> None:
    twist = decoded(ros, SpeedSample(5, 1.25, math.nan))["speed"].twist
    assert (twist.linear.x, twist.linear.y) == (1.25, 0)
    assert math.isnan(twist.angular.z)


def test_images_lossless_or_nearly(ros: Any) -> None:
    for kind, most in (("png", 0), ("jpeg", 40)):
        config = Config(record=Record(format=kind, jpeg_quality=95))  # type: ignore[arg-type]
        message = decoded(ros, SEEN, config)[IMAGES.name]
        assert message.format == kind
        image = np.asarray(cv2.imdecode(message.data, cv2.IMREAD_UNCHANGED), int)
        assert image.shape == IMAGE.shape
        assert np.abs(image - IMAGE).max() <= most


def test_the_scene_of_the_image(ros: Any) -> None:
    message = decoded(ros, SEEN)[SCENE.name]
    assert (message.frame_seq, message.vehicle_speed, len(message.circles), len(message.psi)) == (7, 1.5, 2, 1)
    assert [(thing.class_id, thing.ttc_sigma) for thing in message.objects] == [(1, 1.0)] * 3


@pytest.mark.parametrize(
    ("lens", "model", "d"),
    [
        (None, "", []),
        (Lens(32, 24, 20, 21, 15.5, 11.5), "plumb_bob", [0] * 5),
        (
            Lens(32, 24, 20, 21, 15.5, 11.5, "radial-tangential", (-0.1, 0.01, 1e-3, 2e-3)),
            "plumb_bob",
            [-0.1, 0.01, 1e-3, 2e-3, 0],
        ),
        (
            Lens(32, 24, 20, 21, 15.5, 11.5, "radial-tangential", (-0.1, 0.01, 1e-3, 2e-3, 3e-3)),
            "plumb_bob",
            [-0.1, 0.01, 1e-3, 2e-3, 3e-3],
        ),
        (
            Lens(32, 24, 20, 21, 15.5, 11.5, "equidistant", (0.1, 0.2, 0.3, 0.4)),
            "equidistant",
            [0.1, 0.2, 0.3, 0.4],
        ),
    ],
)
def test_the_lens_if_it_is_known(ros: Any, lens: Lens | None, model: str, d: list[float]) -> None:
    info = decoded(ros, SEEN, lens=lens)[CAMERA_INFO.name]
    assert (info.width, info.height, info.distortion_model, info.d.tolist()) == (32, 24, model, d)
    k = lens.matrix if lens else np.zeros((3, 3))
    assert info.k.reshape(3, 3).tolist() == k.tolist()
    assert info.p.reshape(3, 4)[:, :3].tolist() == k.tolist()
    assert info.r.reshape(3, 3).tolist() == np.eye(3).tolist()


def test_how_each_part_was(ros: Any) -> None:
    statuses = [DeviceStatus("camera", Level.WARN, "away", {"rate_hz": "0"})]
    (status,) = decoded(ros, Statuses(5, statuses))["diagnostics"].status
    assert (status.name, status.message, status.values[0].key) == ("camera", "away", "rate_hz")


@given(st.integers(0, 2**31 - 1), st.integers(0, 10**9 - 1), st.integers(0, 8))
def test_another_stamp_changes_nothing_else(ros: Any, sec: int, nanosec: int, length: int) -> None:
    config = Config(publish=Publish(frame_id="f" * length))
    (message,) = Encoder(config, lambda *_: None).encode(SpeedSample(5, 1.25, 0.5))
    payload = restamped(message.payload, sec * 10**9 + nanosec)
    read = ros.deserialize_cdr(payload, message.topic.message)
    assert (read.header.stamp.sec, read.header.stamp.nanosec) == (sec, nanosec)
    assert payload[12:] == message.payload[12:]
