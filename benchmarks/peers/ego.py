"""Rotation and displacement of the camera since each of the last images, and its present heading."""

import math

import numpy as np
import numpy.typing as npt

from benchmarks.peers.peer import Floats, Mask, Rows
from lcf_edge.config import Config
from lcf_edge.filter import Motion
from lcf_edge.lens import Lens

SLOTS = 10
SPACING_S = 0.045  # least time between two images that are remembered: half a second at 20 frame/s
_PITCH_MEMORY_S = 1.0  # shaking of the camera faster than this does not change the heading
_YAW_MEMORY_S = 0.3
_STILL_M = 1e-3

Vectors = npt.NDArray[np.float64]


class Ego:
    """Rotation and displacement of the camera since the images in ``SLOTS`` slots.

    A stationary point at X in the camera's axes of slot k is now at ``rotation[k]`` X - ``way_m[k]``.
    """

    def __init__(self, config: Config, lens: Lens) -> None:
        self.lens = lens
        self.focal_px = 0.5 * (lens.fx + lens.fy)
        self.rotation = np.tile(np.eye(3), (SLOTS, 1, 1))
        self.way_m = np.zeros((SLOTS, 3))
        self.elapsed_s = np.full(SLOTS, np.inf)
        self.sigma_rad = np.zeros(SLOTS)  # of the rotation
        self.last = Motion(0.0, np.eye(3), 0.0, 0.0, 0.0)
        self.number = 0  # images remembered so far
        self._inverse = np.linalg.inv(lens.matrix)
        self._mounted = np.array([-math.tan(config.camera.yaw_rad), math.tan(config.camera.pitch_rad), 1.0])
        self._forward = self._mounted.copy()  # direction of travel, z = 1

    @property
    def speed_mps(self) -> float:
        """Of the last interval; 0 when unknown."""
        return self.last.speed_mps if math.isfinite(self.last.speed_mps) else 0.0

    @property
    def focus(self) -> tuple[float, float]:
        """The vehicle's heading, px of the ideal pinhole."""
        x, y, _ = self._forward
        return self.lens.cx + self.lens.fx * x, self.lens.cy + self.lens.fy * y

    def advance(self, motion: Motion) -> None:
        """Account for the motion since the last image."""
        self.last = motion
        before = motion.rotation @ (self._forward / np.linalg.norm(self._forward))
        shaken = before / before[2]
        shaken[0] -= motion.path_yaw_rate_radps * motion.dt_s  # a left turn moves the image to the right
        keep = [math.exp(-motion.dt_s / memory) for memory in (_YAW_MEMORY_S, _PITCH_MEMORY_S)]
        self._forward[:2] = self._mounted[:2] + keep * (shaken[:2] - self._mounted[:2])
        after = self._forward / np.linalg.norm(self._forward)
        step_m = 0.5 * self.speed_mps * motion.dt_s * (before + after)  # chord of the arc
        self.rotation[:] = motion.rotation @ self.rotation
        self.way_m[:] = self.way_m @ motion.rotation.T + step_m
        self.elapsed_s += motion.dt_s
        self.sigma_rad += motion.rotation_sigma_rad  # mostly bias, which adds up

    def due(self) -> bool:
        """Whether enough time has passed to store this image."""
        return self.number == 0 or float(self.elapsed_s[(self.number - 1) % SLOTS]) >= SPACING_S

    def remember(self) -> int:
        """Store this image. Return its slot."""
        slot = self.number % SLOTS
        self.rotation[slot], self.way_m[slot], self.elapsed_s[slot], self.sigma_rad[slot] = np.eye(3), 0, 0, 0
        self.number += 1
        return slot

    def slot_back(self, back_by: int) -> int | None:
        """Slot of the image remembered ``back_by`` ago, or the oldest; None: there is none yet."""
        back = min(back_by, self.number, SLOTS)
        return (self.number - back) % SLOTS if back else None

    def homography(self, slot: int) -> Vectors:
        """(3, 3): carries positions of the slot's image through the rotation since."""
        turned: Vectors = self.lens.matrix @ self.rotation[slot] @ self._inverse
        return turned

    def ground_homography(self, slot: int, camera_height_m: float) -> Vectors:
        """(3, 3): carries positions of the slot's image as the ground moves, under a level path.

        The ground is n·X = h with n down, at right angles to the heading: X' = (R - t nᵀ/h) X.
        """
        forward = self._forward / np.linalg.norm(self._forward)
        down = np.array([0.0, 1.0, 0.0])
        down -= forward * (forward @ down)
        normal = self.rotation[slot].T @ (down / np.linalg.norm(down))
        moved: Vectors = self.rotation[slot] - np.outer(self.way_m[slot], normal) / camera_height_m
        return self.lens.matrix @ moved @ self._inverse

    def last_homography(self) -> Vectors:
        """(3, 3): the rotation since the image before."""
        turned: Vectors = self.lens.matrix @ self.last.rotation @ self._inverse
        return turned

    def derotate(self, slot: Rows, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Positions (n,) px in the images of slots (n,), as if the camera had not turned since."""
        h = (self.lens.matrix @ self.rotation @ self._inverse).reshape(SLOTS, 9).astype(np.float32)[slot].T
        return warp(h, x, y)

    def focus_since(self, slot: Rows) -> tuple[Floats, Floats, Floats]:
        """Focus of expansion of the displacement since each slot (n,), px, and its forward part, m."""
        moves: Mask = np.abs(self.way_m[:, 2]) > _STILL_M
        ahead = np.where(moves, self.way_m[:, 2], 1.0)
        now_x, now_y = self.focus
        focus_x = np.where(moves, self.lens.cx + self.lens.fx * self.way_m[:, 0] / ahead, now_x)
        focus_y = np.where(moves, self.lens.cy + self.lens.fy * self.way_m[:, 1] / ahead, now_y)
        x, y, forward = np.stack([focus_x, focus_y, self.way_m[:, 2]]).astype(np.float32)[:, slot]
        return x, y, forward


def warp(h: npt.NDArray[np.float32], x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Positions (n,) through homographies (9,) or (9, n)."""
    scale = 1 / np.maximum(h[6] * x + h[7] * y + h[8], np.float32(1e-6))  # points behind the camera go far away
    return (h[0] * x + h[1] * y + h[2]) * scale, (h[3] * x + h[4] * y + h[5]) * scale
