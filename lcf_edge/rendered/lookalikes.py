"""Kinds of drive in which something looks like something else, or is hard to see."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lcf_edge.rendered.drives import Box, Drop, Lamp, Paint, Profile, Shadow
from lcf_edge.rendered.placing import crossing_walker, obstacle_ahead, through
from lcf_edge.rendered.plan import Plan, Road

_LINE_M = 4.0  # long lines are made of pieces; they overlap, so that no joint is seen


def _plain(grey: float) -> Paint:
    return Paint(0, contrast=0.0, grey=grey)


def _along(plan: Plan, name: str, right_m: float, size_m: tuple[float, float], grey: float) -> None:
    """Something plain of one width and height along the whole way, `right_m` beside its middle."""
    road = Road(plan.drive)
    width, height = size_m
    for number, distance in enumerate(np.arange(-2.0, road.length_m + 40.0, _LINE_M).tolist()):
        (x, z), heading = road.place(distance, right_m)
        path = ((0.0, float(x), float(z)),)
        box = Box(f"{name}_{number}", width, height, 1.05 * _LINE_M, path, heading_rad=heading, paint=_plain(grey))
        plan.boxes.append(box)


def _walker_or_obstacle(plan: Plan) -> None:
    crossing_walker(plan) if plan.random.random() < 0.5 else obstacle_ahead(plan)


def _long_lines(plan: Plan) -> None:
    """Lane line and kerb beside the path, and farther out a plain wall with a skirting board; the camera sharpens."""
    plan.cruise(1.2, 3.0)
    plan.change(sharpening=plan.between(0.8, 1.5))
    half, side = plan.drive.half_width_m, plan.side()
    plan.walls = False
    _walker_or_obstacle(plan)
    _along(plan, "line", side * (half + plan.between(0.1, 0.18)), (0.1, 0.003), 210)
    _along(plan, "kerb", -side * (half + plan.between(0.12, 0.18)), (0.15, 0.1), 150)
    wall = side * plan.between(4.3, 4.8)
    _along(plan, "wall", wall, (0.1, 3.0), 170)
    _along(plan, "board", wall - side * 0.06, (0.02, 0.12), 60)


def _crossing_car(plan: Plan, name: str, speed_mps: tuple[float, float], look: Callable[[], Paint]) -> None:
    """A car crosses from one side, and would be met."""
    plan.change(speed=Profile(((0.0, plan.between(2.0, 3.5)),)))
    plan.walls = False
    plan.clutter_gap_m = (3.0, 6.0)
    road, side = Road(plan.drive), plan.side()
    when = plan.between(0.6, 0.95) * plan.end_s
    reach = float(plan.drive.speed.integral(np.array([when]))[0])

    def draw() -> Box:
        size = plan.between(1.6, 1.8), plan.between(1.3, 1.5), plan.between(3.8, 4.4)
        beyond = size[2] / 2 + plan.drive.half_width_m * plan.between(0.5, 0.7)
        point, heading = road.place(reach + size[0] / 2, -side * beyond)
        way = heading + side * (math.pi / 2 + plan.between(-0.03, 0.03))
        velocity = plan.between(*speed_mps) * np.array([-math.sin(way), math.cos(way)])
        return Box(name, *size, path=tuple(through(point, velocity, when)), heading_rad=way, paint=look())

    plan.add(draw)


def _dark_crossing(plan: Plan) -> None:
    """A dark car crosses fast before a bright skyline."""
    plan.change(sky=replace(plan.drive.sky, contrast=1.7))
    _crossing_car(plan, "dark_car", (2.5, 6.0), lambda: replace(plan.paint(0.3), contrast=0.22, grey=30.0))


def _fast_crossing(plan: Plan) -> None:
    """A car crosses so fast that it leaps 50 to 100 px from image to image."""
    _crossing_car(plan, "fast_car", (6.0, 10.0), lambda: plan.paint(0.3))


def _own_bumper(plan: Plan) -> None:
    """The vehicle's own front fills the foot of the image, and a rod rises from it."""
    plan.cruise(1.2, 2.8)
    width, height = plan.drive.lens.width, plan.drive.lens.height
    left, middle, right = (height * plan.between(0.78, 0.88) for _ in range(3))
    rod, thick = width * plan.between(0.15, 0.85), width * 0.02
    bumper = ((0.0, left), (width / 2, middle), (width - 1.0, right), (width - 1.0, height - 1.0), (0.0, height - 1.0))
    top = height * plan.between(0.55, 0.65)
    plan.change(own_parts=(bumper, ((rod, top), (rod + thick, top), (rod + thick, height - 1.0), (rod, height - 1.0))))
    _walker_or_obstacle(plan)


def _repetitive(plan: Plan) -> None:
    """Paving stones, and bricks on all that stands: every corner looks like its neighbours."""
    plan.cruise(1.2, 2.8)
    plan.change(ground=replace(plan.drive.ground, tile_m=plan.between(0.2, 0.4)))
    plan.tile_m = plan.between(0.12, 0.25)
    _walker_or_obstacle(plan)


