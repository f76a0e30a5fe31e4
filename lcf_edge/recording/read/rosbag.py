"""MCAP recordings of ROS 2 messages, as ``ros2 bag record`` and ``lcf-edge record`` write them."""

import math
from collections.abc import Iterator
from functools import partial
from itertools import chain
from pathlib import Path

from drivers.samples import ImuSample, SpeedSample
from lcf_edge import cdr
from lcf_edge.config import Config
from lcf_edge.errors import ConfigError, LcfError, RecordingError
from lcf_edge.lens import Lens
from lcf_edge.recording.read.decoding import RAW_ENCODINGS, image_from_bytes, image_from_message
from lcf_edge.recording.read.distortion import distortion
from lcf_edge.recording.read.images import natural_order
from lcf_edge.recording.read.mcap_file import McapFile, McapMessage, McapTopic
from lcf_edge.recording.read.recording import MAX_STAMP_NS, Recording, Sample, UndecodedFrame, reorder

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED_IMAGE = "sensor_msgs/msg/CompressedImage"
IMU = "sensor_msgs/msg/Imu"
ODOMETRY = "nav_msgs/msg/Odometry"
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"

SCHEMAS = frozenset((IMAGE, COMPRESSED_IMAGE, IMU, ODOMETRY, TWIST_STAMPED, CAMERA_INFO))

SURVEY_BYTES = 64 * 2**20  # of messages, in which every topic of a file without summary must show up
HEAD_BYTES = 4096  # of a topic's first message: its header, or a whole CameraInfo


class _MessageError(LcfError):
    """A message whose numbers cannot be used; the text says why, for counting."""


class RosBag(Recording):
    """One MCAP file, or the files of a bag's folder in the order of their names.

    Read are the first topics of images, IMU samples and speed that can be used; stamps are those of the
    headers, or the time of recording where a header has none. IMU samples pass in the axes in which they were
    recorded, which are assumed to be the camera's: frame ids are not interpreted; ``imu.axes`` turns them, and a
    warning says when it should. Raises ``RecordingError`` and ``OSError``.
    """

    def __init__(self, path: Path, config: Config) -> None:
        super().__init__(path)
        self._files = self._open_files()
        self._firsts = self._survey()
        image = self._choose("image", IMAGE, COMPRESSED_IMAGE)
        imu = self._choose("imu", IMU)
        speed = self._choose("speed", ODOMETRY, TWIST_STAMPED)
        if image is None:
            raise RecordingError(
                f"{path}: no image that can be read in it (sensor_msgs/msg/Image of "
                f"{', '.join(RAW_ENCODINGS)}, or CompressedImage); record a camera topic"
            )
        kinds = ((image, "image"), (imu, "imu"), (speed, "speed"))
        self._kinds = {topic: kind for topic, kind in kinds if topic}
        self.has_imu, self.has_speed = imu is not None, speed is not None
        counts = [file.counts[image] for file in self._files if file.counts is not None]
        self.frame_count = sum(counts) if len(counts) == len(self._files) else None
        self.lens = self._read_lens(image)
        self._warn_without_lens(config)
        if imu and not config.imu.axes:
            self._check_axes(image, imu)

    def _items(self) -> Iterator[UndecodedFrame | Sample]:
        return reorder(self._stamped(), self._late)

    def _stamped(self) -> Iterator[UndecodedFrame | Sample]:
        for message in self._messages():
            if (kind := self._kinds.get(message.topic)) is None:
                continue
            where = f"{self.path}: {message.topic.name} at {message.log_time_ns / 1e9:.3f} s"
            try:
                yield _parse(message, where)
            except _MessageError as error:
                self._skip(f"{kind} message {error}", where)
            except cdr.CdrError:
                self._skip(f"{kind} message malformed", where)

    def _late(self, item: UndecodedFrame | Sample) -> None:
        kind = {UndecodedFrame: "image", ImuSample: "imu", SpeedSample: "speed"}[type(item)]
        self._skip(f"{kind} time that does not increase", f"{self.path}: {kind} of {item.stamp_ns / 1e9:.3f} s")

    def _open_files(self) -> list[McapFile]:
        """Return the files that can be opened: after a power cut, a bag's last file may be empty."""
        files: list[McapFile] = []
        paths = bag_files(self.path)
        for path in paths:
            try:
                files.append(McapFile(path))
            except RecordingError as error:
                if len(paths) == 1:
                    raise
                self._warn(str(error))
        return files

    def _messages(self) -> Iterator[McapMessage]:
        return chain.from_iterable(file.messages(self._warn, self._skip) for file in self._files)

    def _survey(self) -> dict[McapTopic, bytes]:
        """Return the beginning of the first message of every usable topic, in the order of appearance."""
        expected: set[McapTopic] | None = set()
        for file in self._files:
            if file.counts is None or expected is None:
                expected = None  # without a summary, topics are unknown
            else:
                expected |= {topic for topic, count in file.counts.items() if count and _is_read(topic)}
        firsts: dict[McapTopic, bytes | None] = {}
        seen_bytes = 0
        for message in self._messages():
            if _is_read(message.topic) and message.topic not in firsts:
                usable = _is_usable(message.topic, message.data)
                firsts[message.topic] = message.data[:HEAD_BYTES] if usable else None
            seen_bytes += len(message.data)
            if seen_bytes > SURVEY_BYTES or (expected is not None and firsts.keys() >= expected):
                break
        return {topic: head for topic, head in firsts.items() if head is not None}

    def _choose(self, kind: str, *schemas: str) -> McapTopic | None:
        """The first topic of the first of ``schemas`` that occurs."""
        topics = [topic for schema in schemas for topic in self._firsts if topic.schema == schema]
        if len(topics) > 1:
            others = ", ".join(topic.name for topic in topics[1:])
            self._warn(f"{self.path}: several {kind} topics, {topics[0].name} is read and {others} not")
        return topics[0] if topics else None

    def _read_lens(self, image: McapTopic) -> Lens | None:
        """The lens by the CameraInfo in the namespace of the images' topic."""
        infos = [topic for topic in self._firsts if topic.schema == CAMERA_INFO]
        topics = [topic for topic in infos if image.name.startswith(f"{topic.name.rpartition('/')[0]}/")]
        if not topics:
            return None
        topic = max(topics, key=lambda topic: topic.name.count("/"))
        try:
            info = cdr.decode_camera_info(self._firsts[topic])
            if not info.k[0]:  # 0 means uncalibrated
                return None
            fx, _, cx, _, fy, cy, *_ = info.k
            return Lens(info.width, info.height, fx, fy, cx, cy, *distortion(info.distortion_model, info.d))
        except (ConfigError, cdr.CdrError, ValueError) as error:
            self._warn(f"{self.path}: {topic.name}: {error}; not used")
            return None

    def _check_axes(self, image: McapTopic, imu: McapTopic) -> None:
        try:
            own, camera = (cdr.decode_header(self._firsts[topic]).frame_id for topic in (imu, image))
        except cdr.CdrError:
            return  # reported and counted while reading
        if own != camera and not own.endswith("_optical_frame"):
            self._warn(
                f"{self.path}: {imu.name} is in the axes of {own or 'no named frame'}, taken for the "
                "camera's (x right, y down, z forward); set imu.axes"
            )


