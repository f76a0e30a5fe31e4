"""Square expert, S: circles of one thing are an object, with its range and motion, and their uncertainty.

The third layer (Tafrishi, Dai & Kandjani 2021). Rebel circles join a nearby object of the same motion; the rest found
new ones. Objects keep their identity while they are occluded, or not seen for a short time.
"""

import math

from lcf_edge.filter import circles as shared
from lcf_edge.filter import (
    edge_equations,
    group_motion,
    lengths,
    object_belief,
    object_prediction,
    range_belief,
    rebel_detection,
    situation,
    speed_change,
    turmoil,
)
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.coarse_circles import CoarseGroups
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.columns import CircleColumns, EdgeColumns, ObjectColumns
from lcf_edge.filter.group_motion import MotionSums
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.memory import doubles, integers, octets
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
INNER_SHARE = 0.4  # of its width, from its middle: there it hides the ground, if that is seen beneath it
GROUND_SIGMAS = 2.5  # by which an edge of the ground may differ from it, plus
GROUND_SHARE = 0.25  # this share of its motion: pitch and height of the camera are known no better
MAX_BENEATH = 128  # edges by which an object is told from the ground beneath it
ALL = -1  # all edges of an object measure its motion
NOISE_GAIN = 1.7  # corners wander more than their noise suggests: they are not fixed points of the object
NEWS_SIGMAS = 4.0  # beyond this an innovation is an outlier and is down-weighted
GROWS_S = 0.07  # time constant with which a side of a box moves outwards,
SHRINKS_S = 0.3  # and inwards
TURMOIL_HZ = 1.0  # 1 sigma of m and q where no motion can be tracked
FRAMES_UNREPORTED = 2.0  # of a new object
UNSURE = 0.25  # trust gained per frame, instead of 1, with fewer edges than ``object_prediction.SURE_EDGES``
RECENT_S = 3.0  # time constant with which the number of an object's recent edges decays
UNKNOWN, SEEN = int(ObjectClass.UNKNOWN), int(ObjectState.SEEN)
INFINITY = float("inf")
NAN = float("nan")


class Squares:
    """Scratch memory of one frame.

    ``parts``: the motion of each circle; ``odd``: whether it is not that of its object; ``agreeing``: how many circles
    of each object move as it does; ``wholes``: the motion of each object; ``members``: its edges; ``resting``: those of
    them that are matched while the vehicle is at rest; ``through``: of other edges that are then seen in its middle;
    ``bounds``: within which edges may join it. ``obedient``: whether the edge of a verdict moves as its object does.
    ``rows``, px, and ``sides``, 1: of the object, -1: of the ground, of the edges that show where it ends.
    """

    def __init__(self, circles: int, objects: int, edges: int) -> None:
        self.parts, self.wholes, self.bounds = MotionSums(circles), MotionSums(objects), MotionSums(objects)
        self.agreeing, self.members, self.resting, self.through = [integers(objects) for _ in range(4)]
        self.odd, self.obedient = octets(circles), octets(edges)
        self.rows, self.sides = doubles(MAX_BENEATH), integers(MAX_BENEATH)
        self.evidence, self.belief = Evidence(), Belief()


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
    if is_beside(objects, o, circles, c, settings):
        return moves_alike(objects, o, parts, c, LIKE_SHARE, around, settings)
    width = max(objects.width[o], circles.width[c])
    if is_within(objects, o, circles, c, WIDE_GAP * width, TOWER_GAP * extent_of(objects, o, circles, c)):
        return is_moving(parts, c, settings) and moves_alike(objects, o, parts, c, VERY_LIKE_SHARE, around, settings)
    return False


def extent_of(objects: ObjectColumns, o: int, circles: CircleColumns, c: int) -> float:
    """Returns the larger extent of an object and a circle, px."""
    return max(objects.width[o], circles.width[c], objects.height[o], circles.height[c])


def is_within(objects: ObjectColumns, o: int, circles: CircleColumns, c: int, side_px: float, stack_px: float) -> bool:
    """Whether the boxes of an object and a circle are less than this apart."""
    side = math.fabs(objects.x[o] - circles.x[c]) - 0.5 * (objects.width[o] + circles.width[c])
    stack = math.fabs(objects.y[o] - circles.y[c]) - 0.5 * (objects.height[o] + circles.height[c])
    return side < side_px and stack < stack_px


