"""Decoding: sizes are known before memory is taken, damage is found before it is shown as an image."""

import resource
import struct
import subprocess
import sys
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.cdr import Header, Image
from lcf_edge.image_limit import MAX_PIXELS
from lcf_edge.recording.read.decoding import ImageDecodeError, image_from_bytes, image_from_message

IMAGE = np.random.default_rng(3).integers(0, 256, (30, 41), np.uint8)
SUFFIXES = [".png", ".jpg", ".bmp", ".pgm", ".tif"]


def encoded(suffix: str, image: np.ndarray[tuple[int, ...], np.dtype[np.uint8]] = IMAGE) -> bytes:
    return cv2.imencode(suffix, image)[1].tobytes()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_formats(suffix: str) -> None:
    got = image_from_bytes(encoded(suffix))
    assert (got.shape, got.dtype) == (IMAGE.shape, np.uint8)
    if suffix != ".jpg":
        np.testing.assert_array_equal(got, IMAGE)


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
    with pytest.raises(ImageDecodeError, match="too large"):
        image_from_bytes(_huge(suffix))


# Headers that could be read in two ways: a small image for the check, a large one for the decoder.

SIDE = 20_000


def with_a_size(jpeg: bytes, side: int) -> tuple[bytes, bytes, bytes]:
    """A JPEG whose frame header claims ``side`` x ``side``: what is before it, the header, what is behind."""
    at = jpeg.index(b"\xff\xc0")
    end = at + 2 + int.from_bytes(jpeg[at + 2 : at + 4])
    header = bytearray(jpeg[at:end])
    header[5:9] = struct.pack(">HH", side, side)
    return jpeg[:at], bytes(header), jpeg[end:]


def hidden_behind(prefix: bytes) -> bytes:
    """A JPEG with ``prefix`` before its large frame header: who takes it for a segment lands at a small one."""
    before, large, behind = with_a_size(encoded(".jpg"), SIDE)
    _, small, _ = with_a_size(encoded(".jpg"), 16)
    lead = prefix + large
    passed_over = 2 + int.from_bytes(lead[2:4])
    comment = passed_over - len(lead)  # the decoder passes over the small header with it
    return (
        before + lead + b"\xff\xfe" + struct.pack(">H", comment - 2 + len(small)) + bytes(comment - 4) + small + behind
    )


def tiff(*tags: tuple[int, int, int, int]) -> bytes:
    """A TIFF of one directory and no data; (tag, type, count, value)."""
    entries = b"".join(struct.pack("<HHII", *tag) for tag in tags)
    return b"II*\0" + struct.pack("<IH", 8, len(tags)) + entries + bytes(100)


WIDTH_TAG, HEIGHT_TAG, SAMPLES_TAG, ROWS_TAG, TILE_WIDTH_TAG, TILE_HEIGHT_TAG = 256, 257, 277, 278, 322, 323
SMALL = ((WIDTH_TAG, 4, 1, 16), (HEIGHT_TAG, 4, 1, 16))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (hidden_behind(b"\xff"), "too large"),
        (hidden_behind(b"\xff\xd0"), "damaged"),
        (tiff((WIDTH_TAG, 4, 1, SIDE), (HEIGHT_TAG, 4, 1, SIDE), *SMALL), "damaged"),
        (tiff((WIDTH_TAG, 16, 1, 16), (HEIGHT_TAG, 4, 1, 16)), "damaged"),
        (tiff((WIDTH_TAG, 4, 2, 16), (HEIGHT_TAG, 4, 1, 16)), "damaged"),
        (tiff(*SMALL, (ROWS_TAG, 4, 1, 2**30)), "too large"),
        (tiff(*SMALL, (TILE_WIDTH_TAG, 4, 1, SIDE), (TILE_HEIGHT_TAG, 4, 1, SIDE)), "too large"),
        (tiff(*SMALL, (ROWS_TAG, 4, 1, 16), (SAMPLES_TAG, 4, 1, 2**24)), "too large"),
        (b"P5 #x\r20000 20000 255\n16 16\n255\n" + bytes(1000), "too large"),
        (b"BM" + bytes(12) + struct.pack("<IHHHH", 12, SIDE, SIDE, 1, 8) + bytes(1000), "of unknown format"),
    ],
    ids=[
        "JPEG, fill byte",
        "JPEG, marker without a length",
        "TIFF, tags twice",
        "TIFF, tag of another type",
        "TIFF, two widths",
        "TIFF, rows of a strip",
        "TIFF, tile",
        "TIFF, samples",
        "PGM, comment until a carriage return",
        "BMP, old header",
    ],
)
def test_the_size_is_that_which_the_decoder_will_see(content: bytes, reason: str) -> None:
    with pytest.raises(ImageDecodeError, match=f"^{reason}$"):
        image_from_bytes(content)


