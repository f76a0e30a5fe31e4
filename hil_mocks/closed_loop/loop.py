"""One drive in lockstep: image and samples in, a decision out, which changes the next image."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from drivers.samples import Frame, ImuSample, SpeedSample
from hil_mocks.closed_loop.exact import Exact, Motion, exact
from hil_mocks.closed_loop.sensors import IMU_HZ, Sensors
from hil_mocks.closed_loop.vehicle import Vehicle
from hil_mocks.closed_loop.world import Bodies, World, touch
from lcf_edge.rendered.drives import stamp_ns
from lcf_edge.rendered.projection import Stage
from lcf_edge.rendered.rendering import Renderer

BODIES_EVERY = 2  # steps of the vehicle
LATE_STEPS = 4  # samples that are read between an image and its processing
STANDS_MPS = 0.02
_NEAR_END_M = 1.5


@dataclass(frozen=True, slots=True)
class Moment:
    """The input of a decision."""

    time_s: float
    cruise_mps: float  # wanted speed where nothing is in the way
    speed_mps: float  # of the vehicle, true
    curvature: float  # of the course here, 1/m, left positive
    samples: tuple[ImuSample | SpeedSample, ...]  # since the last
    frame: Frame | None  # None: no images are drawn
    known: tuple[Exact, ...]


class Driver(Protocol):
    """Who decides."""

    def decide(self, moment: Moment) -> float:
        """The speed to drive at now, m/s."""


@dataclass(frozen=True, slots=True)
class Contact:
    """A collision with a body, which is then removed."""

    number: int
    name: str
    time_s: float
    speed_mps: float  # of the vehicle


@dataclass(slots=True)
class Log:
    """Log of a drive, one entry per image."""

    cruise_mps: list[float] = field(default_factory=list)
    target_mps: list[float] = field(default_factory=list)
    speed_mps: list[float] = field(default_factory=list)
    in_view: list[frozenset[int]] = field(default_factory=list)  # numbers of what was in sight
    contacts: list[Contact] = field(default_factory=list)
    distance_m: float = 0.0
    seconds: float = 0.0
    arrived: bool = False


def drive(world: World, driver: Driver, *, with_images: bool = True) -> Log:
    """Run a driver through a world until its end, or a timeout."""
    stage = Stage(world.drawn())
    renderer = Renderer(stage) if with_images else None
    vehicle, bodies, sensors = Vehicle(world.build, world.course, world.start_mps), Bodies(world), Sensors(world)
    log = Log()
    steps = round(IMU_HZ / world.fps)
    waits = list(world.waits_m)
    rest_s = stood_s = 0.0
    samples: list[ImuSample | SpeedSample] = []

    def advance(first: int, last: int) -> None:
        for step in range(first, last):
            time_s = step / IMU_HZ
            samples.extend(sensors.sample(time_s, vehicle))
            vehicle.step(time_s, 1 / IMU_HZ, world.track_m)
            if step % BODIES_EVERY == 0:
                bodies.step(BODIES_EVERY / IMU_HZ, vehicle)
                _contacts(world, vehicle, bodies, time_s, log)

    for seq in range(round(world.seconds * world.fps)):
        time_s = seq / world.fps
        footprints = bodies.footprints()
        view = stage.look(time_s, *sensors.pose(time_s, vehicle), footprints)
        speed_mps, curvature = vehicle.speed_mps, world.course.curvature(vehicle.travelled_m)
        motion = Motion(vehicle.position.copy(), vehicle.axes, speed_mps, vehicle.yaw_rate_radps, curvature)
        known = tuple(exact(stage, view, motion, footprints, bodies.velocity))
        frame = Frame(stamp_ns(time_s), seq, renderer.image(view)) if renderer else None
        advance(seq * steps, seq * steps + LATE_STEPS)
        if waits and vehicle.travelled_m >= waits[0][0]:
            rest_s = waits.pop(0)[1]
        cruise_mps = 0.0 if rest_s > 0 else world.cruise_mps
        rest_s -= 1 / world.fps if vehicle.speed_mps < STANDS_MPS else 0.0
        moment = Moment(time_s, cruise_mps, speed_mps, curvature, tuple(samples), frame, known)
        samples.clear()
        target_mps = min(driver.decide(moment), cruise_mps)
        vehicle.command(time_s, target_mps)
        log.cruise_mps.append(cruise_mps)
        log.target_mps.append(target_mps)
        log.speed_mps.append(speed_mps)
        log.in_view.append(frozenset(each.number for each in known if each.in_sight))
        advance(seq * steps + LATE_STEPS, (seq + 1) * steps)
        left_m = world.course.length_m - vehicle.travelled_m
        stood_s = stood_s + 1 / world.fps if vehicle.speed_mps < STANDS_MPS else 0.0
        if left_m <= 0 or (world.blocked and left_m < _NEAR_END_M and stood_s >= world.arrived_s):
            log.arrived = True
            break
    log.distance_m, log.seconds = vehicle.travelled_m, (seq + 1) / world.fps
    return log


def _contacts(world: World, vehicle: Vehicle, bodies: Bodies, time_s: float, log: Log) -> None:
    if vehicle.speed_mps < STANDS_MPS:
        return
    near = np.abs(bodies.position - vehicle.position).max(axis=1) - bodies.half.max(axis=1) < 2.0
    hull = vehicle.footprint
    prints = bodies.footprints()
    numbers: Sequence[int] = np.flatnonzero(near).tolist()
    for number in numbers:
        if touch(hull, prints[number]):
            log.contacts.append(Contact(number, world.bodies[number].name, time_s, vehicle.speed_mps))
            bodies.remove(number)
