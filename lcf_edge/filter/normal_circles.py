"""Circle expert, C_n: normal edges that agree in direction, speed and position become circles."""

import math

from lcf_edge.filter import circles as shared
from lcf_edge.filter import edge_equations, flow, image_plane, lengths, path, rounding
from lcf_edge.filter.circles import Ids, Members
from lcf_edge.filter.columns import CircleColumns, EdgeColumns
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.memory import Bytes, doubles, integers
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.situation import Situation

SPEED_NOISE_PX = 0.6  # 1 sigma of an edge's V, times t_f
PASSING_WIDTHS = 2.0  # half widths of the vehicle from its path, beyond which a circle may be ignored
DEPTH_SPREAD = 0.5  # share by which the expansion of an edge may differ from its circle's
INSIDE_RADII = 1.5  # radii of a circle within which an edge lies inside,
INSIDE_MARGIN_PX = 4.0  # plus this
SUDDEN_CHANGE = 10.0  # times ε_V, by which the mean expansion of an aligned circle's edges may exceed its own
ALIGNED_SHARE = 0.2  # of ε_β, by which their mean direction may differ from its own
SLOWEST_OCTAVE = -6  # expansions below 2**-6 1/s share one octave
SLOWEST = 0.015625  # 2**-6
OCTAVES = 16
CELLS = 32  # a side, of BS_λ each
MIN_EXPANSION = 1e-3  # 1/s
MIN_R_PX = 1.0


class Flowing:
    """Trusted normal edges that may be grouped, one row each, and the statistics of their circles.

    ``row``: of the table of edges. ``r``: px from O. ``cos``, ``sin``: of the direction of flow. ``expansion``: V/r,
    1/s. ``cell``: its cell of image position and octave of expansion, -1: it has a circle; ``cell_size``: edges in
    each.

    One row per circle: ``members``; ``before``, edges that belonged to it; ``included``, those that still lie in it;
    ``mean_cos``, ``mean_sin``, ``mean_expansion`` of its edges; ``beta_cos``, ``beta_sin`` of its own direction.
    ``open``: the ``open_count`` circles that an edge may join.
    """

    def __init__(self, edges: int, circles: int) -> None:
        self.count = self.open_count = 0
        self.row, self.cell = integers(edges), integers(edges)
        self.r, self.cos, self.sin, self.expansion = [doubles(edges) for _ in range(4)]
        self.cell_size = integers(CELLS * CELLS * OCTAVES)
        self.members = Members(circles)
        self.before, self.included, self.open = [integers(circles) for _ in range(3)]
        self.mean_cos, self.mean_sin, self.mean_expansion = [doubles(circles) for _ in range(3)]
        self.beta_cos, self.beta_sin = [doubles(circles) for _ in range(2)]


def predict(circles: CircleColumns, plane: ImagePlane, around: Situation) -> None:
    """C'_n: a stationary circle moves outward from O and grows, both at the rate of its expansion.

    Circles whose centre left the frame end.
    """
    for c in range(circles.capacity):
        if circles.active[c]:
            growth = circles.expansion[c] * around.dt_s
            circles.x[c] += (circles.x[c] - around.focus_x) * growth
            circles.y[c] += (circles.y[c] - around.focus_y) * growth
            circles.radius[c] *= 1 + growth
            if not image_plane.project(plane, circles.x[c], circles.y[c]):
                circles.active[c] = 0


def passes_by(circles: CircleColumns, c: int, around: Situation) -> bool:
    """Whether the vehicle passes a circle at a distance. Nothing on the path may be ignored."""
    speed, expansion = around.speed_mps, circles.expansion[c]
    if not math.isfinite(speed) or not speed > 0 or not expansion > 0:
        return False
    range_m = speed / max(expansion, MIN_EXPANSION)
    right_m = (circles.x[c] - around.focus_x) / around.pinhole.fx * range_m
    off_path_m = math.fabs(path.miss(right_m, range_m, around))
    radius_m = circles.radius[c] / around.pinhole.fx * range_m
    beside_m = min(math.fabs(right_m), off_path_m) - radius_m  # the turn may end
    return beside_m > PASSING_WIDTHS * around.half_width_m


