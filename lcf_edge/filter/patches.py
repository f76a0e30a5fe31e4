"""Patches: pieces of the image near the path, tracked for seconds, whose growth gives their range.

Near the focus, where obstacles first appear, a corner hardly moves within the window of key frames and seldom lives
longer. An image patch around it does: it is tracked in shift and scale, with sub-pixel accuracy, against the template
in which it was first seen (inverse compositional Lucas-Kanade: Baker and Matthews 2004). Something stationary at Z was
ΔZ farther off then, so it has grown by s = (Z + ΔZ)/Z.
"""

import math

from lcf_edge.filter import flow, image_plane, lengths, path, rounding
from lcf_edge.filter.columns import EdgeColumns
from lcf_edge.filter.flow import Homography
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.memory import Bytes, doubles, integers, octets
from lcf_edge.filter.situation import Situation

SIDE = 16  # samples along a side of a patch
SAMPLES = 256
SHARPNESS = 1.5  # weight exp(-SHARPNESS·r²), r in half-sides: the rim often shows something else
EFFECTIVE_SHARE = 0.4  # effective number of samples after that weighting, as a share
MIN_HALF_PX = 7.0  # half-side of a new patch, at least
MAX_HALF_PX = 16.0  # and at most
HALF_WIDTH_SHARE = 0.4  # half-side, as a share of the vehicle's half width at the range of half a horizon
BESIDE = 1.2  # half widths from the path at that range, within which patches start,
BESIDE_HALVES = 1.5  # or half-sides, if more
KEPT_REACHES = 2.0  # that distance, times this and its growth, beyond which a patch ends
NEAREST_S = 1.0  # ground reached sooner is too low in the image
ROW_SHARE = 1.0  # weight of vertical distance from the horizon in choosing the place nearest to the path
APART = 1.1  # half-sides between the centres of patches
BIRTHS = 3  # per frame, at most
MIN_CONTRAST_GREY = 6.0
NOISE_GREY = 2.0  # 1 sigma of a sample, at least
MAX_SCALE_SIGMA = 0.0125  # of a new patch; a template that does not show its scale is useless
MIN_ALONE = 1e-6  # least share of the stretch that shift and scale do not explain
MIN_SCALE_SIGMA = 0.01  # model error: a patch is not flat
FAR_PX = 1e9
ROUNDS = 4
SMALL_PX = 0.03  # convergence: smaller change of position,
SMALL_SHARE = 0.003  # and of scale
STEP_SHARE = 0.33  # largest step of a round: of position, in half-sides,
STEP_SCALE = 0.1  # and of scale
LIKENESS = 0.95  # least normalised cross-correlation
MAX_MISSES = 4
MIN_SCALE = 0.8
MAX_SCALE = 2.2
LIFE_S = 2.5  # later the surroundings have changed too much
SUCCESSOR_SHARE = 0.5  # of it, after which another patch may start at the same place
MIN_SPEED_MPS = 0.05


