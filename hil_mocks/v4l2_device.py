"""Cameras behind the kernel's V4L2 interface, so that the shipped driver runs without such a kernel.

``MockKernel`` answers the system calls of ``drivers.camera.v4l2_ioctl.Kernel`` for the ``MockCamera`` that are plugged
into it; images come at the camera's rate on a clock. What a real device was seen to do wrong can be switched on.
"""

import errno
import mmap
import os
import select
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from drivers.camera import v4l2_ioctl as v4l2
from drivers.camera.luminance import min_stride
from drivers.clock import Clock

Grey = npt.NDArray[np.uint8]
T = TypeVar("T")
Modes = dict[str, dict[tuple[int, int], tuple[float, ...]]]

WEBCAM: Modes = {
    "YUYV": {(640, 480): (30.0, 15.0), (320, 240): (30.0, 15.0), (1280, 720): (10.0,)},
    "MJPG": {(640, 480): (30.0, 15.0), (320, 240): (30.0, 15.0), (1280, 720): (30.0, 15.0)},
}
"""Formats, sizes and rates of a common USB camera."""


@dataclass
class MockControl:
    """A control: its value, range and step."""

    value: int
    minimum: int
    maximum: int
    step: int = 1
    menu: tuple[int, ...] = ()  # which values exist; empty: no menu


def webcam_controls() -> dict[int, MockControl]:
    """Those of a common USB camera, at its factory settings: everything automatic."""
    return {
        v4l2.CID_POWER_LINE_FREQUENCY: MockControl(2, 0, 2, menu=(0, 1, 2)),
        v4l2.CID_EXPOSURE_AUTO: MockControl(3, 0, 3, menu=(1, 3)),
        v4l2.CID_EXPOSURE_ABSOLUTE: MockControl(250, 3, 2047),
        v4l2.CID_EXPOSURE_AUTO_PRIORITY: MockControl(1, 0, 1),
        v4l2.CID_GAIN: MockControl(0, 0, 255),
    }


def drawn_image(seq: int, width: int, height: int) -> Grey:
    """A grey gradient whose brightness encodes ``seq`` (modulo 128)."""
    ramp = np.linspace(0, 100, width, dtype=np.uint8)[None, :]
    return np.repeat(ramp + np.uint8(seq % 128), height, axis=0)


@dataclass
class MockCamera:
    """A camera and its faults; a fault that counts images ends by itself."""

    card: str = "Mock Webcam"
    driver: str = "uvcvideo"
    modes: Modes = field(default_factory=lambda: WEBCAM)
    controls: dict[int, MockControl] = field(default_factory=webcam_controls)
    caps: int = v4l2.CAP_VIDEO_CAPTURE | v4l2.CAP_STREAMING
    images: Callable[[int, int, int], Grey] = drawn_image
    transfer: float = 0.5  # share of an interval from start of exposure to the filled buffer
    row_padding: int = 0  # bytes after each row
    data_offset: int = 0  # bytes before the image, of a multi-planar device
    field: int = v4l2.FIELD_NONE
    stamp_flags: int = v4l2.FLAG_TIMESTAMP_MONOTONIC | v4l2.FLAG_STAMPED_AT_EXPOSURE
    stamp_offset_s: float = 0.0
    tells_rate: bool = True  # has VIDIOC_S_PARM and lists its rates
    first_sequence: int = 0

    open_error: int = 0  # errno, also of the next ones
    format_error: int = 0
    start_error: int = 0
    dequeue_error: int = 0
    late_s: float = 0.0  # added to the transfer
    stalled: bool = False
    drop: int = 0  # images that the camera loses
    flag_error: int = 0  # images with V4L2_BUF_FLAG_ERROR
    short: int = 0  # images of which half arrives
    spoil: Callable[[bytes], bytes] | None = None  # what happens to the bytes of an image


class _Open:
    """An open file, and with it the state of the stream."""

    def __init__(self, camera: MockCamera) -> None:
        self.camera = camera
        self.pixel_format, self.width, self.height, self.fps = "", 0, 0, 0.0
        self.buffers: list[mmap.mmap] = []
        self.empty: deque[int] = deque()
        self.filled: deque[v4l2.Buffer] = deque()
        self.started_ns: int | None = None
        self.exposed = 0  # images since the start of the stream


