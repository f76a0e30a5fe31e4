"""A drive in the making: draws from its seed, the road by distance, boxes that keep clear of each other."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lcf_edge.rendered.drives import Axis, Box, Drive, Floats, Paint, Profile, Shake
from lcf_edge.rendered.trajectory import Trajectory

_APART_M = 0.05
_CAMERA_CLEAR_M = 0.2  # between a mover and the camera


@dataclass
class Plan:
    """A drive in the making."""

    random: np.random.Generator
    drive: Drive
    boxes: list[Box] = field(default_factory=list)
    contrast: float = 1.0
    clutter_gap_m: tuple[float, float] = (0.9, 2.6)
    walls: bool = True  # behind the clutter
    tile_m: float = 0.0  # of all paint

    @property
    def end_s(self) -> float:
        return self.drive.seconds

    def between(self, low: float, high: float) -> float:
        return float(self.random.uniform(min(low, high), max(low, high)))

    def side(self) -> int:
        return int(self.random.choice((-1, 1)))

    def paint(self, feature_m: float) -> Paint:
        return Paint(int(self.random.integers(2**31)), self.contrast, feature_m, self.between(80, 175), self.tile_m)

    def change(self, **values: Any) -> None:
        """Replace fields of the drive."""
        self.drive = replace(self.drive, **values)

    def cruise(self, low_mps: float, high_mps: float) -> float:
        """A speed, held or slowly changing."""
        speed = self.between(low_mps, high_mps)
        end = float(np.clip(speed * self.between(0.85, 1.15), low_mps, high_mps))
        self.change(speed=Profile(((0.0, speed), (self.end_s, end))))
        return speed

    def shake(self, degrees: float) -> None:
        """Vibration of about so much in pitch, less in the other axes."""
        shakes = []
        axes: tuple[tuple[Axis, float], ...] = (("pitch", 1.0), ("roll", 0.6), ("yaw", 0.5))
        for axis, share in axes:
            for _ in range(2):
                size = math.radians(degrees) * share * self.between(0.3, 0.7)
                shakes.append(Shake(axis, size, self.between(3, 15), self.between(0, 6.28)))
        shakes.append(Shake("heave", 0.002 * degrees, self.between(3, 12), self.between(0, 6.28)))
        self.change(shakes=(*self.drive.shakes, *shakes))

    def add(self, draw: Callable[[], Box], attempts: int = 40) -> Box | None:
        """Add the first of the drawn boxes that touches neither camera nor another box during the drive."""
        for _ in range(attempts):
            box = draw()
            if _clear_of_camera(self.drive, box) and all(_apart(self.drive, box, other) for other in self.boxes):
                self.boxes.append(box)
                return box
        return None

    def stand(
        self,
        name: str,
        place: tuple[Floats, float],
        size_m: tuple[float, float, float],
        *,
        turn_rad: float = 0.0,
        paint: Paint | None = None,
    ) -> Box | None:
        """Add a box that stands at a point (x, z) with a heading, unless it is in the way of another."""
        point, heading = place
        look = paint or self.paint(float(np.clip(min(size_m) / 3, 0.02, 0.3)))
        path = ((0.0, float(point[0]), float(point[1])),)
        box = Box(name, *size_m, path=path, heading_rad=heading + turn_rad, paint=look)
        return self.add(lambda: box, attempts=1)

    def finish(self) -> Drive:
        """The drive with what stands beside its path."""
        return replace(self.drive, boxes=tuple(self.boxes))


class Road:
    """The vehicle's path by distance and offset to the right; straight before its start and after its end."""

    def __init__(self, drive: Drive) -> None:
        time = np.arange(0.0, drive.seconds + 1e-9, 0.02)
        trajectory = Trajectory(drive)
        points, ahead = trajectory.ground_position(time), trajectory.forward(time)
        travelled = drive.speed.integral(time)
        onward = np.concatenate([[True], np.diff(np.maximum.accumulate(travelled)) > 1e-6])
        points, ahead, travelled = points[onward], ahead[onward], travelled[onward]
        reach = 100.0
        self._distance = np.concatenate([[-reach], travelled, [travelled[-1] + reach]])
        self._points = np.concatenate([points[:1] - reach * ahead[:1], points, points[-1:] + reach * ahead[-1:]])
        self._ahead = np.concatenate([ahead[:1], ahead, ahead[-1:]])
        self.length_m = float(travelled[-1])

    def place(self, distance_m: float, right_m: float = 0.0) -> tuple[Floats, float]:
        """Point (x, z) in m and heading in rad."""
        point, ahead = (
            np.array([np.interp(distance_m, self._distance, column) for column in rows.T])
            for rows in (self._points, self._ahead)
        )
        ahead /= np.hypot(*ahead)
        return point + right_m * np.array([ahead[1], -ahead[0]]), math.atan2(-ahead[0], ahead[1])


def _gap(box: Box, time_s: float, points: Floats) -> float:
    """Least distance in m from points (n, 2), (x, z), to the box's footprint."""
    sine, cosine = math.sin(box.heading_rad), math.cos(box.heading_rad)
    offset = np.abs((points - box.position(time_s)) @ np.array([[cosine, -sine], [sine, cosine]]))
    beyond = np.maximum(offset - np.array([box.width_m, box.length_m]) / 2, 0.0)
    return float(np.hypot(beyond[:, 0], beyond[:, 1]).min())


def _clear_of_camera(drive: Drive, box: Box) -> bool:
    time = np.arange(0.0, drive.seconds + 0.1, 0.1)
    camera = Trajectory(drive).position(time)[:, [0, 2]]
    clear = min(_CAMERA_CLEAR_M, drive.half_width_m / 2)
    if len(box.path) == 1:
        return _gap(box, 0.0, camera) > clear
    return all(_gap(box, t, p[None]) > clear for t, p in zip(time.tolist(), camera, strict=True))


def _apart(drive: Drive, box: Box, other: Box) -> bool:
    """Whether two boxes stay apart during the drive: no corner or middle of one comes near the other."""
    still = len(box.path) == len(other.path) == 1
    times = [0.0] if still else np.arange(0.0, drive.seconds + 0.1, 0.2).tolist()
    reach = (math.hypot(box.width_m, box.length_m) + math.hypot(other.width_m, other.length_m)) / 2 + _APART_M
    for time in times:
        if math.dist(box.position(time), other.position(time)) > reach:
            continue
        for one, two in ((box, other), (other, box)):
            if _gap(one, time, np.vstack([two.footprint(time), two.position(time)])) < _APART_M:
                return False
    return True
