"""Circle expert, edges: predict E', classify (λ*), update, add and delete edges."""

import math

from lcf_edge.filter import edge_equations, edge_rows, error_matrix, image_plane, lengths, line_expert
from lcf_edge.filter.columns import CircleColumns, CornerColumns, EdgeColumns, GroupColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.memory import Bytes
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation
from lcf_edge.messages import Cause

MIN_CORR = 0.25
CROSSING = int(Cause.CROSSING)
SWING_SHARE = 0.2  # prediction error that a rebel may have, as a share of its motion
MIN_ORIGIN_PX = 2.0  # an edge nearer to its origin has no direction from it
MIN_RADIUS_PX = 1e-3  # nor one nearer to the focus
STRAY_GATE_SHARE = 0.5  # BL of a new suspect, as a share of BL at birth
ROTATION_SIGMAS = 2.0  # by which an edge may leave its flow line, besides δ
FIRST_EXPANSION_HZ = 1.0  # V/r of a new landmark outside all circles, at most: few things are nearer than a second
FIRST_SPEED_SHARE = 0.5  # 1 sigma of V of a new landmark, as a share of it: its depth is not known
FIXED_PX = 1  # jitter of a corner that does not move
MAX_FIXED_STEP_S = 0.1  # time that one frame counts at most: images minutes apart are no evidence of an own part
USUAL_SHARE = 0.5  # of the trusted edges of a sharp image, at least, are found; where fewer are, a miss tells less
LEAST_SHARPNESS = 0.2  # but it always tells something
MIN_TRUSTED = 15  # edges by which that is judged
JOIN_GATE_SHARE = 0.25  # gate of a new edge in a rebel circle, as a share of the circle's motion


def direct(edges: EdgeColumns, i: int, around: Situation) -> float:
    """Set the direction in which an edge is predicted; return its distance from O, px.

    Normal edges move outward along their flow line, rebels along β + DL, chains along β.
    """
    dx, dy = edges.x[i] - around.focus_x, edges.y[i] - around.focus_y
    r = lengths.of(dx, dy)
    if edges.own_way(i):
        heading = edges.beta[i] + (edges.deviation[i] if edges.rebel[i] else 0.0)
        edges.cos[i], edges.sin[i] = math.cos(heading), math.sin(heading)
    else:
        edges.cos[i], edges.sin[i] = dx / max(r, MIN_RADIUS_PX), dy / max(r, MIN_RADIUS_PX)
    return r


def predict(edges: EdgeColumns, normal: CircleColumns, around: Situation, settings: Settings) -> None:
    """E': normal edges move outward along their flow line, rebels and chains continue their motion.

    A new edge takes half of its speed from its circle; a trusted edge keeps its own: pulled towards a circle at another
    depth, it would lose its corner.
    """
    for i in range(edges.count):
        r = direct(edges, i, around)
        expected = edges.speed[i]
        if edges.trust[i] < settings.tr_s and edges.circle[i] >= 0 and not edges.own_way(i):
            expected = normal.expansion[edges.circle[i]] * r
        speed = edge_equations.predict_speed(edges.speed[i], expected)
        edges.predicted_speed[i] = speed
        edges.predicted_x[i] = edge_equations.predict_place(edges.x[i], speed, edges.cos[i], around.dt_s)
        edges.predicted_y[i] = edge_equations.predict_place(edges.y[i], speed, edges.sin[i], around.dt_s)


def relation_of(edges: EdgeColumns, i: int, x: float, y: float, delta_px: float, settings: Settings) -> int:
    """λ* of an edge and its corner at (x, y), px."""
    if edges.own_way(i):
        return edge_equations.FOLLOWS  # λ*r: no flow line to leave
    return edge_equations.classify(
        x - edges.x[i],
        y - edges.y[i],
        x - edges.predicted_x[i],
        y - edges.predicted_y[i],
        edges.cos[i],
        edges.sin[i],
        edges.predicted_speed[i],
        edges.bl[i],
        delta_px,
        settings.eps_beta_rad,
    )


