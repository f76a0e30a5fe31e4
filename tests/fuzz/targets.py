"""The parsers, each with good inputs to begin with and the errors that it may raise.

A target takes an input and tells in a few words what became of it; whatever it lets through is a finding.
"""

import asyncio
import base64
import io
import logging
import os
import socket
import struct
import threading
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import zenoh
from aiohttp import web
from mcap.writer import CompressionType, Writer

from drivers.camera.jpeg import jpeg_header
from drivers.camera.luminance import FrameError, luminance
from drivers.imu.registry import protocols
from drivers.sample_clock import MAX_AHEAD_NS, SampleClock
from drivers.samples import Frame, ImuSample
from hil_mocks.serial_imu import ENCODERS, mtdata2, shtp_packet
from lcf_edge import cdr
from lcf_edge.config import Config, Publish, load, to_toml
from lcf_edge.config.attached import IN_RECORDING
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.errors import ConfigError, LcfError, RecordingError
from lcf_edge.gate.key_limits import KeyLimits, NameKeys, RefusedKeyError
from lcf_edge.gate.zenoh_batches import NotUnderstoodError
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Scene
from lcf_edge.monitor.live.daemon_address import DaemonAddress
from lcf_edge.monitor.live.history import History
from lcf_edge.monitor.live.monitor import Monitor
from lcf_edge.monitor.web.server import Server
from lcf_edge.monitor.web.update import Audience
from lcf_edge.pipeline import Pipeline, run
from lcf_edge.recording.read import open_recording
from lcf_edge.recording.read.decoding import ImageDecodeError, image_from_bytes
from lcf_edge.recording.read.sensor_yaml import SensorYaml
from lcf_edge.web.doorkeeper import Doorkeeper
from lcf_edge.web.guard import Guard
from lcf_edge.zenoh_link.publisher import ATTACHMENT
from lcf_edge.zenoh_link.session import opened_session
from lcf_edge.zenoh_link.speed_input import RefusedError, SpeedInput

Take = Callable[[bytes], str]
Opened = Callable[[Path], AbstractContextManager[Take]]

STAMP_NS = 1_700_000_000_000_000_000
WIDTH, HEIGHT = 64, 48
MARK = b"\n=====\n"  # between the parts of an input that has several


@dataclass(frozen=True, slots=True)
class Target:
    """A parser under attack. ``opened``: with a folder of its own to write to. ``grows_mib``: memory it may take."""

    name: str
    seeds: Callable[[], Sequence[bytes]]
    opened: Opened
    tokens: Sequence[bytes] = ()
    grows_mib: int = 64


TARGETS: dict[str, Target] = {}


def target(
    seeds: Callable[[], Sequence[bytes]], tokens: Sequence[bytes] = (), grows_mib: int = 64
) -> Callable[[Callable[[Path], Iterator[Take]]], None]:
    """Enter a generator function under its name."""

    def enter(function: Callable[[Path], Iterator[Take]]) -> None:
        name = function.__name__
        TARGETS[name] = Target(name, seeds, contextmanager(function), tokens, grows_mib)

    return enter


