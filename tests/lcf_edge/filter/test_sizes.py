"""The same drive seen at several sizes and through several lenses."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Camera, Config, Vehicle
from lcf_edge.filter import LineCircleFilter
from lcf_edge.lens import Lens
from lcf_edge.messages import Cause

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]


def published(way: Any, lens: Lens) -> npt.NDArray[np.float64]:
    """(n, 4) of the rebel circles after the drive: cause, tangents to the right and down, time to contact."""
    tables = LineCircleFilter(Config(), lens)
    for corners, motion in replace(way, lens=lens):
        tables.step(corners, motion)
    rebel = tables.rebel
    rows = np.flatnonzero(rebel.active & (rebel.trust >= 3))
    right, down = (rebel.x[rows] - lens.cx) / lens.fx, (rebel.y[rows] - lens.cy) / lens.fy
    return np.stack([rebel.cause[rows], right, down, rebel.ttc[rows]], axis=1)


OTHERS = {
    "160x120": Lens(160, 120, 125, 125, 79.5, 59.5),
    "320x240": Lens(320, 240, 250, 250, 159.5, 119.5),
    "1280x960": Lens(1280, 960, 1000, 1000, 639.5, 479.5),
    "1920x1080": Lens(1920, 1080, 1500, 1500, 959.5, 539.5),
    "104 degrees": Lens(640, 480, 250, 250, 319.5, 239.5),
    "fisheye": Lens(640, 480, 300, 300, 319.5, 239.5, "equidistant", (0.0, 0.0, 0.0, 0.0)),
    "170 degrees": Lens(640, 480, 216, 216, 319.5, 239.5, "equidistant", (0.0, 0.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_a_wall_and_a_walker_are_found_where_they_are_at_every_size_and_through_every_lens(
    drive: Drive, clutter: Landmarks, box: Landmarks, lens: Lens, other: Lens
) -> None:
    wall = drive(box((0.0, -0.4, 6.0), (0.5, 0.9, 0.0), landmarks=40))
    walker = drive(box((-2.2, -0.6, 5), (0.5, 1.2, 0.3), landmarks=40), np.array([1.2, 0, 0]))
    way = replace(drive(clutter(150)) + wall + walker, frames=22)
    at_one, at_other = published(way, lens), published(way, other)
    for cause in (Cause.INCOMING, Cause.CROSSING):
        one, another = (found[found[:, 0] == cause] for found in (at_one, at_other))
        assert len(one)
        assert len(another)
        away = np.hypot(*(one[:, None, 1:3] - another[:, 1:3]).transpose(2, 0, 1))
        assert away.min() < 0.05  # half the width of the walker
        if cause == Cause.INCOMING:
            k, j = np.unravel_index(away.argmin(), away.shape)
            assert another[j, 3] == pytest.approx(one[k, 3], rel=0.1)


def test_the_few_corners_of_a_small_wide_image_make_circles_too(drive: Drive, clutter: Landmarks) -> None:
    fisheye = Lens(160, 120, 65.4, 65.4, 79.5, 59.5, "equidistant", (0.0, 0.0, 0.0, 0.0))
    tables = LineCircleFilter(Config(), fisheye)
    circles = []
    for corners, motion in replace(drive(clutter(100)), lens=fisheye, frames=30):
        tables.step(corners, motion)
        circles.append(int(np.count_nonzero(tables.normal.active & (tables.normal.trust >= 3))))
    assert max(circles) >= 3


def test_a_box_in_the_way_is_found_with_the_few_corners_of_a_coarse_image(
    drive: Drive, clutter: Landmarks, box: Landmarks
) -> None:
    """Judged with neighbours within 6.4 px only, not 11, it is found in 21 images of 46."""
    coarse = Lens(160, 120, 83, 83, 79.5, 59.5)
    rover = Config(camera=Camera(height_m=0.13), vehicle=Vehicle(half_width_m=0.12, horizon_s=3.0))
    found = []
    for seed in range(6):
        standing = drive(box((0.0, -0.07, 2.0), (0.3, 0.4, 0.0), landmarks=12, seed=seed))
        way = drive(clutter(120, seed=seed + 1)) + standing
        tables = LineCircleFilter(rover, coarse)
        found.append(0)
        for corners, motion in replace(way, lens=coarse, frames=46, speed_mps=0.6, seed=seed):
            tables.step(corners, motion)
            found[-1] += int(np.any(tables.rebel.active & (tables.rebel.trust >= 3)))
    assert np.mean(found) >= 28  # images of 46
