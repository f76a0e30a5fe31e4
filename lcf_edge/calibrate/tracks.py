"""Corners tracked from image to image (Shi & Tomasi; pyramidal Lucas-Kanade, forward and backward)."""

from collections import Counter
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from drivers.samples import Frame
from lcf_edge.lens import Lens

Floats = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.float32]

_CORNERS = 400
_MIN_TRACKS = 25
_MIN_CORNER_PX = 8.0
_THERE_AND_BACK_PX = 0.7
_WINDOW_PX = (21, 21)
_LEVELS = 4
_MAX_S = 0.5  # between two images


@dataclass(frozen=True)
class Tracks:
    """Corners before and now: x/z, y/z of the ideal pinhole, (n, 2) each."""

    start_ns: int
    end_ns: int
    before: Floats
    after: Floats

    @property
    def dt_s(self) -> float:
        """Time between the two images, s."""
        return (self.end_ns - self.start_ns) * 1e-9


class Tracker:
    """Tracks corners; ``left_out`` counts unusable intervals by reason.

    The next interval begins when the median corner has moved ``min_motion_px``, after ``max_frames`` images at
    the latest.
    """

    def __init__(self, lens: Lens, min_motion_px: float = 0.0, max_frames: int = 1) -> None:
        self.left_out: Counter[str] = Counter()
        self._lens = lens
        self._min_motion_px, self._max_frames = min_motion_px, max_frames
        self._first: Frame | None = None
        self._last: Frame | None = None
        self._start = self._now = np.empty((0, 2), np.float32)
        self._frames = 0

    def add(self, frame: Frame) -> Tracks | None:
        """Track into ``frame``. Return the interval that ends here, if one does."""
        last, self._last = self._last, frame
        if self._first is None or last is None:
            self._begin(frame)
            return None
        dt_s = (frame.stamp_ns - last.stamp_ns) * 1e-9
        if not 0 < dt_s <= _MAX_S:
            self.left_out["images too far apart"] += 1
            self._begin(frame)
            return None
        self._follow(last, frame)
        self._frames += 1
        if len(self._now) < _MIN_TRACKS:
            self.left_out["too few corners"] += 1
            self._begin(frame)
            return None
        moved_px = float(np.median(np.hypot(*(self._now - self._start).T)))
        if moved_px < self._min_motion_px and self._frames < self._max_frames:
            return None
        tracks = Tracks(self._first.stamp_ns, frame.stamp_ns, *self._rays(self._start, self._now))
        self._begin(frame)
        return tracks

    def _begin(self, frame: Frame) -> None:
        self._first, self._frames = frame, 0
        found = np.asarray(cv2.goodFeaturesToTrack(frame.image, _CORNERS, 0.01, _MIN_CORNER_PX))
        self._start = self._now = (found if found.ndim == 3 else np.empty(0)).astype(np.float32).reshape(-1, 2)

    def _follow(self, last: Frame, frame: Frame) -> None:
        if not len(self._now):
            return
        there, found, _ = cv2.calcOpticalFlowPyrLK(
            last.image, frame.image, self._now, np.empty(0), winSize=_WINDOW_PX, maxLevel=_LEVELS
        )
        back, found_back, _ = cv2.calcOpticalFlowPyrLK(
            frame.image, last.image, there, np.empty(0), winSize=_WINDOW_PX, maxLevel=_LEVELS
        )
        good = (found.ravel() == 1) & (found_back.ravel() == 1)
        good &= np.hypot(*(back - self._now).T) < _THERE_AND_BACK_PX
        self._start, self._now = self._start[good], np.asarray(there[good], np.float32)

    def _rays(self, before: Pixels, after: Pixels) -> tuple[Floats, Floats]:
        lens = self._lens
        one, two = (
            (lens.undistort(points).astype(np.float64) - (lens.cx, lens.cy)) / (lens.fx, lens.fy)
            for points in (before, after)
        )
        seen = np.isfinite(one).all(axis=1) & np.isfinite(two).all(axis=1)
        return one[seen], two[seen]
