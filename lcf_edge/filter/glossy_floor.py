"""Whether the floor mirrors: much of what is seen below the horizon lies deep under the ground.

The ground at a row b px below the horizon lies at Z = h·f/b. What stands on it is nearer than the ground in its row; a
lamp in the ceiling, mirrored, is farther away, as if it hung under the floor. Like all that stands it flows outward.
"""

import math

import numpy as np

from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import EdgeTable

MEMORY_S = 4.0
MIN_BELOW = 0.06  # least b/f; higher rows are too near the horizon to have a range
SLOPE_SIGMA_RAD = 0.02  # 1 sigma of the ground's slope and the camera's pitch together
DEEPER = 2.0  # times the camera's height; less may be a wrong height, or a slope
SIGMAS = 3.0  # by which it must be deeper, and flow outward
MAX_DRIFT_SIGMAS = 2.0  # across the flow line,
MAX_DRIFT_SHARE = 0.1  # and as a share of the outward motion
SLOWEST_MPS = 0.05
GLOSSY_SHARE = 0.25  # of the edges below the horizon
DULL_SHARE = 0.15  # with fewer, a glossy floor ends
MIN_UNDER_S = 1.0  # edges · time
MIN_DRIVEN_S = 1.0
APART_S = 0.2  # edges stay: not every frame is counted


class GlossyFloor:
    """``is_glossy``: the verdict. ``under_s``: edges deep under the ground · time, ``seen_s``: all that may show it."""

    def __init__(self, verdicts: Verdicts, edges: EdgeTable, baselines: Baselines, settings: Settings) -> None:
        self.is_glossy = False
        self.under_s = self.seen_s = 0.0
        self._driven_s = self._since_s = 0.0
        self._verdicts, self._edges, self._settings = verdicts, edges, settings
        self._row, self._slot, self._r = (np.asarray(each) for each in (verdicts.row, verdicts.slot, verdicts.r))
        self._drift, self._outward = np.asarray(verdicts.drift), np.asarray(verdicts.outward)
        self._sigma, self._depth_m = np.asarray(verdicts.sigma), np.asarray(baselines.depth_m)

    def measure(self, around: Situation) -> None:
        """Take the verdicts of one frame; without a speed or the camera's height they show nothing."""
        if not (around.camera_height_m > 0 and around.speed_mps > SLOWEST_MPS):
            return
        self._since_s += around.dt_s
        if self._since_s < APART_S:
            return
        (under, seen), since_s, self._since_s = self._count(around), self._since_s, 0.0
        kept = math.exp(-since_s / MEMORY_S)
        self.under_s = kept * self.under_s + under * since_s
        self.seen_s = kept * self.seen_s + seen * since_s
        self._driven_s = kept * self._driven_s + since_s
        share = DULL_SHARE if self.is_glossy else GLOSSY_SHARE
        enough = self._driven_s >= MIN_DRIVEN_S and self.under_s >= MIN_UNDER_S
        self.is_glossy = enough and self.under_s > share * self.seen_s

    def _count(self, around: Situation) -> tuple[int, int]:
        """Return how many edges lie deep under the ground, and how many would show it if they did."""
        n, focal = self._verdicts.count, around.pinhole.focal
        row, outward = self._row[:n], self._outward[:n]
        below = self._edges.y[row] - around.horizon_y
        lever = self._r[:n] * self._depth_m[self._slot[:n]]
        sigma = self._sigma[:n] + math.sqrt(2) * around.noise_px
        # Outward motion of what lies as deep as that.
        deep = lever * (below - SLOPE_SIGMA_RAD * focal) / (DEEPER * around.camera_height_m * focal)
        seen = (below >= MIN_BELOW * focal) & (lever > 0) & (deep >= SIGMAS * sigma)
        seen &= self._edges.trust[row] >= self._settings.tr_s
        under = seen & (np.abs(self._drift[:n]) < MAX_DRIFT_SIGMAS * sigma + MAX_DRIFT_SHARE * np.abs(outward))
        under &= (outward > SIGMAS * sigma) & (outward < deep - SIGMAS * sigma)
        return int(np.count_nonzero(under)), int(np.count_nonzero(seen))
