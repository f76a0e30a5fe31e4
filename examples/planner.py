"""A planner that brakes: it slows down and stops for what the vehicle will meet, and goes on.

    python examples/planner.py tcp/127.0.0.1:7447 1.5 0.3 500

prints the target speed, m/s, for every scene; hand it to the motors. The arguments are the daemon's endpoint, the
cruise speed, m/s, half the vehicle's width, m, and the camera's focal length, px.

The rule: A speed is good if the vehicle, driving it from now on, comes near to nothing within the horizon, or if it is
slow enough to stop before what it would come near to. The fastest good speed is wanted.

- What moves goes on as it does. It is in the way as long as the chance that it is within half width and margin of the
  path is at least ``CHANCE``, by its place, its motion and their sigmas. So somebody who crosses and will have left the
  path in time costs no stop.
- What stands is in the way if its probability of being met is at least ``CHANCE``. While that is not known, because the
  vehicle stands or is slow, its lateral miss tells, with its sigma.
- It comes near from ``gap_m`` before it until the vehicle's length and ``BEHIND_M`` beyond it. Of half its box's width
  at most ``HALF_STANDS_M`` or ``HALF_MOVES_M`` counts. The way in which what goes ahead can stop is added to its range.
- Where the range is unknown, the time to contact stands in for it. What has neither range nor contact is left out.
- A vehicle that rests waits for whatever moves nearer than ``CLOSE_M``: so near it fills the image, and its numbers are
  worth least.
- A higher speed than before has to be good for ``PATIENCE_S``, and for ``REST_S`` where the vehicle rests. A lower one
  counts once two scenes in a row ask for it: what only one shows is mostly nothing.
"""

import sys
from dataclasses import dataclass
from math import erf, isfinite

import numpy as np
import numpy.typing as npt

from lcf_edge.client import scenes
from lcf_edge.messages import ObjectClass

HORIZON_S, STEP_S, SPEEDS = 4.0, 0.1, 16
CHANCE = 0.3
PATIENCE_S = 0.4  # that a higher speed has to be good,
REST_S = 1.0  # and before a vehicle that rests starts: what rests with it can be seen least
RESTS_MPS = 0.05
CLOSE_M = 1.5
AROUND_S = 0.25  # of its own motion is left before and behind what crosses
BEHIND_M = 0.5
HALF_STANDS_M, HALF_MOVES_M = 0.3, 0.5  # a wider box may hold more than one thing

_normal = np.vectorize(lambda sigmas: 0.5 * (1 + erf(sigmas / 2**0.5)), otypes=[float])


@dataclass(frozen=True)
class Vehicle:
    """What the planner knows of its vehicle."""

    half_width_m: float = 0.3
    length_m: float = 0.7
    focal_px: float = 500.0
    braking_mps2: float = 1.5  # that is comfortable
    acceleration_mps2: float = 1.0
    delay_s: float = 0.35  # from an image to the brakes
    gap_m: float = 0.7  # left to what it stops for
    margin_m: float = 0.2  # left to the side


