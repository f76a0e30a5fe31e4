"""Images of what stands ahead: a board with a pattern before a far background, seen from a vehicle that drives."""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.config import Filter
from lcf_edge.corners.detector import CornerDetector
from lcf_edge.filter import Corners, Motion
from lcf_edge.lens import Lens

LENS = Lens(320, 240, 250.0, 250.0, 159.5, 119.5)
Grey = npt.NDArray[np.uint8]


def pattern(width: int, height: int, seed: int, grain_px: float = 2.5) -> Grey:
    """Soft blobs, as cloth and gravel have them; no two places alike."""
    noise = np.random.default_rng(seed).normal(size=(height, width)).astype(np.float32)
    soft = cv2.GaussianBlur(noise, (0, 0), grain_px)
    return np.asarray(np.clip(128 + 45 * soft / soft.std(), 0, 255), np.uint8)


def drawn(image: Grey, texture: Grey, left: float, top: float, scale: float) -> Grey:
    """The image with the texture, that many times as large, its corner there, px."""
    matrix = np.array([[scale, 0, left], [0, scale, top]])
    size = image.shape[1], image.shape[0]
    put = cv2.warpAffine(texture, matrix, size, flags=cv2.INTER_AREA if scale < 0.5 else cv2.INTER_LINEAR)
    where = cv2.warpAffine(np.full_like(texture, 255), matrix, size)
    share = where.astype(np.float32) / 255
    return np.asarray(np.rint(image * (1 - share) + put * share), np.uint8)


@dataclass(frozen=True)
class Board:
    """A drive towards a board; iterating gives what each step takes, with the image.

    ``range_m``, ``right_m``, ``width_m``, ``height_m``: of the board's middle, at the start and at the camera's height,
    and its size. ``speed_mps``, ``yaw_rate_radps``: as reported; the camera itself looks straight ahead. ``flicker``:
    share of the corners that a frame does not show. ``floor_m``: the camera's height above a drawn floor; None: none.
    """

    range_m: float = 6.0
    right_m: float = 0.0
    width_m: float = 0.8
    height_m: float = 1.0
    speed_mps: float = 1.0
    yaw_rate_radps: float = 0.0
    measured_mps: float | None = None
    frames: int = 50
    fps: float = 20.0
    flicker: float = 0.6
    floor_m: float | None = None
    seed: int = 0

    def __iter__(self) -> Iterator[tuple[Corners, Motion, Grey]]:
        detector = CornerDetector(Filter(), LENS, 1500)
        random = np.random.default_rng(self.seed)
        measured_mps = self.speed_mps if self.measured_mps is None else self.measured_mps
        for seq in range(self.frames):
            image = self.image(seq)
            corners, _ = detector.detect(image)
            kept = random.random(len(corners)) >= self.flicker
            shown = Corners(corners.pixel[kept], corners.position[kept], corners.appearance[kept])
            yield shown, Motion(1 / self.fps, np.eye(3), 0.001, measured_mps, self.yaw_rate_radps), image

    def distance_m(self, seq: int) -> float:
        """From the camera to the board."""
        return self.range_m - self.speed_mps * seq / self.fps

    def image(self, seq: int) -> Grey:
        """What the camera sees."""
        background = 160 + pattern(LENS.width, LENS.height, self.seed + 100) // 8
        if self.floor_m:
            background = self.floored(background, self.floor_m, self.speed_mps * seq / self.fps)
        px_m = LENS.fx / self.distance_m(seq)
        texture = pattern(200, round(200 * self.height_m / self.width_m), self.seed, 14.0)
        left = LENS.cx + (self.right_m - self.width_m / 2) * px_m
        return drawn(background, texture, left, LENS.cy - self.height_m / 2 * px_m, self.width_m * px_m / 200)

    def floored(self, image: Grey, height_m: float, driven_m: float) -> Grey:
        """The image with a floor of soft blobs below the horizon, 50 px a metre."""
        floor = pattern(400, 1200, self.seed + 200, 4.0)
        u, v = np.meshgrid(np.arange(LENS.width), np.arange(LENS.height))
        below = np.maximum(v - LENS.cy, 0.5)
        range_m = height_m * LENS.fy / below
        across, along = (u - LENS.cx) * range_m / LENS.fx * 50 + 200, (range_m + driven_m) * 50
        seen = cv2.remap(floor, across.astype(np.float32), along.astype(np.float32), cv2.INTER_LINEAR)
        return np.asarray(np.where((v > LENS.cy) & (range_m < 15.0), seen, image), np.uint8)
