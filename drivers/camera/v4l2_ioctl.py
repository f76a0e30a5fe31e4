"""The part of the kernel's V4L2 interface that the driver needs: structures, request numbers, system calls.

Source: Linux UAPI ``include/uapi/linux/videodev2.h`` (names there: ``VIDIOC_QUERYCAP``, ``struct v4l2_buffer``, …).
Single- and multi-planar capture with memory-mapped buffers. The layout is that of 64-bit Linux, the same on x86-64 and
arm64.
"""

import ctypes
import fcntl
import mmap
import os
import select
from pathlib import Path
from typing import Protocol, TypeVar

u8, u16, u32, u64 = ctypes.c_uint8, ctypes.c_uint16, ctypes.c_uint32, ctypes.c_uint64
i32, i64 = ctypes.c_int32, ctypes.c_int64

VIDEO_CAPTURE = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE
VIDEO_CAPTURE_MPLANE = 9  # V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE
MEMORY_MMAP = 1
MAX_PLANES = 8  # VIDEO_MAX_PLANES

CAP_VIDEO_CAPTURE = 0x0000_0001
CAP_VIDEO_CAPTURE_MPLANE = 0x0000_1000
CAP_STREAMING = 0x0400_0000
CAP_IO_MC = 0x2000_0000  # part of a pipeline that must be set up through the media controller
CAP_DEVICE_CAPS = 0x8000_0000  # the node's own capabilities are listed apart from those of the whole device
CAP_TIMEPERFRAME = 0x1000  # of StreamParm: the rate can be set

_SIGNAL_PROCESSORS = frozenset({"bcm2835-isp", "pispbe"})  # of a Raspberry Pi 4 and 5

FIELD_ANY, FIELD_NONE = 0, 1  # FIELD_NONE: progressive

FLAG_ERROR = 0x0000_0040
FLAG_TIMESTAMP_MASK = 0x0000_E000
FLAG_TIMESTAMP_MONOTONIC = 0x0000_2000
FLAG_STAMP_SOURCE_MASK = 0x0007_0000
FLAG_STAMPED_AT_EXPOSURE = 0x0001_0000  # V4L2_BUF_FLAG_TSTAMP_SRC_SOE; 0: at the end of the frame

DISCRETE = 1  # type of FrameSize and FrameInterval; 2: continuous, 3: stepwise

CTRL_DISABLED = 0x0001

CID_AUTOGAIN = 0x0098_0912
CID_GAIN = 0x0098_0913
CID_POWER_LINE_FREQUENCY = 0x0098_0918
CID_EXPOSURE_AUTO = 0x009A_0901
CID_EXPOSURE_ABSOLUTE = 0x009A_0902  # 100 µs
CID_EXPOSURE_AUTO_PRIORITY = 0x009A_0903  # 1: the rate may fall in the dark
CID_ANALOGUE_GAIN = 0x009E_0903


class Capability(ctypes.Structure):
    """``v4l2_capability``."""

    _fields_ = (
        ("driver", u8 * 16),
        ("card", u8 * 32),
        ("bus_info", u8 * 32),
        ("version", u32),
        ("capabilities", u32),
        ("device_caps", u32),
        ("reserved", u32 * 3),
    )


class FormatDescription(ctypes.Structure):
    """``v4l2_fmtdesc``."""

    _fields_ = (
        ("index", u32),
        ("type", u32),
        ("flags", u32),
        ("description", u8 * 32),
        ("pixelformat", u32),
        ("mbus_code", u32),
        ("reserved", u32 * 3),
    )


class Format(ctypes.Structure):
    """``v4l2_format`` with its ``v4l2_pix_format``."""

    _fields_ = (
        ("type", u32),
        ("padding", u32),  # the union in the kernel's structure holds pointers
        ("width", u32),
        ("height", u32),
        ("pixelformat", u32),
        ("field", u32),
        ("bytesperline", u32),
        ("sizeimage", u32),
        ("colorspace", u32),
        ("rest", u8 * 172),
    )


class PlaneFormat(ctypes.Structure):
    """``v4l2_plane_pix_format``."""

    _fields_ = (("sizeimage", u32), ("bytesperline", u32), ("reserved", u16 * 6))


class PlanesFormat(ctypes.Structure):
    """``v4l2_format`` with its ``v4l2_pix_format_mplane``."""

    _fields_ = (
        ("type", u32),
        ("padding", u32),
        ("width", u32),
        ("height", u32),
        ("pixelformat", u32),
        ("field", u32),
        ("colorspace", u32),
        ("planes", PlaneFormat * MAX_PLANES),
        ("num_planes", u8),
        ("rest", u8 * 19),
    )


class FrameSize(ctypes.Structure):
    """``v4l2_frmsizeenum``; a discrete size is in the first two of ``numbers``: width, height.

    Else: least, largest and step of the width, then of the height.
    """

    _fields_ = (
        ("index", u32),
        ("pixelformat", u32),
        ("type", u32),
        ("numbers", u32 * 6),
        ("reserved", u32 * 2),
    )


