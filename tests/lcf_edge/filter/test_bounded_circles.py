"""What C_r never is: paint, larger than what shows it, kept without evidence, or an absurd number."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Config
from lcf_edge.filter import Corners, LineCircleFilter, Motion, rebel_circles, rebel_groups
from lcf_edge.filter.rebel_groups import RebelGroups
from lcf_edge.lens import Lens
from lcf_edge.messages import Cause

HORIZON_S = 4.0
EXTENT_SIGMAS = 3.6
FARTHEST_M = 1000.0
HORIZONS = 10.0
COAST_S = 0.1 * HORIZON_S

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]
Situation = Callable[..., Any]


# Paint


def lies_flat(
    around: Any, top_px: float, foot_px: float, *, edges: int = 8, short: int = 8, level: bool = True
) -> bool:
    """A group of ``edges`` from ``top_px`` to ``foot_px`` under the horizon; ``short``: that fall short of the flow."""
    groups = RebelGroups(10, 2)
    groups.groups = 1
    members = groups.members
    members.size[0], members.y[0] = edges, around.horizon_y + 0.5 * (top_px + foot_px)
    members.variance_y[0] = ((foot_px - top_px) / EXTENT_SIGMAS) ** 2
    groups.inwards[0], groups.mean_s[0] = short, 0.4
    if level:  # upright: everywhere the same expansion
        groups.focus_rate[0], groups.focus_r2[0] = 100.0, 1e4
    return bool(rebel_groups.is_flat(groups, 0, members, around))


def test_a_thin_strip_on_the_ground_is_flat(situation: Situation) -> None:
    assert lies_flat(situation(camera_height_m=0.3), 70.0, 80.0)


def test_what_reaches_up_from_its_foot_is_not(situation: Situation) -> None:
    assert not lies_flat(situation(camera_height_m=0.3), 40.0, 80.0)


@pytest.mark.parametrize(("edges", "mirrors"), [(8, True), (6, False)], ids=["a glossy floor", "few edges"])
def test_where_lamps_may_be_mirrored_a_leader_reaches_up_to_half_the_height_of_the_camera(
    situation: Situation, edges: int, mirrors: bool
) -> None:
    around = situation(camera_height_m=0.3)
    assert not lies_flat(around, 50.0, 80.0)
    around.floor_mirrors = mirrors
    assert lies_flat(around, 50.0, 80.0, edges=edges, short=edges)
    assert not lies_flat(around, 30.0, 80.0, edges=edges, short=edges)


@pytest.mark.parametrize("short", [0, 1, 4])
def test_what_does_not_mostly_fall_short_of_the_flow_is_no_paint(situation: Situation, short: int) -> None:
    assert not lies_flat(situation(camera_height_m=0.3), 70.0, 80.0, short=short)


def test_what_is_about_the_horizon_is_not_flat(situation: Situation) -> None:
    assert not lies_flat(situation(camera_height_m=0.3), -20.0, 20.0)


def test_paint_that_keeps_station_does_not_lead(drive: Drive, clutter: Landmarks) -> None:
    """As the end of a lane line does, that is always where the image ends."""
    random = np.random.default_rng(5)
    strip = np.stack([random.uniform(-0.3, 0.3, 40), np.full(40, 0.3), random.uniform(2.0, 2.3, 40)], axis=1)
    way = replace(drive(clutter(200)) + drive(strip, np.array([0, 0, 2.0])), frames=18)
    tables = LineCircleFilter(Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, motion)
        published = tables.rebel.active & (tables.rebel.trust >= 3)
        assert Cause.LEADING not in tables.rebel.cause[published]


# Extents


@given(st.floats(0, 1e6), st.floats(0, 1e3))
def test_an_extent_is_no_larger_than_twice_what_shows_it(size_px: float, shown_px: float) -> None:
    bounded = rebel_circles.bounded(size_px, shown_px)
    assert bounded <= size_px
    assert bounded <= 2 * max(shown_px, 12)
    assert bounded == size_px or bounded == pytest.approx(2 * max(shown_px, 12))


# The end


def test_a_circle_that_finds_nothing_more_coasts_no_longer_than_its_time(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """A wall that is near, and is gone all at once."""
    wall = drive(box((0.0, -0.4, 4.0), (0.6, 0.9, 0.0), landmarks=40))
    street = drive(clutter(200))
    with_wall, without = list(replace(street + wall, frames=45)), list(replace(street, frames=45))
    tables = LineCircleFilter(Config(), street.lens)
    gone = 32
    for corners, motion in with_wall[:gone]:
        tables.step(corners, motion)
    met = tables.rebel.active & (tables.rebel.trust >= 3)
    assert met.any()
    ids = set(tables.rebel.id[met].tolist())
    frames_to_end = round((COAST_S + 5 / 20) * 20)  # then trust runs out
    for corners, motion in without[gone : gone + frames_to_end]:
        tables.step(corners, motion)
    assert not ids & set(tables.rebel.id[tables.rebel.active].tolist())


# No absurd numbers


def check(tables: LineCircleFilter) -> None:
    """What holds of every rebel circle."""
    rebel = tables.rebel
    for row in np.flatnonzero(rebel.active):
        for metres in (float(rebel.range[row]), float(rebel.lateral[row])):
            assert math.isnan(metres) or abs(metres) <= FARTHEST_M
        ttc = float(rebel.ttc[row])
        assert ttc == math.inf or 0 < ttc <= HORIZONS * HORIZON_S
        assert np.isfinite([rebel.x[row], rebel.y[row], rebel.width[row], rebel.height[row]]).all()
        assert rebel.radius[row] > 0


@given(
    st.integers(0, 10_000),
    st.floats(-30, 60),
    st.floats(-1, 1),
    st.sampled_from([0.005, 0.05, 0.5]),
    st.sampled_from([0.0, 0.02]),
)
def test_whatever_is_seen_no_number_is_absurd(
    seed: int, speed_mps: float, yaw_rate_radps: float, dt_s: float, sigma_rad: float
) -> None:
    """A swarm of corners of which each goes its own way."""
    random, tables = np.random.default_rng(seed), LineCircleFilter(Config(), Lens(640, 480, 500, 500, 319.5, 239.5))
    at, step = random.uniform(0, [640, 480], (150, 2)), random.normal(0, 4, (6, 2))
    looks, swarm = random.integers(0, 256, (150, 16), np.uint8), random.integers(0, 6, 150)
    for _ in range(14):
        at += step[swarm] + random.normal(0, 0.3, at.shape)
        seen = ((at >= 0) & (at < (639, 479))).all(axis=1)
        pixel = np.rint(at[seen]).astype(np.int32)
        motion = Motion(dt_s, np.eye(3), sigma_rad, speed_mps, yaw_rate_radps)
        tables.step(Corners(pixel, pixel.astype(np.float32), looks[seen]), motion)
        check(tables)


@pytest.mark.parametrize("closing_mps", [-1.9, 0.0, 1.5, 12.0])
@pytest.mark.parametrize("range_m", [1.0, 6.0, 60.0])
def test_on_a_drive_no_number_is_absurd(
    drive: Drive, box: Landmarks, clutter: Landmarks, closing_mps: float, range_m: float
) -> None:
    size = 0.1 * range_m
    thing = drive(box((0.3, -0.2, range_m), (size, size, 0.1), landmarks=40), np.array([0.2, 0, -closing_mps]))
    way = replace(drive(clutter(200)) + thing, frames=40)
    tables = LineCircleFilter(Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, motion)
        check(tables)
