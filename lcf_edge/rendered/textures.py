"""Surfaces made from a seed: grey images with marks that have real corners at several scales."""

from functools import cache

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.rendered.drives import Paint

Image = npt.NDArray[np.uint8]
Random = np.random.Generator


def _clouds(random: Random, shape: tuple[int, int], cell_px: float) -> npt.NDArray[np.float32]:
    """Smooth noise in about -1..1 with bumps of `cell_px`."""
    height, width = shape
    small = random.uniform(-1, 1, (int(height / cell_px) + 3, int(width / cell_px) + 3)).astype(np.float32)
    return np.asarray(cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR), dtype=np.float32)


def _marks(random: Random, canvas: npt.NDArray[np.float32], size_px: float, share: float, depth: float) -> None:
    """Paint rectangles, triangles and discs of about `size_px` that cover about `share` of the canvas."""
    height, width = canvas.shape
    count = int(share * width * height / size_px**2) + 1
    centres = random.uniform((0, 0), (width, height), (count, 2)).astype(np.int32)
    halves = size_px / 2 * random.uniform(0.4, 1.4, (count, 2))
    greys, turns = random.uniform(-depth, depth, count).tolist(), random.uniform(0, np.pi / 2, count)
    cosines, sines = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x, y = halves[:, :1] * (-1, 1, 1, -1), halves[:, 1:] * (-1, -1, 1, 1)
    turned = np.stack([cosines * x - sines * y, sines * x + cosines * y], axis=2)
    polygons = np.rint(centres[:, None] + turned).astype(np.int32)
    for shape, centre, half, polygon, grey in zip(
        random.integers(3, size=count).tolist(),
        centres.tolist(),
        halves.astype(int),
        polygons,
        greys,
        strict=True,
    ):
        if shape == 2:
            cv2.ellipse(canvas, centre, (half + 1).tolist(), 0, 0, 360, (grey,), -1)
        else:
            cv2.fillConvexPoly(canvas, polygon[: 4 - shape], (grey,))


def _tiles(random: Random, shape: tuple[int, int], tile_px: float) -> npt.NDArray[np.float32]:
    """One tile with marks and a joint around it, again and again."""
    side = max(round(tile_px), 8)
    tile = 10 * _clouds(random, (side, side), side / 3)
    _marks(random, tile, side / 3, 0.6, 48)
    joint = max(side // 12, 1)
    tile[:joint] = tile[:, :joint] = -45
    height, width = shape
    return np.tile(tile, (height // side + 1, width // side + 1))[:height, :width]


def _finish(canvas: npt.NDArray[np.float32], mean: float) -> Image:
    return np.asarray(np.clip(canvas + mean, 4, 251), dtype=np.uint8)


def surface(paint: Paint, face: int, size_px: tuple[int, int], px_per_m: float, light: float) -> Image:
    """Texture of one face of a box, `size_px` = (width, height); `light` scales its mean."""
    random = np.random.default_rng([paint.seed, face])
    width, height = size_px
    if paint.tile_m:
        return _finish(_tiles(random, (height, width), paint.tile_m * px_per_m) * paint.contrast, paint.grey * light)
    feature_px = paint.feature_m * px_per_m
    canvas = 18 * _clouds(random, (height, width), max(feature_px * 2, 8.0))
    _marks(random, canvas, feature_px, 0.7, 48)
    _marks(random, canvas, feature_px * 0.4, 0.12, 65)
    canvas += 10 * _clouds(random, (height, width), max(feature_px / 5, 2.0))
    return _finish(canvas * paint.contrast, paint.grey * light)


@cache
def ground(paint: Paint, size_px: int, px_per_m: float) -> Image:
    """Square patch of road, to be continued by reflection: stains, stones, cracks."""
    random = np.random.default_rng([paint.seed, 7])
    if paint.tile_m:
        return _finish(_tiles(random, (size_px, size_px), paint.tile_m * px_per_m) * paint.contrast, paint.grey)
    canvas = 14 * _clouds(random, (size_px, size_px), px_per_m)
    canvas += 10 * _clouds(random, (size_px, size_px), px_per_m / 6)
    _marks(random, canvas, paint.feature_m * px_per_m, 0.08, 40)
    _marks(random, canvas, paint.feature_m * px_per_m / 4, 0.06, 55)
    for _ in range(6):
        ends = random.uniform(0, size_px, (2, 2)).astype(int)
        cv2.line(canvas, ends[0].tolist(), ends[1].tolist(), (-45.0,), 3, cv2.LINE_AA)
    canvas += 6 * _clouds(random, (size_px, size_px), px_per_m / 40)
    return _finish(canvas * paint.contrast, paint.grey)


@cache
def skyline(paint: Paint, side_px: int, height_px: int) -> tuple[Image, ...]:
    """The four sides of the horizon, each (height_px, side_px): clouds above, houses far away."""
    random = np.random.default_rng([paint.seed, 20])
    width = 4 * side_px
    canvas = np.linspace(60, 25, height_px, dtype=np.float32)[:, None] + 6 * _clouds(random, (height_px, width), 120)
    left = 0
    while left < width:
        wide, tall = int(random.integers(20, 90)), int(random.integers(15, 95))
        grey, top = float(random.uniform(-70, 15)), height_px - tall
        cv2.rectangle(canvas, (left, top), (left + wide, height_px), (grey,), -1)
        for row in range(top + 6, height_px - 8, 14):
            for column in range(left + 5, left + wide - 8, 13):
                if random.random() < 0.55:
                    window = (column + int(random.integers(5, 8)), row + int(random.integers(5, 9)))
                    cv2.rectangle(canvas, (column, row), window, (grey + float(random.uniform(-45, 45)),), -1)
        left += wide + int(random.integers(-8, 30))
    canvas = np.roll(canvas, width * 5 // 8, axis=1)  # the strip's ends meet behind the vehicle
    sides = np.split(_finish(canvas * paint.contrast, paint.grey), 4, axis=1)
    return tuple(np.ascontiguousarray(side) for side in sides)