def good_speed(
    objects: npt.NDArray[np.void], speed: float, cruise: float, vehicle: Vehicle, curvature: float = 0.0
) -> float:
    """The fastest good speed, m/s. ``curvature``: of the path ahead, 1/m, left positive."""
    unknown = ~np.isfinite(objects["range"])
    ahead = np.where(unknown, objects["ttc"] * max(speed, 0.1), objects["range"]).astype(float)
    stands = objects["class_id"] == ObjectClass.STANDING
    used = np.isfinite(ahead) & np.isfinite(objects["bearing"])
    if not used.any():
        return cruise
    objects, ahead, stands = objects[used], ahead[used, None], stands[used]
    if abs(speed) < RESTS_MPS and (~stands & (ahead[:, 0] < CLOSE_M)).any():
        return 0.0
    forward, right, right_sigma = (
        np.nan_to_num(objects[name])[:, None] for name in ("v_forward", "v_right", "v_right_sigma")
    )
    most = np.where(stands, HALF_STANDS_M, HALF_MOVES_M)[:, None]
    half = np.minimum(objects["width"][:, None] / 2 / vehicle.focal_px * ahead, most)

    time = np.arange(0.0, HORIZON_S, STEP_S)
    z = ahead + forward * time  # (objects, times)
    x = ahead * np.tan(objects["bearing"][:, None]) + right * time + curvature * z**2 / 2  # beside the path
    passed = (stands & np.isfinite(objects["lateral"]))[:, None]
    x = np.where(passed, objects["lateral"][:, None], x)
    sigma = np.where(passed, objects["lateral_sigma"][:, None], np.hypot(right_sigma * time, 0.1 * half))
    sigma = np.maximum(np.nan_to_num(sigma, nan=0.3), 0.02)
    reach = vehicle.half_width_m + vehicle.margin_m + half + AROUND_S * np.abs(right)
    chance = _normal((reach - x) / sigma) - _normal((-reach - x) / sigma)
    judged = (stands & (objects["closest"] < HORIZON_S))[:, None]
    in_way = np.where(judged, objects["probability"][:, None], chance) >= CHANCE

    speeds = np.linspace(0.0, cruise, SPEEDS)[:, None]
    driven = np.maximum(time - vehicle.delay_s, 0.0)
    faster = np.minimum(speeds, speed + vehicle.acceleration_mps2 * driven)
    way = np.cumsum(np.maximum(faster, np.minimum(speed, speed - vehicle.braking_mps2 * driven)), axis=1) * STEP_S
    near = (z - vehicle.gap_m < way[:, None]) & (z + vehicle.length_m + BEHIND_M > way[:, None])
    meets = (in_way & near).any(axis=2)  # (speeds, objects)
    left = np.where(in_way, z, np.inf).min(axis=1) - vehicle.gap_m
    left += np.maximum(forward[:, 0], 0.0) ** 2 / 2 / vehicle.braking_mps2
    a, delay = vehicle.braking_mps2, vehicle.delay_s
    stops = a * (np.sqrt(delay**2 + 2 * np.maximum(left, 0.0) / a) - delay)
    good = (~meets | (speeds <= stops)).all(axis=1)
    return float(speeds[good].max(initial=0.0))


class Planner:
    """Chooses a speed, and remembers the last one."""

    def __init__(self, vehicle: Vehicle) -> None:
        self.vehicle = vehicle
        self._target_mps = self._last_mps = 0.0
        self._good_s = 0.0

    def target_mps(
        self, objects: npt.NDArray[np.void], speed: float, cruise: float, dt_s: float, curvature: float = 0.0
    ) -> float:
        """The speed to drive at now, m/s."""
        good = good_speed(objects, speed, cruise, self.vehicle, curvature)
        self._good_s = self._good_s + dt_s if good > self._target_mps else 0.0
        if self._good_s >= (REST_S if abs(speed) < RESTS_MPS else PATIENCE_S):
            self._target_mps = good
        self._target_mps, self._last_mps = min(self._target_mps, max(good, self._last_mps)), good
        return min(self._target_mps, cruise)


def main(endpoint: str, cruise: float, half_width_m: float, focal_px: float) -> None:
    """Print the target speed for every scene."""
    planner, before_ns, speed = Planner(Vehicle(half_width_m, focal_px=focal_px)), 0, 0.0
    for scene in scenes(endpoint):
        measured = scene.vehicle_speed if isfinite(scene.vehicle_speed) else speed
        speed = planner.target_mps(scene.objects, measured, cruise, min((scene.stamp_ns - before_ns) * 1e-9, 0.2))
        before_ns = scene.stamp_ns
        sys.stdout.write(f"{speed:.2f}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1], *map(float, sys.argv[2:5]))
