"""The filter: one step takes a frame's corners and the vehicle's motion, and leaves its tables up to date."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Config
from lcf_edge.filter import edge_expert
from lcf_edge.filter.circles import newborn_trust
from lcf_edge.filter.edge_expert import Estimate, Relation
from lcf_edge.filter.feedback import MARGIN_PX, Feedback
from lcf_edge.filter.flow import KeyFrames, Matrix, Pinhole, carry, line_distance, wrap
from lcf_edge.filter.inputs import Corners, Motion
from lcf_edge.filter.line_expert import Groups, inside_psi
from lcf_edge.filter.matching import DISTANCE_COST, CornerIndex, difference, likeness_needed, one_to_one
from lcf_edge.filter.normal_circles import NormalCircles
from lcf_edge.filter.rebel_circles import RebelCircles, Rebels
from lcf_edge.filter.rebel_detection import (
    BASELINE_LEAST_S,
    BASELINE_SURE_S,
    Links,
    Surroundings,
    Verdict,
    agree,
    give_birth,
    judge,
    links_since,
)
from lcf_edge.filter.tables import KEYS, NO_CIRCLE, CircleTable, EdgeTable, Floats, Mask, PsiTable, Rows
from lcf_edge.lens import Lens
from lcf_edge.records import Sizes

PITCH_MEMORY_S = 1.0  # shaking faster than this does not change where the vehicle goes
YAW_MEMORY_S = 0.3
REFINE_LEAST = 25  # edges that a correction of the rotation needs
REFINE_MOST = 200  # and that are enough
PENDING = 2  # links of a chain that waits for its third key frame


@dataclass(frozen=True, slots=True)
class Step:
    """What one step tells besides the tables. ``omitted``: bool (corners,), inside ψ. ``evicted``: rows."""

    omitted: Mask
    sizes: Sizes


class LineCircleFilter:
    """The Line-Circle filter. Pure: no I/O, no clock, no threads; the same input gives the same bytes.

    All tables are allocated here, from ``config.memory``. Positions are px of the ideal pinhole of ``lens``; the lens
    itself is used only to find corners by their place in the frame.
    """

    def __init__(self, config: Config, lens: Lens) -> None:
        memory = config.memory
        self.settings = config.filter
        self._vehicle = config.vehicle
        self._camera = config.camera
        self._lens = lens
        self._pinhole = Pinhole(lens.fx, lens.fy, lens.cx, lens.cy)
        self.edges = EdgeTable(memory.edges_normal, memory.edges_rebel, memory.chains)
        self.normal = CircleTable(memory.circles_normal)
        self.rebel = CircleTable(memory.circles_rebel)
        self.psi = PsiTable(memory.psi)
        self.groups = Groups(memory.groups)
        self._index = CornerIndex(lens.width, lens.height)
        self._keys = KeyFrames()
        self._normal_circles = NormalCircles(config.filter)
        self._rebel_circles = RebelCircles(config.filter)
        self._feedback = Feedback(config.filter)
        self._tr_new = newborn_trust(config.filter)
        mount = np.array([-math.tan(config.camera.yaw_rad), math.tan(config.camera.pitch_rad), 1.0])
        self._mounted = mount / np.linalg.norm(mount)  # direction of travel in the camera's axes
        self._forward = self._mounted.copy()
        self._motion_px = 0.0  # median motion of edges since the last key frame

    def table_bytes(self) -> dict[str, int]:
        """Bytes of each preallocated table."""
        return {
            "edges (E_n, E_r, α)": self.edges.nbytes,
            "circles_normal (C_n)": self.normal.nbytes,
            "circles_rebel (C_r)": self.rebel.nbytes,
            "groups (λ)": self.groups.nbytes,
            "psi (ψ)": self.psi.nbytes,
            "corner index": self._index.nbytes,
        }

    @property
    def focus(self) -> tuple[float, float]:
        """O: where the vehicle is heading, px."""
        x, y, z = self._forward
        return self._pinhole.cx + self._pinhole.fx * x / z, self._pinhole.cy + self._pinhole.fy * y / z

    # -- one step -------------------------------------------------------------------------------------------------

    def step(self, corners: Corners, motion: Motion) -> Step:
        """Take one frame. ``motion.dt_s`` must be positive."""
        self._dt = np.float32(motion.dt_s)
        around = self._derotate(motion)
        corner_x = np.ascontiguousarray(corners.position[:, 0])
        corner_y = np.ascontiguousarray(corners.position[:, 1])
        estimate = self._predict(motion)
        omitted = self._omit(corners, corner_x, corner_y, estimate)
        evicted = self.groups.collect(self.normal, self.rebel, self.settings.tr_cr)

        kept = np.flatnonzero(~omitted)
        self._index.fill(corners.pixel[kept])
        edge, corner = self._match(estimate, corners.pixel, corners.appearance, kept, corner_x, corner_y, motion)
        estimate, self._sigma_rad = self._refine(estimate, edge, corner_x[corner], corner_y[corner], motion)
        self._keys.blur(self._sigma_rad)
        free = self._update_edges(estimate, edge, corner, kept, corners, corner_x, corner_y, motion)
        self._delete_edges()
        evicted += self._add_edges(free, corners, corner_x, corner_y, around)
        key = self._mark_key(motion)
        evicted += self._detect_rebels(around, key, motion)
        evicted += self._update_circles(around, motion)
        n = self.edges.count
        rebel = self.edges.rebel[:n]
        return Step(
            omitted,
            Sizes(
                corners=len(corners),
                omitted=int(np.count_nonzero(omitted)),
                edges_normal=n - int(np.count_nonzero(rebel)),
                edges_rebel=int(np.count_nonzero(rebel)),
                chains=int(np.count_nonzero(self.edges.links[:n])),
                circles_normal=self.normal.count,
                circles_rebel=self.rebel.count,
                groups=self.groups.count,
                psi=self.psi.count,
                evicted=evicted,
            ),
        )

    # -- step 0: the rotation is taken out of all that is stored -----------------------------------------------------

    def _derotate(self, motion: Motion) -> Surroundings:
        speed = motion.speed_mps
        self._turn(motion.rotation, motion.yaw_rate_radps, motion.dt_s)
        self._keys.advance(
            motion.rotation,
            self._forward,
            speed if math.isfinite(speed) else 1.0,
            motion.dt_s,
        )
        self._carry(motion.rotation)
        self._feedback.advance(self.psi, self.normal, self.focus, motion.dt_s)
        growth = self.normal.expansion * np.float32(motion.dt_s)
        fx, fy = np.float32(self.focus[0]), np.float32(self.focus[1])
        self.normal.x += (self.normal.x - fx) * growth
        self.normal.y += (self.normal.y - fy) * growth
        self.normal.radius *= 1 + growth
        self._rebel_circles.predict(self.rebel, motion.dt_s)
        for circles in (self.normal, self.rebel):
            circles.active &= self._in_frame(circles.x, circles.y)
        return Surroundings(
            pinhole=self._pinhole,
            focus=self.focus,
            horizon_y=self.focus[1],
            camera_height_m=self._camera.height_m,
            half_width_m=self._vehicle.half_width_m,
            height_m=self._vehicle.height_m,
            horizon_s=self._vehicle.horizon_s,
            speed_mps=speed,
            yaw_rate_radps=motion.yaw_rate_radps,
            noise_px=self.settings.edge_noise_px,
            delta_px=self.settings.delta_rebel_px,
            focus_sigma_px=self.settings.focus_sigma_px,
            ground_margin=self.settings.ground_margin,
            pitch_sigma_rad=self.settings.pitch_sigma_rad,
        )

    def _turn(self, rotation: Matrix, yaw_rate_radps: float, dt_s: float) -> None:
        """Where the vehicle heads, in the camera's axes: shaking turns the camera and not the heading, a turn both."""
        mounted = self._mounted / self._mounted[2]
        forward = self._forward / self._forward[2]
        shaken = rotation @ forward
        shaken /= shaken[2]
        shaken[0] -= yaw_rate_radps * dt_s  # a left turn moves the picture to the right
        keep_x, keep_y = math.exp(-dt_s / YAW_MEMORY_S), math.exp(-dt_s / PITCH_MEMORY_S)
        forward = np.array(
            [mounted[0] + keep_x * (shaken[0] - mounted[0]), mounted[1] + keep_y * (shaken[1] - mounted[1]), 1.0]
        )
        self._forward = forward / np.linalg.norm(forward)

    def _carry(self, rotation: Matrix) -> None:
        """H = K·R·K⁻¹ on every stored image position; directions turn with their positions."""
        h = self._pinhole.homography(rotation)
        edges, n = self.edges, self.edges.count
        roll = np.float32(math.atan2(h[1, 0], h[0, 0]))
        edges.x[:n], edges.y[:n] = carry(h, edges.x[:n], edges.y[:n])
        edges.origin_x[:n], edges.origin_y[:n] = carry(h, edges.origin_x[:n], edges.origin_y[:n])
        edges.beta[:n] += roll
        for table in (self.normal, self.rebel, self.psi):
            table.x[:], table.y[:] = carry(h, table.x, table.y)
        self.rebel.beta += roll

    # -- step 1: predictions, the Line expert, and matches -----------------------------------------------------------

    def _omit(self, corners: Corners, corner_x: Floats, corner_y: Floats, estimate: Estimate) -> Mask:
        """Corners inside ψ, after ending the regions where something is not as predicted."""
        edges, n, psi = self.edges, self.edges.count, self.psi
        edges.held[:n] = False
        if not psi.active.any():
            return np.zeros(len(corners), np.bool_)
        both = inside_psi(psi, np.concatenate([corner_x, estimate.x]), np.concatenate([corner_y, estimate.y]))
        holder, edge_holder = both[: len(corners)], both[len(corners) :]
        edge_holder[edges.rebel[:n] | (edges.links[:n] > 0)] = NO_CIRCLE
        held = np.flatnonzero(edge_holder != NO_CIRCLE)
        inside = np.flatnonzero(holder != NO_CIRCLE)
        seen = self._seen(held, estimate, corners.pixel[inside])
        self._feedback.end_surprised(psi, holder[inside], edge_holder[held], seen)
        omitted = (holder != NO_CIRCLE) & psi.active[holder]
        edges.held[:n] = (edge_holder != NO_CIRCLE) & psi.active[edge_holder]
        edges.born_key[:n][edges.held[:n]] = self._keys.number  # what is only predicted is no history
        return omitted

    def _seen(self, held: Rows, estimate: Estimate, pixel: npt.NDArray[np.int32]) -> Mask:
        """Whether one of the corners lies where each held edge is predicted, whatever it looks like; bool (h,)."""
        raw = self._lens.distort(np.stack([estimate.x[held], estimate.y[held]], axis=1))
        inside = np.flatnonzero(self._in_picture(raw))
        self._index.fill(pixel)
        reach = np.float32(self.settings.bl_min_px)
        who, what = self._index.candidates(raw[inside, 0], raw[inside, 1], reach)
        near = (np.abs(raw[inside[who]] - pixel[what]) <= reach).all(axis=1)
        seen = np.zeros(len(held), np.bool_)
        seen[inside[who[near]]] = True
        return seen

    def _predict(self, motion: Motion) -> Estimate:
        """E': normal edges go out along their flow line, rebels and chains as they went."""
        edges, n = self.edges, self.edges.count
        x, y, speed = edges.x[:n], edges.y[:n], edges.speed[:n]
        dx, dy = x - np.float32(self.focus[0]), y - np.float32(self.focus[1])
        own_way = edges.rebel[:n] | (edges.links[:n] > 0)
        edges.beta[:n] = np.where(own_way, edges.beta[:n], np.arctan2(dy, dx))
        circle = edges.circle[:n]
        grouped = (circle >= 0) & ~own_way & (edges.trust[:n] < self.settings.tr_s)
        expected = np.where(grouped, self.normal.expansion[np.maximum(circle, 0)] * np.hypot(dx, dy), speed)
        heading = edges.beta[:n] + np.where(edges.rebel[:n], edges.deviation[:n], 0)
        return edge_expert.predict(x, y, heading, speed, expected, motion.dt_s)

    def _match(
        self,
        estimate: Estimate,
        pixel: npt.NDArray[np.int32],
        appearance: npt.NDArray[np.uint8],
        kept: Rows,
        corner_x: Floats,
        corner_y: Floats,
        motion: Motion,
    ) -> tuple[Rows, Rows]:
        """Edges and corners that are the same landmark: near L' first, then, for the rest, near L."""
        edges, n = self.edges, self.edges.count
        widen = np.float32(min(3 * motion.rotation_sigma_rad * self._pinhole.focal, self.settings.leap_px))
        gate = edges.bl[:n] + widen
        wanted = ~edges.held[:n]
        likely = likeness_needed(edges.appearance[:n], self.settings.appearance_max, self.settings.appearance_share)
        first = self._pair(estimate.x, estimate.y, gate, wanted, pixel[kept], appearance, kept, likely)
        used = np.zeros(len(pixel), np.bool_)
        used[first[1]] = True
        wanted[first[0]] = False
        wanted &= ~edges.rebel[:n] & (edges.links[:n] == 0)
        left = np.flatnonzero(~used[kept])
        if not wanted.any() or not len(left):
            return first
        self._index.fill(pixel[kept[left]])
        young = edges.trust[:n] < self.settings.tr_s
        reach = np.where(young, np.float32(self.settings.leap_px), np.float32(self.settings.bl0_px)) + widen
        reach = np.maximum(gate, reach)
        second = self._pair(edges.x[:n], edges.y[:n], reach, wanted, pixel[kept[left]], appearance, kept[left], np.float32(0.5) * likely)
        return np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1]])

    def _pair(
        self,
        x: Floats,
        y: Floats,
        gate: Floats,
        wanted: Mask,
        pixel: npt.NDArray[np.int32],
        appearance: npt.NDArray[np.uint8],
        corner: Rows,
        likely: Floats,
    ) -> tuple[Rows, Rows]:
        """One-to-one pairs of the ``wanted`` edges, looked for at (x, y), and the corners in the index."""
        raw = self._lens.distort(np.stack([x, y], axis=1))
        rows = np.flatnonzero(wanted & self._in_picture(raw))
        who, what = self._index.candidates(raw[rows, 0], raw[rows, 1], gate[rows])
        edge = rows[who]
        off = raw[edge] - pixel[what]
        away = np.hypot(off[:, 0], off[:, 1])
        near = np.flatnonzero(away <= gate[edge])
        edge, what, away = edge[near], what[near], away[near]
        looks = difference(self.edges.appearance[edge], appearance[corner[what]])
        good = np.flatnonzero(looks < likely[edge])
        edge, what = edge[good], what[good]
        cost = looks[good] + np.float32(DISTANCE_COST) * away[good]
        best = one_to_one(edge, what, cost, len(x), len(pixel))
        return edge[best], corner[what[best]]

    def _refine(
        self, estimate: Estimate, edge: Rows, x: Floats, y: Floats, motion: Motion
    ) -> tuple[Estimate, float]:
        """Take out the rotation that the gyro missed: the one that puts trusted edges back on their flow lines.

        Weighted least squares over the distances from the flow lines, which depend on rotation alone; the gyro's
        uncertainty is the prior, so that with a good gyro or few edges nothing happens. Answers the predictions, and
        what is left of the uncertainty in rad.
        """
        edges = self.edges
        steady = ~edges.rebel[edge] & (edges.links[edge] == 0) & (edges.trust[edge] >= self.settings.tr_s)
        sample = np.flatnonzero(steady)
        if len(sample) < REFINE_LEAST or motion.rotation_sigma_rad <= 0:
            return estimate, motion.rotation_sigma_rad
        sample = sample[:: 1 + len(sample) // REFINE_MOST]
        rows, x, y = edge[sample], x[sample], y[sample]
        beta = estimate.beta[rows]
        off = line_distance(x - estimate.x[rows], y - estimate.y[rows], beta)
        pinhole = self._pinhole
        u, v = (x - np.float32(pinhole.cx)) / np.float32(pinhole.fx), (y - np.float32(pinhole.cy)) / np.float32(pinhole.fy)
        cos, sin = np.cos(beta), np.sin(beta)
        focal = np.float32(pinhole.focal)
        a = np.stack(
            [
                (sin * u * v - cos * (1 + v * v)) * focal,
                (-sin * (1 + u * u) + cos * u * v) * focal,
                (sin * v + cos * u) * focal,
            ]
        )
        noise = np.float32(0.7)
        prior = np.eye(3) * (noise / motion.rotation_sigma_rad) ** 2
        turn = np.zeros(3)
        for _ in range(3):
            rest = np.abs(off - turn.astype(np.float32) @ a)
            weight = 1 / np.square(1 + np.square(rest / (2 * noise)))
            wa = a * weight
            information = (wa @ a.T).astype(np.float64) + prior
            turn = np.linalg.solve(information, (wa @ off).astype(np.float64))
        w = turn
        rotation = np.array([[1, -w[2], w[1]], [w[2], 1, -w[0]], [-w[1], w[0], 1]])
        self._keys.correct(rotation)
        self._carry(rotation)
        h = pinhole.homography(rotation)
        ex, ey = carry(h, estimate.x, estimate.y)
        sigma = float(noise * np.sqrt(np.diag(np.linalg.inv(information))[:2].max()))  # of pitch and yaw
        return Estimate(ex, ey, estimate.speed, estimate.beta), sigma

    # -- step 2: Circle expert, edges -----------------------------------------------------------------------------------

    def _update_edges(
        self,
        estimate: Estimate,
        edge: Rows,
        corner: Rows,
        kept: Rows,
        corners: Corners,
        corner_x: Floats,
        corner_y: Floats,
        motion: Motion,
    ) -> Rows:
        """Classify the pairs, update or predict every edge; answers the corners that are left as new landmarks."""
        edges, n, settings = self.edges, self.edges.count, self.settings
        cx, cy = corner_x[corner], corner_y[corner]
        delta = np.float32(settings.delta_px + 2 * self._sigma_rad * self._pinhole.focal)
        at = Estimate(estimate.x[edge], estimate.y[edge], estimate.speed[edge], estimate.beta[edge])
        relation = edge_expert.classify(
            edges.x[edge], edges.y[edge], at, cx, cy, edges.bl[edge], delta, motion.dt_s, settings.eps_beta_rad
        )
        own_way = edges.rebel[edge] | (edges.links[edge] > 0)
        relation[own_way] = Relation.FOLLOWS  # λ*r: a rebel has no flow line to leave
        follows = (relation == Relation.FOLLOWS) | (relation == Relation.DISAGREES)

        # No match, λ*1, λ*4 and λ*5: the edge goes on as predicted.
        change = np.full(n, edge_expert.UNMATCHED)
        change[edges.held[:n]] = 0
        change[edge] = edge_expert.TRUST_CHANGE[relation]
        before_x, before_y = edges.x[edge], edges.y[edge]
        edges.x[:n], edges.y[:n], edges.speed[:n] = estimate.x, estimate.y, estimate.speed
        edges.matched[:n] = False

        rows, at_corner = edge[follows], corner[follows]
        mine = Estimate(at.x[follows], at.y[follows], at.speed[follows], at.beta[follows])
        trust = edges.trust[rows]
        zx, zy = corner_x[at_corner], corner_y[at_corner]
        edges.x[rows] = edge_expert.update_position(trust, settings.tr_cr, mine.x, zx)
        edges.y[rows] = edge_expert.update_position(trust, settings.tr_cr, mine.y, zy)
        edges.speed[rows] = edge_expert.update_speed(trust, settings.tr_cr, mine, zx, zy, motion.dt_s)
        circle = edges.circle[rows]
        table_corr = self.normal.corr[np.maximum(circle, 0)]
        corr = np.where((circle >= 0) & ~edges.rebel[rows], np.maximum(table_corr, np.float32(0.25)), np.float32(1))
        edges.bl[rows] = edge_expert.update_gate(
            edges.bl[rows], edges.speed[rows], mine.speed, corr, motion.dt_s, settings.bl_min_px, settings.bl0_px
        )
        edges.appearance[rows] = corners.appearance[at_corner]
        edges.matched[rows] = True
        self._update_rebels(rows[edges.rebel[rows] | (edges.links[rows] > 0)])
        edges.trust[:n] = edge_expert.change_trust(edges.trust[:n], change, settings.tr_max)

        # λ*4 and λ*5: the corner goes to α, with the history of the edge that it came from.
        strays = (relation == Relation.BREAKS) | (relation == Relation.STAYS)
        room = edges.capacity - edges.count
        strays &= np.cumsum(strays) <= room
        self._spawn(
            edge[strays], before_x[strays], before_y[strays], cx[strays], cy[strays], corner[strays], corners, motion
        )
        used = np.zeros(len(corners), np.bool_)
        used[at_corner] = True
        used[corner[strays]] = True
        return kept[~used[kept]]

    def _update_rebels(self, rows: Rows) -> None:
        """β from the origin to the last detected corner, and DL (eqs. of E_r)."""
        edges = self.edges
        beta = np.arctan2(edges.y[rows] - edges.origin_y[rows], edges.x[rows] - edges.origin_x[rows])
        far = np.hypot(edges.y[rows] - edges.origin_y[rows], edges.x[rows] - edges.origin_x[rows]) > 2
        before = edges.beta[rows]
        beta = np.where(far, beta, before)
        deviation = edge_expert.update_deviation(edges.deviation[rows], beta, before)
        edges.deviation[rows] = np.clip(deviation, -0.5, 0.5)
        edges.beta[rows] = beta

    def _spawn(
        self, edge: Rows, x0: Floats, y0: Floats, x: Floats, y: Floats, corner: Rows, corners: Corners, motion: Motion
    ) -> None:
        """A corner that left its edge's law starts a chain in α."""
        edges = self.edges
        rows = edges.duplicate(edge)
        edges.x[rows], edges.y[rows] = x, y
        edges.beta[rows] = np.arctan2(y - y0, x - x0)
        edges.speed[rows] = np.hypot(x - x0, y - y0) / np.float32(motion.dt_s)
        edges.origin_x[rows], edges.origin_y[rows] = x0, y0
        edges.deviation[rows] = 0
        edges.trust[rows] = self._tr_new
        edges.bl[rows] = np.float32(0.5 * self.settings.bl0_px)
        edges.links[rows] = 1
        edges.circle[rows] = NO_CIRCLE
        edges.matched[rows] = True
        edges.appearance[rows] = corners.appearance[corner]

    def _delete_edges(self) -> None:
        """Edges whose trust ran out, or that left the frame."""
        edges, n = self.edges, self.edges.count
        dead = ~(self._in_frame(edges.x[:n], edges.y[:n]) & (edges.trust[:n] >= self.settings.tr_cr))
        edges.remove(dead)

    def _in_frame(self, x: Floats, y: Floats) -> Mask:
        """Whether positions of the ideal pinhole lie in the picture; bool (n,)."""
        return self._in_picture(self._lens.distort(np.stack([x, y], axis=1)))

    def _in_picture(self, raw: Floats) -> Mask:
        """Whether px of the input frame lie in it; float32 (n, 2), NaN is outside."""
        x, y = raw[:, 0], raw[:, 1]
        return (x >= 0) & (y >= 0) & (x <= self._lens.width - 1) & (y <= self._lens.height - 1)

    def _add_edges(
        self, free: Rows, corners: Corners, corner_x: Floats, corner_y: Floats, around: Surroundings
    ) -> int:
        """Corners in no group or without a match are new landmarks; answers how many rows had to leave."""
        edges, settings = self.edges, self.settings
        n = edges.count
        rebel = edges.rebel[:n]
        normal_left = edges.normal_capacity - (n - int(np.count_nonzero(rebel)))
        room = min(normal_left, edges.capacity - n)
        evicted = max(0, len(free) - room)
        if evicted:
            weak = edges.least_trusted(~rebel & (edges.trust[:n] < self._tr_new), evicted)
            dead = np.zeros(n, np.bool_)
            dead[weak] = True
            edges.remove(dead)
            free = free[: max(0, room) + len(weak)]
        rows = edges.append(len(free))
        x, y = corner_x[free], corner_y[free]
        dx, dy = x - np.float32(around.focus[0]), y - np.float32(around.focus[1])
        edges.x[rows], edges.y[rows] = x, y
        edges.beta[rows] = np.arctan2(dy, dx)
        edges.speed[rows] = self._first_speed(x, y, np.hypot(dx, dy), around)
        edges.bl[rows] = settings.bl0_px
        edges.trust[rows] = self._tr_new
        edges.appearance[rows] = corners.appearance[free]
        edges.born_key[rows] = self._keys.number
        self._join_rebels(rows)
        edges.matched[rows] = True
        return evicted

    def _join_rebels(self, rows: slice) -> None:
        """New landmarks inside a rebel circle are expected to move as it does: they start in α with its motion."""
        edges = self.edges
        x, y = edges.x[rows], edges.y[rows]
        circle, vx, vy = self._rebel_circles.motion_at(self.rebel, x, y)
        joins = np.flatnonzero(circle >= 0)
        at = joins + rows.start
        vx, vy = vx[joins], vy[joins]
        edges.links[at] = 1
        edges.beta[at] = np.arctan2(vy, vx)
        edges.speed[at] = np.hypot(vx, vy)
        edges.origin_x[at], edges.origin_y[at] = x[joins], y[joins]
        edges.bl[at] = np.maximum(np.float32(0.5 * self.settings.bl0_px), np.float32(0.25) * edges.speed[at] * self._dt)

    def _first_speed(self, x: Floats, y: Floats, r: Floats, around: Surroundings) -> Floats:
        """V of a new landmark: what its λ group's circle implies, else the ground, else a configured depth."""
        speed = around.speed_mps if math.isfinite(around.speed_mps) else 0.0
        expansion = np.full(len(x), speed / self.settings.scene_depth_m, np.float32)
        if around.camera_height_m > 0:
            below = np.maximum(y - np.float32(around.horizon_y), 0)
            ground = np.float32(speed / (around.camera_height_m * self._pinhole.focal)) * below
            expansion = np.maximum(expansion, ground) if speed >= 0 else np.minimum(expansion, ground)
        group = self.groups.assign(x, y)
        circle = np.where(group >= 0, self.groups.row[np.maximum(group, 0)], NO_CIRCLE) if self.groups.count else group
        known = circle >= 0
        expansion[known] = self.normal.expansion[circle[known]]
        return (expansion * r).astype(np.float32)

    # -- step 3: α ---------------------------------------------------------------------------------------------------------

    def _mark_key(self, motion: Motion) -> bool:
        """Make this frame a key frame when there is motion enough to be told from corner noise."""
        settings, edges, keys = self.settings, self.edges, self._keys
        n = edges.count
        speeds = np.abs(edges.speed[:n])
        self._motion_px += float(np.median(speeds)) * motion.dt_s if n else 0.0
        due = keys.since_s + 0.5 * motion.dt_s >= settings.key_interval_s or keys.number == 0
        moved = self._motion_px >= settings.key_motion_px
        late = keys.since_s + 0.5 * motion.dt_s >= 2 * settings.key_interval_s
        if not (due and (moved or late or keys.number == 0)):
            return False
        slot = keys.mark()
        edges.key_x[slot, :n] = edges.x[:n]
        edges.key_y[slot, :n] = edges.y[:n]
        self._motion_px = 0.0
        return True

    def _detect_rebels(self, around: Surroundings, key: bool, motion: Motion) -> int:
        """Chains of three key positions that break the flow become E_r; rebels that follow it again lose trust."""
        edges, keys, settings = self.edges, self._keys, self.settings
        n = edges.count
        oldest = np.maximum(edges.born_key[:n], keys.number - KEYS)
        oldest_s = keys.elapsed_s[oldest % KEYS]
        rows = np.flatnonzero(edges.matched[:n] & (oldest < keys.number) & (oldest_s >= BASELINE_LEAST_S))
        evicted = 0
        self._rebels = None
        if not len(rows):
            return 0
        first = links_since(edges, rows, oldest[rows], keys, around)
        x, y = edges.x[rows], edges.y[rows]
        whole = judge(first, x, y, around)
        breaks = whole.mover | whole.incoming
        rebel = edges.rebel[rows]

        # Rebels: still one, or back in the flow.
        obeys = rows[rebel & ~breaks]
        edges.trust[obeys] -= 2
        home = obeys[edges.trust[obeys] < settings.tr_cr]
        edges.rebel[home] = False
        edges.trust[home] = self._tr_new
        edges.circle[home] = NO_CIRCLE
        edges.speed[home] = self._outward_speed(home)

        # Normal edges and chains: a third consistent link makes a rebel, an inconsistent one frees the chain.
        suspects = np.flatnonzero(~rebel & breaks)
        calm = rows[~rebel & ~breaks & (edges.links[rows] > 0)]
        edges.links[calm] = 0
        edges.speed[calm] = self._outward_speed(calm)
        middle = (oldest[rows[suspects]] + keys.number - key) // 2
        has_three = middle > oldest[rows[suspects]]
        waiting = rows[suspects[~has_three]]
        edges.links[waiting] = np.minimum(edges.links[waiting] + key, PENDING)
        edges.links[waiting] = np.maximum(edges.links[waiting], 1)
        suspects, middle = suspects[has_three], middle[has_three]
        if len(suspects):
            those = rows[suspects]
            second = links_since(edges, those, middle, keys, around)
            recent = judge(second, x[suspects], y[suspects], around)
            part = _take(whole, suspects)
            ok = agree(part, first.elapsed_s[suspects], recent, second.elapsed_s, settings.edge_noise_px)
            fail = those[~ok]
            edges.links[fail] = 0
            torn = those[~ok & part.mover]  # not one landmark: its history is worth nothing
            edges.born_key[torn] = keys.number
            born = those[ok]
            room = edges.rebel_capacity - int(np.count_nonzero(edges.rebel[:n]))
            evicted = max(0, len(born) - room)
            born, ok_rows = born[:room], np.flatnonzero(ok)[:room]
            give_birth(edges, born, _take(first, suspects[ok_rows]), _take(second, ok_rows))
            edges.circle[born] = NO_CIRCLE
            edges.trust[born] = self._tr_new
            edges.bl[born] = np.maximum(edges.bl[born], settings.bl_min_px * 2)
        now = edges.rebel[rows] & breaks
        at = np.flatnonzero(now)
        rebels = _take(first, at)
        t = rebels.elapsed_s
        self._rebels = Rebels(
            rows[at], x[at], y[at], (x[at] - rebels.x) / t, (y[at] - rebels.y) / t, rebels, _take(whole, at)
        )
        edges.origin_x[rows[at]], edges.origin_y[rows[at]] = rebels.x, rebels.y  # O slides with the chain's window
        return evicted

    def _outward_speed(self, rows: Rows) -> Floats:
        """V along the flow line of edges that went their own way until now."""
        edges = self.edges
        dx, dy = edges.x[rows] - np.float32(self.focus[0]), edges.y[rows] - np.float32(self.focus[1])
        return edges.speed[rows] * np.cos(wrap(edges.beta[rows] - np.arctan2(dy, dx)))

    # -- steps 4 and 5: circles, ψ, λ ----------------------------------------------------------------------------------------

    def _update_circles(self, around: Surroundings, motion: Motion) -> int:
        edges, n = self.edges, self.edges.count
        ignored = self._feedback.ignored(self.psi, self.normal)
        evicted = self._normal_circles.update(edges, self.normal, around.focus, ignored)
        rebels = self._rebels or _no_rebels()
        evicted += self._rebel_circles.update(edges, self.rebel, rebels, around, motion.speed_mps)
        breaking = edges.rebel[:n] | (edges.links[:n] > 0)
        active = self.rebel.active
        x = np.concatenate([edges.x[:n][breaking], self.rebel.x[active]])
        y = np.concatenate([edges.y[:n][breaking], self.rebel.y[active]])
        reach = np.concatenate(
            [np.full(int(np.count_nonzero(breaking)), np.float32(MARGIN_PX)), self.rebel.radius[active] + np.float32(2 * MARGIN_PX)]
        )
        evicted += self._feedback.write(self.psi, self.normal, self._harmless(around) & self._looked_at(), motion.dt_s)
        self._feedback.give_way(self.psi, x, y, reach)
        return evicted

    def _harmless(self, around: Surroundings) -> Mask:
        """Normal circles that pass by at a distance; bool (capacity,). Nothing on the path may be ignored."""
        speed = around.speed_mps
        if not math.isfinite(speed) or speed <= 0:
            return np.zeros(self.normal.capacity, np.bool_)
        range_m = np.float32(speed) / np.maximum(self.normal.expansion, np.float32(1e-3))
        right = (self.normal.x - np.float32(around.focus[0])) / np.float32(self._pinhole.fx)
        reach = self.normal.radius / np.float32(self._pinhole.fx) * range_m
        beside = np.abs(right * range_m) - reach
        return (self.normal.expansion > 0) & (beside > 1.5 * around.half_width_m)


    def _looked_at(self) -> Mask:
        """Normal circles most of whose edges have a history that α has judged; bool (capacity,)."""
        edges, n, keys = self.edges, self.edges.count, self._keys
        circle = edges.circle[:n]
        member = (circle >= 0) & ~edges.rebel[:n]
        oldest = np.maximum(edges.born_key[:n], keys.number - KEYS)
        judged = member & (oldest < keys.number) & (keys.elapsed_s[oldest % KEYS] >= BASELINE_SURE_S)
        capacity = self.normal.capacity
        count = np.bincount(circle[member], minlength=capacity)
        return 2 * np.bincount(circle[judged], minlength=capacity) > count


def _take(record: "Verdict | Links", rows: Rows) -> "Verdict | Links":
    return type(record)(*(getattr(record, name)[rows] for name in record.__slots__))


def _no_rebels() -> Rebels:
    none = np.empty(0, np.float32)
    no = np.empty(0, np.bool_)
    return Rebels(
        np.empty(0, np.intp),
        none,
        none,
        none,
        none,
        Links(*[none] * 7),
        Verdict(*[none] * 8, no, no),
    )
