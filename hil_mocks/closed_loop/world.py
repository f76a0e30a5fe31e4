"""Stationary and moving bodies around the vehicle, and who yields to whom."""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil_mocks.closed_loop.course import Course
from hil_mocks.closed_loop.vehicle import Build, Vehicle
from lcf_edge.rendered.drives import Box, Drive, Floats, Lens, Paint, Profile, SensorNoise, Shake

_REACH_M = 0.3  # clearance that movers keep from others
_SLOW_MPS = 0.25  # a vehicle slower than this is stepped around
_EVEN_SHARE = 0.1  # of its speed: less sideways motion counts as straight ahead
_PATIENCE_S = 3.0
_NOWHERE_M = 0.3  # who gets no farther than this until his patience ends is blocked
_NEAR_M = 8.0
_TURNING_RADPS = 3.0
_TURNS_MPS = 0.1  # a slower mover keeps its heading
_EVADES_MPS2 = 4.0  # acceleration with which it steps aside
_GONE_M = 1e4

LENS, NOISE, STEADY, GREY = Lens(), SensorNoise(), Profile(((0.0, 1.0),)), Paint(0)


@dataclass(frozen=True, slots=True)
class Leg:
    """Motion along a straight line, with a rest at its end."""

    x_m: float
    z_m: float
    speed_mps: float
    rest_s: float = 0.0
    from_m: float = -math.inf  # it is begun once the vehicle has come so far along its course


@dataclass(frozen=True, slots=True)
class Body:
    """A cuboid on the ground, and its motion; without legs it is stationary."""

    name: str
    width_m: float
    height_m: float
    length_m: float
    x_m: float
    z_m: float
    heading_rad: float
    paint: Paint
    legs: tuple[Leg, ...] = ()
    acceleration_mps2: float = 3.0  # also of its braking
    walker: bool = False

    @property
    def box(self) -> Box:
        """Its initial pose."""
        path = ((0.0, self.x_m, self.z_m),)
        return Box(self.name, self.width_m, self.height_m, self.length_m, path, self.heading_rad, self.paint)


@dataclass(frozen=True)
class World:
    """A world to drive in: the same world and the same decisions give the same bytes."""

    seed: int
    events: tuple[str, ...]  # what happens along the course
    condition: str
    course: Course
    cruise_mps: float
    build: Build
    bodies: tuple[Body, ...]
    blocked: bool = False  # its course ends before a box in the path
    arrived_s: float = 1.0  # how long it then has to stand there
    start_mps: float = 0.0
    waits_m: tuple[tuple[float, float], ...] = ()  # where it stops of its own accord, and for how long, s
    fps: float = 20.0
    horizon_s: float = 4.0
    camera_height_m: float = 0.5
    camera_pitch_rad: float = 0.0
    lens: Lens = LENS
    noise: SensorNoise = NOISE
    shakes: tuple[Shake, ...] = ()  # at 1 m/s; as much less as it is slower
    gyro: bool = True
    odometry: bool = True
    ticks_per_m: float = 2000.0
    track_m: float = 0.4
    gain: Profile = STEADY
    ground: Paint = GREY
    sky: Paint = GREY

    @property
    def seconds(self) -> float:
        """Timeout of a drive."""
        return 2.5 * (self.course.length_m / self.cruise_mps + sum(rest for _, rest in self.waits_m) + 5.0)

    def drawn(self) -> Drive:
        """The renderer's input: everything but the motion."""
        nothing = Profile(((0.0, 0.0),))
        return Drive(
            "closed loop",
            self.seed,
            1.0,
            self.fps,
            nothing,
            nothing,
            tuple(body.box for body in self.bodies),
            lens=self.lens,
            noise=self.noise,
            gain=self.gain,
            camera_height_m=self.camera_height_m,
            camera_pitch_rad=self.camera_pitch_rad,
            ground=self.ground,
            sky=self.sky,
            half_width_m=self.build.half_width_m,
            horizon_s=self.horizon_s,
        )

    def changed(self, **values: Any) -> "World":
        """The world with other values of some fields."""
        return replace(self, **values)


