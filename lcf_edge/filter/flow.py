"""Where what stands still goes in the image: angles, flow lines, the ideal camera, rotations as homographies."""

import math

from lcf_edge.filter.memory import Doubles

PI = 3.141592653589793
MIN_SCALE = 1e-6  # of a homography: what is behind the camera goes far away


def wrap(angle: float) -> float:
    """Angle in (-π, π]."""
    turned = math.fmod(PI - angle, 2 * PI)
    return PI - (turned + 2 * PI if turned < 0 else turned)


def line_distance(dx: float, dy: float, cos: float, sin: float) -> float:
    """Signed distance in px of an offset (dx, dy) from the line through the origin in the direction (cos β, sin β).

    The paper's error-span condition with O as IC and tan β as the slope; signed, and without a pole at vertical
    lines. Positive: to the right of the direction of flow as the image shows it (y down).
    """
    return dy * cos - dx * sin


class Pinhole:
    """The ideal camera that positions refer to, px. ``focal``: mean of ``fx`` and ``fy``."""

    def __init__(self, fx: float, fy: float, cx: float, cy: float) -> None:
        self.fx, self.fy, self.cx, self.cy = fx, fy, cx, cy
        self.focal = 0.5 * (fx + fy)


class Homography:
    """H = K·R·K⁻¹, row after row: where the image of distant points goes when the camera turns.

    ``x``, ``y``: the place that ``warp`` found, px.
    """

    def __init__(self) -> None:
        self.xx = self.yy = self.ww = 1.0
        self.xy = self.xw = self.yx = self.yw = self.wx = self.wy = 0.0
        self.x = self.y = 0.0


def set_homography(h: Homography, pinhole: Pinhole, rotation: Doubles, k: int) -> None:
    """H = K·R·K⁻¹ of the ``k``-th of rotations (n, 3, 3)."""
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
    """Set ``x``, ``y`` of a homography to where it takes an image position, px."""
    scale = 1 / max(h.wx * x + h.wy * y + h.ww, MIN_SCALE)
    h.x = (h.xx * x + h.xy * y + h.xw) * scale
    h.y = (h.yx * x + h.yy * y + h.yw) * scale
