"""MCAP recordings: ROS 2 messages as other programs write them, whole and damaged."""

import struct
import tracemalloc
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config, Imu
from lcf_edge.errors import RecordingError
from lcf_edge.lens import Lens
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording

Read = Callable[..., tuple[Any, list[Any]]]

START_NS = 1_700_000_000_000_000_000
STEP_NS = 50_000_000

MAGIC = b"\x89MCAP0\r\n"
CHUNK, DATA_END = 0x06, 0x0F


@pytest.fixture(scope="module")
def ros() -> Typestore:
    return get_typestore(Stores.ROS2_HUMBLE)


@dataclass
class Messages:
    """Makes messages: (type, payload)."""

    ros: Typestore

    def _make(self, kind: str, stamp_ns: int, frame_id: str, **fields: Any) -> tuple[str, bytes]:
        sec, nanosec = divmod(stamp_ns, 10**9)
        stamp = self.ros.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        header = self.ros.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id)
        return kind, bytes(self.ros.serialize_cdr(self.ros.types[kind](header=header, **fields), kind))

    def image(self, stamp_ns: int, pixels: Any, encoding: str = "mono8", **changed: Any) -> tuple[str, bytes]:
        height, width = pixels.shape[:2]
        fields = {"height": height, "width": width, "encoding": encoding, "is_bigendian": 0}
        fields |= {"step": pixels.strides[0], "data": pixels.reshape(-1)}
        return self._make("sensor_msgs/msg/Image", stamp_ns, "camera_optical_frame", **(fields | changed))

    def compressed(self, stamp_ns: int, data: bytes, image_format: str = "jpeg") -> tuple[str, bytes]:
        array = np.frombuffer(data, np.uint8)
        return self._make("sensor_msgs/msg/CompressedImage", stamp_ns, "camera", format=image_format, data=array)

    def imu(
        self,
        stamp_ns: int,
        gyro: tuple[float, ...] = (0.1, 0.2, 0.3),
        frame_id: str = "imu_optical_frame",
        unknown: float = 0,
    ) -> tuple[str, bytes]:
        x, y, z = gyro
        return self._make(
            "sensor_msgs/msg/Imu",
            stamp_ns,
            frame_id,
            orientation=self.ros.types["geometry_msgs/msg/Quaternion"](x=0, y=0, z=0, w=1),
            orientation_covariance=np.zeros(9),
            angular_velocity=self._vector(x, y, z),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self._vector(0, -9.81, 0),
            linear_acceleration_covariance=np.full(9, unknown, float),
        )

    def odometry(self, stamp_ns: int, speed: float = 1.5) -> tuple[str, bytes]:
        types = self.ros.types
        pose = types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](x=0, y=0, z=0),
            orientation=types["geometry_msgs/msg/Quaternion"](x=0, y=0, z=0, w=1),
        )
        return self._make(
            "nav_msgs/msg/Odometry",
            stamp_ns,
            "odom",
            child_frame_id="base_link",
            pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=self._twist(speed), covariance=np.zeros(36)),
        )

    def twist(self, stamp_ns: int, speed: float = 1.5) -> tuple[str, bytes]:
        return self._make("geometry_msgs/msg/TwistStamped", stamp_ns, "base_link", twist=self._twist(speed))

    def camera_info(
        self,
        model: str = "plumb_bob",
        d: tuple[float, ...] = (),
        focal: float = 50.0,
        k: tuple[float, ...] = (),
        size: tuple[int, int] = (64, 48),
    ) -> tuple[str, bytes]:
        roi = self.ros.types["sensor_msgs/msg/RegionOfInterest"](
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        matrix = np.array(k or [focal, 0, 31.5, 0, focal + bool(focal), 23.5, 0, 0, 1], float)
        rest = {"r": np.zeros(9), "p": np.zeros(12), "binning_x": 0, "binning_y": 0, "roi": roi}
        fields = {
            "height": size[1],
            "width": size[0],
            "distortion_model": model,
            "d": np.array(d, float),
            "k": matrix,
        } | rest
        return self._make("sensor_msgs/msg/CameraInfo", START_NS, "camera_optical_frame", **fields)

    def _vector(self, x: float, y: float, z: float) -> Any:
        return self.ros.types["geometry_msgs/msg/Vector3"](x=float(x), y=float(y), z=float(z))

    def _twist(self, speed: float) -> Any:
        return self.ros.types["geometry_msgs/msg/Twist"](
            linear=self._vector(speed, 0, 0), angular=self._vector(0, 0, 0.25)
        )


@dataclass
class Bag:
    """An MCAP file in the making: (topic, type, payload, log time)."""

    path: Path
    messages: list[tuple[str, str, bytes, int]] = field(default_factory=list)

    def add(self, topic: str, message: tuple[str, bytes], log_time_ns: int = START_NS) -> None:
        self.messages.append((topic, *message, log_time_ns))

    def write(self, encoding: str = "cdr", **options: Any) -> Path:
        writer = Writer(str(self.path), **({"chunk_size": 20_000} | options))
        writer.start(profile="ros2")
        channels: dict[tuple[str, str], int] = {}
        for topic, kind, payload, log_time_ns in self.messages:
            if (topic, kind) not in channels:
                schema = writer.register_schema(kind, "ros2msg", b"")
                channels[topic, kind] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic, kind], log_time_ns, payload, log_time_ns)
        writer.finish()
        return self.path


