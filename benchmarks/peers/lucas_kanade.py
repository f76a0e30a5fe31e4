"""FAST corners, tracked by pyramidal Lucas-Kanade with a forward-backward check."""

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.peers.clustering import TrustedCircles, cluster
from benchmarks.peers.ego import SLOTS, Ego, warp
from benchmarks.peers.peer import Circles, Floats, Grey, Mask
from benchmarks.peers.residual import Tracks, residual
from lcf_edge.config import Config
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens

_WINDOW_PX = (15, 15)
_LEVELS = 2
_CRITERIA = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 12, 0.03)
_RETURN_PX = 0.7  # largest forward-backward error of a track
_CELL_PX = 8  # one track in each such square
_BORDER_PX = 4
_LOOKS_PX = 4  # half a patch
_LOOKS_LIKE = 0.7  # least correlation of a track's patch with that of its oldest image
_MIN_DURATION_S = 0.12  # younger tracks are ignored
_NOISE_PX = 0.3
_MOVER_PX = 2.5


class LucasKanade:
    """Tracks over up to half a second of history, against the flow."""

    def __init__(self, config: Config, lens: Lens) -> None:
        self._config = config
        self._capacity = config.filter.corners_target
        self._detector = CornerDetector(config.filter, lens, config.memory.corners)
        self._ego = Ego(config, lens)
        self._circles = TrustedCircles()
        self._before: Grey | None = None
        self._points = np.empty((0, 2), np.float32)  # px of the input frame
        self._velocity = np.empty((0, 2), np.float32)  # px/s of the pinhole, without rotation
        self._history = np.empty((SLOTS, 0, 2), np.float32)  # px of the pinhole, at remembered images
        self._looks = np.empty((0, (2 * _LOOKS_PX + 1) ** 2), np.float32)  # as it was first seen
        self._born = np.empty(0, np.intp)  # number of the first remembered image

    def process(self, image: Grey, motion: Motion) -> Circles:
        """Rebel circles of one image."""
        self._ego.advance(motion)
        if self._before is not None and len(self._points):
            self._follow(self._before, image)
        circles = self._judge()
        self._add(image)
        self._before = image.copy()
        if self._ego.due():
            slot = self._ego.remember()
            self._history[slot] = self._ego.lens.undistort(self._points)
        return circles

    def _follow(self, before: Grey, image: Grey) -> None:
        """Continue every track in this image; drop lost ones."""
        ego = self._ego
        ideal = ego.lens.undistort(self._points)
        h = ego.last_homography().astype(np.float32).ravel()
        turned = np.stack(warp(h, ideal[:, 0], ideal[:, 1]), axis=1)
        guess = ego.lens.distort(turned + self._velocity * np.float32(ego.last.dt_s)).astype(np.float32)
        gain = float(np.clip(cv2.mean(image)[0] / max(cv2.mean(before)[0], 1.0), 0.4, 2.5))
        if abs(gain - 1) > 0.05:  # the exposure jumped
            before = np.asarray(cv2.convertScaleAbs(before, alpha=gain), np.uint8)
        after, found, back, returned = _both_ways(before, image, self._points, guess)
        off = np.abs(back - self._points).max(axis=1)
        height, width = image.shape
        inside = ((after >= _BORDER_PX) & (after < (width - _BORDER_PX, height - _BORDER_PX))).all(axis=1)
        good: Mask = found & returned & (off < _RETURN_PX) & inside
        good &= (_patches(image, after) * self._looks).sum(axis=1) > _LOOKS_LIKE
        speed = (ego.lens.undistort(after) - turned) / np.float32(max(ego.last.dt_s, 1e-3))
        self._velocity = speed
        self._points = after
        self._keep(good)

    def _keep(self, good: Mask) -> None:
        self._points, self._velocity = self._points[good], self._velocity[good]
        self._history, self._born = self._history[:, good], self._born[good]
        self._looks = self._looks[good]

    def _judge(self) -> Circles:
        ego = self._ego
        oldest = np.maximum(self._born, ego.number - SLOTS)
        slot = oldest % SLOTS
        rows = np.flatnonzero((oldest < ego.number) & (ego.elapsed_s[slot] >= _MIN_DURATION_S))
        now = ego.lens.undistort(self._points[rows])
        then = self._history[slot[rows], rows]
        x, y = ego.derotate(slot[rows], then[:, 0], then[:, 1])
        tracks = Tracks(slot[rows], x, y, now[:, 0], now[:, 1])
        points = residual(tracks, ego, self._config, _NOISE_PX, _MOVER_PX)
        return self._circles.update(cluster(points, least=4, link_px=28.0, share=0.2), ego)

    def _add(self, image: Grey) -> None:
        """Start tracks at corners that have none."""
        corners, _ = self._detector.detect(image)
        columns = image.shape[1] // _CELL_PX + 1
        taken = np.zeros((image.shape[0] // _CELL_PX + 1) * columns, np.bool_)
        taken[_cells(self._points, columns)] = True
        cell = _cells(corners.pixel.astype(np.float32), columns)
        _, first = np.unique(cell, return_index=True)
        new = first[~taken[cell[first]]]
        room = max(self._capacity - len(self._points), 0)
        if len(new) > room:
            new = new[np.linspace(0, len(new) - 1, room).astype(np.intp)]
        added = corners.pixel[new].astype(np.float32)
        self._points = np.concatenate([self._points, added])
        self._velocity = np.concatenate([self._velocity, np.zeros_like(added)])
        self._history = np.concatenate([self._history, np.zeros((SLOTS, len(new), 2), np.float32)], axis=1)
        self._born = np.concatenate([self._born, np.full(len(new), self._ego.number)])
        self._looks = np.concatenate([self._looks, _patches(image, added)])


def _both_ways(before: Grey, image: Grey, points: Floats, guess: Floats) -> tuple[Floats, Mask, Floats, Mask]:
    """Points tracked forward and back again, and which were found in each direction."""
    after, found = _carried(before, image, points, guess)
    back, returned = _carried(image, before, after, points)
    return after, found, back, returned


def _carried(before: Grey, image: Grey, points: Floats, guess: Floats) -> tuple[Floats, Mask]:
    after, found, _ = cv2.calcOpticalFlowPyrLK(
        before,
        image,
        points[:, None],
        guess[:, None].copy(),
        winSize=_WINDOW_PX,
        maxLevel=_LEVELS,
        criteria=_CRITERIA,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(after, np.float32)[:, 0], np.asarray(found).ravel() > 0


def _cells(points: Floats, columns: int) -> npt.NDArray[np.intp]:
    cell = points.astype(np.intp) // _CELL_PX
    return cell[:, 1] * columns + cell[:, 0]


def _patches(image: Grey, points: Floats) -> Floats:
    """The surroundings of points (n, 2), float32 (n, 81): mean 0, length 1."""
    steps = np.arange(-_LOOKS_PX, _LOOKS_PX + 1, dtype=np.float32)
    right, down = np.tile(steps, len(steps)), np.repeat(steps, len(steps))
    columns, rows = points[:, :1] + right, points[:, 1:] + down
    if not len(points):
        return columns
    patch = np.asarray(cv2.remap(image, columns, rows, cv2.INTER_LINEAR), np.float32)
    patch -= patch.mean(axis=1, keepdims=True)
    length = np.sqrt(np.square(patch).sum(axis=1, keepdims=True))
    return np.asarray(patch / np.maximum(length, 1), np.float32)
