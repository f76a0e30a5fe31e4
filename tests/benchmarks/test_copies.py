"""Copies of recordings that a user would call the same: what is in them."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import copies
from drivers.samples import Frame, ImuSample, SpeedSample
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


def names_of_copies(arguments: list[str], recording: Path, into: Path, capsys: pytest.CaptureFixture[str]) -> set[str]:
    """Write copies; what follows the name of the recording in theirs, of which the program tells the number."""
    assert copies.main([*arguments, str(recording.parent), str(into)]) == 0
    names = {each.name.partition("@")[2] for each in into.iterdir()}
    assert f"{len(names)} copies in {into}: lcf-edge evaluate {into}" in capsys.readouterr().out
    return names


def test_every_copy_is_a_recording_with_the_truth_of_its_own_images(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    into = tmp_path / "copies"
    names = names_of_copies([], recording, into, capsys)
    assert names == {*copies.ALTERATIONS, *copies.SELECTIONS, "dropped"}
    original = images_of(recording)
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


@pytest.mark.parametrize("arguments", [[], ["--camera"]], ids=["copies", "worse cameras"])
def test_a_row_without_a_stamp_is_refused_in_one_line(
    arguments: list[str], recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with (recording / "mav0/cam0/data.csv").open("a") as rows:
        rows.write("soon,late.png\n")
    assert copies.main([*arguments, str(recording.parent), str(tmp_path / "copies")]) == 1
    error = capsys.readouterr().err
    assert "yard/mav0/cam0/data.csv: a row is no image: 'soon,late.png'" in error
    assert error.count("\n") == 1


def test_a_worse_camera_shows_it_in_every_image(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    into = tmp_path / "copies"
    assert names_of_copies(["--camera"], recording, into, capsys) == set(copies.CAMERAS)
    original = images_of(recording)
    for name in copies.CAMERAS:
        images = images_of(into / f"yard@{name}")
        assert images.keys() == original.keys()
        assert all((images[stamp] != original[stamp]).any() for stamp in images)
        assert (into / f"yard@{name}/truth.jsonl").read_text() == (recording / "truth.jsonl").read_text()


@pytest.mark.parametrize("name", ["exposure", "bands"])
def test_what_the_recorder_repeated_is_repeated_as_the_worse_camera_showed_it(
    name: str, recording: Path, tmp_path: Path
) -> None:
    images = sorted((recording / "mav0/cam0/data").iterdir())
    for first, second in zip(images[::2], images[1::2], strict=True):
        shutil.copyfile(first, second)
    list(copies.write_worse(recording, tmp_path))
    shown = list(images_of(tmp_path / f"yard@{name}").values())[2:]  # the first copy may be of a still scene
    assert all((first == second).all() for first, second in zip(shown[::2], shown[1::2], strict=True))
    assert all((first != second).any() for first, second in zip(shown[1::2], shown[2::2], strict=False))


@pytest.mark.parametrize("name", copies.CAMERAS)
def test_a_worse_camera_does_to_colours_what_it_does_to_grey(name: str) -> None:
    grey = np.random.default_rng(3).integers(0, 256, (60, 80), np.uint8)
    expected = copies.CAMERAS[name](grey, np.random.default_rng(4))
    coloured = copies.CAMERAS[name](np.dstack([grey] * 3), np.random.default_rng(4))
    assert coloured.dtype == np.uint8
    assert all((coloured[:, :, channel] == expected).all() for channel in range(3))


def test_defects_are_the_same_pixels_in_every_image(recording: Path, tmp_path: Path) -> None:
    list(copies.write_worse(recording, tmp_path))
    original = images_of(recording)
    for name, share, grey in (("hot-pixels", 0.0005, 255), ("many-hot-pixels", 0.003, 255), ("dead-pixels", 0.001, 0)):
        images = images_of(tmp_path / f"yard@{name}")
        stuck = np.logical_or.reduce([images[stamp] != original[stamp] for stamp in original])
        assert all((image[stuck] == grey).all() for image in images.values())
        assert stuck.mean() == pytest.approx(share, abs=2.5 * np.sqrt(share / stuck.size))


def samples_of(folder: Path, kind: type) -> list[Any]:
    return [each for each in open_recording(folder, load(None, [])) if isinstance(each, kind)]


def test_sensors_fail_as_the_name_of_the_copy_says(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    into = tmp_path / "copies"
    assert names_of_copies(["--sensors"], recording, into, capsys) == set(copies.FAILURES)
    inertial = {name: samples_of(into / f"yard@{name}", ImuSample) for name in copies.FAILURES}
    speeds = {name: samples_of(into / f"yard@{name}", SpeedSample) for name in copies.FAILURES}
    whole, half = samples_of(recording, ImuSample), len(samples_of(recording, ImuSample)) // 2
    rates = {name: np.array([each.gyro for each in samples]) for name, samples in inertial.items()}
    true = np.array([each.gyro for each in whole])
    assert np.allclose(rates["gyro-biased"], true + copies.BIAS_RADPS)
    assert np.allclose(rates["gyro-drifts"][0], true[0])
    assert np.allclose(rates["gyro-drifts"][-1], true[-1] + copies.DRIFT_RADPS, atol=1e-3)
    assert inertial["imu-dies"] == whole[:half]
    assert inertial["imu-sticks"][:half] == whole[:half]
    assert len({(each.gyro, each.accel) for each in inertial["imu-sticks"][half:]}) == 1
    assert not inertial["no-imu"]
    assert not inertial["no-turn"]
    assert inertial["no-odometry"] == whole
    assert not speeds["no-odometry"]
    assert speeds["no-imu"] == samples_of(recording, SpeedSample)
    assert len(speeds["no-turn"]) == len(speeds["no-imu"])
    assert all(np.isnan(each.yaw_rate_radps) for each in speeds["no-turn"])
    assert all(images_of(into / f"yard@{name}").keys() == images_of(recording).keys() for name in copies.FAILURES)


def test_an_axis_that_the_gyro_lacks_has_no_bias(recording: Path, tmp_path: Path) -> None:
    path = recording / copies.IMU / "data.csv"
    head, *rows = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text("\n".join(",".join([*row[:1], "0", *row[2:]]) for row in (head, *rows)))
    list(copies.write_failing(recording, tmp_path / "copies"))
    rates = np.array([each.gyro for each in samples_of(tmp_path / "copies/yard@gyro-biased", ImuSample)])
    assert (rates == 0).any(axis=0).sum() == 1


def test_a_sensor_that_a_recording_lacks_cannot_fail(recording: Path, tmp_path: Path) -> None:
    shutil.rmtree(recording / copies.IMU)
    assert list(copies.write_failing(recording, tmp_path / "copies")) == ["yard@no-odometry"]


@pytest.mark.parametrize("row", ["1,nothing,0,0,0,0,0", "1,0"])
def test_a_row_that_is_no_sample_is_told_in_one_line_with_its_file(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], row: str
) -> None:
    path = recording / copies.IMU / "data.csv"
    path.write_text(f"#head\n{row}\n")
    assert copies.main(["--sensors", str(recording.parent), str(tmp_path / "copies")]) == 1
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert str(path) in told