def undecoded(width: int = WIDTH, height: int = HEIGHT) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Clutter."""
    return np.random.default_rng(3).integers(0, 256, (height, width), np.uint8)


def a_scene() -> Scene:
    """Some circles, regions and objects with plausible numbers."""
    circles, psi = np.ones(3, CIRCLE), np.ones(2, PSI_REGION)
    return Scene(STAMP_NS, 7, 640, 480, 1.5, circles, psi, objects=np.ones(2, OBJECT))


def an_info() -> cdr.CameraInfo:
    """A lens."""
    k = (50.0, 0.0, 31.5, 0.0, 50.0, 23.5, 0.0, 0.0, 1.0)
    return cdr.CameraInfo(cdr.Header(STAMP_NS, "camera"), HEIGHT, WIDTH, "plumb_bob", (0.1, 0.01, 1e-3, 1e-3, 0.0), k)


def an_image() -> bytes:
    """``sensor_msgs/msg/Image``."""
    header = struct.pack("<iII4s", STAMP_NS // 10**9, 0, 2, b"c\0")
    fields = struct.pack("<III6sBxII", HEIGHT, WIDTH, 6, b"mono8\0", 0, WIDTH, WIDTH * HEIGHT)
    return cdr.LITTLE_ENDIAN + header + fields + undecoded().tobytes()


def one_line(error: LcfError) -> str:
    """The text of an error, which is a line for a terminal."""
    text = str(error)
    assert text.isprintable(), text
    assert len(text) < 2000, text
    return text


# ROS 2 messages


def messages() -> Sequence[bytes]:
    """One of each kind."""
    status = DeviceStatus("camera", Level.OK, "delivers", {"rate_hz": "20.0"})
    return (
        cdr.encode_scene(a_scene(), "camera"),
        cdr.encode_compressed_image(STAMP_NS, "camera", "jpeg", b"\xff\xd8"),
        cdr.encode_diagnostics(STAMP_NS, "rover", [status, status]),
        cdr.encode_imu(STAMP_NS, "imu", (0.1, 0.2, 0.3), (0.0, -9.8, 0.0)),
        cdr.encode_twist_stamped(STAMP_NS, "base", 1.5, 0.1),
        cdr.encode_camera_info(an_info()),
        cdr.encode_scene(replace(a_scene(), objects=np.empty(0, OBJECT)), "camera")[:-4],  # as older versions sent it
    )


DECODERS = (
    cdr.decode_header,
    cdr.decode_image,
    cdr.decode_compressed_image,
    cdr.decode_imu,
    cdr.decode_odometry,
    cdr.decode_twist_stamped,
    cdr.decode_camera_info,
    cdr.decode_diagnostics,
    cdr.decode_velocity,
    cdr.decode_scene,
)


@target(messages, (b"\0\1\0\0", b"\0\0\0\0", b"jpeg\0"))
def messages_of_ros(_: Path) -> Iterator[Take]:
    """Every decoder."""

    def take(data: bytes) -> str:
        became = ""
        for decode in DECODERS:
            try:
                decode(data)
                became += "+"
            except cdr.CdrError:
                became += "-"
        return became

    yield take


@target(
    lambda: [
        message + MARK + ATTACHMENT.pack(1, STAMP_NS, 16, bytes(16)) for message in (*messages()[:3], messages()[-1])
    ]
)
def what_viewers_receive(_: Path) -> Iterator[Take]:
    """Scenes, diagnostics, previews and their attachments, up to the text for the page."""
    monitor = Monitor(DaemonAddress("tcp/127.0.0.1:9"), history=History())
    monitor.switch_preview(True)

    def take(data: bytes) -> str:
        payload, _, attachment = data.partition(MARK)
        for topic in ("scene", "diagnostics", "preview/compressed"):
            monitor._session.put(f"lcf/{topic}", payload, attachment=attachment or None)
        parts = Audience().update(monitor, "tcp/127.0.0.1:9")
        return f"{len(parts)} {monitor.snapshot().broken > 0}"

    try:
        yield take
    finally:
        monitor.close()


def batches() -> Sequence[bytes]:
    """What a session says: it declares, subscribes, asks, sends, and takes back."""
    declared = b"\x1e\x20\x01\x00\x09lcf/scene\x1e\x62\x01\x00\x02**\x1e\x82\x02\x01\x21\x05\x1e\x01\x01"
    interest = b"\x79\x01\x33\x00\x0clcf/@alive/*\x19\x01"
    asked = b"\xbc\x01\x00\x0blcf/query/*\x26\xe8\x07\xe3\x01\x03a=1\x43\x02\x00b\x1a\x01"
    stamped = b"\x80\x80\x80\x80\x08\x02ab\xc1\x05\x10ab\x01\x07\x43\x01c"
    sent = b"\xbd\x00\x09lcf/speed\x21\x05\xa1" + stamped + b"\x03abc"
    return [b"\x25\x01" + body + b"\x04" for body in (declared, interest, asked, sent)]


@target(batches, (b"**", b"$*", b"/", b"\x1e\x20", b"\x1e\x62", b"\x3d\x00", b"\x80", b"\xff"))
def parties(_: Path) -> Iterator[Take]:
    """What a party says at the gate."""

    def take(data: bytes) -> str:
        limits = KeyLimits(NameKeys())
        try:
            messages = limits.check(data)
        except (RefusedKeyError, NotUnderstoodError) as error:
            return f"{type(error).__name__} {error}"
        return f"{messages} messages"

    yield take


@target(lambda: messages()[4:5])
def speeds(_: Path) -> Iterator[Take]:
    """What arrives on ``<prefix>/speed``."""
    with opened_session(Config().zenoh.__class__(listen=[])) as session:
        speeds = SpeedInput(session, Publish(), now_ns=lambda: STAMP_NS)

        def take(data: bytes) -> str:
            sample: Any = SimpleNamespace(payload=zenoh.ZBytes(data), key_expr="lcf/speed", encoding="application/cdr")
            try:
                return str(speeds._read(sample).speed_mps > 1)
            except RefusedError as error:
                return str(error)

        yield take
        speeds.close()


# Serial IMUs


def serial_streams() -> Sequence[bytes]:
    """What each protocol sends, a few samples."""
    samples = [ImuSample(n * 10_000_000, (0.1, 0.2, 0.3), (0.0, -9.8, 0.1)) for n in range(4)]
    return [b"".join(map(encoder(), samples)) for encoder in ENCODERS.values()]


@target(serial_streams, (b"\xaa\xaa", b"\xfa\xff\x36", b"\x55\x51", b"\x55\x61", b"\x7e\x01", b"*00\r\n", b","))
def serial_protocols(_: Path) -> Iterator[Take]:
    """Every parser: the bytes as they are, and as the content of whole frames."""

    def framed(data: bytes) -> bytes:
        blocks = [data[at : at + 16].ljust(16, b"\0") for at in range(0, min(len(data), 2000), 16)]
        parts = [mtdata2(data[:2000])]
        for block in blocks:
            body, wit = b"\xaa\xaa" + block, bytes((0x55, 0x51 + block[0] % 2)) + block[:8]
            parts += [body + bytes([sum(block) & 0xFF]), wit + bytes([sum(wit) & 0xFF])]
            parts += [b"\x55\x61" + block + bytes(2), shtp_packet(block[0] % 6, block[1], block)]
        return b"".join(parts)

    def take(data: bytes) -> str:
        became = []
        for name, protocol in protocols().items():
            for stream in (data, framed(data)):
                parser = protocol.parser()
                readings = [r for at in range(0, len(stream), 97) for r in parser.feed(stream[at : at + 97])]
                assert all(np.isfinite((*reading.gyro, *reading.accel)).all() for reading in readings), name
                became.append(f"{name}{min(len(readings), 3)}{sorted(parser.counts)}")
        return " ".join(became)

    yield take


def arrivals() -> Sequence[bytes]:
    """Pauses between samples, us, and what the device's own clock tells of them, ticks."""
    return [struct.pack("<II", 5000, 5000) * 40, struct.pack("<IIII", 0, 1, 40_000, 900_000) * 20]


