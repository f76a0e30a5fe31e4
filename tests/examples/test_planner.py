"""The reference planner keeps the rule that it states."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from examples.planner import CLOSE_M, HALF_STANDS_M, PATIENCE_S, REST_S, Planner, Vehicle, good_speed
from lcf_edge.messages import OBJECT, ObjectClass

VEHICLE = Vehicle()
CRUISE = 1.5


def thing(**values) -> np.ndarray:
    """A walker straight ahead that stands and will be met, known well."""
    row = np.zeros(1, OBJECT)
    usual = {
        "class_id": ObjectClass.STANDING,
        "width": 40,
        "ttc": 2.0,
        "range": 3.0,
        "closest": 2.0,
        "probability": 1.0,
    }
    for name, value in {**usual, **values}.items():
        row[name] = value
    return row


def crossing(x_m: float, z_m: float, right_mps: float, **values) -> np.ndarray:
    usual = {"range": z_m, "bearing": math.atan2(x_m, z_m), "v_right": right_mps, "class_id": ObjectClass.CROSSING}
    return thing(**{**usual, "v_right_sigma": 0.1, "closest": math.nan, **values})


def test_with_nothing_ahead_it_cruises() -> None:
    assert good_speed(np.zeros(0, OBJECT), 1.0, CRUISE, VEHICLE) == CRUISE


def test_it_stops_for_what_stands_in_the_way() -> None:
    assert good_speed(thing(range=VEHICLE.gap_m), CRUISE, CRUISE, VEHICLE) == 0.0


@given(st.floats(0.0, 20.0), st.floats(0.1, 4.0))
def test_it_is_slow_enough_to_stop_before_what_it_will_meet(range_m: float, cruise: float) -> None:
    speed = good_speed(thing(range=range_m, ttc=1.0), cruise, cruise, VEHICLE)
    stops_m = speed * VEHICLE.delay_s + speed**2 / 2 / VEHICLE.braking_mps2
    horizon_m = cruise * 4.0
    assert stops_m <= max(range_m - VEHICLE.gap_m, 0.0) + 1e-3 or horizon_m < range_m


def test_it_passes_what_stands_beside_the_path() -> None:
    assert good_speed(thing(range=2.0, probability=0.0), 1.0, CRUISE, VEHICLE) == CRUISE


def test_standing_it_judges_by_the_lateral_miss() -> None:
    beside = thing(range=1.0, lateral=1.2, lateral_sigma=0.1, closest=math.nan, probability=0.0)
    before = thing(range=0.6, lateral=0.1, lateral_sigma=0.1, closest=math.nan, probability=0.0)
    assert good_speed(beside, 0.0, CRUISE, VEHICLE) == CRUISE
    assert good_speed(before, 0.0, CRUISE, VEHICLE) == 0.0


def test_at_rest_it_waits_for_whatever_moves_close_by() -> None:
    """Wherever it seems to go: what fills the image is measured worst."""
    leaves = crossing(1.0, CLOSE_M - 0.1, 1.5)
    assert good_speed(leaves, 0.0, CRUISE, VEHICLE) == 0.0
    assert good_speed(leaves, 0.5, CRUISE, VEHICLE) > 0.0
    assert good_speed(crossing(1.0, CLOSE_M + 0.1, 1.5), 0.0, CRUISE, VEHICLE) == CRUISE


def test_who_will_have_left_the_path_costs_no_stop() -> None:
    leaves = crossing(0.2, 5.0, 1.5)
    assert good_speed(leaves, CRUISE, CRUISE, VEHICLE) > 0.8 * CRUISE


def test_it_slows_down_for_who_will_be_in_the_way() -> None:
    comes = crossing(-1.5, 1.8, 1.0)
    assert good_speed(comes, CRUISE, CRUISE, VEHICLE) < CRUISE


def test_who_walks_away_to_the_side_is_left_alone() -> None:
    assert good_speed(crossing(1.5, 3.0, 1.2), CRUISE, CRUISE, VEHICLE) == CRUISE


def test_of_a_wide_box_no_more_than_the_rule_says_counts() -> None:
    reach_m = VEHICLE.half_width_m + VEHICLE.margin_m
    unjudged = {"range": 0.6, "lateral_sigma": 0.01, "closest": math.nan, "probability": 0.0, "width": 5000}
    beside, before = (thing(lateral=reach_m + HALF_STANDS_M + aside, **unjudged) for aside in (0.1, -0.1))
    assert good_speed(beside, 0.0, CRUISE, VEHICLE) == CRUISE
    assert good_speed(before, 0.0, CRUISE, VEHICLE) == 0.0


def test_what_goes_ahead_leaves_its_own_way_to_stop() -> None:
    stays, leads = (crossing(0.0, 1.2, 0.0, v_forward=ahead_mps) for ahead_mps in (0.0, 1.0))
    slow, fast = (good_speed(each, CRUISE, CRUISE, VEHICLE) for each in (stays, leads))
    assert slow < fast


def test_the_time_to_contact_stands_in_for_an_unknown_range() -> None:
    known = good_speed(thing(range=CRUISE * 0.8, ttc=0.8), CRUISE, CRUISE, VEHICLE)
    assert good_speed(thing(range=math.nan, ttc=0.8), CRUISE, CRUISE, VEHICLE) == known < CRUISE


@pytest.mark.parametrize("name", ["bearing", "v_right", "v_forward", "lateral", "lateral_sigma", "v_right_sigma"])
def test_an_unknown_number_makes_no_unknown_speed(name: str) -> None:
    for kind in ObjectClass:
        speed = good_speed(thing(**{name: math.nan}, class_id=kind), 1.0, CRUISE, VEHICLE)
        assert 0.0 <= speed <= CRUISE


def test_without_range_and_contact_it_is_left_out() -> None:
    assert good_speed(thing(range=math.nan, ttc=math.inf), 1.0, CRUISE, VEHICLE) == CRUISE


@pytest.mark.parametrize(("speed_mps", "patience_s"), [(0.5, PATIENCE_S), (0.0, REST_S)])
def test_a_higher_speed_has_to_be_good_for_a_while_and_a_lower_one_in_two_scenes(
    speed_mps: float, patience_s: float
) -> None:
    """For longer where the vehicle rests."""
    planner, nothing, wall = Planner(VEHICLE), np.zeros(0, OBJECT), thing(range=0.5)
    target_mps = [planner.target_mps(nothing, speed_mps, CRUISE, 0.1) for _ in range(12)]
    patient = round(patience_s / 0.1)
    assert target_mps[: patient - 1] == [0.0] * (patient - 1)
    assert target_mps[patient] == CRUISE
    for things, wanted_mps in ((wall, CRUISE), (nothing, CRUISE), (wall, CRUISE), (wall, 0.0), (nothing, 0.0)):
        assert planner.target_mps(things, CRUISE, CRUISE, 0.1) == wanted_mps