class FrameInterval(ctypes.Structure):
    """``v4l2_frmivalenum``; ``numbers``: numerator, denominator of the interval in s, or of least, largest, step."""

    _fields_ = (
        ("index", u32),
        ("pixelformat", u32),
        ("width", u32),
        ("height", u32),
        ("type", u32),
        ("numbers", u32 * 6),
        ("reserved", u32 * 2),
    )


class StreamParm(ctypes.Structure):
    """``v4l2_streamparm`` with its ``v4l2_captureparm``."""

    _fields_ = (
        ("type", u32),
        ("capability", u32),
        ("capturemode", u32),
        ("numerator", u32),  # of the interval between frames, s
        ("denominator", u32),
        ("rest", u8 * 184),
    )


class RequestBuffers(ctypes.Structure):
    """``v4l2_requestbuffers``."""

    _fields_ = (
        ("count", u32),
        ("type", u32),
        ("memory", u32),
        ("capabilities", u32),
        ("flags", u8),
        ("reserved", u8 * 3),
    )


class Buffer(ctypes.Structure):
    """``v4l2_buffer``."""

    _fields_ = (
        ("index", u32),
        ("type", u32),
        ("bytesused", u32),
        ("flags", u32),
        ("field", u32),
        ("padding", u32),
        ("seconds", i64),  # timestamp
        ("microseconds", i64),
        ("timecode", u8 * 16),
        ("sequence", u32),
        ("memory", u32),
        ("offset", u32),  # for mmap
        ("padding_of_union", u32),
        ("length", u32),
        ("reserved2", u32),
        ("request_fd", i32),
        ("padding_of_struct", u32),
    )


class Plane(ctypes.Structure):
    """``v4l2_plane``."""

    _fields_ = (
        ("bytesused", u32),
        ("length", u32),
        ("offset", u32),  # for mmap
        ("padding_of_union", u32),
        ("data_offset", u32),  # bytes before the image
        ("reserved", u32 * 11),
    )


class PlanesBuffer(ctypes.Structure):
    """``v4l2_buffer`` of a multi-planar device."""

    _fields_ = (
        *Buffer._fields_[:11],
        ("planes", u64),  # address of an array of ``Plane``
        ("length", u32),  # of that array
        *Buffer._fields_[14:],
    )


class BufferType(ctypes.Structure):
    """The ``int`` of ``VIDIOC_STREAMON`` and ``VIDIOC_STREAMOFF``."""

    _fields_ = (("type", i32),)


class ControlQuery(ctypes.Structure):
    """``v4l2_queryctrl``."""

    _fields_ = (
        ("id", u32),
        ("type", u32),
        ("name", u8 * 32),
        ("minimum", i32),
        ("maximum", i32),
        ("step", i32),
        ("default_value", i32),
        ("flags", u32),
        ("reserved", u32 * 2),
    )


class MenuQuery(ctypes.Structure):
    """``v4l2_querymenu``."""

    _fields_ = (("id", u32), ("index", u32), ("name", u8 * 32), ("reserved", u32))


class Control(ctypes.Structure):
    """``v4l2_control``."""

    _fields_ = (("id", u32), ("value", i32))


_WRITE, _READ = 1, 2  # seen from the program


def _request(direction: int, number: int, argument: type[ctypes.Structure]) -> int:
    return direction << 30 | ctypes.sizeof(argument) << 16 | ord("V") << 8 | number


QUERYCAP = _request(_READ, 0, Capability)
ENUM_FMT = _request(_READ | _WRITE, 2, FormatDescription)
S_FMT = _request(_READ | _WRITE, 5, Format)
REQBUFS = _request(_READ | _WRITE, 8, RequestBuffers)
QUERYBUF = _request(_READ | _WRITE, 9, Buffer)
QBUF = _request(_READ | _WRITE, 15, Buffer)
DQBUF = _request(_READ | _WRITE, 17, Buffer)
STREAMON = _request(_WRITE, 18, BufferType)
STREAMOFF = _request(_WRITE, 19, BufferType)
S_PARM = _request(_READ | _WRITE, 22, StreamParm)
G_CTRL = _request(_READ | _WRITE, 27, Control)
S_CTRL = _request(_READ | _WRITE, 28, Control)
QUERYCTRL = _request(_READ | _WRITE, 36, ControlQuery)
QUERYMENU = _request(_READ | _WRITE, 37, MenuQuery)
ENUM_FRAMESIZES = _request(_READ | _WRITE, 74, FrameSize)
ENUM_FRAMEINTERVALS = _request(_READ | _WRITE, 75, FrameInterval)


def fourcc(text: str) -> int:
    """The number of a pixel format's four-character code; trailing blanks may be omitted."""
    return int.from_bytes(text.ljust(4).encode("ascii"), "little")


def fourcc_text(number: int) -> str:
    """A pixel format's four-character code without trailing blanks; a question mark: cannot be printed."""
    return "".join(chr(byte) if 32 <= byte < 127 else "?" for byte in number.to_bytes(4, "little")).rstrip()