def go_on(edges: EdgeColumns, i: int) -> None:
    """Move an edge to its prediction."""
    edges.x[i], edges.y[i], edges.speed[i] = edges.predicted_x[i], edges.predicted_y[i], edges.predicted_speed[i]


def sharpness(edges: EdgeColumns, settings: Settings) -> float:
    """Share of the trusted edges that found a corner, of what is usual; 1 where there are too few to judge by.

    Motion blur loses most corners of an image, though their edges go on.
    """
    found = trusted = 0
    for i in range(edges.count):
        if edges.trust[i] >= settings.tr_s and not edges.held[i]:
            trusted += 1
            found += 1 if edges.corner[i] >= 0 else 0
    if trusted < MIN_TRUSTED:
        return 1.0
    return min(max(found / (USUAL_SHARE * trusted), LEAST_SHARPNESS), 1.0)


def update(
    edges: EdgeColumns,
    normal: CircleColumns,
    rebel: CircleColumns,
    corners: CornerColumns,
    sigma_px: float,
    around: Situation,
    settings: Settings,
) -> None:
    """Classify the matched pairs and update every edge; unmatched ones follow their prediction.

    ``sigma_px``: 1 sigma of the image motion by the rotation.
    """
    delta_px, dt_s = settings.delta_px + ROTATION_SIGMAS * sigma_px, around.dt_s
    unmatched = sharpness(edges, settings) * edge_equations.UNMATCHED
    for i in range(edges.count):
        edges.matched[i] = 0
        error_matrix.predict(edges, i, dt_s)
        corner = edges.corner[i]
        if corner < 0:
            change = 0.0 if edges.held[i] else unmatched
            edges.trust[i] = edge_equations.change_trust(edges.trust[i], change, settings.tr_max)
            go_on(edges, i)
            continue
        x, y, x0, y0 = corners.x[corner], corners.y[corner], edges.x[i], edges.y[i]
        relation = relation_of(edges, i, x, y, delta_px, settings)
        go_on(edges, i)
        if relation in (edge_equations.FOLLOWS, edge_equations.DISAGREES):
            correct(edges, i, normal, rebel, x, y, around, settings)
            take_corner(edges, i, corners, corner, dt_s)
        change = edge_equations.trust_change(relation)
        edges.trust[i] = edge_equations.change_trust(edges.trust[i], change, settings.tr_max)
        if relation in (edge_equations.BREAKS, edge_equations.STAYS) and edges.count < edges.capacity:
            stray(edges, i, x0, y0, corners, corner, around, settings)


def take_corner(edges: EdgeColumns, i: int, corners: CornerColumns, corner: int, dt_s: float) -> None:
    """Mark an edge as matched; it takes its corner's appearance. ``dt_s``: t_f."""
    away_x, away_y = corners.pixel_x[corner] - edges.fixed_x[i], corners.pixel_y[corner] - edges.fixed_y[i]
    if max(away_x, -away_x) <= FIXED_PX and max(away_y, -away_y) <= FIXED_PX:
        edges.fixed_s[i] += min(dt_s, MAX_FIXED_STEP_S)
    else:
        edges.fixed_x[i], edges.fixed_y[i] = corners.pixel_x[corner], corners.pixel_y[corner]
        edges.fixed_s[i] = 0.0
    edges.matched[i] = 1
    edges.words[i, 0], edges.words[i, 1] = corners.words[corner, 0], corners.words[corner, 1]
    corners.taken[corner] = 1


