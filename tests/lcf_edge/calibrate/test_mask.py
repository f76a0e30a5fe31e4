"""`calibrate mask`: what never moves while the vehicle drives is its own."""

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.calibrate.mask import Stillness, as_result, outlines, own_parts
from lcf_edge.calibrate.result import CalibrationError
from lcf_edge.cli.command_line import main
from lcf_edge.config import Config, load
from lcf_edge.errors import ConfigError
from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import Drive

Grey = npt.NDArray[np.uint8]


def watched(images: Sequence[Grey]) -> Stillness:
    stillness = Stillness(*images[0].shape)
    for image in images:
        stillness.add(image)
    return stillness


def images_of(drive: Drive) -> list[Grey]:
    return [frame.image for frame, _ in scenes.frames(replace(drive, fps=5.0))]


def filled(drive: Drive) -> npt.NDArray[np.bool_]:
    inside = np.zeros((drive.lens.height, drive.lens.width), np.uint8)
    for part in drive.own_parts:
        cv2.fillPoly(inside, [np.rint(part).astype(np.int32)], (1,))
    return inside > 0


@pytest.mark.parametrize("seed", [21, 22])
@pytest.mark.parametrize("plain", [False, True], ids=["textured", "plain"])
def test_a_bumper_is_outlined(seed: int, plain: bool) -> None:
    drive = scenes.make("own_bumper", seed)
    true, images = filled(drive), images_of(drive)
    if plain:
        images = [np.where(true, 30, image).astype(np.uint8) for image in images]
    proposed = np.zeros(true.shape, np.uint8)
    for polygon in outlines(own_parts(watched(images))):
        cv2.fillPoly(proposed, [np.rint(polygon).astype(np.int32)], (1,))
    assert (proposed[true] > 0).mean() > 0.98
    assert (proposed[~true] > 0).mean() < 0.02


@pytest.mark.parametrize("kind", ["passing", "turn", "long_lines"])
def test_a_vehicle_without_own_parts_in_view_has_none(kind: str) -> None:
    assert not own_parts(watched(images_of(scenes.make(kind, 23)))).any()


def test_who_stands_still_is_told_to_drive() -> None:
    still = images_of(scenes.make("passing", 23, seconds=0.2))[:1] * 30
    with pytest.raises(CalibrationError, match="drive past things"):
        own_parts(watched(still))


def test_few_images_show_nothing() -> None:
    with pytest.raises(CalibrationError, match="20 are needed"):
        own_parts(watched(images_of(scenes.make("passing", 23, seconds=2.0))))


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    drive = scenes.make("own_bumper", 24, fps=5.0, width=320, height=240, focal_px=250.0)
    return scenes.write(drive, tmp_path_factory.mktemp("bumper"))


def test_the_proposal_is_written_in_px_of_the_configured_size(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, report = tmp_path / "rover.toml", tmp_path / "mask.png"
    file.write_text("[camera]\nwidth = 640\nheight = 480\n", encoding="utf-8")
    options = ["--from", str(recording), "-c", str(file), "--write", "--report", str(report)]
    assert main(["calibrate", "mask", *options]) == 0
    mask = tomllib.loads(capsys.readouterr().out)["camera"]["mask"]
    assert load(file).camera.mask == mask
    lowest = max(y for polygon in mask for _, y in polygon)
    assert 470 <= lowest <= 480  # the images have 240 rows
    assert cv2.imread(str(report)).shape == (600, 1300, 3)


def test_polygons_are_taken_as_given(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["--polygon", "0,200,319,200,319,239,0,239", "--polygon", "0,0,20,0,0,20"]
    sizes = ["--set", "camera.width=320", "--set", "camera.height=240"]
    assert main(["calibrate", "mask", "--from", str(recording), *given, *sizes]) == 0
    found = tomllib.loads(capsys.readouterr().out)["camera"]["mask"]
    assert found == [[[0, 200], [319, 200], [319, 239], [0, 239]], [[0, 0], [20, 0], [0, 20]]]


NUMBERS = st.floats(-700, 1300) | st.floats()
POLYGONS = st.lists(st.lists(st.tuples(NUMBERS, NUMBERS).map(list), min_size=2, max_size=5), max_size=3)


@given(polygons=POLYGONS)
def test_a_mask_is_one_that_the_configuration_takes_or_it_is_refused(polygons: list[list[list[float]]]) -> None:
    image = np.zeros((240, 320), np.uint8)
    try:
        mask = as_result(polygons, image, Config(), "as given", "--polygon").values["mask"]
    except ConfigError:
        return
    assert load(None, [f"camera.mask={mask}"]).camera.mask == mask


def test_a_polygon_far_outside_is_refused(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "mask", "--from", str(recording), "--polygon", "0,0,5000,0,0,50"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "lcf-edge: --polygon: camera.mask: polygon 1 lies far outside an image of 640x480 px"


@pytest.mark.parametrize("text", ["0,0,1,1", "0,0,1,1,2", "a,b,c,d,e,f", "0,0,1,1,2,nan"])
def test_what_is_no_polygon_is_refused(recording: Path, capsys: pytest.CaptureFixture[str], text: str) -> None:
    assert main(["calibrate", "mask", "--from", str(recording), "--polygon", text]) == 2
    assert "X,Y,X,Y,X,Y" in capsys.readouterr().err


def test_a_recording_without_own_parts_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drive = scenes.make("turn", 25, fps=5.0, width=320, height=240, focal_px=250.0)
    assert main(["calibrate", "mask", "--from", str(scenes.write(drive, tmp_path))]) == 1
    assert "nothing stands still" in capsys.readouterr().err