DECODED = """
import resource, sys
from lcf_edge.recording.read.decoding import ImageDecodeError, image_from_bytes
def peak_kib():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
data, before = sys.stdin.buffer.read(), peak_kib()
try:
    image_from_bytes(data)
except ImageDecodeError as error:
    print(f"{error},{(peak_kib() - before) // 1024}")
"""


def test_a_tiff_that_states_its_size_twice_takes_no_memory() -> None:
    """The decoder believes the first, who reads all of them the last."""
    whole = cv2.imencode(".tif", np.zeros((SIDE // 2, SIDE // 2), np.uint8))[1].tobytes()
    assert whole.startswith(b"II")
    (directory,) = struct.unpack_from("<I", whole, 4)
    (count,) = struct.unpack_from("<H", whole, directory)
    entries = whole[directory + 2 : directory + 2 + 12 * count]
    small = b"".join(struct.pack("<HHII", *tag) for tag in SMALL)
    twice = struct.pack("<H", count + len(SMALL)) + entries[:24] + small + entries[24:] + bytes(4)
    content = b"II*\0" + struct.pack("<I", len(whole)) + whole[8:] + twice
    done = subprocess.run([sys.executable, "-c", DECODED], input=content, check=True, capture_output=True)
    reason, grown_mib = done.stdout.decode().split(",")
    assert reason == "damaged"
    assert int(grown_mib) < 16


def test_a_progressive_jpeg_is_refused_by_what_its_decoder_keeps() -> None:
    side = 4400
    assert side**2 < MAX_PIXELS < 3 * side**2
    grey = np.zeros((side, side), np.uint8)
    progressive = [
        cv2.IMWRITE_JPEG_PROGRESSIVE,
        1,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
        cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
    ]
    assert image_from_bytes(cv2.imencode(".jpg", grey, progressive)[1].tobytes()).shape == (side, side)
    with pytest.raises(ImageDecodeError, match=r"^too large$"):
        image_from_bytes(cv2.imencode(".jpg", cv2.merge([grey] * 3), progressive)[1].tobytes())


def test_a_jpeg_of_endless_scans_is_refused() -> None:
    jpeg = cv2.imencode(".jpg", IMAGE, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()
    assert image_from_bytes(jpeg).shape == IMAGE.shape
    at = jpeg.rindex(b"\xff\xda")
    with pytest.raises(ImageDecodeError, match=r"^damaged$"):
        image_from_bytes(jpeg[:at] + jpeg[at:-2] * 200 + jpeg[-2:])


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


@pytest.mark.parametrize(
    "extra",
    [
        b"".join(chunk(b"zTXt", b"key%d\0\0" % number + zlib.compress(bytes(7_900_000))) for number in range(20)),
        chunk(b"iCCP", b"profile\0\0" + zlib.compress(bytes(1000))),
        chunk(b"acTL", struct.pack(">II", 5, 0))
        + chunk(b"fcTL", struct.pack(">5I2H2B", 0, SIDE, SIDE, 0, 0, 1, 9, 0, 0)),
    ],
    ids=["texts that unpack to megabytes", "a profile that makes the decoder complain", "an animation"],
)
def test_of_a_png_only_the_image_is_decoded(extra: bytes, capfd: pytest.CaptureFixture[str]) -> None:
    png = encoded(".png")
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    np.testing.assert_array_equal(image_from_bytes(png[:33] + extra + png[33:]), IMAGE)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib < 8 * 1024
    assert capfd.readouterr() == ("", "")


def test_a_png_whose_header_comes_twice_is_damaged() -> None:
    png = encoded(".png")
    with pytest.raises(ImageDecodeError, match=r"^damaged$"):
        image_from_bytes(png[:33] + chunk(b"IHDR", struct.pack(">II5B", SIDE, SIDE, 8, 0, 0, 0, 0)) + png[33:])


def test_the_decoder_has_the_limit_too_in_the_whole_program() -> None:
    """The second line, where a header is read in another way after all."""
    pgm = f"P5 {MAX_PIXELS // 4096 + 1} 4096 255\n"
    script = (
        "from lcf_edge.cli.command_line import main; main(['config'])\n"
        "import cv2, numpy as np\n"
        "try: print(cv2.imdecode(np.frombuffer(bytes.fromhex(%r), np.uint8), 0))\n"
        "except cv2.error as error: print('PIXELS' in str(error))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script % pgm.encode().hex()], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "True"


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_cut_image_is_damaged(suffix: str, capfd: pytest.CaptureFixture[str]) -> None:
    data = encoded(suffix)
    for end in (1, 9, len(data) // 2, len(data) - 5):
        with pytest.raises(ImageDecodeError):
            image_from_bytes(data[:end])
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(data=st.data())
def test_any_damage_gives_an_image_or_an_image_error(suffix: str, data: st.DataObject) -> None:
    content = bytearray(encoded(suffix))
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    said = "an image"
    try:
        got = image_from_bytes(bytes(content[: data.draw(st.integers(0, len(content)))]))
    except ImageDecodeError as error:
        said = str(error)
    else:
        assert (got.dtype, got.ndim) == (np.uint8, 2)
    assert said in {"an image", "damaged", "empty", "too large", "of unknown format"}


@given(st.binary(max_size=200))
def test_any_bytes_give_an_image_error(content: bytes) -> None:
    with pytest.raises(ImageDecodeError):
        image_from_bytes(content)


def image(encoding: str, step: int, data: bytes | bytearray, width: int = 4, height: int = 2) -> Image:
    return Image(Header(0, ""), height, width, encoding, False, step, memoryview(data))


LEVELS = np.arange(0, 200, 25, np.uint8).reshape(2, 4)


@pytest.mark.parametrize("padding", [0, 5])
@pytest.mark.parametrize("encoding", ["mono8", "8UC1", "rgb8", "bgr8", "yuyv", "yuv422_yuy2", "uyvy", "yuv422"])
def test_raw_images_with_and_without_padded_rows(encoding: str, padding: int) -> None:
    chroma = np.full_like(LEVELS, 128)
    layout = {
        "m": LEVELS, "8": LEVELS, "r": np.repeat(LEVELS, 3, axis=1), "b": np.repeat(LEVELS, 3, axis=1),
        "y": np.dstack((LEVELS, chroma)).reshape(2, 8), "u": np.dstack((chroma, LEVELS)).reshape(2, 8),
    }  # fmt: skip
    rows = layout["u" if encoding == "yuv422" else encoding[0]]
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
    payload = bytearray(rows.tobytes())
    got = image_from_message(image(encoding, rows.shape[1], payload))
    payload[:] = bytes(len(payload))  # a frame does not keep its message
    np.testing.assert_array_equal(got, LEVELS)
    assert got.flags.c_contiguous


@pytest.mark.parametrize(("encoding", "grey"), [("rgb8", 76), ("bgr8", 29)])
def test_order_of_colours(encoding: str, grey: int) -> None:
    assert image_from_message(image(encoding, 12, bytes((255, 0, 0)) * 8))[0, 0] == grey


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
def test_raw_images_that_are_refused(encoding: str, size: tuple[int, int], step: int, length: int, reason: str) -> None:
    assert MAX_PIXELS < 8001**2
    with pytest.raises(ImageDecodeError, match=f"^{reason}$"):
        image_from_message(image(encoding, step, bytes(length), *size))
