"""Folders of images and videos: order, stamps, and what is refused."""

import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.samples import Frame
from lcf_edge.config import Config
from lcf_edge.errors import RecordingError
from lcf_edge.recording.read import open_recording
from lcf_edge.recording.read.images import natural_order
from tests.emulation import needs_the_processor

Read = Callable[..., tuple[Any, list[Any]]]
MAX_MIB = 110
COUNTS_MEMORY = needs_the_processor("the emulator's own memory counts")


@pytest.fixture
def video(tmp_path: Path) -> Path:
    """40 images of 64x48 at 25/s, whose brightness rises."""
    path = tmp_path / "drive.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (64, 48))
    for index in range(40):
        writer.write(np.full((48, 64, 3), 5 * index, np.uint8))
    writer.release()
    return path


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".tif", ".tiff", ".PNG"])
def test_a_folder_of_images_is_read_in_natural_order(tmp_path: Path, read: Read, suffix: str) -> None:
    for index in (1, 2, 10):
        cv2.imwrite(str(tmp_path / f"ga_{index}{suffix}"), np.full((48, 64), 10 * index, np.uint8))
    (tmp_path / "notes.txt").write_text("not an image")
    recording, items = read(tmp_path, fps=4.0)
    assert [frame.stamp_ns for frame in items] == [0, 250_000_000, 500_000_000]
    assert [round(float(frame.image.mean()), -1) for frame in items] == [10, 20, 100]
    assert (recording.frame_count, recording.has_imu, recording.has_speed, recording.lens) == (
        3,
        False,
        False,
        None,
    )
    assert "camera.intrinsics" in recording.warnings[0]


def test_colour_becomes_luminance(tmp_path: Path, read: Read) -> None:
    cv2.imwrite(str(tmp_path / "1.png"), np.full((4, 4, 3), (0, 0, 255), np.uint8))
    _, (frame,) = read(tmp_path)
    assert (frame.image.shape, frame.image.dtype, frame.image[0, 0]) == ((4, 4), np.uint8, 76)


def test_sixteen_bit_images_become_eight_bit(tmp_path: Path, read: Read) -> None:
    cv2.imwrite(str(tmp_path / "1.png"), np.full((4, 4), 0x80FF, np.uint16))
    _, (frame,) = read(tmp_path)
    assert (frame.image.dtype, frame.image[0, 0]) == (np.uint8, 0x80)


@given(st.lists(st.tuples(st.sampled_from(["a", "b_", "é"]), st.integers(0, 10**20)), min_size=2))
def test_numbers_in_names_count_as_numbers(names: list[tuple[str, int]]) -> None:
    ordered = sorted((f"{stem}{number}.png" for stem, number in names), key=natural_order)
    for stem in ("a", "b_", "é"):
        numbers = [int(name[len(stem) : -4]) for name in ordered if name.startswith(stem)]
        if max(numbers, default=0) < 10**18:
            assert numbers == sorted(numbers)


def test_a_broken_image_is_skipped_and_keeps_its_time(tmp_path: Path, read: Read) -> None:
    for index in range(3):
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.zeros((48, 64), np.uint8))
    (tmp_path / "1.png").write_bytes((tmp_path / "1.png").read_bytes()[:40])
    recording, items = read(tmp_path, fps=10.0)
    assert [(frame.seq, frame.stamp_ns) for frame in items] == [(0, 0), (2, 200_000_000)]
    assert recording.skipped == {"image damaged": 1}


def test_a_video_has_its_own_rate(video: Path, read: Read) -> None:
    recording, items = read(video)
    assert [frame.stamp_ns for frame in items] == [40_000_000 * index for index in range(40)]
    assert {(type(frame), frame.image.shape, frame.image.dtype) for frame in items} == {
        (Frame, (48, 64), np.dtype("u1"))
    }
    assert (np.abs([float(frame.image.mean()) - 5 * frame.seq for frame in items]) < 3).all()
    assert recording.frame_count == 40
    assert len(recording.warnings) == 1, "only that nothing is known of the lens"


def test_a_video_has_the_rate_that_is_configured(video: Path, read: Read) -> None:
    _, items = read(video, fps=10.0)
    assert items[-1].stamp_ns == 3_900_000_000


def test_a_video_can_be_read_again(video: Path) -> None:
    recording = open_recording(video, Config())
    assert [frame.stamp_ns for frame in recording] == [frame.stamp_ns for frame in recording]


