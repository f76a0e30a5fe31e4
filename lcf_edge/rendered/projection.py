"""Where things appear: the lens, clipping, and the boxes of a drive as seen at one moment."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.rendered.drives import Box, Drive, Floats, Lens
from lcf_edge.rendered.textures import Image
from lcf_edge.rendered.trajectory import Trajectory

NEAR_M = 0.05
"""Surfaces are clipped at this distance before the camera."""

_EDGE_ON = 1e-6
_CORNER = (0, 1, 2, 3, 3)  # of the footprint, where each face begins: back, right, front, left, top
_NEXT = (1, 2, 3, 0, 2)
_UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@dataclass(frozen=True)
class Surface:
    """A rectangle as the camera sees it: where its texture (u, v in 0..1) lies, and its clipped outline."""

    to_texture: Floats  # (3, 3): px of the canvas to (u, v, 1)
    outline: Floats  # (n, 2) px of the canvas
    bounds: tuple[float, float, float, float]  # left, top, right, bottom of the outline
    extent_px: tuple[float, float]  # its width and height at the scale that its middle has


@dataclass(frozen=True)
class Placed:
    """A box that is in the image."""

    number: int  # among the drive's boxes
    box: Box
    faces: tuple[tuple[int, Surface], ...]  # number of the face (back, right, front, left, top), visible ones


@dataclass(frozen=True)
class View:
    """One moment: the camera's pose and what is before it."""

    time_s: float
    attitude: Floats  # (3, 3) camera to world
    position: Floats  # (3,) m
    placed: tuple[Placed, ...]  # far to near


class Optics:
    """From camera axes to the pinhole canvas, and from the canvas to the finished image.

    The canvas is the image itself, or, with a distorting lens, a larger one that the lens looks at.
    """

    def __init__(self, lens: Lens) -> None:
        self.lens = lens
        self.matrix = lens.matrix
        self.size = (lens.width, lens.height)
        self._map: npt.NDArray[np.float32] | None = None  # columns and rows to look at
        if lens.model != "none":
            columns, rows = np.meshgrid(np.arange(lens.width, dtype=float), np.arange(lens.height, dtype=float))
            seen = self._undistorted(np.stack([columns, rows], axis=-1).reshape(-1, 2))
            low = np.floor(seen.min(axis=0)) - 1
            self.size = tuple((np.ceil(seen.max(axis=0)) + 1 - low).astype(int).tolist())
            self.matrix[:2, 2] -= low
            self._map = (seen - low).T.astype(np.float32).reshape(2, lens.height, lens.width)

    def _undistorted(self, points: Floats) -> Floats:
        """Where a pinhole camera would see what the lens puts at `points` (n, 2) px."""
        matrix, coefficients = self.lens.matrix, np.array(self.lens.distortion)
        if self.lens.model == "equidistant":
            flat = cv2.fisheye.undistortPoints(points[:, None], matrix, coefficients, P=matrix)
        else:
            flat = cv2.undistortPoints(points[:, None], matrix, coefficients, P=matrix)
        return np.asarray(flat, dtype=np.float64)[:, 0]

    def distorted(self, points: Floats) -> Floats:
        """Where the finished image shows points (n, 2) px of the canvas."""
        if self._map is None:
            return points
        rays = (points - self.matrix[:2, 2]) / self.lens.focal_px
        coefficients = np.array(self.lens.distortion)
        if self.lens.model == "equidistant":
            shown = cv2.fisheye.distortPoints(rays[:, None], self.lens.matrix, coefficients)
            return np.asarray(shown, dtype=np.float64)[:, 0]
        rays = np.column_stack([rays, np.ones(len(rays))])
        shown, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), self.lens.matrix, coefficients)
        return np.asarray(shown, dtype=np.float64)[:, 0]

    def finish(self, canvas: Image) -> Image:
        """The image behind the lens."""
        if self._map is None:
            return canvas
        columns, rows = self._map
        return np.asarray(cv2.remap(canvas, columns, rows, cv2.INTER_LINEAR), dtype=np.uint8)

    def surfaces(self, corners: Floats, across: Floats, down: Floats) -> list[Surface | None]:
        """Rectangles by one corner and two sides (n, 3), camera axes in m; None: not in the image."""
        points = corners[:, None] + _UNIT[:, :1] * across[:, None] + _UNIT[:, 1:] * down[:, None]
        homographies = self.matrix @ np.stack([across, down, corners], axis=2)
        before = points[..., 2] >= NEAR_M
        whole: npt.NDArray[np.bool_] = np.all(before, axis=1)
        # Those across the near plane: cut, and measured at the middle of what is left.
        middles = np.full((len(points), 2), 0.5)
        cut = {}
        for row in np.flatnonzero(np.any(before, axis=1) & ~whole).tolist():
            cut[row] = clip_near(np.hstack([points[row], _UNIT]))
            middles[row] = cut[row][:, 3:].mean(axis=0)
        shown = points @ self.matrix.T
        outlines = shown[..., :2] / np.where(whole[:, None], shown[..., 2], 1.0)[..., None]
        x, y, w = np.einsum("nij,nj->in", homographies, np.insert(middles, 2, 1.0, axis=1))
        slopes = homographies[:, :2, :2] * w[:, None, None]
        slopes -= np.stack([x, y], axis=1)[:, :, None] * homographies[:, 2:, :2]
        extents = np.hypot(slopes[:, 0], slopes[:, 1]) / np.square(np.maximum(w, NEAR_M / 2))[:, None]
        low, high = outlines.min(axis=1), outlines.max(axis=1)
        inside: npt.NDArray[np.bool_] = whole & np.all((high > -1) & (low < self.size), axis=1)
        bounds, sizes = np.hstack([low, high]).tolist(), extents.tolist()
        to_textures = np.linalg.inv(homographies)
        found: list[Surface | None] = []
        for row in range(len(points)):
            if row in cut:
                outline = cut[row][:, :3] @ self.matrix.T
                outline = outline[:, :2] / outline[:, 2:]
                bounds[row] = [*outline.min(axis=0).tolist(), *outline.max(axis=0).tolist()]
            elif inside[row]:
                outline = outlines[row]
            else:
                found.append(None)
                continue
            found.append(Surface(to_textures[row], outline, tuple(bounds[row]), tuple(sizes[row])))
        return found


