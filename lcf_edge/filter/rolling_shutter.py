"""The readout time of a rolling shutter, from edges off their flow lines while the camera shakes or turns.

A row at the share u of the image's height is read u·T after the first. A camera that turns at ω has turned by ω·u·T
more by then, so an edge there lies off its flow line by

    d = a·turn - T·u·a·(ω - ω̄)

with a the px across the flow line for 1 rad about each axis, turn a rotation of the whole image, and ω̄ the rate that L
follows, which is a mean over frames. Least squares over the edges of frame k give T_k with its information I_k, the
inverse of its variance. Over the frames

    T = Σ I_k·T_k/Σ I_k,   σ² = the larger of 1/Σ I_k and Σ I_k²·(T_k - T)²/(Σ I_k)², plus (LAG_SHARE·t_f)²
"""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lcf_edge.filter.derotation import OffLine
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CornerTable, EdgeTable

Floats = npt.NDArray[np.float64]

MEMORY_S = 300.0  # of T
LEAN_MEMORY_S = 10.0  # of how much the images lean
LEAST_RADPS = 0.05  # of ω - ω̄; with less a frame shows nothing
LAG_SHARE = 0.03  # of the frame interval: 1 sigma of T by tracks that lag otherwise than ω̄, which no scatter shows
SURE_S = 1e-3  # when the rest of 1 sigma is less, nothing more is measured
SIGMA_PX = 0.7  # 1 sigma of a corner against its prediction
MIN_EDGES = 25  # fully trusted
ROUNDS = 3  # the first without weights
WEAK = 1.0  # prior of turn and T: 0 ± 1 rad, 0 ± 1 s
KNOWN_SIGMAS = 5.0  # by which T is known to differ from 0,
LEAST_READOUT_S = 0.01  # and by this, for tracks and lenses have errors of their own
LEAN_PX = 1.0  # rms by which the first and the last row must be displaced to matter


class RollingShutter:
    """``readout_s``: T from the first row to the last, negative from the last to the first, NaN: unknown.

    ``sigma_s``: 1 sigma of it. ``is_known``: whether T differs from 0. ``matters``: whether it also displaces rows by
    ``LEAN_PX`` lately. ``height``: of the image, px.
    """

    def __init__(self, pinhole: Pinhole, height: int, settings: Settings) -> None:
        self.readout_s = self.sigma_s = math.nan
        self.is_known = self.matters = False
        self._pinhole, self._height, self._settings = pinhole, height, settings
        self._mean_radps: Sequence[float] | None = None  # ω̄
        self._lean = 0.0  # mean square of |ω - ω̄|
        self._sums = np.zeros(5)  # of I, I·T, I², I²·T, I²·T²

    def lose(self) -> None:
        """Forget ω̄: edges were lost."""
        self._mean_radps = None

    def measure(
        self, off: OffLine, edges: EdgeTable, corners: CornerTable, rate_radps: Sequence[float], dt_s: float
    ) -> None:
        """Take a frame's edges off their flow lines, the corners that they found, and ω (3,) at its exposure.

        ω is NaN where it is unknown.
        """
        if not all(map(math.isfinite, rate_radps)):
            self.lose()
            return
        mean, follows = self._mean_radps or rate_radps, 1 / (self._settings.tr_max - self._settings.tr_cr + 1)
        change = [rate - before for rate, before in zip(rate_radps, mean, strict=True)]
        self._mean_radps = [before + follows * more for before, more in zip(mean, change, strict=True)]  # as L
        change2 = sum(more * more for more in change)
        self._lean += (1 - math.exp(-dt_s / LEAN_MEMORY_S)) * (change2 - self._lean)
        self._sums *= math.exp(-dt_s / MEMORY_S)
        if change2 >= LEAST_RADPS**2 and not self.sigma_s < math.hypot(LAG_SHARE * dt_s, SURE_S):  # true for NaN
            self._add(off, edges, corners, np.array(change))
        if self._sums[0] > 0:
            self._decide(dt_s)

    def _add(self, off: OffLine, edges: EdgeTable, corners: CornerTable, change: Floats) -> None:
        """Add T and its information by the fully trusted edges of one frame, robust against movers."""
        row = np.asarray(off.row)[: off.count]
        settled = edges.trust[row] >= self._settings.tr_max
        if np.count_nonzero(settled) < MIN_EDGES:
            return
        a = np.stack([np.asarray(each)[: off.count][settled] for each in (off.pitch, off.yaw, off.roll)])
        px, found = np.asarray(off.px)[: off.count][settled], edges.corner[row[settled]]
        rows = np.vstack([a, -(change @ a) * corners.pixel_y[found] / self._height])
        prior = np.eye(4) * (SIGMA_PX / WEAK) ** 2
        weighted = rows  # w = 1/(1 + (rest/2σ)²)²
        for k in range(ROUNDS):
            matrix = weighted @ rows.T + prior
            solution = np.linalg.solve(matrix, weighted @ px)
            if k < ROUNDS - 1:
                rest = (px - solution @ rows) * (0.5 / SIGMA_PX)
                weighted = rows / (1 + rest * rest) ** 2
        readout_s, information = solution[3], 1 / (SIGMA_PX**2 * np.linalg.inv(matrix)[3, 3])
        squared = information * information
        self._sums += (information, information * readout_s, squared, squared * readout_s, squared * readout_s**2)

    def _decide(self, dt_s: float) -> None:
        information, weighted, squares, linear, constant = self._sums.tolist()
        t = weighted / information
        scatter = constant - 2 * t * linear + t * t * squares
        variance = max(1 / information, scatter / (information * information))
        self.readout_s, self.sigma_s = t, math.sqrt(variance + (LAG_SHARE * dt_s) ** 2)
        self.is_known = abs(t) >= max(LEAST_READOUT_S, KNOWN_SIGMAS * self.sigma_s)
        self.matters = self.is_known and 0.5 * abs(t) * math.sqrt(self._lean) * self._pinhole.focal >= LEAN_PX
