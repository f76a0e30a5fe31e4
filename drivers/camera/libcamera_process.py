"""The process that runs libcamera for the driver ``libcamera``: ``python3 -I libcamera_process.py FD REQUEST``.

It runs under the system's own Python, for which Debian builds libcamera's binding, and needs nothing else. ``FD`` is
a socket of whole messages (``SOCK_SEQPACKET``), ``REQUEST`` the settings as JSON. Messages out, as JSON, each with its
``type``:

- ``cameras``: those present, where the request has no device; then the process ends.
- ``ready``: what was granted, with the descriptors of the buffers, which the reader maps.
- ``picture``: a buffer is filled.
- ``failure``: ``kind`` and ``text`` for the user; then the process ends.

Messages in: the numbers of buffers that were read, one byte each. The process ends when the socket is closed.
Source: libcamera's Python binding 0.4 (Debian 13) and its control and property definitions.
"""

import array
import errno
import json
import math
import os
import re
import selectors
import signal
import socket
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

BUFFERS = 4  # one being filled, one being read, two for the time in between
PIXEL_FORMATS = {  # libcamera's names, which are the bytes' order in a word: this project's, which are V4L2's
    "R8": "GREY",
    "NV12": "NV12",
    "NV21": "NV21",
    "YUV420": "YU12",
    "YVU420": "YV12",
    "YUYV": "YUYV",
    "UYVY": "UYVY",
    "XRGB8888": "XR24",
    "XBGR8888": "XB24",
    "BGR888": "RGB3",
    "RGB888": "BGR3",
    "MJPEG": "MJPG",
}
_RAW = re.compile(r"(?:S[RGB]{4}|R)(\d+)")  # a sensor's raw format, with its bits
_MAX_SIZES = 12
_MAX_SHARE = 0.95  # of the widest field of view, which counts as the same
_MANUAL, _AUTOMATIC, _OFF = 1, 0, 0
_LOCKED = ("ExposureTime", "AnalogueGain")


_BUSY = "close that (fuser -v /dev/media* names it)"


class Refused(Exception):  # noqa: N818  # no fault of the program
    """The request cannot be met."""

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


def serve(libcamera: Any, connection: socket.socket, request: dict[str, Any]) -> None:
    """Deliver images until the other end closes. Raises ``Refused``."""
    manager = libcamera.CameraManager.singleton()
    if not request["device"]:
        cameras = [{"name": _model(one), "id": one.id} for one in manager.cameras]
        if not cameras and (why := why_none()).kind != "missing":
            raise why
        _send(connection, "cameras", cameras=cameras)
        return
    camera = _find(manager, request["device"])
    with _refusing("lost", "fails in libcamera"):
        _acquire(camera)
        try:
            _run(libcamera, manager, camera, connection, request)
        finally:
            camera.release()


def _find(manager: Any, device: str) -> Any:
    """Return the camera with this name or id, in full or in part, or whose pipeline has this node in /dev."""
    cameras = list(manager.cameras)
    if not cameras:
        raise why_none()
    device_name = device.casefold()
    if device.startswith("/dev/"):
        found = [camera for camera in cameras if _node(device) in _property(camera, "SystemDevices", ())]
    else:
        names = [(camera, (camera.id.casefold(), _model(camera).casefold())) for camera in cameras]
        found = [camera for camera, own in names if device_name in own]
        found = found or [camera for camera, own in names if any(device_name in name for name in own)]
    listed = ", ".join(f"{_model(camera)} ({camera.id})" for camera in cameras)
    if not found:
        raise Refused(
            "missing", f"libcamera has no such camera; found: {listed}; set camera.device to one of these names"
        )
    if len(found) > 1:
        raise Refused("wrong", f"more than one camera has this name; use an id from: {listed}")
    return found[0]


def why_none(media: Iterable[Path] | None = None) -> Refused:
    """Return why libcamera finds no camera. Another program that runs one holds a lock on its media device.

    ``media``: all of them by default.
    """
    for path in sorted(Path("/dev").glob("media*")) if media is None else media:
        try:
            with path.open("r+b", buffering=0) as device:
                os.lockf(device.fileno(), os.F_TEST, 0)
        except PermissionError as error:
            if error.filename is not None:  # of opening it
                return Refused("forbidden", f"no permission for {path}; add this user to the group video, log in again")
            return Refused("busy", f"in use by another program; {_BUSY}")
        except OSError as error:
            if error.errno == errno.EAGAIN:
                return Refused("busy", f"in use by another program; {_BUSY}")
    return Refused("missing", "libcamera finds no camera; check that the ribbon cable sits straight, then reboot")