def test_a_damaged_video_is_read_up_to_the_damage(video: Path, read: Read, capfd: pytest.CaptureFixture[str]) -> None:
    data = video.read_bytes()
    video.write_bytes(data[: len(data) // 2])
    recording, items = read(video)
    assert 0 < len(items) < 40
    assert recording.warnings[-1] == f"{video}: damaged, ends after {len(items)} of 40 images"
    assert capfd.readouterr() == ("", "")


def lying(path: Path, width: int, height: int) -> None:
    """Let the header of an AVI file state another size, px."""
    data = bytearray(path.read_bytes())
    struct.pack_into("<II", data, data.find(b"avih") + 40, width, height)
    struct.pack_into("<ii", data, data.find(b"strf") + 12, width, height)
    path.write_bytes(data)


REPLAY = (
    "import resource, subprocess, sys\n"
    "done = subprocess.run([sys.executable, '-m', 'lcf_edge', 'replay', sys.argv[1]], capture_output=True, text=True)\n"
    "print(done.returncode, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024)\n"
    "print(done.stderr)"
)


def replayed(path: Path) -> tuple[int, int, str]:
    """Exit status, peak of memory in MiB, and what was said."""
    done = subprocess.run([sys.executable, "-c", REPLAY, path], check=True, capture_output=True, text=True)
    numbers, _, said = done.stdout.partition("\n")
    status, peak_mib = map(int, numbers.split())
    return status, peak_mib, said


@COUNTS_MEMORY
def test_a_header_that_claims_gigabytes_takes_none(video: Path) -> None:
    lying(video, 32_000, 32_000)
    status, peak_mib, said = replayed(video)
    assert (status, "Traceback" in said) == (0, False)
    assert peak_mib < MAX_MIB


@COUNTS_MEMORY
def test_images_larger_than_the_header_says_are_refused_before_they_take_memory(tmp_path: Path) -> None:
    path = tmp_path / "drive.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25, (9000, 4000))
    writer.write(np.zeros((4000, 9000, 3), np.uint8))
    writer.release()
    lying(path, 64, 48)
    status, peak_mib, said = replayed(path)
    assert (status, said) == (1, f"lcf-edge: {path}: images are too large (9000x4000 px); scale the video\n\n")
    assert peak_mib < MAX_MIB


def filmed(path: Path, size: tuple[int, int], frames: int) -> bytes:
    """A stream that another one can follow in the same file."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MPG2"), 25, size)
    for index in range(frames):
        writer.write(np.full((size[1], size[0], 3), 9 * index, np.uint8))
    writer.release()
    return path.read_bytes()


@needs_the_processor("the emulator ignores limits of memory (RLIMIT_DATA)")
@pytest.mark.parametrize("suffix", [".ts", ".mpg"])
def test_a_later_image_that_is_larger_than_the_first_takes_no_memory(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], suffix: str
) -> None:
    small, large = (filmed(tmp_path / f"{n}{suffix}", *one) for n, one in enumerate([((64, 48), 6), ((4000, 3000), 3)]))
    path = tmp_path / f"drive{suffix}"
    path.write_bytes(small)
    capfd.readouterr()
    status, small_peak_mib, _ = replayed(path)
    assert status == 0
    path.write_bytes(small + large)
    status, peak_mib, said = replayed(path)
    assert status == 0
    assert f"{path}: image 5 is damaged, or larger than the first; the video ends there" in said
    assert peak_mib < small_peak_mib + 40


def test_later_images_of_another_size_are_scaled_to_the_first(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], read: Read
) -> None:
    path = tmp_path / "drive.mpg"
    path.write_bytes(filmed(tmp_path / "1.mpg", (64, 48), 6) + filmed(tmp_path / "2.mpg", (128, 96), 6))
    capfd.readouterr()
    recording, items = read(path)
    assert len(items) >= 10
    assert {frame.image.shape for frame in items} == {(48, 64)}
    assert not any("damaged" in warning for warning in recording.warnings)


@pytest.mark.parametrize("name", ["film.mp4", "film.avi", "film.mkv"])
@pytest.mark.parametrize("content", [b"this is a text\n" * 50, b"", b"\0" * 5000])
def test_what_is_no_video_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, content: bytes
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=rf"{name}: not a video that can be decoded; convert it"):
        open_recording(tmp_path / name, Config())
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (Path.exists, "no such file or folder"),
        (Path.mkdir, "empty folder"),
        (lambda path: (path.mkdir(), (path / "notes.txt").write_text("")), "no images in it"),
        (lambda path: path.write_text("hello"), "not a recording"),
    ],
    ids=["missing", "empty folder", "no images", "text"],
)
def test_what_is_no_recording_is_refused_in_one_line(tmp_path: Path, make: Callable[[Path], Any], message: str) -> None:
    path = tmp_path / "drive"
    make(path)
    with pytest.raises(RecordingError) as caught:
        open_recording(path, Config())
    assert str(caught.value).startswith(f"{path}: {message}; ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["drive" * 1000, "drive\0"])
def test_a_path_that_cannot_be_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(RecordingError, match=r"cannot be read|no such file"):
        open_recording(tmp_path / name, Config())


def test_real_images(data_folder: Path, read: Read) -> None:
    recording, items = read(data_folder / "authors-rig-2020")
    assert len(items) == recording.frame_count == 37
    assert {frame.image.shape for frame in items} == {(480, 640)}
    assert not recording.skipped
