"""ORB features, matched with those of the eighth and the fourth remembered image before."""

import cv2
import numpy as np

from benchmarks.peers.clustering import TrustedCircles, cluster
from benchmarks.peers.ego import SLOTS, Ego
from benchmarks.peers.peer import Bytes, Circles, Floats, Grey, Rows
from benchmarks.peers.residual import Tracks, residual
from lcf_edge.config import Config
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens

_FEATURES_A_CORNER = 1.4
_SCALE, _LEVELS = 1.2, 4
_FAST_THRESHOLD = 10
_BACK = (8, 4)  # images; features missing in the first may be in the second
_REACH_PX = 80.0  # least search radius of a feature
_HAMMING = 48  # bits that may differ
_NOISE_PX = 1.0
_MOVER_PX = 3.5


class Orb:
    """Matches features of this image with those of earlier ones: long baselines without tracking."""

    def __init__(self, config: Config, lens: Lens) -> None:
        self._config = config
        features = round(_FEATURES_A_CORNER * config.filter.corners_target)
        self._orb = cv2.ORB.create(features, _SCALE, _LEVELS, edgeThreshold=16, fastThreshold=_FAST_THRESHOLD)
        self._ego = Ego(config, lens)
        self._circles = TrustedCircles()
        self._points = [np.empty((0, 2), np.float32)] * SLOTS  # px of the pinhole
        self._looks = [np.empty((0, 32), np.uint8)] * SLOTS

    def process(self, image: Grey, motion: Motion) -> Circles:
        """Rebel circles of one image."""
        ego = self._ego
        ego.advance(motion)
        points, looks = self._features(image)
        judged = residual(self._tracks(points, looks), ego, self._config, _NOISE_PX, _MOVER_PX)
        circles = self._circles.update(cluster(judged, least=4, link_px=32.0, share=0.2), ego)
        if ego.due():
            slot = ego.remember()
            self._points[slot], self._looks[slot] = points, looks
        return circles

    def _features(self, image: Grey) -> tuple[Floats, Bytes]:
        """Positions (n, 2) px of the pinhole, and descriptors (n, 32)."""
        keypoints, looks = self._orb.detectAndCompute(image, None)
        if not keypoints:
            return np.empty((0, 2), np.float32), np.empty((0, 32), np.uint8)
        found = np.asarray(cv2.KeyPoint.convert(keypoints), np.float32)
        return self._ego.lens.undistort(found), np.asarray(looks, np.uint8)

    def _tracks(self, points: Floats, looks: Bytes) -> Tracks:
        """Each feature with the oldest image that shows it."""
        slot = np.zeros(len(points), np.intp)
        then = np.full_like(points, np.nan)
        for back in _BACK:
            which = self._ego.slot_back(back)
            if which is None:
                continue
            rows = np.flatnonzero(np.isnan(then[:, 0]))
            now, before = self._match(points[rows], looks[rows], which)
            slot[rows[now]] = which
            then[rows[now]] = before
        known = np.flatnonzero(~np.isnan(then[:, 0]))
        return Tracks(slot[known], then[known, 0], then[known, 1], points[known, 0], points[known, 1])

    def _match(self, points: Floats, looks: Bytes, slot: int) -> tuple[Rows, Floats]:
        """Rows of the features that the slot shows too, and where they were (n, 2), derotated.

        A pair is each other's best, within reach.
        """
        then = self._points[slot]
        if not len(points) or not len(then):
            return np.empty(0, np.intp), np.empty((0, 2), np.float32)
        then = np.stack(self._ego.derotate(np.full(len(then), slot), then[:, 0], then[:, 1]), axis=1)
        best = _nearest(points, looks, then, self._looks[slot])
        best_then = _nearest(then, self._looks[slot], points, looks)
        rows = np.flatnonzero(best >= 0)
        mutual = rows[best_then[best[rows]] == rows]
        return mutual, then[best[mutual]]


def _nearest(points: Floats, looks: Bytes, others: Floats, other_looks: Bytes) -> Rows:
    """Row of the most alike of the ``others`` within reach of each point; -1: none is like it.

    Squares of the reach's size: a point is compared with those in its own and in the eight around it.
    """
    best = np.full(len(points), -1)
    words, other_words = (np.ascontiguousarray(each.view(np.uint64).T) for each in (looks, other_looks))
    squares, other_squares = ((each // _REACH_PX).astype(np.intp) for each in (points, others))
    for square in np.unique(squares, axis=0):
        mine = np.flatnonzero((squares == square).all(axis=1))
        near = np.flatnonzero((np.abs(other_squares - square) <= 1).all(axis=1))
        if not len(near):
            continue
        bits = np.zeros((len(mine), len(near)), np.uint16)
        for word, other in zip(words[:, mine], other_words[:, near], strict=True):
            bits += np.bitwise_count(word[:, None] ^ other)
        nearest = bits.argmin(axis=1)
        alike = bits[np.arange(len(mine)), nearest] <= _HAMMING
        best[mine[alike]] = near[nearest[alike]]
    return best