class _Mover:
    """Progress of a mover along its legs."""

    def __init__(self, row: int, body: Body) -> None:
        self.row, self.body = row, body
        self.leg = 0
        self.rests_s = 0.0
        self.speed_mps = 0.0
        self.evades: Floats = np.zeros(2)  # its velocity less the one that its legs demand, m/s
        self.side = 0  # that it goes round what is in its way, 1: to the right of what it wants
        self.hindered_s = 0.0
        self.hindered_at: Floats = np.zeros(2)
        self.patience_s = _PATIENCE_S


class Bodies:
    """Where all bodies are, by number."""

    def __init__(self, world: World) -> None:
        bodies = world.bodies
        self.half: Floats = np.array([[body.width_m, body.length_m] for body in bodies]).reshape(-1, 2) / 2
        self.position: Floats = np.array([[body.x_m, body.z_m] for body in bodies]).reshape(-1, 2)
        self.velocity: Floats = np.zeros_like(self.position)
        self.heading: Floats = np.array([body.heading_rad for body in bodies])
        self._sees = world.lens.width / 2 / world.lens.focal_px  # tangent of half the camera's field of view
        self._movers = [_Mover(row, body) for row, body in enumerate(bodies) if body.legs]

    def footprints(self) -> Floats:
        """(n, 4, 2) corners (x, z) in m: back left, back right, front right, front left."""
        sine, cosine = np.sin(self.heading)[:, None], np.cos(self.heading)[:, None]
        right = np.hstack([cosine, sine]) * self.half[:, :1]
        ahead = np.hstack([-sine, cosine]) * self.half[:, 1:]
        corners: Floats = np.stack([-right - ahead, right - ahead, right + ahead, ahead - right], axis=1)
        return corners + self.position[:, None]

    def remove(self, number: int) -> None:
        """Remove a body that was hit."""
        self.position[number] = _GONE_M
        self.velocity[number] = 0.0
        self._movers = [mover for mover in self._movers if mover.row != number]

    def step(self, dt_s: float, vehicle: Vehicle) -> None:
        """Advance all movers by one step."""
        for mover in self._movers:
            wish = self._wish(mover, dt_s, vehicle)
            wish += self._evades(mover, wish, vehicle, dt_s)
            row = mover.row
            self.velocity[row] = wish
            self.position[row] += wish * dt_s
            if math.hypot(*wish) > _TURNS_MPS:
                way = math.atan2(-wish[0], wish[1]) - self.heading[row]
                way = math.remainder(way, math.tau)
                self.heading[row] += min(max(way, -_TURNING_RADPS * dt_s), _TURNING_RADPS * dt_s)

    def _wish(self, mover: _Mover, dt_s: float, vehicle: Vehicle) -> Floats:
        """The velocity that its legs demand."""
        mover.rests_s = max(mover.rests_s - dt_s, 0.0)
        legs, travelled_m = mover.body.legs, vehicle.travelled_m
        if mover.leg == len(legs) or mover.rests_s > 0 or travelled_m < legs[mover.leg].from_m:
            mover.speed_mps = 0.0
            return np.zeros(2)
        leg = legs[mover.leg]
        target = np.array([leg.x_m, leg.z_m])
        rest = target - self.position[mover.row]
        left_m = math.hypot(*rest)
        step = mover.body.acceleration_mps2 * dt_s
        stops = leg.rest_s > 0 or mover.leg + 1 == len(legs) or legs[mover.leg + 1].from_m > travelled_m
        most = min(leg.speed_mps, math.sqrt(2 * mover.body.acceleration_mps2 * left_m)) if stops else leg.speed_mps
        mover.speed_mps += min(max(most - mover.speed_mps, -step), step)
        arrived = left_m <= max(mover.speed_mps * dt_s, 0.02)
        if arrived or not (stops or self._is_free(target, mover, vehicle)):
            mover.leg += 1
            mover.rests_s = leg.rest_s
        velocity: Floats = rest * (mover.speed_mps / max(left_m, 1e-9))
        return velocity

    def _is_free(self, place: Floats, mover: _Mover, vehicle: Vehicle) -> bool:
        """Whether a mover can get to a place. It would walk round and round what is there."""
        others = np.arange(len(self.position)) != mover.row
        nearest = _nearest(place, self.position[others], self.heading[others], self.half[others])
        away = place - np.concatenate([nearest, _nearest(place, *_hull(vehicle))])
        return bool(np.hypot(*away.T).min() >= self._clearance_m(mover))

    def _clearance_m(self, mover: _Mover) -> float:
        """Distance of its middle that a mover keeps from others."""
        return float(self.half[mover.row].max()) + _REACH_M

    def _evades(self, mover: _Mover, wish: Floats, vehicle: Vehicle, dt_s: float) -> Floats:
        """Its deviation from a wanted velocity; it changes steadily, so that who is hemmed in does not tremble."""
        if not wish.any():
            mover.evades = np.zeros(2)
            return mover.evades
        change = self._around(mover, wish, vehicle, dt_s) - wish - mover.evades
        mover.evades = mover.evades + change * min(_EVADES_MPS2 * dt_s / max(float(np.hypot(*change)), 1e-9), 1.0)
        return mover.evades

    def _around(self, mover: _Mover, wish: Floats, vehicle: Vehicle, dt_s: float) -> Floats:
        """Adapt a wanted velocity to avoid others nearby, and the vehicle, if that is slow or cannot see the mover.

        Movers that are in the vehicle's view rely on it to stop.
        """
        row = mover.row
        here = self.position[row]
        keep = self._clearance_m(mover)
        near = np.flatnonzero(np.abs(self.position - here).sum(axis=1) < _NEAR_M)
        near = near[near != row]
        points = [_nearest(here, self.position[near], self.heading[near], self.half[near])]
        right_m, ahead_m = (vehicle.axes @ (here - vehicle.position)).tolist()
        if vehicle.speed_mps < _SLOW_MPS or ahead_m < abs(right_m) / self._sees:
            points.append(_nearest(here, *_hull(vehicle)))
        away = here - np.concatenate(points)
        distance = np.hypot(*away.T)
        speed = math.hypot(*wish)
        hindered = False
        for number in np.argsort(-distance):
            share = min(max((keep - distance[number]) / _REACH_M + 1, 0.0), 1.0)
            normal = away[number] / max(distance[number], 1e-9)
            if share == 0 or wish @ normal >= 0:
                continue
            hindered = True
            along = np.array([-normal[1], normal[0]])
            if mover.side == 0:
                mover.side = 1 if wish @ along >= -_EVEN_SHARE * speed else -1
            wish = (1 - share) * wish + share * speed * mover.side * along
        if mover.hindered_s == 0 or math.hypot(*(here - mover.hindered_at)) > _NOWHERE_M:
            mover.hindered_s, mover.hindered_at = 0.0, here.copy()
        mover.hindered_s = mover.hindered_s + dt_s if hindered else max(mover.hindered_s - dt_s, 0.0)
        if mover.hindered_s == 0:
            mover.side, mover.patience_s = 0, _PATIENCE_S
        elif mover.hindered_s > mover.patience_s:  # blocked on this side: try the other one, and farther
            mover.side, mover.hindered_s = -mover.side, dt_s
            mover.patience_s *= 2
        return wish


