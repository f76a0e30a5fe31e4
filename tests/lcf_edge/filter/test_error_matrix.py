"""The variances of an edge are those of many edges that were followed with the same gains."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Config
from lcf_edge.filter import baselines as lines
from lcf_edge.filter import error_matrix
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.error_matrix import MotionError
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import EdgeTable

PINHOLE = Pinhole(480.0, 520.0, 310.0, 250.0)  # px that are not square
DT_S = 0.05
TR_CR = 2.0
CORNER_PX = 0.4
SLOT = 2

place = st.tuples(st.floats(20, 620), st.floats(20, 460))
angle = st.floats(-math.pi, math.pi)
seed = st.integers(0, 1000)
trusts = st.lists(st.none() | st.floats(TR_CR, 6.0), min_size=1, max_size=12)  # none: no corner is found


def situation(**changes: Any) -> Situation:
    around = Situation(Config(), PINHOLE)
    for name, value in changes.items():
        setattr(around, name, value)
    return around


def in_direction(error: MotionError, beta: float) -> float:
    """Variance, px²."""
    return float(error_matrix.variance(error, math.cos(beta), math.sin(beta)))


class Followed:
    """One edge, and 4000 errors of edges like it, along (place, speed) and across (place) their direction."""

    def __init__(self, random: np.random.Generator, speed_sigma_pxps: float) -> None:
        self.random, self.table = random, EdgeTable(1, 1, 1)
        self.table.append(1)
        self.along, self.across = random.normal(0, CORNER_PX, (2, 4000))
        self.speed = random.normal(0, speed_sigma_pxps, 4000)
        error_matrix.start(self.table.columns, 0, CORNER_PX**2, speed_sigma_pxps**2)

    def go_on(self, trust: float | None) -> None:
        edges, random, number = self.table.columns, self.random, len(self.along)
        error_matrix.predict(edges, 0, DT_S)
        self.along += DT_S * self.speed
        if trust is None:
            return
        share = 1 / (trust - TR_CR + 1)
        error_matrix.correct(edges, 0, share, CORNER_PX**2, DT_S)
        ahead, aside = random.normal(0, CORNER_PX, (2, number)) - (self.along, self.across)
        self.along += share * ahead
        self.speed += share * ahead / DT_S
        self.across += share * aside


@given(trusts, seed, st.floats(0, 200))
def test_variances_are_those_of_edges_that_are_followed(
    frames: list[float | None], seed: int, speed_sigma_pxps: float
) -> None:
    followed = Followed(np.random.default_rng(seed), speed_sigma_pxps)
    for trust in frames:
        followed.go_on(trust)
    edges = followed.table
    expected = np.cov(followed.along, followed.speed)
    assert edges.variance_along[0] == pytest.approx(expected[0, 0], rel=0.2)
    assert edges.variance_speed[0] == pytest.approx(expected[1, 1], rel=0.2, abs=1e-9)
    scale = math.sqrt(expected[0, 0] * expected[1, 1])
    assert edges.covariance_speed[0] == pytest.approx(expected[0, 1], abs=0.1 * scale + 1e-9)
    assert edges.variance_across[0] == pytest.approx(np.var(followed.across), rel=0.2)


def test_an_edge_is_better_known_across_its_direction_than_along_it() -> None:
    """Across it does not move, and the mean of its corners is its place; along, its speed must be found too."""
    followed = Followed(np.random.default_rng(0), 40.0)
    for _ in range(30):
        followed.go_on(5.0)
    assert followed.table.variance_across[0] < 0.5 * followed.table.variance_along[0] < 0.5 * CORNER_PX**2


@given(place, angle, seed)
def test_the_variance_in_a_direction_is_that_of_rotations_drawn_from_the_covariance(
    at: tuple[float, float], beta: float, seed: int
) -> None:
    random, baselines, edges = np.random.default_rng(seed), Baselines(), EdgeTable(1, 1, 1)
    spread = random.normal(0, 0.01, (3, 3))
    covariance, elapsed_s, own_px = spread @ spread.T, 0.4, 0.7
    baselines.is_fitted = True
    np.asarray(baselines.rate_covariance)[:] = covariance
    baselines.elapsed_s[SLOT], baselines.sigma_px[SLOT] = elapsed_s, own_px
    edges.key_x[0, SLOT], edges.key_y[0, SLOT] = at
    error, way = MotionError(), (math.cos(beta), math.sin(beta))
    error_matrix.of_rotation(error, baselines, edges.columns, 0, SLOT, *at, situation())
    per_radian = np.array([lines.turn_px(PINHOLE, about, *at, *way) for about in range(3)])
    expected = per_radian @ covariance @ per_radian * elapsed_s**2 + own_px**2
    assert error_matrix.variance(error, *way) == pytest.approx(expected)


@given(angle)
def test_before_a_fit_the_rotation_is_as_uncertain_as_by_the_gyro(beta: float) -> None:
    baselines, edges, error = Baselines(), EdgeTable(1, 1, 1), MotionError()
    baselines.sigma_px[SLOT] = 1.7
    edges.key_x[0, SLOT], edges.key_y[0, SLOT] = 400.0, 300.0
    error_matrix.of_rotation(error, baselines, edges.columns, 0, SLOT, 400.0, 300.0, situation())
    assert in_direction(error, beta) == pytest.approx(1.7**2)


def test_a_share_of_the_turn_is_uncertain_in_the_direction_of_the_turn() -> None:
    baselines, edges, error = Baselines(), EdgeTable(1, 1, 1), MotionError()
    edges.key_x[0, SLOT], edges.key_y[0, SLOT] = 360.0, 320.0
    error_matrix.of_rotation(error, baselines, edges.columns, 0, SLOT, 400.0, 350.0, situation(turn_share=0.1))
    assert math.sqrt(error_matrix.variance(error, 0.8, 0.6)) == pytest.approx(5.0)
    assert error_matrix.variance(error, -0.6, 0.8) == pytest.approx(0.0, abs=1e-9)


@given(angle, st.floats(0, 9), st.floats(0, 9), st.floats(1, 9))
def test_the_places_count_along_and_across_the_direction_of_the_edge(
    beta: float, along: float, across: float, excess: float
) -> None:
    edges, error, around = EdgeTable(1, 1, 1), MotionError(), situation(excess=excess, corner_var=0.2)
    edges.variance_along[0], edges.variance_across[0] = along, across
    edges.cos[0], edges.sin[0] = math.cos(beta), math.sin(beta)
    sigma_px = error_matrix.add_places(error, edges.columns, 0, around)
    expected = excess * (along + 0.2), excess * (across + 0.2)
    assert in_direction(error, beta) == pytest.approx(expected[0])
    assert in_direction(error, beta + math.pi / 2) == pytest.approx(expected[1])
    assert sigma_px**2 == pytest.approx(sum(expected) / 2)


@pytest.mark.parametrize(("mu", "share"), [(0.1, 0.1), (-0.1, 0.0), (3.0, 0.5)])
def test_the_focus_counts_by_the_share_of_its_distance_that_an_edge_has_moved(mu: float, share: float) -> None:
    """Near the focus that share has no bound, and half of it is taken at most; nothing stationary goes towards it."""
    error = MotionError()
    along = error_matrix.add_focus(
        error, mu, 0.6, 0.8, situation(focus_var_x=4.0, focus_var_y=9.0, lasting_var_x=1.0, lasting_var_y=2.0)
    )
    assert along == pytest.approx(share**2 * (0.36 * 1 + 0.64 * 2))
    assert in_direction(error, 0.0) == pytest.approx(share**2 * 4)
    assert in_direction(error, math.pi / 2) == pytest.approx(share**2 * 9)
    assert in_direction(error, math.pi / 4) == pytest.approx(share**2 * 6.5)


@given(angle)
def test_sources_add_up_and_no_variance_is_negative(beta: float) -> None:
    edges, error, around = EdgeTable(1, 1, 1), MotionError(), situation(focus_var_x=4.0, focus_var_y=4.0)
    before = in_direction(error, beta)
    error_matrix.add_places(error, edges.columns, 0, around)
    between = in_direction(error, beta)
    error_matrix.add_focus(error, 0.2, 1.0, 0.0, around)
    assert 0 <= before < between < in_direction(error, beta)
