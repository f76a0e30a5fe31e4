"""ROS 2 messages as bytes: Common Data Representation (OMG DDSI-RTPS 2.5, section 10; plain CDR, version 1).

A payload is four bytes of encapsulation (``00 01 00 00``: little-endian) and the fields in order, each
aligned to its own size from the end of those four bytes. Both byte orders are read, little-endian is written.
Every length is compared with the bytes that are left before memory is taken for it.
"""

import struct
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.errors import LcfError
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Cause, Kind, ObjectClass, ObjectState, Scene

Vector = tuple[float, float, float]

LITTLE_ENDIAN = b"\x00\x01\x00\x00"
FIRST = (len(LITTLE_ENDIAN),)
"""Where the stamp is of a message that begins with one, or with a header."""

_TWIST_BYTES = 7 + 48  # with padding

_WITHOUT_GAPS = (CIRCLE, OBJECT)  # types without padding between their fields

_BYTE_ORDERS: dict[int, Literal["<", ">"]] = {0x0000: ">", 0x0001: "<"}


class CdrError(LcfError):
    """Bytes that are not the message they should be."""


@dataclass(frozen=True, slots=True)
class Header:
    """``std_msgs/msg/Header``."""

    stamp_ns: int
    frame_id: str


@dataclass(frozen=True, slots=True)
class Image:
    """``sensor_msgs/msg/Image``; ``data`` looks into the payload."""

    header: Header
    height: int  # px
    width: int
    encoding: str
    is_bigendian: bool
    step: int  # bytes from row to row
    data: memoryview


@dataclass(frozen=True, slots=True)
class CompressedImage:
    """``sensor_msgs/msg/CompressedImage``; ``data`` looks into the payload."""

    header: Header
    format: str
    data: memoryview


@dataclass(frozen=True, slots=True)
class Imu:
    """``sensor_msgs/msg/Imu`` without its orientation; None: the sender has no such value."""

    header: Header
    gyro: Vector | None  # rad/s
    accel: Vector | None  # m/s²


@dataclass(frozen=True, slots=True)
class Twist:
    """Velocities of ``nav_msgs/msg/Odometry`` or ``geometry_msgs/msg/TwistStamped``: x forward, z up."""

    header: Header
    linear: Vector  # m/s
    angular: Vector  # rad/s


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """``sensor_msgs/msg/CameraInfo`` up to its matrix K."""

    header: Header
    height: int  # px
    width: int
    distortion_model: str
    d: tuple[float, ...]
    k: tuple[float, ...]  # 3x3, row by row


@dataclass(frozen=True, slots=True)
class DiagnosticArray:
    """``diagnostic_msgs/msg/DiagnosticArray``; ``hardware_id`` is that of the first status."""

    header: Header
    hardware_id: str
    status: tuple[DeviceStatus, ...]


def decode_header(payload: bytes | memoryview) -> Header:
    """The header with which a message of any stamped type begins. Raises ``CdrError``."""
    return _Reader(payload).header()


def decode_image(payload: bytes | memoryview) -> Image:
    """``sensor_msgs/msg/Image``. Raises ``CdrError``."""
    reader = _Reader(payload)
    header = reader.header()
    height, width = reader.scalars("II")
    encoding = reader.string()
    (is_bigendian,) = reader.scalars("B")
    (step,) = reader.scalars("I")
    return Image(header, height, width, encoding, bool(is_bigendian), step, reader.octets())


def decode_compressed_image(payload: bytes | memoryview) -> CompressedImage:
    """``sensor_msgs/msg/CompressedImage``. Raises ``CdrError``."""
    reader = _Reader(payload)
    return CompressedImage(reader.header(), reader.string(), reader.octets())


def decode_imu(payload: bytes | memoryview) -> Imu:
    """``sensor_msgs/msg/Imu``. Raises ``CdrError``."""
    reader = _Reader(payload)
    header = reader.header()
    reader.scalars("13d")  # orientation and its covariance
    gyro, gyro_covariance = reader.vector(), reader.scalars("9d")
    accel, accel_covariance = reader.vector(), reader.scalars("9d")
    return Imu(header, gyro if gyro_covariance[0] != -1 else None, accel if accel_covariance[0] != -1 else None)


def decode_odometry(payload: bytes | memoryview) -> Twist:
    """The twist of ``nav_msgs/msg/Odometry``. Raises ``CdrError``."""
    reader = _Reader(payload)
    header = reader.header()
    reader.string()  # child_frame_id
    reader.scalars("43d")  # pose and its covariance
    return Twist(header, reader.vector(), reader.vector())


