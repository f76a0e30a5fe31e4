"""Images without stamps: a video file, or a folder of images in the order of their names."""

import math
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from lcf_edge.config import Camera, Config
from lcf_edge.errors import RecordingError
from lcf_edge.recording.read.decoding import Grey, ImageDecodeError, check_size, read_image
from lcf_edge.recording.read.memory_allowance import MemoryAllowance
from lcf_edge.recording.read.recording import Recording, Sample, UndecodedFrame

IMAGE_SUFFIXES = frozenset((".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".tif", ".tiff"))
VIDEO_SUFFIXES = frozenset(
    (
        ".mp4",
        ".m4v",
        ".mov",
        ".avi",
        ".mkv",
        ".webm",
        ".mpg",
        ".mpeg",
        ".ts",
        ".mjpeg",
        ".mjpg",
        ".wmv",
        ".ogv",
    )
)

_DECODER_BYTES = 32 * 2**20
_BYTES_A_PIXEL = 64  # of the first image: 17 reference images, colours, and a margin
_GRABS_BEYOND = 2  # an image that the decoder refused is reported one or two calls later

FASTEST_FPS = 10_000.0  # a container that claims more is wrong


class ImageFolder(Recording):
    """A folder of images, sorted by name as a person would (2 before 10), at ``camera.fps``.

    Raises ``RecordingError`` and ``OSError``.
    """

    def __init__(self, path: Path, config: Config) -> None:
        super().__init__(path)
        entries = list(path.iterdir())
        self._paths = sorted((p for p in entries if is_image(p)), key=lambda p: natural_order(p.name))
        if not self._paths:
            raise RecordingError(
                f"{path}: {'no images in it' if entries else 'empty folder'}; "
                "wanted are images (png, jpg, bmp, pgm, tif), an mcap file or mav0/cam0/data.csv"
            )
        self.frame_count = len(self._paths)
        self._fps = config.camera.fps
        self._warn_without_lens(config)

    def _items(self) -> Iterator[UndecodedFrame | Sample]:
        for index, path in enumerate(self._paths):
            yield UndecodedFrame(_stamp_ns(index, self._fps), str(path), partial(read_image, path))


class VideoFile(Recording):
    """A video file, at its own rate unless ``camera.fps`` differs from its default.

    A later image may be larger than the first, and the decoder has no limit of its own: its memory is bounded by the
    needs of the first one's size, and the video ends where that is not enough. Raises ``RecordingError``.
    """

    def __init__(self, path: Path, config: Config) -> None:
        super().__init__(path)
        capture = self._open()
        try:
            size = [int(capture.get(key)) for key in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)]
            own_fps, count = capture.get(cv2.CAP_PROP_FPS), capture.get(cv2.CAP_PROP_FRAME_COUNT)
        finally:
            capture.release()
        try:
            check_size(*size)
        except ImageDecodeError as error:
            raise RecordingError(f"{path}: images are {error} ({size[0]}x{size[1]} px); scale the video") from error
        self._decoder_bytes = _DECODER_BYTES + _BYTES_A_PIXEL * size[0] * size[1]
        configured_fps = config.camera.fps
        has_fps = math.isfinite(own_fps) and 0 < own_fps < FASTEST_FPS
        self._fps = own_fps if has_fps and configured_fps == Camera().fps else configured_fps
        if not has_fps:
            self._warn(f"{path}: has no frame rate; camera.fps = {self._fps:g} is used")
        self.frame_count = int(count) if 0 < count < 1e9 else None
        self._warn_without_lens(config)

    def _items(self) -> Iterator[UndecodedFrame | Sample]:
        capture = self._open()
        allowance = MemoryAllowance(self._decoder_bytes)
        index = 0
        try:
            while _grab(capture, allowance):
                read = partial(_retrieve, capture, allowance)
                yield UndecodedFrame(_stamp_ns(index, self._fps), f"{self.path}: image {index}", read)
                index += 1
            if any(_grab(capture, allowance) for _ in range(_GRABS_BEYOND)):
                self._warn(f"{self.path}: image {index} is damaged, or larger than the first; the video ends there")
                return
        except cv2.error as error:
            self._warn(f"{self.path}: damaged after image {index} ({error.err})")
        finally:
            capture.release()
        if self.frame_count is not None and index < self.frame_count - 1:  # containers may count one too many
            self._warn(f"{self.path}: damaged, ends after {index} of {self.frame_count} images")

    def _open(self) -> cv2.VideoCapture:
        in_this_thread = [cv2.CAP_PROP_N_THREADS, 1]
        capture = cv2.VideoCapture(str(self.path), cv2.CAP_ANY, in_this_thread)
        if not capture.isOpened():
            capture.release()
            raise RecordingError(f"{self.path}: not a video that can be decoded; convert it, or check it with a player")
        return capture


def natural_order(name: str) -> list[tuple[int, str]]:
    """Sorting key in which numbers inside a name count as numbers."""
    return [(int(part), "") if part.isdecimal() else (0, part) for part in re.split(r"(\d{1,18})", name)] + [(0, name)]


def _grab(capture: cv2.VideoCapture, allowance: MemoryAllowance) -> bool:
    with allowance.limited():
        return capture.grab()


def _retrieve(capture: cv2.VideoCapture, allowance: MemoryAllowance) -> Grey:
    try:
        with allowance.limited():
            good, image = capture.retrieve()
    except cv2.error as error:  # it was refused memory
        raise ImageDecodeError("too large") from error
    if not good or image is None:
        raise ImageDecodeError("damaged")
    check_size(*image.shape[1::-1])
    return np.asarray(image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def is_image(path: Path) -> bool:
    """Whether a file is one, by its name."""
    return path.suffix.lower() in IMAGE_SUFFIXES and not path.name.startswith(".") and path.is_file()


def _stamp_ns(index: int, fps: float) -> int:
    return round(index * 1e9 / fps)
