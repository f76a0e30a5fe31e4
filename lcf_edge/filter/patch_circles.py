"""C_r from patches: stationary obstacles whose corners do not show that they approach.

At least two patches must agree to found a circle; one confirms it. Its cause is *incoming*. A circle that rebels
updated is left to them.
"""

import math

from lcf_edge.filter import circles as shared
from lcf_edge.filter import lengths, path, situation
from lcf_edge.filter.circles import Ids, Members
from lcf_edge.filter.columns import CircleColumns, EdgeColumns
from lcf_edge.filter.memory import Bytes, octets
from lcf_edge.filter.patches import Patches
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import Cause

MIN_ELAPSED_S = 0.5  # a younger patch has not grown enough to be reliable
MIN_SIGMAS = 4.0  # by which 1/Z of an obstacle exceeds zero,
ALIKE_SIGMAS = 3.0  # and that of a patch that agrees with it
UNEVEN = 3.0  # sigmas that half the difference between a group's growth across and down counts as
SLOWER_HORIZONS = 1.5  # time to contact, one sigma slower, in horizons at most
KNOWN_WIDTHS = 1.1  # half widths from the path within which a known obstacle still is in the way
HALF_SHARE = 0.6  # least half width of a thing, in half-sides of its patch
GROUND_MARGIN = 0.3  # share by which the ground may be misjudged
UPRIGHT_SHARE = 0.25  # of 1/Z, least difference that the ground would have between two patches of something upright,
UPRIGHT_SIGMAS = 4.0  # and by which theirs falls short of it
LOWEST_SHARE = 0.8  # depth under the camera, as a share of its height, below which it is the ground
DRIFT_RAD = 0.004  # sideways drift off its flow line that a stationary patch may have,
PITCH_RAD = 0.02  # and vertical drift: pitch is known less well;
DRIFT_PX = 0.7  # added to both
AGREE_SIGMAS = 2.0  # by which inverse ranges of one thing may differ,
AGREE_SHARE = 0.1  # plus this share,
AGREE_AT_MOST = 0.25  # but by no more than this share
SIDE_SIDES = 3.0  # half-sides within which patches side by side may belong to one thing,
STACK_SIDES = 4.0  # and one above the other
INCOMING = int(Cause.INCOMING)
INFINITY = float("inf")


class PatchGroups:
    """Groups of patches that show one thing; one row per patch from which a group starts.

    ``obstacle``: whether a patch shows one; ``taken``: whether it is in a group already. ``members``: as those of
    circles, from the extent of the patches. Of the last group, ``weight``: Σ 1/σ², ``inverse``: its 1/Z, 1/m;
    ``uneven``: half the difference between its growth across and down, in the same unit.
    """

    def __init__(self, patches: int) -> None:
        self.obstacle, self.taken = [octets(max(patches, 1)) for _ in range(2)]
        self.members = Members(max(patches, 1))
        self.left = self.top = self.right = self.bottom = self.weight = self.inverse = self.uneven = 0.0


def stands(patches: Patches, p: int, around: Situation) -> bool:
    """Whether a patch stays on its flow line."""
    drift_x = patches.x[p] - around.focus_x - patches.scale[p] * (patches.first_x[p] - around.focus_x)
    drift_y = patches.y[p] - around.focus_y - patches.scale[p] * (patches.first_y[p] - around.focus_y)
    across, down = DRIFT_RAD * around.pinhole.fx + DRIFT_PX, PITCH_RAD * around.pinhole.fy + DRIFT_PX
    return math.fabs(drift_x) < across and math.fabs(drift_y) < down


