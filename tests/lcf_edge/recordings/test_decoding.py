"""Decoding: sizes are known before memory is taken, damage is found before it is shown as a picture."""

import struct
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.cdr import Header, Image
from lcf_edge.recordings.decoding import MAX_PIXELS, PictureError, decode_picture, raw_picture

PICTURE = np.random.default_rng(3).integers(0, 256, (30, 41), np.uint8)
SUFFIXES = [".png", ".jpg", ".bmp", ".pgm", ".tif"]


def encoded(suffix: str, picture: np.ndarray[tuple[int, ...], np.dtype[np.uint8]] = PICTURE) -> bytes:
    return cv2.imencode(suffix, picture)[1].tobytes()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_formats(suffix: str) -> None:
    got = decode_picture(encoded(suffix))
    assert (got.shape, got.dtype) == (PICTURE.shape, np.uint8)
    if suffix != ".jpg":
        np.testing.assert_array_equal(got, PICTURE)


def _huge(suffix: str) -> bytes:
    """A small file whose header claims 60000 x 60000."""
    side = 60_000
    data = bytearray(encoded(suffix))
    if suffix == ".png":
        data[16:24] = struct.pack(">II", side, side)
        data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    elif suffix == ".jpg":
        frame = data.index(b"\xff\xc0")
        data[frame + 5 : frame + 9] = struct.pack(">HH", side, side)
    elif suffix == ".bmp":
        data[18:26] = struct.pack("<ii", side, -side)  # negative: rows from the top
    elif suffix == ".pgm":
        return f"P5\n# made by hand\n{side} {side}\n255\n".encode() + bytes(100)
    else:
        (directory,) = struct.unpack_from("<I", data, 4)
        for at in range(directory + 2, directory + 2 + 24, 12):
            (tag,) = struct.unpack_from("<H", data, at)
            if tag in (256, 257):
                struct.pack_into("<HII", data, at + 2, 4, 1, side)
    return bytes(data)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_an_absurd_size_is_refused_by_its_header(suffix: str) -> None:
    with pytest.raises(PictureError, match="too large"):
        decode_picture(_huge(suffix))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_cut_picture_is_damaged(suffix: str, capfd: pytest.CaptureFixture[str]) -> None:
    data = encoded(suffix)
    for end in (1, 9, len(data) // 2, len(data) - 5):
        with pytest.raises(PictureError):
            decode_picture(data[:end])
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(data=st.data())
def test_any_damage_gives_a_picture_or_a_picture_error(suffix: str, data: st.DataObject) -> None:
    content = bytearray(encoded(suffix))
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    said = "a picture"
    try:
        got = decode_picture(bytes(content[: data.draw(st.integers(0, len(content)))]))
    except PictureError as error:
        said = str(error)
    else:
        assert (got.dtype, got.ndim) == (np.uint8, 2)
    assert said in {"a picture", "damaged", "empty", "too large", "of unknown format"}


@given(st.binary(max_size=200))
def test_any_bytes_give_a_picture_error(content: bytes) -> None:
    with pytest.raises(PictureError):
        decode_picture(content)


def image(encoding: str, step: int, data: bytes | bytearray, width: int = 4, height: int = 2) -> Image:
    return Image(Header(0, ""), height, width, encoding, False, step, memoryview(data))


LEVELS = np.arange(0, 200, 25, np.uint8).reshape(2, 4)


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize("encoding", ["mono8", "8UC1", "rgb8", "bgr8", "yuyv", "yuv422_yuy2", "uyvy", "yuv422"])
def test_raw_pictures_with_and_without_padded_rows(encoding: str, padding: int) -> None:
    chroma = np.full_like(LEVELS, 128)
    layout = {
        "m": LEVELS, "8": LEVELS, "r": np.repeat(LEVELS, 3, axis=1), "b": np.repeat(LEVELS, 3, axis=1),
        "y": np.dstack((LEVELS, chroma)).reshape(2, 8), "u": np.dstack((chroma, LEVELS)).reshape(2, 8),
    }  # fmt: skip
    rows = layout["u" if encoding == "yuv422" else encoding[0]]
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
    payload = bytearray(rows.tobytes())
    got = raw_picture(image(encoding, rows.shape[1], payload))
    payload[:] = bytes(len(payload))  # a frame does not keep its message
    np.testing.assert_array_equal(got, LEVELS)
    assert got.flags.c_contiguous


@pytest.mark.parametrize(("encoding", "grey"), [("rgb8", 76), ("bgr8", 29)])
def test_order_of_colours(encoding: str, grey: int) -> None:
    assert raw_picture(image(encoding, 12, bytes((255, 0, 0)) * 8))[0, 0] == grey


@pytest.mark.parametrize(
    ("encoding", "size", "step", "length", "reason"),
    [
        ("mono8", (4, 2), 4, 7, "shorter than its size"),
        ("mono8", (4, 2), 3, 100, "shorter than its size"),
        ("rgb8", (4, 2), 4, 100, "shorter than its size"),
        ("mono8", (4, 2), 2**32 - 1, 100, "shorter than its size"),
        ("mono8", (8001, 8001), 8001, 100, "too large"),
        ("mono8", (2**32 - 1, 2**32 - 1), 2**32 - 1, 100, "too large"),
        ("mono8", (0, 2), 0, 0, "empty"),
        ("32FC1", (4, 2), 16, 32, "of unsupported encoding"),
    ],
)
def test_raw_pictures_that_are_refused(
    encoding: str, size: tuple[int, int], step: int, length: int, reason: str
) -> None:
    assert MAX_PIXELS < 8001**2
    with pytest.raises(PictureError, match=f"^{reason}$"):
        raw_picture(image(encoding, step, bytes(length), *size))
