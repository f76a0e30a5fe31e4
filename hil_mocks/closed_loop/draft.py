"""A world under construction: random draws from its seed, bodies that keep clear of each other and of all paths."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from hil_mocks.closed_loop.course import Course
from hil_mocks.closed_loop.vehicle import Build
from hil_mocks.closed_loop.world import Body, Leg
from lcf_edge.rendered.drives import Floats, Paint

_PACE_SHARE = 0.5  # of the cruise speed: who is faster comes from out of sight


@dataclass
class Draft:
    """A world under construction."""

    random: np.random.Generator
    course: Course
    cruise_mps: float
    build: Build
    bodies: list[Body] = field(default_factory=list)
    kept: list[tuple[Floats, float]] = field(default_factory=list)  # ways (n, 2) that are left free, and how far
    events: list[str] = field(default_factory=list)

    def between(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def pace(self, low: float, high: float) -> float:
        """Draw a walking speed, at which somebody who approaches from the side stays in view."""
        most = max(_PACE_SHARE * self.cruise_mps, 0.2)
        return self.between(min(low, 0.6 * most), min(high, most))

    def side(self) -> int:
        return int(self.random.choice((-1, 1)))

    def paint(self, feature_m: float) -> Paint:
        return Paint(int(self.random.integers(2**31)), 1.0, feature_m, self.between(80, 175))

    def walker(self, start: tuple[float, float], legs: tuple[Leg, ...]) -> None:
        """Add somebody who starts at a place and walks along his legs."""
        size = self.between(0.4, 0.6), self.between(1.5, 1.9), self.between(0.25, 0.4)
        self._mover("walker", size, start, legs, self.paint(self.between(0.09, 0.16)), 3.0, walker=True)

    def cart(self, start: tuple[float, float], legs: tuple[Leg, ...]) -> None:
        """Add a vehicle on wheels."""
        size = self.between(0.6, 1.1), self.between(0.7, 1.4), self.between(0.8, 1.5)
        self._mover("cart", size, start, legs, self.paint(0.18), 1.5, walker=False)

    def _mover(
        self,
        name: str,
        size: tuple[float, float, float],
        start: tuple[float, float],
        legs: tuple[Leg, ...],
        paint: Paint,
        acceleration_mps2: float,
        *,
        walker: bool,
    ) -> None:
        heading = math.atan2(-(legs[0].x_m - start[0]), legs[0].z_m - start[1])
        number = len(self.bodies)
        self.bodies.append(
            Body(f"{name}_{number}", *size, *start, heading, paint, legs, acceleration_mps2, walker=walker)
        )
        corners = np.array([start, *((leg.x_m, leg.z_m) for leg in legs)])
        self.kept.append((_dense(corners), 0.8 + max(size[0], size[2]) / 2))

    def stand(
        self, name: str, at_m: float, right_m: float, size: tuple[float, float, float], turn_rad: float = 0.0
    ) -> None:
        """Add a stationary body, unless it would be in somebody's path or in another body."""
        x, z = self.course.place(at_m, right_m)
        paint = self.paint(float(np.clip(min(size) / 3, 0.03, 0.3)))
        heading = self.course.heading(at_m) + turn_rad
        body = Body(f"{name}_{len(self.bodies)}", *size, x, z, heading, paint)
        place, reach = np.array([x, z]), math.hypot(size[0], size[2]) / 2
        for way, apart_m in self.kept:
            if float(np.hypot(*(way - place).T).min()) < apart_m + reach:
                return
        for other in self.bodies:
            apart_m = math.hypot(other.width_m, other.length_m) / 2 + reach + 0.05
            if math.dist((x, z), (other.x_m, other.z_m)) < apart_m:
                return
        self.bodies.append(body)

    def beside(self, right_m: float) -> float:
        """Convert an offset from the vehicle's flank, m, to one from the middle of the course."""
        return self.build.half_width_m + right_m

    def begin(self, at_m: float, seconds: float) -> float:
        """Return where the vehicle is that long before it reaches a place at its cruise speed."""
        return at_m - self.cruise_mps * seconds


def _dense(corners: Floats) -> Floats:
    pieces = [np.linspace(a, b, max(int(math.dist(a, b) / 0.3), 2)) for a, b in pairwise(corners)]
    return np.concatenate(pieces)