def is_obstacle(patches: Patches, p: int, around: Situation) -> bool:
    """Whether a patch shows something stationary above the ground that the vehicle reaches within the horizon."""
    inverse, inverse_sigma = patches.inverse[p], patches.inverse_sigma[p]
    reach_m = around.assumed_mps * around.horizon_s
    if not inverse > MIN_SIGMAS * inverse_sigma or not (inverse - inverse_sigma) * SLOWER_HORIZONS * reach_m > 1:
        return False
    range_m = 1 / inverse
    half = patches.half_px[p] * patches.scale[p]
    right_m = (patches.x[p] - around.focus_x) / around.pinhole.fx * range_m
    up_m = (around.horizon_y - patches.y[p]) / around.pinhole.fy * range_m
    if path.way_to(right_m, range_m, around) >= reach_m or not stands(patches, p, around):
        return False
    if not around.camera_height_m > 0:
        return up_m < around.height_m
    above_m = up_m + around.camera_height_m
    if not (1 - LOWEST_SHARE) * around.camera_height_m < above_m < around.height_m:
        return False
    ground = situation.ground_inverse(around, patches.y[p] + 0.5 * half)
    return inverse > (1 + GROUND_MARGIN) * ground + inverse_sigma or (
        inverse > situation.ground_inverse(around, patches.y[p]) and is_upright(patches, p, around)
    )


def is_upright(patches: Patches, p: int, around: Situation) -> bool:
    """Whether a patch is at the same range as one above or below it; on the ground, the lower one would be nearer.

    Unlike the range of the ground, this does not depend on the pitch.
    """
    for q in range(patches.capacity):
        if not agree(patches, p, q):
            continue
        nearer = (patches.y[q] - patches.y[p]) / around.pinhole.fy / around.camera_height_m
        short = nearer - (patches.inverse[q] - patches.inverse[p])
        inverse_sigma = lengths.of(patches.inverse_sigma[p], patches.inverse_sigma[q])
        if (
            math.fabs(nearer) > UPRIGHT_SHARE * patches.inverse[p]
            and (short if nearer > 0 else -short) > UPRIGHT_SIGMAS * inverse_sigma
        ):
            return True
    return False


def is_in_way(groups: PatchGroups, g: int, patches: Patches, is_known: bool, around: Situation) -> bool:
    """Whether a group lies in the vehicle's path; for a known obstacle with a margin."""
    range_m = 1 / groups.inverse
    right_m = (groups.members.x[g] - around.focus_x) / around.pinhole.fx * range_m
    beside_m = HALF_SHARE * patches.half_px[g] * patches.scale[g] / around.pinhole.fx * range_m
    half_m = around.half_width_m * (KNOWN_WIDTHS if is_known else 1.0)
    return math.fabs(path.least_miss(right_m, range_m, around)) < half_m + beside_m


def agree(patches: Patches, p: int, q: int) -> bool:
    """Whether two patches show one thing: near each other, and at the same range."""
    if p == q or not patches.active[q] or patches.misses[q] or patches.elapsed_s[q] < MIN_ELAPSED_S:
        return False
    half = patches.half_px[p] * patches.scale[p]
    if math.fabs(patches.x[p] - patches.x[q]) >= SIDE_SIDES * half:
        return False
    if math.fabs(patches.y[p] - patches.y[q]) >= STACK_SIDES * half:
        return False
    one, other = patches.inverse[p], patches.inverse[q]
    inverse_sigma = lengths.of(patches.inverse_sigma[p], patches.inverse_sigma[q])
    apart = math.fabs(one - other)
    return (
        other > ALIKE_SIGMAS * patches.inverse_sigma[q]
        and apart < AGREE_SIGMAS * inverse_sigma + AGREE_SHARE * one
        and apart < AGREE_AT_MOST * one
    )


def add(groups: PatchGroups, g: int, patches: Patches, p: int) -> None:
    """Add a patch to a group."""
    half = patches.half_px[p] * patches.scale[p]
    weight = 1 / (patches.inverse_sigma[p] * patches.inverse_sigma[p])
    groups.members.size[g] += 1
    groups.left, groups.right = min(groups.left, patches.x[p] - half), max(groups.right, patches.x[p] + half)
    groups.top, groups.bottom = min(groups.top, patches.y[p] - half), max(groups.bottom, patches.y[p] + half)
    groups.weight += weight
    groups.inverse += weight * patches.inverse[p]
    groups.uneven += weight * patches.stretch[p] / patches.depth_m[p]