def decode_twist_stamped(payload: bytes | memoryview) -> Twist:
    """``geometry_msgs/msg/TwistStamped``. Raises ``CdrError``."""
    reader = _Reader(payload)
    return Twist(reader.header(), reader.vector(), reader.vector())


def decode_camera_info(payload: bytes | memoryview) -> CameraInfo:
    """``sensor_msgs/msg/CameraInfo``. Raises ``CdrError``."""
    reader = _Reader(payload)
    header = reader.header()
    height, width = reader.scalars("II")
    model = reader.string()
    d = reader.sequence(np.dtype(np.float64), align=8)
    return CameraInfo(header, height, width, model, tuple(d.tolist()), reader.scalars("9d"))


def decode_diagnostics(payload: bytes | memoryview) -> DiagnosticArray:
    """``diagnostic_msgs/msg/DiagnosticArray``. Raises ``CdrError``, also for a level that the message does not know."""
    reader = _Reader(payload)
    header = reader.header()
    hardware_ids: list[str] = []
    status: list[DeviceStatus] = []
    for _ in range(*reader.scalars("I")):
        (number,) = reader.scalars("B")
        name, message, hardware_id = (reader.string() for _ in range(3))
        values = {reader.string(): reader.string() for _ in range(*reader.scalars("I"))}
        try:
            status.append(DeviceStatus(name, Level(number), message, values))
        except ValueError as error:
            raise CdrError(f"CDR: {number} is not a status level") from error
        hardware_ids.append(hardware_id)
    return DiagnosticArray(header, hardware_ids[0] if hardware_ids else "", tuple(status))


def decode_velocity(payload: bytes | memoryview) -> tuple[str, Twist]:
    """``geometry_msgs/msg/TwistStamped`` or ``nav_msgs/msg/Odometry``: which, and its twist.

    Distinguished by their lengths, which must be exact. Raises ``CdrError``.
    """
    reader = _Reader(payload)
    header = reader.header()
    if reader.left <= _TWIST_BYTES:
        kind = "geometry_msgs/msg/TwistStamped"
        twist = Twist(header, reader.vector(), reader.vector())
    else:
        kind = "nav_msgs/msg/Odometry"
        reader.string()  # child_frame_id
        reader.scalars("43d")  # pose and its covariance
        twist = Twist(header, reader.vector(), reader.vector())
        reader.scalars("36d")  # covariance of the twist
    if reader.left:
        raise CdrError(f"CDR: {reader.left} bytes behind a {kind}")
    return kind, twist


def encode_scene(scene: Scene, frame_id: str) -> bytes:
    """``lcf_msgs/msg/Scene``. Raises ``CdrError``."""
    writer = Writer()
    writer.header(scene.stamp_ns, frame_id)
    writer.scalars("QIIf", scene.seq, scene.image_width, scene.image_height, scene.vehicle_speed)
    writer.records(scene.circles, CIRCLE)
    writer.records(scene.psi, PSI_REGION)
    writer.records(scene.objects, OBJECT)
    return writer.payload()


def encode_compressed_image(stamp_ns: int, frame_id: str, image_format: str, data: bytes) -> bytes:
    """``sensor_msgs/msg/CompressedImage``; ``image_format``: ``jpeg`` or ``png``. Raises ``CdrError``."""
    writer = Writer()
    writer.header(stamp_ns, frame_id)
    writer.string(image_format)
    writer.octets(data)
    return writer.payload()


def encode_diagnostics(stamp_ns: int, hardware_id: str, status: Sequence[DeviceStatus]) -> bytes:
    """``diagnostic_msgs/msg/DiagnosticArray``: one status a device. Raises ``CdrError``."""
    writer = Writer()
    writer.header(stamp_ns, "")
    writer.scalars("I", len(status))
    for device in status:
        writer.scalars("B", device.level)
        for text in (device.name, device.message, hardware_id):
            writer.string(text)
        writer.scalars("I", len(device.values))
        for key, value in device.values.items():
            writer.string(key)
            writer.string(value)
    return writer.payload()


