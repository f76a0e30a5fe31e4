"""What stands ahead and comes slowly is found by how much a piece of the image grows, though its corners flicker."""

import math

import numpy as np
import pytest

from lcf_edge.config import Camera, Config, Filter, Memory, Vehicle, load
from lcf_edge.filter import LineCircleFilter
from lcf_edge.messages import Cause
from tests.lcf_edge.filter.boards import LENS, Board

VEHICLE = Vehicle(half_width_m=0.3, height_m=1.5, horizon_s=5.0)
CONFIG = Config(vehicle=VEHICLE)


def driven(board: Board, config: Config = CONFIG) -> list[LineCircleFilter]:
    """The filter after the drive, once for each frame in which it reported a rebel circle; the last one always."""
    tables, reported = LineCircleFilter(config, LENS), []
    for corners, motion, image in board:
        tables.step(corners, motion, image)
        if (tables.rebel.active & (tables.rebel.trust >= config.filter.tr_s)).any():
            reported.append(tables)
    return reported


def without_patches(config: Config) -> Config:
    return Config(vehicle=config.vehicle, filter=Filter(patches=0))


def test_what_stands_ahead_is_found_with_its_range_where_corners_do_not_show_it() -> None:
    board = Board()
    assert not driven(board, without_patches(CONFIG))
    tables = LineCircleFilter(CONFIG, LENS)
    ranges_m = []
    for seq, (corners, motion, image) in enumerate(board):
        tables.step(corners, motion, image)
        rebel = tables.rebel
        for c in np.flatnonzero(rebel.active & (rebel.trust >= 3)):
            assert rebel.cause[c] == Cause.INCOMING
            assert rebel.ttc[c] * board.speed_mps == pytest.approx(rebel.range[c], rel=0.3)
            assert abs(rebel.lateral[c]) < VEHICLE.half_width_m
            ranges_m.append(rebel.range[c] / board.distance_m(seq))
    assert len(ranges_m) > 10
    assert np.median(ranges_m) == pytest.approx(1.0, abs=0.15)


def test_at_the_rim_of_the_way_it_is_reported_without_a_gap() -> None:
    tables = LineCircleFilter(CONFIG, LENS)
    told = []
    for corners, motion, image in Board(right_m=VEHICLE.half_width_m):
        tables.step(corners, motion, image)
        told.append(bool((tables.rebel.active & (tables.rebel.trust >= CONFIG.filter.tr_s)).any()))
    assert sum(told) > 30
    assert all(told[told.index(True) :])


def test_what_two_patches_have_founded_one_confirms() -> None:
    """Patches end after a while, and blur loses some: a circle is not founded anew each time."""
    tables, board = LineCircleFilter(CONFIG, LENS), Board()
    patches, rebel, alone, frames = tables.patches, tables.rebel, -1, 0
    for seq, (corners, motion, image) in enumerate(board):
        tables.step(corners, motion, image)
        if alone >= 0 and not patches.active[alone]:
            break
        told = (rebel.active & (rebel.trust >= CONFIG.filter.tr_s)).any()
        if alone < 0 and told and board.distance_m(seq) < 0.9 * VEHICLE.horizon_s * board.speed_mps:
            alone = int(np.flatnonzero(np.asarray(patches.circle) >= 0)[0])
        if alone >= 0:
            np.asarray(patches.active)[np.arange(patches.capacity) != alone] = 0
            frames += 1
            assert told
    assert frames > 10


LEVEL = Config(vehicle=VEHICLE, camera=Camera(height_m=0.45))
TILTED = Config(vehicle=VEHICLE, camera=Camera(height_m=0.45, pitch_rad=-0.05))  # which is wrong


@pytest.mark.parametrize("seed", [0, 1])
def test_pieces_one_above_the_other_and_as_far_are_not_of_the_ground_wherever_the_horizon_is(seed: int) -> None:
    assert len(driven(Board(height_m=0.9, floor_m=0.45, seed=seed), TILTED)) > 18


@pytest.mark.parametrize("seed", range(3))
def test_a_floor_is_nothing_that_stands(seed: int) -> None:
    beyond = Board(range_m=60.0, floor_m=0.45, flicker=0.3, seed=seed)
    assert not driven(beyond, LEVEL)


def test_it_is_an_object_that_stands() -> None:
    tables = LineCircleFilter(CONFIG, LENS)
    reported = 0
    for corners, motion, image in Board():
        tables.step(corners, motion, image)
        reported += int((tables.objects.active & (tables.objects.trust >= 3)).any())
    assert reported > 5


@pytest.mark.parametrize(
    "board",
    [
        pytest.param(Board(right_m=1.2), id="beside the way"),
        pytest.param(Board(range_m=30.0, width_m=4.0, height_m=4.0), id="beyond the horizon"),
        pytest.param(Board(yaw_rate_radps=0.4), id="in a turn, which leaves it aside"),
        pytest.param(Board(speed_mps=0.0, measured_mps=1.0, frames=40), id="while nothing comes nearer"),
    ],
)
def test_what_will_not_be_met_is_not_reported(board: Board) -> None:
    assert not driven(board)


@pytest.mark.parametrize("speed_mps", [1.5, 2.4, 3.6])
def test_without_a_speed_it_is_found_with_its_time_and_no_range_but_by_its_foot(speed_mps: float) -> None:
    """4 widths a second, 2.4 m/s, are assumed, and what stands ahead is met at any speed."""
    board, tables, found = Board(speed_mps=speed_mps, measured_mps=math.nan), LineCircleFilter(CONFIG, LENS), []
    for seq, (corners, motion, image) in enumerate(board):
        tables.step(corners, motion, image)
        rebel = tables.rebel
        for c in np.flatnonzero(rebel.active & (rebel.trust >= CONFIG.filter.tr_s)):
            assert rebel.cause[c] == Cause.INCOMING
            assert math.isnan(rebel.range[c]) or rebel.range[c] in tables.objects.range
            found.append(rebel.ttc[c] * speed_mps / board.distance_m(seq))
    assert len(found) > 10
    assert np.median(found) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("right_m", [-1.2, 1.2])
def test_without_a_speed_what_stands_beside_is_none_of_them(right_m: float) -> None:
    assert not driven(Board(right_m=right_m, measured_mps=math.nan))


def test_the_paper_s_profile_has_none() -> None:
    assert load(None, ["filter.profile=paper"]).filter.patches == 0


def test_a_full_table_of_circles_is_no_fault() -> None:
    few = Config(vehicle=VEHICLE, memory=Memory(circles_rebel=1, objects=1))
    assert driven(Board(), few)
