"""Objects know more than each of their circles: they correct these, keep one, and tell how new edges in them move."""

import math

from lcf_edge.filter import circles as shared
from lcf_edge.filter import edge_expert, image_plane, lengths, object_belief, object_prediction, rebel_circles, turmoil
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.columns import CircleColumns, EdgeColumns, ObjectColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import Cause, ObjectClass, ObjectState

LEFT_SHARE = 0.25  # of an object's width: with no more in the image it has left
UNKNOWN, STANDING, CROSSING = int(ObjectClass.UNKNOWN), int(ObjectClass.STANDING), int(ObjectClass.CROSSING)
LEADING, CUTTING_IN = int(ObjectClass.LEADING), int(ObjectClass.CUTTING_IN)
CROSSES, COMES, LEADS = int(Cause.CROSSING), int(Cause.INCOMING), int(Cause.LEADING)
SEEN = int(ObjectState.SEEN)
INFINITY = float("inf")


def is_due(objects: ObjectColumns, o: int, settings: Settings) -> bool:
    """Whether a published object will probably be met, and is seen, or so near that its corners are lost."""
    if is_sure(objects, o, settings) and not is_doubtful(objects, o):
        return objects.probability[o] > object_belief.EVEN
    return objects.active[o] != 0 and object_prediction.is_met_soon(objects, o, settings)


def is_doubtful(objects: ObjectColumns, o: int) -> bool:
    """Whether only a few edges show that an object is met soon: by then it is large in the image, and has many."""
    return objects.ttc[o] < object_prediction.SOON_S and objects.support[o] < object_prediction.SURE_EDGES


def is_sure(objects: ObjectColumns, o: int, settings: Settings) -> bool:
    """Whether an object is published, and seen in this frame."""
    return objects.active[o] != 0 and objects.trust[o] >= settings.tr_s and objects.state[o] == SEEN


def cause_of(objects: ObjectColumns, o: int) -> int:
    """Cause of the circles of an object that moves."""
    if objects.probability[o] > object_belief.EVEN:
        return COMES
    return LEADS if objects.class_id[o] == LEADING or objects.class_id[o] == CUTTING_IN else CROSSES


def correct(objects: ObjectColumns, circles: CircleColumns, settings: Settings) -> None:
    """Circles of moving objects take cause, range and lateral miss from their object.

    They keep their own time to contact, on which their prediction rests. Circles of stationary objects measure better
    by themselves; an incoming circle is corrected only where the object crosses.
    """
    for c in range(circles.capacity):
        o = circles.square[c]
        if o < 0 or not circles.active[c] or turmoil.is_shown_by(circles, c) or not is_sure(objects, o, settings):
            continue
        if objects.class_id[o] == UNKNOWN or objects.class_id[o] == STANDING:
            continue
        if circles.cause[c] != COMES or objects.class_id[o] == CROSSING:
            circles.cause[c] = cause_of(objects, o)
            circles.range[c], circles.lateral[c] = objects.range[o], objects.lateral[o]


def is_inside(circles: CircleColumns, c: int, objects: ObjectColumns, o: int) -> bool:
    """Whether the centre of a circle is in the box of an object."""
    if 2 * math.fabs(circles.x[c] - objects.x[o]) > objects.width[o]:
        return False
    return 2 * math.fabs(circles.y[c] - objects.y[o]) <= objects.height[o]


def is_shown(objects: ObjectColumns, o: int, circles: CircleColumns, settings: Settings) -> bool:
    """Whether a trusted circle shows an object."""
    for c in range(circles.capacity):
        is_trusted = circles.active[c] and circles.trust[c] >= settings.tr_s
        if is_trusted and (circles.square[c] == o or is_inside(circles, c, objects, o)):
            return True
    return False


def own_circle(circles: CircleColumns, o: int) -> int:
    """The most trusted circle of an object, -1: it has none."""
    own = -1
    for c in range(circles.capacity):
        if circles.active[c] and circles.square[c] == o and (own < 0 or circles.trust[c] > circles.trust[own]):
            own = c
    return own