@pytest.fixture
def make(ros: Typestore) -> Messages:
    return Messages(ros)


@pytest.fixture
def bag(tmp_path: Path) -> Bag:
    return Bag(tmp_path / "drive.mcap")


def pixels(index: int) -> Any:
    return np.full((48, 64), 5 * index, np.uint8)


@pytest.fixture
def drive(bag: Bag, make: Messages) -> Bag:
    """20 images at 20/s that are recorded 30 ms late, IMU at 100/s, odometry at 50/s, and other things."""
    arrivals: list[tuple[int, str, tuple[str, bytes]]] = []
    for index in range(20):
        stamp = START_NS + index * STEP_NS
        arrivals.append((stamp + 30_000_000, "/camera/image_raw", make.image(stamp, pixels(index))))
        arrivals.append((stamp + 30_000_001, "/camera/camera_info", make.camera_info(d=(0.1, 0.2, 0.3, 0.4, 0.0))))
    end = START_NS + 20 * STEP_NS
    arrivals += [(stamp + 1, "/imu/data", make.imu(stamp)) for stamp in range(START_NS, end, 10_000_000)]
    for stamp in range(START_NS, end, 20_000_000):
        arrivals.append((stamp + 2, "/odom", make.odometry(stamp)))
        arrivals.append((stamp + 3, "/chatter", ("std_msgs/msg/String", b"\0\1\0\0\2\0\0\0a\0")))
    for log_time_ns, topic, message in sorted(arrivals, key=lambda arrival: arrival[0]):
        bag.add(topic, message, log_time_ns)
    return bag


def of(kind: type, items: list[Any]) -> list[Any]:
    return [item for item in items if isinstance(item, kind)]


FORMS: list[dict[str, Any]] = [
    {"compression": CompressionType.NONE},
    {"compression": CompressionType.LZ4},
    {"compression": CompressionType.ZSTD},
    {"use_chunking": False},
    {"repeat_channels": False},
    {"use_statistics": False},
]


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_everything_is_delivered(drive: Bag, read: Read, form: dict[str, Any]) -> None:
    recording, items = read(drive.write(**form))
    assert [frame.stamp_ns for frame in of(Frame, items)] == [START_NS + n * STEP_NS for n in range(20)]
    assert [frame.seq for frame in of(Frame, items)] == list(range(20))
    assert [int(frame.image.mean()) for frame in of(Frame, items)] == [5 * n for n in range(20)]
    assert [s.gyro for s in of(ImuSample, items)] == [(0.1, 0.2, 0.3)] * 100
    assert [s.accel for s in of(ImuSample, items)] == [(0, -9.81, 0)] * 100
    assert [(s.speed_mps, s.yaw_rate_radps) for s in of(SpeedSample, items)] == [(1.5, 0.25)] * 50
    assert recording.lens == Lens(64, 48, 50.0, 51.0, 31.5, 23.5, "radial-tangential", (0.1, 0.2, 0.3, 0.4, 0.0))
    assert recording.frame_count == (None if "repeat_channels" in form or "use_statistics" in form else 20)
    assert (recording.has_imu, recording.has_speed) == (True, True)
    assert (recording.warnings, dict(recording.skipped)) == ([], {})


