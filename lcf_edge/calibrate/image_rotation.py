"""Rotation of the camera between two images, from tracked corners.

With small rotations δ a ray (x, y, 1) moves by B δ, B = [[-xy, 1 + x², -y], [-(1 + y²), xy, x]] (Longuet-Higgins &
Prazdny 1980). Translation moves it too, along the line through the focus of expansion. So errors along that line and
across it are weighted separately and robustly: near corners count only across it, far ones in both directions.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.calibrate.tracks import Tracks

Floats = npt.NDArray[np.float64]

FORWARD = np.array([0.0, 0.0, 1.0])

_ITERATIONS = 8
_MIN_SCALE = 2e-4  # of x/z: about 0.1 px


@dataclass(frozen=True)
class Turn:
    """Mean rate of the camera over an interval, rad/s in its axes, (3,), and 1 sigma about its worst axis."""

    start_ns: int
    end_ns: int
    rate_radps: Floats
    sigma_radps: float


def turn(tracks: Tracks, travel: Floats = FORWARD) -> Turn:
    """Return the rotation over ``tracks``; ``travel``: (3,), direction of travel in camera axes, if it drives."""
    rotation: Floats = np.eye(3)
    rays = np.column_stack([tracks.before, np.ones(len(tracks.before))])
    for _ in range(_ITERATIONS):
        shown = rays @ rotation.T
        place = shown[:, :2] / shown[:, 2:]
        error = tracks.after - place
        along = place - travel[:2] / travel[2]
        along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
        across = np.stack([-along[:, 1], along[:, 0]], axis=1)
        slopes = motion_field(place)
        rows = np.concatenate([np.einsum("ni,nij->nj", way, slopes) for way in (across, along)])
        errors = np.concatenate([np.einsum("ni,ni->n", way, error) for way in (across, along)])
        scale = max(1.4826 * float(np.median(np.abs(errors[: len(place)]))), _MIN_SCALE)
        weights = 1 / (1 + (errors / (2 * scale)) ** 2)
        normal = rows.T @ (rows * weights[:, None])
        covariance = np.linalg.pinv(normal)
        step = covariance @ (rows.T @ (weights * errors))
        rotation = np.asarray(cv2.Rodrigues(step)[0], np.float64) @ rotation
    angles = cv2.Rodrigues(rotation)[0].ravel().astype(np.float64)
    sigma = scale * float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    return Turn(tracks.start_ns, tracks.end_ns, -angles / tracks.dt_s, sigma / tracks.dt_s)


def motion_field(place: Floats) -> Floats:
    """Return B, (n, 2, 3), at rays x/z, y/z, (n, 2)."""
    x, y = place.T
    return np.stack([np.stack([-x * y, 1 + x * x, -y], axis=1), np.stack([-(1 + y * y), x * y, x], axis=1)], axis=1)
