"""The documents, and a folder in which the examples that they give can be run."""

import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

ROOT = Path(__file__).parents[2]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="session")
def text() -> Callable[[str], str]:
    """A document, by its path in the project."""
    return lambda document: (ROOT / document).read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def blocks(text: Callable[[str], str]) -> Callable[[str, str], list[str]]:
    """The fenced blocks of one language in a document."""
    return lambda document, language: [body for name, body in FENCE.findall(text(document)) if name == language]


@pytest.fixture(scope="session")
def rows(text: Callable[[str], str]) -> Callable[[str, str], list[list[str]]]:
    """The cells of the first table under a heading of a document, without its head."""

    def read(document: str, heading: str) -> list[list[str]]:
        table = re.search(r"^\|[^\n]*\n\|[-|]+\n((?:\|[^\n]*\n?)+)", text(document).split(f"\n{heading}\n", 1)[1], re.M)
        assert table
        return [[cell.strip() for cell in row.strip("|").split("|")] for row in table[1].splitlines()]

    return read


@pytest.fixture(scope="session")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the examples name: the demo's output, and its drive as a recording of each kind."""
    place = tmp_path_factory.mktemp("place")
    demo = (sys.executable, "-m", "lcf_edge", "demo", "--out", "demo-out", "--seconds", "2")
    subprocess.run(demo, cwd=place, check=True, capture_output=True)
    (place / "samples").symlink_to(ROOT / "samples")
    (place / "drive").symlink_to(place / "demo-out/recording")
    (place / "images").symlink_to(place / "drive/mav0/cam0/data")
    files = sorted((place / "images").iterdir())[::4]
    pictures = [np.asarray(cv2.imread(str(file))) for file in files]
    height, width, _ = pictures[0].shape
    video = cv2.VideoWriter(str(place / "drive.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 5.0, (width, height))
    for image in pictures:
        video.write(image)
    video.release()
    _write_bag(place / "drive.mcap", files)
    return place


def _write_bag(path: Path, files: list[Path]) -> None:
    kind = "sensor_msgs/msg/CompressedImage"
    writer = Writer(str(path))
    writer.start(profile="ros2")
    channel = writer.register_channel("/camera/compressed", "cdr", writer.register_schema(kind, "ros2msg", b""))
    for stamp_ns, payload in _messages(files, kind):
        writer.add_message(channel, stamp_ns, payload, stamp_ns)
    writer.finish()


def _messages(files: list[Path], kind: str) -> Iterator[tuple[int, bytes]]:
    ros = get_typestore(Stores.ROS2_HUMBLE)
    for file in files:
        sec, nanosec = divmod(int(file.stem), 10**9)
        stamp = ros.types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        header = ros.types["std_msgs/msg/Header"](stamp=stamp, frame_id="camera")
        message = ros.types[kind](header=header, format="png", data=np.frombuffer(file.read_bytes(), np.uint8))
        yield int(file.stem), bytes(ros.serialize_cdr(message, kind))
