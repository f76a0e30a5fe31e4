"""Image motion of edges that move together: mean velocity and rate of expansion, by weighted least squares.

An edge that was at x' a time T ago and is at x now has the velocity v = (x - x')/T halfway between, with the standard
deviation σ/T of its two places. The uncertainty of the rotation is common to all and added once. For a set of edges
v = v̄ + e·(x - x̄): an approaching object expands by e in all directions, one that moves sideways does not. Two things
that move apart sideways, taken for one, expand in width alone: then e is that of the height.
"""

import math

from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.memory import doubles, integers
from lcf_edge.filter.patches import Patches
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.situation import Situation

FAR_PX = 1e9
PIECE_NOISE = 0.35  # 1 sigma of the position of a piece, small px
PIECE_HALF = 2.0  # distance from its centre of the two edges that stand for it, small px
MIN_SPREAD = 1e-9
PARTS_SIGMAS = 5.0  # of both, by which the expansions in width and height differ where there is more than one thing,
PARTS_SHARE = 0.3  # plus this share of the larger
MIN_GROUND = 4  # edges needed to distinguish a level plane from something upright
LIKE_GROUND = 0.25  # of ln(speed), within which edges move as the ground does
GROUND_GAIN = 16.0  # by which the plane must reduce χ², in mean squared residuals


class MotionSums:
    """Sums over the edges of a circle or object, one row each; the sums of parts add up to those of the whole.

    ``count``: edges. With the weight w = 1/σ_v² of each edge, s²/px²: ``weight`` Σw; ``x``, ``y`` Σw·x of the positions
    halfway, px; ``vx``, ``vy`` Σw·v, px/s; ``xx``, ``yy`` Σw·x², Σw·y²; ``xvx``, ``yvy`` Σw·x·v_x, Σw·y·v_y;
    ``focus_x``, ``focus_y`` Σw·O of the displacement since; ``forward`` Σw·(ΔZ/T), m/s; ``elapsed`` Σw·T; ``common``
    Σw·σ of the rotation's rate, px/s. With b, px below the horizon: ``b2v0`` Σw·b², ``b4v0`` Σw·b⁴, ``b1v1`` Σw·b·v_y,
    ``b2v1`` Σw·b²·v_y, ``b0v2`` Σw·v_y². ``left``, ``top``, ``right``, ``bottom``: bounding box of the edges now, px.

    ``expansion``, 1/s, and ``spread``, s²: see ``fit_expansion``.
    """

    def __init__(self, capacity: int) -> None:
        self.count = integers(capacity)
        self.weight, self.x, self.y, self.vx, self.vy = [doubles(capacity) for _ in range(5)]
        self.xx, self.yy, self.xvx, self.yvy = [doubles(capacity) for _ in range(4)]
        self.focus_x, self.focus_y = [doubles(capacity) for _ in range(2)]
        self.forward, self.elapsed, self.common = [doubles(capacity) for _ in range(3)]
        self.b2v0, self.b4v0, self.b1v1, self.b2v1, self.b0v2 = [doubles(capacity) for _ in range(5)]
        self.left, self.top, self.right, self.bottom = [doubles(capacity) for _ in range(4)]
        self.expansion = self.spread = 0.0


def clear(sums: MotionSums, k: int) -> None:
    """Reset the sums of a row."""
    sums.count[k] = 0
    sums.weight[k] = sums.x[k] = sums.y[k] = sums.vx[k] = sums.vy[k] = 0.0
    sums.xx[k] = sums.yy[k] = sums.xvx[k] = sums.yvy[k] = sums.focus_x[k] = sums.focus_y[k] = 0.0
    sums.forward[k] = sums.elapsed[k] = sums.common[k] = 0.0
    sums.b2v0[k] = sums.b4v0[k] = sums.b1v1[k] = sums.b2v1[k] = sums.b0v2[k] = 0.0
    sums.left[k] = sums.top[k] = FAR_PX
    sums.right[k] = sums.bottom[k] = -FAR_PX


def add_motion(sums: MotionSums, k: int, weight: float, x: float, y: float, vx: float, vy: float) -> None:
    """Add the velocity of one point."""
    sums.weight[k] += weight
    sums.x[k] += weight * x
    sums.y[k] += weight * y
    sums.vx[k] += weight * vx
    sums.vy[k] += weight * vy
    sums.xx[k] += weight * x * x
    sums.yy[k] += weight * y * y
    sums.xvx[k] += weight * x * vx
    sums.yvy[k] += weight * y * vy


