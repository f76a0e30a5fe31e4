"""A shaken camera shows how long its rolling shutter reads an image."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Config
from lcf_edge.filter import LineCircleFilter
from lcf_edge.filter.inputs import UNKNOWN

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]


@pytest.fixture(scope="module")
def shaken(drive: Drive, clutter: Landmarks) -> Any:
    """A street, seen by a camera that shakes by 1°."""
    return replace(drive(clutter(600)), frames=60, shake_rad=0.0175, sigma_rad=0.002)


def after(way: Any) -> Any:
    tables = LineCircleFilter(Config(), way.lens)
    for taken in way:
        tables.step(*taken)
    return tables.shutter


@pytest.mark.parametrize("readout_s", [0.012, 0.02, 0.03, -0.02])
def test_the_readout_time_is_found_within_its_sigma(shaken: Any, readout_s: float) -> None:
    shutter = after(replace(shaken, readout_s=readout_s))
    assert shutter.readout_s == pytest.approx(readout_s, rel=0.15)
    assert abs(shutter.readout_s - readout_s) < 3 * shutter.sigma_s
    assert shutter.is_known


def test_it_matters_where_it_displaces_rows(shaken: Any) -> None:
    assert after(replace(shaken, readout_s=0.03)).matters


def test_who_crosses_changes_nothing(shaken: Any, drive: Drive, box: Landmarks) -> None:
    walkers = drive(box((-2.0, -0.4, 6.0), (1.0, 1.6, 0.3), landmarks=80), np.array([1.0, 0.0, 0.0]))
    shutter = after(replace(shaken + walkers, readout_s=0.02))
    assert abs(shutter.readout_s - 0.02) < 3 * shutter.sigma_s


def test_rows_read_at_once_are_no_rolling_shutter(shaken: Any) -> None:
    shutter = after(shaken)
    assert abs(shutter.readout_s) < 3 * shutter.sigma_s
    assert not shutter.is_known


def test_a_short_readout_is_not_told(shaken: Any) -> None:
    shutter = after(replace(shaken, readout_s=0.008))
    assert shutter.readout_s == pytest.approx(0.008, abs=2 * shutter.sigma_s)
    assert not shutter.is_known


def test_a_camera_that_does_not_shake_shows_nothing(shaken: Any) -> None:
    shutter = after(replace(shaken, readout_s=0.03, shake_rad=0.0))
    assert math.isnan(shutter.readout_s)
    assert not shutter.matters


def test_a_known_shutter_does_not_matter_while_the_rows_hardly_move(shaken: Any) -> None:
    shutter = after(replace(shaken, readout_s=0.03, shake_rad=0.004, frames=200))
    assert shutter.is_known
    assert not shutter.matters


def test_without_a_gyro_nothing_is_known(shaken: Any) -> None:
    tables = LineCircleFilter(Config(), shaken.lens)
    for corners, motion in replace(shaken, readout_s=0.03):
        tables.step(corners, replace(motion, rate_radps=UNKNOWN))
    assert math.isnan(tables.shutter.readout_s)
