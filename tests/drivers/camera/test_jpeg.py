"""The header of a JPEG: read as the decoder reads it, or not at all."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.camera.jpeg import JpegHeader, jpeg_header

WIDTH, HEIGHT = 41, 30
IMAGE = np.random.default_rng(3).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
QUARTER = cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420


def encoded(image: np.ndarray = IMAGE, *parameters: int) -> bytes:
    return cv2.imencode(".jpg", image, parameters)[1].tobytes()


JPEG = encoded()


def decoded_size(jpeg: bytes) -> tuple[int, int] | None:
    """As OpenCV decodes it."""
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    return None if image is None else (image.shape[1], image.shape[0])


@pytest.mark.parametrize(
    ("jpeg", "samples", "one_pass"),
    [
        (encoded(IMAGE[:, :, 0]), WIDTH * HEIGHT, True),
        (encoded(IMAGE, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, QUARTER), 1.5 * WIDTH * HEIGHT, True),
        (encoded(IMAGE, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, QUARTER, cv2.IMWRITE_JPEG_PROGRESSIVE, 1), 1845, False),
    ],
    ids=["grey", "colour", "progressive"],
)
def test_size_and_what_the_decoder_keeps(jpeg: bytes, samples: int, one_pass: bool) -> None:
    header = jpeg_header(jpeg)
    assert header == JpegHeader(WIDTH, HEIGHT, samples, one_pass, header.data_at if header else 0)


def test_fill_bytes_may_stand_before_a_marker() -> None:
    at = JPEG.index(b"\xff\xc0")
    filled = JPEG[:at] + b"\xff" * 5 + JPEG[at:]
    header = jpeg_header(filled)
    assert header
    assert (header.width, header.height) == (WIDTH, HEIGHT) == decoded_size(filled)


@pytest.mark.parametrize("end", [0, 1, 2, 3, 20, 200, JPEG.index(b"\xff\xda") + 1])
def test_a_header_that_is_cut_off_is_none(end: int) -> None:
    assert jpeg_header(JPEG[:end]) is None


@pytest.mark.parametrize("marker", [0x01, 0xC3, 0xC8, 0xCF, 0xD0, 0xD8, 0xD9, 0x02])
def test_what_the_decoder_would_step_over_in_another_way_is_no_header(marker: int) -> None:
    at = JPEG.index(b"\xff\xc0")
    assert jpeg_header(JPEG[:at] + bytes((0xFF, marker, 0, 2)) + JPEG[at:]) is None
    assert jpeg_header(JPEG[:at] + bytes(1) + JPEG[at:]) is None


def test_a_second_frame_is_no_header() -> None:
    at = JPEG.index(b"\xff\xc0")
    end = at + 2 + int.from_bytes(JPEG[at + 2 : at + 4])
    assert jpeg_header(JPEG[:end] + JPEG[at:end] + JPEG[end:]) is None


@given(st.data())
def test_where_there_is_a_header_the_decoder_sees_no_other_size(data: st.DataObject) -> None:
    """Bytes are changed, put in and taken out, of markers above all."""
    jpeg = bytearray(JPEG)
    begin = JPEG.index(b"\xff\xda") + 12
    byte = st.sampled_from((0xFF, 0, 1, 2, 0xC0, 0xC1, 0xC2, 0xC4, 0xD0, 0xD8, 0xDA, 0xDB, 0xDC, 0xFE, 0xE1))
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(2, begin))
        jpeg[at : at + data.draw(st.integers(0, 4))] = bytes(data.draw(st.lists(byte, max_size=4)))
    header, size = jpeg_header(bytes(jpeg)), None
    if header is not None and max(header.width, header.height) < 1000:
        size = decoded_size(bytes(jpeg))
        assert size in {None, (header.width, header.height)}