def test_samples_come_before_the_frame_that_needs_them(drive: Bag, read: Read) -> None:
    _, items = read(drive.write())
    for frame in of(Frame, items)[:-1]:
        before = items[: items.index(frame)]
        assert of(ImuSample, before)[-1].stamp_ns == frame.stamp_ns
        assert 0 <= of(SpeedSample, before)[-1].stamp_ns - frame.stamp_ns < 20_000_000


def test_reading_again_gives_the_same(drive: Bag) -> None:
    recording = open_recording(drive.write(), Config())
    assert [repr(item) for item in recording] == [repr(item) for item in recording]


def test_a_folder_of_another_writer(tmp_path: Path, ros: Typestore, make: Messages, read: Read) -> None:
    """A bag as a folder with its metadata, written by rosbags."""
    with BagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {
            kind: writer.add_connection(topic, kind, typestore=ros)
            for topic, kind in (("/image", "sensor_msgs/msg/Image"), ("/imu", "sensor_msgs/msg/Imu"))
        }
        for index in range(5):
            stamp = START_NS + index * STEP_NS
            for kind, payload in (make.imu(stamp), make.image(stamp, pixels(index))):
                writer.write(connections[kind], stamp, payload)
    recording, items = read(tmp_path / "bag")
    assert (len(of(Frame, items)), len(of(ImuSample, items)), recording.frame_count) == (5, 5, 5)


def test_files_of_a_split_bag_are_one_recording(tmp_path: Path, make: Messages, read: Read) -> None:
    for number in (0, 1, 2, 10):
        part = Bag(tmp_path / f"bag_{number}.mcap")
        part.add("/image", make.image(START_NS + number * STEP_NS, pixels(number)))
        part.write()
    recording, items = read(tmp_path)
    assert [int(frame.image.mean()) for frame in items] == [0, 5, 10, 50]
    assert recording.frame_count == 4


def test_an_empty_last_file_of_a_bag_is_passed_over(tmp_path: Path, make: Messages, read: Read) -> None:
    part = Bag(tmp_path / "bag_0.mcap")
    part.add("/image", make.image(START_NS, pixels(1)))
    part.write()
    (tmp_path / "bag_1.mcap").write_bytes(b"")
    recording, items = read(tmp_path)
    assert len(items) == 1
    assert "bag_1.mcap: not an MCAP file" in recording.warnings[0]


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_compressed_images(bag: Bag, make: Messages, read: Read, suffix: str) -> None:
    good = cv2.imencode(suffix, pixels(20))[1].tobytes()
    for index, data in enumerate((good, good[:-20], b"", good)):
        bag.add("/image/compressed", make.compressed(START_NS + index, data))
    recording, items = read(bag.write())
    assert [(frame.seq, int(frame.image.mean())) for frame in items] == [(0, 100), (3, 100)]
    assert recording.skipped == {"image damaged": 1, "image empty": 1}


def test_colour(bag: Bag, make: Messages, read: Read) -> None:
    bag.add("/image", make.image(START_NS, np.full((4, 4, 3), (255, 0, 0), np.uint8), "rgb8"))
    _, (frame,) = read(bag.write())
    assert frame.image[0, 0] == 76


def test_twist_is_speed_where_there_is_no_odometry(bag: Bag, make: Messages, read: Read) -> None:
    bag.add("/twist", make.twist(START_NS, 0.75))
    bag.add("/image", make.image(START_NS, pixels(1)))
    _, items = read(bag.write())
    assert of(SpeedSample, items)[0] == SpeedSample(START_NS, 0.75, 0.25)


