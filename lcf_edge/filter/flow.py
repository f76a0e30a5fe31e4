"""Geometry of the flow: angles, flow lines, the pinhole camera, rotations as homographies."""

import math

from lcf_edge.filter.memory import Doubles

PI = 3.141592653589793
MIN_SCALE = 1e-6  # of a homography: points behind the camera are sent far away


def wrap(angle: float) -> float:
    """Wrap an angle to (-π, π]."""
    turned = math.fmod(PI - angle, 2 * PI)
    return PI - (turned + 2 * PI if turned < 0 else turned)


def line_distance(dx: float, dy: float, cos: float, sin: float) -> float:
    """Signed distance of an offset (dx, dy) from the line through the origin in the direction (cos β, sin β), px.

    The paper's error-span condition with O as IC and tan β as the slope, but signed, and without the pole at vertical
    lines. Positive: to the right of the direction of flow in the image (y down).
    """
    return dy * cos - dx * sin


class Pinhole:
    """The ideal pinhole camera, px. ``focal``: mean of ``fx`` and ``fy``."""

    def __init__(self, fx: float, fy: float, cx: float, cy: float) -> None:
        self.fx, self.fy, self.cx, self.cy = fx, fy, cx, cy
        self.focal = 0.5 * (fx + fy)


class Homography:
    """H = K·R·K⁻¹, row-major: the image motion of points at infinity under a rotation.

    ``x``, ``y``: result of ``warp``, px.
    """

    def __init__(self) -> None:
        self.xx = self.yy = self.ww = 1.0
        self.xy = self.xw = self.yx = self.yw = self.wx = self.wy = 0.0
        self.x = self.y = 0.0


def set_homography(h: Homography, pinhole: Pinhole, rotation: Doubles, k: int) -> None:
    """Set H = K·R·K⁻¹ from the ``k``-th of rotations (n, 3, 3)."""
    h.xx = (pinhole.fx * rotation[k, 0, 0] + pinhole.cx * rotation[k, 2, 0]) / pinhole.fx
    h.yx = (pinhole.fy * rotation[k, 1, 0] + pinhole.cy * rotation[k, 2, 0]) / pinhole.fx
    h.wx = rotation[k, 2, 0] / pinhole.fx
    h.xy = (pinhole.fx * rotation[k, 0, 1] + pinhole.cx * rotation[k, 2, 1]) / pinhole.fy
    h.yy = (pinhole.fy * rotation[k, 1, 1] + pinhole.cy * rotation[k, 2, 1]) / pinhole.fy
    h.wy = rotation[k, 2, 1] / pinhole.fy
    h.xw = pinhole.fx * rotation[k, 0, 2] + pinhole.cx * rotation[k, 2, 2] - pinhole.cx * h.xx - pinhole.cy * h.xy
    h.yw = pinhole.fy * rotation[k, 1, 2] + pinhole.cy * rotation[k, 2, 2] - pinhole.cx * h.yx - pinhole.cy * h.yy
    h.ww = rotation[k, 2, 2] - pinhole.cx * h.wx - pinhole.cy * h.wy


def warp(h: Homography, x: float, y: float) -> None:
    """Map an image position, px; the result is in ``x``, ``y`` of the homography."""
    scale = 1 / max(h.wx * x + h.wy * y + h.ww, MIN_SCALE)
    h.x = (h.xx * x + h.xy * y + h.xw) * scale
    h.y = (h.yx * x + h.yy * y + h.yw) * scale
