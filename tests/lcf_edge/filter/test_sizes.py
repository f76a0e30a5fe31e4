"""The same drive seen at two sizes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Config
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


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_a_wall_and_a_walker_are_found_where_they_are_at_every_size(
    drive: Drive, clutter: Landmarks, box: Landmarks, lens: Lens, scale: float
) -> None:
    wall = drive(box((0.0, -0.4, 6.0), (0.5, 0.9, 0.0), landmarks=40))
    walker = drive(box((-2.2, -0.6, 5), (0.5, 1.2, 0.3), landmarks=40), np.array([1.2, 0, 0]))
    way = replace(drive(clutter(150)) + wall + walker, frames=22)
    other = Lens(int(640 * scale), int(480 * scale), 500 * scale, 500 * scale, 320 * scale - 0.5, 240 * scale - 0.5)
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
