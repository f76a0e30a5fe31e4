"""The benchmark as a user starts it: what it writes, and what it refuses. Its numbers are nobody's promise."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks import memory, report, run
from benchmarks.methods import NAMES
from benchmarks.playing import config_of, play_drive, play_recording
from benchmarks.report import Table
from benchmarks.speed import config_for
from lcf_edge.config import load, to_toml
from lcf_edge.rendered import scenes

DRIVE = scenes.make("crossing", 1, seconds=0.5, width=320, height=240, focal_px=250.0)


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Results go here, drives are short, and no recordings are at hand."""
    monkeypatch.setattr(report, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(scenes, "make", partial(scenes.make, seconds=0.8, width=320, height=240, focal_px=250.0))
    monkeypatch.setenv("LCF_EDGE_DATA", str(tmp_path / "none"))
    return tmp_path / "results"


def test_quality_is_printed_and_written(results: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run.main(["--only", "quality", "--kinds", "ahead,passing", "--seeds", "1"]) == 0
    printed = capsys.readouterr().out
    assert printed.rstrip("\n") == (results / "quality.md").read_text().rstrip("\n")
    written = json.loads((results / "quality.json").read_text())
    assert set(written["scores"]) == {"ahead", "passing"}
    assert set(written["scores"]["ahead"]) == set(NAMES)
    assert written["seeds"] == [1]
    assert {"cpu", "cores", "python", "numpy", "opencv", "commit", "date"} <= set(written["conditions"])
    assert "| passing   | no threat" in printed


@pytest.mark.parametrize(
    ("arguments", "named"),
    [(["--kinds", "flying"], "flying"), (["--seeds", "many"], "--seeds many"), (["--seeds", "1-2-x"], "1-2-x")],
)
def test_nonsense_is_one_line(arguments: list[str], named: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run.main(arguments) == 2
    error = capsys.readouterr().err
    assert named in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(("text", "seeds"), [("0-4", [0, 1, 2, 3, 4]), ("7", [7]), ("0,2,5-6", [0, 2, 5, 6])])
def test_seeds(text: str, seeds: list[int]) -> None:
    assert run._numbers(text) == seeds


def test_a_table_is_markdown() -> None:
    lines = Table("Times", ["method", "ms"], [["one", "1.0"], ["another", "12.0"]]).markdown().splitlines()
    assert lines[0] == "### Times"
    assert lines[2:4] == ["| method  |   ms |", "|---------|-----:|"]
    assert lines[4] == "| one     |  1.0 |"
    assert report.number(float("nan"), 2) == "-"


def test_methods_get_the_same_from_a_drive_and_from_its_recording(tmp_path: Path) -> None:
    """In memory and through files: the same frames and, up to the digits of a text file, the same motion."""
    config = config_of(DRIVE)
    rendered = list(play_drive(DRIVE, config, ["filter"]))
    read = list(play_recording(scenes.write(DRIVE, tmp_path), config, ["filter"]))
    assert [m.frame.stamp_ns for m in rendered] == [m.frame.stamp_ns for m in read]
    for one, other in zip(rendered, read, strict=True):
        np.testing.assert_array_equal(one.frame.image, other.frame.image)
        assert one.scenes["filter"].vehicle_speed == pytest.approx(other.scenes["filter"].vehicle_speed, abs=2e-3)
        assert one.scenes["filter"].sizes.corners == other.scenes["filter"].sizes.corners


def test_the_configuration_is_one_that_a_user_can_write(tmp_path: Path) -> None:
    for corners in (300, 4000):
        config = config_for(DRIVE, corners)
        (tmp_path / "config.toml").write_text(to_toml(config))
        assert load(tmp_path / "config.toml") == config


def test_memory_is_that_of_a_process_of_its_own(tmp_path: Path) -> None:
    ballast = np.ones(200 * 2**20, np.uint8)
    measured = memory.measure("nothing", scenes.write(DRIVE, tmp_path), config_of(DRIVE))
    assert memory.peak_bytes() > ballast.nbytes
    assert 10 < measured.peak_mib < 150


def test_a_child_that_fails_is_reported(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="no such file"):
        memory.measure("nothing", tmp_path / "none", config_of(DRIVE))