def encode_imu(stamp_ns: int, frame_id: str, gyro: Vector, accel: Vector) -> bytes:
    """``sensor_msgs/msg/Imu`` without orientation, covariances unknown; rad/s, m/s². Raises ``CdrError``."""
    writer = Writer()
    writer.header(stamp_ns, frame_id)
    writer.scalars("13d", 0, 0, 0, 1, -1, *[0] * 8)  # -1: there is no orientation
    writer.scalars("24d", *gyro, *[0] * 9, *accel, *[0] * 9)
    return writer.payload()


def encode_twist_stamped(stamp_ns: int, frame_id: str, speed_mps: float, yaw_rate_radps: float) -> bytes:
    """``geometry_msgs/msg/TwistStamped``: x forward, z up; NaN: unknown. Raises ``CdrError``."""
    writer = Writer()
    writer.header(stamp_ns, frame_id)
    writer.scalars("6d", speed_mps, 0, 0, 0, 0, yaw_rate_radps)
    return writer.payload()


def encode_camera_info(info: CameraInfo) -> bytes:
    """``sensor_msgs/msg/CameraInfo`` of one camera, not rectified: R is the identity, P has K. Raises ``CdrError``."""
    writer = Writer()
    writer.header(info.header.stamp_ns, info.header.frame_id)
    writer.scalars("II", info.height, info.width)
    writer.string(info.distortion_model)
    writer.scalars("I", len(info.d))
    writer.scalars(f"{len(info.d) + 9}d", *info.d, *info.k)
    rows = (info.k[:3], info.k[3:6], info.k[6:])
    writer.scalars("21d", 1, 0, 0, 0, 1, 0, 0, 0, 1, *(number for row in rows for number in (*row, 0)))
    writer.scalars("6I?", 0, 0, 0, 0, 0, 0, False)  # binning, region of interest: none
    return writer.payload()


def restamped(payload: bytes, stamp_ns: int, at: Iterable[int] = FIRST) -> bytes:
    """A little-endian message with another stamp where its stamps are, ``at`` these bytes. Raises ``CdrError``."""
    writer = Writer()
    writer.stamp(stamp_ns)
    stamp = writer.payload()[len(LITTLE_ENDIAN) :]
    pieces: list[bytes | memoryview] = []
    end = 0
    for start in at:
        pieces += (memoryview(payload)[end:start], stamp)
        end = start + len(stamp)
    return b"".join((*pieces, memoryview(payload)[end:]))


def decode_scene(payload: bytes | memoryview) -> Scene:
    """``lcf_msgs/msg/Scene``; objects, circles and ψ are read-only views of a little-endian payload.

    A payload that ends after ψ comes from an older version and has
    no objects. Raises ``CdrError``, also for a kind, cause, class or state that the message does not know, and for a
    signalling NaN, of which NumPy would complain.
    """
    reader = _Reader(payload)
    header = reader.header()
    seq, width, height, speed = reader.scalars("QIIf")
    circles, psi = reader.sequence(CIRCLE, align=4), reader.sequence(PSI_REGION, align=4)
    objects = reader.sequence(OBJECT, align=4) if reader.left else np.empty(0, OBJECT)
    for name, ids, known in (
        ("kind of a circle", circles["kind"], Kind),
        ("cause of a circle", circles["cause"], Cause),
        ("class of an object", objects["class_id"], ObjectClass),
        ("state of an object", objects["state"], ObjectState),
    ):
        if (ids > max(known)).any():  # valid ids are 0 to the largest known
            raise CdrError(f"CDR: the {name} is unknown")
    if _signals(circles) or _signals(psi) or _signals(objects):
        raise CdrError("CDR: a signalling NaN")
    return Scene(header.stamp_ns, seq, width, height, speed, circles, psi, objects=objects)