def _hull(vehicle: Vehicle) -> tuple[Floats, Floats, Floats]:
    """Middle (1, 2), heading (1,) and half sizes (1, 2) of the vehicle's rectangle."""
    build = vehicle.build
    middle = vehicle.position - vehicle.ahead * build.length_m / 2
    return middle[None], np.array([vehicle.heading_rad]), np.array([[build.half_width_m, build.length_m / 2]])


def _nearest(point: Floats, middle: Floats, heading: Floats, half: Floats) -> Floats:
    """(n, 2) points of rectangles that are nearest to a point."""
    sine, cosine = np.sin(heading), np.cos(heading)
    right, ahead = np.stack([cosine, sine], axis=1), np.stack([-sine, cosine], axis=1)
    offset = point - middle
    x = np.clip((offset * right).sum(axis=1), -half[:, 0], half[:, 0])
    z = np.clip((offset * ahead).sum(axis=1), -half[:, 1], half[:, 1])
    nearest: Floats = middle + right * x[:, None] + ahead * z[:, None]
    return nearest


def touch(one: Floats, two: Floats) -> bool:
    """Whether two rectangles (4, 2) overlap."""
    for corners in (one, two):
        for axis in (corners[1] - corners[0], corners[3] - corners[0]):
            a, b = one @ axis, two @ axis
            if a.max() < b.min() or b.max() < a.min():
                return False
    return True
