"""The flow that the displacement since each key frame implies for this image."""

import math

from lcf_edge.filter import flow
from lcf_edge.filter.flow import Homography, Pinhole
from lcf_edge.filter.inputs import KEYS
from lcf_edge.filter.key_frames import KeyFrames
from lcf_edge.filter.memory import doubles
from lcf_edge.filter.situation import Situation

STILL_M = 1e-3  # a displacement below this has no direction


class Baselines:
    """One row for each slot of ``KeyFrames``.

    ``h``: homography (KEYS, 9) of the rotation since. ``focus_x``, ``focus_y``: focus of the displacement since, px.
    ``depth_m``: ΔZ, its forward component. ``elapsed_s``. ``sigma_px``: uncertainty of the rotation since, of this key
    frame alone: by the gyro, or by the flow once that has measured it. ``is_fitted``, ``rate_covariance`` (3, 3),
    (rad/s)²: of the rotation-rate error after a fit, which all key frames share. ``turned_x``, ``turned_y``: scratch,
    image motion of a point for 1 rad about each axis, px.
    """

    def __init__(self) -> None:
        self.h = doubles(KEYS, 9)
        self.focus_x, self.focus_y, self.depth_m, self.elapsed_s, self.sigma_px = [doubles(KEYS) for _ in range(5)]
        self.is_fitted = False
        self.rate_covariance = doubles(3, 3)
        self.turned_x, self.turned_y = doubles(3), doubles(3)


def measure(baselines: Baselines, keys: KeyFrames, h: Homography, pinhole: Pinhole, around: Situation) -> None:
    """Set the baselines of this frame from the key frames. ``h``: scratch."""
    baselines.is_fitted = False
    for k in range(KEYS):
        flow.set_homography(h, pinhole, keys.rotation, k)
        baselines.h[k, 0], baselines.h[k, 1], baselines.h[k, 2] = h.xx, h.xy, h.xw
        baselines.h[k, 3], baselines.h[k, 4], baselines.h[k, 5] = h.yx, h.yy, h.yw
        baselines.h[k, 6], baselines.h[k, 7], baselines.h[k, 8] = h.wx, h.wy, h.ww
        ahead = keys.displacement[k, 2]
        baselines.focus_x[k], baselines.focus_y[k] = around.focus_x, around.focus_y
        if math.fabs(ahead) > STILL_M:
            baselines.focus_x[k] = keys.displacement[k, 0] / ahead * pinhole.fx + pinhole.cx
            baselines.focus_y[k] = keys.displacement[k, 1] / ahead * pinhole.fy + pinhole.cy
        baselines.depth_m[k], baselines.elapsed_s[k] = ahead, keys.elapsed_s[k]
        baselines.sigma_px[k] = keys.sigma_rad[k] * pinhole.focal


def then_x(baselines: Baselines, slot: int, x: float, y: float) -> float:
    """x of a position at the key frame in ``slot``, derotated to now, px."""
    scale = baselines.h[slot, 6] * x + baselines.h[slot, 7] * y + baselines.h[slot, 8]
    return (baselines.h[slot, 0] * x + baselines.h[slot, 1] * y + baselines.h[slot, 2]) / scale


def then_y(baselines: Baselines, slot: int, x: float, y: float) -> float:
    """y of a position at the key frame in ``slot``, derotated to now, px."""
    scale = baselines.h[slot, 6] * x + baselines.h[slot, 7] * y + baselines.h[slot, 8]
    return (baselines.h[slot, 3] * x + baselines.h[slot, 4] * y + baselines.h[slot, 5]) / scale


def turn(baselines: Baselines, k: int, pinhole: Pinhole, x: float, y: float, z: float) -> None:
    """Add a small rotation, rad about each axis, to that since key frame ``k``: H ← K·R·K⁻¹·H."""
    fx, fy, cx, cy = pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy
    for j in range(3):
        # to rays, rotate, back to the image
        across, down, ahead = baselines.h[k, j], baselines.h[k, 3 + j], baselines.h[k, 6 + j]
        u, v = (across - cx * ahead) / fx, (down - cy * ahead) / fy
        turned_u, turned_v, turned_w = u - z * v + y * ahead, z * u + v - x * ahead, ahead - y * u + x * v
        baselines.h[k, j] = fx * turned_u + cx * turned_w
        baselines.h[k, 3 + j] = fy * turned_v + cy * turned_w
        baselines.h[k, 6 + j] = turned_w


def turn_px(pinhole: Pinhole, axis: int, x: float, y: float, cos: float, sin: float) -> float:
    """Image motion of a point in the direction (cos, sin) for 1 rad of rotation about x (0), y (1) or z (2), px."""
    u, v = (x - pinhole.cx) / pinhole.fx, (y - pinhole.cy) / pinhole.fy
    if axis == 0:
        return -u * v * pinhole.fx * cos - (1 + v * v) * pinhole.fy * sin
    if axis == 1:
        return (1 + u * u) * pinhole.fx * cos + u * v * pinhole.fy * sin
    return -v * pinhole.fx * cos + u * pinhole.fy * sin
