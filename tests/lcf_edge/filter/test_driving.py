"""Whether the vehicle drives, as the image shows, whatever speed is measured."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Config
from lcf_edge.filter import LineCircleFilter

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]

SOON = 10  # images, 0.5 s


def verdicts(way: Any, measured_mps: float) -> Iterator[bool]:
    """The verdict after each step of a filter that gets this speed."""
    tables = LineCircleFilter(Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, replace(motion, speed_mps=measured_mps))
        yield tables.drives


@pytest.fixture(scope="session")
def street(drive: Drive, clutter: Landmarks) -> Any:
    """What stands on both sides of the path."""
    return drive(clutter(300))


@pytest.mark.parametrize("measured_mps", [0.0, math.nan, 2.0])
def test_who_drives_is_seen_to_drive_whatever_speed_is_measured(street: Any, measured_mps: float) -> None:
    assert all(list(verdicts(street, measured_mps))[SOON:])


def test_a_speed_that_drifts_about_zero_does_not_hide_it(street: Any) -> None:
    """Of an accelerometer, which took a smooth drive for a rest: its sign is no reverse."""
    tables, verdicts = LineCircleFilter(Config(), street.lens), []
    for number, (corners, motion) in enumerate(street):
        tables.step(corners, replace(motion, speed_mps=-0.01 if number % 6 < 3 else 0.01))
        verdicts.append(tables.drives)
    assert all(verdicts[SOON:])


@pytest.mark.parametrize("measured_mps", [0.0, math.nan])
def test_who_stands_is_not(street: Any, measured_mps: float) -> None:
    assert not any(verdicts(replace(street, speed_mps=0.0), measured_mps))


def test_who_stands_is_not_though_somebody_comes_straight_at_it(street: Any, drive: Drive, box: Landmarks) -> None:
    """Who comes flows out from O as well, on both sides, but the street does not."""
    comes = drive(box((0.0, -0.4, 5.0), (0.8, 1.6, 0.2), landmarks=80), np.array([0.0, 0.0, -1.5]))
    assert not any(verdicts(replace(street + comes, speed_mps=0.0), 0.0))


def test_who_stands_is_not_though_traffic_passes_on_both_sides(drive: Drive, box: Landmarks) -> None:
    """Even where nothing that stands is in sight, and one side drives away."""
    comes = drive(box((-3.0, -0.4, 12.0), (2.0, 1.6, 4.0), landmarks=120), np.array([0.0, 0.0, -4.0]))
    goes = drive(box((3.0, -0.4, 5.0), (2.0, 1.6, 4.0), landmarks=120), np.array([0.0, 0.0, 4.0]))
    assert not any(verdicts(replace(comes + goes, speed_mps=0.0), 0.0))


def test_who_drives_is_seen_to_drive_though_most_of_the_scene_is_far_ahead(
    street: Any, drive: Drive, box: Landmarks
) -> None:
    """Near O it hardly flows at any speed."""
    skyline = drive(box((0.0, -2.0, 200.0), (24.0, 12.0, 0.0), landmarks=600))
    assert all(list(verdicts(street + skyline, 0.0))[SOON:])


def test_who_stands_is_not_though_some_come_on_both_sides_if_others_cross(drive: Drive, box: Landmarks) -> None:
    left, right = (
        drive(box((x, -0.4, 9.0), (2.0, 1.6, 3.0), landmarks=150), np.array([0.0, 0.0, -3.0])) for x in (-3.0, 3.0)
    )
    crosses = drive(box((-1.2, -0.4, 6.0), (1.6, 1.6, 0.3), landmarks=260), np.array([1.0, 0.0, 0.0]))
    assert not any(verdicts(replace(left + right + crosses, speed_mps=0.0), 0.0))
