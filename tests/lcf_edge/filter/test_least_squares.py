"""Least squares by the normal equations: as NumPy has it."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.filter import least_squares
from lcf_edge.filter.least_squares import NormalEquations

Floats = npt.NDArray[np.float64]

unknowns = st.integers(1, 5)
seeds = st.integers(0, 10_000)


def problem(number: int, seed: int, rows: int = 30) -> tuple[Floats, Floats, Floats, Floats]:
    """Rows, what was measured, weights, and the weights of the priors."""
    random = np.random.default_rng(seed)
    scales = 10.0 ** random.uniform(-1, 2, number)  # unknowns of different units
    return (
        random.normal(0, 1, (rows, number)) * scales,
        random.normal(0, 5, rows),
        random.uniform(0.01, 2, rows),
        random.uniform(0.01, 3, number),
    )


def entered(rows: Floats, measured: Floats, weights: Floats, priors: Floats) -> NormalEquations:
    """The equations, ready to be solved."""
    equations = NormalEquations()
    least_squares.begin(equations, len(priors))
    for i, weight in enumerate(priors.tolist()):
        least_squares.add_prior(equations, i, weight)
    for row, value, weight in zip(rows, measured.tolist(), weights.tolist(), strict=True):
        np.asarray(equations.row)[: len(row)] = row
        least_squares.add(equations, weight, value)
    return equations


@given(unknowns, seeds)
def test_the_answer_is_that_of_numpy(number: int, seed: int) -> None:
    """A prior is a row that measures 0."""
    rows, measured, weights, priors = problem(number, seed)
    equations = entered(rows, measured, weights, priors)
    least_squares.solve(equations)
    root = np.sqrt(weights)
    all_rows = np.concatenate([rows * root[:, None], np.diag(np.sqrt(priors))])
    expected = np.linalg.lstsq(all_rows, np.concatenate([measured * root, np.zeros(number)]), rcond=None)[0]
    assert np.asarray(equations.solution)[:number] == pytest.approx(expected, rel=1e-6, abs=1e-9)


@given(unknowns, seeds)
def test_the_inverse_is_that_of_the_matrix(number: int, seed: int) -> None:
    rows, measured, weights, priors = problem(number, seed)
    equations = entered(rows, measured, weights, priors)
    least_squares.solve(equations)
    least_squares.invert(equations)
    matrix = (rows.T * weights) @ rows + np.diag(priors)
    assert np.asarray(equations.inverse)[:number, :number] == pytest.approx(np.linalg.inv(matrix), rel=1e-6, abs=1e-12)


@given(unknowns, seeds)
def test_what_was_measured_without_error_is_found_exactly(number: int, seed: int) -> None:
    rows, _, weights, _ = problem(number, seed)
    truth = np.random.default_rng(seed).uniform(-3, 3, number)
    equations = entered(rows, rows @ truth, weights, np.zeros(number))
    least_squares.solve(equations)
    assert np.asarray(equations.solution)[:number] == pytest.approx(truth, rel=1e-5, abs=1e-6)


def test_nothing_measured_leaves_the_priors() -> None:
    equations = entered(np.empty((0, 3)), np.empty(0), np.empty(0), np.array([4.0, 1.0, 0.25]))
    least_squares.solve(equations)
    assert np.asarray(equations.solution)[:3].tolist() == [0.0, 0.0, 0.0]
    least_squares.invert(equations)
    assert np.diag(equations.inverse)[:3] == pytest.approx([0.25, 1.0, 4.0])


def test_what_nothing_determines_stays_finite() -> None:
    """Rows that are all alike, without a prior, leave a direction open."""
    equations = entered(np.ones((10, 2)), np.full(10, 3.0), np.ones(10), np.zeros(2))
    least_squares.solve(equations)
    assert np.isfinite(equations.solution).all()
    assert sum(np.asarray(equations.solution)[:2]) == pytest.approx(3.0)


def test_equations_are_begun_anew() -> None:
    equations = entered(*problem(5, 1))
    least_squares.solve(equations)
    least_squares.begin(equations, 1)
    equations.row[0] = 2.0
    least_squares.add(equations, 1.0, 6.0)
    least_squares.solve(equations)
    assert equations.solution[0] == pytest.approx(3.0)