def text(field: ctypes.Array[ctypes.c_uint8]) -> str:
    """A string of fixed size, up to its first zero."""
    name = bytes(field).split(b"\0", 1)[0].decode(errors="replace")
    return "".join(c if c.isprintable() else "?" for c in name).strip()


Argument = TypeVar("Argument", bound=ctypes.Structure)


class Kernel(Protocol):
    """The system calls; all raise ``OSError``."""

    def nodes(self) -> list[str]:
        """Paths of all video nodes, in the order of their numbers."""
        ...

    def open(self, path: str) -> int:
        """A file descriptor."""
        ...

    def ioctl(self, fd: int, request: int, argument: Argument) -> Argument:
        """The argument as the kernel left it."""
        ...

    def map(self, fd: int, length: int, offset: int) -> mmap.mmap:
        """The memory of a buffer."""
        ...

    def poll(self, fd: int, timeout_s: float) -> int:
        """Wait for a filled buffer; return the poll(2) events, 0 after the timeout."""
        ...

    def close(self, fd: int) -> None:
        """Let the file go."""
        ...


class LinuxKernel:
    """The running one."""

    def nodes(self) -> list[str]:
        """Paths of all video nodes, in the order of their numbers."""
        paths = (path for path in Path("/dev").glob("video*") if path.name[5:].isdecimal())
        return [str(path) for path in sorted(paths, key=lambda path: int(path.name[5:]))]

    def open(self, path: str) -> int:
        """A file descriptor."""
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    def ioctl(self, fd: int, request: int, argument: Argument) -> Argument:
        """The argument as the kernel left it."""
        while True:
            try:
                fcntl.ioctl(fd, request, argument, True)
            except InterruptedError:
                continue
            return argument

    def map(self, fd: int, length: int, offset: int) -> mmap.mmap:
        """The memory of a buffer."""
        return mmap.mmap(fd, length, mmap.MAP_SHARED, mmap.PROT_READ, offset=offset)

    def poll(self, fd: int, timeout_s: float) -> int:
        """Wait for a filled buffer; return the poll(2) events, 0 after the timeout."""
        poller = select.poll()
        poller.register(fd, select.POLLIN)
        return sum(events for _, events in poller.poll(timeout_s * 1e3))

    def close(self, fd: int) -> None:
        """Let the file go."""
        os.close(fd)


LINUX = LinuxKernel()


class Node:
    """An open video node: ``name`` as the user calls it, ``path``, ``card`` as the camera calls itself, ``caps``."""

    def __init__(self, path: str, name: str, kernel: Kernel) -> None:
        """Raises ``OSError``."""
        self.path, self.name = path, name
        self._kernel = kernel
        self._fd = kernel.open(path)
        try:
            capability = self.ask(QUERYCAP, Capability())
        except OSError:
            self.close()
            raise
        self.card = text(capability.card)
        self._driver = text(capability.driver)
        has_own_caps = capability.capabilities & CAP_DEVICE_CAPS
        self.caps = int(capability.device_caps if has_own_caps else capability.capabilities)

    @property
    def is_camera(self) -> bool:
        """Whether it delivers images by itself; nodes of metadata, sound and radio do not."""
        return self._captures and self.caps & CAP_STREAMING != 0 and not self.needs_libcamera

    @property
    def needs_libcamera(self) -> bool:
        """Whether it delivers images only when sensor and pipeline are run through the media controller.

        Cameras on the ribbon cable are like that: the node accepts sizes and formats, and then does not start.
        """
        return self._captures and (self.caps & CAP_IO_MC != 0 or self.is_signal_processor)

    @property
    def is_signal_processor(self) -> bool:
        """Whether it processes images of other nodes; not all report that, and they exist without a camera, too."""
        return self._driver in _SIGNAL_PROCESSORS

    @property
    def buffer_type(self) -> int:
        """``VIDEO_CAPTURE``, or ``VIDEO_CAPTURE_MPLANE`` where the device knows only that."""
        return VIDEO_CAPTURE if self.caps & CAP_VIDEO_CAPTURE else VIDEO_CAPTURE_MPLANE

    @property
    def _captures(self) -> bool:
        return self.caps & (CAP_VIDEO_CAPTURE | CAP_VIDEO_CAPTURE_MPLANE) != 0

    def ask(self, request: int, argument: Argument) -> Argument:
        """The argument as the kernel left it. Raises ``OSError``."""
        return self._kernel.ioctl(self._fd, request, argument)

    def map(self, length: int, offset: int) -> mmap.mmap:
        """The memory of a buffer. Raises ``OSError``."""
        return self._kernel.map(self._fd, length, offset)

    def poll(self, timeout_s: float) -> int:
        """Wait for a filled buffer; return the poll(2) events, 0 after the timeout. Raises ``OSError``."""
        return self._kernel.poll(self._fd, timeout_s)

    def close(self) -> None:
        """Let the file go. Raises ``OSError``."""
        self._kernel.close(self._fd)
