"""The kinds of drive: layouts, speeds, textures and sides drawn from a seed.

Speeds and misses are drawn so that what is a threat is one clearly, for part of the drive at least; contact
itself lies after the end of the drive, or the object is passed beside the camera.
"""

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hil_mocks.drives import Box, Drive, Floats, Lens, Profile, SensorNoise
from hil_mocks.plan import Plan, Road

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
        if plan.random.random() < 0.75:
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


def _through(point: Floats, velocity: Floats, time_s: float) -> list[tuple[float, float, float]]:
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
        return _walker(name, plan, _through(point, speed * np.array([-math.sin(way), math.cos(way)]), when))

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
        path = _through(point, -speed * np.array([-math.sin(heading), math.cos(heading)]), when)
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
    return _follow(plan, "cutting", gap, closing, offset)


def _follow(plan: Plan, name: str, gap_m: float, closing_mps: float, offset_m: Callable[[float], float]) -> Box | None:
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


# Kinds.


def _passing(plan: Plan) -> None:
    plan.cruise(1.2, 3.5)


def _ahead(plan: Plan) -> None:
    plan.cruise(1.2, 3.0)
    obstacle_ahead(plan)


def _crossing(plan: Plan) -> None:
    plan.cruise(1.2, 2.8)
    crossing_walker(plan)


def _oncoming(plan: Plan) -> None:
    plan.cruise(1.0, 2.5)
    if plan.random.random() < 0.5:
        oncoming_mover(plan, "oncoming", (-0.3, 0.3), cart=True)
    else:
        side = plan.side()
        oncoming_mover(plan, "oncoming", (side * 0.6, side * 0.65), cart=False, contact_s=plan.end_s * 0.8)


def _cut_in(plan: Plan) -> None:
    plan.cruise(1.5, 3.0)
    cutting_cart(plan)


def _leader(plan: Plan) -> None:
    plan.cruise(1.2, 2.8)
    closing = plan.between(0.45, 0.8)
    gap, right = closing * plan.end_s + plan.between(0.9, 1.3), plan.between(-0.1, 0.1)
    _follow(plan, "leader", gap, closing, lambda _: right)


def _vibration(plan: Plan) -> None:
    plan.cruise(1.2, 2.5)
    plan.shake(plan.between(1.0, 2.0))
    crossing_walker(plan) if plan.random.random() < 0.5 else obstacle_ahead(plan)


def _turn(plan: Plan) -> None:
    speed = plan.cruise(1.2, 2.4)
    rate = plan.side() * min(plan.between(0.1, 0.3), 0.25 * 9.81 / speed)
    begin = plan.between(1.0, 2.0)
    hold = min(plan.between(3.0, 5.0), 1.3 / abs(rate))
    knots = ((0.0, 0.0), (begin, 0.0), (begin + 0.8, rate), (begin + hold, rate), (begin + hold + 0.8, 0.0))
    plan.change(yaw_rate=Profile(knots))
    obstacle_ahead(plan)


def _crowd(plan: Plan) -> None:
    plan.cruise(1.0, 2.0)
    crossing_walker(plan, "walker_0", pass_s=plan.end_s * 0.75)
    for number in range(1, int(plan.random.integers(5, 8))):
        if number % 2:
            side = plan.side()
            oncoming_mover(
                plan,
                f"walker_{number}",
                (side * 1.3, side * 2.6),
                cart=False,
                contact_s=plan.between(0.4, 1.3) * plan.end_s,
            )
        else:
            crossing_walker(plan, f"walker_{number}", miss_m=(-3.0, 3.0), pass_s=plan.between(0.5, 1.5) * plan.end_s)


def _slow_rover(plan: Plan) -> None:
    plan.change(
        speed=Profile(((0.0, 0.05),)),
        half_width_m=0.12,
        horizon_s=20.0,
        camera_height_m=0.12,
        ground=replace(plan.drive.ground, feature_m=0.02),
    )
    road = Road(plan.drive)
    for number in range(int(plan.random.integers(14, 20))):
        size = plan.between(0.06, 0.2), plan.between(0.09, 0.3), plan.between(0.06, 0.2)
        right = plan.side() * (plan.drive.half_width_m + 0.06 + size[0] + plan.between(0.0, 0.5))
        place = road.place(plan.between(0.5, 3.0), right)
        plan.stand(f"clutter_{number}", place, size, turn_rad=plan.between(-0.5, 0.5))
    contact = 0.05 * (plan.end_s + plan.between(2.0, 5.0))
    place = road.place(contact + 0.06, plan.between(-0.06, 0.06))
    plan.stand("obstacle", place, (plan.between(0.1, 0.22), 0.2, 0.12))
    for number in range(8):
        place = road.place(4.2, (number - 3.5) * 0.6)
        plan.stand(f"wall_{number}", place, (0.58, 1.0, 0.1), paint=plan.paint(0.08))


