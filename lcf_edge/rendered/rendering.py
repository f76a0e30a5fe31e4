"""Images of a drive: far to near, each surface warped through its homography onto its bounding region.

Shrinking is anti-aliased: box faces keep a pyramid with independent levels across and along, chosen by the
face's foreshortening; the ground is drawn in bands of distance with three lines an image row.
"""

import math
from dataclasses import astuple

import cv2
import numpy as np

from lcf_edge.rendered import textures
from lcf_edge.rendered.drives import Box, Drop, Floats, Paint
from lcf_edge.rendered.projection import Stage, Surface, View
from lcf_edge.rendered.textures import Image

_POLYGON_BITS = 4  # of a pixel's fraction, for OpenCV's polygons
_FACE_LIGHT = (0.85, 1.1, 0.95, 0.75, 1.25)  # back, right, front, left, top
_FACE_TEXELS = 384  # longest side of a face's texture
_GROUND_TEXELS = 2048
_GROUND_MARGIN = 1024
_GROUND_ORIGIN = 0.37  # of the patch, so that no mirror axis runs along the usual path
_SKYLINE_M = 1000.0  # half the side of the backdrop that travels with the camera
_SKYLINE_TEXELS = 1024
_SKYLINE_ROWS = 480
_ZENITH_GREY = 205
_EXPOSURE_STEPS = 4
_SHARPENED_PX = 1.2
_READOUT_BANDS = 8
_DARK = np.zeros((8, 8), dtype=np.uint8)
_OWN_FEATURE_PX = 25.0
_OWN_GREY = 70.0
_LAMP = np.full((8, 8), 250, dtype=np.uint8)
_DROP_RIM = 0.15  # of its radius, over which it fades
_DROP_BLUR = 0.08  # of the image in it
_DROP_SHRINKS = 8
_DIRT_GREY = 60


class _Skin:
    """The texture of one face with its pyramid, halved across and along independently, made when needed."""

    def __init__(self, base: Image) -> None:
        self._levels: dict[tuple[int, int], Image] = {(0, 0): base}

    def level(self, across: int, along: int) -> Image:
        if (across, along) not in self._levels:
            height, width = self._levels[0, 0].shape
            size = (max(width >> across, 1), max(height >> along, 1))
            smaller = cv2.resize(self._levels[0, 0], size, interpolation=cv2.INTER_AREA)
            self._levels[across, along] = np.asarray(smaller, dtype=np.uint8)
        return self._levels[across, along]

    def fitting(self, surface: Surface) -> Image:
        """The level with about one texel a pixel in the middle of the surface, across and along."""
        height, width = self._levels[0, 0].shape
        wide, tall = surface.extent_px
        across = math.log2(width / min(max(wide, 1.0), width))
        along = math.log2(height / min(max(tall, 1.0), height))
        return self.level(round(across), round(along))


