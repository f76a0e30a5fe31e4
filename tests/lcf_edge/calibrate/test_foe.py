"""How the camera is mounted, from where the flow of a straight drive comes."""

import math
import os
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.samples import Frame
from lcf_edge.calibrate.foe import calibrate_foe
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.result import CalibrationError
from lcf_edge.calibrate.sources import RecordedSource
from lcf_edge.config import Config
from lcf_edge.lens import Lens
from lcf_edge.rendered import scenes
from lcf_edge.rendered.scenes import Drive, Profile, Shake

Make = Callable[..., Any]

PINHOLE = Lens(320, 240, 250.0, 250.0, 159.5, 119.5)
DATA = Path(os.environ.get("LCF_EDGE_DATA", Path(__file__).parents[4] / "shared/data"))


def drive(seed: int, yaw_rad: float = 0.0, pitch_rad: float = 0.0, **changes: Any) -> Drive:
    """Straight past boxes, shaken a little, with a camera that looks aside."""
    made = scenes.make("passing", seed)
    return replace(
        made,
        seconds=4.0,
        fps=10.0,
        lens=scenes.Lens(width=320, height=240, focal_px=250.0),
        camera_pitch_rad=pitch_rad,
        shakes=(*made.shakes, Shake("yaw", yaw_rad, 0.0, math.pi / 2)),
        **changes,
    )


def frames_of(of: Drive) -> list[Frame]:
    return [frame for frame, _ in scenes.frames(of)]


@pytest.mark.parametrize(("seed", "yaw_rad", "pitch_rad"), [(2, -0.1, 0.05)])
def test_the_mounting_is_found_within_half_a_degree(
    given: Make, guide: Guide, seed: int, yaw_rad: float, pitch_rad: float
) -> None:
    frames = frames_of(drive(seed, yaw_rad, pitch_rad))
    values = calibrate_foe(given(frames, lens=PINHOLE), Config(), None, guide).values
    assert values["yaw_rad"] == pytest.approx(yaw_rad, abs=math.radians(0.3))
    assert values["pitch_rad"] == pytest.approx(pitch_rad, abs=math.radians(0.3))


@pytest.fixture(scope="module")
def straight() -> list[Frame]:
    return frames_of(drive(3))


def test_what_is_no_straight_drive_is_refused(given: Make, guide: Guide, straight: list[Frame]) -> None:
    turning = frames_of(drive(3, yaw_rate=Profile(((0.0, 0.3),))))[:16]
    blank = [replace(frame, image=np.full_like(frame.image, 90)) for frame in straight]
    standing = [replace(frame, image=straight[0].image) for frame in straight * 2]
    standing = [replace(frame, stamp_ns=straight[0].stamp_ns + i * 10**8) for i, frame in enumerate(standing)]
    backwards = [replace(frame, image=other.image) for frame, other in zip(straight, reversed(straight), strict=True)]
    for frames, message in (
        (turning, "the drive is not straight, it turned in"),
        (blank, "followed over 0 intervals"),
        (standing, "hardly anything came nearer"),
        (backwards, "as when reversing"),
        ([], "no images came"),
    ):
        with pytest.raises(CalibrationError, match=message):
            calibrate_foe(given(frames, lens=PINHOLE), Config(), None, guide)


def test_a_lens_that_nobody_knows_is_refused(given: Make, guide: Guide, straight: list[Frame]) -> None:
    with pytest.raises(CalibrationError, match="run lcf-edge calibrate camera first"):
        calibrate_foe(given(straight), Config(), None, guide)


@pytest.mark.skipif(not (DATA / "kitti-straight").is_dir(), reason="no recordings here")
def test_a_real_drive_has_the_direction_of_its_true_poses(guide: Guide) -> None:
    poses = np.loadtxt(DATA / "kitti-straight/poses.txt").reshape(-1, 3, 4)
    x, y, z = np.mean([a[:, :3].T @ (b[:, 3] - a[:, 3]) for a, b in pairwise(poses)], axis=0)
    source = RecordedSource(DATA / "kitti-straight", Config(), guide, imu=False)
    values = calibrate_foe(source, Config(), 2.6, guide).values
    assert values["yaw_rad"] == pytest.approx(-math.atan(x / z), abs=math.radians(0.5))
    assert values["pitch_rad"] == pytest.approx(math.atan(y / z), abs=math.radians(0.5))
