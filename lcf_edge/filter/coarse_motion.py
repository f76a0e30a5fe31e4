"""Coarse motion: independently moving pieces of the image, found by block matching in a downscaled image.

What crosses fast leaves the gates of its corners, and what is dark or plain has few corners that can be tracked.
Downscaled, noise averages out and outlines remain. A piece that matches nowhere along its flow line, at any depth, is
searched for all around: in the last frame, and in an older key frame, which shows slower motion. Its motion counts if
it continues from image to image, as in α. A piece that matches on its flow line only nearer than the ground, and soon
in the way, shows something upright, however few corners it has.
"""

import math

import numpy as np

from lcf_edge.filter import block_matching, flow, image_plane, lengths, path, rounding, situation
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.block_matching import Blocks
from lcf_edge.filter.flow import Homography, Pinhole
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.inputs import KEYS
from lcf_edge.filter.key_frames import KeyFrames
from lcf_edge.filter.memory import Bytes, Doubles, doubles, integers, memory_of
from lcf_edge.filter.situation import Situation
from lcf_edge.lens import Lens

REACH_SHARE = 0.16  # horizontal search range, as a share of the image's width,
DOWN_SHARE = 0.5  # and vertical, as a share of that
NEAREST_M = 0.25  # depth below which nothing stationary is expected
ANY_WAY_M = 1e3  # distance assumed where the speed is unknown: the whole flow line from O is searched
OFF_FLOW = 1.5  # small px off the flow line within which a piece may be stationary, and more
ROTATION_SIGMAS = 2.0  # where the rotation is uncertain,
TURN_SIGMAS = 2.0  # or the lens, in a turn
MAX_OFF_FLOW = 3.0  # with more tolerance nothing is measured
PLAIN_GREY = 2.0  # least texture of a piece: mean grey difference of neighbouring px, both directions together
CALM_GREY = 3.0  # tolerated matching error: noise for each pixel,
BESIDE_PX = 0.6  # and the effect of a sub-pixel offset of this many small px
LIKENESS = 0.5  # largest error where it moves, as a share of the least where it is stationary
RING = 3  # small px around the match, where a distinct piece fits worse by
RING_LIKENESS = 1.25  # this factor,
RING_GREY = 0.5  # and this much for each pixel
STAYS_PX = 0.8  # small px: what moves less in the image as the camera turns may be a drop on the lens, or an own part
MAX_SEEN = 40  # pieces per frame searched along their flow line,
MAX_SEARCHES = 20  # and all around
SLOW_S = 0.3  # greatest age of the older image,
MIN_SLOW_S = 0.1  # and least
SAME_SMALL_PX = 1.0  # by which alike motions may differ,
SAME_SHARE = 0.25  # plus this share
GROUND_MARGIN = 0.3  # share by which the ground may be misjudged
LAST, OLDER = 0, 1
UNKNOWN, STANDS, CHANGED = 0, 1, 2
WORST = 256 * 64