def gather(flowing: Flowing, edges: EdgeColumns, around: Situation, settings: Settings) -> None:
    """Gather the edges that may be grouped; |V_e| ≤ ε_V·V_ν of eq. EdgeEncompare, with V_ν as image speed."""
    fastest = settings.eps_v * around.scene_flow_pxps / around.pinhole.focal
    flowing.count = 0
    for i in range(edges.count):
        if edges.trust[i] < settings.tr_s or edges.held[i] or edges.own_way(i):
            continue
        dx, dy = edges.x[i] - around.focus_x, edges.y[i] - around.focus_y
        r = max(lengths.of(dx, dy), MIN_R_PX)
        if math.fabs(edges.speed[i]) > fastest * r + SPEED_NOISE_PX / around.dt_s:
            continue
        j = flowing.count
        flowing.count += 1
        flowing.row[j], flowing.r[j], flowing.cos[j], flowing.sin[j] = i, r, dx / r, dy / r
        flowing.expansion[j] = edges.speed[i] / r


def lies_inside(edges: EdgeColumns, i: int, circles: CircleColumns, c: int) -> bool:
    """Whether an edge lies in a circle, with a margin."""
    dx, dy = edges.x[i] - circles.x[c], edges.y[i] - circles.y[c]
    reach = circles.radius[c] * INSIDE_RADII + INSIDE_MARGIN_PX
    return dx * dx + dy * dy < reach * reach


def fits(
    flowing: Flowing,
    j: int,
    edges: EdgeColumns,
    circles: CircleColumns,
    c: int,
    around: Situation,
    settings: Settings,
) -> bool:
    """Whether an edge agrees with a circle in direction, speed and position (EdgeEncompare)."""
    i = flowing.row[j]
    dx, dy = edges.x[i] - circles.x[c], edges.y[i] - circles.y[c]
    if not circles.active[c] or dx * dx + dy * dy >= settings.bs_px * settings.bs_px:
        return False
    along = flowing.cos[j] * flowing.beta_cos[c] + flowing.sin[j] * flowing.beta_sin[c]
    if along <= math.cos(settings.eps_beta_rad):
        return False
    centre = circles.expansion[c]
    slack = DEPTH_SPREAD * math.fabs(centre) + SPEED_NOISE_PX / around.dt_s / flowing.r[j]
    return math.fabs(flowing.expansion[j] - centre) < slack


def nearest_open(flowing: Flowing, edges: EdgeColumns, i: int, circles: CircleColumns) -> int:
    """The open circle nearest to an edge, -1: none."""
    nearest = -1
    least = 0.0
    for k in range(flowing.open_count):
        c = flowing.open[k]
        dx, dy = edges.x[i] - circles.x[c], edges.y[i] - circles.y[c]
        away2 = dx * dx + dy * dy
        if nearest < 0 or away2 < least:
            nearest, least = c, away2
    return nearest


def open_circles(flowing: Flowing, circles: CircleColumns, ignored: Bytes) -> None:
    """List the circles that an edge may join: in use, and not under ψ."""
    flowing.open_count = 0
    for c in range(circles.capacity):
        flowing.before[c] = flowing.included[c] = 0
        if circles.active[c]:
            flowing.beta_cos[c], flowing.beta_sin[c] = math.cos(circles.beta[c]), math.sin(circles.beta[c])
            if not ignored[c]:
                flowing.open[flowing.open_count] = c
                flowing.open_count += 1


def involve(
    flowing: Flowing, edges: EdgeColumns, circles: CircleColumns, around: Situation, settings: Settings
) -> None:
    """Assign each edge to a circle, -1: none, and count the edges that still lie in theirs (percentinvolve)."""
    for j in range(flowing.count):
        i = flowing.row[j]
        c = edges.circle[i]
        if c >= 0:
            flowing.before[c] += 1
            if lies_inside(edges, i, circles, c):
                flowing.included[c] += 1
            if fits(flowing, j, edges, circles, c, around, settings):
                continue
            edges.circle[i] = -1
        c = nearest_open(flowing, edges, i, circles)
        if c >= 0 and lies_inside(edges, i, circles, c) and fits(flowing, j, edges, circles, c, around, settings):
            edges.circle[i] = c