def _dusk(plan: Plan) -> None:
    plan.cruise(1.2, 2.5)
    low, jump = plan.between(0.4, 0.55), plan.between(0.3, 0.7) * plan.end_s
    knots = ((0.0, low), (jump, low * 0.85), (jump + 0.05, low * 1.5), (plan.end_s, low * 1.3))
    plan.change(gain=Profile(knots), noise=replace(plan.drive.noise, picture=4.0))
    crossing_walker(plan) if plan.random.random() < 0.5 else obstacle_ahead(plan)


def _stop_and_go(plan: Plan) -> None:
    speed, end = plan.between(1.5, 2.5), plan.end_s
    knots = (
        (0.0, 0.0),
        (0.08 * end, 0.0),
        (0.22 * end, speed),
        (0.38 * end, speed),
        (0.5 * end, 0.0),
        (0.58 * end, 0.0),
        (0.7 * end, speed),
    )
    plan.change(speed=Profile(knots))
    obstacle_ahead(plan)


def _reversing(plan: Plan) -> None:
    speed = plan.between(0.6, 1.5)
    plan.change(speed=Profile(((0.0, -speed), (plan.end_s, -speed * plan.between(0.8, 1.1)))))


def _far_walker(plan: Plan) -> None:
    plan.cruise(2.8, 3.8)
    plan.clutter_gap_m = (2.5, 5.0)
    crossing_walker(plan, "far_walker", pass_s=plan.end_s + plan.between(0.2, 1.0), speed_mps=(0.5, 0.9))


def _two_crossing(plan: Plan) -> None:
    plan.cruise(1.2, 2.5)
    crossing_walker(plan, "walker_left", side=-1, pass_s=plan.end_s * plan.between(0.55, 0.75))
    crossing_walker(plan, "walker_right", side=1, pass_s=plan.end_s * plan.between(0.8, 1.0))


def _low_texture(plan: Plan) -> None:
    plan.cruise(1.2, 2.5)
    plan.contrast = 0.22
    plan.change(ground=replace(plan.drive.ground, contrast=0.3), sky=replace(plan.drive.sky, contrast=0.3))
    box = crossing_walker(plan) if plan.random.random() < 0.5 else obstacle_ahead(plan)
    if box is not None:
        plan.boxes[-1] = replace(box, paint=replace(box.paint, contrast=0.55))


_KINDS: dict[str, Callable[[Plan], None]] = {
    "passing": _passing,
    "ahead": _ahead,
    "crossing": _crossing,
    "oncoming": _oncoming,
    "cut_in": _cut_in,
    "leader": _leader,
    "vibration": _vibration,
    "turn": _turn,
    "crowd": _crowd,
    "slow_rover": _slow_rover,
    "dusk": _dusk,
    "stop_and_go": _stop_and_go,
    "reversing": _reversing,
    "far_walker": _far_walker,
    "two_crossing": _two_crossing,
    "low_texture": _low_texture,
}

KINDS: tuple[str, ...] = tuple(_KINDS)
"""Kinds of drive; in `passing` and `reversing` nothing threatens."""


def make(
    kind: str,
    seed: int,
    *,
    seconds: float | None = None,
    fps: float | None = None,
    width: int = 640,
    height: int = 480,
    focal_px: float = 500.0,
) -> Drive:
    """The drive of a kind and a seed.

    By default 8 s at 20 frames/s; `slow_rover`, 5 cm/s as in the paper, lasts 30 s at 3 frames/s. Raises
    ValueError on an unknown kind, a negative seed, or a drive without a picture.
    """
    if kind not in _KINDS:
        raise ValueError(f"unknown kind of drive {kind!r}; one of {', '.join(KINDS)}")
    slow = kind == "slow_rover"
    seconds = seconds or (30.0 if slow else 8.0)
    fps = fps or (3.0 if slow else 20.0)
    if seed < 0 or seconds * fps < 1 or min(width, height) < 16 or focal_px <= 0:
        raise ValueError("a drive needs a seed >= 0, at least one picture of 16x16 px, and a positive focal length")
    random = np.random.default_rng([seed, zlib.crc32(kind.encode())])
    bias = random.normal(0, 0.005, 3).tolist(), random.normal(0, 0.1, 3).tolist()
    noise = SensorNoise(tuple(bias[0]), accel_bias_mps2=tuple(bias[1]), speed_scale=float(random.normal(1, 0.01)))
    still = Profile(((0.0, 0.0),))
    drive = Drive(kind, seed, seconds, fps, still, still, (), Lens(width, height, focal_px), noise)
    plan = Plan(random, drive)
    plan.change(
        ground=replace(plan.paint(0.08), grey=plan.between(90, 120)),
        sky=replace(plan.paint(0.1), grey=150.0),
        camera_pitch_rad=plan.between(-0.03, 0.03),
        lens=replace(drive.lens, vignetting=plan.between(0.0, 0.3)),
    )
    if not slow:
        plan.shake(plan.between(0.05, 0.2))
    _KINDS[kind](plan)
    if not slow:
        line_with_clutter(plan)
    return plan.finish()
