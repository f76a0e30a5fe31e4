"""Weighted linear least squares with a few unknowns, by the normal equations and Cholesky factorisation."""

import math

from lcf_edge.filter.memory import doubles

MAX_UNKNOWNS = 5
MIN_PIVOT = 1e-12  # guards a matrix that priors keep positive definite


class NormalEquations:
    """(Σ w·aᵀa + prior)·solution = Σ w·a·b, for up to ``MAX_UNKNOWNS``.

    ``row``: a, to be set before ``add``. ``solution``: after ``solve``. ``inverse``: of the matrix, after ``invert``;
    times the variance of a measurement of weight 1 it is the covariance of the solution.
    """

    def __init__(self) -> None:
        self.unknowns = MAX_UNKNOWNS
        self.row, self.right, self.solution = [doubles(MAX_UNKNOWNS) for _ in range(3)]
        self.matrix, self.factor, self.inverse = [doubles(MAX_UNKNOWNS, MAX_UNKNOWNS) for _ in range(3)]


def begin(equations: NormalEquations, unknowns: int) -> None:
    """Reset the equations."""
    equations.unknowns = unknowns
    for i in range(unknowns):
        equations.right[i] = 0.0
        for j in range(unknowns):
            equations.matrix[i, j] = 0.0


def add_prior(equations: NormalEquations, i: int, weight: float) -> None:
    """Add the prior that the ``i``-th unknown is 0, with this weight."""
    equations.matrix[i, i] += weight


def add(equations: NormalEquations, weight: float, measured: float) -> None:
    """Add the measurement ``row``·solution = ``measured``, with this weight."""
    for i in range(equations.unknowns):
        weighted = weight * equations.row[i]
        equations.right[i] += weighted * measured
        for j in range(i + 1):
            equations.matrix[i, j] += weighted * equations.row[j]


def factorise(equations: NormalEquations) -> None:
    """Factorise: matrix = factor·factorᵀ, the factor lower triangular."""
    for i in range(equations.unknowns):
        for j in range(i + 1):
            rest = equations.matrix[i, j]
            for k in range(j):
                rest -= equations.factor[i, k] * equations.factor[j, k]
            if i == j:
                equations.factor[i, i] = math.sqrt(max(rest, MIN_PIVOT))
            else:
                equations.factor[i, j] = rest / equations.factor[j, j]


def substitute(equations: NormalEquations) -> None:
    """Solve for ``right`` with the present factor."""
    last = equations.unknowns - 1
    for i in range(equations.unknowns):
        rest = equations.right[i]
        for k in range(i):
            rest -= equations.factor[i, k] * equations.solution[k]
        equations.solution[i] = rest / equations.factor[i, i]
    for j in range(equations.unknowns):
        i = last - j
        rest = equations.solution[i]
        for k in range(i + 1, equations.unknowns):
            rest -= equations.factor[k, i] * equations.solution[k]
        equations.solution[i] = rest / equations.factor[i, i]


def solve(equations: NormalEquations) -> None:
    """Set ``solution``."""
    factorise(equations)
    substitute(equations)


def invert(equations: NormalEquations) -> None:
    """Set ``inverse``, after ``solve``; overwrites ``right`` and ``solution``."""
    for j in range(equations.unknowns):
        for i in range(equations.unknowns):
            equations.right[i] = 1.0 if i == j else 0.0
        substitute(equations)
        for i in range(equations.unknowns):
            equations.inverse[i, j] = equations.solution[i]
