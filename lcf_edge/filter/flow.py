"""Where what stands still goes in the picture: directions, flow lines, derotation, key frames."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcf_edge.filter.tables import KEYS, Floats

Matrix = npt.NDArray[np.float64]
NEAR = 1e-6


def wrap(angle: Floats) -> Floats:
    """Angle in (-π, π], any shape."""
    return np.asarray(np.pi - np.remainder(np.pi - angle, 2 * np.pi), np.float32)


def line_distance(dx: Floats, dy: Floats, cos: Floats, sin: Floats) -> Floats:
    """Signed distance in px of an offset (dx, dy) from the line through the origin in the direction (cos β, sin β).

    The paper's error-span condition with O as IC and tan β as the slope; signed, and without a pole at vertical
    lines. Positive: to the right of the direction of flow as the picture shows it (y down).
    """
    return dy * cos - dx * sin


@dataclass(frozen=True, slots=True)
class Pinhole:
    """The ideal camera that positions refer to, px."""

    fx: float
    fy: float
    cx: float
    cy: float

    @property
    def focal(self) -> float:
        """Mean focal length, px."""
        return 0.5 * (self.fx + self.fy)

    def homography(self, rotation: Matrix) -> Matrix:
        """H = K·R·K⁻¹: carries image positions of distant points through a rotation; (…, 3, 3)."""
        h = np.array(rotation)
        h[..., 0, :] = self.fx * h[..., 0, :] + self.cx * h[..., 2, :]
        h[..., 1, :] = self.fy * h[..., 1, :] + self.cy * h[..., 2, :]
        h[..., :, 0] /= self.fx
        h[..., :, 1] /= self.fy
        h[..., :, 2] -= self.cx * h[..., :, 0] + self.cy * h[..., :, 1]
        return h


def carry(h: Matrix, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Image positions through a homography; x, y: float32 (n,) px."""
    a, b, c, d, e, f, g, i, j = map(np.float32, h.ravel().tolist())
    scale = 1 / np.maximum(g * x + i * y + j, np.float32(NEAR))
    return (a * x + b * y + c) * scale, (d * x + e * y + f) * scale


class KeyFrames:
    """The key frames of α: how the vehicle has turned and moved since each.

    A point that stands still at X in the axes of key frame k is now at ``rotation[k]``·X - ``displacement[k]``.
    ``number``: float count of key frames so far; slot of key frame i is i mod KEYS.
    """

    def __init__(self) -> None:
        self.rotation = np.tile(np.eye(3), (KEYS, 1, 1))
        self.displacement = np.zeros((KEYS, 3))
        self.elapsed_s = np.zeros(KEYS)
        self.sigma_rad = np.zeros(KEYS)  # of the rotation since
        self.number = 0  # key frames so far
        self.since_s = 0.0  # time since the last one

    def advance(self, rotation: Matrix, forward: npt.NDArray[np.float64], speed_mps: float, dt_s: float) -> None:
        """Account for the motion of one frame interval; ``forward``: (3,) unit direction of travel in camera axes."""
        step = 0.5 * speed_mps * dt_s * (forward + rotation @ forward)  # chord of the arc
        self.rotation[:] = rotation @ self.rotation
        self.displacement[:] = self.displacement @ rotation.T + step
        self.elapsed_s += dt_s
        self.since_s += dt_s

    def blur(self, sigma_rad: float) -> None:
        """Account for what the rotation of the last interval leaves uncertain."""
        self.sigma_rad[:] = np.hypot(self.sigma_rad, sigma_rad)

    def correct(self, rotation: Matrix) -> None:
        """Apply a small rotation that the flow has shown to be missing in the last interval."""
        self.rotation[:] = rotation @ self.rotation
        self.displacement[:] = self.displacement @ rotation.T

    def mark(self) -> int:
        """Make this instant a key frame; answers its slot."""
        slot = self.number % KEYS
        self.rotation[slot] = np.eye(3)
        self.displacement[slot] = 0
        self.elapsed_s[slot] = 0
        self.sigma_rad[slot] = 0
        self.number += 1
        self.since_s = 0.0
        return slot