def test_a_header_without_time_has_the_time_of_recording(bag: Bag, make: Messages, read: Read) -> None:
    bag.add("/image", make.image(0, pixels(1)), log_time_ns=START_NS + 5)
    _, (frame,) = read(bag.write())
    assert frame.stamp_ns == START_NS + 5


def test_the_first_of_several_topics_is_read(bag: Bag, make: Messages, read: Read) -> None:
    for index in range(3):
        bag.add("/left/image", make.image(START_NS + index, pixels(1)))
        bag.add("/right/image", make.image(START_NS + index, pixels(2)))
    bag.add("/right/camera_info", make.camera_info())
    recording, items = read(bag.write())
    assert {int(frame.image.mean()) for frame in items} == {5}
    assert "several image topics, /left/image is read and /right/image not" in recording.warnings[0]
    assert recording.lens is None, "the other camera's lens is not this one's"


def test_topics_that_cannot_be_used_are_not_chosen(bag: Bag, make: Messages, read: Read) -> None:
    """Depth images, and an IMU whose gyro and accelerometer are apart."""
    bag.add("/depth", make.image(START_NS, np.zeros((4, 8), np.uint8), "16UC1", width=4))
    bag.add("/depth/compressed", make.compressed(START_NS, b"", "16UC1; compressedDepth png"))
    bag.add("/gyro", make.imu(START_NS, unknown=-1))
    bag.add("/image", make.image(START_NS, pixels(1)))
    recording, items = read(bag.write())
    assert [int(frame.image.mean()) for frame in items] == [5]
    assert not recording.has_imu