class Renderer:
    """Draws the images of one drive; keeps its textures."""

    def __init__(self, stage: Stage) -> None:
        drive = stage.drive
        self._stage, self._drive, self._optics = stage, drive, stage.optics
        self._skins: dict[tuple[str, int], _Skin] = {}
        self._ground_px_per_m = 128 / drive.camera_height_m
        self._ground = _Skin(textures.ground(drive.ground, _GROUND_TEXELS, self._ground_px_per_m))
        self._haze = int(self._ground.level(11, 11)[0, 0])
        self._skyline = textures.skyline(drive.sky, _SKYLINE_TEXELS, _SKYLINE_ROWS)
        self._ground_levels: dict[int, Image] = {}
        x, y = np.meshgrid(np.linspace(-1, 1, drive.lens.width), np.linspace(-1, 1, drive.lens.height))
        self._vignette = (1 - drive.lens.vignetting * (x**2 + y**2) / 2).astype(np.float32)
        self._own = np.zeros((drive.lens.height, drive.lens.width), dtype=np.uint8)  # where own parts hide the world
        for polygon in drive.own_parts:
            cv2.fillPoly(self._own, [np.rint(polygon).astype(np.int32)], (255,))
        look = Paint(drive.seed, feature_m=_OWN_FEATURE_PX, grey=_OWN_GREY)
        self._own_look = textures.surface(look, 0, (drive.lens.width, drive.lens.height), 1.0, 1.0)
        self._random = np.random.default_rng([drive.seed, 3])
        shape = (drive.lens.height + 32, drive.lens.width + 32)
        grain = self._random.normal(0, drive.noise.image, (4, *shape))
        self._grain = np.rint(grain).astype(np.int16)

    def image(self, view: View) -> Image:
        """The next image (height, width); exposure starts at the view's time."""
        drive = self._drive
        exposed = self._read_out(view) if drive.readout_s else self._optics.finish(self._canvas(view))
        if drive.exposure_s > 0:
            later = drive.exposure_s * np.arange(1, _EXPOSURE_STEPS) / _EXPOSURE_STEPS
            views = [self._stage.view(view.time_s + delay) for delay in later.tolist()]
            light = [exposed, *(self._optics.finish(self._canvas(each)) for each in views)]
            exposed = np.rint(np.mean(light, axis=0)).astype(np.uint8)
        exposed = np.where(self._own > 0, self._own_look, exposed) if drive.own_parts else exposed
        for drop in drive.drops:
            _cover(exposed, drop)
        gain = float(drive.gain.at(np.array([view.time_s]))[0])
        lit = cv2.multiply(exposed, self._vignette, scale=gain, dtype=cv2.CV_8U)
        if drive.sharpening:
            smoother = cv2.GaussianBlur(lit, (0, 0), _SHARPENED_PX)
            lit = cv2.addWeighted(lit, 1 + drive.sharpening, smoother, -drive.sharpening, 0)
        top, left, which = self._random.integers((32, 32, len(self._grain)))
        grain = self._grain[which, top : top + lit.shape[0], left : left + lit.shape[1]]
        return np.asarray(cv2.add(lit, grain, dtype=cv2.CV_8U), dtype=np.uint8)

    def _read_out(self, view: View) -> Image:
        """Bands of rows, each at its own time, the view's in the middle."""
        drive = self._drive
        image = np.empty((drive.lens.height, drive.lens.width), dtype=np.uint8)
        for band in range(_READOUT_BANDS):
            top, bottom = (drive.lens.height * edge // _READOUT_BANDS for edge in (band, band + 1))
            late = drive.readout_s * ((band + 0.5) / _READOUT_BANDS - 0.5)
            image[top:bottom] = self._optics.finish(self._canvas(self._stage.view(view.time_s + late)))[top:bottom]
        return image

    def _canvas(self, view: View) -> Image:
        """The scene through the pinhole, full daylight, no noise."""
        canvas = np.empty(self._optics.size[::-1], dtype=np.uint8)
        self._draw_ground(canvas, view.attitude, view.position)
        self._draw_shadows(canvas, view)
        if self._drive.gloss:
            self._draw_lamps(canvas, view, self._drive.ceiling_m, self._drive.gloss)
        self._draw_skyline(canvas, view.attitude)
        self._draw_lamps(canvas, view, -self._drive.ceiling_m, 1.0)
        for placed in view.placed:
            for face, surface in placed.faces:
                _paint(canvas, surface, self._skin(placed.box, face).fitting(surface))
        return canvas

    def _skin(self, box: Box, face: int) -> _Skin:
        if (box.name, face) not in self._skins:
            wide, tall = box.length_m if face in (1, 3) else box.width_m, box.height_m
            if face == 4:
                tall = box.length_m
            px_per_m = _FACE_TEXELS / max(wide, tall)
            size = (max(int(wide * px_per_m), 8), max(int(tall * px_per_m), 8))
            image = textures.surface(box.paint, face, size, px_per_m, _FACE_LIGHT[face])
            self._skins[box.name, face] = _Skin(image)
        return self._skins[box.name, face]

    def _ground_level(self, level: int) -> Image:
        """The patch continued around it: OpenCV is slow at continuing it."""
        if level not in self._ground_levels:
            margin = (_GROUND_MARGIN,) * 4
            wider = cv2.copyMakeBorder(self._ground.level(level, level), *margin, cv2.BORDER_REFLECT)
            self._ground_levels[level] = np.asarray(wider, dtype=np.uint8)
        return self._ground_levels[level]

    def _draw_skyline(self, canvas: Image, attitude: Floats) -> None:
        """A square of walls that travels with the camera, from its zenith down to the horizon."""
        half = _SKYLINE_M
        top = half * _SKYLINE_ROWS / (_SKYLINE_TEXELS / 2)
        corners = np.array([[-half, -top, half], [half, -top, half], [half, -top, -half], [-half, -top, -half]])
        corners = corners @ attitude
        across = np.roll(corners, -1, axis=0) - corners
        down = np.tile(attitude[1] * top, (4, 1))
        for side, surface in enumerate(self._optics.surfaces(corners, across, down)):
            if surface is not None:
                _paint(canvas, surface, self._skyline[side])

    def _draw_lamps(self, canvas: Image, view: View, y_m: float, share: float) -> None:
        """The lamps in the ceiling; or, as far below the floor, as it mirrors a share of their light."""
        if not self._drive.lamps:
            return
        x, z, width, length = np.array([astuple(lamp) for lamp in self._drive.lamps]).T
        level, none = np.full(len(x), y_m), np.zeros(len(x))
        corners = (np.stack([x - width / 2, level, z - length / 2], axis=1) - view.position) @ view.attitude
        across = np.stack([width, none, none], axis=1) @ view.attitude
        down = np.stack([none, none, length], axis=1) @ view.attitude
        for surface in self._optics.surfaces(corners, across, down):
            if surface is not None:
                _paint(canvas, surface, _LAMP, share)

    def _draw_shadows(self, canvas: Image, view: View) -> None:
        """Shadows on the ground: where the vehicle is, and its heading, they go along."""
        if not self._drive.shadows:
            return
        forward = self._stage.trajectory.forward(np.array([view.time_s]))[0]
        ahead, right = np.array([forward[0], 0.0, forward[1]]), np.array([forward[1], 0.0, -forward[0]])
        foot = np.array([view.position[0], 0.0, view.position[2]])
        for shadow in self._drive.shadows:
            aside = shadow.right_m + shadow.velocity_mps * (view.time_s - self._drive.seconds / 2)
            near = shadow.ahead_m - shadow.length_m / 2
            corner = foot + (aside - shadow.width_m / 2) * right + near * ahead - view.position
            sides = [shadow.width_m * right, shadow.length_m * ahead]
            placed = [vector @ view.attitude for vector in (corner, *sides)]
            for surface in self._optics.surfaces(*(vector[None] for vector in placed)):
                if surface is not None:
                    _paint(canvas, surface, _DARK, shadow.share)

    def _draw_ground(self, canvas: Image, attitude: Floats, position: Floats) -> None:
        """Bands of rows, each with the level of the pyramid that fits its distance."""
        optics, height_m = self._optics, -position[1]
        width, height = optics.size
        scale = self._ground_px_per_m
        # Texels (x, z) to canvas; the patch repeats by reflection, so whole double patches can be taken off.
        patch = _GROUND_TEXELS / scale
        where = np.remainder(position[[0, 2]] + (0.5 + _GROUND_ORIGIN) * patch, 2 * patch) - patch / 2
        origin = position[[0, 2]] - where
        start = (np.array([origin[0], 0.0, origin[1]]) - position) @ attitude
        to_canvas = optics.matrix @ np.column_stack([attitude[0] / scale, attitude[2] / scale, start])
        canvas[:] = self._haze
        horizon = optics.matrix[1, 2] - optics.lens.focal_px * attitude[1, 2] / attitude[1, 1]
        tilted = abs(attitude[1, 0] / attitude[1, 1]) * width  # rows that a rolled horizon rises by at most
        canvas[: int(np.clip(horizon - tilted, 0, height))] = _ZENITH_GREY
        below = np.arange(height) - horizon
        depth = optics.lens.focal_px * height_m / np.maximum(below, 1e-3)
        texels_a_line = scale * depth**2 / (optics.lens.focal_px * height_m) / 3
        level_of_row = np.clip(np.rint(np.log2(texels_a_line)), 0, 7)
        level_of_row[below < 3] = 8  # haze
        stretch = np.array([[1.0, 0.0, 0.0], [0.0, 3.0, 1.0], [0.0, 0.0, 1.0]])  # three lines a row, middle on it
        for level in np.unique(level_of_row[level_of_row < 8]).astype(int).tolist():
            rows = np.flatnonzero(level_of_row == level)
            shrink = np.diag([2.0**level, 2.0**level, 1.0])
            shrink[:2, 2] = (2.0**level - 1) / 2 - _GROUND_MARGIN * 2.0**level
            lift = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -float(rows[0])], [0.0, 0.0, 1.0]])
            band = cv2.warpPerspective(
                self._ground_level(level),
                np.linalg.inv(stretch @ lift @ to_canvas @ shrink),
                (width, 3 * len(rows)),
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_REFLECT,
            )
            cv2.resize(band, (width, len(rows)), canvas[rows[0] : rows[-1] + 1], interpolation=cv2.INTER_AREA)