class MockKernel:
    """Nodes and their cameras; ``calls`` counts the system calls, ``mapped`` is the memory that was given out."""

    def __init__(self, clock: Clock) -> None:
        self.calls: Counter[str] = Counter()
        self.mapped: list[mmap.mmap] = []
        self._clock = clock
        self._cameras: dict[str, MockCamera] = {}
        self._links: dict[str, str] = {}
        self._files: dict[int, _Open] = {}
        self._next_fd = 1000

    @property
    def open_files(self) -> int:
        """How many files are open."""
        return len(self._files)

    def plug(self, path: str, camera: MockCamera, link: str = "") -> None:
        """Plug a camera in; ``link``: its name in ``/dev/v4l/by-id``."""
        self._cameras[path] = camera
        if link:
            self._links[link] = path

    def unplug(self, path: str) -> None:
        """Pull the plug."""
        del self._cameras[path]
        self._links = {link: target for link, target in self._links.items() if target != path}

    def nodes(self) -> list[str]:
        """Paths of all video nodes."""
        return sorted(self._cameras)

    def open(self, path: str) -> int:
        """As open(2)."""
        self.calls["open"] += 1
        camera = self._cameras.get(self._links.get(path, path))
        if camera is None:
            raise _os_error(errno.ENOENT)
        _refuse(camera.open_error)
        self._next_fd += 1
        self._files[self._next_fd] = _Open(camera)
        return self._next_fd

    def ioctl(self, fd: int, request: int, argument: v4l2.Argument) -> v4l2.Argument:
        """As ioctl(2), for the requests that the driver makes."""
        self.calls["ioctl"] += 1
        file = self._files[fd]
        if file.camera not in self._cameras.values():
            raise _os_error(errno.ENODEV)
        _ANSWERS.get(request, MockKernel._unknown)(self, file, argument)
        return argument

    def map(self, fd: int, length: int, offset: int) -> mmap.mmap:
        """As mmap(2)."""
        memory = self._files[fd].buffers[offset // mmap.PAGESIZE]
        assert len(memory) == length
        self.mapped.append(memory)
        return memory

    def poll(self, fd: int, timeout_s: float) -> int:
        """As poll(2) for POLLIN; the clock goes on to the next image or to the timeout."""
        self.calls["poll"] += 1
        file = self._files[fd]
        end_ns = self._clock.monotonic_ns() + round(timeout_s * 1e9)
        while True:
            if file.camera not in self._cameras.values():
                return select.POLLERR | select.POLLHUP
            self._expose(file)
            if file.filled or file.camera.dequeue_error:
                return select.POLLIN
            now_ns = self._clock.monotonic_ns()
            if now_ns >= end_ns:
                return 0
            next_ns = end_ns if file.camera.stalled else min(end_ns, self._complete_ns(file, file.exposed))
            self._clock.sleep_s(max(next_ns - now_ns, 1) / 1e9)

    def close(self, fd: int) -> None:
        """As close(2)."""
        if self._files.pop(fd, None) is None:
            raise _os_error(errno.EBADF)

    def _exposure_ns(self, file: _Open, number: int) -> int:
        assert file.started_ns is not None
        return file.started_ns + round(number * 1e9 / file.fps)

    def _complete_ns(self, file: _Open, number: int) -> int:
        camera = file.camera
        return self._exposure_ns(file, number) + round((camera.transfer / file.fps + camera.late_s) * 1e9)

    def _expose(self, file: _Open) -> None:
        """Fill buffers with the images that are complete by now; without an empty buffer they are lost."""
        now_ns = self._clock.monotonic_ns()
        while file.started_ns is not None and self._complete_ns(file, file.exposed) <= now_ns:
            number = file.exposed
            file.exposed += 1
            if file.camera.stalled:
                continue
            if file.camera.drop:
                file.camera.drop -= 1
            elif file.empty:
                file.filled.append(self._fill(file, file.empty.popleft(), number))

    def _fill(self, file: _Open, index: int, number: int) -> v4l2.Buffer:
        camera = file.camera
        data = encode(camera.images(number, file.width, file.height), file.pixel_format, camera.row_padding)
        if camera.spoil:
            data = camera.spoil(data)
        if camera.short:
            camera.short -= 1
            data = data[: len(data) // 2]
        flags = camera.stamp_flags
        if camera.flag_error:
            camera.flag_error -= 1
            flags |= v4l2.FLAG_ERROR
        data = bytes(camera.data_offset) + data
        file.buffers[index][: len(data)] = data
        stamp_us = (self._exposure_ns(file, number) + round(camera.stamp_offset_s * 1e9)) // 1000
        return v4l2.Buffer(
            index=index,
            bytesused=len(data),
            flags=flags,
            seconds=stamp_us // 1_000_000,
            microseconds=stamp_us % 1_000_000,
            sequence=(camera.first_sequence + number) % 2**32,
        )

    def _unknown(self, _file: _Open, _argument: v4l2.Argument) -> None:
        raise _os_error(errno.ENOTTY)

    def _capabilities(self, file: _Open, answer: v4l2.Capability) -> None:
        card = file.camera.card.encode()[:31]
        answer.card[: len(card)] = card
        driver = file.camera.driver.encode()[:15]
        answer.driver[: len(driver)] = driver
        answer.capabilities = file.camera.caps | v4l2.CAP_VIDEO_CAPTURE | v4l2.CAP_DEVICE_CAPS  # of the whole device
        answer.device_caps = file.camera.caps

    def _format_at(self, file: _Open, answer: v4l2.FormatDescription) -> None:
        answer.pixelformat = v4l2.fourcc(_item(list(file.camera.modes), answer.index))

    def _size_at(self, file: _Open, answer: v4l2.FrameSize) -> None:
        sizes = file.camera.modes.get(v4l2.fourcc_text(answer.pixelformat), {})
        answer.type = v4l2.DISCRETE
        answer.numbers[:2] = _item(list(sizes), answer.index)

    def _rate_at(self, file: _Open, answer: v4l2.FrameInterval) -> None:
        sizes = file.camera.modes.get(v4l2.fourcc_text(answer.pixelformat), {})
        rates = sizes.get((answer.width, answer.height), ()) if file.camera.tells_rate else ()
        answer.type = v4l2.DISCRETE
        answer.numbers[:2] = 1000, round(1000 * _item(list(rates), answer.index))

    def _set_format(self, file: _Open, answer: v4l2.Format | v4l2.PlanesFormat) -> None:
        """Replace an unsupported format by the nearest supported one, as the kernel's drivers do."""
        _refuse(file.camera.format_error)
        modes = file.camera.modes
        requested = v4l2.fourcc_text(answer.pixelformat)
        file.pixel_format = requested if requested in modes else next(iter(modes))
        sizes = modes[file.pixel_format]
        asked = (answer.width, answer.height)
        file.width, file.height = asked if asked in sizes else next(iter(sizes))
        file.fps = max(sizes[file.width, file.height])
        answer.width, answer.height = file.width, file.height
        answer.pixelformat = v4l2.fourcc(file.pixel_format)
        answer.field = file.camera.field
        plane = answer.planes[0] if isinstance(answer, v4l2.PlanesFormat) else answer
        stride = min_stride(file.pixel_format, file.width)
        plane.bytesperline = stride + file.camera.row_padding if stride else 0
        plane.sizeimage = file.height * max(plane.bytesperline, 2 * file.width)

    def _set_rate(self, file: _Open, answer: v4l2.StreamParm) -> None:
        if not file.camera.tells_rate:
            raise _os_error(errno.ENOTTY)
        asked = answer.denominator / answer.numerator
        rates = file.camera.modes[file.pixel_format][file.width, file.height]
        file.fps = min(rates, key=lambda rate: abs(rate - asked))
        answer.capability = v4l2.CAP_TIMEPERFRAME
        answer.numerator, answer.denominator = 1000, round(1000 * file.fps)

    def _request_buffers(self, file: _Open, answer: v4l2.RequestBuffers) -> None:
        size = file.height * (4 * file.width + file.camera.row_padding) + 65536
        file.buffers = [mmap.mmap(-1, size) for _ in range(answer.count)]

    def _buffer_at(self, file: _Open, answer: v4l2.Buffer | v4l2.PlanesBuffer) -> None:
        memory = _first_plane(answer)
        memory.length = len(file.buffers[answer.index])
        memory.offset = answer.index * mmap.PAGESIZE

    def _queue(self, file: _Open, buffer: v4l2.Buffer | v4l2.PlanesBuffer) -> None:
        self._expose(file)
        assert buffer.index not in file.empty
        file.empty.append(buffer.index)

    def _dequeue(self, file: _Open, answer: v4l2.Buffer | v4l2.PlanesBuffer) -> None:
        _refuse(file.camera.dequeue_error)
        self._expose(file)
        if not file.filled:
            raise _os_error(errno.EAGAIN)
        filled = file.filled.popleft()
        memory = _first_plane(answer)
        memory.bytesused = filled.bytesused
        if isinstance(memory, v4l2.Plane):
            memory.data_offset = file.camera.data_offset
        for name in ("index", "flags", "seconds", "microseconds", "sequence"):
            setattr(answer, name, getattr(filled, name))

    def _start(self, file: _Open, _argument: v4l2.BufferType) -> None:
        _refuse(file.camera.start_error)
        file.started_ns, file.exposed = self._clock.monotonic_ns(), 0

    def _stop(self, file: _Open, _argument: v4l2.BufferType) -> None:
        file.started_ns = None

    def _query_control(self, file: _Open, answer: v4l2.ControlQuery) -> None:
        control = _control(file, answer.id)
        answer.minimum, answer.maximum, answer.step = control.minimum, control.maximum, control.step

    def _query_menu(self, file: _Open, answer: v4l2.MenuQuery) -> None:
        if answer.index not in _control(file, answer.id).menu:
            raise _os_error(errno.EINVAL)

    def _get_control(self, file: _Open, answer: v4l2.Control) -> None:
        answer.value = _control(file, answer.id).value

    def _set_control(self, file: _Open, argument: v4l2.Control) -> None:
        control = _control(file, argument.id)
        if control.menu and argument.value not in control.menu:
            raise _os_error(errno.EINVAL)
        steps = round((argument.value - control.minimum) / control.step)
        control.value = control.minimum + steps * control.step


def encode(image: Grey, pixel_format: str, row_padding: int = 0) -> bytes:
    """A grey image as a camera would send it, rows of raw formats followed by padding.

    Bits beyond eight are set, so that a reader that takes the wrong ones is noticed.
    """
    height, width = image.shape
    if pixel_format == "MJPG":
        return bytes(cv2.imencode(".jpg", image)[1])
    colour = np.full_like(image, 128)
    if pixel_format in {"YUYV", "YVYU"}:
        image = np.stack([image, colour], axis=2)
    elif pixel_format in {"UYVY", "VYUY"}:
        image = np.stack([colour, image], axis=2)
    elif pixel_format in {"NV12", "NV21", "YU12", "YV12"}:
        image = np.vstack([image, colour[: height // 2]])
    elif pixel_format in {"NV16", "NV61", "422P"}:
        image = np.vstack([image, colour])
    elif pixel_format in {"BGR3", "RGB3"}:
        image = np.stack([image] * 3, axis=2)
    elif pixel_format in {"XR24", "XB24"}:
        image = np.stack([image] * 3 + [colour], axis=2)
    elif bits := WORDS.get(pixel_format):
        image = (image.astype("<u2") << (bits - 8) | (1 << (bits - 8)) - 1).view(np.uint8)
    elif pixels := PACKED.get(pixel_format):
        lower = np.full((height, width // pixels, 1), 255, np.uint8)
        image = np.concatenate([image.reshape(height, -1, pixels), lower], axis=2)
    rows = image.reshape(len(image), -1)
    return np.pad(rows, ((0, 0), (0, row_padding)), constant_values=255).tobytes()


WORDS = {
    **dict.fromkeys(("Y10", "BG10", "GB10", "BA10", "RG10"), 10),
    **dict.fromkeys(("Y12", "BG12", "GB12", "BA12", "RG12"), 12),
    **dict.fromkeys(("Y16", "BYR2", "GB16", "GR16", "RG16"), 16),
}
"""Bits that are used of the 16 of a pixel."""
PACKED = {
    **dict.fromkeys(("Y10P", "pBAA", "pGAA", "pgAA", "pRAA"), 4),
    **dict.fromkeys(("Y12P", "pBCC", "pGCC", "pgCC", "pRCC"), 2),
}
"""Pixels whose lower bits share a byte."""


def _first_plane(buffer: v4l2.Buffer | v4l2.PlanesBuffer) -> v4l2.Buffer | v4l2.Plane:
    """Where length and place of the first memory are written."""
    return v4l2.Plane.from_address(buffer.planes) if isinstance(buffer, v4l2.PlanesBuffer) else buffer


def _os_error(number: int) -> OSError:
    return OSError(number, os.strerror(number))


def _refuse(number: int) -> None:
    if number:
        raise _os_error(number)


def _item(items: list[T], index: int) -> T:
    if index >= len(items):
        raise _os_error(errno.EINVAL)
    return items[index]


def _control(file: _Open, control: int) -> MockControl:
    if control not in file.camera.controls:
        raise _os_error(errno.EINVAL)
    return file.camera.controls[control]


_ANSWERS: dict[int, Callable[[MockKernel, _Open, Any], None]] = {
    v4l2.QUERYCAP: MockKernel._capabilities,
    v4l2.ENUM_FMT: MockKernel._format_at,
    v4l2.ENUM_FRAMESIZES: MockKernel._size_at,
    v4l2.ENUM_FRAMEINTERVALS: MockKernel._rate_at,
    v4l2.S_FMT: MockKernel._set_format,
    v4l2.S_PARM: MockKernel._set_rate,
    v4l2.REQBUFS: MockKernel._request_buffers,
    v4l2.QUERYBUF: MockKernel._buffer_at,
    v4l2.QBUF: MockKernel._queue,
    v4l2.DQBUF: MockKernel._dequeue,
    v4l2.STREAMON: MockKernel._start,
    v4l2.STREAMOFF: MockKernel._stop,
    v4l2.QUERYCTRL: MockKernel._query_control,
    v4l2.QUERYMENU: MockKernel._query_menu,
    v4l2.G_CTRL: MockKernel._get_control,
    v4l2.S_CTRL: MockKernel._set_control,
}
