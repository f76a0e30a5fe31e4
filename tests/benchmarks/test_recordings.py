"""Real recordings in the benchmark: what is written. A rendered one stands in for a real one."""

import json
from pathlib import Path

import cv2
import pytest

from benchmarks import recordings, report, run
from benchmarks.methods import NAMES
from lcf_edge.evaluate.drawings import WIDTH_PX
from lcf_edge.rendered import scenes


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with one recording of eight pictures, whose first has truth."""
    monkeypatch.setattr(report, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(run, "SHEET", tmp_path / "bench-out" / "sheet.png")
    drive = scenes.make("ahead", 1, seconds=0.4, width=160, height=120, focal_px=125.0)
    place = scenes.write(drive, tmp_path / "real" / "yard")
    (place / "settings").write_text("vehicle.half_width_m=0.3 camera.height_m=0.5\n")
    first = next(iter(scenes.truths(drive))).stamp_ns
    line = {"stamp_ns": first, "objects": [{"name": "bin", "box": [50, 40, 90, 80], "threat": True, "by": "eye"}]}
    (place / "truth.jsonl").write_text(json.dumps(line) + "\n")
    return tmp_path


def test_tables_and_a_sheet_of_pictures_are_written(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run.main(["--only", "recordings", "--recordings", str(folder / "real")]) == 0
    printed = capsys.readouterr().out
    for title in ("Threats found", "Found after, s", "Rebels on nothing", "does not come", "Step, median ms"):
        assert title in printed
    written = json.loads((folder / "results" / "recordings.json").read_text())["recordings"]["yard"]
    assert set(written) == set(NAMES)
    assert (written["filter"]["scored"], written["filter"]["due"]) == (1, 1)
    sheet = cv2.imread(str(folder / "bench-out" / "sheet.png"))
    assert sheet.shape[1] == recordings.FRAMES * WIDTH_PX
    assert sheet.max() > 100


def test_without_a_folder_it_says_how_to_name_one(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(recordings.VARIABLE, raising=False)
    assert run.main(["--only", "recordings"]) == 0
    assert "--recordings or LCF_EDGE_DATA" in capsys.readouterr().out


def test_a_folder_without_recordings_is_one_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run.main(["--only", "recordings", "--recordings", str(folder / "results")]) != 0
    assert "no recordings" in capsys.readouterr().err
