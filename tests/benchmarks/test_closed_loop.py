"""The contest in the closed loop as a user starts it: what it writes, and what it refuses."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks import closed_loop, drive_video, report
from benchmarks.drivers import NAMES
from hil_mocks.closed_loop import worlds
from hil_mocks.closed_loop.course import Course
from hil_mocks.closed_loop.world import World
from lcf_edge.messages import OBJECT, ObjectClass
from lcf_edge.rendered.drives import Lens


@pytest.fixture
def short(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Small pictures, courses of a metre, and a box before their end."""
    make = worlds.make

    def shorter(seed: int) -> World:
        world = make(seed)
        block = next(body for body in make(2).bodies if body.name.startswith("blocker"))
        box = worlds.replace(block, x_m=0.0, z_m=2.0, heading_rad=0.0)
        return world.changed(course=Course(2.5), bodies=(box,), start_mps=0.0, waits_m=(), lens=Lens(320, 240, 250.0))

    monkeypatch.setattr(worlds, "make", shorter)
    monkeypatch.setattr(report, "RESULTS", tmp_path / "results")
    return tmp_path


def test_tables_and_video_are_written(short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--worlds", "2", "--seed", "4", "--drivers", "truth,objects,blind", "--video", str(short / "out")]
    assert closed_loop.main(arguments) == 0
    printed = capsys.readouterr().out
    assert (short / "results" / "drive.md").read_text() in printed
    written = json.loads((short / "results" / "drive.json").read_text())
    assert [result["seed"] for result in written["results"]] == [4, 5]
    assert written["results"][0]["outcomes"]["blind"]["threats"] == 1
    assert written["results"][0]["outcomes"]["truth"]["collisions"] == []
    [film] = (short / "out").iterdir()
    shown, image = cv2.VideoCapture(str(film)).read()
    assert shown
    assert image.shape == (240, 320, 3)


def test_what_is_unknown_of_an_object_is_not_written_into_the_video() -> None:
    thing = np.zeros(1, OBJECT)
    thing["id"], thing["class_id"] = 7, ObjectClass.CUTTING_IN
    for name, value, sigma in (("ttc", 2.14, 0.3), ("range", 3.0, 0.52), ("lateral", -0.8, np.nan)):
        thing[name], thing[f"{name}_sigma"] = value, sigma
    assert drive_video.label(thing[0]) == "7 cutting in, 2.1 ±0.3 s, 3.0 ±0.5 m, -0.8 m aside"
    thing["ttc"], thing["range"], thing["lateral"] = np.inf, np.nan, np.nan
    assert drive_video.label(thing[0]) == "7 cutting in"


def test_the_same_worlds_give_the_same_outcomes(short: Path) -> None:
    del short
    assert closed_loop.contest(4, ["objects"]) == closed_loop.contest(4, ["objects"])


@pytest.mark.parametrize("wrong", [("--drivers", "truth,nobody"), ("--worlds", "0"), ("--seed", "-1"), ("--jobs", "0")])
def test_what_it_does_not_know_is_refused_in_a_line(wrong: tuple[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    assert closed_loop.main(wrong) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_all_drivers_take_part_by_default() -> None:
    assert set(NAMES) >= {"truth", "objects", "circles", "blind", "lucas_kanade"}
