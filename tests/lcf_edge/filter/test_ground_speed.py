"""The vehicle's speed, from the ground seen below the horizon."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Camera, Config
from lcf_edge.ego_motion.inertial_speed import InertialSpeed
from lcf_edge.filter import LineCircleFilter
from lcf_edge.filter.ground_speed import GroundSpeed

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]


def ground(landmarks: int = 300, height_m: float = 0.3) -> npt.NDArray[np.float64]:
    """(n, 3) landmarks on the ground, left, right and ahead."""
    random = np.random.default_rng(3)
    x, z = random.uniform(-3, 3, landmarks), random.uniform(1.0, 12.0, landmarks)
    return np.stack([x, np.full(landmarks, height_m), z], axis=1)


def ground_speed(way: Any, speed_mps: float, config: Config | None = None) -> GroundSpeed:
    """The speed by the ground at the end of a drive of which a wrong speed was reported."""
    tables = LineCircleFilter(config or Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, replace(motion, speed_mps=speed_mps))
    return tables.ground


@pytest.mark.parametrize("wrong_mps", [2.0, 1.0, 3.0, -0.5])
def test_the_ground_shows_the_speed_whatever_was_reported(drive: Drive, clutter: Landmarks, wrong_mps: float) -> None:
    way = replace(drive(ground()) + drive(clutter(100)), frames=16)
    found = ground_speed(way, wrong_mps)
    assert found.speed_mps == pytest.approx(2.0, rel=0.1)
    assert abs(found.speed_mps - 2.0) < 2 * found.sigma_mps


def test_where_no_ground_is_seen_nothing_is_reported(drive: Drive, clutter: Landmarks) -> None:
    above = clutter(200) * np.array([1.0, 1.0, 1.0]) - np.array([0.0, 0.6, 0.0])
    assert math.isnan(ground_speed(replace(drive(above), frames=16), 2.0).speed_mps)


@pytest.mark.parametrize("away_m", [4.0, 6.0])
def test_a_wall_ahead_is_no_ground(drive: Drive, away_m: float) -> None:
    """Some of its rows agree on a speed, by which the ground would be as near there."""
    random = np.random.default_rng(5)
    wall = np.stack([*random.uniform(-2, 2, (2, 600)), np.full(600, away_m)], axis=1)
    assert math.isnan(ground_speed(replace(drive(wall), frames=16), math.nan).speed_mps)


def test_without_a_height_of_the_camera_nothing_is_reported(drive: Drive) -> None:
    config = Config(camera=Camera(height_m=0))
    assert math.isnan(ground_speed(replace(drive(ground()), frames=16), 2.0, config).speed_mps)


def test_a_speed_by_the_accelerometer_follows_the_ground_as_far_as_it_is_unsure() -> None:
    speed = InertialSpeed(0.01)
    up = np.array([0.0, -9.81, 0.0])
    speed.rest(up, 0.05, up, np.eye(3))
    for _ in range(40):  # 2 s at 0.5 m/s², of which the accelerometer measures half
        speed.advance(0.05, np.array([0.0, -9.81, 0.25]), np.eye(3), 0.0)
    before, doubt = speed.mean_mps, speed.sigma_mps
    for _ in range(20):
        speed.see_mean(1.0, 0.1, 0.05)
        speed.advance(0.05, np.array([0.0, -9.81, 0.0]), np.eye(3), 0.0)
    assert before == pytest.approx(0.5, abs=0.05)
    assert speed.mean_mps == pytest.approx(1.0, abs=0.1)
    assert speed.sigma_mps < doubt + 0.05