class CoarseMotion:
    """The downscaled image, in ``blocks``; each of its px is ``side`` px of the input frame.

    ``turned``: (1, 3, 3), the rotation since the last image. Of the image that is searched: ``then_s``, its age;
    ``back``, homography of distant points from now to then; ``ahead_m``, ``focus_x``, ``focus_y``: displacement since,
    and its focus; ``off_flow``, small px. Of the piece that is searched for: ``here``, its first pixel; ``base_x``,
    ``base_y``, small px, where its upper left corner was if it is at infinity; ``across``, ``down``, offset from there
    if it moves; ``least_still``, ``least_moving``, matching errors; ``share``: of the way to where the nearest depth
    would have been, if stationary.

    One row per piece, ``columns`` by ``rows`` of them: ``x``, ``y``, its centre, px of the ideal pinhole; ``came_x``,
    ``came_y``: ``base`` in the last image, -1: not fully inside it; ``shares`` (2, pieces), latest ``share`` in the
    last image and in the older one; ``links``: images over which its motion has continued, 0: stationary or unknown;
    ``vx``, ``vy``, px/s, derotated; ``elapsed_s``, over which that was measured; ``contact_s``, time until something
    upright that it shows is met, 0: it shows none that is in the way soon; ``stance``: whether since the last image it
    ``STANDS`` or has ``CHANGED`` otherwise; ``links_before``, ``vx_before``, ``vy_before`` of the last image.
    """

    def __init__(self, lens: Lens, side: int) -> None:
        self.side = side
        self.blocks = Blocks(lens.width // side, lens.height // side)
        self.columns, self.rows = self.blocks.columns, self.blocks.rows
        pieces = self.columns * self.rows
        self.turned = memory_of(np.eye(3).reshape(1, 3, 3))
        self.back = Homography()
        self.then_s = self.ahead_m = self.focus_x = self.focus_y = self.off_flow = 0.0
        self.base_x = self.base_y = self.share = 0.0
        self.seen = self.searches = self.here = self.across = self.down = 0
        self.least_still = self.least_moving = 0
        half = 0.5 * (block_matching.WINDOW * side - 1)
        u, v = np.meshgrid(
            np.arange(self.columns) * block_matching.STEP * side + half,
            np.arange(self.rows) * block_matching.STEP * side + half,
        )
        middles = lens.undistort(np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float32)).astype(np.float64)
        self.x, self.y = memory_of(middles[:, 0]), memory_of(middles[:, 1])
        self.links, self.links_before, self.stance = [integers(pieces) for _ in range(3)]
        self.came_x, self.came_y, self.elapsed_s, self.contact_s = [doubles(pieces) for _ in range(4)]
        self.vx, self.vy, self.vx_before, self.vy_before = [doubles(pieces) for _ in range(4)]
        self.shares = doubles(2, pieces)


# Images


def take(coarse: CoarseMotion, small: Bytes) -> None:
    """Take the next downscaled image, row-major."""
    block_matching.take(coarse.blocks, small)
    for i in range(3):
        for j in range(3):
            coarse.turned[0, i, j] = 1.0 if i == j else 0.0


def turn(coarse: CoarseMotion, rotation: Doubles) -> None:
    """Add a rotation (1, 3, 3) to that since the last image."""
    for j in range(3):
        x, y, z = coarse.turned[0, 0, j], coarse.turned[0, 1, j], coarse.turned[0, 2, j]
        for i in range(3):
            coarse.turned[0, i, j] = rotation[0, i, 0] * x + rotation[0, i, 1] * y + rotation[0, i, 2] * z


def turn_back(coarse: CoarseMotion, pinhole: Pinhole, rotation: Doubles, k: int, keys: KeyFrames) -> None:
    """Set ``back`` from the ``k``-th of rotations (n, 3, 3) since then. ``keys.step`` is scratch."""
    for i in range(3):
        for j in range(3):
            keys.step[0, i, j] = rotation[k, j, i]
    flow.set_homography(coarse.back, pinhole, keys.step, 0)


def look_back(coarse: CoarseMotion, keys: KeyFrames, around: Situation) -> None:
    """Search in the last image."""
    block_matching.look_back(coarse.blocks)
    turn_back(coarse, around.pinhole, coarse.turned, 0, keys)
    coarse.then_s = around.dt_s
    coarse.ahead_m = around.assumed_mps * around.dt_s
    coarse.focus_x, coarse.focus_y = around.focus_x, around.focus_y
    sigma_px = keys.rate_sigma_radps * around.dt_s * around.pinhole.focal
    coarse.off_flow = OFF_FLOW + ROTATION_SIGMAS * sigma_px / coarse.side


def look_farther_back(
    coarse: CoarseMotion, slot: int, keys: KeyFrames, baselines: Baselines, around: Situation
) -> None:
    """Search in the image of the key frame in ``slot``."""
    block_matching.look_farther_back(coarse.blocks, slot)
    turn_back(coarse, around.pinhole, keys.rotation, slot, keys)
    coarse.then_s = baselines.elapsed_s[slot]
    coarse.ahead_m = baselines.depth_m[slot]
    coarse.focus_x, coarse.focus_y = baselines.focus_x[slot], baselines.focus_y[slot]
    coarse.off_flow = OFF_FLOW + ROTATION_SIGMAS * baselines.sigma_px[slot] / coarse.side


