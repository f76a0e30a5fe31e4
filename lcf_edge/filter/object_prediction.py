"""How objects go on: where their motion takes them, and for how long they are kept that their edges do not show."""

import math

from lcf_edge.filter import block_matching, flow, image_plane, lengths, object_belief, situation, speed_change
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.columns import EdgeColumns, ObjectColumns
from lcf_edge.filter.flow import Homography
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.inputs import LOOK_SIDE
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import ObjectState

WANDER_MPS = 1.0  # 1 sigma of the change of a velocity in one second; ``object_belief.UNSEEN_MPS`` where it is not seen
MAX_LAG = 0.5  # bounds the growth in a frame, and the correction of a rate from the middle of its window to now
EDGE_PX = 1.0  # inset of a corner from the outline
SURE_EDGES = 7  # fewer may lie on something else
COAST_S = 0.3  # an unseen object keeps its trust for this long,
HIDDEN_S = 1.0  # occluded by another one,
OUTSIDE_S = 1.0  # out of view,
COMING_S = 3.0  # and out of view, but moving towards the path;
NEAR_S = 1.0  # nearer than ``NEAR_M``, at least,
NEAR_M = 1.5
SOON_S = 2.0  # or farther, but large, well trusted and probably met within this time: until then;
REMNANT_SHARE = 0.33  # fewer edges of such a near object, as a share of its recent number, do not measure its motion;
LEAVES_S = 0.5  # unless it leaves the image within this time
RESTING_S = 2.0  # stationary, or near and seen through, before a stationary vehicle,
LINGERS_S = 6.0  # and near, not seen through;
SAME_PLACE_M = 0.5  # two objects this near to each other in range, and in one place of the image, are one
STARTS_S = 0.3  # for so long, as somebody starts to walk, some edges still show that he stands
THROUGH_S = 0.5  # it is seen through where edges that have not moved for this long,
MIN_THROUGH = 3  # at least so many, and before a vehicle at rest more than it lately had of its own,
THROUGH_SHARE = 0.3  # lie this near to the centre of its box, as a share of its width and height
LOSES_HZ = 20.0  # trust lost per second after that
PASSED_M = 0.1  # an unseen object nearer than this is passed
CHANGED_GREY = 10.0  # RMS difference of the samples from which a place looks different
LIGHT_SHARE = 0.15  # by which the light on it may change
LOOKS_AFTER = 1.5  # frames after it was lost
UNKNOWN, SAME, CHANGED = 0, 1, 2
NOT_YET, WATCHED, MOVED, NO_LONGER, EMPTY = 0, 1, 2, 3, 4
HIDDEN, COASTING = int(ObjectState.HIDDEN), int(ObjectState.COASTING)
INFINITY = float("inf")
NAN = float("nan")


def derotate(objects: ObjectColumns, h: Homography) -> None:
    """Apply H = K·R·K⁻¹ to the centres of objects."""
    for o in range(objects.capacity):
        if objects.active[o]:
            flow.warp(h, objects.x[o], objects.y[o])
            objects.x[o], objects.y[o] = h.x, h.y


def looming_at(objects: ObjectColumns, o: int, speed_mps: float) -> float:
    """Returns m, 1/s, converted to another speed of the vehicle than the one at which it was measured."""
    gained_mps = speed_mps - objects.reference[o]
    if objects.middle[o] > 0 and math.isfinite(gained_mps):
        return objects.looming[o] + gained_mps / objects.middle[o]
    return objects.looming[o]


def velocity_x(objects: ObjectColumns, o: int, x: float, looming: float, around: Situation) -> float:
    """Returns the image velocity of a part of an object at ``x``, px/s: sideways motion, and looming about O."""
    return objects.sideways[o] * around.pinhole.fx + looming * (x - around.focus_x)


def velocity_y(y: float, looming: float, around: Situation) -> float:
    """Returns the image velocity of a part at ``y``, px/s: motion on the ground expands about the horizon."""
    return looming * (y - around.horizon_y)


def x_in(objects: ObjectColumns, o: int, time_s: float, around: Situation) -> float:
    """Returns where its motion would take the centre of an object, px."""
    looming = looming_at(objects, o, around.speed_mps)
    return objects.x[o] + velocity_x(objects, o, objects.x[o], looming, around) * time_s


def bounded(change: float) -> float:
    """Returns a relative change, at most ``MAX_LAG`` either way."""
    return min(max(change, -MAX_LAG), MAX_LAG)


