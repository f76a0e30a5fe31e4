"""Things put into recordings: where the world would show them, and what is said about them."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks import inserted
from drivers.samples import Frame
from lcf_edge.config import load
from lcf_edge.recording.read import open_recording
from lcf_edge.rendered import scenes

SETTINGS = ("vehicle.half_width_m=0.3", "camera.height_m=0.5")


@pytest.fixture(scope="module")
def copies(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the copies of a drive straight on, through a place where nothing is in the way."""
    drive = scenes.make("passing", 1, seconds=4.0, width=160, height=120, focal_px=120.0)
    place = scenes.write(drive, tmp_path_factory.mktemp("real") / "yard")
    (place / "settings").write_text("\n".join(SETTINGS))
    into = place.parent / "copies"
    assert inserted.main([str(place.parent), str(into)]) == 0
    return into


def truths(copy: Path) -> list[list[dict]]:
    return [json.loads(line)["objects"] for line in (copy / "truth.jsonl").read_text().splitlines()]


def test_every_thing_is_put_in_every_place(copies: Path) -> None:
    names = {each.name for each in copies.iterdir()}
    assert names == {f"yard@{motion}-{n}" for motion in inserted.MOTIONS for n in range(len(inserted.MET))}


@pytest.mark.parametrize("motion", inserted.MOTIONS)
def test_a_thing_grows_until_it_is_met_and_is_a_threat_just_before(copies: Path, motion: str) -> None:
    objects = [each for each in truths(copies / f"yard@{motion}-2") if each]
    widths = [each[0]["box"][2] - each[0]["box"][0] for each in objects]
    assert widths[-1] > 3 * widths[0]
    assert all(each[0]["threat"] for each in objects[-5:])
    assert all(each[0]["moving"] == (motion != "stands") for each in objects)


def test_only_the_thing_is_drawn(copies: Path) -> None:
    """Between two copies images differ only where the box of either is."""
    one, other = copies / "yard@stands-2", copies / "yard@crosses-2"
    config = load(None, [])
    images = [[each.image for each in open_recording(copy, config) if isinstance(each, Frame)] for copy in (one, other)]
    for here, there, objects, others in zip(*images, truths(one), truths(other), strict=True):
        differs = here != there
        for each in objects + others:
            left, top, right, bottom = each["box"]
            rows, columns = (
                slice(max(int(low) - 2, 0), max(int(high) + 3, 0)) for low, high in ((top, bottom), (left, right))
            )
            differs[rows, columns] = False
        assert not differs.any()


def test_a_thing_that_stands_is_where_the_vehicle_will_be(copies: Path) -> None:
    """Its foot is on the ground that the vehicle reaches, as the camera's height and its range say."""
    copy = copies / "yard@stands-2"
    frames = [each for each in open_recording(copy, load(None, SETTINGS)) if isinstance(each, Frame)]
    config = load(None, SETTINGS)
    images = [each.image for each in frames]
    way, mounted, lens = inserted.way_of(copy, config, images)
    assert (lens.fx, lens.width, lens.height) == (120.0, 160, 120)
    board = inserted.board_for(way, len(frames) - 1, "stands", mounted, 1.0)
    n = len(frames) // 2
    corners = inserted.corners_px(way, board, n, mounted, lens)
    assert corners is not None
    ahead_m = np.hypot(board.x_m[n] - way.x_m[n], board.z_m[n] - way.z_m[n])
    horizon_y = lens.cy + lens.fy * np.tan(mounted.camera.pitch_rad + way.pitch_rad[n])
    assert corners[2:, 1] == pytest.approx(horizon_y + lens.fy * 0.5 / ahead_m, abs=1.0)
    assert inserted.is_met(way, board, n, mounted)


def test_a_recording_without_a_speed_is_refused(
    copies: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / "real" / "yard"
    place.parent.mkdir()
    (copies / "yard@stands-0").rename(place)
    odometry = place / "mav0/odom0/data.csv"
    odometry.write_text(odometry.read_text().splitlines()[0] + "\n")
    assert inserted.main([str(place.parent), str(tmp_path / "into")]) == 1
    error = capsys.readouterr().err
    assert error.startswith("benchmarks.inserted: ")
    assert error.count("\n") == 1
