"""Circle expert, edges: predicts E', finds their corners, classifies (λ*), updates, adds and deletes edges."""

import math

import numpy as np
import numpy.typing as npt

from lcf_edge.config import Filter
from lcf_edge.filter.circles import newborn_trust
from lcf_edge.filter.derotation import LEAST_EDGES, MOST_EDGES
from lcf_edge.filter.edge_equations import (
    TRUST_CHANGE,
    UNMATCHED,
    Estimate,
    Relation,
    change_trust,
    classify,
    predict,
    update_deviation,
    update_gate,
    update_position,
    update_speed,
)
from lcf_edge.filter.flow import line_distance
from lcf_edge.filter.inputs import Corners, Motion
from lcf_edge.filter.line_expert import Groups
from lcf_edge.filter.matching import Found, Matcher, likeness_needed
from lcf_edge.filter.rebel_circles import RebelCircles
from lcf_edge.filter.situation import Situation
from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, EdgeTable, Floats, Mask, Rows

LEAST_CORR = 0.25
SWING_SHARE = 0.2  # of its own motion, by which a rebel may miss its prediction
DEVIATION_MOST_RAD = 0.5  # DL is bounded
ORIGIN_LEAST_PX = 2.0  # an edge nearer to its origin has no direction from it


class EdgeExpert:
    """Works on the table of edges (E_n, E_r and the chains of α)."""

    def __init__(self, settings: Filter, matcher: Matcher, edges: EdgeTable, normal: CircleTable) -> None:
        self._settings = settings
        self._matcher = matcher
        self._edges = edges
        self._normal = normal
        self._tr_new = newborn_trust(settings)

    def predict(self, around: Situation, dt_s: float) -> Estimate:
        """E': normal edges go out along their flow line, rebels and chains as they went.

        A newborn takes half of its speed from its circle; an edge that has proven itself, from itself: pulled
        towards a circle of another depth, it would run beside its corner.
        """
        edges, n = self._edges, self._edges.count
        x, y, speed = edges.x[:n], edges.y[:n], edges.speed[:n]
        dx, dy = x - np.float32(around.focus[0]), y - np.float32(around.focus[1])
        r = np.sqrt(dx * dx + dy * dy)
        inverse = 1 / np.maximum(r, np.float32(1e-3))
        cos, sin = dx * inverse, dy * inverse
        own_way = edges.own_way()
        turned = own_way.nonzero()[0]
        if len(turned):
            heading = edges.beta[turned] + np.where(edges.rebel[turned], edges.deviation[turned], 0)
            cos[turned], sin[turned] = np.cos(heading), np.sin(heading)
        newborn = (edges.trust[:n] < self._settings.tr_s) & ~own_way
        newborn &= edges.circle[:n] >= 0
        rows = newborn.nonzero()[0]
        expected = speed.copy()
        expected[rows] = self._normal.expansion.take(edges.circle[rows]) * r[rows]
        return predict(x, y, cos, sin, speed, expected, dt_s)

    def find(self, estimate: Estimate, corners: Corners, kept: Rows, slack_px: float) -> Found:
        """Edges and corners that are the same landmark: near L' first, then, for the rest, near L.

        ``kept``: corners outside ψ. ``slack_px``: by which the camera's rotation is uncertain.
        """
        edges, n, settings = self._edges, self._edges.count, self._settings
        slack = np.float32(min(slack_px, settings.leap_px))
        gate = edges.bl[:n] + slack
        wanted = ~edges.held[:n]
        looks = edges.appearance[:n]
        likely = likeness_needed(looks, settings.appearance_max, settings.appearance_share)
        free = np.zeros(len(corners), np.bool_)
        free[kept] = True
        first = self._matcher.pair(estimate.x, estimate.y, looks, gate, likely, wanted, corners, free)
        free[first.corner] = False
        wanted[first.edge] = False
        wanted &= ~edges.own_way()
        if not wanted.any() or not free.any():
            return first
        young = edges.trust[:n] < settings.tr_s
        reach = np.where(young, np.float32(settings.leap_px), np.float32(settings.bl0_px))
        reach = np.maximum(gate, reach + slack)
        likely *= np.float32(0.5)  # a wider look needs a better likeness
        second = self._matcher.pair(edges.x[:n], edges.y[:n], looks, reach, likely, wanted, corners, free)
        return Found(np.concatenate([first.edge, second.edge]), np.concatenate([first.corner, second.corner]))

    def off_line(
        self, estimate: Estimate, found: Found, x: Floats, y: Floats
    ) -> tuple[Floats, Floats, Floats, Floats, Floats] | None:
        """Trusted normal edges that tell about the rotation: corners x, y, px off the flow line, cos β, sin β."""
        edges, rows = self._edges, found.edge
        sample = ((edges.trust.take(rows) >= self._settings.tr_s) & ~edges.own_way().take(rows)).nonzero()[0]
        if len(sample) < LEAST_EDGES:
            return None
        sample = sample[:: 1 + len(sample) // MOST_EDGES]
        at, corner = estimate.take(rows.take(sample)), found.corner.take(sample)
        x, y = x.take(corner), y.take(corner)
        return x, y, line_distance(x - at.x, y - at.y, at.cos, at.sin), at.cos, at.sin

    def update(
        self,
        estimate: Estimate,
        found: Found,
        corners: Corners,
        x: Floats,
        y: Floats,
        motion: Motion,
        rotation_px: float,
    ) -> Mask:
        """Classify the pairs, update or predict every edge; answers the corners that are taken, bool (corners,).

        ``x``, ``y``: corners, px. ``rotation_px``: what is left uncertain of the rotation.
        """
        edges, n, settings = self._edges, self._edges.count, self._settings
        edge, corner = found.edge, found.corner
        at = estimate.take(edge)
        delta = settings.delta_px + 2 * rotation_px
        before_x, before_y = edges.x.take(edge), edges.y.take(edge)
        cx, cy = x.take(corner), y.take(corner)
        relation = classify(before_x, before_y, at, cx, cy, edges.bl.take(edge), delta, settings.eps_beta_rad)
        relation[edges.own_way().take(edge)] = Relation.FOLLOWS  # λ*r: no flow line to leave

        # No match, λ*1, λ*4 and λ*5: the edge goes on as predicted.
        change = np.full(n, UNMATCHED)
        change[edges.held[:n]] = 0
        change[edge] = TRUST_CHANGE.take(relation)
        edges.x[:n], edges.y[:n], edges.speed[:n] = estimate.x, estimate.y, estimate.speed
        edges.matched[:n] = False

        follows = ((relation == Relation.FOLLOWS) | (relation == Relation.DISAGREES)).nonzero()[0]
        rows, seen = edge.take(follows), corner.take(follows)
        self._include(rows, at.take(follows), cx.take(follows), cy.take(follows), motion.dt_s)
        edges.appearance[rows] = corners.appearance.take(seen, axis=0)
        edges.matched[rows] = True
        edges.trust[:n] = change_trust(edges.trust[:n], change, settings.tr_max)

        strays = ((relation == Relation.BREAKS) | (relation == Relation.STAYS)).nonzero()[0]
        strays = strays[: edges.capacity - n]
        self._stray(edge[strays], corner[strays], before_x[strays], before_y[strays], corners, x, y, motion.dt_s)
        taken = np.zeros(len(corners), np.bool_)
        taken[seen] = True
        taken[corner[strays]] = True
        return taken

    def _include(self, rows: Rows, at: Estimate, x: Floats, y: Floats, dt_s: float) -> None:
        """L, V, BL of edges whose corner was found (eq. EnEstimation); β and DL of rebels and chains."""
        edges, settings = self._edges, self._settings
        trust = edges.trust.take(rows)
        edges.x[rows] = update_position(trust, settings.tr_cr, at.x, x)
        edges.y[rows] = update_position(trust, settings.tr_cr, at.y, y)
        speed = update_speed(trust, settings.tr_cr, at, x, y, dt_s)
        edges.speed[rows] = speed
        own_way = edges.own_way().take(rows)
        circle = edges.circle.take(rows)
        corr = np.maximum(self._normal.corr.take(circle, mode="clip"), np.float32(LEAST_CORR))
        corr[(circle < 0) | edges.rebel.take(rows)] = 1
        gate = update_gate(edges.bl.take(rows), speed, at.speed, corr, dt_s, settings.bl_min_px, settings.bl0_px)
        swing = np.float32(SWING_SHARE * dt_s) * np.abs(speed)  # what comes near accelerates in the picture
        edges.bl[rows] = np.maximum(gate, swing, out=gate, where=own_way)
        rows = rows[own_way]
        if not len(rows):
            return
        dx, dy = edges.x[rows] - edges.origin_x[rows], edges.y[rows] - edges.origin_y[rows]
        before = edges.beta[rows]
        beta = np.where(np.hypot(dx, dy) > ORIGIN_LEAST_PX, np.arctan2(dy, dx), before)
        deviation = update_deviation(edges.deviation[rows], beta, before)
        edges.deviation[rows] = np.clip(deviation, -DEVIATION_MOST_RAD, DEVIATION_MOST_RAD)
        edges.beta[rows] = beta

    def _stray(
        self,
        edge: Rows,
        corner: Rows,
        x0: Floats,
        y0: Floats,
        corners: Corners,
        x: Floats,
        y: Floats,
        dt_s: float,
    ) -> None:
        """λ*4 and λ*5: the corner goes to α, with the history of the edge whose law it broke."""
        edges = self._edges
        rows = edges.duplicate(edge)
        x1, y1 = x[corner], y[corner]
        edges.x[rows], edges.y[rows] = x1, y1
        edges.beta[rows] = np.arctan2(y1 - y0, x1 - x0)
        edges.speed[rows] = np.hypot(x1 - x0, y1 - y0) / np.float32(dt_s)
        edges.origin_x[rows], edges.origin_y[rows] = x0, y0
        edges.deviation[rows] = 0
        edges.trust[rows] = self._tr_new
        edges.bl[rows] = 0.5 * self._settings.bl0_px
        edges.links[rows] = 1
        edges.circle[rows] = NO_CIRCLE
        edges.matched[rows] = True
        edges.appearance[rows] = corners.appearance[corner]

    def delete(self) -> None:
        """Edges whose trust ran out, or that left the frame."""
        edges, n = self._edges, self._edges.count
        edges.remove(~(self._matcher.in_frame(edges.x[:n], edges.y[:n]) & (edges.trust[:n] >= self._settings.tr_cr)))

    def add(
        self,
        free: Rows,
        corners: Corners,
        x: Floats,
        y: Floats,
        around: Situation,
        groups: Groups,
        key_number: int,
    ) -> tuple[slice, int]:
        """Corners that no edge claims are new landmarks (λ*1 among them); answers their rows and the evictions.

        When the table is full, newborns take the place of edges that are trusted less than they are.
        """
        edges, settings = self._edges, self._settings
        room = min(edges.normal_room(), edges.capacity - edges.count)
        evicted = max(0, len(free) - room)
        if evicted:
            n = edges.count
            weak = edges.least_trusted(~edges.rebel[:n] & (edges.trust[:n] < self._tr_new), evicted)
            dead = np.zeros(n, np.bool_)
            dead[weak] = True
            edges.remove(dead)
            free = free[: max(0, room) + len(weak)]
        rows = edges.append(len(free))
        x, y = x.take(free), y.take(free)
        dx, dy = x - np.float32(around.focus[0]), y - np.float32(around.focus[1])
        edges.x[rows], edges.y[rows] = x, y
        edges.speed[rows] = self._first_expansion(x, y, around, groups) * np.sqrt(dx * dx + dy * dy)
        edges.bl[rows] = settings.bl0_px
        edges.trust[rows] = self._tr_new
        edges.appearance[rows] = corners.appearance.take(free, axis=0)
        edges.born_key[rows] = key_number
        edges.matched[rows] = True
        return rows, evicted

    def _first_expansion(self, x: Floats, y: Floats, around: Situation, groups: Groups) -> npt.NDArray[np.float32]:
        """V/r of new landmarks: what the circle of their λ group implies, else the ground, else a configured depth."""
        speed = around.speed_mps if math.isfinite(around.speed_mps) else 0.0
        expansion = np.full(len(x), speed / self._settings.scene_depth_m, np.float32)
        if around.camera_height_m > 0:
            below = np.maximum(y - np.float32(around.horizon_y), 0)
            ground = np.float32(speed / (around.camera_height_m * around.pinhole.focal)) * below
            expansion = np.where(np.abs(ground) > np.abs(expansion), ground, expansion)
        circle = groups.circle_at(x, y)
        known = circle >= 0
        expansion[known] = self._normal.expansion[circle[known]]
        return expansion

    def join_rebels(self, rows: slice, circles: CircleTable, rebel_circles: RebelCircles, dt_s: float) -> None:
        """New landmarks inside a rebel circle are expected to move as it does: they start in α with its motion."""
        edges = self._edges
        circle, vx, vy = rebel_circles.motion_at(circles, edges.x[rows], edges.y[rows])
        joins = np.flatnonzero(circle >= 0)
        at = joins + rows.start
        vx, vy = vx[joins], vy[joins]
        edges.links[at] = 1
        edges.beta[at] = np.arctan2(vy, vx)
        edges.speed[at] = np.hypot(vx, vy)
        edges.origin_x[at], edges.origin_y[at] = edges.x[at], edges.y[at]
        edges.bl[at] = np.maximum(0.5 * self._settings.bl0_px, 0.25 * edges.speed[at] * np.float32(dt_s))