def is_beside(objects: ObjectColumns, o: int, circles: CircleColumns, c: int, settings: Settings) -> bool:
    """Whether a circle is as near to an object as circles of one thing are."""
    near_px, extent = settings.rebel_link_px, extent_of(objects, o, circles, c)
    return is_within(objects, o, circles, c, max(near_px, SIDE_GAP * extent), max(near_px, STACK_GAP * extent))


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
    looming = object_prediction.looming_at(objects, o, parts.forward[c] / weight)
    dx = vx - object_prediction.velocity_x(objects, o, x, looming, around)
    dy = vy - object_prediction.velocity_y(y, looming, around)
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


def shows_object(parts: MotionSums, c: int, around: Situation, settings: Settings) -> bool:
    """Whether a circle is no part of the ground and, before a vehicle at rest, moves or expands now.

    Edges that seem to have fallen short of the flow, since the vehicle was at rest earlier than it knew, do not.
    """
    if group_motion.is_ground(parts, c, around):
        return False
    if not situation.is_at_rest(around) or is_moving(parts, c, settings):
        return True
    group_motion.fit_expansion(parts, c)
    return math.fabs(parts.expansion) > object_belief.STILL_HZ


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
    """Detach circles that have ended, and those that no longer move as their object does, or are elsewhere.

    If no circle of an object moves as it did, it moves otherwise now, and those that are still near it stay.
    """
    for o in range(objects.capacity):
        squares.agreeing[o] = 0
    for c in range(circles.capacity):
        o = circles.square[c]
        if o >= 0 and (not circles.active[c] or not objects.active[o]):
            circles.square[c] = o = -1
        if o >= 0 and squares.parts.count[c] >= MIN_EDGES:
            agrees = belongs(objects, o, circles, c, squares.parts, around, settings)
            squares.agreeing[o] += agrees
            squares.odd[c] = not agrees
        else:
            squares.odd[c] = 0
    for c in range(circles.capacity):
        o = circles.square[c]
        if squares.odd[c] and (squares.agreeing[o] > 0 or not is_beside(objects, o, circles, c, settings)):
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
    objects.watched[o] = object_prediction.NO_LONGER
    objects.range[o] = objects.middle[o] = objects.middle_sigma[o] = objects.ttc[o] = objects.foot[o] = NAN
    objects.probability[o] = 0.0
    object_prediction.forget_motion(objects, o)


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
            if objects.looming[o] * around.dt_s > object_prediction.MAX_LAG:
                take_place(objects, o, circles, c, around)
                return True
            half_width, half_height = 0.5 * circles.width[c], 0.5 * circles.height[c]
            left, right = circles.x[c] - half_width, circles.x[c] + half_width
            fit(objects, o, left, right, circles.y[c] - half_height, circles.y[c] + half_height, around)
            return True
    return False


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
        elif circles.trust[c] >= settings.tr_s and (in_turmoil or shows_object(squares.parts, c, around, settings)):
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
    lag = 1 - object_prediction.bounded(0.5 * elapsed_s * rate)
    speed_mps = wholes.forward[o] / weight if math.isfinite(around.speed_mps) else NAN
    update_rate(objects, o, 1.0, 0.0, rate / lag, repeated * variance / (lag * lag), speed_mps)
    speed_change.observe(objects, o, rate / lag, repeated * variance / (lag * lag), speed_mps)
    across = (x - focus_x) / fx
    aside = wholes.vx[o] / weight / fx
    aside_var = (1 / weight + common * common) / (fx * fx)
    update_rate(objects, o, across, 1.0, aside / lag, repeated * aside_var / (lag * lag), speed_mps)


def show(objects: ObjectColumns, o: int, wholes: MotionSums, around: Situation) -> None:
    """Update an object's box from all of its edges."""
    left, right = wholes.left[o] - object_prediction.EDGE_PX, wholes.right[o] + object_prediction.EDGE_PX
    fit(
        objects,
        o,
        left,
        right,
        wholes.top[o] - object_prediction.EDGE_PX,
        wholes.bottom[o] + object_prediction.EDGE_PX,
        around,
    )


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


# Edges of an object


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
    looming = object_prediction.looming_at(objects, o, speed_mps)
    lag = 1 - object_prediction.bounded(0.5 * elapsed_s * looming)
    vx = object_prediction.velocity_x(objects, o, x, looming, around) * lag
    vy = object_prediction.velocity_y(y, looming, around) * lag
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
    of the object; the others, only inside the box of its members, count for this frame. Before a vehicle at rest, what
    does not move may as well lie behind the object.
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
        x, y, noise_px = edges.x[i], edges.y[i], STRAY_SIGMAS * verdicts.noise[j]
        if situation.is_at_rest(around) and lengths.of(x - verdicts.x[j], y - verdicts.y[j]) < noise_px:
            continue
        moves = still_px(verdicts, j) > noise_px
        for o in range(objects.capacity):
            if not (is_in_reach(squares.bounds, o, x, y) if moves else is_in_reach(squares.wholes, o, x, y)):
                continue
            if obeys(objects, o, verdicts, j, edges, baselines, JOIN_SHARE, around):
                group_motion.add_edge(squares.wholes, o, verdicts, j, edges, baselines, around)
                if moves:
                    edges.square[i] = o
                break


