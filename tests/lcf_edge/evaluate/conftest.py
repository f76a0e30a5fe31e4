"""A corpus of small rendered drives: with truth, without, and broken."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from lcf_edge.rendered import scenes

BIN = {"name": "bin", "box": [60, 45, 100, 85], "threat": True, "moving": False, "by": "eye"}


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 13 images in which something stands ahead."""
    made = scenes.make("ahead", 1, seconds=0.9, width=160, height=120, focal_px=125.0)
    return scenes.write(made, tmp_path_factory.mktemp("drive") / "yard")


@pytest.fixture(scope="session")
def stamps_ns(drive: Path) -> list[int]:
    """Of its images."""
    return [int(line.split(",")[0]) for line in (drive / "mav0/cam0/data.csv").read_text().splitlines()[1:]]


@pytest.fixture
def corpus(tmp_path: Path, drive: Path, stamps_ns: list[int]) -> Path:
    """A folder of three recordings: one with truth and settings, one without truth, one that is no recording at all."""
    folder = tmp_path / "corpus"
    for name in ("with-truth", "without"):
        (folder / name).mkdir(parents=True)
        (folder / name / "mav0").symlink_to(drive / "mav0")
        (folder / name / "settings").write_text("vehicle.half_width_m=0.3 camera.height_m=0.5\n")
    write_truth(folder / "with-truth" / "truth.jsonl", stamps_ns)
    (folder / "broken.mcap").write_bytes(b"no recording" * 20)
    return folder


def write_truth(path: Path, stamps_ns: list[int]) -> None:
    """A bin in every image."""
    path.write_text("".join(json.dumps({"stamp_ns": stamp, "objects": [BIN]}) + "\n" for stamp in stamps_ns))


@pytest.fixture
def truth_of() -> Callable[[Path, list[int]], None]:
    """Write a file of truth."""
    return write_truth
