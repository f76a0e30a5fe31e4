"""From the bytes of a buffer to grey."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.camera.luminance import PIXEL_FORMATS, FrameError, luminance, min_stride
from hil_mocks.v4l2_device import drawn_image, encode

WIDTH, HEIGHT = 64, 48
IMAGE = drawn_image(7, WIDTH, HEIGHT)
BAYER = PIXEL_FORMATS[PIXEL_FORMATS.index("MJPG") + 1 :]
SEPARATE = ("NM12", "NM21", "NM16", "NM61", "YM12", "YM21")  # luminance has a buffer of its own
RAW = tuple(name for name in PIXEL_FORMATS if name not in {"MJPG", *BAYER})
JPEG = encode(IMAGE, "MJPG")


def read(pixel_format: str, data: bytes, padding: int = 0) -> np.ndarray:
    stride = min_stride(pixel_format, WIDTH) + padding
    return luminance(pixel_format, memoryview(data), WIDTH, HEIGHT, stride)


@pytest.mark.parametrize("padding", [0, 32])
@pytest.mark.parametrize("pixel_format", RAW)
def test_raw_formats_give_their_luminance_to_the_bit(pixel_format: str, padding: int) -> None:
    data = encode(IMAGE, pixel_format, padding)
    image = read(pixel_format, data, padding)
    assert np.array_equal(image, IMAGE)
    assert not np.shares_memory(image, np.frombuffer(data, np.uint8))  # the buffer will be filled again
    assert image.flags.c_contiguous


@pytest.mark.parametrize("padding", [0, 32])
@pytest.mark.parametrize("pixel_format", BAYER)
def test_raw_images_of_a_sensor_with_colours_give_weighted_sums(pixel_format: str, padding: int) -> None:
    """Grey stays grey, and red, green and blue weigh as in ITU-R BT.601."""
    grey = np.full((HEIGHT, WIDTH), 120, np.uint8)
    assert np.abs(read(pixel_format, encode(grey, pixel_format, padding), padding) - 120.0).max() <= 1
    first_row = {"B": "BGGR", "G": "GBRG", "g": "GRBG", "R": "RGGB"}
    named = {"BA81": "BGGR", "BYR2": "BGGR", "BA10": "GRBG", "BA12": "GRBG", "GR16": "GRBG", "GRBG": "GRBG"}
    pattern = named.get(pixel_format) or first_row[pixel_format[1 if pixel_format[0] == "p" else 0]]
    for colour, weight in (("R", 0.299), ("G", 0.587), ("B", 0.114)):
        tile = np.array([200 * (filtered == colour) for filtered in pattern], np.uint8).reshape(2, 2)
        seen = read(pixel_format, encode(np.tile(tile, (HEIGHT // 2, WIDTH // 2)), pixel_format, padding), padding)
        assert np.abs(seen[4:-4, 4:-4] - 200 * weight).max() <= 2


@pytest.mark.parametrize("pixel_format", [name for name in RAW if name not in SEPARATE and "P" not in name[1:]])
def test_an_image_may_be_of_any_width(pixel_format: str) -> None:
    image = IMAGE[:, :50]
    data = memoryview(encode(image, pixel_format))
    assert np.array_equal(luminance(pixel_format, data, 50, HEIGHT, min_stride(pixel_format, 50)), image)


@pytest.mark.parametrize("reduction", [2, 4, 8])
def test_a_jpeg_of_a_larger_image_is_decoded_to_the_smaller_one(reduction: int) -> None:
    """As if the large one were decoded and its pixels then averaged."""
    rows, columns = np.mgrid[: HEIGHT * reduction, : WIDTH * reduction] / reduction
    large = (128 + 60 * np.sin(rows / 4) * np.cos(columns / 5)).astype(np.uint8)
    seen = luminance("MJPG", memoryview(encode(large, "MJPG")), WIDTH, HEIGHT, 0, reduction)
    averaged = cv2.resize(large, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    assert np.abs(seen.astype(int) - averaged).mean() < 2
    with pytest.raises(FrameError, match="wrong size"):
        luminance("MJPG", memoryview(JPEG), WIDTH, HEIGHT, 0, reduction)


def test_a_jpeg_of_colours_gives_its_luminance() -> None:
    colour = np.dstack([IMAGE, np.roll(IMAGE, 9, axis=1), IMAGE[:, ::-1]])
    jpeg = bytes(cv2.imencode(".jpg", colour, [cv2.IMWRITE_JPEG_QUALITY, 95])[1])
    difference = cv2.absdiff(read("MJPG", jpeg), cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY))
    assert difference.mean() < 2


def test_a_jpeg_may_be_filled_up_after_its_end() -> None:
    assert np.abs(read("MJPG", JPEG + bytes(500)).astype(int) - IMAGE).max() < 10


def test_a_jpeg_without_huffman_tables_has_the_standard_ones() -> None:
    """As USB cameras send it."""
    at = JPEG.index(b"\xff\xc4")
    bare = JPEG
    while (at := bare.find(b"\xff\xc4")) >= 0:
        bare = bare[:at] + bare[at + 2 + int.from_bytes(bare[at + 2 : at + 4]) :]
    assert np.abs(read("MJPG", bare).astype(int) - IMAGE).max() < 10


def test_a_jpegs_orientation_does_not_turn_the_image() -> None:
    exif = bytes.fromhex("ffe1002245786966000049492a00080000000100120103000100000006000000000000000000")[:36]
    assert read("MJPG", JPEG[:2] + exif + JPEG[2:]).shape == (HEIGHT, WIDTH)


@pytest.mark.parametrize("pixel_format", RAW)
def test_too_few_bytes_are_refused(pixel_format: str) -> None:
    data = encode(IMAGE, pixel_format)
    needed = min_stride(pixel_format, WIDTH) * HEIGHT
    with pytest.raises(FrameError, match="short"):
        read(pixel_format, data[: needed - 1])


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "short"),
        (JPEG[: len(JPEG) // 2], "corrupt"),
        (JPEG[:-2], "corrupt"),
        (JPEG[2:], "corrupt"),
        (b"\xff\xd8" + bytes(1000), "corrupt"),
        (JPEG[: len(JPEG) // 2] + b"\xff\xe1" + JPEG[len(JPEG) // 2 :], "corrupt"),
        (encode(drawn_image(7, 2 * WIDTH, HEIGHT), "MJPG"), "wrong size"),
    ],
    ids=["nothing", "cut off", "without its end", "without its start", "zeros", "a lost packet", "another size"],
)
def test_a_damaged_jpeg_is_refused(data: bytes, reason: str) -> None:
    with pytest.raises(FrameError, match=reason):
        read("MJPG", data)


def test_a_jpeg_that_claims_a_huge_size_takes_no_memory() -> None:
    at = JPEG.index(b"\xff\xc0")
    with pytest.raises(FrameError, match="wrong size"):
        read("MJPG", JPEG[: at + 5] + b"\xff\xff\xff\xff" + JPEG[at + 9 :])


def test_a_jpeg_with_a_huge_size_behind_a_fill_byte_takes_no_memory() -> None:
    """Who takes the fill byte for a marker lands behind the comment, at the header of the wanted size."""
    at = JPEG.index(b"\xff\xc0")
    end = at + 2 + int.from_bytes(JPEG[at + 2 : at + 4])
    huge = b"\xff" + JPEG[at : at + 5] + b"\x7d\x00\x7d\x00" + JPEG[at + 9 : end]
    comment = 2 + int.from_bytes(huge[2:4]) - len(huge)
    behind = b"\xff\xfe" + (comment - 2 + end - at).to_bytes(2) + bytes(comment - 4) + JPEG[at:end]
    with pytest.raises(FrameError, match="wrong size"):
        read("MJPG", JPEG[:at] + huge + behind + JPEG[end:])


def test_a_progressive_jpeg_is_refused() -> None:
    """No camera sends one, and its decoder keeps the whole image several times."""
    jpeg = cv2.imencode(".jpg", IMAGE, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    with pytest.raises(FrameError, match="corrupt"):
        read("MJPG", jpeg)


@given(st.binary(max_size=400), st.integers(0, len(JPEG)), st.sampled_from(PIXEL_FORMATS))
def test_any_bytes_are_an_image_or_refused(rubbish: bytes, at: int, pixel_format: str) -> None:
    try:
        outcome: object = read(pixel_format, JPEG[:at] + rubbish + JPEG[at + len(rubbish) :]).shape
    except FrameError as error:
        outcome = str(error)
    assert outcome in ((HEIGHT, WIDTH), "short", "corrupt", "wrong size")
