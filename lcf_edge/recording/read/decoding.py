"""From encoded bytes to luminance; the size is checked before memory is allocated for it."""

import os
import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from drivers.camera.jpeg import jpeg_header
from lcf_edge.cdr import Image
from lcf_edge.errors import LcfError
from lcf_edge.image_limit import MAX_PIXELS

Grey = npt.NDArray[np.uint8]
"""(height, width) luminance."""

MAX_FILE_BYTES = 256 * 2**20

_COLOUR = {"rgb8": cv2.COLOR_RGB2GRAY, "bgr8": cv2.COLOR_BGR2GRAY, "8uc3": cv2.COLOR_BGR2GRAY}
_LUMINANCE_OFFSET = {"yuyv": 0, "yuv422_yuy2": 0, "uyvy": 1, "yuv422": 1}  # every second byte is Y

RAW_ENCODINGS = {"mono8": 1, "8uc1": 1} | dict.fromkeys(_COLOUR, 3) | dict.fromkeys(_LUMINANCE_OFFSET, 2)
"""Encodings of ``sensor_msgs/msg/Image`` (in lower case) that can be read, and their bytes a pixel."""

_PNG_CHUNKS = frozenset((b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND", b"eXIf"))
_MAX_SCANS = 100  # of a JPEG: each costs a pass over the image
_BMP_HEADER = 40  # bytes
_COMMENT = rb"(?:\s+(?:#[^\r\n]*[\r\n]\s*)*)"
_NETPBM = re.compile(rb"P[1-6]" + _COMMENT + rb"(\d{1,9})" + _COMMENT + rb"(\d{1,9})\s")
_TIFF_NUMBERS = {3: "H", 4: "I"}  # the type of a tag's value
_TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_SAMPLES, _TIFF_ROWS_PER_STRIP = 256, 257, 277, 278
_TIFF_TILE_WIDTH, _TIFF_TILE_HEIGHT = 322, 323
_TIFF_SIZES = frozenset(
    (_TIFF_WIDTH, _TIFF_HEIGHT, _TIFF_SAMPLES, _TIFF_ROWS_PER_STRIP, _TIFF_TILE_WIDTH, _TIFF_TILE_HEIGHT)
)
_TIFF_ALL_ROWS = 2**32 - 1
_MAX_TIFF_STRIP = 128 * 2**20  # bytes

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # quiet: we report errors once
_set_log_level = getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel  # moved in OpenCV 5
_set_log_level(0)


class ImageDecodeError(LcfError):
    """An image that cannot be used; the text says why in two or three words, for counting."""


def read_image(path: Path) -> Grey:
    """Luminance of an image file (png, jpeg, bmp, pgm/ppm, tiff). Raises ``ImageDecodeError``."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise ImageDecodeError("too large")
        return image_from_bytes(path.read_bytes())
    except FileNotFoundError as error:
        raise ImageDecodeError("missing") from error
    except OSError as error:
        raise ImageDecodeError("unreadable") from error


def image_from_bytes(data: bytes | memoryview) -> Grey:
    """Luminance of an encoded image (png, jpeg, bmp, pgm/ppm, tiff).

    The size is checked first, in the header as the decoder will read it: a small file can decode to gigabytes.
    Raises ``ImageDecodeError``.
    """
    if not len(data):
        raise ImageDecodeError("empty")
    content = bytes(data)
    try:
        (width, height), content = _checked(content)
    except (struct.error, IndexError) as error:
        raise ImageDecodeError("damaged") from error
    check_size(width, height)
    try:
        image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)
    except cv2.error as error:
        raise ImageDecodeError("damaged") from error
    if image is None or sorted(image.shape) != sorted((width, height)):
        raise ImageDecodeError("damaged")
    return np.asarray(image, np.uint8)


def image_from_message(image: Image) -> Grey:
    """Luminance of a ``sensor_msgs/msg/Image``, copied out of its payload. Raises ``ImageDecodeError``."""
    encoding = image.encoding.lower()
    if encoding not in RAW_ENCODINGS:
        raise ImageDecodeError("of unsupported encoding")
    check_size(image.width, image.height)
    row = image.width * RAW_ENCODINGS[encoding]
    if image.step < row or len(image.data) < image.step * image.height:
        raise ImageDecodeError("shorter than its size")
    rows = np.frombuffer(image.data, np.uint8, image.step * image.height).reshape(image.height, image.step)
    pixels = rows[:, :row]
    if encoding in _COLOUR:
        colour = np.ascontiguousarray(pixels).reshape(image.height, image.width, 3)
        return np.asarray(cv2.cvtColor(colour, _COLOUR[encoding]), np.uint8)
    if encoding in _LUMINANCE_OFFSET:
        return pixels[:, _LUMINANCE_OFFSET[encoding] :: 2].copy()
    return pixels.copy()


def check_size(width: int, height: int) -> None:
    """Refuse an empty or absurd image size with ``ImageDecodeError``."""
    if min(width, height) < 1:
        raise ImageDecodeError("empty")
    if width * height > MAX_PIXELS:
        raise ImageDecodeError("too large")


def _checked(data: bytes) -> tuple[tuple[int, int], bytes]:
    """Return width and height by the header, and the part of ``data`` that the decoder needs."""
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return _png(data)
    if data.startswith(b"\xff\xd8"):
        return _jpeg_size(data), data
    if data.startswith(b"BM"):
        header, width, height = struct.unpack_from("<Iii", data, 14)
        if header < _BMP_HEADER:  # older headers have sizes elsewhere
            raise ImageDecodeError("of unknown format")
        return (abs(width), abs(height)), data
    if data.startswith((b"II*\0", b"MM\0*")):
        return _tiff_size(data), data
    if netpbm := _NETPBM.match(data[:4096]):
        return (int(netpbm[1]), int(netpbm[2])), data
    raise ImageDecodeError("of unknown format")


def _png(data: bytes) -> tuple[tuple[int, int], bytes]:
    """Check every chunk, because the decoder would invent what is missing.

    Only chunks of the image itself are passed on: texts and profiles unpack to megabytes, an animation has images of
    other sizes.
    """
    if data[12:16] != b"IHDR":
        raise ImageDecodeError("damaged")
    parts = [data[:8]]
    at, kind = 8, b""
    while kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", data, at)
        (crc,) = struct.unpack_from(">I", data, at + 8 + length)
        if zlib.crc32(data[at + 4 : at + 8 + length]) != crc or (kind == b"IHDR") != (at == 8):
            raise ImageDecodeError("damaged")
        if kind in _PNG_CHUNKS:
            parts.append(data[at : at + 12 + length])
        at += 12 + length
    return struct.unpack_from(">II", data, 16), b"".join(parts)


def _jpeg_size(data: bytes) -> tuple[int, int]:
    if b"\xff\xd9" not in data[-1024:]:
        raise ImageDecodeError("damaged")  # cut off before its end marker
    header = jpeg_header(data)
    if header is None or data.count(b"\xff\xda", header.data_at) > _MAX_SCANS:
        raise ImageDecodeError("damaged")
    if header.samples > MAX_PIXELS and not header.one_pass:
        raise ImageDecodeError("too large")
    return header.width, header.height


def _tiff_size(data: bytes) -> tuple[int, int]:
    """Check strips or tiles too: each is unpacked whole, at up to 8 bytes a sample."""
    order = "<" if data.startswith(b"II") else ">"
    tags: dict[int, int] = {}
    for tag, value in _tiff_tags(data, order):
        if tag in tags:  # readers differ in which one they use
            raise ImageDecodeError("damaged")
        tags[tag] = value
    width, height = tags.get(_TIFF_WIDTH, 0), tags.get(_TIFF_HEIGHT, 0)
    rows = tags.get(_TIFF_ROWS_PER_STRIP, _TIFF_ALL_ROWS)
    across = tags.get(_TIFF_TILE_WIDTH, width)
    down = tags.get(_TIFF_TILE_HEIGHT, height if rows in {0, _TIFF_ALL_ROWS} else rows)
    if across * down * tags.get(_TIFF_SAMPLES, 1) * 8 > _MAX_TIFF_STRIP:
        raise ImageDecodeError("too large")
    return width, height


def _tiff_tags(data: bytes, order: str) -> Iterator[tuple[int, int]]:
    """Return the tags that give a size, one number each."""
    (directory,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, directory)
    for at in range(directory + 2, directory + 2 + 12 * count, 12):
        tag, kind, values = struct.unpack_from(f"{order}HHI", data, at)
        if tag not in _TIFF_SIZES:
            continue
        if kind not in _TIFF_NUMBERS or values != 1:
            raise ImageDecodeError("damaged")
        (value,) = struct.unpack_from(order + _TIFF_NUMBERS[kind], data, at + 8)
        yield tag, value
