"""What degrades the scenes is reported in words."""

import re
from pathlib import Path

import numpy as np
import pytest

from drivers.samples import Frame
from lcf_edge.config import Config, Filter, Imu
from lcf_edge.daemon.degrade import Degradation
from lcf_edge.messages import CIRCLE, PSI_REGION, PipelineScene, Sizes

MS = 1_000_000
REPLAY = Path(__file__).parents[3] / "docs/replay.md"
NOTES = re.findall(
    r"^\| `([a-z ]+)` \|", REPLAY.read_text(encoding="utf-8").split("\n### Notes\n")[1].split("\n## ")[0], re.M
)
SAID_OTHERWISE = {"first frame", "repeated picture", "stands still", "rotation from pictures", "no corners", "dark"}
"""Notes that cost nothing, or that the daemon reports after half a second."""


def scene(seq: int, *, corners: int = 500, speed_mps: float = 1.0, notes: tuple[str, ...] = ()) -> PipelineScene:
    none = np.zeros(0, CIRCLE), np.zeros(0, PSI_REGION)
    return PipelineScene(0, seq, 640, 480, speed_mps, *none, sizes=Sizes(corners=corners), notes=notes)


def frame(stamp_ms: int, grey: int = 120) -> Frame:
    return Frame(stamp_ms * MS, 0, np.full((480, 640), grey, np.uint8))


def test_all_is_well() -> None:
    degradation = Degradation(Config())
    for seq in range(30):
        degradation.add(frame(33 * seq), scene(seq))
        assert not degradation.notes


@pytest.mark.parametrize(("grey", "word"), [(5, "dark: "), (180, "blind: ")])
def test_a_dark_or_covered_lens_is_reported_after_half_a_second_and_until_it_sees(grey: int, word: str) -> None:
    degradation = Degradation(Config())
    degradation.add(frame(0), scene(0))
    degradation.add(frame(400, grey), scene(1, corners=0, speed_mps=0))
    assert not degradation.notes
    degradation.add(frame(500, grey), scene(2, corners=0, speed_mps=0))
    assert degradation.notes[0].startswith(word)
    degradation.add(frame(533), scene(3, corners=1))
    assert not degradation.notes


def test_a_camera_that_is_dark_from_the_start_is_reported_too() -> None:
    degradation = Degradation(Config())
    for stamp_ms in (0, 300, 600):
        degradation.add(frame(stamp_ms, 0), scene(0, corners=0))
    assert degradation.notes[0].startswith("dark: ")


@pytest.mark.parametrize(
    ("interval_ms", "speed_mps", "is_noted"), [(33, 1.5, False), (500, 1.5, True), (500, -1.5, True)]
)
def test_a_frame_rate_too_low_for_the_motion(interval_ms: int, speed_mps: float, is_noted: bool) -> None:
    degradation = Degradation(Config(filter=Filter(leap_px=40.0, scene_depth_m=4.0)))
    degradation.add(frame(0), scene(0, speed_mps=speed_mps))
    degradation.add(frame(interval_ms), scene(1, speed_mps=speed_mps))
    assert [note.partition(":")[0] for note in degradation.notes] == ["frame rate too low for the motion"] * is_noted


def test_without_a_speed_nothing_is_said_of_the_rate() -> None:
    degradation = Degradation(Config())
    degradation.add(frame(0), scene(0))
    degradation.add(frame(5000), scene(1, speed_mps=float("nan")))
    assert not degradation.notes


@pytest.mark.parametrize("note", sorted(set(NOTES) - SAID_OTHERWISE))
def test_what_degrades_a_scene_is_reported(note: str) -> None:
    degradation = Degradation(Config())
    degradation.add(frame(0), scene(0, notes=("first frame", note)))
    assert len(degradation.notes) == 1


@pytest.mark.parametrize(
    ("note", "words"),
    [
        ("gyro bias unknown", "the gyro's bias is not known yet"),
        ("gyro stuck", "the gyro repeats one value"),
    ],
)
def test_a_gyro_that_is_not_fully_believed_says_why(note: str, words: str) -> None:
    degradation = Degradation(Config())
    degradation.add(frame(0), scene(0, notes=(note,)))
    assert degradation.notes[0].startswith(words)
    degradation.add(frame(50), scene(1))
    assert not degradation.notes


@pytest.mark.parametrize("note", ["imu gap", "gyro stuck"])
def test_nobody_is_sent_to_the_cable_of_a_recording(note: str) -> None:
    def is_noted(config: Config) -> str:
        degradation = Degradation(config)
        degradation.add(frame(0), scene(0, notes=(note,)))
        (words,) = degradation.notes
        return words

    assert "check " in is_noted(Config(imu=Imu(driver="mpu6050")))
    of_a_recording = is_noted(Config(imu=Imu(driver="recording", recording="drive")))
    assert "recording" in of_a_recording
    assert "check " not in of_a_recording