def forget_motion(objects: ObjectColumns, o: int) -> None:
    """Reset an object's motion to unknown."""
    objects.looming[o] = objects.sideways[o] = objects.mq[o] = 0.0
    objects.mm[o] = objects.qq[o] = INFINITY
    objects.reference[o] = NAN
    speed_change.forget(objects, o)


def predict(objects: ObjectColumns, plane: ImagePlane, around: Situation, settings: Settings) -> None:
    """Predict S': propagate each object by its motion, with growing uncertainty, and delete those out of reach."""
    for o in range(objects.capacity):
        if not objects.active[o]:
            continue
        if math.isfinite(around.speed_mps) != math.isfinite(objects.reference[o]):
            forget_motion(objects, o)
        dt_s, looming = around.dt_s, looming_at(objects, o, around.speed_mps)
        if lingers(objects, o, around):
            dt_s = 0.0
        objects.x[o] += velocity_x(objects, o, objects.x[o], looming, around) * dt_s
        objects.y[o] += velocity_y(objects.y[o], looming, around) * dt_s
        growth = 1 + bounded(looming * dt_s)
        objects.width[o] *= growth
        objects.height[o] *= growth
        objects.foot[o] *= growth
        objects.looming[o] *= growth
        objects.sideways[o] *= growth
        speed_change.predict(objects, o, growth, around.dt_s)
        inverse = 0.0
        if objects.middle[o] > 0:
            objects.middle[o] /= growth
            objects.range[o] /= growth
            inverse = 1 / objects.middle[o]
        wander_mps = WANDER_MPS if objects.unseen_s[o] == 0 else object_belief.UNSEEN_MPS
        wander = wander_mps * max(inverse, math.fabs(looming)) * math.sqrt(around.dt_s)
        objects.mm[o] += wander * wander
        objects.qq[o] += wander * wander
        objects.age_s[o] += around.dt_s
        if is_passed(objects, o) or (
            not is_in_sight(objects, o, plane) and not is_beside(objects, o, around, settings)
        ):
            objects.active[o] = 0


# What stands before a vehicle at rest: as long as its place in the image looks the same, it is there


def grey(objects: ObjectColumns, o: int, k: int, coarse: CoarseMotion, plane: ImagePlane) -> int:
    """Returns the grey of the downscaled image at the ``k``-th sample of an object's box, -1: outside of the image."""
    across, down = k % LOOK_SIDE + 0.5, k // LOOK_SIDE + 0.5
    x = objects.x[o] + (across / LOOK_SIDE - 0.5) * objects.width[o]
    y = objects.y[o] + (down / LOOK_SIDE - 0.5) * objects.height[o]
    if not image_plane.project(plane, x, y):
        return -1
    return block_matching.grey(coarse.blocks, plane.u / coarse.side, plane.v / coarse.side)


def look(objects: ObjectColumns, o: int, coarse: CoarseMotion, plane: ImagePlane) -> None:
    """Remember how the place of an object looks."""
    for k in range(LOOK_SIDE * LOOK_SIDE):
        objects.looks[o, k] = max(grey(objects, o, k, coarse, plane), 0)


def looks_different(objects: ObjectColumns, o: int, coarse: CoarseMotion, plane: ImagePlane) -> bool:
    """Whether that place looks different now, but for the light on it."""
    count = before = gained = squares = 0.0
    for k in range(LOOK_SIDE * LOOK_SIDE):
        now = grey(objects, o, k, coarse, plane)
        if now >= 0:
            change = now - objects.looks[o, k] + 0.0
            count += 1
            before += objects.looks[o, k]
            gained += change
            squares += change * change
    light = min(max(gained, -LIGHT_SHARE * before), LIGHT_SHARE * before) / max(count, 1.0)
    return squares - (2 * gained - light * count) * light > CHANGED_GREY * CHANGED_GREY * count


def stir(objects: ObjectColumns, o: int, coarse: CoarseMotion, plane: ImagePlane, around: Situation) -> None:
    """Keep an object that was lost right before a vehicle at rest as long as something stirs in its place.

    Somebody so near fills the image, and nobody stands so still that it does not change; but no corner lasts.
    """
    just_lost = objects.unseen_s[o] < LOOKS_AFTER * around.dt_s
    if just_lost or looks_different(objects, o, coarse, plane):
        look(objects, o, coarse, plane)
        if not just_lost:
            objects.unseen_s[o] = around.dt_s


