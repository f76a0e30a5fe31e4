"""The filter: one step takes a frame's corners and the vehicle's motion, and leaves its tables up to date."""

import math
from dataclasses import dataclass

import numpy as np

from lcf_edge.config import Config
from lcf_edge.filter.alpha import Alpha
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.derotation import Residual, derotate, missing_rotation
from lcf_edge.filter.edge_equations import Estimate
from lcf_edge.filter.edge_expert import EdgeExpert
from lcf_edge.filter.feedback import Feedback
from lcf_edge.filter.flow import KeyFrames, Matrix, Pinhole, carry
from lcf_edge.filter.inputs import Corners, Motion
from lcf_edge.filter.line_expert import Groups, LineExpert
from lcf_edge.filter.matching import Found, Matcher
from lcf_edge.filter.normal_circles import NormalCircles
from lcf_edge.filter.rebel_circles import RebelCircles
from lcf_edge.filter.rebel_detection import Rebels
from lcf_edge.filter.situation import Heading, Situation, situation
from lcf_edge.filter.tables import CircleTable, EdgeTable, Floats, Mask, PsiTable
from lcf_edge.lens import Lens
from lcf_edge.records import Sizes

SURPRISE_PX = 4.0  # a rotation may exceed the latest ones by this
FORGET = 0.3


@dataclass(frozen=True, slots=True)
class Step:
    """What one step tells besides the tables.

    ``omitted``: bool (corners,), inside ψ. ``residual``: the rotation that the gyro missed, None: too few
    edges tell it.
    """

    omitted: Mask
    sizes: Sizes
    residual: Residual | None


