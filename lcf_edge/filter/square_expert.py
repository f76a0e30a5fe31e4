"""Square expert, S: circles of one thing are an object, with its range and motion, and their uncertainty.

The third layer (Tafrishi, Dai & Kandjani 2021). Rebel circles join a nearby object of the same motion; the rest found
new ones. Objects keep their identity while they are occluded, or not seen for a short time.
"""

import math

from lcf_edge.filter import circles as shared
from lcf_edge.filter import (
    edge_equations,
    flow,
    group_motion,
    image_plane,
    lengths,
    path,
    range_belief,
    situation,
    speed_change,
    turmoil,
)
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.coarse_circles import CoarseGroups
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.columns import CircleColumns, EdgeColumns, ObjectColumns
from lcf_edge.filter.flow import Homography
from lcf_edge.filter.group_motion import MotionSums
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.memory import integers, octets
from lcf_edge.filter.patches import Patches
from lcf_edge.filter.range_belief import Belief, Evidence
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import ObjectClass, ObjectState

MIN_EDGES = 2  # needed to measure a motion
SIDE_GAP = 0.25  # largest gap between circles of one object, of the larger extent: horizontal,
STACK_GAP = 0.75  # and vertical, since a pedestrian has few corners between head and feet;
WIDE_GAP = 0.8  # where the motions agree closely: horizontal, of the width,
TOWER_GAP = 2.0  # and vertical
LIKE_SIGMAS = 3.0  # tolerance for motions of one object,
LIKE_SHARE = 0.25  # plus this share of the speed, since limbs swing,
VERY_LIKE_SHARE = 0.1  # or this one, for close agreement;
MAX_SIGMAS_SHARE = 0.5  # bounds the sigmas, as a share of the speed: an uncertain object would absorb its surroundings
LIKE_SHARE_OF_LINK = 0.2  # plus this share of the link distance of rebels, per second
STRAY_SIGMAS = 4.0  # of noise, plus
STRAY_SHARE = 0.35  # this share of its speed: tolerance for the motion of an object's edge,
JOIN_SHARE = 0.1  # less for one that is no rebel
SIDE_REACH = 0.1  # margin in which edges that break the flow may join, as a share of the box of its edges,
STACK_REACH = 0.3  # and above and below; the ground before it moves much as it does, so others join only inside
ALL = -1  # all edges of an object measure its motion
WANDER_MPS = 1.0  # 1 sigma of the change of a velocity in one second,
UNSEEN_MPS = 0.3  # less where it is not seen
BODY_SHARE = 0.1  # model error of m, 1 sigma, as a share: some edges lie farther off than the rest,
BODY_HZ = 0.015  # and in quadrature with it;
SWING_SHARE = 0.1  # the same of q
SWING_HZ = 0.006
NOISE_GAIN = 1.7  # corners wander more than their noise suggests: they are not fixed points of the object
MAX_LAG = 0.5  # bounds the correction of a rate from the middle of its window to now
NEWS_SIGMAS = 4.0  # beyond this an innovation is an outlier and is down-weighted
PERSISTS_S = 0.055  # time constant with which the log odds of standing decay,
MAX_ODDS = 4.0  # which are clamped to this
GROWS_S = 0.07  # time constant with which a side of a box moves outwards,
SHRINKS_S = 0.3  # and inwards,
FOOT_S = 1.2  # and with which the foot rises to a higher lowest edge,
FOOT_BELOW_S = 3.0  # if it was below the image
EDGE_PX = 1.0  # inset of a corner from the outline
TURMOIL_HZ = 1.0  # 1 sigma of m and q where no motion can be tracked
FRAMES_UNREPORTED = 2.0  # of a new object
UNSURE = 0.25  # trust gained per frame, instead of 1, with fewer edges than
SURE_EDGES = 7
COAST_S = 0.3  # an unseen object keeps its trust for this long,
HIDDEN_S = 1.0  # occluded by another one,
OUTSIDE_S = 1.0  # out of view,
COMING_S = 3.0  # and out of view, but moving towards the path;
NEAR_S = 1.0  # nearer than ``NEAR_M``, at least,
NEAR_M = 1.5
SOON_S = 2.0  # or farther, but large, well trusted and probably met within this time: until then;
REMNANT_SHARE = 0.33  # fewer edges of such a near object, as a share of its recent number, do not measure its motion;
RECENT_S = 3.0  # time constant with which that number decays;
LEAVES_S = 0.5  # unless it leaves the image within this time
RESTING_S = 2.0  # stationary, or near and seen through, before a stationary vehicle,
LINGERS_S = 6.0  # and near, not seen through;
SAME_PLACE_M = 0.5  # two objects this near to each other in range, and in one place of the image, are one
THROUGH_S = 0.5  # it is seen through where edges that have not moved for this long,
MIN_THROUGH = 3  # at least so many,
THROUGH_SHARE = 0.3  # lie this near to the centre of its box, as a share of its width and height
LOSES_HZ = 20.0  # trust lost per second after that
FOOT_PX = 2.0  # 1 sigma of the row of the lowest edge
BORDER_PX = 4.0
CUT_SHARE = 0.15  # of its height: if the lowest edge is this near to the image's border, the foot may be below it,
CUT_HIDES = 0.75  # with this probability
PASSED_M = 0.1  # an unseen object nearer than this is passed
MOVES_SIGMAS = 1.5  # a velocity above this is significant
SLOW_MPS = 0.15
INTO_PATH = 0.2  # least sideways motion of an object that cuts in, as a share of its forward motion
STILL_HZ = 0.05  # before a vehicle at rest, an object with a smaller looming and sideways rate is at rest too
RATE_SIGMAS = 1.0  # a time to contact is reported for a looming above this
EVEN = 0.5
MAX_RANGE_M = 1000.0  # larger ranges are not reported
UNKNOWN, STANDING, CROSSING = int(ObjectClass.UNKNOWN), int(ObjectClass.STANDING), int(ObjectClass.CROSSING)
ONCOMING, LEADING, CUTTING_IN = int(ObjectClass.ONCOMING), int(ObjectClass.LEADING), int(ObjectClass.CUTTING_IN)
SEEN, HIDDEN, COASTING = int(ObjectState.SEEN), int(ObjectState.HIDDEN), int(ObjectState.COASTING)
INFINITY = float("inf")
NAN = float("nan")