def older_slot(coarse: CoarseMotion, baselines: Baselines) -> int:
    """Slot of the oldest key frame of an age that shows slow motion, -1: there is none."""
    oldest, most = -1, MIN_SLOW_S
    for k in range(KEYS):
        if k < coarse.blocks.keys and most <= baselines.elapsed_s[k] <= SLOW_S:
            oldest, most = k, baselines.elapsed_s[k]
    return oldest


# Pieces


def calm(coarse: CoarseMotion, k: int) -> int:
    """Largest matching error of a piece with itself: noise, and the sub-pixel offset."""
    return rounding.whole(CALM_GREY * block_matching.PIXELS + BESIDE_PX * coarse.blocks.rough[k])


def nearest_px(x: float) -> int:
    """The nearest integer."""
    return rounding.whole(math.floor(x + 0.5))


def difference(coarse: CoarseMotion, x: int, y: int, most: int) -> int:
    """Matching error of the piece with that at (x, y) then; above ``most`` outside the image."""
    return block_matching.difference(coarse.blocks, coarse.here, x, y, most)


def stands_as_lately(coarse: CoarseMotion, k: int, end_x: float, end_y: float) -> bool:
    """Whether a piece matches, within 1 px, where it was if stationary at the depth last seen there."""
    x = nearest_px(coarse.base_x + coarse.share * end_x)
    y = nearest_px(coarse.base_y + coarse.share * end_y)
    most = calm(coarse, k)
    return (
        difference(coarse, x, y, most) <= most
        or difference(coarse, x - 1, y, most) <= most
        or difference(coarse, x + 1, y, most) <= most
        or difference(coarse, x, y - 1, most) <= most
        or difference(coarse, x, y + 1, most) <= most
    )


def seek_standing(coarse: CoarseMotion, k: int, end_x: float, end_y: float, off_flow: float) -> None:
    """Find the best match of a stationary piece: along its flow line, from ``base`` at most to (end_x, end_y)."""
    x, y = nearest_px(coarse.base_x), nearest_px(coarse.base_y)
    beside = rounding.whole(off_flow + 0.5)
    level = math.fabs(end_x) > math.fabs(end_y)
    steps = rounding.whole(max(math.fabs(end_x), math.fabs(end_y))) + 1
    coarse.least_still = WORST
    for step in range(-1, steps + 2):
        share = 1.0 * step / steps
        along_x, along_y = x + nearest_px(end_x * share), y + nearest_px(end_y * share)
        for off in range(-beside, beside + 1):
            at_x, at_y = along_x + (0 if level else off), along_y + (off if level else 0)
            total = block_matching.shape_difference(coarse.blocks, coarse.here, at_x, at_y, coarse.least_still)
            coarse.least_still = min(coarse.least_still, total)
        if coarse.least_still <= calm(coarse, k):
            coarse.share = share
            return


def off_segment(x: float, y: float, end_x: float, end_y: float) -> float:
    """Distance of a point from the segment between the origin and (end_x, end_y)."""
    along = min(max((x * end_x + y * end_y) / max(end_x * end_x + end_y * end_y, 1.0), 0.0), 1.0)
    return lengths.of(x - along * end_x, y - along * end_y)


def try_moving(coarse: CoarseMotion, across: int, down: int, end_x: float, end_y: float, off_flow: float) -> None:
    """Try a match of a moving piece, off the segment on which a stationary one could have been."""
    if off_segment(across, down, end_x, end_y) > off_flow:
        x, y = nearest_px(coarse.base_x) + across, nearest_px(coarse.base_y) + down
        total = difference(coarse, x, y, coarse.least_moving)
        if total < coarse.least_moving:
            coarse.least_moving, coarse.across, coarse.down = total, across, down


def seek_moving(coarse: CoarseMotion, end_x: float, end_y: float, off_flow: float) -> None:
    """Find the best match of a moving piece: over every other px all around, then over those next to it."""
    reach = rounding.whole(0.5 * REACH_SHARE * coarse.blocks.width)
    reach_down = rounding.whole(DOWN_SHARE * reach)
    coarse.searches += 1
    coarse.least_moving = WORST
    coarse.across = coarse.down = 0
    for down in range(-reach_down, reach_down + 1):
        for across in range(-reach, reach + 1):
            try_moving(coarse, 2 * across, 2 * down, end_x, end_y, off_flow)
    middle_x, middle_y = coarse.across, coarse.down
    for down in range(-1, 2):
        for across in range(-1, 2):
            try_moving(coarse, middle_x + across, middle_y + down, end_x, end_y, off_flow)