def correct(
    edges: EdgeColumns,
    i: int,
    normal: CircleColumns,
    rebel: CircleColumns,
    x: float,
    y: float,
    around: Situation,
    settings: Settings,
) -> None:
    """Update L, V, BL of an edge with its corner at (x, y) (eq. EnEstimation), and β and DL of rebels and chains."""
    dt_s = around.dt_s
    trust, tr_cr = trust_in_prediction(edges, i, rebel, x, y, dt_s, settings), settings.tr_cr
    predicted = edges.predicted_speed[i]
    along = (x - edges.predicted_x[i]) * edges.cos[i] + (y - edges.predicted_y[i]) * edges.sin[i]
    speed = edge_equations.update_speed(trust, tr_cr, predicted, along, dt_s)
    edges.x[i] = edge_equations.update_position(trust, tr_cr, edges.predicted_x[i], x)
    edges.y[i] = edge_equations.update_position(trust, tr_cr, edges.predicted_y[i], y)
    edges.speed[i] = speed
    error_matrix.correct(edges, i, edge_equations.share_of_corner(trust, tr_cr), around.corner_var, dt_s)
    corr = 1.0
    if edges.circle[i] >= 0 and not edges.rebel[i]:
        corr = max(normal.corr[edges.circle[i]], MIN_CORR)
    edges.bl[i] = edge_equations.update_gate(
        edges.bl[i], speed, predicted, corr, dt_s, settings.bl_min_px, settings.bl0_px
    )
    if edges.own_way(i):
        swing = SWING_SHARE * dt_s * math.fabs(speed)  # what approaches accelerates in the image
        edges.bl[i] = max(edges.bl[i], swing)
        turn_own_way(edges, i)


def trust_in_prediction(
    edges: EdgeColumns, i: int, rebel: CircleColumns, x: float, y: float, dt_s: float, settings: Settings
) -> float:
    """Tr that weights L' of an edge; reduced for a crossing rebel that outruns its prediction.

    What approaches accelerates in the image: weighted by trust alone L' would lag ever farther behind, and leave its
    gate where ``SWING_SHARE`` of the motion exceeds it. So L lags its corner by at most δ.
    """
    if not edges.rebel[i] or edges.circle[i] < 0 or rebel.cause[edges.circle[i]] != CROSSING:
        return edges.trust[i]
    dx, dy = x - edges.predicted_x[i], y - edges.predicted_y[i]
    behind = dx * edges.cos[i] + dy * edges.sin[i]
    aside = math.fabs(dy * edges.cos[i] - dx * edges.sin[i])
    swing = SWING_SHARE * dt_s * edges.predicted_speed[i]
    if min(behind, swing) <= settings.bl_min_px or aside > behind or behind <= settings.delta_px:
        return edges.trust[i]
    return min(edges.trust[i], settings.tr_cr + settings.delta_px / (behind - settings.delta_px))


def turn_own_way(edges: EdgeColumns, i: int) -> None:
    """Update β of a rebel or chain, the direction from its O, and DL, which follows the turn of β."""
    dx, dy, before = edges.x[i] - edges.origin_x[i], edges.y[i] - edges.origin_y[i], edges.beta[i]
    if lengths.of(dx, dy) > MIN_ORIGIN_PX:
        edges.beta[i] = math.atan2(dy, dx)
    deviation = edge_equations.update_deviation(edges.deviation[i], edges.beta[i] - before)
    edges.deviation[i] = edge_equations.bound_deviation(deviation)


def stray(
    edges: EdgeColumns,
    i: int,
    x0: float,
    y0: float,
    corners: CornerColumns,
    corner: int,
    around: Situation,
    settings: Settings,
) -> None:
    """λ*4 and λ*5: the corner goes to α as a copy of the edge whose law it broke, which was at (x0, y0)."""
    row, dt_s = edges.count, around.dt_s
    edges.count += 1
    edge_rows.copy_row(edges, i, row)
    x, y = corners.x[corner], corners.y[corner]
    edges.x[row], edges.y[row] = x, y
    edges.beta[row] = math.atan2(y - y0, x - x0)
    edges.speed[row] = lengths.of(x - x0, y - y0) / dt_s
    edges.origin_x[row], edges.origin_y[row] = x0, y0
    edges.deviation[row] = 0.0
    edges.trust[row] = settings.tr_new
    edges.bl[row] = STRAY_GATE_SHARE * settings.bl0_px
    edges.suspect_keys[row] = 1
    edges.circle[row] = -1
    error_matrix.start(edges, row, around.corner_var, 2 * around.corner_var / (dt_s * dt_s))
    take_corner(edges, row, corners, corner, dt_s)