def _acquire(camera: Any) -> None:
    try:
        camera.acquire()
    except (RuntimeError, OSError) as error:
        raise Refused("busy", f"in use by another program ({error}); {_BUSY}") from error


def _run(libcamera: Any, manager: Any, camera: Any, connection: socket.socket, request: dict[str, Any]) -> None:
    stream, granted = _configure(libcamera, camera, request)
    controls = _controls(camera, request)
    allocator = libcamera.FrameBufferAllocator(camera)
    allocator.allocate(stream)
    buffers = allocator.buffers(stream)
    requests = []
    for index, buffer in enumerate(buffers):
        requests.append(camera.create_request(index))
        requests[-1].add_buffer(stream, buffer)
    planes = [buffer.planes[0] for buffer in buffers]  # the luminance, or all there is
    granted["buffers"] = [[plane.offset, plane.length] for plane in planes]
    _send(connection, "ready", [plane.fd for plane in planes], **granted)
    camera.start(controls)
    for one, part in zip(requests, _in_order(controls), strict=False):
        for control, value in part.items():
            one.set_control(control, value)
    try:
        for one in requests:
            camera.queue_request(one)
        _hand_over(libcamera, manager, camera, connection, stream, requests)
    finally:
        camera.stop()


def _hand_over(
    libcamera: Any, manager: Any, camera: Any, connection: socket.socket, stream: Any, requests: list[Any]
) -> None:
    with selectors.DefaultSelector() as selector:
        selector.register(connection, selectors.EVENT_READ)
        selector.register(manager.event_fd, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fileobj is connection:
                    read = connection.recv(64)
                    if not read:
                        return
                    for index in read:
                        requests[index].reuse()
                        camera.queue_request(requests[index])
                else:
                    for done in manager.get_ready_requests():
                        _pass_on(libcamera, connection, stream, done)


def _pass_on(libcamera: Any, connection: socket.socket, stream: Any, done: Any) -> None:
    if done.status != libcamera.Request.Status.Complete:
        raise Refused("lost", "libcamera cancelled its requests, as when a camera is unplugged; check its cable")
    metadata = done.buffers[stream].metadata
    stamps = {control.name: value for control, value in done.metadata.items()}
    _send(
        connection,
        "picture",
        index=done.cookie,
        sequence=metadata.sequence,
        stamp_ns=stamps.get("SensorTimestamp") or metadata.timestamp,
        size=metadata.planes[0].bytes_used,
        good=metadata.status == libcamera.FrameMetadata.Status.Success,
    )


def _configure(libcamera: Any, camera: Any, request: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Set up the camera's stream; return it, and what was granted."""
    width, height, fps = request["width"], request["height"], request["fps"]
    offered = camera.generate_configuration([libcamera.StreamRole.Viewfinder]).at(0).formats
    readable = {PIXEL_FORMATS[str(one)]: one for one in offered.pixel_formats if str(one) in PIXEL_FORMATS}
    requested = request["format"]
    for name in PIXEL_FORMATS.values():
        if name not in readable or requested not in {"auto", name}:
            continue
        config = _configuration(libcamera, camera, readable[name], width, height)
        if config is None:
            continue
        config = _widest(libcamera, camera, request, readable[name], config)
        camera.configure(config)
        _check_rate(camera, fps)
        stream = config.at(0)
        return stream.stream, {"format": name, "width": width, "height": height, "stride": stream.stride, "fps": fps}
    refused = "format that can be read" if requested == "auto" else requested
    described = "; ".join(f"{name}: {_sizes(offered, one)}" for name, one in readable.items())
    raise Refused(
        "unsupported", f"no {refused} of {width}x{height}; offered: {described or 'nothing that can be read'}"
    )


def _configuration(libcamera: Any, camera: Any, pixel_format: Any, width: int, height: int, mode: Any = None) -> Any:
    """Return a configuration that is granted as requested; None: there is none."""
    config = camera.generate_configuration([libcamera.StreamRole.Viewfinder])
    stream = config.at(0)
    stream.pixel_format, stream.size, stream.buffer_count = pixel_format, libcamera.Size(width, height), BUFFERS
    if mode is not None:
        config.sensor_config = mode
    if config.validate() == libcamera.CameraConfiguration.Status.Invalid:
        return None
    stream = config.at(0)
    same = (stream.size.width, stream.size.height, str(stream.pixel_format)) == (width, height, str(pixel_format))
    return config if same else None


def _widest(libcamera: Any, camera: Any, request: dict[str, Any], pixel_format: Any, fallback: Any) -> Any:
    """Return the configuration with the sensor's smallest mode of those with the widest view, at the requested rate.

    By default libcamera takes the mode of the nearest size, which on many sensors is a crop. The view of a mode is
    known only once it is set up. ``fallback``: where modes cannot be chosen.
    """
    offers: list[tuple[int, int, Any]] = []
    for mode in _modes(libcamera, camera):
        size = request["width"], request["height"]
        config = _configuration(libcamera, camera, pixel_format, *size, mode)
        if config is None:
            continue
        camera.configure(config)
        crop = _property(camera, "ScalerCropMaximum", None)
        fastest_us = _limits(camera)[0]
        if crop is not None and fastest_us * request["fps"] <= 1.01e6:
            output = mode.output_size
            offers.append((crop.size.width * crop.size.height, output.width * output.height, config))
    most = max((field for field, *_ in offers), default=0)
    wide = [one for one in offers if one[0] >= _MAX_SHARE * most]
    return min(wide, key=lambda one: one[1])[2] if wide else fallback


def _modes(libcamera: Any, camera: Any) -> Iterator[Any]:
    """Yield the sensor's modes, where the pipeline reports their view and lets them be chosen."""
    if _property(camera, "ScalerCropMaximum", None) is None or not hasattr(libcamera, "SensorConfiguration"):
        return
    raw = camera.generate_configuration([libcamera.StreamRole.Raw])
    if raw is None or len(raw) == 0:
        return
    formats = raw.at(0).formats
    deepest: dict[tuple[int, int], int] = {}
    for pixel_format in formats.pixel_formats:
        if bits := _RAW.match(str(pixel_format)):
            for size in formats.sizes(pixel_format):
                key = size.width, size.height
                deepest[key] = max(deepest.get(key, 0), int(bits[1]))
    for (width, height), bits_of_mode in deepest.items():
        mode = libcamera.SensorConfiguration()
        mode.bit_depth, mode.output_size = bits_of_mode, libcamera.Size(width, height)
        yield mode


def _check_rate(camera: Any, fps: float) -> None:
    fastest_us, slowest_us = _limits(camera)
    if slowest_us and not 0.99 * fastest_us <= 1e6 / fps <= 1.01 * slowest_us:
        slow, fast = 1e6 / slowest_us, 1e6 / fastest_us if fastest_us else 0.0
        raise Refused("unsupported", f"no {fps:g} frames a second at this size; offered: {slow:.4g}..{fast:.4g}/s")


def _limits(camera: Any) -> tuple[int, int]:
    """Return the shortest and longest frame duration, µs; 0, 0: unknown."""
    info = _known(camera).get("FrameDurationLimits")
    return (int(_first(info[1].min)), int(_first(info[1].max))) if info else (0, 0)


def _controls(camera: Any, request: dict[str, Any]) -> dict[Any, Any]:
    """Return the controls to set at the start. Raises ``Refused`` for those the camera lacks or refuses."""
    known = _known(camera)
    chosen: dict[str, Any] = {}
    exposure_s, gain, power_line_hz = request["exposure_s"], request["gain"], request["power_line_hz"]
    if "FrameDurationLimits" in known:
        interval_us = round(1e6 / request["fps"])
        chosen["FrameDurationLimits"] = (interval_us, interval_us)
    if exposure_s is not None:
        chosen["ExposureTime"] = _within(known, "ExposureTime", "camera.exposure_s", round(exposure_s * 1e6), 1e-6)
    if gain is not None:
        chosen["AnalogueGain"] = _within(known, "AnalogueGain", "camera.gain", float(gain))
    if "ExposureTimeMode" in known:  # since libcamera 0.5; before that, setting a value locks it
        chosen["ExposureTimeMode"] = _AUTOMATIC if exposure_s is None else _MANUAL
    if "AnalogueGainMode" in known:
        chosen["AnalogueGainMode"] = _AUTOMATIC if gain is None else _MANUAL
    if "AeEnable" in known and "ExposureTimeMode" not in known:
        chosen["AeEnable"] = exposure_s is None or gain is None
    if power_line_hz is not None:
        if not {"AeFlickerMode", "AeFlickerPeriod"} <= set(known):
            raise Refused("unsupported", "camera.power_line_hz cannot be set; leave it unset")
        chosen["AeFlickerMode"] = _MANUAL if power_line_hz else _OFF
        if power_line_hz:
            chosen["AeFlickerPeriod"] = round(1e6 / (2 * power_line_hz))
    if "AfMode" in known:  # a lens that moves would be taken for motion
        chosen["AfMode"] = _OFF
        if "LensPosition" in known and (default := _first(known["LensPosition"][1].default)) is not None:
            chosen["LensPosition"] = float(default)
    return {known[name][0]: value for name, value in chosen.items()}


def _in_order(controls: dict[Any, Any]) -> tuple[dict[Any, Any], dict[Any, Any]]:
    """Split the controls between the first and the second request.

    Before 0.5 libcamera applies controls of one request in any order, and switching the automatic off or on resets a
    value that is already locked (agc_channel.cpp); some pipelines take no controls at the start (rkisp1.cpp).
    """
    values = {control: value for control, value in controls.items() if control.name in _LOCKED}
    return {control: value for control, value in controls.items() if control not in values}, values


def _within(known: dict[str, Any], name: str, key: str, value: float, unit: float = 1.0) -> float:
    """Check that the control can take the value, and return it. ``unit``: of the control, in the key's."""
    if name not in known:
        raise Refused("unsupported", f"{key} cannot be set; leave it unset")
    low, high = _first(known[name][1].min) or 0, _first(known[name][1].max) or math.inf
    if not low <= value <= high:
        text = f"{key} cannot be {value * unit:g}; choose {low * unit:g} to {high * unit:g}, or leave it unset"
        raise Refused("unsupported", text)
    return value


def _known(camera: Any) -> dict[str, tuple[Any, Any]]:
    """Return the camera's controls by name."""
    return {control.name: (control, info) for control, info in camera.controls.items()}


def _property(camera: Any, name: str, default: Any) -> Any:
    return next((value for control, value in camera.properties.items() if control.name == name), default)


def _model(camera: Any) -> str:
    return str(_property(camera, "Model", camera.id))


def _node(path: str) -> int:
    """Return the device number of a node; 0: none."""
    try:
        return os.stat(path).st_rdev  # noqa: PTH116  # as libcamera does
    except OSError:
        return 0


def _sizes(offered: Any, pixel_format: Any) -> str:
    sizes = [f"{size.width}x{size.height}" for size in offered.sizes(pixel_format)]
    return ", ".join(sizes[:_MAX_SIZES] + ["…"] * (len(sizes) > _MAX_SIZES)) or str(offered.range(pixel_format))


def _first(value: Any) -> Any:
    return value[0] if isinstance(value, (list, tuple)) else value


def _send(connection: socket.socket, what: str, descriptors: list[int] | None = None, **fields: Any) -> None:
    rights = [(socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", descriptors))] if descriptors else []
    connection.sendmsg([json.dumps({"type": what, **fields}).encode()], rights)


@contextmanager
def _refusing(kind: str, text: str) -> Iterator[None]:
    """Turn what libcamera raises into ``Refused``; errors of the closed socket pass through."""
    try:
        yield
    except ConnectionError:
        raise
    except (RuntimeError, OSError) as error:
        raise Refused(kind, f"{text} ({error})") from error


def _answer(connection: socket.socket, request: str) -> None:
    try:
        import libcamera  # type: ignore[import-not-found]  # noqa: PLC0415  # of the system's Python
    except ImportError as error:
        text = f"{sys.executable} has no libcamera ({error}); apt install python3-libcamera libcamera-ipa"
        raise Refused("software", text) from error
    serve(libcamera, connection, json.loads(request))


def main(descriptor: str, request: str) -> None:
    """Run until the socket is closed."""
    for number in (signal.SIGINT, signal.SIGTERM):  # meant for the reader, which closes the socket
        signal.signal(number, signal.SIG_IGN)
    with socket.socket(fileno=int(descriptor)) as connection, suppress(ConnectionError):
        try:
            _answer(connection, request)
        except Refused as refusal:
            _send(connection, "failure", kind=refusal.kind, text=str(refusal))


if __name__ == "__main__":
    main(*sys.argv[1:])