def is_distinct(coarse: CoarseMotion) -> bool:
    """Whether the match of a moving piece is unique nearby: a straight edge matches anywhere along itself."""
    x, y = nearest_px(coarse.base_x) + coarse.across, nearest_px(coarse.base_y) + coarse.down
    most = rounding.whole(RING_LIKENESS * coarse.least_moving + RING_GREY * block_matching.PIXELS)
    for down in range(-RING, RING + 1):
        for across in range(-RING, RING + 1):
            on_ring = max(abs(across), abs(down)) == RING
            if on_ring and difference(coarse, x + across, y + down, most) <= most:
                return False
    return True


def finer(before: int, middle: int, after: int) -> float:
    """Sub-pixel offset of the minimum of three errors from the middle one, px; they fall and rise linearly."""
    highest = max(before, after) - middle
    return 0.5 * (before - after) / highest if highest > 0 else 0.0


def set_motion(coarse: CoarseMotion, k: int) -> bool:
    """Set the velocity of a moving piece; return whether it has moved in the image."""
    x, y = nearest_px(coarse.base_x) + coarse.across, nearest_px(coarse.base_y) + coarse.down
    middle = coarse.least_moving
    across = x + finer(difference(coarse, x - 1, y, WORST), middle, difference(coarse, x + 1, y, WORST))
    down = y + finer(difference(coarse, x, y - 1, WORST), middle, difference(coarse, x, y + 1, WORST))
    coarse.vx[k] = (coarse.base_x - across) * coarse.side / coarse.then_s
    coarse.vy[k] = (coarse.base_y - down) * coarse.side / coarse.then_s
    coarse.elapsed_s[k] = coarse.then_s
    left, top = block_matching.STEP * (k % coarse.columns), block_matching.STEP * (k // coarse.columns)
    return max(math.fabs(across - left), math.fabs(down - top)) > STAYS_PX


def are_alike(coarse: CoarseMotion, vx: float, vy: float, other_vx: float, other_vy: float) -> bool:
    """Whether two motions agree within tolerance."""
    speed = max(lengths.of(vx, vy), lengths.of(other_vx, other_vy))
    return lengths.of(vx - other_vx, vy - other_vy) <= SAME_SMALL_PX * coarse.side / coarse.then_s + SAME_SHARE * speed


def chain(coarse: CoarseMotion, k: int, dt_s: float) -> None:
    """Set the links of a moving piece: one more than those of the piece that it comes from, if that moved alike."""
    from_x = coarse.came_x[k] - coarse.vx[k] * dt_s / coarse.side
    from_y = coarse.came_y[k] - coarse.vy[k] * dt_s / coarse.side
    column, row = (
        rounding.whole(max(from_x, 0.0) / block_matching.STEP),
        rounding.whole(max(from_y, 0.0) / block_matching.STEP),
    )
    coarse.links[k] = 1
    for r in range(max(row - 1, 0), min(row + 3, coarse.rows)):
        for c in range(max(column - 1, 0), min(column + 3, coarse.columns)):
            b = r * coarse.columns + c
            if coarse.links_before[b] < coarse.links[k]:
                continue
            if are_alike(coarse, coarse.vx[k], coarse.vy[k], coarse.vx_before[b], coarse.vy_before[b]):
                coarse.links[k] = coarse.links_before[b] + 1


def put(coarse: CoarseMotion, k: int, plane: ImagePlane) -> bool:
    """Set ``here`` and ``base`` of a piece; return whether at infinity it was fully inside the image."""
    left, top = block_matching.STEP * (k % coarse.columns), block_matching.STEP * (k // coarse.columns)
    coarse.here = block_matching.WINDOW * (left * coarse.blocks.height + top)
    if not image_plane.project(plane, coarse.x[k], coarse.y[k]):
        return False
    u, v = plane.u, plane.v
    flow.warp(coarse.back, coarse.x[k], coarse.y[k])
    if not image_plane.project(plane, coarse.back.x, coarse.back.y):
        return False
    coarse.base_x, coarse.base_y = left + (plane.u - u) / coarse.side, top + (plane.v - v) / coarse.side
    return (
        0 <= coarse.base_x <= coarse.blocks.width - block_matching.WINDOW
        and 0 <= coarse.base_y <= coarse.blocks.height - block_matching.WINDOW
    )


def see(coarse: CoarseMotion, k: int, age: int, around: Situation) -> bool:
    """Whether the piece set by ``put`` moves independently; ``age`` of the searched image: LAST or OLDER."""
    ahead_m = coarse.ahead_m if math.isfinite(around.speed_mps) else ANY_WAY_M
    nearest = ahead_m / (NEAREST_M + math.fabs(ahead_m)) / coarse.side
    end_x, end_y = (coarse.focus_x - coarse.x[k]) * nearest, (coarse.focus_y - coarse.y[k]) * nearest
    coarse.share = coarse.shares[age, k]
    if stands_as_lately(coarse, k, end_x, end_y):
        if age == LAST:
            coarse.stance[k] = STANDS
        return False
    if coarse.seen >= MAX_SEEN:
        return False
    coarse.seen += 1
    turned = lengths.of(
        coarse.base_x - block_matching.STEP * (k % coarse.columns),
        coarse.base_y - block_matching.STEP * (k // coarse.columns),
    )  # known only as well as the lens
    off_flow = coarse.off_flow + TURN_SIGMAS * around.turn_share * turned
    seek_standing(coarse, k, end_x, end_y, off_flow)
    coarse.shares[age, k] = coarse.share
    if age == LAST:
        coarse.stance[k] = STANDS if coarse.least_still <= calm(coarse, k) else CHANGED
    if coarse.least_still <= calm(coarse, k) or coarse.searches >= MAX_SEARCHES:
        return False
    seek_moving(coarse, end_x, end_y, off_flow)
    moves = coarse.least_moving < LIKENESS * coarse.least_still and coarse.least_moving <= calm(coarse, k)
    return moves and is_distinct(coarse)


def farthest_share(coarse: CoarseMotion, k: int, around: Situation) -> float:
    """Share of the way to the focus by which a piece has moved, at most, if it shows the ground, or what is far off."""
    soon = coarse.then_s / (coarse.then_s + around.horizon_s)
    if not around.camera_height_m > 0:
        return soon
    lowest_y = coarse.y[k] + 0.5 * block_matching.WINDOW * coarse.side + around.pinhole.focal * around.horizon_sigma_rad
    ground = (1 + GROUND_MARGIN) * coarse.ahead_m * situation.ground_inverse(around, lowest_y)
    return max(soon, ground / (1 + ground))


def may_be_near(coarse: CoarseMotion, way_x: float, way_y: float, way: float, steps: int, far_px: float) -> bool:
    """Whether a piece matches better nearer than ``far_px`` than farther off: at every other px along its flow line."""
    x, y = nearest_px(coarse.base_x), nearest_px(coarse.base_y)
    far = near = WORST
    for step in range(0, steps + 2, 2):
        along_x, along_y = x + nearest_px(way_x * step / way), y + nearest_px(way_y * step / way)
        total = difference(coarse, along_x, along_y, WORST)
        if step <= far_px:
            far = min(far, total)
        else:
            near = min(near, total)
    return near < far


def seek_near(coarse: CoarseMotion, k: int, off_flow: float, farthest: float) -> float:
    """Find the best match of a piece nearer than ``farthest``; returns its share of the way to the focus.

    0: none that fits, or what is farther off fits nearly as well.
    """
    way_x, way_y = (coarse.focus_x - coarse.x[k]) / coarse.side, (coarse.focus_y - coarse.y[k]) / coarse.side
    level = math.fabs(way_x) > math.fabs(way_y)
    way = max(math.fabs(way_x), math.fabs(way_y))
    steps = rounding.whole(way * coarse.ahead_m / (NEAREST_M + coarse.ahead_m)) + 1
    far_px = farthest * way + off_flow
    if far_px + 1 >= steps or not may_be_near(coarse, way_x, way_y, way, steps, far_px):
        return 0.0
    x, y = nearest_px(coarse.base_x), nearest_px(coarse.base_y)
    beside, nearest = rounding.whole(off_flow + 0.5), 0
    coarse.least_still = coarse.least_moving = WORST
    for step in range(-1, steps + 2):
        along_x, along_y = nearest_px(way_x * step / way), nearest_px(way_y * step / way)
        for off in range(-beside, beside + 1):
            across, down = along_x + (0 if level else off), along_y + (off if level else 0)
            total = difference(coarse, x + across, y + down, WORST)
            if step <= far_px:
                coarse.least_still = min(coarse.least_still, total)
            elif total < coarse.least_moving:
                coarse.least_moving, coarse.across, coarse.down, nearest = total, across, down, step
    fits = coarse.least_moving <= calm(coarse, k) and coarse.least_moving < LIKENESS * coarse.least_still
    return nearest / way if fits else 0.0


def is_in_way(coarse: CoarseMotion, k: int, range_m: float, around: Situation) -> bool:
    """Whether a piece at a range is in the vehicle's path, and no higher than the vehicle."""
    right_m = (coarse.x[k] - around.focus_x) / around.pinhole.fx * range_m
    up_m = around.camera_height_m + (around.horizon_y - coarse.y[k]) / around.pinhole.fy * range_m
    return up_m < around.height_m and math.fabs(path.least_miss(right_m, range_m, around)) < around.half_width_m


def seek_all_near(coarse: CoarseMotion, plane: ImagePlane, around: Situation) -> None:
    """Find textured pieces that are met soon, if they stand, against the searched image."""
    if not around.assumed_mps > 0 or not coarse.ahead_m > 0 or coarse.off_flow >= MAX_OFF_FLOW:
        return
    for k in range(coarse.columns * coarse.rows):
        known = coarse.links[k] > 0 or coarse.blocks.rough[k] < PLAIN_GREY * block_matching.PIXELS
        if known or not put(coarse, k, plane):
            continue
        share = seek_near(coarse, k, coarse.off_flow, farthest_share(coarse, k, around))
        if share > 0 and is_in_way(coarse, k, coarse.ahead_m * (1 - share) / share, around):
            coarse.contact_s[k] = coarse.then_s * (1 - share) / share
            set_motion(coarse, k)


def see_all(coarse: CoarseMotion, age: int, plane: ImagePlane, around: Situation) -> None:
    """Find moving pieces against the searched image, among textured ones not yet found to move."""
    pieces = coarse.columns * coarse.rows
    for back in range(pieces):
        k = pieces - 1 - back
        known = coarse.links[k] > 0 or coarse.blocks.rough[k] < PLAIN_GREY * block_matching.PIXELS
        if known or not put(coarse, k, plane):
            continue
        if age == LAST:
            coarse.came_x[k], coarse.came_y[k] = coarse.base_x, coarse.base_y
        is_measured = coarse.came_x[k] >= 0 and coarse.off_flow < MAX_OFF_FLOW
        if is_measured and see(coarse, k, age, around) and set_motion(coarse, k):
            chain(coarse, k, around.dt_s)


def measure(coarse: CoarseMotion, keys: KeyFrames, baselines: Baselines, plane: ImagePlane, around: Situation) -> None:
    """Find the pieces that move independently: fast against the last image, slower against an older one; near ones."""
    for k in range(coarse.columns * coarse.rows):
        coarse.links_before[k], coarse.vx_before[k], coarse.vy_before[k] = coarse.links[k], coarse.vx[k], coarse.vy[k]
        coarse.links[k] = 0
        coarse.stance[k] = UNKNOWN
        coarse.contact_s[k] = 0.0
        coarse.came_x[k] = -1.0
    coarse.seen = coarse.searches = 0
    if coarse.blocks.count < 2 or not coarse.columns or not coarse.rows:
        return
    block_matching.roughen(coarse.blocks)
    look_back(coarse, keys, around)
    see_all(coarse, LAST, plane, around)
    slot = older_slot(coarse, baselines)
    if slot >= 0:
        look_farther_back(coarse, slot, keys, baselines, around)
        see_all(coarse, OLDER, plane, around)
        seek_all_near(coarse, plane, around)
