"""Drivers of the closed loop: the same planner with ground truth, objects or circles as input, or none."""

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from benchmarks.methods import FILTER, Method, make
from benchmarks.peers import PEERS
from benchmarks.playing import config_of
from examples.planner import Planner, Vehicle
from hil_mocks.closed_loop.exact import Memory
from hil_mocks.closed_loop.loop import Driver, Moment
from hil_mocks.closed_loop.world import World
from lcf_edge.config import Config
from lcf_edge.lens import Lens
from lcf_edge.messages import OBJECT, Cause, Kind, ObjectClass, Scene
from lcf_edge.rendered.drives import Drive

TRUTH, OBJECTS, CIRCLES, BLIND = "truth", "objects", "circles", "blind"
NAMES = (TRUTH, OBJECTS, CIRCLES, *PEERS, BLIND)

_MIN_TRUST = 3.0
_SIGMA_M, _SIGMA_SHARE = 0.2, 0.15  # of the numbers of circles
_FARTHEST_M = 30.0
_FORWARD_MPS, _RIGHT_MPS = (-2.0, 4.0), (-2.5, 2.5)  # nothing is faster

Reported = Callable[[Scene], npt.NDArray[np.void]]


def planner_of(world: World) -> Planner:
    """Return the planner as the vehicle's user would configure it."""
    build = world.build
    return Planner(Vehicle(build.half_width_m, build.length_m, world.lens.focal_px))


def method_of(world: World, name: str) -> Method:
    """Return a method of the benchmark, configured as the vehicle's user would."""
    drive = world.drawn()
    config: Config = config_of(drive)
    return make(name, config, Lens.from_config(config.camera, drive.lens.width, drive.lens.height))


class TruthDriver:
    """The planner with the ground truth of everything in sight."""

    def __init__(self, world: World) -> None:
        self._planner, self._memory, self._dt_s = planner_of(world), Memory(), 1 / world.fps

    def decide(self, moment: Moment) -> float:
        """The speed to drive at now, m/s."""
        objects = self._memory.objects(moment.time_s, moment.known)
        return self._planner.target_mps(objects, moment.speed_mps, moment.cruise_mps, self._dt_s, moment.curvature)


class BlindDriver:
    """Never brakes."""

    def decide(self, moment: Moment) -> float:
        """The speed to drive at now, m/s."""
        return moment.cruise_mps


class SceneDriver:
    """The planner on the results of a method; ``reported``: which of them it is given."""

    def __init__(self, world: World, name: str, reported: Reported) -> None:
        self._planner, self._dt_s = planner_of(world), 1 / world.fps
        self._method, self.reported = method_of(world, name), reported
        self._target_mps = world.start_mps
        self.scene: Scene | None = None

    def decide(self, moment: Moment) -> float:
        """The speed to drive at now, m/s."""
        for sample in moment.samples:
            self._method.add(sample)
        assert moment.frame is not None
        self.scene = self._method.process(moment.frame)
        speed = self.scene.vehicle_speed
        if not math.isfinite(speed):  # not measured: assume the wanted speed
            speed = self._target_mps
        self._target_mps = self._planner.target_mps(
            self.reported(self.scene), speed, moment.cruise_mps, self._dt_s, moment.curvature
        )
        return self._target_mps


def driver(world: World, name: str) -> Driver:
    """The driver of a name, one of ``NAMES``."""
    if name == TRUTH:
        return TruthDriver(world)
    if name == BLIND:
        return BlindDriver()
    return SceneDriver(world, FILTER if name in (OBJECTS, CIRCLES) else name, reported_objects(world, name))


def reported_objects(world: World, name: str) -> Reported:
    """Return the part of a scene that the planner of a driver is given."""
    if name == OBJECTS:
        return lambda scene: scene.objects
    return lambda scene: objects_of_circles(scene, world.drawn())


def objects_of_circles(scene: Scene, drive: Drive) -> npt.NDArray[np.void]:
    """Return an object for each trusted rebel circle: its numbers, and those that follow from them.

    Peers report range and lateral miss of stationary objects only. For movers, the range follows from the foot on the
    ground, and the miss from the motion in the image.
    """
    circles = scene.circles[(scene.circles["kind"] == Kind.REBEL) & (scene.circles["trust"] >= _MIN_TRUST)]
    objects = np.zeros(len(circles), OBJECT)
    for name in ("id", "support", "x", "y", "ttc", "bearing", "range", "lateral", "trust"):
        objects[name] = circles[name]
    objects["width"] = objects["height"] = 2 * circles["radius"]
    speed = scene.vehicle_speed if math.isfinite(scene.vehicle_speed) else 0.0
    stands = circles["cause"] == Cause.INCOMING
    ttc = np.where(np.isfinite(circles["ttc"]), circles["ttc"], np.nan)

    focal, (cx, cy) = drive.lens.focal_px, drive.lens.matrix[:2, 2]
    silent = np.isnan(circles["bearing"])  # a peer
    objects["bearing"][silent] = np.arctan((circles["x"][silent] - cx) / focal)
    moves = silent & ~stands
    foot_px = circles["y"] + circles["radius"] - (cy + focal * math.tan(drive.camera_pitch_rad))
    foot_m = np.clip(drive.camera_height_m * focal / np.maximum(foot_px, 1.0), 0.3, _FARTHEST_M)
    objects["range"] = np.where(moves, foot_m, objects["range"])
    objects["range"] = np.where(np.isfinite(objects["range"]), objects["range"], ttc * speed)
    miss_m = foot_m * circles["speed"] * np.cos(circles["direction"]) / focal * ttc
    objects["lateral"] = np.where(moves, miss_m, objects["lateral"])

    known = ~stands & np.isfinite(ttc) & (ttc > 0)
    right_m = objects["range"] * np.tan(objects["bearing"])
    with np.errstate(invalid="ignore", divide="ignore"):
        objects["v_forward"] = np.where(known, np.clip(speed - objects["range"] / ttc, *_FORWARD_MPS), 0.0)
        objects["v_right"] = np.where(known, np.clip((objects["lateral"] - right_m) / ttc, *_RIGHT_MPS), 0.0)
    leads = ~stands & ~np.isfinite(ttc)
    objects["v_forward"][leads] = speed
    objects["class_id"] = np.where(stands, ObjectClass.STANDING, ObjectClass.UNKNOWN)
    objects["closest"] = ttc
    objects["probability"] = stands
    objects["lateral_sigma"] = _SIGMA_M
    objects["range_sigma"], objects["ttc_sigma"] = _SIGMA_SHARE * objects["range"], _SIGMA_SHARE * ttc
    objects["v_right_sigma"] = objects["v_forward_sigma"] = _SIGMA_M
    return objects