def add_edge(
    sums: MotionSums, k: int, verdicts: Verdicts, j: int, edges: EdgeColumns, baselines: Baselines, around: Situation
) -> None:
    """Add one edge, as it moved since the key frame of its verdict."""
    i, slot = verdicts.row[j], verdicts.slot[j]
    elapsed_s = baselines.elapsed_s[slot]
    weight = elapsed_s * elapsed_s / (verdicts.noise[j] * verdicts.noise[j])
    vx, vy = (edges.x[i] - verdicts.x[j]) / elapsed_s, (edges.y[i] - verdicts.y[j]) / elapsed_s
    x, y = 0.5 * (edges.x[i] + verdicts.x[j]), 0.5 * (edges.y[i] + verdicts.y[j])
    sums.count[k] += 1
    add_motion(sums, k, weight, x, y, vx, vy)
    sums.focus_x[k] += weight * baselines.focus_x[slot]
    sums.focus_y[k] += weight * baselines.focus_y[slot]
    sums.forward[k] += weight * baselines.depth_m[slot] / elapsed_s
    sums.elapsed[k] += weight * elapsed_s
    sums.common[k] += weight * verdicts.sigma[j] / elapsed_s
    below = y - around.horizon_y
    sums.b2v0[k] += weight * below * below
    sums.b4v0[k] += weight * below * below * below * below
    sums.b1v1[k] += weight * below * vy
    sums.b2v1[k] += weight * below * below * vy
    sums.b0v2[k] += weight * vy * vy
    sums.left[k], sums.right[k] = min(sums.left[k], edges.x[i]), max(sums.right[k], edges.x[i])
    sums.top[k], sums.bottom[k] = min(sums.top[k], edges.y[i]), max(sums.bottom[k], edges.y[i])