def clip_near(points: Floats) -> Floats:
    """Cut a convex polygon (n, 2+k), camera axes first, at z = NEAR_M; the other columns are interpolated."""
    if points[:, 2].min() >= NEAR_M:
        return points
    kept: list[Floats] = []
    for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
        if a[2] >= NEAR_M:
            kept.append(a)
        if (a[2] >= NEAR_M) != (b[2] >= NEAR_M):
            kept.append(a + (b - a) * (NEAR_M - a[2]) / (b[2] - a[2]))
    return np.array(kept).reshape(-1, points.shape[1])


class Stage:
    """A drive with its camera and its path, to be looked at any time."""

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        self.optics = Optics(drive.lens)
        self.trajectory = Trajectory(drive)
        self._still = np.array([len(box.path) == 1 for box in drive.boxes], dtype=bool)
        self._footprints = np.array([box.footprint(0.0) for box in drive.boxes]).reshape(-1, 4, 2)

    def footprints(self, time_s: float) -> Floats:
        """(n, 4, 2) of all boxes, as `Box.footprint`."""
        now = self._footprints.copy()
        for number in np.flatnonzero(~self._still).tolist():
            now[number] = self.drive.boxes[number].footprint(time_s)
        return now

    def view(self, time_s: float) -> View:
        """What the camera sees, nearer boxes after farther ones."""
        time = np.array([time_s])
        attitude, position = self.trajectory.attitude(time)[0], self.trajectory.position(time)[0]
        return self.look(time_s, attitude, position, self.footprints(time_s))

    def look(self, time_s: float, attitude: Floats, position: Floats, base: Floats) -> View:
        """What a camera in a pose sees of the boxes on their footprints `base` (n, 4, 2)."""
        boxes = self.drive.boxes
        if not boxes:
            return View(time_s, attitude, position, ())
        offset = base - position[[0, 2]]
        distance = np.hypot(*offset.mean(axis=1).T)
        before = (offset @ attitude[[0, 2], 2]).max(axis=1) > -1.0  # a metre for pitch
        side = np.roll(base, -1, axis=1) - base
        # The camera is on a side's outer side; one seen edge on is left out.
        outside = side[..., 0] * offset[..., 1] - side[..., 1] * offset[..., 0] > _EDGE_ON
        tall = np.array([box.height_m for box in boxes])
        seen = np.column_stack([outside, -position[1] - tall > _EDGE_ON]) & before[:, None]
        order = np.argsort(-distance, kind="stable")
        rows, faces = np.nonzero(seen[order])
        rows = order[rows]
        # Corner, corner across and corner down of each face; the top's lie among the high ones.
        over = np.array([box.top_offset(time_s) for box in boxes])
        hanging = offset + np.stack([over, np.zeros_like(over)], axis=1)[:, None]
        high = (np.insert(hanging, 1, (-tall - position[1])[:, None], axis=2)) @ attitude
        corner, next_corner = np.array(_CORNER)[faces], np.array(_NEXT)[faces]
        start = high[rows, corner]
        upright = attitude[1] * tall[rows, None] - attitude[0] * over[rows, None]
        down = np.where((faces == 4)[:, None], high[rows, 0] - high[rows, 3], upright)
        surfaces = self.optics.surfaces(start, high[rows, next_corner] - start, down)
        placed: dict[int, list[tuple[int, Surface]]] = {}
        for number, face, surface in zip(rows.tolist(), faces.tolist(), surfaces, strict=True):
            if surface is not None:
                placed.setdefault(number, []).append((face, surface))
        return View(
            time_s,
            attitude,
            position,
            tuple(Placed(number, boxes[number], tuple(found)) for number, found in placed.items()),
        )