def average(flowing: Flowing, members: Members, edges: EdgeColumns) -> None:
    """Statistics of the edges of each circle: number, mean position and variance, mean direction and expansion."""
    for c in range(members.capacity):
        shared.clear(members, c)
        flowing.mean_cos[c] = flowing.mean_sin[c] = flowing.mean_expansion[c] = 0.0
    for j in range(flowing.count):
        i = flowing.row[j]
        c = edges.circle[i]
        if c >= 0:
            members.size[c] += 1
            members.x[c] += edges.x[i]
            members.y[c] += edges.y[i]
            flowing.mean_cos[c] += flowing.cos[j]
            flowing.mean_sin[c] += flowing.sin[j]
            flowing.mean_expansion[c] += flowing.expansion[j]
    for c in range(members.capacity):
        if members.size[c] > 0:
            members.x[c] /= members.size[c]
            members.y[c] /= members.size[c]
            flowing.mean_cos[c] /= members.size[c]
            flowing.mean_sin[c] /= members.size[c]
            flowing.mean_expansion[c] /= members.size[c]
    for j in range(flowing.count):
        i = flowing.row[j]
        c = edges.circle[i]
        if c >= 0:
            dx, dy = edges.x[i] - members.x[c], edges.y[i] - members.y[c]
            members.variance_x[c] += dx * dx / members.size[c]
            members.variance_y[c] += dy * dy / members.size[c]


def is_involved(flowing: Flowing, c: int, settings: Settings) -> bool:
    """Whether enough of a circle's edges still lie in it (percentinvolve)."""
    share = settings.involvement * max(flowing.before[c], 1)
    return flowing.members.size[c] >= settings.circle_support and flowing.included[c] >= share


def is_aligned(flowing: Flowing, circles: CircleColumns, c: int, settings: Settings) -> bool:
    """Whether the edges of a circle move, in the mean, as it does (EdgeCirclenormalcompare)."""
    beta = math.atan2(flowing.mean_sin[c], flowing.mean_cos[c])
    turn = math.fabs(flow.wrap(beta - circles.beta[c]))
    most = SUDDEN_CHANGE * settings.eps_v * math.fabs(circles.expansion[c])
    return math.fabs(flowing.mean_expansion[c]) <= most and turn < ALIGNED_SHARE * settings.eps_beta_rad


def compare(flowing: Flowing, circles: CircleColumns, ignored: Bytes, settings: Settings) -> None:
    """Update circles from their edges: aligned Tr +1; deviating but involved, updated and Tr -1; else Tr -1."""
    for c in range(circles.capacity):
        if not circles.active[c] or ignored[c]:
            continue
        change = -1.0
        if is_involved(flowing, c, settings):
            if is_aligned(flowing, circles, c, settings):
                change = 1.0
            circles.expansion[c] = edge_equations.update_position(
                circles.trust[c], settings.tr_cr, circles.expansion[c], flowing.mean_expansion[c]
            )
            shared.blend(circles, c, flowing.members, c, settings)
            circles.corr[c] = lengths.of(flowing.mean_cos[c], flowing.mean_sin[c])
        circles.trust[c] = edge_equations.change_trust(circles.trust[c], change, settings.tr_max)


def direct(circles: CircleColumns, around: Situation) -> None:
    """Set β and V of normal circles from their position and expansion."""
    for c in range(circles.capacity):
        if circles.active[c]:
            dx, dy = circles.x[c] - around.focus_x, circles.y[c] - around.focus_y
            circles.beta[c] = math.atan2(dy, dx)
            circles.speed[c] = circles.expansion[c] * lengths.of(dx, dy)


def cell_of(x: float, y: float, expansion: float, around: Situation, size_px: float) -> int:
    """Number of the cell, of image position and octave of expansion, of an edge."""
    u = rounding.whole(math.floor((x - around.focus_x) / size_px)) + CELLS // 2
    v = rounding.whole(math.floor((y - around.focus_y) / size_px)) + CELLS // 2
    octave = rounding.whole(math.floor(math.log2(max(math.fabs(expansion), SLOWEST)) + 0.5)) - SLOWEST_OCTAVE
    return ((v & (CELLS - 1)) * CELLS + (u & (CELLS - 1))) * OCTAVES + min(octave, OCTAVES - 1)