class Patches:
    """One row per patch.

    ``x``, ``y``: centre, px; ``first_x``, ``first_y``: where that was first seen, derotated to now, px; ``half_px``:
    half-side then; ``scale``: s since then, and ``sigma`` of it; ``elapsed_s``; ``depth_m``: ΔZ; ``stretch``: half the
    excess of its growth across over that down, as a share of its size; ``misses``: consecutive frames in which it was
    not found; ``inverse``, ``inverse_sigma``: 1/Z if it is stationary, with 1 sigma, 1/m; ``circle``: row of C_r that
    it supports in this frame, -1: none.

    The template, over its samples: ``grey``, minus its mean; ``across``, ``down``, ``growing``, ``stretching``: its
    weighted derivatives by shift, scale and stretch; ``sums`` of these and of their products with ``grey`` (8);
    ``inverted``: inverse of the normal matrix of the first three (9); ``coupled``: their products with ``stretching``
    (3); ``alone``: squared ``stretching`` that they do not explain; ``contrast``: 1 sigma of ``grey``; ``unit``: sigma
    of the scale for noise of one grey level.

    ``weight`` of the samples; ``offset``: of a row or column of them from the centre, half-sides. ``tried``: distance
    from the path of the last place tried, px. The rest is the result of one comparison.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.active = octets(max(capacity, 1))
        self.misses, self.circle = [integers(max(capacity, 1)) for _ in range(2)]
        self.x, self.y, self.first_x, self.first_y = [doubles(max(capacity, 1)) for _ in range(4)]
        self.half_px, self.scale, self.sigma, self.elapsed_s = [doubles(max(capacity, 1)) for _ in range(4)]
        self.depth_m, self.inverse, self.inverse_sigma = [doubles(max(capacity, 1)) for _ in range(3)]
        self.contrast, self.unit = [doubles(max(capacity, 1)) for _ in range(2)]
        self.grey, self.across, self.down, self.growing = [doubles(max(capacity, 1), SAMPLES) for _ in range(4)]
        self.stretching = doubles(max(capacity, 1), SAMPLES)
        self.sums, self.inverted = doubles(max(capacity, 1), 8), doubles(max(capacity, 1), 9)
        self.coupled = doubles(max(capacity, 1), 3)
        self.alone, self.stretch = [doubles(max(capacity, 1)) for _ in range(2)]
        self.weight, self.sampled, self.offset = doubles(SAMPLES), doubles(SAMPLES), doubles(SIDE)
        self.u = self.v = self.right_u = self.right_v = self.down_u = self.down_v = 0.0
        self.mean = self.square = self.shared = 0.0
        self.on_across = self.on_down = self.on_growing = self.on_stretching = 0.0
        self.tried = 0.0
        weigh(self)


def weigh(patches: Patches) -> None:
    """Set offsets and Gaussian weights of the samples, normalised to a sum of 1."""
    for k in range(SIDE):
        patches.offset[k] = (2.0 * k - (SIDE - 1)) / (SIDE - 1)
    total = 0.0
    for k in range(SAMPLES):
        x, y = patches.offset[k % SIDE], patches.offset[k // SIDE]
        patches.weight[k] = math.exp(-SHARPNESS * (x * x + y * y))
        total += patches.weight[k]
    for k in range(SAMPLES):
        patches.weight[k] /= total


# Where patches are


def derotate(patches: Patches, h: Homography) -> None:
    """Apply H = K·R·K⁻¹ to the present and first positions of patches."""
    for p in range(patches.capacity):
        if patches.active[p]:
            flow.warp(h, patches.x[p], patches.y[p])
            patches.x[p], patches.y[p] = h.x, h.y
            flow.warp(h, patches.first_x[p], patches.first_y[p])
            patches.first_x[p], patches.first_y[p] = h.x, h.y


def predict(patches: Patches, around: Situation) -> None:
    """Move each patch outward from O, as stationary."""
    for p in range(patches.capacity):
        if not patches.active[p]:
            continue
        ahead_m = around.assumed_mps * around.dt_s
        growth = 1 + patches.inverse[p] * ahead_m
        patches.x[p] = around.focus_x + (patches.x[p] - around.focus_x) * growth
        patches.y[p] = around.focus_y + (patches.y[p] - around.focus_y) * growth
        patches.scale[p] *= growth
        patches.elapsed_s[p] += around.dt_s
        patches.depth_m[p] += ahead_m


def correct_way(patches: Patches, factor: float) -> None:
    """Multiply the way driven since each patch began, and so its range, by a factor: the speed was another.

    What has no way shows no range, and ends.
    """
    for p in range(patches.capacity):
        if not factor > 0:
            patches.active[p] = 0
            continue
        patches.depth_m[p] *= factor
        patches.inverse[p] /= factor
        patches.inverse_sigma[p] /= factor


# Looking


def locate(patches: Patches, plane: ImagePlane, x: float, y: float, half: float) -> bool:
    """Project a patch through the lens: centre and half-sides, px of the frame; return whether all of it is seen."""
    if not image_plane.project(plane, x, y):
        return False
    patches.u, patches.v = plane.u, plane.v
    if not image_plane.project(plane, x + half, y):
        return False
    patches.right_u, patches.right_v = plane.u - patches.u, plane.v - patches.v
    if not image_plane.project(plane, x, y + half):
        return False
    patches.down_u, patches.down_v = plane.u - patches.u, plane.v - patches.v
    across = math.fabs(patches.right_u) + math.fabs(patches.down_u)
    down = math.fabs(patches.right_v) + math.fabs(patches.down_v)
    return (
        patches.u - across >= 0
        and patches.v - down >= 0
        and patches.u + across < plane.width - 1
        and patches.v + down < plane.height - 1
    )


def look(patches: Patches, image: Bytes, width: int) -> None:
    """Sample the image where the patch was located, by bilinear interpolation."""
    middle_u, right_u, down_u = patches.u, patches.right_u, patches.down_u
    middle_v, right_v, down_v = patches.v, patches.right_v, patches.down_v
    for row in range(SIDE):
        y = patches.offset[row]
        for column in range(SIDE):
            x = patches.offset[column]
            u, v = middle_u + x * right_u + y * down_u, middle_v + x * right_v + y * down_v
            left, top = rounding.whole(u), rounding.whole(v)
            at = top * width + left
            share, below = u - left, v - top
            upper = image[at] + share * (image[at + 1] - image[at])
            lower = image[at + width] + share * (image[at + width + 1] - image[at + width])
            patches.sampled[row * SIDE + column] = upper + below * (lower - upper)


def compare(patches: Patches, p: int) -> None:
    """Compute the sums over the samples."""
    mean = square = shared = on_across = on_down = on_growing = on_stretching = 0.0
    for k in range(SAMPLES):
        grey = patches.sampled[k]
        weighed = patches.weight[k] * grey
        mean += weighed
        square += weighed * grey
        shared += weighed * patches.grey[p, k]
        on_across += patches.across[p, k] * grey
        on_down += patches.down[p, k] * grey
        on_growing += patches.growing[p, k] * grey
        on_stretching += patches.stretching[p, k] * grey
    patches.mean, patches.square, patches.shared = mean, square, shared
    patches.on_across, patches.on_down = on_across, on_down
    patches.on_growing, patches.on_stretching = on_growing, on_stretching


def bounded(value: float, most: float) -> float:
    """Clamp a value to ±``most``."""
    return min(max(value, -most), most)


def step(patches: Patches, p: int, gain: float) -> float:
    """One Gauss-Newton step of shift and scale, to align the samples, times ``gain``, with the template.

    The stretch is measured, not applied. Return the size of the step, relative to convergence.
    """
    across = gain * (patches.on_across - patches.mean * patches.sums[p, 0]) - patches.sums[p, 3]
    down = gain * (patches.on_down - patches.mean * patches.sums[p, 1]) - patches.sums[p, 4]
    growing = gain * (patches.on_growing - patches.mean * patches.sums[p, 2]) - patches.sums[p, 5]
    most = STEP_SHARE * patches.half_px[p]
    x = patches.inverted[p, 0] * across + patches.inverted[p, 1] * down + patches.inverted[p, 2] * growing
    y = patches.inverted[p, 3] * across + patches.inverted[p, 4] * down + patches.inverted[p, 5] * growing
    grown = patches.inverted[p, 6] * across + patches.inverted[p, 7] * down + patches.inverted[p, 8] * growing
    stretching = gain * (patches.on_stretching - patches.mean * patches.sums[p, 6]) - patches.sums[p, 7]
    stretching -= patches.coupled[p, 0] * x + patches.coupled[p, 1] * y + patches.coupled[p, 2] * grown
    patches.stretch[p] = -stretching / patches.alone[p]
    x, y, grown = bounded(x, most), bounded(y, most), bounded(grown, STEP_SCALE)
    patches.x[p] -= patches.scale[p] * x
    patches.y[p] -= patches.scale[p] * y
    patches.scale[p] /= 1 + grown
    return max((math.fabs(x) + math.fabs(y)) / SMALL_PX, math.fabs(grown) / SMALL_SHARE)


def find(patches: Patches, p: int, image: Bytes, plane: ImagePlane) -> bool:
    """Find a patch near its prediction: set position, scale and sigma; return whether it was found."""
    change, likeness, rest = 2.0, 0.0, 0.0
    for _ in range(ROUNDS):
        if change < 1:
            break
        if not locate(patches, plane, patches.x[p], patches.y[p], patches.half_px[p] * patches.scale[p]):
            return False
        look(patches, image, plane.width)
        compare(patches, p)
        variance = patches.square - patches.mean * patches.mean
        if variance < 1:
            return False
        likeness = patches.shared / math.sqrt(variance) / patches.contrast[p]
        gain = patches.shared / variance
        rest = patches.contrast[p] * patches.contrast[p] - gain * patches.shared
        change = step(patches, p, gain)
    noise = max(math.sqrt(max(rest, 0.0)), NOISE_GREY) * patches.unit[p] * patches.scale[p]
    patches.sigma[p] = lengths.of(noise, MIN_SCALE_SIGMA)
    return likeness >= LIKENESS and MIN_SCALE < patches.scale[p] < MAX_SCALE


def follow(patches: Patches, image: Bytes, plane: ImagePlane) -> None:
    """Track each patch into this image; one not found keeps its prediction, and ends after too many misses."""
    for p in range(patches.capacity):
        if not patches.active[p]:
            continue
        x, y, scale = patches.x[p], patches.y[p], patches.scale[p]
        if find(patches, p, image, plane):
            patches.misses[p] = 0
        else:
            patches.x[p], patches.y[p], patches.scale[p] = x, y, scale
            patches.misses[p] += 1
        patches.circle[p] = -1
        patches.inverse[p] = patches.inverse_sigma[p] = 0.0
        if patches.depth_m[p] > 0:
            patches.inverse[p] = (patches.scale[p] - 1) / patches.depth_m[p]
            patches.inverse_sigma[p] = patches.sigma[p] / patches.depth_m[p]
        if patches.misses[p] > MAX_MISSES or patches.elapsed_s[p] > LIFE_S:
            patches.active[p] = 0


# Birth


def half_side(around: Situation) -> float:
    """Half-side of a new patch, px: a share of the vehicle's half width at the range of half a horizon."""
    halfway_m = max(0.5 * around.assumed_mps * around.horizon_s, MIN_SPEED_MPS)
    half = HALF_WIDTH_SHARE * around.half_width_m * around.pinhole.fx / halfway_m
    return min(max(half, MIN_HALF_PX), MAX_HALF_PX)


