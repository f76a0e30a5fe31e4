"""Where objects are, in the camera's optical frame (REP-103: x right, y down, z ahead along the optical axis)."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Config
from lcf_edge.lens import Lens

Floats = npt.NDArray[np.float64]

_OPTICAL_FROM_BODY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""(3, 3), turns a vector of x ahead, y left, z up into x right, y down, z ahead."""


@dataclass(frozen=True)
class Setup:
    """What the messages need besides the scene: lens, frames, the camera's pose over ``base_frame``, and limits."""

    lens: Lens
    frame_id: str = "camera"
    base_frame: str = "base_link"
    ahead_m: float = 0.0
    left_m: float = 0.0
    up_m: float = 0.0
    pitch_rad: float = 0.0  # looks up
    yaw_rad: float = 0.0  # looks to the right
    horizon_s: float = 4.0  # what is met later is no threat yet
    max_trust: float = 5.0

    @classmethod
    def from_config(cls, config: Config, lens: Lens) -> "Setup":
        """As the configuration says; the height is that over the ground."""
        camera, publish = config.camera, config.publish
        return cls(
            lens,
            publish.frame_id,
            publish.base_frame,
            camera.ahead_m,
            camera.left_m,
            camera.height_m,
            camera.pitch_rad,
            camera.yaw_rad,
            config.vehicle.horizon_s,
            config.filter.tr_max,
        )

    @cached_property
    def base_from_optical(self) -> Floats:
        """Return the rotation (3, 3) of vectors from the optical frame to ``base_frame``."""
        # With x ahead, y left, z up, looking up is a negative rotation about y, looking right one about z.
        cy, sy = np.cos(-self.yaw_rad), np.sin(-self.yaw_rad)
        cp, sp = np.cos(-self.pitch_rad), np.sin(-self.pitch_rad)
        yaw = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
        pitch = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
        return np.asarray(yaw @ pitch @ _OPTICAL_FROM_BODY.T)


def placed(objects: npt.NDArray[np.void]) -> npt.NDArray[np.void]:
    """Return the objects whose position is known."""
    known = np.isfinite(objects["range"]) & np.isfinite(objects["bearing"]) & np.isfinite(objects["elevation"])
    return np.asarray(objects[known])


def positions(objects: npt.NDArray[np.void]) -> Floats:
    """(n, 3) m: right, down, ahead of the middle of each box; NaN where it is not known."""
    ahead = objects["range"].astype(np.float64)
    right = np.tan(objects["bearing"].astype(np.float64))
    up = np.hypot(1.0, right) * np.tan(objects["elevation"].astype(np.float64))
    return np.stack((ahead * right, -ahead * up, ahead), axis=1)


def sizes(objects: npt.NDArray[np.void], lens: Lens) -> Floats:
    """(n, 2) m: width and height of each box at its range; NaN where that is not known."""
    ahead = objects["range"].astype(np.float64)
    return np.stack((ahead * objects["width"] / lens.fx, ahead * objects["height"] / lens.fy), axis=1)


def quaternion(rotation: Floats) -> tuple[float, float, float, float]:
    """x, y, z, w of a (3, 3) rotation matrix, w not negative."""
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    # Each row is the quaternion times four of its own components; the longest is the most accurate.
    rows = np.array(
        [
            (1 + a - e - i, b + d, c + g, h - f),
            (b + d, 1 - a + e - i, f + h, c - g),
            (c + g, f + h, 1 - a - e + i, d - b),
            (h - f, c - g, d - b, 1 + a + e + i),
        ]
    )
    row = rows[np.argmax(rows.diagonal())]
    x, y, z, w = (row / np.linalg.norm(row) * (1.0 if row[3] >= 0 else -1.0)).tolist()
    return x, y, z, w