class LineCircleFilter:
    """The Line-Circle filter. Pure: no I/O, no clock, no threads; the same input gives the same bytes.

    All tables are allocated here, from ``config.memory``. Positions are px of the ideal pinhole of ``lens``; the lens
    itself is used only to find corners by their place in the frame.
    """

    def __init__(self, config: Config, lens: Lens) -> None:
        memory, settings = config.memory, config.filter
        self._config = config
        self._pinhole = Pinhole(lens.fx, lens.fy, lens.cx, lens.cy)
        self.edges = EdgeTable(memory.edges_normal, memory.edges_rebel, memory.chains)
        self.normal = CircleTable(memory.circles_normal)
        self.rebel = CircleTable(memory.circles_rebel)
        self.psi = PsiTable(memory.psi)
        self.groups = Groups(memory.groups)
        self._keys = KeyFrames()
        self._heading = Heading(self._pinhole, config.camera)
        self._matcher = Matcher(lens)
        self._line_expert = LineExpert(settings, self._matcher, self.edges, self.psi)
        self._edge_expert = EdgeExpert(settings, self._matcher, self.edges, self.normal)
        self._alpha = Alpha(settings, self.edges, self._keys)
        ids = Ids()  # one count, so that an id names one circle of either kind
        self._normal_circles = NormalCircles(settings, ids)
        self._rebel_circles = RebelCircles(settings, config.vehicle.horizon_s, ids)
        self._feedback = Feedback(settings, self._matcher)
        self._missing_px = settings.leap_px  # by which the gyro lately missed the rotation

    def table_bytes(self) -> dict[str, int]:
        """Bytes of each preallocated table."""
        return {
            "edges (E_n, E_r, α)": self.edges.nbytes,
            "circles_normal (C_n)": self.normal.nbytes,
            "circles_rebel (C_r)": self.rebel.nbytes,
            "groups (λ)": self.groups.nbytes,
            "psi (ψ)": self.psi.nbytes,
            "corner index": self._matcher.nbytes,
        }

    @property
    def focus(self) -> tuple[float, float]:
        """O: where the vehicle is heading, px."""
        return self._heading.focus

    def step(self, corners: Corners, motion: Motion) -> Step:
        """Take one frame. ``motion.dt_s`` must be positive."""
        x, y = np.ascontiguousarray(corners.position.T)
        self._matcher.fill(corners.pixel)
        around = self._derotate(motion)

        estimate = self._edge_expert.predict(around, motion.dt_s)
        omitted = self._line_expert.omit(corners, x, y, estimate, self._keys.number)
        evicted = self.groups.collect(self.normal, self.rebel, self._config.filter.tr_cr)

        kept = (~omitted).nonzero()[0]
        found = self._edge_expert.find(estimate, corners, kept, self._slack_px(motion))
        estimate, sigma_rad, residual = self._refine(estimate, found, x, y, motion)
        taken = self._edge_expert.update(estimate, found, corners, x, y, motion, sigma_rad * self._pinhole.focal)
        self._edge_expert.delete()
        rows, left = self._edge_expert.add(kept[~taken[kept]], corners, x, y, around, self.groups, self._keys.number)
        self._edge_expert.join_rebels(rows, self.rebel, self._rebel_circles, motion.dt_s)
        evicted += left

        rebels, left = self._alpha.detect(around, self._alpha.mark_key(motion.dt_s))
        evicted += left
        evicted += self._update_circles(around, rebels, motion.dt_s)
        evicted += self.edges.trim()
        return Step(omitted, self._sizes(len(corners), omitted, evicted), residual)

    def _derotate(self, motion: Motion) -> Situation:
        """Step 0, and the predictions of circles and ψ."""
        for table in (self.normal, self.rebel, self.psi):
            table.park()
        self._heading.turn(motion)
        speed = motion.speed_mps if math.isfinite(motion.speed_mps) else 1.0  # of an unknown speed, the direction
        self._keys.advance(motion.rotation, self._heading.forward, speed, motion.dt_s)
        self._carry(motion.rotation)
        self._normal_circles.predict(self.normal, self.focus, motion.dt_s)
        self._rebel_circles.predict(self.rebel, motion.dt_s)
        self.normal.active &= self._matcher.in_frame(self.normal.x, self.normal.y)
        self.rebel.active &= self._matcher.in_frame(*self._rebel_circles.innermost(self.rebel, self._pinhole))
        self._feedback.advance(self.psi, self.normal, self.focus, motion.dt_s)  # ψ ends with its circle
        return situation(self._config, self._pinhole, self._heading, motion)

    def _carry(self, rotation: Matrix) -> None:
        derotate(self._pinhole, rotation, self.edges, (self.normal, self.rebel), self.psi)

    def _slack_px(self, motion: Motion) -> float:
        """By how much the rotation may shift the picture: as the gyro says, or, without one, as it lately did."""
        gyro_px = 3 * motion.rotation_sigma_rad * self._pinhole.focal
        return min(gyro_px, SURPRISE_PX + 3 * self._missing_px, self._config.filter.leap_px)

    def _refine(
        self, estimate: Estimate, found: Found, x: Floats, y: Floats, motion: Motion
    ) -> tuple[Estimate, float, Residual | None]:
        """Take out the rotation that the gyro missed. Return the predictions, what stays uncertain, rad, and it."""
        residual = None
        sigma_rad = motion.rotation_sigma_rad
        told = self._edge_expert.off_line(estimate, found, x, y) if sigma_rad > 0 else None
        if told is not None:
            rotation, sigma_rad, residual = missing_rotation(self._pinhole, *told, sigma_rad)
            missed_px = math.hypot(rotation[0, 2], rotation[1, 2]) * self._pinhole.focal
            self._missing_px += FORGET * (missed_px - self._missing_px)
            self._keys.correct(rotation)
            self._carry(rotation)
            ex, ey = carry(self._pinhole.homography(rotation), estimate.x, estimate.y)
            estimate = Estimate(ex, ey, estimate.speed, estimate.cos, estimate.sin)
        else:
            self._missing_px = self._config.filter.leap_px  # lost: look everywhere
        self._keys.blur(sigma_rad)
        return estimate, sigma_rad, residual

    def _update_circles(self, around: Situation, rebels: Rebels | None, dt_s: float) -> int:
        """Steps 4 and 5: circles, ψ; answers evictions."""
        edges = self.edges
        ignored = self._feedback.ignored(self.psi, self.normal)
        evicted = self._normal_circles.update(edges, self.normal, around, ignored)
        evicted += self._rebel_circles.update(edges, self.rebel, rebels, around)
        ready = self._feedback.ready(self.psi, self.normal)
        passing = self._normal_circles.passing_by(self.normal, around)
        ready &= passing
        if ready.any():
            ready &= self._alpha.looked_at(self.normal.capacity)
            evicted += self._feedback.write(self.psi, self.normal, ready, dt_s)
        self._feedback.give_way(self.psi, passing, edges, self.rebel)
        return evicted

    def _sizes(self, corners: int, omitted: Mask, evicted: int) -> Sizes:
        n = self.edges.count
        rebels = int(np.count_nonzero(self.edges.rebel[:n]))
        return Sizes(
            corners=corners,
            omitted=int(np.count_nonzero(omitted)),
            edges_normal=n - rebels,
            edges_rebel=rebels,
            chains=int(np.count_nonzero(self.edges.links[:n])),
            circles_normal=self.normal.count,
            circles_rebel=self.rebel.count,
            groups=self.groups.count,
            psi=self.psi.count,
            evicted=evicted,
        )