class Squares:
    """Scratch memory of one frame.

    ``parts``: the motion of each circle; ``wholes``: of each object; ``members``: its edges; ``resting``: those of
    them that are matched while the vehicle is at rest; ``bounds``: within which edges may join it. ``obedient``:
    whether the edge of a verdict moves as its object does.
    """

    def __init__(self, circles: int, objects: int, edges: int) -> None:
        self.parts, self.wholes, self.bounds = MotionSums(circles), MotionSums(objects), MotionSums(objects)
        self.members, self.resting = integers(objects), integers(objects)
        self.obedient = octets(edges)
        self.evidence, self.belief = Evidence(), Belief()


# Prediction


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
        growth = 1 + min(max(looming * dt_s, -MAX_LAG), MAX_LAG)
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
        wander = (
            (WANDER_MPS if objects.unseen_s[o] == 0 else UNSEEN_MPS)
            * max(inverse, math.fabs(looming))
            * math.sqrt(around.dt_s)
        )
        objects.mm[o] += wander * wander
        objects.qq[o] += wander * wander
        objects.age_s[o] += around.dt_s
        if is_passed(objects, o) or (
            not is_in_sight(objects, o, plane) and not is_beside(objects, o, around, settings)
        ):
            objects.active[o] = 0


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
    return (objects.right[o] if objects.x[o] < around.focus_x else -objects.right[o]) > SLOW_MPS


def lingers(objects: ObjectColumns, o: int, around: Situation) -> bool:
    """Whether an object was lost near a stationary vehicle, which it does not leave; its motion is then unknown."""
    is_lost = objects.unseen_s[o] > 0 and math.fabs(around.speed_mps) < SLOW_MPS and objects.range[o] < NEAR_M
    return is_lost and (not objects.left[o] or comes(objects, o, around))


def is_seen_through(objects: ObjectColumns, o: int, edges: EdgeColumns) -> bool:
    """Whether stationary edges are seen in the middle of the box of a lost object."""
    through = 0
    for i in range(edges.count):
        if edges.matched[i] and edges.fixed_s[i] >= THROUGH_S:
            across, down = math.fabs(edges.x[i] - objects.x[o]), math.fabs(edges.y[i] - objects.y[o])
            if across < THROUGH_SHARE * objects.width[o] and down < THROUGH_SHARE * objects.height[o]:
                through += 1
    return through >= MIN_THROUGH


# Circles of one object


def belongs(
    objects: ObjectColumns,
    o: int,
    circles: CircleColumns,
    c: int,
    parts: MotionSums,
    around: Situation,
    settings: Settings,
) -> bool:
    """Whether a circle is a part of an object: near its box, with the same motion.

    A large object may have few corners, so a wider gap is allowed if the circle moves, and closely as the object does;
    whatever stands still in the image agrees with everything else that does.
    """
    width, tall = max(objects.width[o], circles.width[c]), max(objects.height[o], circles.height[c])
    extent = max(width, tall)
    side = math.fabs(objects.x[o] - circles.x[c]) - 0.5 * (objects.width[o] + circles.width[c])
    stack = math.fabs(objects.y[o] - circles.y[c]) - 0.5 * (objects.height[o] + circles.height[c])
    near_px = settings.rebel_link_px
    if side < max(near_px, SIDE_GAP * extent) and stack < max(near_px, STACK_GAP * extent):
        return moves_alike(objects, o, parts, c, LIKE_SHARE, around, settings)
    if side < WIDE_GAP * width and stack < TOWER_GAP * extent and is_moving(parts, c, settings):
        return moves_alike(objects, o, parts, c, VERY_LIKE_SHARE, around, settings)
    return False


def is_moving(parts: MotionSums, c: int, settings: Settings) -> bool:
    """Whether a circle moves in the image, beyond its noise."""
    weight = parts.weight[c]
    speed = lengths.of(parts.vx[c] / weight, parts.vy[c] / weight)
    return speed > LIKE_SIGMAS / math.sqrt(weight) + LIKE_SHARE_OF_LINK * settings.rebel_link_px


def expands_alike(objects: ObjectColumns, o: int, parts: MotionSums, c: int, looming: float) -> bool:
    """Whether a circle expands as an object looms: near O, things at different ranges move much the same."""
    group_motion.fit_expansion(parts, c)
    apart = math.fabs(parts.expansion - looming)
    sigmas = LIKE_SIGMAS * math.sqrt(NOISE_GAIN * NOISE_GAIN / parts.spread + objects.mm[o])
    return apart < sigmas + LIKE_SHARE * max(math.fabs(parts.expansion), math.fabs(looming))


def moves_alike(
    objects: ObjectColumns,
    o: int,
    parts: MotionSums,
    c: int,
    share: float,
    around: Situation,
    settings: Settings,
) -> bool:
    """Whether a circle moves as that part of the object would, within the uncertainty of both."""
    weight = parts.weight[c]
    x, y = parts.x[c] / weight, parts.y[c] / weight
    vx, vy = parts.vx[c] / weight, parts.vy[c] / weight
    looming = looming_at(objects, o, parts.forward[c] / weight)
    dx, dy = vx - velocity_x(objects, o, x, looming, around), vy - velocity_y(y, looming, around)
    fx, fy = around.pinhole.fx, around.pinhole.fy
    across, down = (x - around.focus_x) / fx, (y - around.horizon_y) / fy
    own = 1 / weight
    sideways = objects.qq[o] + across * across * objects.mm[o] + 2 * across * objects.mq[o]
    variance_x = own + fx * fx * max(sideways, 0.0)
    variance_y = own + fy * fy * down * down * objects.mm[o]
    like = share * lengths.of(vx, vy) + LIKE_SHARE_OF_LINK * settings.rebel_link_px
    largest = MAX_SIGMAS_SHARE * max(lengths.of(vx, vy), lengths.of(vx - dx, vy - dy))
    return (
        math.fabs(dx) < min(LIKE_SIGMAS * math.sqrt(variance_x), largest) + like
        and math.fabs(dy) < min(LIKE_SIGMAS * math.sqrt(variance_y), largest) + like
        and expands_alike(objects, o, parts, c, looming)
    )


def measure_circles(
    parts: MotionSums,
    circles: CircleColumns,
    verdicts: Verdicts,
    edges: EdgeColumns,
    patches: Patches,
    coarse: CoarseMotion,
    coarse_groups: CoarseGroups,
    baselines: Baselines,
    around: Situation,
) -> None:
    """Measure the motion of each rebel circle from its edges, patches and image pieces."""
    for c in range(circles.capacity):
        group_motion.clear(parts, c)
    for j in range(verdicts.count):
        i = verdicts.row[j]
        if edges.rebel[i] and edges.circle[i] >= 0:
            group_motion.add_edge(parts, edges.circle[i], verdicts, j, edges, baselines, around)
    for p in range(patches.capacity):
        if patches.active[p] and patches.circle[p] >= 0:
            group_motion.add_patch(parts, patches.circle[p], patches, p, around)
    for p in range(coarse.columns * coarse.rows):
        if coarse_groups.circle[p] >= 0:
            group_motion.add_piece(parts, coarse_groups.circle[p], coarse, p, around)


