"""An earlier image, registered to this one as if the scene were only ground and distant points."""

import cv2
import numpy as np

from benchmarks.peers.ego import Ego, warp
from benchmarks.peers.peer import Floats, Grey, Mask
from lcf_edge.config import Config


class Backdrop:
    """Warps the earlier image: above the horizon by the camera's rotation, below it by the motion of the ground.

    Images are ``shrink`` times smaller than the camera's. ``pixels``: (n, 2) position of each pixel of an image,
    row-major, px of the pinhole.
    """

    def __init__(self, config: Config, ego: Ego, shrink: int) -> None:
        self.size = (ego.lens.width // shrink, ego.lens.height // shrink)
        self._height_m = config.camera.height_m
        self._ego = ego
        self._shrink = shrink
        columns, rows = np.meshgrid(*(np.arange(each, dtype=np.float32) for each in self.size))
        self.pixels = self.full(np.stack([columns, rows], axis=2).reshape(-1, 2))

    def shrink(self, image: Grey) -> Grey:
        """Return the downscaled image."""
        return np.asarray(cv2.resize(image, self.size, interpolation=cv2.INTER_AREA), np.uint8)

    def full(self, points: Floats) -> Floats:
        """Positions (n, 2) px of a small image, in px of the pinhole."""
        half = np.float32(0.5)
        return self._ego.lens.undistort(np.float32(self._shrink) * (points + half) - half)

    def expect(self, points: Floats, slot: int) -> Floats:
        """Return where points (n, 2), px of the pinhole, were if distant or on the ground; derotated."""
        ego = self._ego
        if self._height_m <= 0:
            return points
        moved = ego.homography(slot) @ np.linalg.inv(ego.ground_homography(slot, self._height_m))
        ground = np.stack(warp(moved.astype(np.float32).ravel(), points[:, 0], points[:, 1]), axis=1)
        return np.where(points[:, 1:] > np.float32(ego.focus[1]), ground, points)

    def lay(self, earlier: Grey, slot: int) -> tuple[Grey, Mask]:
        """Return the slot's downscaled image warped onto this one, and the pixels that it covers; both of ``size``."""
        ego = self._ego
        derotated = self.expect(self.pixels, slot)
        turn_back = np.linalg.inv(ego.homography(slot)).astype(np.float32).ravel()
        seen = ego.lens.distort(np.stack(warp(turn_back, derotated[:, 0], derotated[:, 1]), axis=1))
        place = (seen + np.float32(0.5)) / np.float32(self._shrink) - np.float32(0.5)
        columns, rows = np.ascontiguousarray(place.T).reshape(2, *earlier.shape)
        covered: Mask = (columns >= 0) & (rows >= 0) & (columns < self.size[0] - 1) & (rows < self.size[1] - 1)
        laid = cv2.remap(earlier, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(laid, np.uint8), covered