def delete(edges: EdgeColumns, plane: ImagePlane, dead: Bytes, tr_cr: float) -> None:
    """Delete edges below Tr_cr or outside the frame. ``dead``: (capacity,), scratch."""
    for i in range(edges.count):
        seen = image_plane.project(plane, edges.x[i], edges.y[i])
        dead[i] = 0 if seen and edges.trust[i] >= tr_cr else 1
    edge_rows.remove(edges, dead)


def count_unclaimed(corners: CornerColumns) -> int:
    """Number of corners outside ψ that no edge took."""
    unclaimed = 0
    for k in range(corners.count):
        if not corners.omitted[k] and not corners.taken[k]:
            unclaimed += 1
    return unclaimed


def add(
    edges: EdgeColumns,
    normal: CircleColumns,
    corners: CornerColumns,
    groups: GroupColumns,
    around: Situation,
    room: int,
    key_number: int,
    settings: Settings,
) -> None:
    """Add corners that no edge took as new landmarks (those of λ*1 too), at most ``room``."""
    for k in range(corners.count):
        if room > 0 and not corners.omitted[k] and not corners.taken[k]:
            room -= 1
            row = edges.count
            edges.count += 1
            x, y = corners.x[k], corners.y[k]
            r = lengths.of(x - around.focus_x, y - around.focus_y)
            edge_rows.empty_row(edges, row)
            edges.x[row], edges.y[row] = x, y
            edges.speed[row] = first_expansion(x, y, normal, groups, around, settings) * r
            edges.bl[row], edges.trust[row] = settings.bl0_px, settings.tr_new
            edges.born_key[row] = key_number
            unsure = FIRST_SPEED_SHARE * edges.speed[row]
            error_matrix.start(edges, row, around.corner_var, unsure * unsure)
            take_corner(edges, row, corners, k, around.dt_s)


def first_expansion(
    x: float, y: float, normal: CircleColumns, groups: GroupColumns, around: Situation, settings: Settings
) -> float:
    """V/r of a new landmark: of its λ group's circle, else of the ground, else at the configured depth.

    That is a rover's: at 12 m/s it would be met in a third of a second, and few corners be found again.
    """
    circle = line_expert.circle_at(groups, x, y)
    if circle >= 0:
        return normal.expansion[circle]
    speed = around.speed_mps if math.isfinite(around.speed_mps) else 0.0
    expansion = min(max(speed / settings.scene_depth_m, -FIRST_EXPANSION_HZ), FIRST_EXPANSION_HZ)
    if around.camera_height_m > 0:
        below = max(y - around.horizon_y, 0.0)
        ground = speed / (around.camera_height_m * around.pinhole.focal) * below
        if math.fabs(ground) > math.fabs(expansion):
            return ground
    return expansion


def suspect(edges: EdgeColumns, i: int, vx: float, vy: float, around: Situation, settings: Settings) -> None:
    """Start a new landmark in α, with the motion of the rebel circle that it is in, px/s."""
    edges.suspect_keys[i] = 1
    edges.beta[i] = math.atan2(vy, vx)
    edges.speed[i] = lengths.of(vx, vy)
    edges.origin_x[i], edges.origin_y[i] = edges.x[i], edges.y[i]
    step = JOIN_GATE_SHARE * edges.speed[i] * around.dt_s
    edges.bl[i] = max(STRAY_GATE_SHARE * settings.bl0_px, step)