@target(arrivals, (b"\xff" * 4, b"\0" * 4, b"\1\0\0\0"))
def imu_clocks(_: Path) -> Iterator[Take]:
    """Stamps of samples whose device has a clock of its own: they increase, and do not run away."""

    def take(data: bytes) -> str:
        clock, arrival_ns, last_ns = SampleClock(1e6), STAMP_NS, -STAMP_NS
        steps = [max(ticks, 1) for ticks in struct.unpack(f"<{len(data) // 4}I", data[: len(data) // 4 * 4])]
        for count, (pause_us, ticks) in enumerate(pairwise(steps)):
            arrival_ns += pause_us * 1000
            (stamp_ns,) = clock.stamps_of_steps_ns(arrival_ns, [ticks])
            assert last_ns < stamp_ns <= arrival_ns + MAX_AHEAD_NS + count
            last_ns = stamp_ns
        return f"{clock.rate_hz:.0e}"

    yield take


# Configurations


@target(
    lambda: [
        to_toml(Config()).encode(),
        b'[camera]\ngain = 3\nintrinsics = [1, 2.5, 3e1, 4]\n[publish]\nrobot = """x"""\n',
    ],
    (b"a.b.", b'"', b"'''", b'"""', b"[[", b"{", b"}", b"\\u001b", b"\xc2\x9b", b" = ", b"\n[filter]\n", b"#", b"\r"),
)
def configurations(folder: Path) -> Iterator[Take]:
    """A TOML file, up to the pipeline that is made of it, and written down again."""
    path, again = folder / "config.toml", folder / "again.toml"

    def take(data: bytes) -> str:
        path.write_bytes(data)
        try:
            config = load(path)
            text = to_toml(config)
            again.write_text(text, encoding="utf-8", newline="\n")
            assert load(again) == config
            assert all(line.isprintable() for line in text.split("\n"))
            if config.memory.budget_mib < 200:
                from lcf_edge.cli.config import report  # noqa: PLC0415  # as `lcf-edge config` does

                report(config)
        except ConfigError as error:
            return one_line(error).partition(": ")[2][:30]
        return "taken"

    yield take


YAML = b"""\
resolution: [64, 48]
intrinsics: [50.0, 50.0, 31.5, 23.5]
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]
T_BS:
  rows: 4
  data: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]
"""


@target(lambda: [YAML], (b"equidistant", b"- ", b": ", b"[", b"]", b"%YAML:1.0\n", b"!!opencv-matrix"))
def sensor_yaml(folder: Path) -> Iterator[Take]:
    """A calibration of an ASL folder, up to a frame seen through that lens."""
    path = folder / "sensor.yaml"
    image = undecoded()

    def take(data: bytes) -> str:
        path.write_bytes(data)
        try:
            yaml = SensorYaml(path)
            yaml.rotation()
            lens = yaml.lens()
            if (lens.width, lens.height) == (WIDTH, HEIGHT):
                Pipeline(Config(), lens).process(Frame(STAMP_NS, 0, image))
        except RecordingError as error:
            return str(error).partition("sensor.yaml")[2][:30]
        return lens.model

    yield take


# Recordings


def asl_parts() -> Sequence[bytes]:
    """Three csv files and two calibrations."""
    cam = b"#t,file\n" + b"".join(b"%d,%d.png\n" % (n * 50_000_000, n % 2) for n in range(4))
    imu = b"#t\n" + b"".join(b"%d,0.1,0.2,0.3,0,-9.8,0\n" % (n * 10_000_000) for n in range(20))
    odom = b"#t\n" + b"".join(b"%d,1.5,0.25\n" % (n * 20_000_000) for n in range(10))
    return [MARK.join((cam, imu, odom, YAML, YAML))]


@target(asl_parts, (b"\n", b",", b"../", b"9" * 30, b"nan", b"\xef\xbb\xbf", MARK))
def asl_folder(folder: Path) -> Iterator[Take]:
    """A whole replay."""
    files = [folder / "mav0" / name for name in ("cam0/data.csv", "imu0/data.csv", "odom0/data.csv")]
    files += [folder / "mav0" / name for name in ("cam0/sensor.yaml", "imu0/sensor.yaml")]
    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
    (folder / "mav0/cam0/data").mkdir()
    for number in range(2):
        cv2.imwrite(str(folder / f"mav0/cam0/data/{number}.png"), undecoded())

    def take(data: bytes) -> str:
        for file, part in zip(files, (*data.split(MARK), *[b""] * 5), strict=False):
            file.write_bytes(part)
        return replayed(folder, 6)

    yield take


def replayed(path: Path, frames: int) -> str:
    """What a replay tells, of so many frames at most."""
    try:
        recording = open_recording(path, Config())
        for count, _ in enumerate(run(recording, Config())):
            if count >= frames:
                break
    except (RecordingError, ConfigError) as error:
        return one_line(error).rpartition("/")[2][:30]
    assert all(warning.isprintable() for warning in recording.warnings)
    return f"{sorted(recording.skipped)} {len(recording.warnings)}"


def mcap_file(
    topics: Sequence[tuple[str, str, bytes]], compression: CompressionType = CompressionType.NONE, config: bytes = b""
) -> bytes:
    """(topic, type, payload)"""
    file = io.BytesIO()
    writer = Writer(file, 2000, compression, enable_crcs=False)
    writer.start("ros2")
    if config:
        writer.add_attachment(0, 0, IN_RECORDING, "application/toml", config)
    for number, (topic, kind, payload) in enumerate(topics):
        channel = writer.register_channel(topic, "cdr", writer.register_schema(kind, "ros2msg", b""))
        writer.add_message(channel, STAMP_NS + number, payload, STAMP_NS + number)
    writer.finish()
    return file.getvalue()


def mcap_files() -> Sequence[bytes]:
    """Of each compression, with every type."""
    jpeg = cv2.imencode(".jpg", undecoded())[1].tobytes()
    topics = [
        ("/camera/image", "sensor_msgs/msg/Image", an_image()),
        (
            "/camera/compressed",
            "sensor_msgs/msg/CompressedImage",
            cdr.encode_compressed_image(STAMP_NS, "c", "jpeg", jpeg),
        ),
        ("/camera/camera_info", "sensor_msgs/msg/CameraInfo", messages()[5]),
        ("/imu", "sensor_msgs/msg/Imu", messages()[3]),
        ("/speed", "geometry_msgs/msg/TwistStamped", messages()[4]),
    ]
    forms = (CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD)
    return [mcap_file(topics, form, b"[camera]\nfps = 10\n") for form in forms] + [mcap_file(topics[1:])]


@target(
    mcap_files,
    (
        b"\x89MCAP0\r\n",
        b"\xff" * 8,
        b"zstd",
        b"lz4",
        b"\x05",
        b"\x06",
        b"\x08",
        b"\x0b",
        b"\x0e",
        b"sensor_msgs/msg/Image",
    ),
)
def mcap(folder: Path) -> Iterator[Take]:
    """A whole replay, and the configuration inside."""
    path = folder / "drive.mcap"

    def take(data: bytes) -> str:
        path.write_bytes(data)
        try:
            load(path)
        except ConfigError as error:
            return one_line(error)[-20:] + replayed(path, 6)
        return replayed(path, 6)

    yield take


@target(lambda: [messages()[5]], (b"equidistant\0", b"plumb_bob\0", b"rational_polynomial\0"))
def camera_info(folder: Path) -> Iterator[Take]:
    """Whatever a lens may be, an image is seen through it."""
    path = folder / "drive.mcap"

    def take(data: bytes) -> str:
        topics = [
            ("/c/camera_info", "sensor_msgs/msg/CameraInfo", data),
            ("/c/image", "sensor_msgs/msg/Image", an_image()),
        ]
        path.write_bytes(mcap_file(topics))
        return replayed(path, 2)

    yield take


# Images


def tiff() -> bytes:
    """Uncompressed and small, for its tags to be changed."""
    return cv2.imencode(".tif", undecoded(16, 12), [cv2.IMWRITE_TIFF_COMPRESSION, 1])[1].tobytes()


def pictures_in_all_formats() -> Sequence[bytes]:
    """Small ones."""
    small = undecoded(16, 12)
    colour = cv2.merge([small, small.T.reshape(12, 16), small])
    progressive = [cv2.IMWRITE_JPEG_PROGRESSIVE, 1]
    encoded = [cv2.imencode(suffix, small)[1].tobytes() for suffix in (".png", ".jpg", ".bmp", ".pgm")]
    encoded += [cv2.imencode(suffix, colour)[1].tobytes() for suffix in (".png", ".jpg", ".bmp", ".ppm")]
    return [*encoded, tiff(), cv2.imencode(".jpg", colour, progressive)[1].tobytes()]


def with_checksums(png: bytes) -> bytes:
    """The chunks of a PNG with checksums that are right."""
    parts, at = [png[:8]], 8
    while at + 12 <= len(png):
        (length,) = struct.unpack_from(">I", png, at)
        body = png[at + 4 : at + 8 + length]
        parts.append(png[at : at + 4] + body + struct.pack(">I", zlib.crc32(body)))
        at += 12 + length
    return b"".join(parts)


MARKERS = [bytes((0xFF, marker)) for marker in (0, 1, 0xC0, 0xC2, 0xC4, 0xD0, 0xD8, 0xD9, 0xDA, 0xE1, 0xFE, 0xFF)]
TAGS = [struct.pack("<HHII", tag, 4, 1, 60_000) for tag in (256, 257, 277, 278, 322, 323)]


@target(pictures_in_all_formats, (*MARKERS, *TAGS, b"acTL", b"zTXt", b"IHDR", b"IDAT", b"#\r", b"60000"), grows_mib=256)
def pictures(_: Path) -> Iterator[Take]:
    """Every format; an image has the size that the check saw."""

    def take(data: bytes) -> str:
        became = ""
        for content in (data, with_checksums(data)) if data.startswith(b"\x89PNG") else (data,):
            try:
                became += f"{image_from_bytes(content).ndim}"
            except ImageDecodeError as error:
                became += str(error)
        return became

    yield take


@target(lambda: [cv2.imencode(".jpg", undecoded())[1].tobytes()], MARKERS)
def pictures_of_the_camera(_: Path) -> Iterator[Take]:
    """MJPG, whose size is known."""

    def take(data: bytes) -> str:
        header = jpeg_header(data)
        try:
            return str(luminance("MJPG", memoryview(data), WIDTH, HEIGHT, 0).shape) + str(header is None)
        except FrameError as error:
            return str(error)

    yield take


# The page of `lcf-edge view`


KEY = base64.b64encode(bytes(16)).decode()
UPGRADE = (
    f"GET /updates HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    f"Sec-WebSocket-Key: {KEY}\r\nSec-WebSocket-Version: 13\r\n\r\n"
).encode()


def requests() -> Sequence[bytes]:
    """What a browser sends: the page, an update, a file."""
    asked = b"\x81\x84\0\0\0\0next"  # a masked text
    return (
        b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /save HTTP/1.1\r\nHost: 127.0.0.1\r\nOrigin: http://127.0.0.1\r\n\r\n",
        b"POST /updates HTTP/1.1\r\nHost: [::1]\r\nContent-Length: 3\r\n\r\nabc",
        UPGRADE + asked,
        UPGRADE + b"\x88\x82\0\0\0\0\x03\xe8" + asked,
        UPGRADE + b"\x01\x81\0\0\0\0n" + b"\x80\x83\0\0\0\0ext" + b"\x89\x81\0\0\0\0p",
    )


HTTP = (
    b"\r\n",
    b"Transfer-Encoding: chunked\r\n",
    b"Content-Length: -1\r\n",
    b"Host: [",
    b"\x89\xff",
    b"\x81\xfe\xff\xff",
    b"?token=",
)


STARTS_WITHIN_S = 30.0


class _Page:
    """A real server in a thread of its own; what it complains about is kept."""

    def __init__(self) -> None:
        self.complaints: list[str] = []
        self._ready = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="page")
        self._thread.start()
        if not self._ready.wait(STARTS_WITHIN_S):
            raise RuntimeError("the page does not start")

    async def _serve(self) -> None:
        self._loop, self._end = asyncio.get_running_loop(), asyncio.Event()
        self._loop.set_exception_handler(lambda _, context: self.complaints.append(str(context)))
        server, door = Server(DaemonAddress("tcp/127.0.0.1:9")), Doorkeeper()
        runner = web.AppRunner(server.application(Guard("127.0.0.1"), door), access_log=None, shutdown_timeout=0.1)
        await runner.setup()
        assert runner.server is not None
        listening = await self._loop.create_server(partial(door.protocol, runner.server), "127.0.0.1", 0)
        self.address = listening.sockets[0].getsockname()[:2]
        self._ready.set()
        await self._end.wait()
        listening.close()
        await runner.cleanup()
        server.close()

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()


@target(requests, HTTP)
def page(_: Path) -> Iterator[Take]:
    """HTTP and WebSocket; after each attack the page is served as before."""
    logging.getLogger("aiohttp").addHandler(logging.NullHandler())
    logging.getLogger("aiohttp").propagate = False
    server = _Page()

    def received(browser: socket.socket, patience_s: float) -> bytes:
        with suppress(ConnectionError, TimeoutError):
            browser.settimeout(patience_s)
            return browser.recv(4096)
        return b""

    def take(data: bytes) -> str:
        with socket.create_connection(server.address) as attacker, socket.create_connection(server.address) as browser:
            with suppress(ConnectionError):
                attacker.sendall(data)
            browser.sendall(b"GET /icon.svg HTTP/1.1\r\nHost: localhost\r\n\r\n")
            served = received(browser, 4.0)
            answer = received(attacker, 0.02)  # by now it is there, or what was asked is not whole
        assert b"Traceback" not in answer
        assert not server.complaints, server.complaints
        assert b" 500 " not in answer[:16], answer
        assert served.startswith(b"HTTP/1.1 200")
        return answer[9:12].decode("latin-1")

    try:
        yield take
    finally:
        server.close()


def chosen(names: Sequence[str]) -> Mapping[str, Target]:
    """The targets of those names; all, where there are none."""
    return {name: TARGETS[name] for name in names} if names else TARGETS


os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