def keep_members(
    objects: ObjectColumns, squares: Squares, circles: CircleColumns, around: Situation, settings: Settings
) -> None:
    """Detach circles that have ended, or no longer move as their object does."""
    for c in range(circles.capacity):
        o = circles.square[c]
        if o < 0:
            continue
        if (
            not circles.active[c]
            or not objects.active[o]
            or (
                squares.parts.count[c] >= MIN_EDGES
                and not belongs(objects, o, circles, c, squares.parts, around, settings)
            )
        ):
            circles.square[c] = -1


def object_in_turmoil(objects: ObjectColumns, circles: CircleColumns, c: int) -> int:
    """Returns the nearest object that overlaps a circle in turmoil, -1: none."""
    nearest = -1
    least = INFINITY
    for o in range(objects.capacity):
        dx, dy = math.fabs(objects.x[o] - circles.x[c]), math.fabs(objects.y[o] - circles.y[c])
        meets = dx < 0.5 * max(objects.width[o], circles.width[c]) and dy < 0.5 * max(
            objects.height[o], circles.height[c]
        )
        if objects.active[o] and meets and lengths.of(dx, dy) < least:
            nearest, least = o, lengths.of(dx, dy)
    return nearest


def nearest_object(
    objects: ObjectColumns, squares: Squares, circles: CircleColumns, c: int, around: Situation, settings: Settings
) -> int:
    """Returns the nearest object that a circle is a part of, -1: none."""
    nearest = -1
    least = INFINITY
    for o in range(objects.capacity):
        if objects.active[o] and belongs(objects, o, circles, c, squares.parts, around, settings):
            away = lengths.of(objects.x[o] - circles.x[c], objects.y[o] - circles.y[c])
            if away < least:
                nearest, least = o, away
    return nearest


def free_row(objects: ObjectColumns) -> int:
    """Returns the first unused row, -1: none."""
    for o in range(objects.capacity):
        if not objects.active[o]:
            return o
    return -1


def row_to_spare(objects: ObjectColumns, settings: Settings) -> int:
    """Returns the row of the least trusted object that is neither seen nor reported; -1: there is none."""
    spare = -1
    for o in range(objects.capacity):
        if objects.unseen_s[o] == 0 or objects.trust[o] >= settings.tr_s:
            continue
        if spare < 0 or objects.trust[o] < objects.trust[spare]:
            spare = o
    return spare


def give_birth(objects: ObjectColumns, o: int, settings: Settings, ids: Ids) -> None:
    """Initialise a new object. It is not reported in its first frames, in which few edges would determine it."""
    objects.active[o] = 1
    objects.recent_edges[o] = 0.0
    objects.id[o] = shared.new_id(ids)
    objects.trust[o] = settings.tr_s - FRAMES_UNREPORTED - 1
    objects.age_s[o] = objects.unseen_s[o] = objects.log_odds[o] = 0.0
    objects.class_id[o], objects.state[o], objects.support[o], objects.left[o] = UNKNOWN, SEEN, 0, 0
    objects.range[o] = objects.middle[o] = objects.middle_sigma[o] = objects.ttc[o] = objects.foot[o] = NAN
    objects.probability[o] = 0.0
    forget_motion(objects, o)