def reach_px(half: float, around: Situation) -> float:
    """Distance from the path within which patches start, px."""
    halfway_m = 0.5 * around.assumed_mps * around.horizon_s
    return max(BESIDE * around.half_width_m * around.pinhole.fx / halfway_m, BESIDE_HALVES * half)


def beside_px(x: float, around: Situation) -> float:
    """Distance from the path at the range of half a horizon, px."""
    halfway_m = 0.5 * around.assumed_mps * around.horizon_s
    right_m = (x - around.focus_x) / around.pinhole.fx * halfway_m
    return math.fabs(path.least_miss(right_m, halfway_m, around)) / halfway_m * around.pinhole.fx


def retire(patches: Patches, half: float, around: Situation) -> None:
    """End patches that the vehicle passes well aside, on its arc and straight on, in favour of places in its way."""
    reach = KEPT_REACHES * reach_px(half, around)
    for p in range(patches.capacity):
        if patches.active[p]:
            away = min(beside_px(patches.x[p], around), math.fabs(patches.x[p] - around.focus_x))
            if away > reach * max(patches.scale[p], 1.0):
                patches.active[p] = 0


def free_row(patches: Patches) -> int:
    """The first row not in use, -1: none."""
    for p in range(patches.capacity):
        if not patches.active[p]:
            return p
    return -1