def _motion_blur(plan: Plan) -> None:
    """Exposes long while it shakes."""
    plan.cruise(1.5, 3.0)
    plan.shake(plan.between(0.5, 1.0))
    plan.change(exposure_s=plan.between(0.02, 0.035))
    _walker_or_obstacle(plan)


def _glossy_floor(plan: Plan) -> None:
    """A hall with lamps in the ceiling and in the floor, where they move as what lies far below."""
    plan.cruise(1.2, 2.5)
    plan.change(
        ground=replace(plan.drive.ground, contrast=0.25, grey=plan.between(80, 110)),
        gloss=plan.between(0.4, 0.7),
        ceiling_m=plan.between(2.5, 4.0),
        lamps=_lamps(plan),
    )
    _walker_or_obstacle(plan)


def _lamps(plan: Plan) -> tuple[Lamp, ...]:
    road = Road(plan.drive)
    rows, gap = (plan.between(-2.2, -1.0), plan.between(0.8, 2.2)), plan.between(1.8, 3.0)
    size = plan.between(0.2, 0.6), plan.between(0.6, 1.2)
    places = [
        road.place(d, right)[0].tolist() for d in np.arange(0, road.length_m + 30, gap).tolist() for right in rows
    ]
    return tuple(Lamp(x, z, *size) for x, z in places)


def _rolling_shutter(plan: Plan) -> None:
    """Rows are read one after the other while it shakes: what is upright leans and wobbles."""
    plan.cruise(1.2, 2.8)
    plan.shake(plan.between(0.4, 0.8))
    plan.change(readout_s=plan.between(0.015, 0.03))
    _walker_or_obstacle(plan)


def _moving_shadows(plan: Plan) -> None:
    """The vehicle's own shadow goes before it, and others sweep across the ground."""
    plan.cruise(1.2, 2.8)
    half = plan.drive.half_width_m
    own = Shadow(plan.between(-0.5, 0.5), plan.between(1.2, 2.0), 2 * half, plan.between(0.8, 1.6), 0.45)
    others = (
        Shadow(
            plan.between(-1.0, 1.0),
            plan.between(3.0, 8.0),
            plan.between(0.3, 1.0),
            plan.between(0.5, 2.0),
            plan.between(0.3, 0.5),
            plan.side() * plan.between(0.5, 2.0),
        )
        for _ in range(3)
    )
    plan.change(shadows=(own, *others))
    _walker_or_obstacle(plan)


def _swaying_trees(plan: Plan) -> None:
    """Trees on both sides bend in the wind: they move, and stay where they are."""
    plan.cruise(1.2, 2.8)
    plan.walls = False
    _walker_or_obstacle(plan)
    road = Road(plan.drive)
    for number, distance in enumerate(np.arange(2.0, road.length_m + 20.0, plan.between(1.5, 2.5)).tolist()):
        right = (-1) ** number * (plan.drive.half_width_m + plan.between(0.9, 2.5))
        size = plan.between(0.5, 0.9), plan.between(2.0, 4.0), plan.between(0.5, 0.9)
        tree = plan.stand(f"tree_{number}", road.place(distance, right), size, turn_rad=plan.between(-0.5, 0.5))
        if tree is not None:
            swaying = replace(tree, sway_m=plan.between(0.03, 0.12), sway_hz=plan.between(0.2, 0.5))
            plan.boxes[plan.boxes.index(tree)] = swaying


def _biased_gyro(plan: Plan) -> None:
    """An uncalibrated chip: each axis is off by 5 to 20 degrees a second."""
    plan.cruise(1.2, 2.8)
    x, y, z = (plan.side() * math.radians(plan.between(5.0, 20.0)) for _ in range(3))
    plan.change(noise=replace(plan.drive.noise, gyro_bias_radps=(x, y, z)))
    _walker_or_obstacle(plan)


def _wet_lens(plan: Plan) -> None:
    """Drops and dirt on the lens, on a winding way."""
    plan.cruise(1.2, 2.8)
    side, rate = plan.side(), plan.between(0.3, 0.5)
    knots = ((0.0, side * rate), (0.25, side * rate), (0.35, -side * rate), (0.75, -side * rate), (0.85, side * rate))
    plan.change(yaw_rate=Profile(tuple((share * plan.end_s, turn) for share, turn in knots)))
    width, height = plan.drive.lens.width, plan.drive.lens.height
    drops = (
        Drop(
            width * plan.between(0.15, 0.85),
            height * plan.between(0.2, 0.8),
            width * plan.between(0.04, 0.08),
            is_dirt=number == 0,
        )
        for number in range(int(plan.random.integers(3, 6)))
    )
    plan.change(drops=tuple(drops))
    _walker_or_obstacle(plan)


LOOKALIKES: dict[str, Callable[[Plan], None]] = {
    "long_lines": _long_lines,
    "dark_crossing": _dark_crossing,
    "fast_crossing": _fast_crossing,
    "own_bumper": _own_bumper,
    "repetitive": _repetitive,
    "motion_blur": _motion_blur,
    "glossy_floor": _glossy_floor,
    "rolling_shutter": _rolling_shutter,
    "moving_shadows": _moving_shadows,
    "swaying_trees": _swaying_trees,
    "biased_gyro": _biased_gyro,
    "wet_lens": _wet_lens,
}