def found(
    objects: ObjectColumns,
    o: int,
    squares: Squares,
    circles: CircleColumns,
    c: int,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> None:
    """Create a new object from a circle."""
    give_birth(objects, o, settings, ids)
    left, right = squares.parts.left[c], squares.parts.right[c]
    top, bottom = squares.parts.top[c], squares.parts.bottom[c]
    objects.x[o], objects.width[o] = 0.5 * (left + right), right - left
    objects.y[o], objects.height[o] = 0.5 * (top + bottom), bottom - top
    circles.square[c] = o
    group_motion.clear(squares.wholes, o)
    group_motion.add(squares.wholes, o, squares.parts, c)
    observe(objects, o, squares.wholes, around)


def found_in_turmoil(
    objects: ObjectColumns, o: int, circles: CircleColumns, c: int, around: Situation, settings: Settings, ids: Ids
) -> None:
    """Create a new object from a circle in turmoil."""
    give_birth(objects, o, settings, ids)
    circles.square[c] = o
    take_place(objects, o, circles, c, around)


def take_place(objects: ObjectColumns, o: int, circles: CircleColumns, c: int, around: Situation) -> None:
    """Set an object to a circle in turmoil: its box is known, its motion and range are not."""
    objects.x[o], objects.y[o] = circles.x[c], circles.y[c]
    objects.width[o], objects.height[o] = circles.width[c], circles.height[c]
    objects.middle[o] = objects.middle_sigma[o] = objects.foot[o] = NAN
    objects.looming[o] = objects.sideways[o] = objects.mq[o] = 0.0
    objects.mm[o] = objects.qq[o] = TURMOIL_HZ * TURMOIL_HZ
    objects.reference[o] = around.speed_mps
    speed_change.forget(objects, o)


def forget_motion(objects: ObjectColumns, o: int) -> None:
    """Reset an object's motion to unknown."""
    objects.looming[o] = objects.sideways[o] = objects.mq[o] = 0.0
    objects.mm[o] = objects.qq[o] = INFINITY
    objects.reference[o] = NAN
    speed_change.forget(objects, o)


def gather(
    objects: ObjectColumns,
    squares: Squares,
    circles: CircleColumns,
    edges: EdgeColumns,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> int:
    """Assign each circle without an object to one, or create a new one; returns how many objects were evicted."""
    evicted = 0
    for c in range(circles.capacity):
        in_turmoil = turmoil.is_shown_by(circles, c)
        if not circles.active[c] or circles.square[c] >= 0:
            continue
        if squares.parts.count[c] < MIN_EDGES and not in_turmoil:
            continue
        if in_turmoil:
            o = object_in_turmoil(objects, circles, c)
        else:
            o = nearest_object(objects, squares, circles, c, around, settings)
        if o >= 0:
            circles.square[c] = o
        elif circles.trust[c] >= settings.tr_s and (in_turmoil or not group_motion.is_ground(squares.parts, c, around)):
            o = free_row(objects)
            if o < 0:
                evicted += 1
                o = row_to_spare(objects, settings)
                if o < 0:
                    continue
                leave(circles, o, -1)
                hand_over(edges, o, -1)
            if in_turmoil:
                found_in_turmoil(objects, o, circles, c, around, settings, ids)
            else:
                found(objects, o, squares, circles, c, around, settings, ids)
    return evicted


def leave(circles: CircleColumns, o: int, to: int) -> None:
    """Reassign the circles of an object to another one; -1: to none."""
    for c in range(circles.capacity):
        if circles.square[c] == o:
            circles.square[c] = to


def hand_over(edges: EdgeColumns, o: int, to: int) -> None:
    """Reassign the edges of an object to another one; -1: to none."""
    for i in range(edges.count):
        if edges.square[i] == o:
            edges.square[i] = to


def belong_together(
    objects: ObjectColumns,
    a: int,
    b: int,
    squares: Squares,
    circles: CircleColumns,
    around: Situation,
    settings: Settings,
) -> bool:
    """Whether every measured circle of one object could be a part of the other, and vice versa; one at least."""
    measured = False
    for c in range(circles.capacity):
        o = circles.square[c]
        if squares.parts.count[c] < MIN_EDGES or o not in (a, b):
            continue
        if not belongs(objects, b if o == a else a, circles, c, squares.parts, around, settings):
            return False
        measured = True
    return measured


def unite(
    objects: ObjectColumns,
    squares: Squares,
    circles: CircleColumns,
    edges: EdgeColumns,
    around: Situation,
    settings: Settings,
) -> None:
    """Merge objects that turn out to be one, the younger into the older."""
    for a in range(objects.capacity):
        for b in range(objects.capacity):
            if a == b or not objects.active[a] or not objects.active[b]:
                continue
            if objects.age_s[a] < objects.age_s[b] or (objects.age_s[a] == objects.age_s[b] and a > b):
                continue
            if objects.unseen_s[a] > 0 or objects.unseen_s[b] > 0:
                continue
            if belong_together(objects, a, b, squares, circles, around, settings):
                leave(circles, b, a)
                hand_over(edges, b, a)
                objects.active[b] = 0


# Measurement


def update_rate(
    objects: ObjectColumns, o: int, h_m: float, h_q: float, value: float, variance: float, speed_mps: float
) -> None:
    """Kalman update by a measurement of h_m·m + h_q·q; outliers are down-weighted.

    ``speed_mps``: V at which it was made. m is linear in V, so its mean belongs to the mean of V. A new object must be
    given a measurement of m first (1, 0), then one of q (across, 1).
    """
    if not math.isfinite(objects.mm[o]):
        objects.looming[o], objects.mm[o], objects.reference[o] = value, variance, speed_mps
        return
    if not math.isfinite(objects.qq[o]):
        objects.sideways[o] = value - h_m * objects.looming[o]
        objects.qq[o] = variance + h_m * h_m * objects.mm[o]
        objects.mq[o] = -h_m * objects.mm[o]
        return
    p_m = h_m * objects.mm[o] + h_q * objects.mq[o]
    p_q = h_m * objects.mq[o] + h_q * objects.qq[o]
    expected = h_m * p_m + h_q * p_q
    news = value - h_m * objects.looming[o] - h_q * objects.sideways[o]
    surprise = news * news / (expected + variance) / (NEWS_SIGMAS * NEWS_SIGMAS)
    total = expected + variance * max(surprise, 1.0)
    objects.looming[o] += p_m / total * news
    objects.reference[o] += p_m / total * h_m * (speed_mps - objects.reference[o])
    objects.sideways[o] += p_q / total * news
    objects.mm[o] -= p_m * p_m / total
    objects.mq[o] -= p_m * p_q / total
    objects.qq[o] -= p_q * p_q / total


def observe(objects: ObjectColumns, o: int, wholes: MotionSums, around: Situation) -> None:
    """Update m and q from the motion of all edges of an object, propagated from the middle of their window to now.

    m remains that at the mean speed over the window. Windows of successive frames overlap, so each measurement is
    given less weight.
    """
    weight = wholes.weight[o]
    fx = around.pinhole.fx
    x, y = wholes.x[o] / weight, wholes.y[o] / weight
    focus_x, focus_y = wholes.focus_x[o] / weight, wholes.focus_y[o] / weight
    elapsed_s, common = wholes.elapsed[o] / weight, wholes.common[o] / weight
    repeated = NOISE_GAIN * NOISE_GAIN
    if math.isfinite(objects.mm[o]):
        repeated *= max(elapsed_s / around.dt_s, 1.0)
    group_motion.fit_expansion(wholes, o)
    rate, variance = wholes.expansion, 1 / wholes.spread
    below = y - focus_y
    if math.fabs(below) > 1:
        # motion on the ground expands about the horizon
        vertical = wholes.vy[o] / weight / below
        vertical_var = (1 / weight + common * common) / (below * below)
        rate = (rate * vertical_var + vertical * variance) / (vertical_var + variance)
        variance = variance * vertical_var / (vertical_var + variance)
    lag = 1 - min(max(0.5 * elapsed_s * rate, -MAX_LAG), MAX_LAG)
    speed_mps = wholes.forward[o] / weight if math.isfinite(around.speed_mps) else NAN
    update_rate(objects, o, 1.0, 0.0, rate / lag, repeated * variance / (lag * lag), speed_mps)
    speed_change.observe(objects, o, rate / lag, repeated * variance / (lag * lag), speed_mps)
    across = (x - focus_x) / fx
    aside = wholes.vx[o] / weight / fx
    aside_var = (1 / weight + common * common) / (fx * fx)
    update_rate(objects, o, across, 1.0, aside / lag, repeated * aside_var / (lag * lag), speed_mps)


def show(objects: ObjectColumns, o: int, wholes: MotionSums, around: Situation) -> None:
    """Update an object's box from all of its edges."""
    left, right = wholes.left[o] - EDGE_PX, wholes.right[o] + EDGE_PX
    fit(objects, o, left, right, wholes.top[o] - EDGE_PX, wholes.bottom[o] + EDGE_PX, around)


def fit(
    objects: ObjectColumns, o: int, left: float, right: float, top: float, bottom: float, around: Situation
) -> None:
    """Move an object's box towards the given sides: it grows fast and shrinks slowly."""
    half_width, half_height = 0.5 * objects.width[o], 0.5 * objects.height[o]
    left = follow(objects.x[o] - half_width, left, -1.0, around)
    right = follow(objects.x[o] + half_width, right, 1.0, around)
    top = follow(objects.y[o] - half_height, top, -1.0, around)
    bottom = follow(objects.y[o] + half_height, bottom, 1.0, around)
    objects.x[o], objects.width[o] = 0.5 * (left + right), right - left
    objects.y[o], objects.height[o] = 0.5 * (top + bottom), bottom - top


def follow(side: float, shown: float, outwards: float, around: Situation) -> float:
    """Returns a side of a box, px, low-pass filtered towards ``shown``. ``outwards``: 1 or -1."""
    time_s = GROWS_S if (shown - side) * outwards > 0 else SHRINKS_S
    return side + (1 - math.exp(-around.dt_s / time_s)) * (shown - side)


# Belief


def collect_evidence(evidence: Evidence, objects: ObjectColumns, o: int, plane: ImagePlane, around: Situation) -> None:
    """Set the evidence of an object, in angles, and update its foot."""
    fx, fy = around.pinhole.fx, around.pinhole.fy
    evidence.looming, evidence.sideways = objects.looming[o], objects.sideways[o]
    whole = lengths.of(BODY_SHARE * evidence.looming, BODY_HZ)
    evidence.mm, evidence.mq = objects.mm[o] + whole * whole, objects.mq[o]
    whole = lengths.of(SWING_SHARE * evidence.sideways, SWING_HZ)
    evidence.qq = objects.qq[o] + whole * whole
    evidence.across = (objects.x[o] - around.focus_x) / fx
    evidence.half_width = 0.5 * objects.width[o] / fx
    evidence.half_extent = max(evidence.half_width, 0.5 * objects.height[o] / fy)
    evidence.across_sigma = 0.5 * evidence.half_width
    bottom = objects.y[o] + 0.5 * objects.height[o]
    if around.camera_height_m > 0:
        per_m = fy * around.camera_height_m
        shown = (bottom - around.horizon_y) / per_m
        if not objects.foot[o] > shown:
            objects.foot[o] = shown
        else:
            low = around.horizon_y + objects.foot[o] * per_m + BORDER_PX
            time_s = FOOT_S if image_plane.project(plane, around.focus_x, low) else FOOT_BELOW_S
            objects.foot[o] += (1 - math.exp(-around.dt_s / time_s)) * (shown - objects.foot[o])
        evidence.foot = objects.foot[o]
        bottom = around.horizon_y + evidence.foot * per_m
        evidence.hidden = range_belief.HIDDEN_FOOT
        if not image_plane.project(plane, around.focus_x, bottom + CUT_SHARE * objects.height[o]):
            evidence.hidden = CUT_HIDES
        evidence.foot_sigma = math.sqrt(around.pitch_sigma_rad * around.pitch_sigma_rad + FOOT_PX * FOOT_PX / fy / fy)
        evidence.foot_sigma /= around.camera_height_m
    evidence.is_cut = not image_plane.project(plane, around.focus_x, bottom + BORDER_PX)
    evidence.reference = objects.reference[o]
    evidence.inverse, evidence.inverse_var = objects.inverse[o], objects.inverse_var[o]
    evidence.range_before, evidence.range_doubt = objects.middle[o], objects.middle_sigma[o]
    kept = math.exp(-around.dt_s / PERSISTS_S)
    evidence.log_odds = min(max(kept * objects.log_odds[o], -MAX_ODDS), MAX_ODDS)


def believe(objects: ObjectColumns, o: int, belief: Belief, evidence: Evidence, around: Situation) -> None:
    """Set the object's range, motion, risk and class from the belief."""
    objects.log_odds[o] = belief.log_odds
    objects.middle[o], objects.middle_sigma[o] = belief.middle, belief.middle_sigma
    objects.range[o], objects.range_sigma[o] = belief.mean[range_belief.RANGE], belief.sigma[range_belief.RANGE]
    objects.forward[o], objects.forward_sigma[o] = belief.mean[range_belief.FORWARD], belief.sigma[range_belief.FORWARD]
    objects.right[o], objects.right_sigma[o] = belief.mean[range_belief.RIGHT], belief.sigma[range_belief.RIGHT]
    objects.closest[o], objects.closest_sigma[o] = belief.mean[range_belief.CLOSEST], belief.sigma[range_belief.CLOSEST]
    objects.lateral[o], objects.lateral_sigma[o] = belief.mean[range_belief.LATERAL], belief.sigma[range_belief.LATERAL]
    objects.probability[o] = belief.met
    if objects.range[o] > MAX_RANGE_M:
        objects.range[o] = objects.range_sigma[o] = NAN
    if math.fabs(objects.lateral[o]) > MAX_RANGE_M:
        objects.lateral[o] = objects.lateral_sigma[o] = NAN
    set_contact(objects, o, belief.mean[range_belief.RATE], belief.sigma[range_belief.RATE], around)
    objects.class_id[o] = class_of(objects, o, belief, evidence)


def set_contact(objects: ObjectColumns, o: int, rate: float, sigma: float, around: Situation) -> None:
    """Set the time to contact from its inverse, 1/s; none where the looming is not above its noise."""
    if rate > RATE_SIGMAS * sigma and rate * range_belief.MAX_HORIZONS * around.horizon_s > 1:
        objects.ttc[o], objects.ttc_sigma[o] = 1 / rate, sigma / (rate * rate)
    else:
        objects.ttc[o], objects.ttc_sigma[o] = INFINITY, NAN


def class_of(objects: ObjectColumns, o: int, belief: Belief, evidence: Evidence) -> int:
    """Returns the class of an object by its motion over ground."""
    if belief.stands > EVEN:
        return STANDING
    forward, right = objects.forward[o], objects.right[o]
    goes_on = math.fabs(forward) > max(MOVES_SIGMAS * objects.forward_sigma[o], SLOW_MPS)
    goes_aside = math.fabs(right) > max(MOVES_SIGMAS * objects.right_sigma[o], SLOW_MPS)
    if goes_aside and (not goes_on or math.fabs(right) >= math.fabs(forward)):
        return CROSSING
    if not goes_on:
        return UNKNOWN
    if forward < 0:
        return ONCOMING
    into_path = goes_aside and right * evidence.across < 0 and math.fabs(right) > INTO_PATH * forward
    return CUTTING_IN if into_path else LEADING


def rests(objects: ObjectColumns, o: int, around: Situation) -> bool:
    """Whether neither an object nor the vehicle moves; the image then holds no new information about its range."""
    if not situation.is_at_rest(around) or objects.log_odds[o] < 0 or not objects.range[o] > 0:
        return False
    return math.fabs(objects.looming[o]) < STILL_HZ and math.fabs(objects.sideways[o]) < STILL_HZ


def coast(objects: ObjectColumns, o: int, evidence: Evidence, around: Situation) -> None:
    """Derive an object's numbers from its last position and velocity; unseen, they become more uncertain."""
    drift_mps = UNSEEN_MPS * math.sqrt(around.dt_s) if objects.unseen_s[o] > 0 else 0.0
    objects.forward_sigma[o] = lengths.of(objects.forward_sigma[o], drift_mps)
    objects.right_sigma[o] = lengths.of(objects.right_sigma[o], drift_mps)
    range_m, closing_mps = objects.range[o], around.speed_mps - objects.forward[o]
    right_mps = objects.right[o]
    if objects.unseen_s[o] > 0:
        objects.range_sigma[o] = lengths.of(objects.range_sigma[o], objects.forward_sigma[o] * around.dt_s)
    share = lengths.of(objects.range_sigma[o] / range_m, objects.forward_sigma[o] / max(closing_mps, SLOW_MPS))
    objects.probability[o] = 0.0
    objects.lateral[o] = objects.lateral_sigma[o] = objects.closest[o] = objects.closest_sigma[o] = NAN
    set_contact(objects, o, closing_mps / range_m, share * math.fabs(closing_mps) / range_m, around)
    if not math.isfinite(objects.ttc[o]):
        return
    time_s, time_sigma_s = objects.ttc[o], objects.ttc_sigma[o]
    objects.closest[o], objects.closest_sigma[o] = time_s, time_sigma_s
    right_m = range_m * evidence.across + right_mps * time_s
    objects.lateral[o] = path.miss(right_m, range_m + objects.forward[o] * time_s, around)
    aside = lengths.of(range_m * evidence.across_sigma, evidence.across * objects.range_sigma[o])
    late = lengths.of(objects.right_sigma[o] * time_s, right_mps * time_sigma_s)
    objects.lateral_sigma[o] = lengths.of(aside, late)
    half_m = around.half_width_m + evidence.half_width * range_m
    variance = objects.lateral_sigma[o] * objects.lateral_sigma[o]
    beside = range_belief.below(half_m, objects.lateral[o], variance)
    beside -= range_belief.below(-half_m, objects.lateral[o], variance)
    soon = range_belief.below(around.horizon_s, time_s, time_sigma_s * time_sigma_s)
    objects.probability[o] = beside * soon


def believe_without_speed(objects: ObjectColumns, o: int, evidence: Evidence, around: Situation) -> None:
    """Set an object's numbers without the vehicle's speed: time to contact from looming, range from the foot."""
    objects.middle[o] = objects.middle_sigma[o] = objects.range[o] = objects.range_sigma[o] = NAN
    objects.lateral[o] = objects.lateral_sigma[o] = NAN
    objects.forward[o] = objects.forward_sigma[o] = objects.right[o] = objects.right_sigma[o] = NAN
    objects.closest[o] = objects.closest_sigma[o] = NAN
    objects.class_id[o] = UNKNOWN
    sigma = math.sqrt(evidence.mm)
    set_contact(objects, o, evidence.looming, sigma, around)
    beside = EVEN
    if around.camera_height_m > 0 and evidence.foot > 2 * evidence.foot_sigma and not evidence.is_cut:
        range_m = 1 / evidence.foot
        objects.range[o], objects.range_sigma[o] = range_m, range_m * range_m * evidence.foot_sigma
        objects.right[o], objects.right_sigma[o] = evidence.sideways * range_m, math.sqrt(evidence.qq) * range_m
        if math.isfinite(objects.ttc[o]):
            time_s = objects.ttc[o]
            objects.lateral[o] = range_m * (evidence.across + evidence.sideways * time_s)
            lateral_var = range_m * range_m * time_s * time_s * evidence.qq
            objects.lateral_sigma[o] = math.sqrt(lateral_var)
            half_m = around.half_width_m + evidence.half_width * range_m
            beside = range_belief.below(half_m, objects.lateral[o], lateral_var)
            beside -= range_belief.below(-half_m, objects.lateral[o], lateral_var)
    soon = 1 - range_belief.below(1 / around.horizon_s, evidence.looming, evidence.mm)
    objects.probability[o] = beside * soon


# Lifetime


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


def object_in_place_of(objects: ObjectColumns, o: int) -> int:
    """Returns the object that is seen, by more than a few edges, in the place of an unseen one; -1: none.

    Somebody who stops or turns at once breaks the motion of his object, and another one is founded on him. Two things
    cannot be in one place, so they are one.
    """
    for other in range(objects.capacity):
        if other == o or not objects.active[other] or objects.unseen_s[other] > 0:
            continue
        if objects.support[other] < SURE_EDGES:
            continue
        apart_m = math.fabs(objects.range[o] - objects.range[other])
        if not apart_m < min(lengths.of(objects.range_sigma[o], objects.range_sigma[other]), SAME_PLACE_M):
            continue
        across = math.fabs(objects.x[o] - objects.x[other]) < 0.5 * objects.width[other]
        if across and math.fabs(objects.y[o] - objects.y[other]) < 0.5 * objects.height[other]:
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
    way_px = velocity_x(objects, o, objects.x[o], looming_at(objects, o, around.speed_mps), around) * LEAVES_S
    return image_plane.project(plane, objects.x[o] + way_px, objects.y[o])


def near_s(objects: ObjectColumns, o: int, around: Situation) -> float:
    """Returns for how long an object lost nearby is kept, s: until the vehicle is there."""
    if not math.isfinite(around.speed_mps):
        return NEAR_S
    return min(max(objects.range[o] / max(math.fabs(around.speed_mps), SLOW_MPS), NEAR_S), LINGERS_S)


def is_met_soon(objects: ObjectColumns, o: int, settings: Settings) -> bool:
    """Whether a well trusted object farther than ``NEAR_M`` will probably be met within ``SOON_S``.

    Only what is large in the image grows so fast that its corners are lost, and not what something nearer hides.
    """
    is_large = max(objects.width[o], objects.height[o]) > settings.min_coast_px
    is_soon = objects.range[o] >= NEAR_M and objects.ttc[o] < SOON_S
    is_trusted = objects.trust[o] >= settings.tr_coast and objects.state[o] != HIDDEN
    return is_trusted and is_large and is_soon and objects.probability[o] > EVEN


def go_on(
    objects: ObjectColumns, o: int, edges: EdgeColumns, plane: ImagePlane, around: Situation, settings: Settings
) -> None:
    """Keep an object without edges in this frame as hidden or coasting; in the end, delete it.

    It is kept for longer where missing edges are expected: stationary before a stationary vehicle, very near, or out
    of view.
    """
    objects.unseen_s[o] += around.dt_s
    by = object_in_place_of(objects, o)
    if by >= 0:
        take_over(objects, o, by)
        return
    hidden = is_behind(objects, o)
    objects.state[o] = HIDDEN if hidden else COASTING
    patience_s = HIDDEN_S if hidden else COAST_S
    if objects.unseen_s[o] <= COAST_S and not is_in_image(objects, o, objects.x[o], plane):
        objects.left[o] = 1
    if not is_in_sight(objects, o, plane) or (objects.left[o] and not comes(objects, o, around)):
        patience_s = outside_s(objects, o, around)
    elif lingers(objects, o, around):
        patience_s = RESTING_S if is_seen_through(objects, o, edges) else LINGERS_S
    elif math.fabs(around.speed_mps) < SLOW_MPS and objects.log_odds[o] > 0:
        patience_s = RESTING_S
    elif is_met_soon(objects, o, settings):
        patience_s = LINGERS_S
    elif objects.range[o] < NEAR_M:
        patience_s = near_s(objects, o, around)
    if objects.unseen_s[o] > patience_s:
        objects.trust[o] -= around.dt_s * LOSES_HZ
    if objects.trust[o] < settings.tr_cr:
        objects.active[o] = 0


def go_on_in_turmoil(
    objects: ObjectColumns, o: int, circles: CircleColumns, around: Situation, settings: Settings
) -> bool:
    """Update an object without edges from its circle in turmoil; returns whether it has one.

    It keeps the motion that its edges last showed until contact would occur: beyond that the looming is unbounded, and
    what is seen there must move differently.
    """
    for c in range(circles.capacity):
        if turmoil.is_shown_by(circles, c) and circles.square[c] == o and circles.unseen_s[c] == 0:
            objects.unseen_s[o], objects.state[o], objects.left[o] = 0.0, SEEN, 0
            objects.support[o] = circles.support[c]
            objects.trust[o] = edge_equations.change_trust(objects.trust[o], 1.0, settings.tr_max)
            if objects.looming[o] * around.dt_s > MAX_LAG:
                take_place(objects, o, circles, c, around)
                return True
            half_width, half_height = 0.5 * circles.width[c], 0.5 * circles.height[c]
            left, right = circles.x[c] - half_width, circles.x[c] + half_width
            fit(objects, o, left, right, circles.y[c] - half_height, circles.y[c] + half_height, around)
            return True
    return False


def obeys(
    objects: ObjectColumns,
    o: int,
    verdicts: Verdicts,
    j: int,
    edges: EdgeColumns,
    baselines: Baselines,
    share: float,
    around: Situation,
) -> bool:
    """Whether an edge moves as its position on the object would, within noise and a share of its speed."""
    i = verdicts.row[j]
    elapsed_s = baselines.elapsed_s[verdicts.slot[j]]
    speed_mps = baselines.depth_m[verdicts.slot[j]] / elapsed_s
    x, y = 0.5 * (edges.x[i] + verdicts.x[j]), 0.5 * (edges.y[i] + verdicts.y[j])
    looming = looming_at(objects, o, speed_mps)
    lag = 1 - min(max(0.5 * elapsed_s * looming, -MAX_LAG), MAX_LAG)
    vx, vy = velocity_x(objects, o, x, looming, around) * lag, velocity_y(y, looming, around) * lag
    dx, dy = (edges.x[i] - verdicts.x[j]) / elapsed_s - vx, (edges.y[i] - verdicts.y[j]) / elapsed_s - vy
    most = STRAY_SIGMAS * verdicts.noise[j] / elapsed_s + share * lengths.of(vx, vy)
    return dx * dx + dy * dy < most * most


def set_reach(bounds: MotionSums, wholes: MotionSums, o: int) -> None:
    """Set the bounds within which edges may join an object."""
    bounds.count[o] = wholes.count[o]
    if wholes.count[o] < MIN_EDGES:
        return
    side = SIDE_REACH * (wholes.right[o] - wholes.left[o])
    stack = STACK_REACH * (wholes.bottom[o] - wholes.top[o])
    bounds.left[o], bounds.right[o] = wholes.left[o] - side, wholes.right[o] + side
    bounds.top[o], bounds.bottom[o] = wholes.top[o] - stack, wholes.bottom[o] + stack


def is_in_reach(bounds: MotionSums, o: int, x: float, y: float) -> bool:
    """Whether a point is inside the bounds of an object."""
    if bounds.count[o] < MIN_EDGES or x < bounds.left[o] or x > bounds.right[o]:
        return False
    return y >= bounds.top[o] and y <= bounds.bottom[o]


def still_px(verdicts: Verdicts, j: int) -> float:
    """Returns by how much an edge's motion deviates from that of a stationary point at any depth, px."""
    return max(math.fabs(verdicts.drift[j]), verdicts.short[j], verdicts.over[j])


def take_others(
    objects: ObjectColumns,
    squares: Squares,
    verdicts: Verdicts,
    edges: EdgeColumns,
    baselines: Baselines,
    around: Situation,
) -> None:
    """Let edges that are no rebels join the object that they are near to and move with.

    Feet on the ground, for instance, hardly break the flow. Those that do not move as stationary points become members
    of the object; the others, only inside the box of its members, count for this frame.
    """
    shown = 0
    for o in range(objects.capacity):
        set_reach(squares.bounds, squares.wholes, o)
        shown += squares.wholes.count[o]
    if shown == 0:
        return
    for j in range(verdicts.count):
        i = verdicts.row[j]
        if edges.square[i] >= 0:
            continue
        x, y = edges.x[i], edges.y[i]
        moves = still_px(verdicts, j) > STRAY_SIGMAS * verdicts.noise[j]
        for o in range(objects.capacity):
            if not (is_in_reach(squares.bounds, o, x, y) if moves else is_in_reach(squares.wholes, o, x, y)):
                continue
            if obeys(objects, o, verdicts, j, edges, baselines, JOIN_SHARE, around):
                group_motion.add_edge(squares.wholes, o, verdicts, j, edges, baselines, around)
                if moves:
                    edges.square[i] = o
                break


def square_of(objects: ObjectColumns, circles: CircleColumns, edges: EdgeColumns, i: int) -> int:
    """Returns the object that an edge belongs to, by its circle or as before; -1: none.

    An edge far outside the object's box was left behind, on the background, and no longer belongs to it.
    """
    if edges.rebel[i] and edges.circle[i] >= 0 and circles.square[edges.circle[i]] >= 0:
        return circles.square[edges.circle[i]]
    o = edges.square[i]
    if o < 0:
        return -1
    beside = math.fabs(edges.x[i] - objects.x[o]) > objects.width[o]
    return -1 if beside or math.fabs(edges.y[i] - objects.y[o]) > objects.height[o] else o


def count_members(
    objects: ObjectColumns,
    squares: Squares,
    circles: CircleColumns,
    verdicts: Verdicts,
    edges: EdgeColumns,
    baselines: Baselines,
    around: Situation,
) -> None:
    """Count the edges of each object; ``ALL`` where most of them contradict its predicted motion."""
    for o in range(objects.capacity):
        group_motion.clear(squares.wholes, o)
        squares.members[o] = squares.resting[o] = 0
    for i in range(edges.count):
        edges.square[i] = o = square_of(objects, circles, edges, i)
        if o >= 0 and edges.matched[i] and situation.is_at_rest(around):
            squares.resting[o] += 1
    for j in range(verdicts.count):
        o = edges.square[verdicts.row[j]]
        if o >= 0:
            squares.members[o] += 1
            share = STRAY_SHARE if edges.rebel[verdicts.row[j]] else JOIN_SHARE
            squares.obedient[j] = 1 if obeys(objects, o, verdicts, j, edges, baselines, share, around) else 0
            squares.wholes.count[o] += squares.obedient[j]
    for o in range(objects.capacity):
        if squares.wholes.count[o] < MIN_EDGES or 2 * squares.wholes.count[o] < squares.members[o]:
            squares.members[o] = ALL
        squares.wholes.count[o] = 0


def take_members(
    objects: ObjectColumns,
    squares: Squares,
    circles: CircleColumns,
    verdicts: Verdicts,
    edges: EdgeColumns,
    coarse: CoarseMotion,
    coarse_groups: CoarseGroups,
    baselines: Baselines,
    around: Situation,
) -> None:
    """Measure each object's motion from its edges, and drop those that move differently from most.

    The pieces of the body ahead count as well.
    """
    count_members(objects, squares, circles, verdicts, edges, baselines, around)
    for j in range(verdicts.count):
        i = verdicts.row[j]
        o = edges.square[i]
        if o < 0:
            continue
        if squares.members[o] == ALL or squares.obedient[j]:
            group_motion.add_edge(squares.wholes, o, verdicts, j, edges, baselines, around)
        else:
            edges.square[i] = -1
    for p in range(coarse.columns * coarse.rows):
        c = coarse_groups.circle[p]
        if c >= 0 and coarse.contact_s[p] > 0 and circles.square[c] >= 0:
            group_motion.add_piece(squares.wholes, circles.square[c], coarse, p, around)
    for c in range(circles.capacity):
        o = circles.square[c]
        if o >= 0 and circles.active[c] and squares.wholes.count[o] < MIN_EDGES:
            group_motion.add(squares.wholes, o, squares.parts, c)  # patches and pieces replace missing edges


def belief_in(objects: ObjectColumns, o: int, wholes: MotionSums, around: Situation, settings: Settings) -> float:
    """Returns the change of trust of an object seen by its edges: slow with few, negative if it moves as the ground."""
    if group_motion.is_ground(wholes, o, around):
        return -1.0
    return 1.0 if wholes.count[o] >= SURE_EDGES or objects.trust[o] < settings.tr_cr else UNSURE


def renew_numbers(
    objects: ObjectColumns, o: int, squares: Squares, unmeasured: bool, plane: ImagePlane, around: Situation
) -> None:
    """Update the numbers of an object from its evidence; if its motion was not measured, by coasting."""
    collect_evidence(squares.evidence, objects, o, plane, around)
    if unmeasured and math.isfinite(objects.forward[o]):
        coast(objects, o, squares.evidence, around)
    elif math.isfinite(around.speed_mps):
        range_belief.consider(squares.belief, squares.evidence, around)
        believe(objects, o, squares.belief, squares.evidence, around)
    else:
        believe_without_speed(objects, o, squares.evidence, around)


def update(
    squares: Squares,
    objects: ObjectColumns,
    circles: CircleColumns,
    verdicts: Verdicts,
    edges: EdgeColumns,
    patches: Patches,
    coarse: CoarseMotion,
    coarse_groups: CoarseGroups,
    baselines: Baselines,
    plane: ImagePlane,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> int:
    """Update S from C_r; returns evictions."""
    for i in range(edges.count):
        if edges.square[i] >= 0 and not objects.active[edges.square[i]]:
            edges.square[i] = -1  # before its row is used again
    measure_circles(squares.parts, circles, verdicts, edges, patches, coarse, coarse_groups, baselines, around)
    keep_members(objects, squares, circles, around, settings)
    evicted = gather(objects, squares, circles, edges, around, settings, ids)
    unite(objects, squares, circles, edges, around, settings)
    take_members(objects, squares, circles, verdicts, edges, coarse, coarse_groups, baselines, around)
    take_others(objects, squares, verdicts, edges, baselines, around)
    for o in range(objects.capacity):
        if not objects.active[o]:
            continue
        count = squares.wholes.count[o]
        remnant = False
        if count >= MIN_EDGES:
            objects.recent_edges[o] = max(objects.recent_edges[o] * math.exp(-around.dt_s / RECENT_S), count)
            remnant = is_remnant(objects, o, count, plane, around)
            objects.unseen_s[o], objects.state[o], objects.left[o] = 0.0, SEEN, 0
            objects.support[o] = count
            believed = belief_in(objects, o, squares.wholes, around, settings)
            objects.trust[o] = edge_equations.change_trust(objects.trust[o], believed, settings.tr_max)
            if objects.trust[o] < settings.tr_cr and objects.age_s[o] > 0:
                objects.active[o] = 0
                continue
            if not remnant:
                show(objects, o, squares.wholes, around)
                if objects.age_s[o] == 0:
                    forget_motion(objects, o)
                observe(objects, o, squares.wholes, around)
        elif squares.resting[o] >= MIN_EDGES:
            objects.unseen_s[o], objects.state[o], objects.left[o] = 0.0, SEEN, 0
            objects.looming[o] = objects.sideways[o] = 0.0
            objects.reference[o] = around.speed_mps
        elif not go_on_in_turmoil(objects, o, circles, around, settings):
            go_on(objects, o, edges, plane, around, settings)
            if not objects.active[o]:
                continue
        renew_numbers(
            objects, o, squares, remnant or objects.unseen_s[o] > 0 or rests(objects, o, around), plane, around
        )
    return evicted
