"""Input of one step of the filter."""

from dataclasses import dataclass
from math import nan

import numpy as np
import numpy.typing as npt

APPEARANCE_SAMPLES = 16
LOOK_SIDE = 5  # by as many samples, of the place of an object before a vehicle at rest
KEYS = 16  # key frames in an edge's history
UNKNOWN = (nan, nan, nan)


@dataclass(frozen=True, slots=True)
class Corners:
    """The corners of one frame (the paper's Edge).

    ``pixel``: int32 (n, 2), x and y in the input frame. ``position``: float32 (n, 2), px of the ideal pinhole, lens
    distortion removed. ``appearance``: uint8 (n, 16), grey samples around the corner, shifted to a mean of 128.
    """

    pixel: npt.NDArray[np.int32]
    position: npt.NDArray[np.float32]
    appearance: npt.NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.pixel)

    def of(self, chosen: npt.NDArray[np.bool_]) -> "Corners":
        """Return the corners for which ``chosen``, (n,), is true."""
        return Corners(self.pixel[chosen], self.position[chosen], self.appearance[chosen])


NO_CORNERS = Corners(
    np.empty((0, 2), np.int32), np.empty((0, 2), np.float32), np.empty((0, APPEARANCE_SAMPLES), np.uint8)
)


@dataclass(frozen=True, slots=True)
class Motion:
    """How the vehicle moved since the last frame.

    ``dt_s``: t_f, from capture stamps. ``rotation``: float64 (3, 3), takes a direction from the last exposure's camera
    axes to this one's. ``rotation_sigma_rad``: its uncertainty. ``speed_mps``: V_ν, NaN: unknown.
    ``path_yaw_rate_radps``: of the vehicle's path, turning left is positive (the camera may shake besides).
    ``rate_radps``: ω of the camera about its axes at this exposure, NaN: not measured.
    """

    dt_s: float
    rotation: npt.NDArray[np.float64]
    rotation_sigma_rad: float
    speed_mps: float
    path_yaw_rate_radps: float
    rate_radps: tuple[float, float, float] = UNKNOWN