def gather(groups: PatchGroups, p: int, patches: Patches) -> None:
    """Gather the group of a patch and those that agree with it."""
    shared.clear(groups.members, p)
    groups.left = groups.top = INFINITY
    groups.right = groups.bottom = -INFINITY
    groups.weight = groups.inverse = groups.uneven = 0.0
    for q in range(patches.capacity):
        if agree(patches, p, q):
            add(groups, p, patches, q)
    add(groups, p, patches, p)
    groups.inverse /= groups.weight
    groups.uneven /= groups.weight
    across, down = groups.right - groups.left, groups.bottom - groups.top
    groups.members.x[p], groups.members.y[p] = groups.left + 0.5 * across, groups.top + 0.5 * down
    groups.members.variance_x[p] = across * across / (shared.EXTENT_SIGMAS * shared.EXTENT_SIGMAS)
    groups.members.variance_y[p] = down * down / (shared.EXTENT_SIGMAS * shared.EXTENT_SIGMAS)


def grows_evenly(groups: PatchGroups) -> bool:
    """Whether a group grows as much down as across.

    Things in a row beside the path flow apart, faster the farther from the focus, and so resemble one nearer thing that
    grows, but only along their row. The ground grows more down than across.
    """
    return groups.inverse > MIN_SIGMAS * lengths.of(1 / math.sqrt(groups.weight), UNEVEN * groups.uneven)


def claim(groups: PatchGroups, p: int, patches: Patches, circle: int) -> None:
    """Mark the patches of a group as taken. ``circle``: row of C_r that they support, -1: none."""
    for q in range(patches.capacity):
        if q == p or agree(patches, p, q):
            groups.taken[q] = 1
            if circle >= 0:
                patches.circle[q] = circle


def circle_of(groups: PatchGroups, g: int, circles: CircleColumns, settings: Settings) -> int:
    """The nearest circle that shows the same thing, -1: none."""
    nearest, least = -1, INFINITY
    half = 0.5 * max(groups.right - groups.left, groups.bottom - groups.top)
    for c in range(circles.capacity):
        if not circles.active[c]:
            continue
        away = lengths.of(circles.x[c] - groups.members.x[g], circles.y[c] - groups.members.y[g])
        if away < max(circles.radius[c], half) + settings.member_margin_px and away < least:
            nearest, least = c, away
    return nearest


def continues(groups: PatchGroups, circles: CircleColumns, c: int, around: Situation) -> bool:
    """Whether a group is met when a circle is."""
    apart = math.fabs(groups.inverse - 1 / (around.assumed_mps * circles.ttc[c]))
    return apart < AGREE_SIGMAS / math.sqrt(groups.weight) + AGREE_SHARE * groups.inverse


def update(
    groups: PatchGroups,
    patches: Patches,
    edges: EdgeColumns,
    circles: CircleColumns,
    updated: Bytes,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> None:
    """Update C_r from the obstacles that patches show.

    ``updated``: circles that rebels have updated; those updated here are marked too.
    """
    if not around.assumed_mps > 0:
        return
    for p in range(patches.capacity):
        seen = patches.active[p] and not patches.misses[p] and patches.elapsed_s[p] >= MIN_ELAPSED_S
        groups.obstacle[p] = 1 if seen and is_obstacle(patches, p, around) else 0
        groups.taken[p] = 0
    for p in range(patches.capacity):
        if not groups.obstacle[p] or groups.taken[p]:
            continue
        gather(groups, p, patches)
        c = circle_of(groups, p, circles, settings)
        is_known = c >= 0 and circles.cause[c] == INCOMING
        if groups.members.size[p] < 2 and not (is_known and continues(groups, circles, c, around)):
            continue
        if not is_in_way(groups, p, patches, is_known, around) or (c < 0 and not grows_evenly(groups)):
            continue
        is_shown = c >= 0 and updated[c] != 0  # updated by rebels, and left to them
        if c < 0:
            c = shared.row_for_newborn(edges, circles, True, settings)
            if c >= 0:
                shared.give_birth(circles, c, groups.members, p, settings, ids)
        elif not is_shown:
            shared.confirm(circles, c, groups.members, p, settings)
        claim(groups, p, patches, -1 if is_shown else c)
        if c >= 0 and not is_shown:
            updated[c] = 1
            shared.stand(circles, c, groups.members.x[p], 1 / groups.inverse, around, settings)
