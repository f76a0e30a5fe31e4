"""The key frames of α: rotation and displacement since each."""

import math

import numpy as np

from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.inputs import KEYS
from lcf_edge.filter.memory import Doubles, doubles, memory_of


class KeyFrames:
    """A stationary point at X in the axes of key frame k is now at ``rotation[k]``·X - ``displacement[k]``.

    ``elapsed_s``: since each. ``sigma_rad``: uncertainty of the rotation since. ``number``: key frames so far; the slot
    of key frame i is i mod KEYS. ``since_s``: time since the last one. ``step``: (1, 3, 3), scratch for a rotation.
    """

    def __init__(self) -> None:
        self.rotation = memory_of(np.tile(np.eye(3), (KEYS, 1, 1)))
        self.displacement = doubles(KEYS, 3)
        self.step = doubles(1, 3, 3)
        self.elapsed_s, self.sigma_rad = doubles(KEYS), doubles(KEYS)
        self.number = 0
        self.since_s = self.rate_sigma_radps = 0.0


def turn_one(keys: KeyFrames, k: int, rotation: Doubles) -> None:
    """Add a rotation (1, 3, 3) to that since the key frame in slot ``k``."""
    for j in range(3):
        x, y, z = keys.rotation[k, 0, j], keys.rotation[k, 1, j], keys.rotation[k, 2, j]
        for i in range(3):
            keys.rotation[k, i, j] = rotation[0, i, 0] * x + rotation[0, i, 1] * y + rotation[0, i, 2] * z
    x, y, z = keys.displacement[k, 0], keys.displacement[k, 1], keys.displacement[k, 2]
    for i in range(3):
        keys.displacement[k, i] = rotation[0, i, 0] * x + rotation[0, i, 1] * y + rotation[0, i, 2] * z


def learn(keys: KeyFrames, k: int, x: float, y: float, z: float, sigma_rad: float) -> None:
    """Correct the rotation since the key frame in slot ``k`` by a measured error, rad about each axis.

    ``sigma_rad``: remaining uncertainty.
    """
    keys.step[0, 0, 0] = keys.step[0, 1, 1] = keys.step[0, 2, 2] = 1.0
    keys.step[0, 0, 1], keys.step[0, 0, 2], keys.step[0, 1, 2] = -z, y, -x
    keys.step[0, 1, 0], keys.step[0, 2, 0], keys.step[0, 2, 1] = z, -y, x
    turn_one(keys, k, keys.step)
    keys.sigma_rad[k] = min(keys.sigma_rad[k], sigma_rad)


def turn(keys: KeyFrames, rotation: Doubles) -> None:
    """Add a rotation (1, 3, 3) to those since all key frames: R ← rotation·R, d ← rotation·d."""
    for k in range(KEYS):
        turn_one(keys, k, rotation)


def advance(
    keys: KeyFrames, rotation: Doubles, ahead_x: float, ahead_y: float, ahead_z: float, way_m: float, dt_s: float
) -> None:
    """Add the motion of one frame interval.

    ``rotation``: (1, 3, 3). ``ahead_x``, ``ahead_y``, ``ahead_z``: unit direction of travel, camera axes. ``way_m``:
    distance driven, as the chord of an arc.
    """
    turn(keys, rotation)
    for i in range(3):
        turned = rotation[0, i, 0] * ahead_x + rotation[0, i, 1] * ahead_y + rotation[0, i, 2] * ahead_z
        ahead = ahead_x if i == 0 else (ahead_y if i == 1 else ahead_z)
        for k in range(KEYS):
            keys.displacement[k, i] += 0.5 * way_m * (ahead + turned)
    for k in range(KEYS):
        keys.elapsed_s[k] += dt_s
    keys.since_s += dt_s


def inflate(keys: KeyFrames, sigma_rad: float, dt_s: float) -> None:
    """Add the uncertainty of the last interval's rotation."""
    keys.rate_sigma_radps = sigma_rad / dt_s
    for k in range(KEYS):
        keys.sigma_rad[k] = math.sqrt(keys.sigma_rad[k] * keys.sigma_rad[k] + sigma_rad * sigma_rad)


def scale(keys: KeyFrames, factor: float) -> None:
    """Scale the displacements since all key frames; 0: the vehicle was stationary."""
    for k in range(KEYS):
        for i in range(3):
            keys.displacement[k, i] *= factor


def mark(keys: KeyFrames) -> int:
    """Make this instant a key frame; return its slot."""
    slot = keys.number % KEYS
    for i in range(3):
        for j in range(3):
            keys.rotation[slot, i, j] = 1.0 if i == j else 0.0
        keys.displacement[slot, i] = 0.0
    keys.elapsed_s[slot] = keys.sigma_rad[slot] = 0.0
    keys.number += 1
    keys.since_s = 0.0
    return slot


def oldest_key(edges: EdgeColumns, i: int, keys: KeyFrames) -> int:
    """Number of the oldest key frame within the window in which an edge was seen."""
    return max(edges.born_key[i], keys.number - KEYS)


def has_history(edges: EdgeColumns, i: int, keys: KeyFrames, min_s: float) -> bool:
    """Whether an edge has a history of at least ``min_s``."""
    oldest = oldest_key(edges, i, keys)
    return oldest < keys.number and keys.elapsed_s[oldest % KEYS] >= min_s
