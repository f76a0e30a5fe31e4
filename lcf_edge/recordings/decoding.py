"""From the bytes of a picture to luminance, with its size known before memory is taken for it."""

import os
import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.cdr import Image
from lcf_edge.errors import LcfError

Grey = npt.NDArray[np.uint8]
"""(height, width) luminance."""

MAX_PIXELS = 64_000_000
MAX_FILE_BYTES = 256 * 2**20

_COLOUR = {"rgb8": cv2.COLOR_RGB2GRAY, "bgr8": cv2.COLOR_BGR2GRAY, "8uc3": cv2.COLOR_BGR2GRAY}
_LUMINANCE_OFFSET = {"yuyv": 0, "yuv422_yuy2": 0, "uyvy": 1, "yuv422": 1}  # every second byte is Y

RAW_ENCODINGS = {"mono8": 1, "8uc1": 1} | dict.fromkeys(_COLOUR, 3) | dict.fromkeys(_LUMINANCE_OFFSET, 2)
"""Encodings of ``sensor_msgs/msg/Image`` (in lower case) that can be read, and their bytes a pixel."""

os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # quiet: what went wrong is told once, by us
_set_log_level = getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel  # moved in OpenCV 5
_set_log_level(0)


class PictureError(LcfError):
    """A picture that cannot be used; the text says why in two or three words, for counting."""


def read_picture(path: Path) -> Grey:
    """Luminance of a picture file (png, jpeg, bmp, pgm/ppm, tiff). Raises ``PictureError``."""
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise PictureError("too large")
        return decode_picture(path.read_bytes())
    except FileNotFoundError as error:
        raise PictureError("missing") from error
    except OSError as error:
        raise PictureError("unreadable") from error


def decode_picture(data: bytes | memoryview) -> Grey:
    """Luminance of an encoded picture (png, jpeg, bmp, pgm/ppm, tiff).

    The size comes from the header first: a small file can decode to gigabytes. Raises ``PictureError``.
    """
    if not len(data):
        raise PictureError("empty")
    try:
        width, height = _size(bytes(data))
    except (struct.error, IndexError) as error:
        raise PictureError("damaged") from error
    check_size(width, height)
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE)
    except cv2.error as error:
        raise PictureError("damaged") from error
    if image is None:
        raise PictureError("damaged")
    return np.asarray(image, np.uint8)


def raw_picture(image: Image) -> Grey:
    """Luminance of a ``sensor_msgs/msg/Image``, copied out of its payload. Raises ``PictureError``."""
    encoding = image.encoding.lower()
    if encoding not in RAW_ENCODINGS:
        raise PictureError("of unsupported encoding")
    check_size(image.width, image.height)
    row = image.width * RAW_ENCODINGS[encoding]
    if image.step < row or len(image.data) < image.step * image.height:
        raise PictureError("shorter than its size")
    rows = np.frombuffer(image.data, np.uint8, image.step * image.height).reshape(image.height, image.step)
    pixels = rows[:, :row]
    if encoding in _COLOUR:
        colour = np.ascontiguousarray(pixels).reshape(image.height, image.width, 3)
        return np.asarray(cv2.cvtColor(colour, _COLOUR[encoding]), np.uint8)
    if encoding in _LUMINANCE_OFFSET:
        return pixels[:, _LUMINANCE_OFFSET[encoding] :: 2].copy()
    return pixels.copy()


def check_size(width: int, height: int) -> None:
    """Refuse an empty or absurd picture size with ``PictureError``."""
    if min(width, height) < 1:
        raise PictureError("empty")
    if width * height > MAX_PIXELS:
        raise PictureError("too large")


def _size(data: bytes) -> tuple[int, int]:
    """Width and height as the header tells them."""
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return _png_size(data)
    if data.startswith(b"\xff\xd8"):
        return _jpeg_size(data)
    if data.startswith(b"BM"):
        width, height = struct.unpack_from("<ii", data, 18)
        return abs(width), abs(height)
    if data.startswith((b"II*\0", b"MM\0*")):
        return _tiff_size(data)
    if netpbm := re.match(rb"P[1-6]((?:\s+(?:#[^\n]*\n\s*)*)(\d{1,9})){2}\s", data[:4096]):
        width, height = re.sub(rb"#[^\n]*\n", b" ", netpbm.group(0)[2:]).split()
        return int(width), int(height)
    raise PictureError("of unknown format")


def _png_size(data: bytes) -> tuple[int, int]:
    """Checks every chunk too: the decoder would fill up what is missing and call it a picture."""
    at = 8
    while data[at + 4 : at + 8] != b"IEND":
        (length,) = struct.unpack_from(">I", data, at)
        (crc,) = struct.unpack_from(">I", data, at + 8 + length)
        if zlib.crc32(data[at + 4 : at + 8 + length]) != crc:
            raise PictureError("damaged")
        at += 12 + length
    return struct.unpack_from(">II", data, 16)


def _jpeg_size(data: bytes) -> tuple[int, int]:
    if b"\xff\xd9" not in data[-1024:]:
        raise PictureError("damaged")  # cut off before its end marker
    at = 2
    while data[at] == 0xFF:
        marker, length = struct.unpack_from(">BH", data, at + 1)
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):  # start of frame
            height, width = struct.unpack_from(">HH", data, at + 5)
            return width, height
        at += 2 + length
    raise PictureError("damaged")


def _tiff_size(data: bytes) -> tuple[int, int]:
    order = "<" if data.startswith(b"II") else ">"
    tags = dict(_tiff_tags(data, order))
    return tags.get(256, 0), tags.get(257, 0)


def _tiff_tags(data: bytes, order: str) -> Iterator[tuple[int, int]]:
    (directory,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, directory)
    for at in range(directory + 2, directory + 2 + 12 * count, 12):
        tag, kind = struct.unpack_from(f"{order}HH", data, at)
        (value,) = struct.unpack_from(order + ("H" if kind == 3 else "I"), data, at + 8)
        yield tag, value
