"""The path that the vehicle is to drive: a line on the ground, by the distance along it."""

import math

import numpy as np

from lcf_edge.rendered.drives import Floats

_STEP_M = 0.05
_BEFORE_M, _BEYOND_M = 20.0, 60.0  # straight, before its start and after its end
_SEARCHED_M = 2.0


class Course:
    """A line with curvatures at knots (distance m, 1/m, left positive), straight lines between them."""

    def __init__(self, length_m: float, knots: tuple[tuple[float, float], ...] = ((0.0, 0.0),)) -> None:
        self.length_m = length_m
        self._distance = np.arange(-_BEFORE_M, length_m + _BEYOND_M, _STEP_M)
        along, curvature = np.array(knots).T
        self._curvature = np.interp(self._distance, along, curvature)
        self._curvature[(self._distance < 0) | (self._distance > length_m)] = 0.0
        heading = np.cumsum(self._curvature) * _STEP_M
        ways = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        points = np.cumsum(ways, axis=0) * _STEP_M
        start = self._row(0.0)
        self._heading = heading - heading[start]
        self.points: Floats = points - points[start]  # (n, 2), (x, z) in m

    def _row(self, distance_m: float) -> int:
        return min(max(round((distance_m + _BEFORE_M) / _STEP_M), 0), len(self._distance) - 1)

    def curvature(self, distance_m: float) -> float:
        """1/m, left positive."""
        return float(self._curvature[self._row(distance_m)])

    def heading(self, distance_m: float) -> float:
        """rad, left positive."""
        return float(self._heading[self._row(distance_m)])

    def place(self, distance_m: float, right_m: float = 0.0) -> tuple[float, float]:
        """The point (x, z) in m at a distance along it and an offset to its right."""
        row = self._row(distance_m)
        rest, heading = distance_m - self._distance[row], float(self._heading[row])
        x, z = (self.points[row] + rest * np.array([-math.sin(heading), math.cos(heading)])).tolist()
        return x + right_m * math.cos(heading), z + right_m * math.sin(heading)

    def locate(self, point: Floats, near_m: float) -> tuple[float, float]:
        """Distance along it and offset to its right, m, of a point that is near the distance `near_m`."""
        first, last = self._row(near_m - _SEARCHED_M), self._row(near_m + _SEARCHED_M) + 1
        row = first + int(np.argmin(((self.points[first:last] - point) ** 2).sum(axis=1)))
        heading = float(self._heading[row])
        offset = point - self.points[row]
        ahead = float(offset @ (-math.sin(heading), math.cos(heading)))
        return float(self._distance[row]) + ahead, float(offset @ (math.cos(heading), math.sin(heading)))

    def clearance(self, point: Floats) -> float:
        """Least distance of a point from the line, m."""
        return math.sqrt(float(((self.points - point) ** 2).sum(axis=1).min()))