def see_through(
    objects: ObjectColumns,
    squares: Squares,
    verdicts: Verdicts,
    edges: EdgeColumns,
    baselines: Baselines,
    around: Situation,
) -> None:
    """Count the edges seen in the middle of the box of each object that is not seen, or is before a vehicle at rest.

    Not its own: those that do not move as it does and, before a vehicle at rest, those that have been fixed for
    ``THROUGH_S``.
    """
    at_rest = situation.is_at_rest(around)
    for o in range(objects.capacity):
        squares.through[o] = 0
        if not objects.active[o] or (objects.unseen_s[o] == 0 and not at_rest):
            continue
        if at_rest:
            squares.through[o] = object_prediction.fixed_behind(objects, o, edges)
        for j in range(verdicts.count):
            i = verdicts.row[j]
            other = edges.square[i] != o and edges.fixed_s[i] < object_prediction.THROUGH_S
            if not other or not object_prediction.is_in_middle(objects, o, edges.x[i], edges.y[i]):
                continue
            if not obeys(objects, o, verdicts, j, edges, baselines, JOIN_SHARE, around):
                squares.through[o] += 1


def flows_as_ground(verdicts: Verdicts, j: int, edges: EdgeColumns, baselines: Baselines, around: Situation) -> bool:
    """Whether an edge moves as the ground at its image row."""
    inverse = situation.ground_inverse(around, edges.y[verdicts.row[j]])
    expected = rebel_detection.lever_of(verdicts, j, baselines) * inverse
    most = GROUND_SIGMAS * verdicts.along[j] + GROUND_SHARE * expected
    aside = GROUND_SIGMAS * verdicts.across[j]
    return math.fabs(verdicts.outward[j] - expected) < most and math.fabs(verdicts.drift[j]) < aside


def find_foot(squares: Squares, o: int, listed: int, around: Situation) -> None:
    """Set where an object ends and the ground beneath it begins, by the edges listed: its lowest one there.

    What stands on the ground hides that behind it: as few edges of the ground as possible lie higher than that, and as
    few of the object lower, which lie on the ground where it moves just so.
    """
    foot = -1
    least = listed + 1
    for k in range(listed):
        if squares.sides[k] < 0:
            continue
        wrong = 0
        for n in range(listed):
            if (squares.rows[n] - squares.rows[k]) * squares.sides[n] > 0:
                wrong += 1
        if wrong < least or (wrong == least and squares.rows[k] > squares.rows[foot]):
            foot, least = k, wrong
    if foot < 0:
        return
    squares.wholes.bottom[o] = min(squares.wholes.bottom[o], squares.rows[foot])
    for n in range(listed):
        if squares.sides[n] < 0 and squares.rows[n] > squares.rows[foot]:
            range_belief.see_ground(squares.evidence, situation.ground_inverse(around, squares.rows[n]))


def find_ground(
    objects: ObjectColumns,
    o: int,
    squares: Squares,
    verdicts: Verdicts,
    edges: EdgeColumns,
    baselines: Baselines,
    around: Situation,
) -> None:
    """Find the ground beneath an object, by its edges below the horizon and those of the ground there."""
    squares.evidence.grounds = 0
    if squares.wholes.count[o] < MIN_EDGES or not around.camera_height_m > 0 or not math.isfinite(around.speed_mps):
        return
    listed = 0
    for j in range(verdicts.count):
        i = verdicts.row[j]
        y, aside = edges.y[i], math.fabs(edges.x[i] - objects.x[o])
        if y <= around.horizon_y or listed == MAX_BENEATH:
            continue
        is_own = edges.square[i] == o
        if is_own or (
            aside < INNER_SHARE * objects.width[o]
            and flows_as_ground(verdicts, j, edges, baselines, around)
            and not obeys(objects, o, verdicts, j, edges, baselines, JOIN_SHARE, around)
        ):
            squares.rows[listed], squares.sides[listed] = y, 1 if is_own else -1
            listed += 1
    find_foot(squares, o, listed, around)