def watch(
    objects: ObjectColumns,
    o: int,
    count: int,
    own: int,
    through: int,
    coarse: CoarseMotion,
    plane: ImagePlane,
    around: Situation,
) -> int:
    """Returns whether the place of an object looks as when the vehicle stopped, or it stopped near a vehicle at rest.

    Nothing flows then, and corners come and go: a few that are left may be of it, or of what it hid. ``UNKNOWN`` of
    what moves sideways, may move, or had few edges. ``CHANGED`` of what is not there: it has few edges left, and in its
    middle more of those behind are seen than it lately had. ``count``: of its edges, ``own``: of its members found
    in this frame, ``through``: of those behind.
    """
    if not situation.is_at_rest(around) or not block_matching.has_image(coarse.blocks):
        objects.watched[o] = NOT_YET
        return UNKNOWN
    if objects.watched[o] != WATCHED and through < MIN_THROUGH and lingers(objects, o, around):
        stir(objects, o, coarse, plane, around)
    if math.fabs(objects.sideways[o]) >= object_belief.STILL_HZ:
        objects.watched[o] = MOVED
        return UNKNOWN
    if objects.watched[o] == WATCHED:
        return CHANGED if looks_different(objects, o, coarse, plane) else SAME
    is_well_seen = count >= max(REMNANT_SHARE * objects.recent_edges[o], SURE_EDGES)
    stopped = objects.watched[o] == MOVED and objects.range[o] < NEAR_M and is_well_seen
    stands = objects.watched[o] == NOT_YET and objects.log_odds[o] > 0 and objects.recent_edges[o] >= SURE_EDGES
    if objects.watched[o] == NOT_YET:
        objects.watched[o] = NO_LONGER
    is_empty = through >= MIN_THROUGH and through > objects.recent_edges[o] and own < SURE_EDGES
    if is_empty or objects.watched[o] == EMPTY:
        objects.watched[o] = EMPTY
        return CHANGED
    if not (stopped or stands) or objects.unseen_s[o] > 0:
        return UNKNOWN
    look(objects, o, coarse, plane)
    objects.watched[o] = WATCHED
    return SAME


# How long they are kept


def is_in_image(objects: ObjectColumns, o: int, x: float, plane: ImagePlane) -> bool:
    """Whether a point ``x`` of the middle row of an object's box is in the image, above and below left aside."""
    return image_plane.project(plane, x, min(max(objects.y[o], EDGE_PX), plane.height - EDGE_PX - 1))


def is_in_sight(objects: ObjectColumns, o: int, plane: ImagePlane) -> bool:
    """Whether a part of the middle row of an object's box is in the image."""
    left, right = objects.x[o] - 0.5 * objects.width[o], objects.x[o] + 0.5 * objects.width[o]
    if is_in_image(objects, o, objects.x[o], plane) or is_in_image(objects, o, left, plane):
        return True
    return is_in_image(objects, o, right, plane) or (left < 0 and right > plane.width)


def is_passed(objects: ObjectColumns, o: int) -> bool:
    """Whether an unseen object would by now be nearer than is possible."""
    return objects.unseen_s[o] > 0 and objects.middle[o] < PASSED_M


def is_beside(objects: ObjectColumns, o: int, around: Situation, settings: Settings) -> bool:
    """Whether an object that left the image may still be met."""
    patience_s = outside_s(objects, o, around)
    return objects.trust[o] >= settings.tr_s and objects.unseen_s[o] < patience_s and objects.middle[o] > 0


def outside_s(objects: ObjectColumns, o: int, around: Situation) -> float:
    """Returns for how long an object is kept that left the image, s: longer if it moves towards the path."""
    return COMING_S if comes(objects, o, around) else OUTSIDE_S


def comes(objects: ObjectColumns, o: int, around: Situation) -> bool:
    """Whether an object moves towards the path from the side."""
    return (objects.right[o] if objects.x[o] < around.focus_x else -objects.right[o]) > object_belief.SLOW_MPS


def lingers(objects: ObjectColumns, o: int, around: Situation) -> bool:
    """Whether an object was lost near a stationary vehicle, which it does not leave; its motion is then unknown."""
    is_lost = (
        objects.unseen_s[o] > 0 and math.fabs(around.speed_mps) < object_belief.SLOW_MPS and objects.range[o] < NEAR_M
    )
    return is_lost and (not objects.left[o] or comes(objects, o, around))


