"""Rotations between axes: from pairs of directions (Kabsch), and whether they are exact axes."""

from itertools import permutations, product

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

EXACT = tuple(
    matrix
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
    if np.linalg.det(matrix := np.eye(3)[list(order)] * np.array(signs)[:, None]) > 0
)
"""The 24 rotations that take axes onto axes."""


def best_rotation(product_matrix: Floats) -> tuple[Floats, float]:
    """Return the rotation R (3, 3) that maximises Σ bᵀ R a, given Σ b aᵀ (3, 3); and that sum."""
    u, s, vt = np.linalg.svd(product_matrix)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt)) or 1.0])
    rotation: Floats = np.asarray((u * sign) @ vt, np.float64)
    return rotation, float(s @ sign)


def angle_rad(one: Floats, other: Floats) -> float:
    """Return the angle between two rotations (3, 3), rad."""
    return float(2 * np.arcsin(min(1.0, float(np.linalg.norm(one - other)) / np.sqrt(8))))


def nearest_exact(rotation: Floats) -> tuple[Floats, float]:
    """Return the closest of ``EXACT``, and how far it is, rad."""
    nearest = max(EXACT, key=lambda exact: float(np.trace(exact @ rotation.T)))
    return nearest, angle_rad(nearest, rotation)


def in_words(rotation: Floats) -> str:
    """Where the IMU's axes point: "x ahead, y left, z up" where they are exact."""
    names = (("right", "left"), ("down", "up"), ("ahead", "back"))
    words = []
    for axis, column in zip("xyz", rotation.T, strict=True):
        row = int(np.argmax(np.abs(column)))
        words.append(f"{axis} {names[row][int(column[row] < 0)]}")
    return ", ".join(words)
