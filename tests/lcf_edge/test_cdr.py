"""CDR against an independent implementation (rosbags), and against bytes that mean nothing."""

import struct
from collections.abc import Callable
from enum import IntEnum
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from lcf_edge import cdr
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Cause, Kind, ObjectClass, ObjectState, Scene, Shape

DECODERS: dict[str, Callable[[bytes], Any]] = {
    "sensor_msgs/msg/Image": cdr.decode_image,
    "sensor_msgs/msg/CompressedImage": cdr.decode_compressed_image,
    "sensor_msgs/msg/Imu": cdr.decode_imu,
    "nav_msgs/msg/Odometry": cdr.decode_odometry,
    "geometry_msgs/msg/TwistStamped": cdr.decode_twist_stamped,
    "sensor_msgs/msg/CameraInfo": cdr.decode_camera_info,
    "lcf_msgs/msg/Scene": cdr.decode_scene,
    "std_msgs/msg/Header": cdr.decode_header,
}

FRAME_IDS = ["", "c", "cam", "camera", "camera_link", "Kamera größer"]  # all alignments behind a string
STAMP_NS = 1_700_000_000_123_456_789


@pytest.fixture(scope="module")
def message(ros: Typestore) -> Callable[..., Any]:
    """Makes a message by type and fields; `header` from its frame id."""

    def make(kind: str, **fields: Any) -> Any:
        if "header" in fields:
            sec, nanosec = divmod(STAMP_NS, 10**9)
            stamp = ros.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
            fields["header"] = ros.types["std_msgs/msg/Header"](stamp=stamp, frame_id=fields["header"])
        return ros.types[kind](**fields)

    return make


