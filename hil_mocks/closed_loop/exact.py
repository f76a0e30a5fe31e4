"""Ground truth of each body in an image, as the records of objects."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcf_edge.messages import OBJECT, ObjectClass, ObjectState
from lcf_edge.rendered.drives import Floats
from lcf_edge.rendered.projection import Stage, View
from lcf_edge.rendered.truth import MIN_BOX_PX, MIN_VISIBLE, MOVING_MPS, Bounds, passages_of, visible_shares

REMEMBERED_S = 1.5  # bodies are still reported for so long after they leave the view
_SIGMA = 0.05  # of every number
_SLOW_MPS = 0.1  # a slower vehicle has no path
_ASIDE_SHARE = 0.35  # of its speed: a body ahead that moves inwards faster than this cuts in


@dataclass(frozen=True, slots=True)
class Motion:
    """Of the vehicle at one moment."""

    position: Floats  # (2,) x, z, m
    axes: Floats  # (2, 2): carries (x, z) into (right, ahead)
    speed_mps: float
    yaw_rate_radps: float  # left positive
    curvature: float  # of its path, 1/m, left positive


@dataclass(frozen=True, slots=True)
class Exact:
    """One body in one image; right and forward are those of the vehicle."""

    number: int
    name: str
    box: Bounds  # x, y, w, h in px of the image, clipped to it
    visible: float  # share of its area that nothing nearer hides
    range_m: float  # ahead of the camera, to its nearest corner
    bearing_rad: float  # of the middle of its box
    elevation_rad: float
    beside_m: float  # of its middle from the path now
    v_forward_mps: float  # over ground
    v_right_mps: float
    ttc_s: float  # to the camera plane, inf: never
    lateral_m: float  # of its middle beside the path as its front is passed, NaN: never
    closest_s: float  # until then
    threat: bool  # will be met within the horizon if both go on as they do
    class_id: ObjectClass

    @property
    def in_sight(self) -> bool:
        """Large enough in the image, and not mostly hidden."""
        return self.visible >= MIN_VISIBLE and min(self.box[2:]) >= MIN_BOX_PX

    @property
    def moving(self) -> bool:
        return math.hypot(self.v_forward_mps, self.v_right_mps) > MOVING_MPS


def exact(stage: Stage, view: View, motion: Motion, footprints: Floats, velocities: Floats) -> list[Exact]:
    """Ground truth of everything in a view; footprints (n, 4, 2) and velocities (n, 2) of all bodies, (x, z)."""
    numbers = [placed.number for placed in view.placed]
    if not numbers:
        return []
    drive = stage.drive
    corners = (footprints[numbers] - motion.position) @ motion.axes.T
    moving = velocities[numbers] @ motion.axes.T
    size = drive.half_width_m, drive.camera_ahead_m
    ways = passages_of(corners, moving, motion.speed_mps, motion.yaw_rate_radps, *size, drive.horizon_s)
    found = []
    shares = visible_shares(view, stage.optics)
    for row, (placed, way, (visible, box)) in enumerate(zip(view.placed, ways, shares, strict=True)):
        if box is None or way.depth_m <= 0:
            continue
        right, forward = moving[row].tolist()
        middle = corners[row].mean(axis=0).tolist()
        beside = middle[0] + motion.curvature * middle[1] ** 2 / 2
        across, down = (np.array(box[:2]) + np.array(box[2:]) / 2 - stage.optics.lens.matrix[:2, 2]).tolist()
        focal = drive.lens.focal_px
        found.append(
            Exact(
                placed.number,
                placed.box.name,
                box,
                visible,
                way.depth_m,
                math.atan2(across, focal),
                math.atan2(-down, math.hypot(focal, across)),
                beside,
                forward,
                right,
                way.ttc_s,
                way.lateral_m,
                way.closest_s,
                way.threat,
                _class(forward, right, beside),
            )
        )
    return sorted(found, key=lambda each: each.number)


def _class(forward_mps: float, right_mps: float, beside_m: float) -> ObjectClass:
    speed = math.hypot(forward_mps, right_mps)
    if speed <= MOVING_MPS:
        return ObjectClass.STANDING
    if abs(right_mps) > 2 * abs(forward_mps):
        return ObjectClass.CROSSING
    if forward_mps < 0:
        return ObjectClass.ONCOMING
    inwards = right_mps * beside_m < 0 and abs(right_mps) > _ASIDE_SHARE * speed
    return ObjectClass.CUTTING_IN if inwards else ObjectClass.LEADING


class Memory:
    """Ground truth as objects: those in sight, and for a short while those that were."""

    def __init__(self) -> None:
        self._first: dict[int, float] = {}
        self._last: dict[int, tuple[float, Exact]] = {}

    def objects(self, time_s: float, known: Sequence[Exact]) -> npt.NDArray[np.void]:
        """OBJECT records of one moment."""
        known_objects: dict[int, tuple[float, Exact]] = {each.number: (time_s, each) for each in known if each.in_sight}
        hidden = {each.number: each for each in known}
        for number, (seen_s, _) in self._last.items():
            if number in known_objects or time_s - seen_s > REMEMBERED_S:
                continue
            after = hidden.get(number)
            if after is not None:
                known_objects[number] = (seen_s, after)
        self._last = known_objects
        for number in known_objects:
            self._first.setdefault(number, time_s)
        rows = np.zeros(len(known_objects), OBJECT)
        for row, (seen_s, each) in zip(rows, known_objects.values(), strict=True):
            x, y, width, height = each.box
            row["id"], row["class_id"] = each.number + 1, each.class_id
            row["state"] = ObjectState.SEEN if seen_s == time_s else ObjectState.HIDDEN
            row["x"], row["y"], row["width"], row["height"] = x + width / 2, y + height / 2, width, height
            row["support"], row["trust"] = 20, 5.0
            values = {
                "ttc": each.ttc_s,
                "bearing": each.bearing_rad,
                "elevation": each.elevation_rad,
                "range": each.range_m,
                "lateral": each.lateral_m if math.isfinite(each.lateral_m) or each.moving else each.beside_m,
                "v_forward": each.v_forward_mps,
                "v_right": each.v_right_mps,
                "closest": each.closest_s,
            }
            for name, value in values.items():
                row[name] = value
                row[f"{name}_sigma"] = _SIGMA if math.isfinite(value) else math.nan
            row["probability"] = float(each.threat)
            row["age"], row["unseen"] = time_s - self._first[each.number], time_s - seen_s
        return rows


def exact_of_drive(stage: Stage, view: View) -> list[Exact]:
    """The same for a view of a rendered drive, whose motion is known in advance."""
    drive, time = stage.drive, np.array([view.time_s])
    x, z = stage.trajectory.forward(time)[0].tolist()
    speed, yaw_rate = float(drive.speed.at(time)[0]), float(drive.yaw_rate.at(time)[0])
    curvature = yaw_rate / speed if abs(speed) > _SLOW_MPS else 0.0
    position = stage.trajectory.ground_position(time)[0]
    motion = Motion(position, np.array([[z, -x], [x, z]]), speed, yaw_rate, curvature)
    velocities = np.array([box.velocity(view.time_s) for box in drive.boxes]).reshape(-1, 2)
    return exact(stage, view, motion, stage.footprints(view.time_s), velocities)