def is_covered(patches: Patches, x: float, y: float, half: float) -> bool:
    """Whether a patch covers a position, and will long enough: an old one soon needs a successor that has grown."""
    for p in range(patches.capacity):
        if not patches.active[p] or patches.elapsed_s[p] > SUCCESSOR_SHARE * LIFE_S:
            continue
        if math.fabs(patches.x[p] - x) < APART * half and math.fabs(patches.y[p] - y) < APART * half:
            return True
    return False


def next_place(patches: Patches, edges: EdgeColumns, half: float, around: Situation) -> int:
    """The edge nearest to the path, among those not tried yet, where an obstacle may appear; -1: none.

    In the image that is around the path at the range of half a horizon, from the vehicle's height there down to the
    ground reached in ``NEAREST_S``.
    """
    fy = around.pinhole.fy
    halfway_m, reach = 0.5 * around.assumed_mps * around.horizon_s, reach_px(half, around)
    top = around.horizon_y - max(around.height_m - around.camera_height_m, 0.0) / halfway_m * fy - half
    bottom = around.horizon_y + fy * around.camera_height_m / (around.assumed_mps * NEAREST_S)
    if not around.camera_height_m > 0:
        bottom = around.horizon_y + fy
    best, least = -1, FAR_PX
    for i in range(edges.count):
        x, y = edges.x[i], edges.y[i]
        if y <= top or y >= bottom or not edges.matched[i]:
            continue
        away = beside_px(x, around)
        if away >= reach:
            continue
        away += ROW_SHARE * math.fabs(y - around.horizon_y)
        if patches.tried < away < least and not is_covered(patches, x, y, half):
            best, least = i, away
    patches.tried = least
    return best


