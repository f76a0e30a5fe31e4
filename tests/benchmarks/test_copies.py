"""Copies of recordings that a user would call the same: what is in them."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import copies
from drivers.samples import Frame
from lcf_edge.config import load
from lcf_edge.recording.read import open_recording
from lcf_edge.rendered import scenes


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Seventy small images, with truth for every tenth."""
    drive = scenes.make("ahead", 1, seconds=3.5, width=80, height=60, focal_px=60.0)
    place = scenes.write(drive, tmp_path / "real" / "yard")
    (place / "settings").write_text("vehicle.half_width_m=0.3\n")
    stamps = [truth.stamp_ns for truth in scenes.truths(drive)][::10]
    (place / "truth.jsonl").write_text("".join(json.dumps({"stamp_ns": each, "objects": []}) + "\n" for each in stamps))
    return place


def images_of(folder: Path) -> dict[int, np.ndarray]:
    return {each.stamp_ns: each.image for each in open_recording(folder, load(None, [])) if isinstance(each, Frame)}


def test_every_copy_is_a_recording_with_the_truth_of_its_own_images(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    into = tmp_path / "copies"
    assert copies.main([str(recording.parent), str(into)]) == 0
    original = images_of(recording)
    names = {each.name.partition("@")[2] for each in into.iterdir()}
    assert names == {*copies.ALTERATIONS, *copies.SELECTIONS, "dropped"}
    assert f"{len(names)} copies in {into}: lcf-edge evaluate {into}" in capsys.readouterr().out
    for name in names:
        copy = into / f"yard@{name}"
        images = images_of(copy)
        truth = [json.loads(line)["stamp_ns"] for line in (copy / "truth.jsonl").read_text().splitlines()]
        assert set(truth) == {stamp for stamp in list(original)[::10] if stamp in images}
        assert (copy / "settings").read_text() == (recording / "settings").read_text()
        if name in copies.ALTERATIONS:
            assert images.keys() == original.keys()
            assert any((images[stamp] != original[stamp]).any() for stamp in images)
        else:
            assert images.keys() < original.keys()
            assert all((images[stamp] == original[stamp]).all() for stamp in images)


def test_noise_is_as_strong_as_its_name_says_and_the_same_each_time(recording: Path, tmp_path: Path) -> None:
    (_, first), (_, second) = ((list(copies.write(recording, tmp_path / name)), tmp_path / name) for name in "ab")
    original = images_of(recording)
    for sigma in (1, 2, 3):
        one, other = (images_of(into / f"yard@noise-{sigma}") for into in (first, second))
        assert all((one[stamp] == other[stamp]).all() for stamp in one)
        inside = [(image > 20) & (image < 235) for image in original.values()]
        off = [(one[stamp].astype(float) - original[stamp])[mask] for stamp, mask in zip(original, inside, strict=True)]
        assert np.concatenate(off).std() == pytest.approx(sigma, rel=0.1)


def test_a_folder_that_exists_and_an_image_that_does_not_are_refused_in_one_line(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "copies" / "yard@from-10").mkdir(parents=True)
    assert copies.main([str(recording.parent), str(tmp_path / "copies")]) == 1
    assert "yard@from-10" in capsys.readouterr().err
    next((recording / "mav0/cam0/data").iterdir()).write_bytes(b"no image")
    assert copies.main([str(recording.parent), str(tmp_path / "more")]) == 1
    error = capsys.readouterr().err
    assert error.endswith(": no image\n")
    assert error.count("\n") == 1
