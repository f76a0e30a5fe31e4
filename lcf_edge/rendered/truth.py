"""What is where, exactly: boxes in the image, time to contact, miss, threat; geometry, not images."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.rendered.drives import Floats, stamp_ns
from lcf_edge.rendered.projection import Optics, Placed, Stage, View

Bounds = tuple[float, float, float, float]

MIN_BOX_PX = 8.0
MIN_VISIBLE = 0.3
MOVING_MPS = 0.02

_STEP_S = 0.1
_STANDSTILL_MPS = 1e-6
_MAX_S = 12.0  # lateral misses are predicted this far, or to the horizon


@dataclass(frozen=True, slots=True)
class ObjectTruth:
    """One object in one image."""

    id: int  # its place among the drive's boxes
    name: str
    box: Bounds  # x, y, w, h in px of the image, clipped to it
    visible: float  # share of its area that nothing nearer hides
    depth_m: float  # of its nearest corner before the camera, along the vehicle's heading
    ttc_s: float  # to the camera plane with the present relative speed, inf: never
    lateral_m: float  # of its middle beside the path as its front is passed, right positive, NaN: never
    threat: bool  # will be passed within the half widths and the horizon
    moving: bool

    @property
    def in_sight(self) -> bool:
        """Large enough in the image, and not mostly hidden."""
        return self.visible >= MIN_VISIBLE and min(self.box[2:]) >= MIN_BOX_PX

    @property
    def target(self) -> bool:
        """A threat in sight."""
        return self.threat and self.in_sight


@dataclass(frozen=True, slots=True)
class Truth:
    """One frame: an image with its stamp and number."""

    stamp_ns: int
    seq: int
    speed_mps: float
    yaw_rate_radps: float  # left positive
    objects: tuple[ObjectTruth, ...]


@dataclass(frozen=True, slots=True)
class Passage:
    """How a box will be passed if it keeps its velocity and the vehicle its speed and yaw rate."""

    depth_m: float
    ttc_s: float
    lateral_m: float  # of its middle beside the path as its front is passed, right positive, NaN: never
    closest_s: float  # until its front is passed, NaN: never
    threat: bool


def truth(stage: Stage, view: View, seq: int) -> Truth:
    """The truth about one view."""
    drive, time = stage.drive, np.array([view.time_s])
    ways = passages(stage, view.time_s, [placed.number for placed in view.placed])
    shares = visible_shares(view, stage.optics)
    found = []
    for placed, way, (visible, box) in zip(view.placed, ways, shares, strict=True):
        if box is not None:
            moving = bool(np.hypot(*placed.box.velocity(view.time_s)) > MOVING_MPS)
            found.append(
                ObjectTruth(
                    placed.number,
                    placed.box.name,
                    box,
                    visible,
                    way.depth_m,
                    way.ttc_s,
                    way.lateral_m,
                    way.threat,
                    moving,
                )
            )
    found.sort(key=lambda each: each.id)
    speed, yaw_rate = float(drive.speed.at(time)[0]), float(drive.yaw_rate.at(time)[0])
    return Truth(stamp_ns(view.time_s), seq, speed, yaw_rate, tuple(found))


def passages(stage: Stage, time_s: float, numbers: Sequence[int]) -> list[Passage]:
    """How each of the drive's boxes with these numbers will be passed."""
    if not numbers:
        return []
    drive, now = stage.drive, np.array([time_s])
    speed, yaw_rate = float(drive.speed.at(now)[0]), float(drive.yaw_rate.at(now)[0])
    ahead = stage.trajectory.forward(now)[0]
    to_vehicle = np.array([[ahead[1], ahead[0]], [-ahead[0], ahead[1]]])  # columns: right, ahead
    corners = stage.footprints(time_s)[list(numbers)] - stage.trajectory.ground_position(now)[0]
    corners = corners @ to_vehicle  # (n, 4, 2)
    velocity = np.array([drive.boxes[number].velocity(time_s) for number in numbers]) @ to_vehicle
    size = drive.half_width_m, drive.camera_ahead_m
    return passages_of(corners, velocity, speed, yaw_rate, *size, drive.horizon_s)


