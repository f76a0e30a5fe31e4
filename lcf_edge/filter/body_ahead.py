"""Circle expert, C_r from the downscaled image: one large body straight ahead, however few corners it has.

Its pieces (``coarse_motion``) are all met at the same time, and flow apart.
"""

from lcf_edge.filter import circles as shared
from lcf_edge.filter import lengths
from lcf_edge.filter.circles import Ids, Members
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.columns import CircleColumns, EdgeColumns
from lcf_edge.filter.memory import Bytes, Integers, octets
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import Cause

SAME_TIME = 0.8  # ratio of the times until the pieces of one body are met, at least
SAME_CONTACT = 0.64  # and of its time to contact and that of a circle that edges show
MIN_PIECES = 6
MIN_SHARE = 0.5  # of all pieces that are met soon
MIN_SIDE = 2  # pieces on either side of O,
GROWTH = 0.75  # or else share of its growth that it must show across and down,
MIN_SPREAD = 6.0  # small px, 1 standard deviation, with pieces so far apart,
MIN_CONTACT_S = 0.45  # if it is not met sooner: what passes very near seems to be
UPRIGHT = 0.5  # its highest piece is above the horizon, or below by at most this share of the depth of its lowest
BESIDE_PX = 4.0  # small px from O, within which a piece is on neither side
SPREAD_PX2 = 2.7  # small px², variance of what a piece shows about its centre
INCOMING = int(Cause.INCOMING)
INFINITY = float("inf")


class BodyAhead:
    """The body in this frame. ``is_part``: whether a piece belongs to it; ``members``: their statistics, one row.

    ``rate``: 1/s, inverse of its time to contact. ``highest``, ``lowest``: rows of its pieces, px. ``left``, ``right``:
    number of those on either side of O. ``across``, ``down``: by how much it grows, 1/s, 0: unknown.
    """

    def __init__(self, pieces: int) -> None:
        self.is_part, self.members = octets(pieces), Members(1)
        self.rate = self.highest = self.lowest = self.across = self.down = 0.0
        self.left = self.right = 0


def is_met_with(coarse: CoarseMotion, k: int, other: int) -> bool:
    """Whether two pieces are met at about the same time."""
    one_s, other_s = coarse.contact_s[k], coarse.contact_s[other]
    return one_s > SAME_TIME * other_s and other_s > SAME_TIME * one_s


def middle_piece(coarse: CoarseMotion) -> int:
    """Return the piece with which most are met, -1: none."""
    pieces, middle, most = coarse.columns * coarse.rows, -1, 0
    for k in range(pieces):
        met = 0
        for other in range(pieces if coarse.contact_s[k] > 0 else 0):
            met += 1 if is_met_with(coarse, k, other) else 0
        if met > most:
            middle, most = k, met
    return middle


def gather(body: BodyAhead, members: Members, coarse: CoarseMotion) -> bool:
    """Gather the pieces that are met with most others; return whether they are enough."""
    middle, near = middle_piece(coarse), 0
    shared.clear(members, 0)
    if middle < 0:
        return False
    for k in range(coarse.columns * coarse.rows):
        body.is_part[k] = 1 if is_met_with(coarse, middle, k) else 0
        members.size[0] += body.is_part[k]
        near += 1 if coarse.contact_s[k] > 0 else 0
    return members.size[0] >= MIN_PIECES and members.size[0] >= MIN_SHARE * near


def measure(body: BodyAhead, members: Members, coarse: CoarseMotion, around: Situation) -> None:
    """Set the place, the time to contact and the growth of the body."""
    share, beside_px = 1.0 / members.size[0], BESIDE_PX * coarse.side
    body.rate, body.highest, body.lowest, body.left, body.right = 0.0, INFINITY, -INFINITY, 0, 0
    for k in range(coarse.columns * coarse.rows):
        if body.is_part[k]:
            members.x[0] += share * coarse.x[k]
            members.y[0] += share * coarse.y[k]
            body.rate += share / coarse.contact_s[k]
            body.highest, body.lowest = min(body.highest, coarse.y[k]), max(body.lowest, coarse.y[k])
            body.left += 1 if coarse.x[k] < around.focus_x - beside_px else 0
            body.right += 1 if coarse.x[k] > around.focus_x + beside_px else 0
    wide = tall = parting = growing = 0.0
    for k in range(coarse.columns * coarse.rows):
        if body.is_part[k]:
            dx, dy = coarse.x[k] - members.x[0], coarse.y[k] - members.y[0]
            wide += share * dx * dx
            tall += share * dy * dy
            parting += share * dx * coarse.vx[k]
            growing += share * dy * coarse.vy[k]
    least = MIN_SPREAD * MIN_SPREAD * coarse.side * coarse.side
    body.across = parting / wide if wide > least else 0.0
    body.down = growing / tall if tall > least else 0.0
    members.variance_x[0] = wide + SPREAD_PX2 * coarse.side * coarse.side
    members.variance_y[0] = tall + SPREAD_PX2 * coarse.side * coarse.side


def comes_closer(body: BodyAhead, coarse: CoarseMotion, around: Situation) -> bool:
    """Whether the body is something upright that comes closer.

    What moves aside seems near too, on its own side of O, but does not grow; only what comes closer is near on both
    sides, or flows apart both across and down as it must by its time to contact, measured since the searched image. So
    does the ground, but not at one time to contact in rows far apart.
    """
    if around.horizon_y - body.highest < -UPRIGHT * (body.lowest - around.horizon_y):
        return False
    if min(body.left, body.right) >= MIN_SIDE:
        return True
    least = GROWTH * body.rate / (1 + body.rate * coarse.then_s)
    return body.rate * MIN_CONTACT_S < 1 and body.across > least and body.down > least


def circle_of(body: BodyAhead, members: Members, circles: CircleColumns, updated: Bytes, settings: Settings) -> int:
    """Return the nearest circle that shows the body, -1: none."""
    nearest, least = -1, INFINITY
    for c in range(circles.capacity):
        if not circles.active[c] or circles.cause[c] != INCOMING:
            continue
        if updated[c] and not SAME_CONTACT < circles.ttc[c] * body.rate < 1 / SAME_CONTACT:
            continue
        away = lengths.of(circles.x[c] - members.x[0], circles.y[c] - members.y[0])
        if away < max(circles.radius[c], shared.radius_of(members, 0, settings.bs_px)) and away < least:
            nearest, least = c, away
    return nearest


def update(
    body: BodyAhead,
    members: Members,
    coarse: CoarseMotion,
    circle: Integers,
    edges: EdgeColumns,
    circles: CircleColumns,
    updated: Bytes,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> None:
    """Update C_r from the body ahead. ``members``: those of ``body``.

    ``circle``: of each piece, row of C_r, -1: none; set for those of the body.
    ``updated``: circles that other sources have updated, which are left alone; one updated here is marked too.
    """
    if not gather(body, members, coarse):
        return
    measure(body, members, coarse, around)
    if not comes_closer(body, coarse, around):
        return
    c = circle_of(body, members, circles, updated, settings)
    if c < 0:
        c = shared.row_for_newborn(edges, circles, True, settings)
        if c < 0:
            return
        shared.give_birth(circles, c, members, 0, settings, ids)
    elif not updated[c]:
        shared.confirm(circles, c, members, 0, settings)
    if not updated[c]:
        updated[c] = 1
        shared.stand(circles, c, members.x[0], around.assumed_mps / body.rate, around, settings)
    for k in range(coarse.columns * coarse.rows):
        if body.is_part[k]:
            circle[k] = c