def add_patch(sums: MotionSums, k: int, patches: Patches, p: int, around: Situation) -> None:
    """Add a patch, as four edges that move with its centre and expand as it does."""
    elapsed_s, half = patches.elapsed_s[p], patches.half_px[p]
    then, now = half, half * patches.scale[p]
    reach, sigma = 0.5 * (then + now), patches.sigma[p] * half / elapsed_s
    weight = 0.25 / (sigma * sigma)
    sums.count[k] += 4
    for corner in range(4):
        across, down = (1.0 if corner % 2 else -1.0), (1.0 if corner // 2 else -1.0)
        x = 0.5 * (patches.x[p] + patches.first_x[p]) + across * reach
        y = 0.5 * (patches.y[p] + patches.first_y[p]) + down * reach
        vx = (patches.x[p] - patches.first_x[p] + across * (now - then)) / elapsed_s
        vy = (patches.y[p] - patches.first_y[p] + down * (now - then)) / elapsed_s
        add_motion(sums, k, weight, x, y, vx, vy)
    sums.focus_x[k] += 4 * weight * around.focus_x
    sums.focus_y[k] += 4 * weight * around.focus_y
    sums.forward[k] += 4 * weight * patches.depth_m[p] / elapsed_s
    sums.elapsed[k] += 4 * weight * elapsed_s
    sums.left[k], sums.right[k] = min(sums.left[k], patches.x[p] - now), max(sums.right[k], patches.x[p] + now)
    sums.top[k], sums.bottom[k] = min(sums.top[k], patches.y[p] - now), max(sums.bottom[k], patches.y[p] + now)


def add_piece(sums: MotionSums, k: int, coarse: CoarseMotion, p: int, around: Situation) -> None:
    """Add a piece of the downscaled image, as two edges about its centre."""
    elapsed_s, noise_px, half = coarse.elapsed_s[p], PIECE_NOISE * coarse.side, PIECE_HALF * coarse.side
    weight = elapsed_s * elapsed_s / (2 * noise_px * noise_px)
    vx, vy = coarse.vx[p], coarse.vy[p]
    x, y = coarse.x[p] - 0.5 * elapsed_s * vx, coarse.y[p] - 0.5 * elapsed_s * vy
    sums.count[k] += 2
    add_motion(sums, k, weight, x, y, vx, vy)
    sums.focus_x[k] += weight * around.focus_x
    sums.focus_y[k] += weight * around.focus_y
    sums.forward[k] += weight * (around.speed_mps if math.isfinite(around.speed_mps) else 0.0)
    sums.elapsed[k] += weight * elapsed_s
    sums.left[k], sums.right[k] = min(sums.left[k], coarse.x[p] - half), max(sums.right[k], coarse.x[p] + half)
    sums.top[k], sums.bottom[k] = min(sums.top[k], coarse.y[p] - half), max(sums.bottom[k], coarse.y[p] + half)


def add(sums: MotionSums, k: int, part: MotionSums, c: int) -> None:
    """Add all edges of a part."""
    sums.count[k] += part.count[c]
    sums.weight[k] += part.weight[c]
    sums.x[k] += part.x[c]
    sums.y[k] += part.y[c]
    sums.vx[k] += part.vx[c]
    sums.vy[k] += part.vy[c]
    sums.xx[k] += part.xx[c]
    sums.yy[k] += part.yy[c]
    sums.xvx[k] += part.xvx[c]
    sums.yvy[k] += part.yvy[c]
    sums.focus_x[k] += part.focus_x[c]
    sums.focus_y[k] += part.focus_y[c]
    sums.forward[k] += part.forward[c]
    sums.elapsed[k] += part.elapsed[c]
    sums.common[k] += part.common[c]
    sums.b2v0[k] += part.b2v0[c]
    sums.b4v0[k] += part.b4v0[c]
    sums.b1v1[k] += part.b1v1[c]
    sums.b2v1[k] += part.b2v1[c]
    sums.b0v2[k] += part.b0v2[c]
    sums.left[k], sums.right[k] = min(sums.left[k], part.left[c]), max(sums.right[k], part.right[c])
    sums.top[k], sums.bottom[k] = min(sums.top[k], part.top[c]), max(sums.bottom[k], part.bottom[c])


def fit_expansion(sums: MotionSums, k: int) -> None:
    """Set ``expansion`` = Σw·(x - x̄)·(v - v̄) / Σw·|x - x̄|², and ``spread``, 1/σ² of it, Σw·|x - x̄|².

    Where width and height expand differently, the edges belong to things that move apart or together sideways: then the
    height alone counts.
    """
    weight, x, y = sums.weight[k], sums.x[k], sums.y[k]
    wide, tall = max(sums.xx[k] - x * x / weight, MIN_SPREAD), max(sums.yy[k] - y * y / weight, MIN_SPREAD)
    parting, growing = sums.xvx[k] - x * sums.vx[k] / weight, sums.yvy[k] - y * sums.vy[k] / weight
    sums.expansion, sums.spread = growing / tall, tall
    parting_hz = parting / wide
    noise = PARTS_SIGMAS * math.sqrt(1 / wide + 1 / tall)
    share = PARTS_SHARE * max(math.fabs(parting_hz), math.fabs(sums.expansion))
    if math.fabs(parting_hz - sums.expansion) <= noise + share:
        sums.spread = wide + tall
        sums.expansion = (parting + growing) / sums.spread


def is_ground(sums: MotionSums, k: int, around: Situation) -> bool:
    """Whether edges move as a level plane rather than as something upright on it.

    An upright thing is all at one range: its edges move by v_y = m·b. Points of a plane are nearer the lower they are
    seen: v_y = κ·b². The better fit by χ² decides; neither m, nor κ, nor the vehicle's speed need be known. It is a
    plane, too, where κ is that of the ground around.
    """
    if sums.top[k] <= around.horizon_y or not sums.b2v0[k] > 0:
        return False
    per_mps = around.camera_height_m * around.pinhole.fy * sums.b2v1[k] / sums.b4v0[k]
    if around.ground_mps > 0 and per_mps > 0 and math.fabs(math.log(per_mps / around.ground_mps)) < LIKE_GROUND:
        return True
    if sums.count[k] < MIN_GROUND:
        return False
    upright = sums.b1v1[k] * sums.b1v1[k] / sums.b2v0[k]
    level = sums.b2v1[k] * sums.b2v1[k] / sums.b4v0[k]
    left = max(sums.b0v2[k] - level, sums.count[k])  # residual χ² of the level plane
    return level - upright > GROUND_GAIN * left / sums.count[k]