def give_birth(patches: Patches, p: int, x: float, y: float, half: float, image: Bytes, plane: ImagePlane) -> bool:
    """Start a patch around a position; False: too little contrast, or its scale would not show."""
    if not locate(patches, plane, x, y, half):
        return False
    look(patches, image, plane.width)
    mean = 0.0
    for k in range(SAMPLES):
        mean += patches.weight[k] * patches.sampled[k]
    for k in range(SAMPLES):
        patches.grey[p, k] = patches.sampled[k] - mean
    patches.half_px[p] = half
    if not set_template(patches, p):
        return False
    patches.active[p], patches.misses[p], patches.circle[p] = 1, 0, -1
    patches.x[p] = patches.first_x[p] = x
    patches.y[p] = patches.first_y[p] = y
    patches.scale[p], patches.sigma[p] = 1.0, MAX_SCALE_SIGMA
    patches.elapsed_s[p] = patches.depth_m[p] = patches.inverse[p] = patches.inverse_sigma[p] = 0.0
    return True


def slope(patches: Patches, p: int, k: int, place: int, stride: int) -> float:
    """Gradient of the template at sample ``k``, grey levels per sample; ``place``: its row or column."""
    if place == 0:
        return patches.grey[p, k + stride] - patches.grey[p, k]
    if place == SIDE - 1:
        return patches.grey[p, k] - patches.grey[p, k - stride]
    return 0.5 * (patches.grey[p, k + stride] - patches.grey[p, k - stride])