def show(objects: ObjectColumns, o: int, circles: CircleColumns, c: int, around: Situation, settings: Settings) -> None:
    """Set a circle from its object, with trust Tr_s."""
    x, y = objects.x[o], objects.y[o]
    looming = object_prediction.looming_at(objects, o, around.speed_mps)
    vx = object_prediction.velocity_x(objects, o, x, looming, around)
    vy = object_prediction.velocity_y(y, looming, around)
    circles.x[c], circles.y[c], circles.beta[c], circles.speed[c] = x, y, math.atan2(vy, vx), lengths.of(vx, vy)
    circles.width[c], circles.height[c] = objects.width[o], objects.height[o]
    reach = 0.5 * max(objects.width[o], objects.height[o])
    circles.radius[c] = min(max(reach, shared.MIN_RADIUS_PX), settings.bs_px)
    circles.trust[c], circles.support[c], circles.cause[c] = settings.tr_s, objects.support[o], COMES
    circles.ttc[c] = objects.ttc[o] if objects.ttc[o] > 0 else INFINITY
    circles.range[c], circles.lateral[c] = objects.range[o], objects.lateral[o]


def has_left(objects: ObjectColumns, o: int, plane: ImagePlane) -> bool:
    """Whether an unseen object has all but left the image."""
    inward = (0.5 - LEFT_SHARE) * objects.width[o]
    inmost_x = objects.x[o] + inward if objects.x[o] < 0.5 * plane.width else objects.x[o] - inward
    return objects.state[o] != SEEN and not image_plane.project(plane, inmost_x, objects.y[o])


def end_outside(
    objects: ObjectColumns, circles: CircleColumns, edges: EdgeColumns, plane: ImagePlane, around: Situation
) -> None:
    """End the circles of objects that left the image; only the object continues.

    Not while no flow is seen: then it fills the image.
    """
    if not around.flow_is_seen:
        return
    ended = 0
    for c in range(circles.capacity):
        o = circles.square[c]
        if o >= 0 and circles.active[c] and has_left(objects, o, plane):
            circles.active[c] = 0
            ended += 1
    if ended > 0:
        shared.release(edges, circles, True)


def update(
    objects: ObjectColumns,
    circles: CircleColumns,
    edges: EdgeColumns,
    plane: ImagePlane,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> None:
    """C_r from S: an object that is due keeps a circle even if its edges hardly break the flow, or are lost."""
    correct(objects, circles, settings)
    end_outside(objects, circles, edges, plane, around)
    for o in range(objects.capacity):
        if not is_due(objects, o, settings) or is_shown(objects, o, circles, settings):
            continue
        c = own_circle(circles, o)
        if c < 0:
            c = shared.row_for_newborn(edges, circles, True, settings)
            if c < 0:
                continue
            shared.begin(circles, c, ids)
            circles.square[c] = o
        show(objects, o, circles, c, around, settings)


def join_rebels(
    edges: EdgeColumns,
    start: int,
    circles: CircleColumns,
    objects: ObjectColumns,
    around: Situation,
    settings: Settings,
) -> None:
    """Start new landmarks inside a rebel circle in α, with the motion of its object, if that is known, else its own.

    ``start``: row of the first of them.
    """
    for i in range(start, edges.count):
        c = rebel_circles.circle_at(circles, edges.x[i], edges.y[i], settings)
        if c < 0:
            continue
        o = circles.square[c]
        if o >= 0 and is_sure(objects, o, settings) and math.isfinite(objects.qq[o]):
            looming = object_prediction.looming_at(objects, o, around.speed_mps)
            vx = object_prediction.velocity_x(objects, o, edges.x[i], looming, around)
            vy = object_prediction.velocity_y(edges.y[i], looming, around)
        else:
            vx = rebel_circles.velocity_x(circles, c, edges.x[i], around.horizon_s)
            vy = rebel_circles.velocity_y(circles, c, edges.y[i], around.horizon_s)
        edge_expert.suspect(edges, i, vx, vy, around, settings)
