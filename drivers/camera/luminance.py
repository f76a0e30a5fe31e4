"""From the bytes of a buffer to grey, without a way through colours.

GREY is grey already; NV12 begins with a plane of it (Y); YUYV and UYVY carry it in every second byte; MJPG is decoded
to its Y component.
Source: Linux "Video for Linux API", Image Formats; ITU-T T.81 (JPEG), annex B, for the markers.
"""

import re

import cv2
import numpy as np
import numpy.typing as npt

from drivers.camera.jpeg import jpeg_header
from drivers.errors import DriverError

Grey = npt.NDArray[np.uint8]
"""(height, width) luminance."""

PIXEL_FORMATS = ("GREY", "NV12", "YUYV", "UYVY", "MJPG")
"""What can be read, the cheapest first."""

_RAW = {"GREY": (1, 0), "NV12": (1, 0), "YUYV": (2, 0), "UYVY": (2, 1)}  # bytes a pixel of the rows with Y, offset of Y
_MARKER = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")  # one that cannot be within entropy-coded data


class FrameError(DriverError):
    """One picture that cannot be used; the text says why in two or three words, for counting."""


def least_stride(pixel_format: str, width: int) -> int:
    """Bytes from one row to the next where the device does not tell; 0 for MJPG."""
    return _RAW[pixel_format][0] * width if pixel_format in _RAW else 0


def luminance(pixel_format: str, data: memoryview, width: int, height: int, stride: int) -> Grey:
    """Grey of its own memory from ``data``, the filled part of a buffer; ``stride``: bytes from one row to the next.

    Raises ``FrameError``: "short", "corrupt", "wrong size".
    """
    if pixel_format == "MJPG":
        return _decode(bytes(data), width, height)
    if len(data) < stride * height:
        raise FrameError("short")
    rows = np.frombuffer(data, np.uint8, stride * height).reshape(height, stride)
    bytes_a_pixel, offset = _RAW[pixel_format]
    return rows[:, offset : bytes_a_pixel * width : bytes_a_pixel].copy()


def _decode(jpeg: bytes, width: int, height: int) -> Grey:
    """The size comes from the header first: a few bytes can decode to gigabytes."""
    if not jpeg:
        raise FrameError("short")
    header = jpeg_header(jpeg)
    if header is None or not header.one_pass:
        raise FrameError("corrupt")
    if (header.width, header.height) != (width, height):
        raise FrameError("wrong size")
    end = _MARKER.search(jpeg, header.data_at)  # the decoder would fill up what is missing and call it a picture
    if end is None or end.group() != b"\xff\xd9":
        raise FrameError("corrupt")
    try:
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise FrameError("corrupt") from error
    if image is None or image.shape != (height, width):
        raise FrameError("corrupt")
    return np.asarray(image, np.uint8)
