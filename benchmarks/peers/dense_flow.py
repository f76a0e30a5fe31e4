"""DIS optical flow on half-size images, relative to the motion of the ground and of distant points."""

import cv2
import numpy as np

from benchmarks.peers.backdrop import Backdrop
from benchmarks.peers.clustering import TrustedCircles, cluster
from benchmarks.peers.ego import SLOTS, Ego
from benchmarks.peers.peer import Circles, Floats, Grey, Mask
from benchmarks.peers.residual import Tracks, residual
from lcf_edge.config import Config
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens

_SHRINK = 2
_BACK = 4  # images
# In px of the small image:
_GRID = 4
_BORDER = 4
_TEXTURE = 4.0  # least mean gradient of the surroundings, grey levels a pixel
_RETURN = 0.7  # flow there and back must agree
_SMOOTH = 1.0  # and with that of its neighbours: across an edge it is interpolated
_NOISE_PX = 0.5
_MOVER_PX = 2.0


class DenseFlow:
    """Flow on a grid, where there is texture."""

    def __init__(self, config: Config, lens: Lens) -> None:
        self._config = config
        self._flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
        self._ego = Ego(config, lens)
        self._backdrop = Backdrop(config, self._ego, _SHRINK)
        self._circles = TrustedCircles()
        self._images = [np.zeros((0, 0), np.uint8)] * SLOTS
        width, height = self._backdrop.size
        grid = np.meshgrid(np.arange(_BORDER, width - _BORDER, _GRID), np.arange(_BORDER, height - _BORDER, _GRID))
        self._u, self._v = (each.ravel() for each in grid)

    def process(self, image: Grey, motion: Motion) -> Circles:
        """Rebel circles of one image."""
        ego = self._ego
        ego.advance(motion)
        small = self._backdrop.shrink(image)
        slot = ego.slot_back(_BACK)
        if slot is None:
            circles = self._circles.none
        else:
            judged = residual(self._tracks(small, slot), ego, self._config, _NOISE_PX, _MOVER_PX)
            circles = self._circles.update(cluster(judged, least=5, link_px=24.0, share=0.3), ego)
        if ego.due():
            self._images[ego.remember()] = small
        return circles

    def _tracks(self, small: Grey, slot: int) -> Tracks:
        before, _ = self._backdrop.lay(self._images[slot], slot)
        back, forth = self._calc(small, before), self._calc(before, small)  # back: where each pixel was
        good = np.flatnonzero(self._sure(small, back, forth))
        u, v = self._u[good], self._v[good]
        at = np.stack([u, v], axis=1).astype(np.float32)
        now = self._backdrop.full(at)
        then = self._backdrop.expect(self._backdrop.full(at + back[v, u]), slot)
        return Tracks(np.full(len(now), slot), then[:, 0], then[:, 1], now[:, 0], now[:, 1])

    def _calc(self, one: Grey, other: Grey) -> Floats:
        start = np.zeros((*one.shape, 2), np.float32)
        return np.asarray(self._flow.calc(one, other, start), np.float32)

    def _sure(self, small: Grey, back: Floats, forth: Floats) -> Mask:
        """Return which grid points have texture, and a flow that is consistent backward and nearby; bool (n,)."""
        u, v = self._u, self._v
        across, down = (cv2.Sobel(small, cv2.CV_32F, dx, 1 - dx, scale=0.25) for dx in (1, 0))
        texture = np.asarray(cv2.blur(cv2.magnitude(across, down), (7, 7)))[v, u]
        flow = back[v, u]
        rough = np.abs(np.asarray(cv2.blur(back, (9, 9)))[v, u] - flow).max(axis=1)
        was = np.rint(np.stack([u, v], axis=1) + flow).astype(np.intp)
        inside = ((was >= _BORDER) & (was < np.array(self._backdrop.size) - _BORDER)).all(axis=1)
        was[~inside] = 0
        off = np.abs(forth[was[:, 1], was[:, 0]] + flow).max(axis=1)
        sure: Mask = inside & (texture > _TEXTURE) & (off < _RETURN) & (rough < _SMOOTH)
        return sure
