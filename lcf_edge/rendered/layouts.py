"""The kinds of drive: layouts, speeds, textures and sides drawn from a seed."""

import zlib
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lcf_edge.rendered.drives import Drive, Lens, Profile, SensorNoise
from lcf_edge.rendered.lookalikes import LOOKALIKES
from lcf_edge.rendered.placing import (
    crossing_walker,
    cutting_cart,
    follow,
    line_with_clutter,
    obstacle_ahead,
    oncoming_mover,
)
from lcf_edge.rendered.plan import Plan, Road


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
    follow(plan, "leader", gap, closing, lambda _: right)


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


def _turn_ahead_of_axle(plan: Plan) -> None:
    plan.change(camera_ahead_m=plan.between(0.2, 0.6))
    _turn(plan)


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
    plan.change(gain=Profile(knots), noise=replace(plan.drive.noise, image=4.0))
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
    "turn_ahead_of_axle": _turn_ahead_of_axle,
    "crowd": _crowd,
    "slow_rover": _slow_rover,
    "dusk": _dusk,
    "stop_and_go": _stop_and_go,
    "reversing": _reversing,
    "far_walker": _far_walker,
    "two_crossing": _two_crossing,
    "low_texture": _low_texture,
    **LOOKALIKES,
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
    ValueError on an unknown kind, a negative seed, or a drive without an image.
    """
    if kind not in _KINDS:
        raise ValueError(f"unknown kind of drive {kind!r}; one of {', '.join(KINDS)}")
    slow = kind == "slow_rover"
    seconds = seconds or (30.0 if slow else 8.0)
    fps = fps or (3.0 if slow else 20.0)
    if seed < 0 or seconds * fps < 1 or min(width, height) < 16 or focal_px <= 0:
        raise ValueError("a drive needs a seed >= 0, at least one image of 16x16 px, and a positive focal length")
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