def bag_files(path: Path) -> list[Path]:
    """The MCAP files of a bag: ``path`` itself, or those in the folder."""
    return sorted(path.glob("*.mcap"), key=lambda file: natural_order(file.name)) if path.is_dir() else [path]


def _is_read(topic: McapTopic) -> bool:
    return topic.schema in SCHEMAS and topic.encoding == "cdr"


def _is_usable(topic: McapTopic, first: bytes) -> bool:
    """Whether a topic has usable contents, by its first message: depth images and IMU topics
    with half of the values do not.
    """
    try:
        if topic.schema == IMAGE:
            return cdr.decode_image(first).encoding.lower() in RAW_ENCODINGS
        if topic.schema == COMPRESSED_IMAGE:
            return "compressedDepth" not in cdr.decode_compressed_image(first).format
        if topic.schema == IMU:
            imu = cdr.decode_imu(first)
            return imu.gyro is not None and imu.accel is not None
    except cdr.CdrError:
        pass  # this one is broken, the next may be intact
    return True


def _parse(message: McapMessage, where: str) -> UndecodedFrame | Sample:
    """Raises ``CdrError`` or ``_MessageError``."""
    match message.topic.schema:
        case schema if schema == IMAGE:
            image = cdr.decode_image(message.data)
            return UndecodedFrame(_stamp_ns(image.header, message), where, partial(image_from_message, image))
        case schema if schema == COMPRESSED_IMAGE:
            compressed = cdr.decode_compressed_image(message.data)
            return UndecodedFrame(
                _stamp_ns(compressed.header, message), where, partial(image_from_bytes, compressed.data)
            )
        case schema if schema == IMU:
            imu = cdr.decode_imu(message.data)
            if imu.gyro is None or imu.accel is None:
                raise _MessageError("without angular velocity or acceleration")
            if not all(map(math.isfinite, imu.gyro + imu.accel)):
                raise _MessageError("with NaN or inf")
            return ImuSample(_stamp_ns(imu.header, message), imu.gyro, imu.accel)
        case schema:
            decode = cdr.decode_odometry if schema == ODOMETRY else cdr.decode_twist_stamped
            twist = decode(message.data)
            speed_mps, yaw_rate_radps = twist.linear[0], twist.angular[2]
            if not math.isfinite(speed_mps) or math.isinf(yaw_rate_radps):  # NaN: an unknown yaw rate
                raise _MessageError("with NaN or inf")
            return SpeedSample(_stamp_ns(twist.header, message), speed_mps, yaw_rate_radps)


def _stamp_ns(header: cdr.Header, message: McapMessage) -> int:
    stamp_ns = header.stamp_ns if header.stamp_ns > 0 else message.log_time_ns
    if stamp_ns > MAX_STAMP_NS:
        raise _MessageError("without a time")
    return stamp_ns
