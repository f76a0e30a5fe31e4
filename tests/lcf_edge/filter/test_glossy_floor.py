"""A floor that mirrors shows things that lie far under it."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Camera, Config
from lcf_edge.filter import LineCircleFilter
from lcf_edge.messages import Cause

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]

HEIGHT_M = Config().camera.height_m


def level(y_m: float, landmarks: int, seed: int = 3) -> npt.NDArray[np.float64]:
    """(n, 3) landmarks on a level plane, left, right and ahead."""
    random = np.random.default_rng(seed)
    x, z = random.uniform(-3, 3, landmarks), random.uniform(1.0, 16.0, landmarks)
    return np.stack([x, np.full(landmarks, y_m), z], axis=1)


@pytest.fixture(scope="module")
def dull(drive: Drive, clutter: Landmarks) -> Any:
    """A street on a plane."""
    return replace(drive(level(HEIGHT_M, 200)) + drive(clutter(100)), frames=40)


@pytest.fixture(scope="module")
def glossy(dull: Any, drive: Drive) -> Any:
    """The same below lamps 2 m above the camera, which are seen mirrored."""
    return dull + drive(level(2.0 + 2 * HEIGHT_M, 200, seed=4))


def verdicts(way: Any, config: Config | None = None, speed_mps: float | None = None) -> list[bool]:
    tables = LineCircleFilter(config or Config(), way.lens)
    seen = []
    for corners, motion in way:
        tables.step(corners, motion if speed_mps is None else replace(motion, speed_mps=speed_mps))
        seen.append(tables.floor.is_glossy)
    return seen


def test_a_glossy_floor_is_seen_after_a_second_and_not_before(glossy: Any) -> None:
    seen = verdicts(glossy)
    assert not any(seen[:20])
    assert all(seen[25:])


def test_a_dull_one_is_none(dull: Any) -> None:
    assert not any(verdicts(dull))


def test_it_ends_after_some_seconds_on_a_dull_one(glossy: Any, dull: Any) -> None:
    tables = LineCircleFilter(Config(), dull.lens)
    for corners, motion in (*glossy, *6 * list(dull)):
        tables.step(corners, motion)
    assert not tables.floor.is_glossy


def test_people_who_walk_ahead_are_no_mirror(dull: Any, drive: Drive, box: Landmarks) -> None:
    """They are near, though they flow as what is far."""
    people = drive(box((0.0, 0.0, 3.0), (1.2, 0.5, 0.3), landmarks=40), np.array([0.0, 0.0, 1.5]))
    assert not any(verdicts(dull + people))


def leads(way: Any, *, glossy: bool) -> bool:
    """Whether a circle ever leads, if the floor is taken for glossy, or for dull."""
    tables, led = LineCircleFilter(Config(), way.lens), False
    for corners, motion in way:
        tables.floor.is_glossy = glossy
        tables.floor.under_s, tables.floor.seen_s = (1e9, 1e9) if glossy else (0.0, 1e9)
        tables.step(corners, motion)
        led |= Cause.LEADING in tables.rebel.cause[tables.rebel.active & (tables.rebel.trust >= 3)]
    return led


@pytest.mark.parametrize(("height_share", "on_glossy"), [(0.4, False), (0.9, True)], ids=["low", "high"])
def test_above_a_glossy_floor_what_is_less_than_half_as_high_as_the_camera_does_not_lead(
    dull: Any, drive: Drive, box: Landmarks, height_share: float, on_glossy: bool
) -> None:
    """It may be a mirrored lamp. Above a dull floor it leads if it shows enough edges."""
    height_m = height_share * HEIGHT_M
    thing = drive(box((0.0, HEIGHT_M - height_m / 2, 1.5), (0.5, height_m, 0.0), landmarks=40), np.array([0, 0, 2.2]))
    assert leads(dull + thing, glossy=False)
    assert leads(dull + thing, glossy=True) == on_glossy


@pytest.mark.parametrize("share", [0.65, 1.5])
def test_a_height_that_is_somewhat_wrong_makes_no_mirror(dull: Any, share: float) -> None:
    assert not any(verdicts(dull, Config(camera=Camera(height_m=share * HEIGHT_M))))


@pytest.mark.parametrize("speed_mps", [0.0, math.nan])
def test_without_a_speed_nothing_is_said(glossy: Any, speed_mps: float) -> None:
    assert not any(verdicts(glossy, speed_mps=speed_mps))


def test_without_a_height_of_the_camera_nothing_is_said(glossy: Any) -> None:
    assert not any(verdicts(glossy, Config(camera=Camera(height_m=0))))
