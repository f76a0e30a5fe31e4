"""Points that break the flow of the static scene, and points on a collision course.

While the camera moves ahead by ΔZ, a stationary point at depth Z moves along the line through the focus of expansion by
the share μ = ΔZ/Z of its distance r. A *mover* leaves that line, moves inwards, or moves less than the ground in its
row would. A *threat* follows the flow, stands above the ground, and will be met within the horizon (time to contact
ΔZ/(μ v)) and the half width.
"""

from dataclasses import dataclass

import numpy as np

from benchmarks.peers.ego import Ego
from benchmarks.peers.peer import Floats, Mask, Rows
from lcf_edge.config import Config

_NEAREST_M = 0.25  # nothing is nearer
_GROUND_MARGIN = 0.2  # share by which the ground's depth may be misjudged
_PITCH_SIGMA_RAD = 0.008
_FOCUS_SIGMA_PX = 6.0
_ASKEW = 0.25  # drift of a corner between two objects, as a share of its displacement
_CERTAIN = 1.0  # sigmas that a threat's flow must exceed
_BIAS_SIGMA_RADPS = 0.006
_LEFT_SHARE, _LEFT_PX = 0.4, 1.0  # of the gyro's uncertainty, once the flow has shown its bias
_MIN_BIAS = 40  # points that show the gyro's bias


@dataclass(frozen=True, slots=True)
class Tracks:
    """Points with their earlier positions, in the image of ``slot``; (n,), px of the pinhole."""

    slot: Rows
    x_then: Floats  # as if the camera had not turned since
    y_then: Floats
    x: Floats
    y: Floats

    def __len__(self) -> int:
        return len(self.x)


@dataclass(frozen=True, slots=True)
class Residual:
    """Results for each track; (n,)."""

    x: Floats  # px
    y: Floats
    vx: Floats  # px/s, without the camera's rotation
    vy: Floats
    down_then: Floats  # px below the focus, where it was
    mover: Mask
    threat: Mask
    ttc_s: Floats  # if it stands still; inf: never
    range_m: Floats
    lateral_m: Floats  # from the arc that speed and yaw rate give, right positive


def residual(tracks: Tracks, ego: Ego, config: Config, noise_px: float, mover_px: float) -> Residual:
    """Judge tracks. ``noise_px``: 1 sigma of a flow vector; ``mover_px``: least deviation of a mover."""
    lens, focal = ego.lens, np.float32(ego.focal_px)
    elapsed = ego.elapsed_s.astype(np.float32)[tracks.slot]
    sigma_px = ego.sigma_rad.astype(np.float32)[tracks.slot] * focal
    focus_x, focus_y, ahead_m = ego.focus_since(tracks.slot)
    ax, ay = tracks.x_then - focus_x, tracks.y_then - focus_y
    r = np.maximum(np.hypot(ax, ay), np.float32(1))
    ax, ay = ax / r, ay / r
    mx, my = tracks.x - tracks.x_then, tracks.y - tracks.y_then
    turned_x, turned_y, known = _gyro_bias(tracks, ego, ax, ay, mx, my, elapsed)
    mx, my = mx - turned_x, my - turned_y
    if known:
        sigma_px = np.minimum(np.float32(_LEFT_SHARE) * sigma_px, np.float32(_LEFT_PX))

    way = np.sign(ahead_m) + (ahead_m == 0)
    outward = (mx * ax + my * ay) * way
    drift = my * ax - mx * ay
    travelled = np.abs(ahead_m)
    below = tracks.y - np.float32(ego.focus[1])
    slack = focal * np.float32(_PITCH_SIGMA_RAD)
    height = np.float32(config.camera.height_m)
    per_px = travelled / (height * focal) if height > 0 else np.zeros_like(travelled)
    ground = r * per_px * np.maximum(below + slack, 0)  # the most that the ground moves
    least = r * per_px * np.maximum(below - slack, 0) / np.float32(1 + _GROUND_MARGIN)
    share = np.abs(outward) / r
    tolerance = np.float32(mover_px) + np.float32(_FOCUS_SIGMA_PX) * share + 2 * sigma_px
    mover = (np.abs(drift) > tolerance + np.float32(_ASKEW) * np.abs(outward)) | (least - outward > tolerance)
    mover |= outward - r * travelled / np.float32(_NEAREST_M) > tolerance

    speed = np.float32(max(ego.speed_mps, 1e-3))
    range_m = travelled / np.maximum(share, np.float32(1e-5))
    ttc = range_m / speed
    right_m = (tracks.x - np.float32(ego.focus[0])) / np.float32(lens.fx) * range_m
    lateral = beside_path(right_m, range_m, ego)
    above_m = height - below / focal * range_m if height > 0 else np.zeros_like(range_m)
    noise = np.float32(noise_px) + sigma_px
    reach = np.float32(config.vehicle.half_width_m)
    threat = ~mover & (ahead_m > 0) & (ego.speed_mps > 0)
    threat &= (ttc < config.vehicle.horizon_s) & (np.abs(lateral) < reach) & (above_m < config.vehicle.height_m)
    threat &= outward > np.float32(_CERTAIN) * noise
    threat &= outward - ground * np.float32(1 + _GROUND_MARGIN) > np.float32(_CERTAIN) * noise
    down = tracks.y_then - focus_y
    return Residual(tracks.x, tracks.y, mx / elapsed, my / elapsed, down, mover, threat, ttc, range_m, lateral)


def beside_path(right_m: Floats, ahead_m: Floats, ego: Ego) -> Floats:
    """Distance of points from the vehicle's path, right positive, m; the path is an arc."""
    speed, yaw_rate = ego.speed_mps, ego.last.path_yaw_rate_radps
    if abs(yaw_rate) < 1e-3 * max(abs(speed), 0.05):
        return right_m
    radius = np.float32(speed / yaw_rate)  # its centre is to the left when positive
    beside: Floats = (np.hypot(right_m + radius, ahead_m) - np.abs(radius)) * np.sign(radius)
    return beside


def _gyro_bias(
    tracks: Tracks, ego: Ego, ax: Floats, ay: Floats, mx: Floats, my: Floats, elapsed: Floats
) -> tuple[Floats, Floats, bool]:
    """Flow that the gyro's bias leaves: the rate that puts most tracks back on their flow lines.

    Robust least squares over the drift, which translation does not affect; 0 with too few tracks. (ax, ay): unit
    vector from the focus, (mx, my): motion, px. Returns the flow, px, and whether it is known.
    """
    if len(tracks) < _MIN_BIAS:
        return np.zeros_like(mx), np.zeros_like(my), False
    lens, focal = ego.lens, np.float32(ego.focal_px)
    u, v = (tracks.x - np.float32(lens.cx)) / focal, (tracks.y - np.float32(lens.cy)) / focal
    flow_x = np.stack([u * v, -(1 + u * u), v]) * (focal * elapsed)  # px for 1 rad/s about x, y, z
    flow_y = np.stack([1 + v * v, -u * v, -u]) * (focal * elapsed)
    a = flow_y * ax - flow_x * ay
    drift = my * ax - mx * ay
    rate = np.zeros(3)
    unsure = float(np.max(ego.sigma_rad[tracks.slot] / elapsed, initial=_BIAS_SIGMA_RADPS))
    prior = np.eye(3) / unsure**2
    for _ in range(4):
        rest = drift - rate.astype(np.float32) @ a
        wa = a / (1 + np.square(rest))
        rate = np.linalg.solve((wa @ a.T).astype(np.float64) + prior, (wa @ drift).astype(np.float64))
    small = rate.astype(np.float32)
    return small @ flow_x, small @ flow_y, True
