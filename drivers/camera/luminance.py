"""Luminance from the bytes of a buffer, without decoding colours where the format allows.

GREY is luminance already; NV12, YU12 and similar begin with a plane of it (Y); YUYV and UYVY carry it in every second
byte; MJPG is decoded to its Y component. Of more than 8 bits the upper 8 are kept. Raw Bayer images and RGB become
weighted sums of their colours (ITU-R BT.601).
Source: Linux "Video for Linux API", Image Formats; ITU-T T.81 (JPEG), annex B, for the markers.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from drivers.camera.jpeg import jpeg_header
from drivers.errors import DriverError

Grey = npt.NDArray[np.uint8]
"""(height, width) luminance."""

REDUCTIONS = {
    1: cv2.IMREAD_GRAYSCALE,
    2: cv2.IMREAD_REDUCED_GRAYSCALE_2,
    4: cv2.IMREAD_REDUCED_GRAYSCALE_4,
    8: cv2.IMREAD_REDUCED_GRAYSCALE_8,
}
"""By how much a JPEG can be made smaller while it is decoded (cheaper than afterwards), and the decoder's flag."""

_MARKER = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")  # one that cannot be within entropy-coded data


@dataclass(frozen=True, slots=True)
class _Layout:
    """``octets`` hold ``pixels`` of a row; ``grey`` copies luminance from rows without padding."""

    octets: int
    pixels: int
    grey: Callable[[Grey], Grey]

    def row(self, width: int) -> int:
        """Bytes of ``width`` pixels."""
        return -(-width // self.pixels) * self.octets


def _packed(octets: int, pixels: int) -> Callable[[Grey], Grey]:
    """MIPI packing: the upper 8 bits of each pixel of a group, then the lower bits of all of them."""

    def grey(rows: Grey) -> Grey:
        uppers = rows.reshape(len(rows), -1, octets)[:, :, :pixels].view(f"u{pixels}")  # each group as one number
        return uppers[:, :, 0].copy().view(np.uint8)

    return grey


def _words(bits: int) -> Callable[[Grey], Grey]:
    """16 bits per pixel, little-endian, the lower ``bits`` used."""
    if bits == 8:
        return lambda rows: rows.view("<u2").astype(np.uint8)  # the upper ones fall away
    return lambda rows: (rows.view("<u2") >> (bits - 8)).astype(np.uint8)


def _colours(code: int, channels: int) -> Callable[[Grey], Grey]:
    return lambda rows: np.asarray(cv2.cvtColor(rows.reshape(len(rows), -1, channels), code), np.uint8)


def _bayer(code: int, raw: Callable[[Grey], Grey]) -> Callable[[Grey], Grey]:
    return lambda rows: np.asarray(cv2.cvtColor(raw(rows), code), np.uint8)


def _as_it_is(rows: Grey) -> Grey:
    return rows


_Y = _Layout(1, 1, np.copy)
_LAYOUTS = {
    "GREY": _Y,
    **dict.fromkeys(("NV12", "NV21", "NV16", "NV61", "YU12", "YV12", "422P"), _Y),
    **dict.fromkeys(("NM12", "NM21", "NM16", "NM61", "YM12", "YM21"), _Y),  # a buffer of its own for each plane
    "Y10P": _Layout(5, 4, _packed(5, 4)),
    "Y12P": _Layout(3, 2, _packed(3, 2)),
    "Y10": _Layout(2, 1, _words(10)),
    "Y12": _Layout(2, 1, _words(12)),
    "Y16": _Layout(2, 1, _words(16)),
    **dict.fromkeys(("YUYV", "YVYU"), _Layout(2, 1, _words(8))),  # words at once: a seventh of the time of each byte
    **dict.fromkeys(("UYVY", "VYUY"), _Layout(2, 1, _words(16))),
    "XR24": _Layout(4, 1, _colours(cv2.COLOR_BGRA2GRAY, 4)),
    "XB24": _Layout(4, 1, _colours(cv2.COLOR_RGBA2GRAY, 4)),
    "BGR3": _Layout(3, 1, _colours(cv2.COLOR_BGR2GRAY, 3)),
    "RGB3": _Layout(3, 1, _colours(cv2.COLOR_RGB2GRAY, 3)),
}
_BAYER = (  # OpenCV's code, and the formats of 8, 10 and 12 bits, 10 and 12 bits packed, 16 bits
    (cv2.COLOR_BayerBGGR2GRAY, ("BA81", "BG10", "BG12", "pBAA", "pBCC", "BYR2")),
    (cv2.COLOR_BayerGBRG2GRAY, ("GBRG", "GB10", "GB12", "pGAA", "pGCC", "GB16")),
    (cv2.COLOR_BayerGRBG2GRAY, ("GRBG", "BA10", "BA12", "pgAA", "pgCC", "GR16")),
    (cv2.COLOR_BayerRGGB2GRAY, ("RGGB", "RG10", "RG12", "pRAA", "pRCC", "RG16")),
)
_RAW = (
    _Layout(1, 1, _as_it_is),
    _LAYOUTS["Y10"],
    _LAYOUTS["Y12"],
    _LAYOUTS["Y10P"],
    _LAYOUTS["Y12P"],
    _LAYOUTS["Y16"],
)
_LAYOUTS |= {
    name: _Layout(raw.octets, raw.pixels, _bayer(code, raw.grey))
    for code, names in _BAYER
    for name, raw in zip(names, _RAW, strict=True)
}

PIXEL_FORMATS = (
    *(name for name in _LAYOUTS if not any(name in names for _, names in _BAYER)),
    "MJPG",
    *(name for _, names in _BAYER for name in names),
)
"""What can be read, by V4L2's four-character code: the cheapest first, raw images, which nothing has exposed, last."""


class FrameError(DriverError):
    """One unusable image; the text is the reason in two or three words, for counting."""


def min_stride(pixel_format: str, width: int) -> int:
    """Return the stride in bytes where the device does not report it; 0 for MJPG."""
    return _LAYOUTS[pixel_format].row(width) if pixel_format in _LAYOUTS else 0


def luminance(pixel_format: str, data: memoryview, width: int, height: int, stride: int, reduction: int = 1) -> Grey:
    """Return a copy of the luminance of ``data``, the filled part of a buffer; ``stride``: bytes per row.

    ``reduction``: factor by which the image in a JPEG is larger, one of ``REDUCTIONS``. Raises ``FrameError``: "short",
    "corrupt", "wrong size".
    """
    if pixel_format == "MJPG":
        return _decode(bytes(data), width, height, reduction)
    if len(data) < stride * height:
        raise FrameError("short")
    layout = _LAYOUTS[pixel_format]
    rows = np.frombuffer(data, np.uint8, stride * height).reshape(height, stride)
    grey = layout.grey(rows[:, : layout.row(width)])
    return grey if grey.shape[1] == width else grey[:, :width].copy()


def _decode(jpeg: bytes, width: int, height: int, reduction: int) -> Grey:
    """Decode a JPEG, after checking the size in its header: a few bytes can decode to gigabytes."""
    if not jpeg:
        raise FrameError("short")
    header = jpeg_header(jpeg)
    if header is None or not header.one_pass:
        raise FrameError("corrupt")
    if (header.width, header.height) != (width * reduction, height * reduction):
        raise FrameError("wrong size")
    end = _MARKER.search(jpeg, header.data_at)  # the decoder would fill in a truncated image
    if end is None or end.group() != b"\xff\xd9":
        raise FrameError("corrupt")
    try:
        image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), REDUCTIONS[reduction] | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error as error:
        raise FrameError("corrupt") from error
    if image is None or image.shape != (height, width):
        raise FrameError("corrupt")
    return np.asarray(image, np.uint8)
