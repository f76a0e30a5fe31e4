"""Frame difference: what differs from a registered earlier image is upright or moves.

A column of difference stands on the ground at its foot, which gives range, time to contact and lateral miss. Columns
in the path make blobs; upright objects beside the path differ too, and are ignored.
"""

import cv2
import numpy as np

from benchmarks.peers.backdrop import Backdrop
from benchmarks.peers.clustering import Clusters, TrustedCircles
from benchmarks.peers.ego import SLOTS, Ego
from benchmarks.peers.peer import Bytes, Circles, Floats, Grey, Mask, Rows
from benchmarks.peers.residual import beside_path
from lcf_edge.config import Config
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens

_SHRINK = 2
_BACK = 8  # images
_MIN_DIFFERENCE = 16  # grey levels
_SLACK = np.ones((3, 3), np.uint8)  # tolerance of the registration
_OPEN = np.ones((3, 3), np.uint8)
_CLOSE = np.ones((21, 13), np.uint8)
_AREA_PX = 60  # of the small image
_FOOT_PX = 4.0  # least below the horizon: farther away the range is meaningless
_TALL_M, _TALL_SHARE = 0.4, 0.8  # least height of a column, and as a share of the camera's, whichever is less


class FrameDifference:
    """Blobs of difference on the path."""

    def __init__(self, config: Config, lens: Lens) -> None:
        self._config = config
        self._ego = Ego(config, lens)
        self._backdrop = Backdrop(config, self._ego, _SHRINK)
        self._circles = TrustedCircles()
        self._images = [np.zeros((0, 0), np.uint8)] * SLOTS
        rows, columns = self._backdrop.size[1], self._backdrop.size[0]
        self._x, self._y = np.ascontiguousarray(self._backdrop.pixels.T).reshape(2, rows, columns)

    def process(self, image: Grey, motion: Motion) -> Circles:
        """Rebel circles of one image."""
        ego = self._ego
        ego.advance(motion)
        small = self._backdrop.shrink(np.asarray(cv2.GaussianBlur(image, (5, 5), 0), np.uint8))
        slot = ego.slot_back(_BACK)
        if slot is None or ego.speed_mps <= 0 or self._config.camera.height_m <= 0:
            circles = self._circles.none
        else:
            circles = self._circles.update(self._blobs(self._differs(small, slot)), ego)
        if ego.due():
            self._images[ego.remember()] = small
        return circles

    def _differs(self, small: Grey, slot: int) -> Bytes:
        """Return the mask of differences; 0 or 1."""
        before, covered = self._backdrop.lay(self._images[slot], slot)
        gain = float(small[covered].mean()) / max(float(before[covered].mean()), 1.0)  # the exposure may have changed
        before = np.asarray(cv2.convertScaleAbs(before, alpha=gain), np.uint8)
        over = cv2.subtract(small, cv2.dilate(before, _SLACK))
        under = cv2.subtract(cv2.erode(before, _SLACK), small)
        mask = (covered & (cv2.max(over, under) > _MIN_DIFFERENCE)).astype(np.uint8)
        mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, _OPEN), np.uint8)
        return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _CLOSE), np.uint8)

    def _blobs(self, mask: Bytes) -> Clusters:
        """Connected parts of the mask, of columns in the path."""
        foot = mask.shape[0] - 1 - np.argmax(mask[::-1] > 0, axis=0)
        range_m, lateral_m = self._stands(foot)
        min_m = min(_TALL_M, _TALL_SHARE * self._config.camera.height_m)
        tall = _SHRINK * np.count_nonzero(mask, axis=0) > min_m * self._ego.focal_px / range_m
        ttc = range_m / np.float32(self._ego.speed_mps)
        vehicle = self._config.vehicle
        in_way: Mask = tall & (ttc < vehicle.horizon_s) & (np.abs(lateral_m) < vehicle.half_width_m)
        _, label, stats, centres = cv2.connectedComponentsWithStats(mask * in_way.astype(np.uint8))
        parts = 1 + np.flatnonzero(stats[1:, cv2.CC_STAT_AREA] >= _AREA_PX)
        nearest = [float(ttc[np.flatnonzero((label == part).any(axis=0))].min()) for part in parts]
        middle = np.rint(centres[parts]).astype(np.intp)
        x, y = self._x[middle[:, 1], middle[:, 0]], self._y[middle[:, 1], middle[:, 0]]
        size = _SHRINK * stats[parts, cv2.CC_STAT_WIDTH], _SHRINK * stats[parts, cv2.CC_STAT_HEIGHT]
        still = np.zeros(len(parts), np.float32)
        return Clusters(
            x,
            y,
            (0.5 * np.hypot(*size)).astype(np.float32),
            still,
            still,
            stats[parts, cv2.CC_STAT_AREA].astype(np.intp),
            np.ones(len(parts), np.bool_),
            np.array(nearest, np.float32),
            range_m[middle[:, 0]],
            lateral_m[middle[:, 0]],
        )

    def _stands(self, foot: Rows) -> tuple[Floats, Floats]:
        """Range and lateral miss of columns with their feet in these rows, one row per column."""
        ego = self._ego
        columns = np.arange(len(foot))
        x, y = self._x[foot, columns], self._y[foot, columns]
        below = y - np.float32(ego.focus[1])
        reach = np.float32(self._config.camera.height_m * ego.focal_px)
        range_m = np.where(below > _FOOT_PX, reach / np.maximum(below, 1), np.float32(np.inf))
        near_m = np.minimum(range_m, np.float32(1e6))
        right_m = (x - np.float32(ego.focus[0])) / np.float32(ego.lens.fx) * near_m
        return range_m.astype(np.float32), beside_path(right_m, near_m, ego)
