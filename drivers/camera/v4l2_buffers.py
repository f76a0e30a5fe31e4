"""The requests that differ between single-planar and multi-planar devices, as one interface.

A multi-planar device (many systems on a chip) may keep the planes of an image in memories of their own. Luminance is
in the first one of all formats that are read, so that only it is mapped.
Source: Linux "Video for Linux API", Single- and multi-planar APIs; ``struct v4l2_plane``.
"""

import ctypes
from dataclasses import dataclass
from typing import Protocol

from drivers.camera.v4l2_ioctl import (
    DQBUF,
    FIELD_NONE,
    MAX_PLANES,
    MEMORY_MMAP,
    QBUF,
    QUERYBUF,
    S_FMT,
    VIDEO_CAPTURE,
    VIDEO_CAPTURE_MPLANE,
    Buffer,
    Format,
    Node,
    Plane,
    PlanesBuffer,
    PlanesFormat,
    fourcc,
    fourcc_text,
)


@dataclass(frozen=True, slots=True)
class Granted:
    """The format that the device will deliver; ``stride`` 0: unknown."""

    pixel_format: str
    width: int
    height: int
    stride: int
    field: int


@dataclass(frozen=True, slots=True)
class Filled:
    """A buffer with an image: its bytes are ``start`` to ``end`` of its memory."""

    index: int
    start: int
    end: int
    flags: int
    sequence: int
    stamp_ns: int


class Buffers(Protocol):
    """The requests; all raise ``OSError``."""

    def set_format(self, node: Node, pixel_format: str, width: int, height: int) -> Granted:
        """Ask for progressive images; the device grants what it can."""
        ...

    def place(self, node: Node, index: int) -> tuple[int, int]:
        """Length and offset of a buffer, for its mapping."""
        ...

    def queue(self, node: Node, index: int) -> None:
        """Let the device fill it."""
        ...

    def dequeue(self, node: Node) -> Filled:
        """The oldest that is filled."""
        ...


class SinglePlanar:
    """One memory for each image."""

    def set_format(self, node: Node, pixel_format: str, width: int, height: int) -> Granted:
        """Ask for progressive images; the device grants what it can. Raises ``OSError``."""
        requested = Format(
            type=VIDEO_CAPTURE, width=width, height=height, pixelformat=fourcc(pixel_format), field=FIELD_NONE
        )
        got = node.ask(S_FMT, requested)
        return Granted(fourcc_text(got.pixelformat), got.width, got.height, got.bytesperline, got.field)

    def place(self, node: Node, index: int) -> tuple[int, int]:
        """Length and offset of a buffer, for its mapping. Raises ``OSError``."""
        buffer = node.ask(QUERYBUF, Buffer(index=index, type=VIDEO_CAPTURE, memory=MEMORY_MMAP))
        return buffer.length, buffer.offset

    def queue(self, node: Node, index: int) -> None:
        """Let the device fill it. Raises ``OSError``."""
        node.ask(QBUF, Buffer(index=index, type=VIDEO_CAPTURE, memory=MEMORY_MMAP))

    def dequeue(self, node: Node) -> Filled:
        """The oldest that is filled. Raises ``OSError``."""
        buffer = node.ask(DQBUF, Buffer(type=VIDEO_CAPTURE, memory=MEMORY_MMAP))
        return Filled(buffer.index, 0, buffer.bytesused, buffer.flags, buffer.sequence, _stamp_ns(buffer))


class MultiPlanar:
    """A memory for each plane of an image; the first is what counts."""

    def set_format(self, node: Node, pixel_format: str, width: int, height: int) -> Granted:
        """Ask for progressive images; the device grants what it can. Raises ``OSError``."""
        requested = PlanesFormat(
            type=VIDEO_CAPTURE_MPLANE, width=width, height=height, pixelformat=fourcc(pixel_format), field=FIELD_NONE
        )
        got = node.ask(S_FMT, requested)
        return Granted(fourcc_text(got.pixelformat), got.width, got.height, got.planes[0].bytesperline, got.field)

    def place(self, node: Node, index: int) -> tuple[int, int]:
        """Length and offset of a buffer's first plane, for its mapping. Raises ``OSError``."""
        _, plane = _ask(node, QUERYBUF, index)
        return plane.length, plane.offset

    def queue(self, node: Node, index: int) -> None:
        """Let the device fill it. Raises ``OSError``."""
        _ask(node, QBUF, index)

    def dequeue(self, node: Node) -> Filled:
        """The oldest that is filled. Raises ``OSError``."""
        buffer, plane = _ask(node, DQBUF, 0)
        stamp_ns = _stamp_ns(buffer)
        return Filled(buffer.index, plane.data_offset, plane.bytesused, buffer.flags, buffer.sequence, stamp_ns)


def buffers_of(node: Node) -> Buffers:
    """What the node understands."""
    return MultiPlanar() if node.buffer_type == VIDEO_CAPTURE_MPLANE else SinglePlanar()


def _ask(node: Node, request: int, index: int) -> tuple[PlanesBuffer, Plane]:
    """The buffer as the device left it, and its first plane."""
    planes = (Plane * MAX_PLANES)()
    buffer = PlanesBuffer(
        index=index,
        type=VIDEO_CAPTURE_MPLANE,
        memory=MEMORY_MMAP,
        planes=ctypes.addressof(planes),
        length=MAX_PLANES,
    )
    return node.ask(request, buffer), planes[0]


def _stamp_ns(buffer: Buffer | PlanesBuffer) -> int:
    return int(buffer.seconds) * 1_000_000_000 + int(buffer.microseconds) * 1_000