@pytest.mark.parametrize(
    ("frame_id", "is_warned_of"),
    [("imu_optical_frame", False), ("camera_optical_frame", False), ("imu_link", True), ("", True)],
)
def test_axes_of_an_imu_that_may_not_be_the_cameras_are_reported(
    bag: Bag, make: Messages, frame_id: str, is_warned_of: bool
) -> None:
    bag.add("/camera/camera_info", make.camera_info())
    bag.add("/camera/image", make.image(START_NS, pixels(1)))
    bag.add("/imu", make.imu(START_NS, frame_id=frame_id))
    bag.write()
    assert any("imu.axes" in warning for warning in open_recording(bag.path, Config()).warnings) == is_warned_of
    turn = Imu(axes=[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    assert open_recording(bag.path, Config(imu=turn)).warnings == []


@pytest.mark.parametrize(
    ("model", "d", "expected"),
    [
        ("plumb_bob", (0.1, 0.2, 0.3, 0.4), ("radial-tangential", (0.1, 0.2, 0.3, 0.4))),
        ("plumb_bob", (0.0,) * 5, ("none", ())),
        ("", (), ("none", ())),
        ("equidistant", (0.1, 0.2, 0.3, 0.4), ("equidistant", (0.1, 0.2, 0.3, 0.4))),
        (
            "rational_polynomial",
            (0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0),
            ("radial-tangential", (0.1, 0.2, 0.3, 0.4, 0.5)),
        ),
        ("rational_polynomial", (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0, 0), None),
        ("spline", (0.1,), None),
        ("plumb_bob", (0.1, float("nan"), 0.0, 0.0), None),
    ],
)
def test_lens(bag: Bag, make: Messages, model: str, d: tuple[float, ...], expected: tuple[str, Any] | None) -> None:
    bag.add("/camera/camera_info", make.camera_info(model, d))
    bag.add("/camera/image_raw", make.image(START_NS, pixels(1)))
    recording = open_recording(bag.write(), Config())
    if expected is None:
        assert recording.lens is None
        assert any("/camera/camera_info" in warning for warning in recording.warnings)
    else:
        assert recording.lens
        assert (recording.lens.model, recording.lens.coefficients) == expected


@pytest.mark.parametrize(
    "info",
    [
        {"k": (50, 0, 31.5, 0, 0, 23.5, 0, 0, 1)},
        {"k": (1e-320, 0, 31.5, 0, 1e-320, 23.5, 0, 0, 1)},
        {"k": (-50, 0, 31.5, 0, 50, 23.5, 0, 0, 1)},
        {"k": (np.nan, 0, 31.5, 0, 50, 23.5, 0, 0, 1)},
        {"k": (np.inf, 0, 31.5, 0, 50, 23.5, 0, 0, 1)},
        {"k": (50, 0, 1e300, 0, 50, 23.5, 0, 0, 1)},
        {"k": (1e300, 0, 31.5, 0, 1e300, 23.5, 0, 0, 1)},
        {"d": (0.1, 1e300, 0, 0)},
        {"d": (0.1, 1e200, 1e200, 1e200, 1e200)},
        {"d": (np.nan, 0, 0, 0)},
        {"size": (0, 48)},
        {"size": (0, 0)},
        {"size": (2**32 - 1, 2**32 - 1)},
        {"model": "plumb_bob\x1b[31m" + "x" * 5000, "d": (0.1, 0.2, 0.3, 0.4)},
    ],
    ids=lambda info: str(info)[:40],
)
def test_a_lens_that_cannot_be_is_reported_in_one_line_and_not_used(
    bag: Bag, make: Messages, read: Read, info: dict[str, Any]
) -> None:
    bag.add("/camera/camera_info", make.camera_info(**info))
    bag.add("/camera/image_raw", make.image(START_NS, pixels(1)))
    recording, frames = read(bag.write())
    assert recording.lens is None
    assert len(frames) == 1
    assert [len(list(run(recording, Config()))), recording.warnings == [], "not used" in recording.warnings[0]] == [
        1,
        0,
        1,
    ]
    assert recording.warnings[0].isprintable()
    assert len(recording.warnings[0]) < 600


@pytest.mark.parametrize(
    "info",
    [{"d": (0.1, 1e-320, 0, 1e-320)}, {"d": (0.1, 0.2, 0.3, 1e-300, 1e-310)}, {"d": (-100.0, 100.0, 1.0, 1.0)}],
    ids=str,
)
def test_an_odd_lens_is_used_without_a_failure(bag: Bag, make: Messages, info: dict[str, Any]) -> None:
    bag.add("/camera/camera_info", make.camera_info(**info))
    bag.add("/camera/image_raw", make.image(START_NS, pixels(1)))
    recording = open_recording(bag.write(), Config())
    assert recording.lens
    assert len(list(run(recording, Config()))) == 1


def test_an_uncalibrated_camera_has_no_lens(bag: Bag, make: Messages) -> None:
    bag.add("/camera/camera_info", make.camera_info(focal=0.0))
    bag.add("/camera/image_raw", make.image(START_NS, pixels(1)))
    recording = open_recording(bag.write(), Config())
    assert recording.lens is None
    assert "camera.intrinsics" in recording.warnings[0]


def test_what_is_wrong_with_single_messages_is_counted(bag: Bag, make: Messages, read: Read) -> None:
    def add(topic: str, message: tuple[str, bytes]) -> None:
        bag.add(topic, message, START_NS + len(bag.messages))

    def cut(message: tuple[str, bytes]) -> tuple[str, bytes]:
        return message[0], message[1][:-30]

    for index in range(4):
        add("/image", make.image(START_NS + index * STEP_NS, pixels(index)))
        add("/imu", make.imu(START_NS + index * STEP_NS))
        add("/odom", make.odometry(START_NS + index * STEP_NS))
    stamp = START_NS + 4 * STEP_NS
    add("/image", make.image(stamp, pixels(1), data=np.zeros(100, np.uint8)))
    add("/image", make.image(stamp + 1, pixels(1), width=2**31, height=2**31))
    add("/image", make.image(stamp + 2, np.zeros((8, 8), np.uint8)))
    add("/image", cut(make.image(stamp + 3, pixels(1))))
    add("/image", make.image(START_NS, pixels(1)))
    add("/imu", make.imu(stamp, (0.0, float("nan"), 0.0)))
    add("/imu", make.imu(stamp + 1, unknown=-1))
    add("/imu", cut(make.imu(stamp + 2)))
    add("/odom", make.odometry(stamp, float("inf")))
    recording, items = read(bag.write())
    assert (len(of(Frame, items)), len(of(ImuSample, items)), len(of(SpeedSample, items))) == (4, 4, 4)
    assert recording.skipped == {
        "image shorter than its size": 1,
        "image too large": 1,
        "image of another size than the first": 1,
        "image message malformed": 1,
        "image time that does not increase": 1,
        "imu message with NaN or inf": 1,
        "imu message without angular velocity or acceleration": 1,
        "imu message malformed": 1,
        "speed message with NaN or inf": 1,
    }
    assert len(recording.warnings) == 9 + 1, "each told once, and that nothing is known of the lens"


def test_names_in_a_file_cannot_write_to_the_terminal(bag: Bag, make: Messages, read: Read) -> None:
    for index in range(2):
        bag.add(f"/image{index}\x1b[2J\n", make.image(START_NS, pixels(1)))
    recording, _ = read(bag.write())
    assert all(warning.isprintable() for warning in recording.warnings)


@pytest.mark.parametrize("form", FORMS, ids=str)
@pytest.mark.parametrize("share", [0.4, 0.6, 0.9])
def test_a_cut_file_is_read_up_to_the_cut(drive: Bag, read: Read, form: dict[str, Any], share: float) -> None:
    data = drive.write(**form).read_bytes()
    end_of_data = next(start for opcode, start, _ in _records(data) if opcode == DATA_END)
    drive.path.write_bytes(data[: int(share * end_of_data)])
    recording, items = read(drive.path)
    frames = len(of(Frame, items))
    assert [frame.seq for frame in of(Frame, items)] == list(range(frames))
    assert len(of(ImuSample, items)) >= 5 * (frames - 1)
    damage = [warning for warning in recording.warnings if "damaged at byte" in warning]
    assert len(damage) == 1
    assert damage[0].endswith("read up to there")


def test_zeros_that_a_power_cut_left_are_where_the_damage_is(drive: Bag, read: Read) -> None:
    data = drive.write().read_bytes()
    start, length = _chunks(data)[2]
    drive.path.write_bytes(data[: start + length] + bytes(50_000))
    recording, items = read(drive.path)
    assert f"damaged at byte {start + length}" in recording.warnings[0]
    assert len(of(Frame, items)) > 4


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_the_chunk_that_was_cut_is_read_as_far_as_it_goes(
    bag: Bag, make: Messages, read: Read, compression: CompressionType
) -> None:
    """All messages in one chunk, whose content does not compress."""
    rng = np.random.default_rng(1)
    for index in range(200):
        bag.add("/image", make.image(START_NS + index, rng.integers(0, 256, (48, 64), np.uint8)), START_NS + index)
    data = bag.write(compression=compression, chunk_size=2**24).read_bytes()
    bag.path.write_bytes(data[: len(data) * 3 // 4])
    recording, items = read(bag.path)
    assert 100 <= len(items) <= 150
    assert "damaged at byte" in recording.warnings[0]


MIB = 2**20
IMAGE = "sensor_msgs/msg/Image"


@pytest.mark.parametrize(
    ("topics", "bytes_each", "chunk_bytes"),
    [(1, 120 * MIB, 2**28), (1, 250 * MIB, 2**28), (20, 15 * MIB, 1), (3, 40 * MIB, 1)],
    ids=["one message", "a message too large", "many topics", "several messages"],
)
def test_a_small_file_takes_little_memory(bag: Bag, topics: int, bytes_each: int, chunk_bytes: int) -> None:
    for number in range(topics):
        bag.add(f"/image{number}", (IMAGE, bytes(bytes_each)))
    bag.write(compression=CompressionType.ZSTD, chunk_size=chunk_bytes)
    bag.messages.clear()
    assert bag.path.stat().st_size < 30_000
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError):
            open_recording(bag.path, Config())
        assert tracemalloc.get_traced_memory()[1] < 64 * MIB
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("claimed", [256 * MIB, 1000, 2**62], ids=["true", "small", "huge"])
@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_a_chunk_that_unpacks_to_much_takes_little_memory(tmp_path: Path, compression: str, claimed: int) -> None:
    def text(content: bytes) -> bytes:
        return struct.pack("<I", len(content)) + content

    zeros = bytes(256 * MIB)
    packed = lz4.frame.compress(zeros) if compression == "lz4" else zstandard.compress(zeros, 1)
    del zeros
    chunk = struct.pack("<QQQI", 0, 10, claimed, 0) + text(compression.encode())
    chunk += struct.pack("<Q", len(packed)) + packed
    header = text(b"ros2") + text(b"")
    magic = b"\x89MCAP0\r\n"
    records = [(1, header), (CHUNK, chunk), (2, bytes(20))]
    parts = [struct.pack("<BQ", opcode, len(content)) + content for opcode, content in records]
    path = tmp_path / "drive.mcap"
    path.write_bytes(magic + b"".join(parts) + magic)
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError):
            open_recording(path, Config())
        assert tracemalloc.get_traced_memory()[1] < 64 * MIB
    finally:
        tracemalloc.stop()


def test_names_of_topics_are_kept_only_as_far_as_topics_are_called(bag: Bag, make: Messages) -> None:
    for number in range(400):
        bag.add(f"/{number}{'x' * 50_000}", make.image(START_NS, pixels(1)))
    bag.write(chunk_size=1)
    tracemalloc.start()
    try:
        with pytest.raises(RecordingError):
            open_recording(bag.path, Config())
        assert tracemalloc.get_traced_memory()[1] < 8 * MIB
    finally:
        tracemalloc.stop()


def test_dark_images_that_compress_well_are_read(bag: Bag, make: Messages, read: Read) -> None:
    for index in range(10):
        bag.add("/image", make.image(START_NS + index, np.zeros((1080, 1440), np.uint8)), START_NS + index)
    recording, items = read(bag.write(compression=CompressionType.ZSTD, chunk_size=4 * MIB))
    assert len(items) == 10
    assert recording.skipped == {}


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD])
def test_a_chunk_that_is_damaged_is_passed_over(drive: Bag, read: Read, compression: CompressionType) -> None:
    data = bytearray(drive.write(compression=compression).read_bytes())
    chunks = _chunks(data)
    assert len(chunks) > 4
    start, length = chunks[1]
    data[start + length - 10] ^= 0xFF
    drive.path.write_bytes(data)
    recording, items = read(drive.path)
    (damage,) = recording.warnings
    assert f"byte {start}" in damage
    assert recording.skipped == {"chunk damaged": 1}
    frames = [frame.stamp_ns for frame in of(Frame, items)]
    assert frames[0] == START_NS
    assert frames[-1] == START_NS + 19 * STEP_NS
    assert 20 > len(frames) > 10