def is_in_middle(objects: ObjectColumns, o: int, x: float, y: float) -> bool:
    """Whether a point is near the centre of an object's box."""
    across, down = math.fabs(x - objects.x[o]), math.fabs(y - objects.y[o])
    return across < THROUGH_SHARE * objects.width[o] and down < THROUGH_SHARE * objects.height[o]


def fixed_behind(objects: ObjectColumns, o: int, edges: EdgeColumns) -> int:
    """Returns the number of stationary edges in the middle of the box of an object that are not its own."""
    through = 0
    for i in range(edges.count):
        is_fixed = edges.matched[i] and edges.fixed_s[i] >= THROUGH_S
        if is_fixed and edges.square[i] != o and is_in_middle(objects, o, edges.x[i], edges.y[i]):
            through += 1
    return through


def is_behind(objects: ObjectColumns, o: int) -> bool:
    """Whether a nearer, seen object overlaps this one in the image."""
    for other in range(objects.capacity):
        if other == o or not objects.active[other] or objects.unseen_s[other] > 0:
            continue
        if not objects.range[other] < objects.range[o]:
            continue
        across = math.fabs(objects.x[o] - objects.x[other]) < 0.5 * (objects.width[other] + objects.width[o])
        if across and math.fabs(objects.y[o] - objects.y[other]) < 0.5 * (objects.height[other] + objects.height[o]):
            return True
    return False


def is_in_place_of(objects: ObjectColumns, o: int, other: int) -> bool:
    """Whether a seen object is where an unseen one is taken to be."""
    apart_m = math.fabs(objects.range[o] - objects.range[other])
    if not apart_m < min(lengths.of(objects.range_sigma[o], objects.range_sigma[other]), SAME_PLACE_M):
        return False
    across = math.fabs(objects.x[o] - objects.x[other]) < 0.5 * objects.width[other]
    return across and math.fabs(objects.y[o] - objects.y[other]) < 0.5 * objects.height[other]


def has_left(objects: ObjectColumns, o: int, other: int, around: Situation) -> bool:
    """Whether a seen object, founded as another was lost, was then in its place: it stood and walks on, or turned."""
    if objects.age_s[other] > objects.unseen_s[o] + STARTS_S:
        return False
    since_s = max(objects.age_s[other], objects.unseen_s[o])
    moves = 0.0 if lingers(objects, o, around) else 1.0
    aside_m = (objects.right[other] - moves * objects.right[o]) * since_s
    ahead_m = (objects.forward[other] - moves * objects.forward[o]) * since_s
    own_m, other_m = objects.range[o] / around.pinhole.fx, objects.range[other] / around.pinhole.fx  # of a pixel there
    half_m = 0.5 * (objects.width[o] * own_m + objects.width[other] * other_m)
    right_m = (objects.x[other] - around.focus_x) * other_m - (objects.x[o] - around.focus_x) * own_m
    apart_m = math.fabs(objects.range[other] - objects.range[o] - ahead_m)
    return apart_m < objects.range_sigma[o] + objects.range_sigma[other] and math.fabs(right_m - aside_m) < half_m


def object_in_place_of(objects: ObjectColumns, o: int, around: Situation) -> int:
    """Returns the object that is seen, by more than a few edges, in the place of a lost one, or left it; -1: none.

    Somebody who stops, turns or walks on at once breaks the motion of his object, and another one is founded on him.
    Two things cannot be in one place, so they are one.
    """
    for other in range(objects.capacity):
        if other == o or not objects.active[other] or objects.unseen_s[other] > 0:
            continue
        if objects.support[other] < SURE_EDGES:
            continue
        if is_in_place_of(objects, o, other) or has_left(objects, o, other, around):
            return other
    return -1


def take_over(objects: ObjectColumns, o: int, by: int) -> None:
    """End an unseen object; the seen one in its place has its trust and, if younger, its identity."""
    objects.trust[by] = max(objects.trust[by], objects.trust[o])
    if objects.age_s[by] < objects.age_s[o]:
        objects.id[by], objects.age_s[by] = objects.id[o], objects.age_s[o]
    objects.active[o] = 0