def passages_of(
    corners: Floats,
    velocity: Floats,
    speed: float,
    yaw_rate: float,
    half_width_m: float,
    camera_ahead_m: float,
    horizon_s: float,
) -> list[Passage]:
    """How footprints `corners` (n, 4, 2) with `velocity` (n, 2) over ground, (right, ahead) of the axle, are passed.

    The corners move on straight lines, the vehicle on its arc; the passing is the moment when the box's
    foremost corner reaches the camera plane. What has reached it already is no threat.
    """
    time = np.arange(0.0, max(horizon_s + 1, _MAX_S), _STEP_S)
    turned = yaw_rate * time
    chord = speed * time * np.sinc(turned / 2 / np.pi)  # sinc: holds for a straight path too
    vehicle = np.stack([-chord * np.sin(turned / 2), chord * np.cos(turned / 2)], axis=1)
    moved = velocity[:, None] * time[:, None] - vehicle  # (n, time, 2)
    relative = corners[:, None] + moved[:, :, None]  # (n, time, 4, 2)
    sine, cosine = np.sin(turned)[:, None], np.cos(turned)[:, None]
    beside = relative[..., 0] * cosine + relative[..., 1] * sine
    before = (relative[..., 1] * cosine - relative[..., 0] * sine).min(axis=2) - camera_ahead_m

    found = []
    for row, (depth, closing) in enumerate(zip(before[:, 0], speed - velocity[:, 1], strict=True)):
        ttc = float(depth / closing) if depth > 0 and closing > _STANDSTILL_MPS else math.inf
        passed = np.flatnonzero(before[row] <= 0)
        if depth <= 0 or not len(passed):
            found.append(Passage(float(depth), ttc, math.nan, math.nan, threat=False))
            continue
        last = passed[0] - 1
        share = before[row, last] / (before[row, last] - before[row, last + 1])
        there = beside[row, last] + share * (beside[row, last + 1] - beside[row, last])
        lateral, half = float(there.mean()), float(np.ptp(there)) / 2
        closest_s = float(time[last] + share * _STEP_S)
        threat = bool(closest_s <= horizon_s and abs(lateral) <= half_width_m + half)
        found.append(Passage(float(depth), ttc, lateral, closest_s, threat))
    return found


def visible_shares(view: View, optics: Optics) -> list[tuple[float, Bounds | None]]:
    """Of each placed box: the share of its area in the image that is not hidden, and its bounds."""
    width, height = optics.size
    order = np.zeros((height // 2, width // 2), dtype=np.uint16)
    alone = np.zeros_like(order)
    for index, placed in enumerate(view.placed, start=1):
        _fill(order, placed, index)
    shares = []
    for index, placed in enumerate(view.placed, start=1):
        left, top, right, bottom = (value / 2 for value in _outer(placed))
        window = np.s_[max(int(top) - 2, 0) : max(int(bottom) + 3, 0), max(int(left) - 2, 0) : max(int(right) + 3, 0)]
        _fill(alone, placed, 1)
        own = alone[window] > 0
        area = int(np.count_nonzero(own))
        hidden = int(np.count_nonzero(order[window][own] != index))
        alone[window] = 0
        shares.append((1 - hidden / area if area else 0.0, _bounds(placed, optics)))
    return shares


def _fill(mask: npt.NDArray[np.uint16], placed: Placed, value: int) -> None:
    for _, surface in placed.faces:
        polygon = np.rint(((surface.outline + 0.5) / 2 - 0.5) * 16).astype(np.int32)
        cv2.fillConvexPoly(mask, polygon, (value,), cv2.LINE_8, 4)


def _bounds(placed: Placed, optics: Optics) -> Bounds | None:
    """x, y, w, h in px of the finished image, clipped to it."""
    left, top, right, bottom = _outer(placed)
    if optics.lens.model != "none":
        outlines = np.concatenate([_edge_points(surface.outline) for _, surface in placed.faces])
        outlines = optics.distorted(np.clip(outlines, -0.5, np.array(optics.size) - 0.5))
        left, top = outlines.min(axis=0).tolist()
        right, bottom = outlines.max(axis=0).tolist()
    left, top = max(left, -0.5), max(top, -0.5)
    width = min(right, optics.lens.width - 0.5) - left
    height = min(bottom, optics.lens.height - 0.5) - top
    return (left, top, width, height) if min(width, height) > 0 else None


def _outer(placed: Placed) -> Bounds:
    """left, top, right, bottom over all faces, px of the canvas."""
    lefts, tops, rights, bottoms = zip(*(surface.bounds for _, surface in placed.faces), strict=True)
    return min(lefts), min(tops), max(rights), max(bottoms)


def _edge_points(outline: Floats) -> Floats:
    """Points along the polygon's sides: a lens bends them."""
    along = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None, None]
    points: Floats = outline + along * (np.roll(outline, -1, axis=0) - outline)
    return points.reshape(-1, 2)