def is_near(objects: ObjectColumns, o: int, x: float, y: float) -> bool:
    """Whether a point is in the box of an object, or little beside it."""
    reach_x, reach_y = (0.5 + SIDE_REACH) * objects.width[o], (0.5 + STACK_REACH) * objects.height[o]
    return math.fabs(x - objects.x[o]) < reach_x and math.fabs(y - objects.y[o]) < reach_y


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
        is_own = squares.members[o] == ALL and is_near(objects, o, edges.x[i], edges.y[i])
        if is_own or squares.obedient[j]:
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


# Update


def belief_in(objects: ObjectColumns, o: int, wholes: MotionSums, around: Situation, settings: Settings) -> float:
    """Returns the change of trust of an object seen by its edges: slow with few, negative if it moves as the ground."""
    if group_motion.is_ground(wholes, o, around):
        return -1.0
    return 1.0 if wholes.count[o] >= object_prediction.SURE_EDGES or objects.trust[o] < settings.tr_cr else UNSURE


def measure(objects: ObjectColumns, o: int, wholes: MotionSums, place: int, around: Situation) -> None:
    """Update an object's box and motion from its edges; where its ``place`` has changed its motion was observed."""
    show(objects, o, wholes, around)
    if objects.age_s[o] == 0:
        object_prediction.forget_motion(objects, o)
    if place != object_prediction.CHANGED:
        observe(objects, o, wholes, around)


def see_at_rest(objects: ObjectColumns, o: int, around: Situation) -> None:
    """Update an object that stands before a vehicle at rest."""
    objects.unseen_s[o], objects.state[o], objects.left[o] = 0.0, SEEN, 0
    objects.looming[o] = objects.sideways[o] = 0.0
    objects.reference[o] = around.speed_mps


def renew_numbers(
    objects: ObjectColumns, o: int, squares: Squares, unmeasured: bool, plane: ImagePlane, around: Situation
) -> None:
    """Update the numbers of an object from its evidence; if its motion was not measured, by coasting."""
    object_belief.collect_evidence(squares.evidence, objects, o, plane, around)
    if unmeasured and math.isfinite(objects.forward[o]):
        object_belief.coast(objects, o, squares.evidence, around)
    elif math.isfinite(around.speed_mps):
        range_belief.consider(squares.belief, squares.evidence, around)
        object_belief.believe(objects, o, squares.belief, squares.evidence, around)
    else:
        object_belief.believe_without_speed(objects, o, squares.evidence, around)


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
    see_through(objects, squares, verdicts, edges, baselines, around)
    for o in range(objects.capacity):
        if not objects.active[o]:
            continue
        find_ground(objects, o, squares, verdicts, edges, baselines, around)
        count = squares.wholes.count[o]
        own, through = squares.resting[o], squares.through[o]
        place = object_prediction.watch(objects, o, count, own, through, coarse, plane, around)
        if place == object_prediction.CHANGED and count >= MIN_EDGES:
            observe(objects, o, squares.wholes, around)
        gone = place == object_prediction.CHANGED and object_belief.is_still(objects, o)
        shown = not gone and not object_prediction.is_left_over(objects, o, own, around)
        remnant = False
        if place == object_prediction.SAME or (squares.resting[o] >= MIN_EDGES and count < MIN_EDGES and shown):
            see_at_rest(objects, o, around)
        elif count >= MIN_EDGES and shown:
            objects.recent_edges[o] = max(objects.recent_edges[o] * math.exp(-around.dt_s / RECENT_S), count)
            remnant = object_prediction.is_remnant(objects, o, count, plane, around)
            objects.unseen_s[o], objects.state[o], objects.left[o] = 0.0, SEEN, 0
            objects.support[o] = count
            believed = belief_in(objects, o, squares.wholes, around, settings)
            objects.trust[o] = edge_equations.change_trust(objects.trust[o], believed, settings.tr_max)
            if objects.trust[o] < settings.tr_cr and objects.age_s[o] > 0:
                objects.active[o] = 0
                continue
            if not remnant:
                measure(objects, o, squares.wholes, place, around)
        elif not go_on_in_turmoil(objects, o, circles, around, settings):
            object_prediction.go_on(objects, o, gone, through, edges, plane, around, settings)
            if not objects.active[o]:
                continue
        renew_numbers(
            objects,
            o,
            squares,
            remnant
            or place == object_prediction.SAME
            or objects.unseen_s[o] > 0
            or object_belief.rests(objects, o, around),
            plane,
            around,
        )
    return evicted