@pytest.fixture(scope="module")
def samples(message: Callable[..., Any]) -> Callable[[str], dict[str, Any]]:
    """One message of every type that is read, by frame id."""

    def vector(x: float, y: float, z: float) -> Any:
        return message("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def make(frame_id: str) -> dict[str, Any]:
        twist = message("geometry_msgs/msg/Twist", linear=vector(1.5, 0.1, 0.2), angular=vector(0.3, 0.4, -0.5))
        turn = message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        pose = message(
            "geometry_msgs/msg/Pose",
            position=message("geometry_msgs/msg/Point", x=1.0, y=2.0, z=3.0),
            orientation=turn,
        )
        return {
            "sensor_msgs/msg/Image": message(
                "sensor_msgs/msg/Image",
                header=frame_id,
                height=2,
                width=3,
                encoding="mono8",
                is_bigendian=0,
                step=4,
                data=np.arange(8, dtype=np.uint8),
            ),
            "sensor_msgs/msg/CompressedImage": message(
                "sensor_msgs/msg/CompressedImage",
                header=frame_id,
                format="jpeg",
                data=np.arange(5, dtype=np.uint8),
            ),
            "sensor_msgs/msg/Imu": message(
                "sensor_msgs/msg/Imu",
                header=frame_id,
                orientation=turn,
                orientation_covariance=np.full(9, 7.0),
                angular_velocity=vector(0.1, 0.2, 0.3),
                angular_velocity_covariance=np.zeros(9),
                linear_acceleration=vector(1.0, -9.81, 2.0),
                linear_acceleration_covariance=np.array([-1.0] + 8 * [0.0]),
            ),
            "nav_msgs/msg/Odometry": message(
                "nav_msgs/msg/Odometry",
                header=frame_id,
                child_frame_id=frame_id + "x",
                pose=message("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
                twist=message("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.ones(36)),
            ),
            "geometry_msgs/msg/TwistStamped": message("geometry_msgs/msg/TwistStamped", header=frame_id, twist=twist),
            "sensor_msgs/msg/CameraInfo": message(
                "sensor_msgs/msg/CameraInfo",
                header=frame_id,
                height=480,
                width=640,
                distortion_model="plumb_bob",
                d=np.array([0.1, 0.2, 0.3, 0.4, 0.5]),
                k=np.arange(9.0),
                r=np.zeros(9),
                p=np.zeros(12),
                binning_x=0,
                binning_y=0,
                roi=message(
                    "sensor_msgs/msg/RegionOfInterest",
                    x_offset=0,
                    y_offset=0,
                    height=0,
                    width=0,
                    do_rectify=False,
                ),
            ),
        }

    return make


@pytest.mark.parametrize("little_endian", [True, False], ids=["little-endian", "big-endian"])
@pytest.mark.parametrize("frame_id", FRAME_IDS)
def test_reads_what_another_implementation_wrote(
    ros: Typestore, samples: Callable[[str], dict[str, Any]], frame_id: str, little_endian: bool
) -> None:
    payloads = {
        kind: bytes(ros.serialize_cdr(m, kind, little_endian=little_endian)) for kind, m in samples(frame_id).items()
    }
    header = cdr.Header(STAMP_NS, frame_id)

    image = cdr.decode_image(payloads["sensor_msgs/msg/Image"])
    assert (image.header, image.height, image.width, image.encoding) == (header, 2, 3, "mono8")
    assert (image.is_bigendian, image.step, image.data.tobytes()) == (False, 4, bytes(range(8)))

    compressed = cdr.decode_compressed_image(payloads["sensor_msgs/msg/CompressedImage"])
    assert (compressed.header, compressed.format, bytes(compressed.data)) == (header, "jpeg", bytes(range(5)))

    imu = cdr.decode_imu(payloads["sensor_msgs/msg/Imu"])
    assert imu == cdr.Imu(header, (0.1, 0.2, 0.3), None)  # a covariance of -1 says: no such value

    for kind in ("nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistStamped"):
        assert DECODERS[kind](payloads[kind]) == cdr.Twist(header, (1.5, 0.1, 0.2), (0.3, 0.4, -0.5))

    info = cdr.decode_camera_info(payloads["sensor_msgs/msg/CameraInfo"])
    assert (info.header, info.height, info.width, info.distortion_model) == (header, 480, 640, "plumb_bob")
    assert (info.d, info.k) == ((0.1, 0.2, 0.3, 0.4, 0.5), tuple(map(float, range(9))))


def test_camera_without_distortion_has_an_empty_sequence(
    ros: Typestore, samples: Callable[[str], dict[str, Any]]
) -> None:
    kind = "sensor_msgs/msg/CameraInfo"
    message = samples("camera")[kind]
    message.d = np.zeros(0)
    info = cdr.decode_camera_info(ros.serialize_cdr(message, kind))
    assert (info.d, info.k) == ((), tuple(map(float, range(9))))


def scene(circles: int, psi: int, objects: int = 2) -> Scene:
    rng = np.random.default_rng(7)
    tables = (_filled(dtype, rows, rng) for dtype, rows in ((CIRCLE, circles), (PSI_REGION, psi)))
    return Scene(STAMP_NS, 17, 640, 480, 1.5, *tables, objects=_filled(OBJECT, objects, rng))


def without_objects(payload: bytes) -> bytes:
    """The same as it was sent before there were objects."""
    return payload[: -4 - OBJECT.itemsize * len(cdr.decode_scene(payload).objects)]


def _filled(dtype: np.dtype[np.void], rows: int, rng: np.random.Generator) -> npt.NDArray[np.void]:
    """Records with random fields; what lies between the fields is not zero."""
    records = np.frombuffer(bytes([0xAA]) * dtype.itemsize * rows, dtype).copy()
    for name in dtype.names or ():
        records[name] = rng.integers(1, {"kind": 2, "cause": 4, "class_id": 6, "state": 3}.get(name, 100), rows)
    return records


@pytest.mark.parametrize("frame_id", FRAME_IDS)
@pytest.mark.parametrize(("circles", "psi", "objects"), [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (3, 2, 2)])
def test_scene_is_read_by_another_implementation(
    ros: Typestore, frame_id: str, circles: int, psi: int, objects: int
) -> None:
    sent = scene(circles, psi, objects)
    payload = cdr.encode_scene(sent, frame_id)
    got: Any = ros.deserialize_cdr(payload, "lcf_msgs/msg/Scene")
    assert (got.header.stamp.sec * 10**9 + got.header.stamp.nanosec, got.header.frame_id) == (
        STAMP_NS,
        frame_id,
    )
    assert (got.frame_seq, got.image_width, got.image_height, got.vehicle_speed) == (17, 640, 480, 1.5)
    for rows, records in ((got.circles, sent.circles), (got.psi, sent.psi), (got.objects, sent.objects)):
        assert [tuple(getattr(row, name) for name in records.dtype.names) for row in rows] == records.tolist()
    assert bytes(ros.serialize_cdr(got, "lcf_msgs/msg/Scene")) == payload, "also the padding"


@pytest.mark.parametrize("little_endian", [True, False], ids=["little-endian", "big-endian"])
def test_scene_written_by_another_implementation_is_read(ros: Typestore, little_endian: bool) -> None:
    kind = "lcf_msgs/msg/Scene"
    sent = scene(3, 2)
    payload = ros.serialize_cdr(
        ros.deserialize_cdr(cdr.encode_scene(sent, "camera"), kind), kind, little_endian=little_endian
    )
    got = cdr.decode_scene(bytes(payload))
    assert (got.stamp_ns, got.seq, got.image_width, got.image_height) == (STAMP_NS, 17, 640, 480)
    assert got.circles.tolist() == sent.circles.tolist()
    assert got.psi.tolist() == sent.psi.tolist()
    assert got.objects.tolist() == sent.objects.tolist()


def records(dtype: np.dtype[np.void], **largest: int) -> st.SearchStrategy[npt.NDArray[np.void]]:
    """Any rows whose floats are of a message, and whose ids are up to those of ``largest``."""

    def row(words: bytes) -> npt.NDArray[np.void]:
        rows = np.frombuffer(words, dtype).copy()
        for name in dtype.names or ():
            if name in largest:
                rows[name] %= largest[name] + 1
            elif rows.dtype[name] == np.float32:
                bits = rows[name].view(np.uint32)
                bits[np.isnan(bits.view(np.float32))] |= 0x00400000  # a quiet one
        return rows

    return (
        st.integers(0, 4)
        .flatmap(lambda n: st.binary(min_size=n * dtype.itemsize, max_size=n * dtype.itemsize))
        .map(row)
    )


@given(
    circles=records(CIRCLE, kind=1, cause=3),
    psi=records(PSI_REGION),
    objects=records(OBJECT, class_id=5, state=2),
    frame_id=st.sampled_from(FRAME_IDS),
)
def test_any_scene_is_read_as_it_was_written(
    circles: npt.NDArray[np.void], psi: npt.NDArray[np.void], objects: npt.NDArray[np.void], frame_id: str
) -> None:
    payload = cdr.encode_scene(Scene(STAMP_NS, 17, 640, 480, 1.5, circles, psi, objects=objects), frame_id)
    got = cdr.decode_scene(payload)
    assert got.circles.tobytes() == circles.tobytes()
    assert got.objects.tobytes() == objects.tobytes()
    assert all(got.psi[name].tobytes() == psi[name].tobytes() for name in PSI_REGION.names or ())
    old = cdr.decode_scene(without_objects(payload))
    assert (old.circles.tobytes(), len(old.psi), len(old.objects)) == (circles.tobytes(), len(psi), 0)
    assert cdr.encode_scene(got, frame_id) == payload


def test_a_reader_of_before_objects_finds_its_part_unchanged() -> None:
    sent = scene(3, 2)
    payload = cdr.encode_scene(sent, "camera")
    assert payload.startswith(without_objects(payload))
    ours = ("Circle", "PsiRegion", "Scene")
    definitions = {name: (files("lcf_edge") / "msg" / f"{name}.msg").read_text(encoding="utf-8") for name in ours}
    assert definitions["Scene"].endswith("PsiRegion[] psi\nObject[] objects\n")
    definitions["Scene"] = definitions["Scene"].removesuffix("Object[] objects\n")
    before = get_typestore(Stores.ROS2_HUMBLE)
    for name, text in definitions.items():
        before.register(get_types_from_msg(text, f"lcf_msgs/msg/{name}"))
    got: Any = before.deserialize_cdr(without_objects(payload), "lcf_msgs/msg/Scene")
    assert [circle.id for circle in got.circles] == sent.circles["id"].tolist()
    assert bytes(before.serialize_cdr(got, "lcf_msgs/msg/Scene")) == without_objects(payload)


def test_scene_is_read_without_a_copy() -> None:
    payload = bytearray(cdr.encode_scene(scene(3, 2), "camera"))
    got = cdr.decode_scene(payload)
    place = payload.index(got.circles[1:2].tobytes())
    payload[place : place + 4] = struct.pack("<I", 4242)
    assert got.circles["id"][1] == 4242
    assert not got.circles.flags.writeable
    assert not got.psi.flags.writeable
    assert not got.objects.flags.writeable


@pytest.mark.parametrize(
    ("message", "dtype", "constants"),
    [
        ("Circle", CIRCLE, [*Kind, *Cause]),
        ("PsiRegion", PSI_REGION, [*Shape]),
        ("Object", OBJECT, [*ObjectClass, *ObjectState]),
    ],
)
def test_fields_and_constants_of_the_message_definitions_are_those_of_the_records(
    message: str, dtype: np.dtype[np.void], constants: list[IntEnum]
) -> None:
    text = (files("lcf_edge") / "msg" / f"{message}.msg").read_text(encoding="utf-8")
    said = [line.partition("#")[0].split() for line in text.splitlines() if line.partition("#")[0].strip()]
    assert tuple(words[1] for words in said if "=" not in words) == dtype.names
    values = [(words[1], int(words[3])) for words in said if "=" in words]
    assert values == [(constant.name, constant.value) for constant in constants]


@pytest.mark.parametrize(
    "wrong", [{"stamp_ns": 2**62}, {"seq": -1}, {"image_width": 2**32}, {"vehicle_speed": 1e300}], ids=str
)
def test_scene_whose_numbers_do_not_fit_is_refused(wrong: dict[str, float]) -> None:
    fields: dict[str, Any] = {
        "stamp_ns": 0,
        "seq": 0,
        "image_width": 1,
        "image_height": 1,
        "vehicle_speed": 0.0,
    }
    with pytest.raises(cdr.CdrError, match="does not fit"):
        cdr.encode_scene(Scene(**(fields | wrong), circles=np.empty(0, CIRCLE), psi=np.empty(0, PSI_REGION)), "c")


@pytest.mark.parametrize("kind", DECODERS)
@given(body=st.binary(max_size=400), order=st.sampled_from([b"\0\0", b"\0\1", b"\0\3", b"\x12"]))
def test_any_bytes_are_a_message_or_a_cdr_error(kind: str, body: bytes, order: bytes) -> None:
    with_error(DECODERS[kind], order + b"\0\0" + body)


@given(data=st.data())
def test_a_damaged_message_is_a_message_or_a_cdr_error(
    ros: Typestore, samples: Callable[[str], dict[str, Any]], data: st.DataObject
) -> None:
    messages = samples("camera")
    kind = data.draw(st.sampled_from(sorted(messages)))
    payload = bytearray(ros.serialize_cdr(messages[kind], kind))
    for _ in range(data.draw(st.integers(0, 4))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    with_error(DECODERS[kind], bytes(payload[: data.draw(st.integers(0, len(payload)))]))


@pytest.mark.parametrize("kind", DECODERS)
def test_a_message_cut_short_is_an_error(ros: Typestore, samples: Callable[[str], dict[str, Any]], kind: str) -> None:
    if kind.startswith(("lcf_msgs", "std_msgs")):
        payload = without_objects(cdr.encode_scene(scene(2, 2), "camera"))
    else:
        payload = bytes(ros.serialize_cdr(samples("camera")[kind], kind))
    ends = [n for n in range(len(payload)) if not with_error(DECODERS[kind], payload[:n])]
    assert ends == list(range(len(ends))), "every shorter payload is refused, up to the last field that is read"
    assert len(ends) >= 20


def test_a_scene_cut_short_is_an_error_but_for_one_that_ends_before_the_objects() -> None:
    payload = cdr.encode_scene(scene(2, 2), "camera")
    whole = [n for n in range(len(payload)) if with_error(cdr.decode_scene, payload[:n])]
    assert whole == [len(without_objects(payload))]


@pytest.mark.parametrize(
    ("rows", "field", "value", "name"),
    [
        ("circles", "kind", 2, "kind of a circle"),
        ("circles", "cause", 4, "cause of a circle"),
        ("circles", "cause", 255, "cause of a circle"),
        ("objects", "class_id", 6, "class of an object"),
        ("objects", "class_id", 255, "class of an object"),
        ("objects", "state", 3, "state of an object"),
    ],
)
def test_a_circle_or_object_of_an_unknown_kind_is_refused(rows: str, field: str, value: int, name: str) -> None:
    sent = scene(3, 2)
    getattr(sent, rows)[field][1] = value
    with pytest.raises(cdr.CdrError, match=f"the {name}"):
        cdr.decode_scene(cdr.encode_scene(sent, "camera"))


@pytest.mark.parametrize("bits", [0x7F800001, 0x7FBFFFFF, 0xFFA00000])
@pytest.mark.parametrize(
    ("rows", "field"),
    [("circles", "x"), ("circles", "lateral"), ("psi", "trust"), ("objects", "x"), ("objects", "unseen")],
)
def test_a_signalling_nan_is_refused_for_numpy_would_complain_of_it(rows: str, field: str, bits: int) -> None:
    sent = scene(3, 2)
    getattr(sent, rows)[field].view(np.uint32)[1] = bits
    with pytest.raises(cdr.CdrError, match="signalling NaN"):
        cdr.decode_scene(cdr.encode_scene(sent, "camera"))


def test_numbers_that_are_none_otherwise_are_taken() -> None:
    sent = scene(3, 2)
    sent.circles["range"] = (np.nan, np.inf, -np.inf)
    sent.circles["lateral"].view(np.uint32)[:] = (0x7FFFFFFF, 0xFFC00001, 0x00000001)
    got = cdr.decode_scene(cdr.encode_scene(sent, "camera"))
    np.testing.assert_array_equal(got.circles["range"], sent.circles["range"])


@pytest.mark.parametrize("table", ["circles", "psi", "objects"])
def test_a_count_beyond_what_is_left_is_refused_in_each_table(table: str) -> None:
    sent = scene(1, 1, 1)
    payload = bytearray(cdr.encode_scene(sent, "camera"))
    sizes = {"objects": OBJECT.itemsize, "psi": PSI_REGION.itemsize, "circles": CIRCLE.itemsize}
    behind = [*sizes][: [*sizes].index(table) + 1]
    place = len(payload) - sum(sizes[name] + 4 for name in behind)
    assert payload[place : place + 4] == struct.pack("<I", 1)
    payload[place : place + 4] = struct.pack("<I", 0xFFFFFFFF)
    with pytest.raises(cdr.CdrError, match="are left"):
        cdr.decode_scene(payload)


def test_a_count_beyond_the_payload_takes_no_memory() -> None:
    header = b"\0\1\0\0" + struct.pack("<iII", 0, 0, 1) + b"\0"
    claim = header + b"\0" * 3 + struct.pack("<QIIf", 0, 1, 1, 0.0) + struct.pack("<I", 0xFFFFFFFF)
    with pytest.raises(cdr.CdrError, match="are left"):
        cdr.decode_scene(claim)


def with_error(decode: Callable[[bytes], Any], payload: bytes) -> bool:
    """Whether it could be decoded; an error must be a CdrError and has one line."""
    said = ""
    try:
        decode(payload)
    except cdr.CdrError as error:
        said = str(error)
    assert "\n" not in said
    return not said