def sort_left(flowing: Flowing, edges: EdgeColumns, around: Situation, settings: Settings) -> None:
    """Sort the edges without a circle into cells."""
    for j in range(flowing.count):
        i = flowing.row[j]
        flowing.cell[j] = -1
        if edges.circle[i] < 0:
            flowing.cell[j] = cell_of(edges.x[i], edges.y[i], flowing.expansion[j], around, settings.bs_px)
            flowing.cell_size[flowing.cell[j]] += 1


def largest_cell(flowing: Flowing, support: int) -> int:
    """The cell with the most edges, of equals the first; -1: none has ``support`` edges."""
    largest = -1
    for j in range(flowing.count):
        cell = flowing.cell[j]
        if cell < 0 or flowing.cell_size[cell] < support:
            continue
        size, most = flowing.cell_size[cell], flowing.cell_size[max(largest, 0)]
        if largest < 0 or size > most or (size == most and cell < largest):
            largest = cell
    return largest


def average_cell(flowing: Flowing, cell: int, members: Members, edges: EdgeColumns, c: int) -> None:
    """Make the edges of a cell members of circle ``c``, and compute their statistics."""
    shared.clear(members, c)
    flowing.mean_expansion[c] = 0.0
    for j in range(flowing.count):
        if flowing.cell[j] == cell:
            i = flowing.row[j]
            edges.circle[i] = c
            members.size[c] += 1
            members.x[c] += edges.x[i]
            members.y[c] += edges.y[i]
            flowing.mean_expansion[c] += flowing.expansion[j]
    members.x[c] /= members.size[c]
    members.y[c] /= members.size[c]
    flowing.mean_expansion[c] /= members.size[c]
    for j in range(flowing.count):
        if flowing.cell[j] == cell:
            i = flowing.row[j]
            dx, dy = edges.x[i] - members.x[c], edges.y[i] - members.y[c]
            members.variance_x[c] += dx * dx / members.size[c]
            members.variance_y[c] += dy * dy / members.size[c]


def found(
    flowing: Flowing, edges: EdgeColumns, circles: CircleColumns, around: Situation, settings: Settings, ids: Ids
) -> None:
    """Found circles from the remaining edges, those of one cell together, the largest groups first."""
    sort_left(flowing, edges, around, settings)
    cell = largest_cell(flowing, settings.circle_support)
    while cell >= 0:
        c = shared.row_for_newborn(edges, circles, False, settings)
        if c >= 0:
            average_cell(flowing, cell, flowing.members, edges, c)
            shared.give_birth(circles, c, flowing.members, c, settings, ids)
            circles.expansion[c] = flowing.mean_expansion[c]
        flowing.cell_size[cell] = 0
        cell = largest_cell(flowing, settings.circle_support)
    for j in range(flowing.count):
        if flowing.cell[j] >= 0:
            flowing.cell_size[flowing.cell[j]] = 0


def update(
    flowing: Flowing,
    edges: EdgeColumns,
    circles: CircleColumns,
    ignored: Bytes,
    around: Situation,
    settings: Settings,
    ids: Ids,
) -> None:
    """C_n from E_n (eqs. EdgeEncompare, EdgeCirclenormalcompare, percentinvolve).

    ``ignored``: (capacity,), circles under an active ψ, which are predicted only.
    """
    gather(flowing, edges, around, settings)
    open_circles(flowing, circles, ignored)
    involve(flowing, edges, circles, around, settings)
    average(flowing, flowing.members, edges)
    compare(flowing, circles, ignored, settings)
    for c in range(circles.capacity):
        if circles.trust[c] < settings.tr_cr:
            circles.active[c] = 0
    shared.release(edges, circles, False)
    found(flowing, edges, circles, around, settings, ids)
    direct(circles, around)


def mean_expansion(circles: CircleColumns) -> float:
    """Mean |V/r|, 1/s, of the circles, weighted by their edges; 0 without any."""
    total, edges = 0.0, 0
    for c in range(circles.capacity):
        if circles.active[c]:
            total += math.fabs(circles.expansion[c]) * circles.support[c]
            edges += circles.support[c]
    return total / max(edges, 1)
