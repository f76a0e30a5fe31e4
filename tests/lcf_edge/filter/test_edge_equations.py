"""Edges: exact answers of every equation on flow fields that are known."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.filter.edge_equations import (
    change_trust,
    classify,
    predict_place,
    predict_speed,
    trust_change,
    update_deviation,
    update_gate,
    update_position,
    update_speed,
)

DT_S = 0.5
BL_PX = 10.0
DELTA_PX = 2.0
EPS_BETA_RAD = math.radians(20)
BEYOND, FOLLOWS, DISAGREES, BREAKS, STAYS = range(1, 6)  # λ*

DIRECTIONS = [math.radians(45 * step) for step in range(-3, 5)]


def relation(beta: float, along_px: float, across_px: float = 0.0, *, step_px: float = 30.0) -> int:
    """λ* of a corner ``along_px`` beyond L' and ``across_px`` off the line; L' lies ``step_px`` from L."""
    cos, sin = math.cos(beta), math.sin(beta)
    ahead = along_px * cos - across_px * sin, along_px * sin + across_px * cos
    moved = ahead[0] + step_px * cos, ahead[1] + step_px * sin
    return classify(*moved, *ahead, cos, sin, step_px / DT_S, BL_PX, DELTA_PX, EPS_BETA_RAD)


# The five classes


@pytest.mark.parametrize("beta", DIRECTIONS)
@pytest.mark.parametrize("off", [(0, 0), (4.5, 0), (-4.5, 0), (0, 1.9), (0, -1.9)])
def test_2_follows_in_the_gate_on_the_line_as_predicted(beta: float, off: tuple[float, float]) -> None:
    assert relation(beta, *off) == FOLLOWS


@pytest.mark.parametrize("beta", DIRECTIONS)
@pytest.mark.parametrize("off", [(7, 0), (-7, 0), (9.5, 1.9)])
def test_3_disagrees_in_speed_when_it_is_more_than_half_the_gate_from_the_prediction(
    beta: float, off: tuple[float, float]
) -> None:
    assert relation(beta, *off) == DISAGREES


@pytest.mark.parametrize("beta", DIRECTIONS)
@pytest.mark.parametrize("across_px", [1.9, -1.9])
def test_3_disagrees_in_direction_when_it_moved_aside_by_more_than_20_degrees(beta: float, across_px: float) -> None:
    assert math.atan2(abs(across_px), 4.5) > EPS_BETA_RAD
    assert relation(beta, 0.0, across_px, step_px=4.5) == DISAGREES


@pytest.mark.parametrize("beta", DIRECTIONS)
@pytest.mark.parametrize("off", [(11, 0), (15, 1.9), (-15, 0), (200, 0)])
def test_1_beyond_the_gate_but_on_the_line(beta: float, off: tuple[float, float]) -> None:
    assert relation(beta, *off) == BEYOND


@pytest.mark.parametrize("beta", DIRECTIONS)
@pytest.mark.parametrize("off", [(-30, 0), (-22, 0), (-38, 0), (-30, 1.9)])
def test_5_stays_where_it_was_although_it_should_have_moved_out(beta: float, off: tuple[float, float]) -> None:
    assert relation(beta, *off) == STAYS


@pytest.mark.parametrize("beta", DIRECTIONS)
@pytest.mark.parametrize("off", [(0, 2.1), (0, -2.1), (5, 20), (-30, 3), (-60, -40)])
def test_4_breaks_every_law_when_it_left_the_line(beta: float, off: tuple[float, float]) -> None:
    assert relation(beta, *off) == BREAKS


@pytest.mark.parametrize("beta", DIRECTIONS)
def test_an_edge_that_comes_in_follows_when_it_goes_on_inwards(beta: float) -> None:
    """V is signed: a reversing vehicle sees what stands still flow inwards."""
    assert relation(beta, 0.0, step_px=-30.0) == FOLLOWS
    assert relation(beta, 60.0, step_px=-30.0) == BEYOND


# Where classes overlap: 2 before 3, both before 5, 5 before 1 (of which it is a part), 4 last


@pytest.mark.parametrize("beta", DIRECTIONS)
def test_near_both_the_prediction_and_the_previous_place_it_follows(beta: float) -> None:
    assert relation(beta, -4.0, step_px=6.0) == FOLLOWS


@pytest.mark.parametrize("beta", DIRECTIONS)
def test_near_both_but_disagreeing_it_is_no_5(beta: float) -> None:
    assert relation(beta, -8.0, step_px=12.0) == DISAGREES


@pytest.mark.parametrize("beta", DIRECTIONS)
def test_outside_the_gate_and_near_the_previous_place_it_is_no_1(beta: float) -> None:
    assert relation(beta, -12.0, step_px=12.0) == STAYS


@pytest.mark.parametrize("beta", DIRECTIONS)
@pytest.mark.parametrize("along_px", [0.0, -6.0, -12.0, 14.0])
def test_off_the_line_nothing_else_counts(beta: float, along_px: float) -> None:
    assert relation(beta, along_px, 2.5, step_px=12.0) == BREAKS


@given(
    beta=st.floats(-math.pi, math.pi),
    along=st.floats(-80, 80),
    across=st.floats(-20, 20),
    step=st.floats(-40, 40),
    turn=st.floats(-math.pi, math.pi),
)
def test_the_class_does_not_depend_on_the_direction(
    beta: float, along: float, across: float, step: float, turn: float
) -> None:
    """Away from the borders between classes: the answer at β is the answer at any other β."""
    answers = {
        relation(b, along + a, across + c, step_px=step)
        for b in (beta, beta + turn)
        for a in (-0.02, 0.02)
        for c in (-0.02, 0.02)
    }
    here = {relation(beta, along + a, across + c, step_px=step) for a in (-0.02, 0.02) for c in (-0.02, 0.02)}
    assert len(here) > 1 or answers == here


# Trust


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        (BEYOND, -1),
        (FOLLOWS, +1),
        (DISAGREES, -1),
        (BREAKS, 0),
        (STAYS, -1),
    ],
)
def test_trust_changes_by_class(kind: int, change: int) -> None:
    assert trust_change(kind) == change
    assert change_trust(3.0, trust_change(kind), 5.0) == 3.0 + change


def test_trust_is_never_more_than_the_most() -> None:
    assert [change_trust(trust, 1.0, 5.0) for trust in (4.0, 4.5, 5.0)] == [5.0, 5.0, 5.0]


# Updates


@pytest.mark.parametrize("beta", DIRECTIONS)
def test_prediction_goes_half_its_own_speed_and_half_the_expected_one(beta: float) -> None:
    speed = predict_speed(60, 40)
    assert speed == 50.0
    assert predict_place(100, speed, math.cos(beta), 0.5) == pytest.approx(100 + 25 * math.cos(beta))
    assert predict_place(50, speed, math.sin(beta), 0.5) == pytest.approx(50 + 25 * math.sin(beta))


@pytest.mark.parametrize(
    ("trust", "expected"),
    [(2.0, 16.0), (2.5, (0.5 * 10 + 16) / 1.5), (3.0, 13.0), (4.0, 12.0), (5.0, 11.5), (1.0, 16.0)],
)
def test_location_weighs_the_prediction_by_trust_above_the_critical(trust: float, expected: float) -> None:
    assert update_position(trust, 2.0, 10, 16) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("trust", "beyond_px", "expected"), [(2.0, 6.0, 62.0), (2.0, -6.0, 38.0), (4.0, 6.0, 54.0), (4.0, -6.0, 46.0)]
)
def test_speed_takes_the_residual_along_the_line(trust: float, beyond_px: float, expected: float) -> None:
    """50 px/s and 6 px in half a second, at weight 1/((Tr - Tr_cr) + 1)."""
    assert update_speed(trust, 2.0, 50, beyond_px, 0.5) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("bl", "speed", "predicted", "corr", "expected"),
    [
        (20, 60, 50, 1.0, 12.5),
        (20, 60, 50, 0.5, 15.0),
        (20, 50, 60, 0.5, 15.0),
        (4, 50, 50, 1.0, 3.0),
        (20, 90, 50, 0.5, 25.0),
    ],
)
def test_gate_learns_from_the_error_of_speed(
    bl: float, speed: float, predicted: float, corr: float, expected: float
) -> None:
    """½(|V' - V|·t_f/Corr + BL) between 3 and 25 px."""
    assert update_gate(bl, speed, predicted, corr, 0.5, 3.0, 25.0) == expected


@given(st.floats(-0.45, 0.45), st.floats(-0.5, 0.5))
def test_deviation_converges_to_a_constant_turn(turn: float, deviation: float) -> None:
    error = abs(deviation - turn)
    for _ in range(20):
        deviation = update_deviation(deviation, turn)
        assert abs(deviation - turn) <= max(0.6 * error, 1e-4)
        error = abs(deviation - turn)


@pytest.mark.parametrize("turns", [-2, 0, 3])
@pytest.mark.parametrize(("deviation", "turn", "expected"), [(0.1, 0.3, 0.2), (0.0, -0.4, -0.2), (0.2, 0.2, 0.2)])
def test_deviation_halves_its_error_across_the_cut_too(
    deviation: float, turn: float, expected: float, turns: int
) -> None:
    assert update_deviation(deviation, turn + 2 * math.pi * turns) == pytest.approx(expected)