def is_remnant(objects: ObjectColumns, o: int, count: int, plane: ImagePlane, around: Situation) -> bool:
    """Whether too few of a near object's recent edges are left to measure its motion.

    A very near object loses its corners, and the last ones may lie on a limb, or on something else: its range would
    seem to grow while it comes closer. Not if it is about to leave the image, which explains the loss, nor before a
    vehicle at rest, where few edges are expected.
    """
    if not objects.range[o] < NEAR_M or count >= REMNANT_SHARE * objects.recent_edges[o]:
        return False
    if situation.is_at_rest(around):
        return False
    return image_plane.project(plane, x_in(objects, o, LEAVES_S, around), objects.y[o])


def is_left_over(objects: ObjectColumns, o: int, own: int, around: Situation) -> bool:
    """Whether so few members of something near a vehicle at rest are left that they may lie on what it hid.

    Who walks on leaves a few corners beside him behind, which stand still, as he did: another object is founded on him,
    or he was not seen since. ``own``: number of its members.
    """
    if not situation.is_at_rest(around) or not objects.range[o] < NEAR_M:
        return False
    if own >= REMNANT_SHARE * objects.recent_edges[o]:
        return False
    if objects.unseen_s[o] > 0 and objects.log_odds[o] > 0:
        return True
    return object_in_place_of(objects, o, around) >= 0


def near_s(objects: ObjectColumns, o: int, around: Situation) -> float:
    """Returns for how long an object lost nearby is kept, s: until the vehicle is there."""
    if not math.isfinite(around.speed_mps):
        return NEAR_S
    return min(max(objects.range[o] / max(math.fabs(around.speed_mps), object_belief.SLOW_MPS), NEAR_S), LINGERS_S)


def is_met_soon(objects: ObjectColumns, o: int, settings: Settings) -> bool:
    """Whether a well trusted object farther than ``NEAR_M`` will probably be met within ``SOON_S``.

    Only what is large in the image grows so fast that its corners are lost, and not what something nearer hides, nor
    what does not loom: its motion is unknown.
    """
    is_large = max(objects.width[o], objects.height[o]) > settings.min_coast_px
    is_soon = objects.range[o] >= NEAR_M and objects.ttc[o] < SOON_S and objects.looming[o] * LINGERS_S > 1
    is_trusted = objects.trust[o] >= settings.tr_coast and objects.state[o] != HIDDEN
    return is_trusted and is_large and is_soon and objects.probability[o] > object_belief.EVEN


def go_on(
    objects: ObjectColumns,
    o: int,
    gone: bool,
    through: int,
    edges: EdgeColumns,
    plane: ImagePlane,
    around: Situation,
    settings: Settings,
) -> None:
    """Keep an object without edges in this frame as hidden or coasting; in the end, delete it.

    It is kept for longer where missing edges are expected: stationary before a stationary vehicle, very near, or out
    of view. ``gone``: its place looks different from when it was seen there; ``through``: number of edges in its middle
    that move differently: then its corners are not lost, but it has stopped or turned.
    """
    objects.unseen_s[o] += around.dt_s
    by = object_in_place_of(objects, o, around)
    if by >= 0:
        take_over(objects, o, by)
        return
    hidden = is_behind(objects, o)
    objects.state[o] = HIDDEN if hidden else COASTING
    patience_s = HIDDEN_S if hidden else COAST_S
    coasts_s = COAST_S - objects.unseen_s[o]
    if coasts_s >= 0 and not is_in_image(objects, o, x_in(objects, o, coasts_s, around), plane):
        objects.left[o] = 1
    if not is_in_sight(objects, o, plane) or (objects.left[o] and not comes(objects, o, around)):
        patience_s = outside_s(objects, o, around)
    elif lingers(objects, o, around):
        has_gone = gone or objects.recent_edges[o] < SURE_EDGES or fixed_behind(objects, o, edges) >= MIN_THROUGH
        patience_s = RESTING_S if has_gone else LINGERS_S
    elif math.fabs(around.speed_mps) < object_belief.SLOW_MPS and objects.log_odds[o] > 0:
        patience_s = RESTING_S
    elif through < MIN_THROUGH and is_met_soon(objects, o, settings):
        patience_s = LINGERS_S
    elif objects.range[o] < NEAR_M:
        patience_s = near_s(objects, o, around)
    if objects.unseen_s[o] > patience_s:
        objects.trust[o] -= around.dt_s * LOSES_HZ
    if objects.trust[o] < settings.tr_cr:
        objects.active[o] = 0