def set_template(patches: Patches, p: int) -> bool:
    """Compute the template's derivatives and inverse normal matrix; False: it cannot be tracked."""
    half, spacing = patches.half_px[p], 2 * patches.half_px[p] / (SIDE - 1)
    square = xx = xy = xs = yy = ys = ss = xt = yt = st = tt = 0.0
    for k in range(8):
        patches.sums[p, k] = 0.0
    for k in range(SAMPLES):
        row, column = k // SIDE, k % SIDE
        weight, grey = patches.weight[k], patches.grey[p, k]
        x, y = slope(patches, p, k, column, 1) / spacing, slope(patches, p, k, row, SIDE) / spacing
        grows = half * (x * patches.offset[column] + y * patches.offset[row])
        stretches = half * (x * patches.offset[column] - y * patches.offset[row])
        square += weight * grey * grey
        xx += weight * x * x
        xy += weight * x * y
        xs += weight * x * grows
        yy += weight * y * y
        ys += weight * y * grows
        ss += weight * grows * grows
        xt += weight * x * stretches
        yt += weight * y * stretches
        st += weight * grows * stretches
        tt += weight * stretches * stretches
        patches.stretching[p, k] = weight * stretches
        patches.across[p, k], patches.down[p, k], patches.growing[p, k] = weight * x, weight * y, weight * grows
        patches.sums[p, 0] += weight * x
        patches.sums[p, 1] += weight * y
        patches.sums[p, 2] += weight * grows
        patches.sums[p, 3] += weight * x * grey
        patches.sums[p, 4] += weight * y * grey
        patches.sums[p, 5] += weight * grows * grey
        patches.sums[p, 6] += weight * stretches
        patches.sums[p, 7] += weight * stretches * grey
    patches.contrast[p] = math.sqrt(square)
    xx_minor, xy_minor, xs_minor = yy * ss - ys * ys, xy * ss - ys * xs, xy * ys - yy * xs
    determinant = xx * xx_minor - xy * xy_minor + xs * xs_minor
    if patches.contrast[p] < MIN_CONTRAST_GREY or not determinant > 1e-12 * xx * yy * ss:
        return False
    patches.inverted[p, 0] = xx_minor / determinant
    patches.inverted[p, 1] = patches.inverted[p, 3] = -xy_minor / determinant
    patches.inverted[p, 2] = patches.inverted[p, 6] = xs_minor / determinant
    patches.inverted[p, 4] = (xx * ss - xs * xs) / determinant
    patches.inverted[p, 5] = patches.inverted[p, 7] = (xs * xy - xx * ys) / determinant
    patches.inverted[p, 8] = (xx * yy - xy * xy) / determinant
    across = patches.inverted[p, 0] * xt + patches.inverted[p, 1] * yt + patches.inverted[p, 2] * st
    down = patches.inverted[p, 3] * xt + patches.inverted[p, 4] * yt + patches.inverted[p, 5] * st
    growing = patches.inverted[p, 6] * xt + patches.inverted[p, 7] * yt + patches.inverted[p, 8] * st
    patches.coupled[p, 0], patches.coupled[p, 1], patches.coupled[p, 2] = xt, yt, st
    patches.alone[p] = max(tt - across * xt - down * yt - growing * st, MIN_ALONE * tt)
    patches.unit[p] = math.sqrt(patches.inverted[p, 8] / (EFFECTIVE_SHARE * SAMPLES))
    return patches.unit[p] < MAX_SCALE_SIGMA


def renew(patches: Patches, edges: EdgeColumns, image: Bytes, plane: ImagePlane, around: Situation) -> None:
    """Start new patches in free rows, around edges near the path."""
    if not around.assumed_mps > MIN_SPEED_MPS:
        return
    half = half_side(around)
    retire(patches, half, around)
    patches.tried = -1.0
    for _ in range(BIRTHS):
        p = free_row(patches)
        i = next_place(patches, edges, half, around) if p >= 0 else -1
        if i < 0:
            return
        give_birth(patches, p, edges.x[i], edges.y[i], half, image, plane)