def _paint(canvas: Image, surface: Surface, texture: Image, share: float = 1.0) -> None:
    """Blend a textured surface, or a share of its light, into the canvas, edges smoothed."""
    left, top, right, bottom = surface.bounds
    left, top = max(math.floor(left) - 1, 0), max(math.floor(top) - 1, 0)
    width = min(math.ceil(right) + 2, canvas.shape[1]) - left
    height = min(math.ceil(bottom) + 2, canvas.shape[0]) - top
    if width <= 0 or height <= 0:
        return
    rows, columns = texture.shape
    # Texel i lies at (i + 1/2) / size.
    to_texel = np.array([[columns, 0.0, -0.5], [0.0, rows, -0.5], [0.0, 0.0, 1.0]]) @ surface.to_texture
    to_texel[:, 2] += to_texel[:, :2] @ (left, top)
    patch = cv2.warpPerspective(
        texture,
        to_texel,
        (width, height),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    mask = np.zeros((height, width), dtype=np.uint8)
    polygon = np.rint((surface.outline - (left, top)) * 2**_POLYGON_BITS).astype(np.int32)
    cv2.fillConvexPoly(mask, polygon, (round(255 * share),), cv2.LINE_AA, _POLYGON_BITS)
    region = canvas[top : top + height, left : left + width]
    kept = cv2.multiply(region, cv2.bitwise_not(mask), scale=1 / 255)
    cv2.add(kept, cv2.multiply(patch, mask, scale=1 / 255), region)


def _cover(image: Image, drop: Drop) -> None:
    """Blend what a drop shows into the image; nothing if it lies outside."""
    height, width = image.shape
    reach = round(2 * drop.radius_px)
    left, right = (max(round(drop.x_px) + side, 0) for side in (-reach, reach))
    top, bottom = (max(round(drop.y_px) + side, 0) for side in (-reach, reach))
    region = image[top:bottom, left:right]
    if not region.size:
        return
    x, y = np.meshgrid(np.arange(region.shape[1]) + left - drop.x_px, np.arange(region.shape[0]) + top - drop.y_px)
    opaque = 1 / (1 + np.exp((np.hypot(x, y) / drop.radius_px - 1) / _DROP_RIM))
    shown = np.full(region.shape, float(_DIRT_GREY))
    if not drop.is_dirt:
        small = cv2.resize(image, (width // _DROP_SHRINKS, height // _DROP_SHRINKS), interpolation=cv2.INTER_AREA)
        soft = cv2.GaussianBlur(small, (0, 0), _DROP_BLUR * small.shape[1])
        # The whole image is upside down in it.
        columns, rows = ((0.5 - each / (2 * drop.radius_px)) for each in (x, y))
        columns, rows = (columns * small.shape[1]).astype(np.float32), (rows * small.shape[0]).astype(np.float32)
        shown = cv2.remap(soft, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(float)
    region[:] = np.rint(region * (1 - opaque) + shown * opaque).astype(np.uint8)