def _signals(rows: npt.NDArray[np.void]) -> bool:
    """Whether a float32 field holds a signalling NaN: not a number, and its highest fraction bit is not set."""
    words = rows.view(np.uint32).reshape(len(rows), rows.dtype.itemsize // 4)
    bits = words[:, _float_words(rows.dtype)]
    return bool(((bits & 0x7FC00000 == 0x7F800000) & (bits & 0x003FFFFF != 0)).any())


@cache
def _float_words(dtype: np.dtype[np.void]) -> list[int]:
    """Return which four-byte words of a record are float32 fields."""
    fields = (dtype.fields or {}).values()
    return [offset // 4 for kind, offset, *_ in fields if kind == np.float32]


class Writer:
    """A payload that grows. Raises ``CdrError`` for a value that does not fit its field.

    ``stamps``: where in the payload each stamp begins.
    """

    def __init__(self) -> None:
        self.stamps = array("I")
        self._body = bytearray()

    def payload(self) -> bytes:
        """Return what was written, with its encapsulation."""
        return LITTLE_ENDIAN + self._body

    def header(self, stamp_ns: int, frame_id: str) -> None:
        """``std_msgs/msg/Header``."""
        self.stamp(stamp_ns)
        self.string(frame_id)

    def stamp(self, stamp_ns: int) -> None:
        """``builtin_interfaces/msg/Time``."""
        self.scalars("iI", *divmod(stamp_ns, 1_000_000_000))
        self.stamps.append(len(LITTLE_ENDIAN) + len(self._body) - 8)

    def scalars(self, fields: str, *values: float) -> None:
        """Fields in the notation of ``struct``, none of which is wider than the one before it."""
        first = struct.calcsize(f"<{fields.lstrip('0123456789')[0]}")
        self._body.extend(bytes(-len(self._body) % first))
        try:
            self._body.extend(struct.pack(f"<{fields}", *values))
        except (struct.error, OverflowError) as error:
            raise CdrError(f"CDR: a value does not fit its field ({error})") from error

    def string(self, text: str) -> None:
        """Append a string up to its first NUL; characters that UTF-8 does not have become question marks."""
        self.octets(text.replace("\0", "").encode(errors="replace") + b"\0")

    def octets(self, data: bytes) -> None:
        """A sequence of bytes."""
        self.scalars("I", len(data))
        self._body.extend(data)

    def records(self, rows: npt.NDArray[np.void], dtype: np.dtype[np.void]) -> None:
        """Append a sequence of fixed-size records; padding between their fields is zero."""
        block: npt.NDArray[np.void] = rows
        if rows.dtype != dtype or dtype not in _WITHOUT_GAPS:
            block = np.zeros(len(rows), dtype)
            for name in dtype.names or ():
                block[name] = rows[name]
        self.scalars("I", len(block))
        self._body.extend(block.tobytes())


class _Reader:
    """Reads a payload field by field. Raises ``CdrError`` where it is too short."""

    def __init__(self, payload: bytes | memoryview) -> None:
        if len(payload) < 4:
            raise CdrError("CDR: shorter than its encapsulation header")
        kind = int.from_bytes(payload[:2], "big")
        if kind not in _BYTE_ORDERS:
            raise CdrError(f"CDR: encapsulation {kind:#06x} is not plain CDR")
        self._order = _BYTE_ORDERS[kind]
        self._data = memoryview(payload).toreadonly()[4:]
        self._at = 0

    @property
    def left(self) -> int:
        """Number of bytes not yet read."""
        return len(self._data) - self._at

    def header(self) -> Header:
        sec, nanosec = self.scalars("iI")
        return Header(sec * 1_000_000_000 + nanosec, self.string())

    def scalars(self, fields: str) -> tuple[Any, ...]:
        """Fields in the notation of ``struct``, none of which is wider than the one before it."""
        first = struct.calcsize(f"<{fields.lstrip('0123456789')[0]}")
        layout = struct.Struct(self._order + fields)
        start = self._take(layout.size, align=first)
        return layout.unpack_from(self._data, start)

    def vector(self) -> Vector:
        x, y, z = self.scalars("3d")
        return x, y, z

    def string(self) -> str:
        """Read a string: with its closing NUL, or empty without one."""
        try:
            return str(self.octets(), "utf-8").removesuffix("\0")
        except UnicodeDecodeError as error:
            raise CdrError("CDR: a string is not UTF-8") from error

    def octets(self) -> memoryview:
        (count,) = self.scalars("I")
        start = self._take(count, align=1)
        return self._data[start : start + count]

    def sequence(self, dtype: np.dtype[Any], align: int) -> npt.NDArray[Any]:
        (count,) = self.scalars("I")
        if not count:  # an empty sequence has no padding either
            return np.empty(0, dtype)
        start = self._take(count * dtype.itemsize, align)
        rows = np.frombuffer(self._data, dtype.newbyteorder(self._order), count, start)
        return rows.astype(dtype, copy=False)

    def _take(self, size: int, align: int) -> int:
        """Return the start of the next ``size`` bytes, and move beyond them."""
        start = self._at + -self._at % align
        if size > len(self._data) - start:
            raise CdrError(f"CDR: {size} bytes are needed at {start}, {max(0, len(self._data) - start)} are left")
        self._at = start + size
        return start
