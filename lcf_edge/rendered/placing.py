"""What stands and what moves in a drive, placed so that what is a threat is one clearly, for part of it at least.

Contact itself lies after the end of the drive, or the object is passed beside the camera.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from lcf_edge.rendered.drives import Box, Floats
from lcf_edge.rendered.plan import Plan, Road

_CLEAR_M = 0.35  # between what stands beside the path and the half width


# What stands.


def line_with_clutter(plan: Plan) -> None:
    """Boxes left and right of the path, and walls behind them."""
    road = Road(plan.drive)
    start, end = min(road.length_m, 0.0), road.length_m + 22.0
    for side in (-1, 1):
        distance = start + plan.between(1.5, 3.0)
        while distance < end:
            size = plan.between(0.3, 1.1), plan.between(0.35, 2.0), plan.between(0.3, 1.1)
            beside = plan.drive.half_width_m + _CLEAR_M + math.hypot(size[0], size[2]) / 2
            right = side * (beside + plan.between(0.0, 1.6))
            turn = plan.between(-0.5, 0.5)
            plan.stand(f"clutter_{len(plan.boxes)}", road.place(distance, right), size, turn_rad=turn)
            distance += size[2] / 2 + plan.between(*plan.clutter_gap_m)
        if plan.walls and plan.random.random() < 0.75:
            right, tall = side * plan.between(4.2, 6.5), plan.between(2.2, 4.0)
            paint = plan.paint(plan.between(0.25, 0.45))
            for at in np.arange(start, end + 6, 3.0).tolist():
                paint = replace(paint, seed=paint.seed + 1)
                plan.stand(f"wall_{len(plan.boxes)}", road.place(at, right), (0.3, tall, 2.94), paint=paint)


def obstacle_ahead(plan: Plan) -> Box | None:
    """Something in the way, to be hit shortly after the drive's end."""
    contact_s = plan.end_s + plan.between(0.4, 1.2)
    reach = float(plan.drive.speed.integral(np.array([contact_s]))[0])
    size = plan.between(0.5, 1.3), plan.between(0.5, 1.8), 0.6
    place = Road(plan.drive).place(reach + size[2] / 2, plan.between(-0.35, 0.35))
    return plan.stand("obstacle", place, size, turn_rad=plan.between(-0.5, 0.5))


# What moves.


def _walker(name: str, plan: Plan, path: Sequence[tuple[float, float, float]]) -> Box:
    (_, x0, z0), (_, x1, z1) = path[:2]
    heading = math.atan2(-(x1 - x0), z1 - z0)
    size = plan.between(0.4, 0.6), plan.between(1.5, 1.9), plan.between(0.3, 0.45)
    return Box(name, *size, path=tuple(path), heading_rad=heading, paint=plan.paint(plan.between(0.09, 0.16)))


def through(point: Floats, velocity: Floats, time_s: float) -> list[tuple[float, float, float]]:
    """Straight path through a point (x, z) at a time."""
    (x, z), (x_mps, z_mps) = point.tolist(), velocity.tolist()
    return [(time_s + t, x + t * x_mps, z + t * z_mps) for t in (-10.0, 10.0)]


def crossing_walker(
    plan: Plan,
    name: str = "walker",
    *,
    side: int = 0,
    miss_m: tuple[float, float] = (0.45, 0.7),
    pass_s: float = 0.0,
    speed_mps: tuple[float, float] = (0.8, 1.7),
) -> Box | None:
    """Comes from the side (-1 left); is `miss_m` beyond the path's middle when it is passed at `pass_s`."""
    side = side or plan.side()
    when = pass_s or plan.between(0.55, 0.95) * plan.end_s
    road = Road(plan.drive)
    reach = float(plan.drive.speed.integral(np.array([when]))[0])

    def draw() -> Box:
        point, heading = road.place(reach + 0.25, -side * plan.between(*miss_m))
        way = heading + side * (math.pi / 2 + plan.between(-0.35, 0.35))
        speed = plan.between(*speed_mps)
        return _walker(name, plan, through(point, speed * np.array([-math.sin(way), math.cos(way)]), when))

    return plan.add(draw)


def oncoming_mover(
    plan: Plan, name: str, right_m: tuple[float, float], *, cart: bool, contact_s: float | None = None
) -> Box | None:
    """Comes towards the vehicle, `right_m` beside its path; contact after the drive's end or as given."""
    when = contact_s or plan.end_s + plan.between(0.4, 1.0)
    reach = float(plan.drive.speed.integral(np.array([when]))[0])
    road = Road(plan.drive)

    def draw() -> Box:
        size = plan.between(0.8, 1.5), plan.between(0.9, 1.5), plan.between(1.0, 2.2)
        point, heading = road.place(reach + (size[2] / 2 if cart else 0.2), plan.between(*right_m))
        speed = plan.between(0.8, 1.8)
        path = through(point, -speed * np.array([-math.sin(heading), math.cos(heading)]), when)
        if not cart:
            return _walker(name, plan, path)
        return Box(name, *size, path=tuple(path), heading_rad=heading + math.pi, paint=plan.paint(0.18))

    return plan.add(draw)


def cutting_cart(plan: Plan) -> Box | None:
    """Drives ahead in the side lane and moves in front of the vehicle; slower than it."""
    side, begin, takes = plan.side(), plan.between(1.5, 3.0), plan.between(1.4, 2.2)
    lane, end = side * plan.between(1.8, 2.4), plan.between(-0.15, 0.15)

    def offset(time_s: float) -> float:
        share = min(max((time_s - begin) / takes, 0.0), 1.0)
        return lane + (end - lane) * (3 - 2 * share) * share**2

    closing = plan.between(0.5, 0.9)
    gap = closing * plan.end_s + plan.between(0.9, 1.3)
    return follow(plan, "cutting", gap, closing, offset)


def follow(plan: Plan, name: str, gap_m: float, closing_mps: float, offset_m: Callable[[float], float]) -> Box | None:
    """A cart that travels along the road, knots every 0.1 s."""
    road = Road(plan.drive)
    size = plan.between(0.8, 1.4), plan.between(0.8, 1.5), plan.between(0.9, 1.8)
    knots = []
    for time in np.arange(-0.1, plan.end_s + 0.3, 0.1).tolist():
        reach = float(plan.drive.speed.integral(np.array([time]))[0]) + gap_m - closing_mps * time + size[2] / 2
        knots.append((time, *road.place(reach, offset_m(time))[0].tolist()))
    heading = road.place(gap_m)[1]
    cart = Box(name, *size, path=tuple(knots), heading_rad=heading, paint=plan.paint(0.18))
    return plan.add(lambda: cart, attempts=1)
