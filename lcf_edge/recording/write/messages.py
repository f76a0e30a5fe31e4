"""From records to messages: what is recorded of each, on which topic.

A message is queued with a stamp of the monotonic clock, which the file replaces by one of the system clock.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge import cdr
from lcf_edge.config import Config
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.lens import Lens
from lcf_edge.messages import PipelineScene
from lcf_edge.standard_messages import camera_transform, image_annotations, markers
from lcf_edge.standard_messages.camera_transform import encode_camera_transform
from lcf_edge.standard_messages.image_annotations import write_image_annotations
from lcf_edge.standard_messages.markers import encode_markers
from lcf_edge.standard_messages.positions import Setup

KnownLens = Callable[[Config, int, int], Lens | None]
"""The calibrated lens for images of a width and height; None: it is only guessed."""

_MODELS = {"none": "plumb_bob", "radial-tangential": "plumb_bob", "equidistant": "equidistant"}
_PNG_COMPRESSION = 1  # of 9; more takes several times as long to save a few percent


class RecordedTopic(NamedTuple):
    """Messages of one type."""

    name: str  # below the prefix
    message: str
    is_global: bool = False  # not below it
    is_stamped: bool = True  # its messages begin with a stamp
    is_lasting: bool = False  # the player keeps the last message for late subscribers

    def path(self, prefix: str) -> str:
        """The topic's full name in ROS."""
        return f"/{self.name}" if self.is_global else f"/{prefix}/{self.name}"


IMAGES = RecordedTopic("camera/image_raw/compressed", "sensor_msgs/msg/CompressedImage")
CAMERA_INFO = RecordedTopic("camera/camera_info", "sensor_msgs/msg/CameraInfo")
IMU = RecordedTopic("imu", "sensor_msgs/msg/Imu")
SPEED = RecordedTopic("speed", "geometry_msgs/msg/TwistStamped")
SCENE = RecordedTopic("scene", "lcf_msgs/msg/Scene")
ANNOTATIONS = RecordedTopic("annotations", image_annotations.MESSAGE)
MARKERS = RecordedTopic("markers", markers.MESSAGE, is_stamped=False)
TRANSFORM = RecordedTopic("tf_static", camera_transform.MESSAGE, is_global=True, is_stamped=False, is_lasting=True)
DIAGNOSTICS = RecordedTopic("diagnostics", "diagnostic_msgs/msg/DiagnosticArray")

TOPICS = (IMAGES, CAMERA_INFO, IMU, SPEED, SCENE, ANNOTATIONS, MARKERS, TRANSFORM, DIAGNOSTICS)


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """A message before it has its final stamp."""

    topic: RecordedTopic
    stamp_ns: int  # monotonic
    payload: bytes
    stamps: Iterable[int] = cdr.FIRST  # where in the payload its stamp is, of topics that are stamped


@dataclass(frozen=True, slots=True)
class FrameAndScene:
    """A frame and its scene."""

    frame: Frame
    scene: PipelineScene


@dataclass(frozen=True, slots=True)
class Statuses:
    """The state of each part of the program; of none in a replay."""

    stamp_ns: int  # monotonic
    statuses: Sequence[DeviceStatus]


Record = FrameAndScene | ImuSample | SpeedSample | Statuses


class Encoder:
    """Encodes records by ``config``, which may be replaced at any time."""

    def __init__(self, config: Config, known_lens: KnownLens) -> None:
        self.config = config
        self._known_lens = known_lens
        self._info: tuple[Config, int, int, bytes] | None = None
        self._known_setup: tuple[Config, int, int, Setup] | None = None

    def encode(self, record: Record) -> Iterator[RecordedMessage]:
        """The messages of a record. Raises ``CdrError``."""
        publish = self.config.publish
        match record:
            case FrameAndScene(frame, scene):
                yield RecordedMessage(
                    CAMERA_INFO, frame.stamp_ns, self._camera_info(scene.image_width, scene.image_height)
                )
                yield RecordedMessage(IMAGES, frame.stamp_ns, self._image(frame))
                yield RecordedMessage(SCENE, frame.stamp_ns, cdr.encode_scene(scene, publish.frame_id))
                drawn = write_image_annotations(scene)
                yield RecordedMessage(ANNOTATIONS, frame.stamp_ns, drawn.payload(), drawn.stamps)
                setup = self._setup(scene.image_width, scene.image_height)
                yield RecordedMessage(MARKERS, frame.stamp_ns, encode_markers(replace(scene, stamp_ns=0), setup))
            case ImuSample():
                # The samples are in the IMU's own axes; without a rotation these are the camera's.
                frame_id = "imu" if self.config.imu.axes else publish.frame_id
                yield RecordedMessage(IMU, record.stamp_ns, cdr.encode_imu(0, frame_id, record.gyro, record.accel))
            case SpeedSample(stamp_ns, speed_mps, yaw_rate_radps):
                yield RecordedMessage(
                    SPEED, stamp_ns, cdr.encode_twist_stamped(0, "base_link", speed_mps, yaw_rate_radps)
                )
            case Statuses(stamp_ns, statuses):
                if statuses:
                    yield RecordedMessage(DIAGNOSTICS, stamp_ns, cdr.encode_diagnostics(0, publish.robot, statuses))
                camera = self.config.camera
                place = Setup.from_config(self.config, Lens.from_config(camera, camera.width, camera.height))
                yield RecordedMessage(TRANSFORM, stamp_ns, encode_camera_transform(0, place))

    def _image(self, frame: Frame) -> bytes:
        record = self.config.record
        flags = {
            "jpeg": (cv2.IMWRITE_JPEG_QUALITY, record.jpeg_quality),
            "png": (cv2.IMWRITE_PNG_COMPRESSION, _PNG_COMPRESSION),
        }
        _, data = cv2.imencode(f".{record.format}", frame.image, flags[record.format])
        return cdr.encode_compressed_image(0, self.config.publish.frame_id, record.format, data.tobytes())

    def _camera_info(self, width: int, height: int) -> bytes:
        info = self._info
        if info is None or info[:3] != (self.config, width, height):
            self._info = info = (self.config, width, height, self._made_camera_info(width, height))
        return info[3]

    def _setup(self, width: int, height: int) -> Setup:
        known = self._known_setup
        if known is None or known[:3] != (self.config, width, height):
            lens = self._known_lens(self.config, width, height) or Lens.from_config(self.config.camera, width, height)
            self._known_setup = known = (self.config, width, height, Setup.from_config(self.config, lens))
        return known[3]

    def _made_camera_info(self, width: int, height: int) -> bytes:
        header = cdr.Header(0, self.config.publish.frame_id)
        lens = self._known_lens(self.config, width, height)
        if lens is None:  # K of zeros: not calibrated
            return cdr.encode_camera_info(cdr.CameraInfo(header, height, width, "", (), (0.0,) * 9))
        d = (*lens.coefficients, *[0.0] * 5)[: 4 if lens.model == "equidistant" else 5]
        k = tuple(lens.matrix.ravel().tolist())
        return cdr.encode_camera_info(cdr.CameraInfo(header, height, width, _MODELS[lens.model], d, k))