def _records(data: bytes | bytearray) -> Iterator[tuple[int, int, int]]:
    """Opcode, start and length of the records of a whole file."""
    at = len(MAGIC)
    while at < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, at)
        yield opcode, at, 9 + length
        at += 9 + length


def _chunks(data: bytes | bytearray) -> list[tuple[int, int]]:
    return [(start, length) for opcode, start, length in _records(data) if opcode == CHUNK]


@pytest.mark.parametrize("claim", [2**30, 2**40, 2**64 - 1])
@pytest.mark.parametrize(("place", "said"), [(16, "bytes unpacked"), (36, "")], ids=["unpacked", "packed"])
def test_a_size_that_is_a_lie_takes_no_memory(drive: Bag, read: Read, place: int, said: str, claim: int) -> None:
    """Sizes of a chunk, unpacked and packed (behind the four letters of its compression)."""
    data = bytearray(drive.write().read_bytes())
    start, _ = _chunks(data)[1]
    struct.pack_into("<Q", data, start + 9 + place, claim)
    drive.path.write_bytes(data)
    recording, items = read(drive.path)
    assert len(of(Frame, items)) > 10
    assert all(said in warning for warning in recording.warnings)


_FOOTER = struct.Struct("<BQQQI8s")


def _record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


_LONG = 2**64 - 1
_CHUNK_INDEX = _record(0x08, struct.pack("<QQQQIQI", 0, _LONG, _LONG, _LONG, 0, _LONG, 0))
_STATISTICS = struct.pack("<QHIIIIQQ", _LONG, 1, 1, 0, 0, 1, 0, _LONG)


@pytest.mark.parametrize(
    ("more", "start"),
    [
        (b"", 2**63),
        (b"", _LONG),
        (b"", 1),
        (b"", 8),  # the whole file
        (_CHUNK_INDEX * 1000, None),
        (_record(0x0E, struct.pack("<BQQ", 8, 8, _LONG)) * 1000, None),  # offsets of the summary, in circles
        (_record(0x0B, _STATISTICS + struct.pack("<IHQ", 10, 1, _LONG)), None),
        (_record(0x0B, _STATISTICS + struct.pack("<I", 2**32 - 1)), None),
        (struct.pack("<BQ", 0x0B, 2**63), None),
        (_record(0x04, bytes(12)) * 10_000, None),
    ],
)
def test_a_summary_that_lies_changes_nothing(drive: Bag, read: Read, more: bytes, start: int | None) -> None:
    data = drive.write().read_bytes()
    wanted = [type(item) for item in read(drive.path)[1]]
    footer = _FOOTER.unpack(data[-_FOOTER.size :])
    begin = footer[2] if start is None else start
    place = footer[2]
    tail = _FOOTER.pack(*footer[:2], begin, begin, 0, footer[5])
    drive.path.write_bytes(data[:place] + more + data[place : -_FOOTER.size] + tail)
    recording, items = read(drive.path)
    assert [type(item) for item in items] == wanted
    assert all(len(warning) < 300 for warning in recording.warnings)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_any_damage_leaves_a_recording_or_a_recording_error(drive: Bag, data: st.DataObject) -> None:
    form = data.draw(st.sampled_from(FORMS))
    content = bytearray(drive.write(**form).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(8, len(content) - 8))
        wrong = data.draw(st.one_of(st.binary(min_size=1, max_size=1), st.just(b"\xff" * 8), st.just(bytes(8))))
        content[at : at + len(wrong)] = wrong
    damaged = drive.path.with_name("damaged.mcap")
    damaged.write_bytes(content[: data.draw(st.integers(8, len(content)))])
    said = ""
    try:
        list(open_recording(damaged, Config()))
    except RecordingError as error:
        said = str(error)
    assert "\n" not in said


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"garbage" * 100,
        MAGIC,
        MAGIC + b"garbage" * 100,
        MAGIC + bytes(100_000),
    ],
    ids=["empty", "garbage", "magic", "magic, garbage", "magic, zeros"],
)
def test_garbage_is_refused_in_one_line(bag: Bag, content: bytes) -> None:
    bag.path.write_bytes(content)
    with pytest.raises(RecordingError) as caught:
        open_recording(bag.path, Config())
    assert str(caught.value).startswith(f"{bag.path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("fault", ["no images", "only depth", "ros1"])
def test_a_file_without_images_is_refused(bag: Bag, make: Messages, fault: str) -> None:
    bag.add("/imu", make.imu(START_NS))
    if fault == "only depth":
        bag.add("/depth", make.image(START_NS, pixels(1), "16UC1", width=32))
    elif fault == "ros1":
        bag.add("/image", make.image(START_NS, pixels(1)))
    bag.write(encoding="ros1" if fault == "ros1" else "cdr")
    with pytest.raises(RecordingError, match=r"no image that can be read in it.*record a camera topic"):
        open_recording(bag.path, Config())
