"""S: circles that belong to one thing are one object, with its class, its contact and its identity."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Camera, Config, Filter, Memory
from lcf_edge.filter import Corners, LineCircleFilter, Motion, square_expert
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.group_motion import MotionSums
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CircleTable, ObjectTable
from lcf_edge.messages import ObjectClass, ObjectState

TR_S = Config().filter.tr_s
SETTINGS = Settings(Filter(), Pinhole(500.0, 500.0, 319.5, 239.5))
SPEED_MPS, FPS = 2.0, 20.0

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]


def steps(way: Any, config: Config | None = None, speed_mps: float | None = None) -> Iterator[LineCircleFilter]:
    """The filter after each frame."""
    tables = LineCircleFilter(config or Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, motion if speed_mps is None else replace(motion, speed_mps=speed_mps))
        yield tables


def published(objects: ObjectTable) -> list[int]:
    """Rows of published objects."""
    return np.flatnonzero(objects.active & (objects.trust >= TR_S)).tolist()


def without(corners: Corners, hidden: set[bytes]) -> Corners:
    """The corners but for those of landmarks with these looks."""
    keep = np.array([looks.tobytes() not in hidden for looks in corners.appearance])
    return Corners(corners.pixel[keep], corners.position[keep], corners.appearance[keep])


def looks_of(way: Any, landmarks: slice) -> set[bytes]:
    """Of some landmarks of a drive."""
    return {looks.tobytes() for looks in way.looks[landmarks]}


def test_a_wall_ahead_is_one_object_that_stands(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    way = drive(clutter(150)) + drive(box((0.0, -0.4, 7.0), (0.5, 0.9, 0.0), landmarks=40))
    *_, tables = steps(replace(way, frames=30))
    left_m = 7.0 - SPEED_MPS * 29 / FPS
    (row,) = published(tables.objects)
    objects = tables.objects
    assert objects.class_id[row] == ObjectClass.STANDING
    assert objects.state[row] == ObjectState.SEEN
    assert objects.ttc[row] == pytest.approx(left_m / SPEED_MPS, rel=0.1)
    assert objects.range[row] == pytest.approx(left_m, rel=0.1)
    assert abs(objects.lateral[row]) < 0.15
    assert objects.probability[row] > 0.8


@pytest.mark.parametrize("side", [-1, 1])
def test_who_crosses_is_one_object_from_head_to_foot(
    drive: Drive, box: Landmarks, clutter: Landmarks, side: int
) -> None:
    """1.7 m tall, on the ground 0.3 m under the camera, 1.2 m/s."""
    walker = drive(box((-2.2 * side, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=60), np.array([1.2 * side, 0, 0]))
    seen: list[tuple[int, int]] = []
    for tables in steps(replace(drive(clutter(150)) + walker, frames=34)):
        objects = tables.objects
        rows = published(objects)
        seen += [(int(objects.id[row]), int(objects.class_id[row])) for row in rows]
    assert len(seen) > 10
    assert len({identity for identity, _ in seen}) == 1
    assert {what for _, what in seen[3:]} == {ObjectClass.CROSSING}
    assert np.sign(objects.right[rows[0]]) == side
    assert abs(objects.right[rows[0]]) == pytest.approx(1.2, rel=0.3)
    assert len({int(one) for one in tables.rebel.square[tables.rebel.active]} - {-1}) == 1


@pytest.mark.parametrize("side", [-1, 1])
def test_who_leaves_to_the_side_never_stands_and_is_never_imminent(
    drive: Drive, box: Landmarks, clutter: Landmarks, side: int
) -> None:
    """Beside the path, walking away from it, the vehicle fast."""
    walker = drive(box((1.0 * side, -0.55, 5.0), (0.4, 1.7, 0.2), landmarks=60), np.array([1.4 * side, 0, 0]))
    reported = 0
    for tables in steps(replace(drive(clutter(150)) + walker, frames=36)):
        objects = tables.objects
        for row in published(objects):
            reported += 1
            assert objects.class_id[row] != ObjectClass.STANDING
            assert objects.probability[row] < 0.1
    assert reported > 5


def test_what_goes_ahead_leads(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    random = np.random.default_rng(3)
    ground = np.stack([random.choice([-1, 1], 250) * random.uniform(0.4, 3, 250), np.full(250, 0.3),
                       random.uniform(1, 12, 250)], axis=1)  # fmt: skip
    leader = drive(box((0.0, 0.1, 2.5), (0.6, 0.35, 0.0), landmarks=40), np.array([0, 0, 2.0]))
    *_, tables = steps(replace(drive(ground) + drive(clutter(150)) + leader, frames=18))
    (row,) = published(tables.objects)
    assert tables.objects.class_id[row] == ObjectClass.LEADING
    assert tables.objects.forward[row] == pytest.approx(2.0, rel=0.2)
    assert tables.objects.range[row] == pytest.approx(2.5, rel=0.2)
    assert tables.objects.probability[row] < 0.2


def two_who_cross(drive: Drive, box: Landmarks, clutter: Landmarks) -> Any:
    """From both sides."""
    left = drive(box((-2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=50), np.array([1.0, 0, 0]))
    right = drive(box((2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=50), np.array([-1.0, 0, 0]))
    return replace(drive(clutter(150)) + left + right, frames=22)


def test_two_who_cross_from_both_sides_are_two(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    *_, tables = steps(two_who_cross(drive, box, clutter))
    rows = published(tables.objects)
    assert len(rows) == 2
    assert sorted(np.sign(tables.objects.right[rows])) == [-1, 1]


def test_two_of_which_an_image_shows_nothing_stay_two(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    way = two_who_cross(drive, box, clutter)
    tables = LineCircleFilter(Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, motion)
    tables.step(without(corners, looks_of(way, slice(None))), motion)
    assert len(published(tables.objects)) == 2


@pytest.mark.parametrize(("gap_px", "pxps", "one"), [(10, 0, True), (10, 60, True), (60, 0, False), (60, 60, True)])
def test_across_a_wide_gap_only_motion_shows_that_two_are_one(
    situation: Callable[..., Any], gap_px: float, pxps: float, one: bool
) -> None:
    """An object and a circle beside it, each 100 px wide, seen from a vehicle that stands."""
    objects, circles, parts = ObjectTable(1), CircleTable(1), MotionSums(1)
    around = situation(speed_mps=0.0)
    objects.x[0], objects.y[0], objects.width[0], objects.height[0] = 200.0, 240.0, 100.0, 100.0
    objects.sideways[0], objects.mm[0], objects.qq[0] = pxps / around.pinhole.fx, 1e-4, 1e-4
    x = 300.0 + gap_px
    circles.x[0], circles.y[0], circles.width[0], circles.height[0] = x, 240.0, 100.0, 100.0
    weight = 0.1
    parts.count[0], parts.weight[0], parts.x[0], parts.y[0] = 10, weight, weight * x, weight * 240.0
    parts.vx[0] = weight * pxps
    assert bool(square_expert.belongs(objects.columns, 0, circles.columns, 0, parts, around, SETTINGS)) == one


@pytest.mark.parametrize(("range_m", "one"), [(2.7, True), (3.2, True), (6.2, False)])
def test_near_the_focus_the_expansion_shows_what_stands_behind_an_object(
    situation: Callable[..., Any], range_m: float, one: bool
) -> None:
    """There things at different ranges move much the same. The object stands at 2.7 m, the circle is beside it."""
    objects, circles, parts = ObjectTable(1), CircleTable(1), MotionSums(1)
    around = situation(speed_mps=2.0)
    left, y = around.focus_x - 35.0, around.horizon_y
    objects.x[0], objects.y[0], objects.width[0], objects.height[0] = left, y, 50.0, 250.0
    objects.looming[0], objects.reference[0], objects.mm[0], objects.qq[0] = 2.0 / 2.7, 2.0, 0.04**2, 0.01**2
    circles.x[0], circles.y[0], circles.width[0], circles.height[0] = around.focus_x + 40.0, y, 40.0, 130.0
    weight, looming = 3.0, 2.0 / range_m  # seen for 0.75 s
    x, below = (part.ravel() for part in np.meshgrid(np.linspace(20, 60, 5), np.linspace(-65, 65, 4)))
    vx, vy = looming * x, looming * below
    x, y = x + around.focus_x, below + y
    parts.count[0], parts.weight[0], parts.forward[0] = len(x), weight * len(x), weight * len(x) * 2.0
    for name, value in (
        ("x", x), ("y", y), ("vx", vx), ("vy", vy), ("xx", x * x), ("yy", y * y), ("xvx", x * vx), ("yvy", y * vy)
    ):  # fmt: skip
        np.asarray(getattr(parts, name))[0] = weight * value.sum()
    assert bool(square_expert.belongs(objects.columns, 0, circles.columns, 0, parts, around, SETTINGS)) == one


@pytest.mark.parametrize(("speed_mps", "aside_mps", "ahead_m"), [(0.5, 0.3, 5.0), (1.0, 0.3, 6.0), (0.3, 0.25, 5.0)])
def test_two_who_part_before_the_vehicle_come_no_nearer_than_their_height_shows(
    drive: Drive, box: Landmarks, clutter: Landmarks, speed_mps: float, aside_mps: float, ahead_m: float
) -> None:
    """They stand side by side and walk off to both sides: taken for one, they grow in width and not in height."""
    way = replace(drive(clutter(150)), frames=36, speed_mps=speed_mps)
    for side in (-1, 1):
        walker = box((0.22 * side, -0.55, ahead_m), (0.4, 1.7, 0.2), landmarks=50, seed=2 + side)
        way = way + drive(walker, np.array([aside_mps * side, 0, 0]))
    told = 0
    for frame, tables in enumerate(steps(way)):
        objects = tables.objects
        left_m = ahead_m - speed_mps * frame / FPS
        for row in published(objects):
            told += 1
            assert objects.looming[row] == pytest.approx(speed_mps / left_m, rel=0.25)
            assert objects.range[row] > 0.7 * left_m
            assert objects.probability[row] < 0.3
    assert told > 20


def test_an_object_that_is_not_seen_coasts_keeps_its_id_and_ends(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """Somebody who crosses vanishes for 0.25 s, then for good."""
    walker = drive(box((-2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=60), np.array([1.2, 0, 0]))
    way = replace(drive(clutter(150)) + walker, frames=60)
    tables = LineCircleFilter(Config(), way.lens)
    states, before = [], None
    for seq, (corners, motion) in enumerate(way):
        gone = 20 <= seq < 25 or seq >= 32
        tables.step(without(corners, looks_of(way, slice(150, None))) if gone else corners, motion)
        rows = published(tables.objects)
        if seq == 19:
            before = tables.objects.id[rows].tolist()
        if 20 <= seq < 25:
            states += tables.objects.state[rows].tolist()
        if seq == 30:
            assert tables.objects.id[rows].tolist() == before
    assert ObjectState.COASTING in states
    assert not published(tables.objects)


def test_without_a_speed_the_contact_is_known_and_no_speed_over_ground(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    walker = drive(box((-1.6, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=60), np.array([1.0, 0, 0]))
    reported = 0
    for tables in steps(replace(drive(clutter(150)) + walker, frames=24), speed_mps=math.nan):
        objects = tables.objects
        for row in published(objects):
            reported += 1
            assert objects.class_id[row] == ObjectClass.UNKNOWN
            assert math.isnan(objects.forward[row])
            assert not math.isnan(objects.ttc[row])
    assert reported


def test_without_a_speed_a_wall_ahead_is_met_and_has_a_range_by_its_foot(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    way = drive(clutter(150)) + drive(box((0.0, -0.2, 7.0), (0.5, 1.4, 0.0), landmarks=60))
    config = Config(camera=Camera(height_m=0.5))
    seen, off = [], []
    for seq, tables in enumerate(steps(replace(way, frames=40), config, speed_mps=math.nan)):
        objects, left_m = tables.objects, 7.0 - SPEED_MPS * seq / FPS
        for row in published(objects):
            seen.append(objects.probability[row])
            off.append(abs(objects.range[row] - left_m) / objects.range_sigma[row])
            assert objects.ttc[row] * SPEED_MPS == pytest.approx(left_m, rel=0.4)
    assert len(seen) > 15
    assert np.median(seen) > 0.8
    assert np.count_nonzero(np.isfinite(off)) > 10
    assert np.nanmedian(off) < 2


def test_without_a_speed_who_leaves_to_the_side_is_hardly_met(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    walker = drive(box((1.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=60), np.array([1.0, 0, 0]))
    reported = 0
    for tables in steps(replace(drive(clutter(150)) + walker, frames=30), speed_mps=math.nan):
        rows = published(tables.objects)
        reported += len(rows)
        assert not (tables.objects.probability[rows] > 0.3).any()
    assert reported


def test_what_finds_no_place_in_a_full_table_is_counted(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    left = drive(box((-2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=50), np.array([1.0, 0, 0]))
    right = drive(box((2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=50), np.array([-1.0, 0, 0]))
    way = replace(drive(clutter(150)) + left + right, frames=22)
    tables = LineCircleFilter(Config(memory=Memory(objects=1)), way.lens)
    evicted = [tables.step(corners, motion).sizes.evicted for corners, motion in way]
    assert tables.objects.count == 1
    assert sum(evicted) > 0


def test_what_is_seen_keeps_its_place_in_a_full_table(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    left = drive(box((-2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=50), np.array([1.0, 0, 0]))
    right = drive(box((2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=50), np.array([-1.0, 0, 0]))
    way = replace(drive(clutter(150)) + left + right, frames=40)
    reported = [
        int(tables.objects.id[row])
        for tables in steps(way, Config(memory=Memory(objects=1)))
        for row in published(tables.objects)
    ]
    assert len(reported) > 20
    assert len(set(reported)) == 1


def test_an_object_is_reported_from_its_third_frame_on(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    """The numbers of its first frames are those of a few edges."""
    walker = drive(box((-2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=60), np.array([1.2, 0, 0]))
    reported_after_s = []
    for tables in steps(replace(drive(clutter(150)) + walker, frames=24)):
        reported_after_s += tables.objects.age_s[published(tables.objects)].tolist()
    assert reported_after_s
    assert min(reported_after_s) == pytest.approx(2 / FPS)


def test_of_few_edges_it_is_reported_three_frames_later(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    walker = drive(box((-2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=6), np.array([1.2, 0, 0]))
    few, reported_after_s = Config(filter=Filter(rebel_support=3)), []
    for tables in steps(replace(drive(clutter(150)) + walker, frames=30), few):
        reported_after_s += tables.objects.age_s[published(tables.objects)].tolist()
    assert min(reported_after_s) == pytest.approx(5 / FPS)


def test_where_nothing_breaks_the_flow_there_is_no_object(drive: Drive, clutter: Landmarks) -> None:
    for tables in steps(replace(drive(clutter(200)), frames=24)):
        assert tables.objects.count == 0


def before_a_wall(drive: Drive, box: Landmarks, clutter: Landmarks) -> tuple[LineCircleFilter, Corners, Motion]:
    """The filter after a drive towards a wall, and the last that it was given."""
    wall = replace(drive(clutter(150)) + drive(box((0.0, -0.2, 4.0), (0.6, 0.9, 0.0), landmarks=40)), frames=30)
    tables = LineCircleFilter(Config(), wall.lens)
    for corners, motion in wall:
        tables.step(corners, motion)
    return tables, corners, motion


def test_what_stands_before_a_vehicle_that_stops_stays_where_it_was(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """Nothing moves in the image any more: it breaks no flow, and is still there; what is known of it stays."""
    tables, corners, motion = before_a_wall(drive, box, clutter)
    (row,) = published(tables.objects)
    identity, numbers = tables.objects.id[row], []
    for _ in range(100):
        tables.step(corners, replace(motion, speed_mps=0.0))
        assert tables.objects.id[published(tables.objects)].tolist() == [identity]
        numbers.append((float(tables.objects.range[row]), float(tables.objects.range_sigma[row])))
    assert numbers[20] == pytest.approx(numbers[-1], rel=0.1)
    assert tables.objects.class_id[row] == ObjectClass.STANDING


def test_before_a_vehicle_that_stands_an_object_is_not_held_by_what_lies_beside_it(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """Else what somebody hid would hold him at its place, long after he left."""
    tables, corners, motion = before_a_wall(drive, box, clutter)
    for _ in range(20):
        tables.step(corners, replace(motion, speed_mps=0.0))
    edges, (row,) = tables.edges, published(tables.objects)
    x, width = edges.x[: edges.count], tables.objects.width[row]
    beside = np.abs(x - tables.objects.x[row]) > 1.5 * width
    assert beside.sum() > 10
    edges.square[: edges.count][beside] = row
    tables.step(corners, replace(motion, speed_mps=0.0))
    own = edges.square[: edges.count] == row
    assert own.any()
    assert (np.abs(edges.x[: edges.count][own] - tables.objects.x[row]) <= 1.5 * width).all()


def grey_image(tables: LineCircleFilter, grey: int) -> npt.NDArray[np.uint8]:
    """A downscaled image, all of one grey but for a gradient."""
    blocks = tables._coarse.blocks
    return np.tile(np.arange(blocks.width, dtype=np.uint8), (blocks.height, 1)) + np.uint8(grey)


@pytest.mark.parametrize(("then", "stays"), [(60, True), (64, True), (120, False)], ids=["same", "lit", "different"])
def test_what_stands_before_a_vehicle_at_rest_is_there_as_long_as_its_place_looks_the_same(
    drive: Drive, box: Landmarks, clutter: Landmarks, then: int, stays: bool
) -> None:
    """Its corners come and go, and what it hid has some as well."""
    wall = replace(drive(clutter(150)) + drive(box((0.0, -0.2, 4.0), (0.6, 0.9, 0.0), landmarks=40)), frames=30)
    tables, mine = LineCircleFilter(Config(), wall.lens), looks_of(wall, slice(150, None))
    image = grey_image(tables, 60)
    for corners, motion in wall:
        tables.step(corners, motion, small=image)
    for _ in range(10):
        tables.step(corners, replace(motion, speed_mps=0.0), small=image)
    (row,) = published(tables.objects)
    before = tables.objects.range[row], tables.objects.x[row], tables.objects.width[row]
    for _ in range(200):
        tables.step(without(corners, mine), replace(motion, speed_mps=0.0), small=grey_image(tables, then))
    assert (row in published(tables.objects)) is stays
    if stays:
        assert (tables.objects.range[row], tables.objects.x[row], tables.objects.width[row]) == pytest.approx(before)


def test_where_it_looks_different_a_few_edges_do_not_hold_what_stood_before_a_vehicle_at_rest(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """What it hid rests as well, and would show for ever that it is there."""
    wall = replace(drive(clutter(150)) + drive(box((0.0, -0.2, 4.0), (0.6, 0.9, 0.0), landmarks=40)), frames=30)
    tables, gone = LineCircleFilter(Config(), wall.lens), looks_of(wall, slice(154, None))
    for corners, motion in wall:
        tables.step(corners, motion, small=grey_image(tables, 60))
    for _ in range(10):
        tables.step(corners, replace(motion, speed_mps=0.0), small=grey_image(tables, 60))
    assert len(published(tables.objects)) == 1
    for _ in range(60):
        tables.step(without(corners, gone), replace(motion, speed_mps=0.0), small=grey_image(tables, 150))
    assert not published(tables.objects)


@pytest.mark.parametrize("shows", [False, True], ids=["nothing", "the background"])
def test_a_few_edges_do_not_hold_somebody_whom_a_vehicle_at_rest_sees_through(
    drive: Drive, box: Landmarks, clutter: Landmarks, shows: bool
) -> None:
    """They may lie on what he hid, and would show for ever that he is there."""
    walker = drive(box((-0.2, -0.3, 1.3), (0.35, 1.0, 0.15), landmarks=30), np.array([0.5, 0, 0]))
    way = replace(walker + drive(clutter(650)), frames=12, speed_mps=0.0)
    tables, hidden, his = LineCircleFilter(Config(), way.lens), looks_of(way, slice(90, None)), looks_of(way, slice(30))
    for corners, motion in way:
        tables.step(without(corners, hidden), motion, small=grey_image(tables, 60))
    (row,) = published(tables.objects)
    left = without(corners, his if shows else his | hidden)
    for _ in range(4 * round(FPS)):
        edges = tables.edges
        near = np.abs(edges.x[: edges.count] - tables.objects.x[row]) < 0.5 * tables.objects.width[row]
        edges.square[np.flatnonzero(near)[:4]] = row
        tables.step(left, motion, small=grey_image(tables, 60))
    assert (row in published(tables.objects)) is not shows


@pytest.mark.parametrize("velocity_mps", [(0.0, -0.8), (0.4, 0.0)], ids=["comes straight", "crosses"])
def test_before_a_vehicle_at_rest_what_comes_or_moves_is_an_object(
    drive: Drive, box: Landmarks, clutter: Landmarks, velocity_mps: tuple[float, float]
) -> None:
    right_mps, forward_mps = velocity_mps
    body = drive(box((0.0, 0.0, 3.5), (0.5, 0.5, 0.1), landmarks=60), np.array([right_mps, 0, forward_mps]))
    *_, tables = steps(replace(drive(clutter(150)) + body, frames=24, speed_mps=0.0))
    (row,) = published(tables.objects)
    assert tables.objects.class_id[row] == (ObjectClass.ONCOMING if forward_mps else ObjectClass.CROSSING)


def test_where_a_vehicle_was_at_rest_earlier_than_it_knew_the_ground_is_no_object(
    drive: Drive, clutter: Landmarks
) -> None:
    """Its edges seem to have fallen short of the flow, as those of something that leads do."""
    random, height_m, least_mps = np.random.default_rng(4), 0.3, 0.08
    ground = np.stack([random.uniform(-1.5, 1.5, 700), np.full(700, height_m), random.uniform(0.6, 12, 700)], axis=1)
    way = replace(drive(ground) + drive(clutter(100)), frames=20, speed_mps=2.0)
    tables = LineCircleFilter(Config(camera=Camera(height_m=height_m)), way.lens)
    for corners, motion in way:
        tables.step(corners, motion)
    for speed_mps in np.arange(way.speed_mps, 0.0, -0.125) - 0.125:
        way = replace(way, points_m=way.in_camera(way.frames - 1), frames=2, speed_mps=speed_mps)
        *_, (corners, motion) = way
        tables.step(corners, replace(motion, speed_mps=max(speed_mps, least_mps)))
    for speed_mps in (least_mps,) * 8 + (0.0,) * 40:
        tables.step(corners, replace(motion, speed_mps=speed_mps))
        assert published(tables.objects) == []


def test_who_leaves_the_image_at_its_side_is_expected_there_for_a_second(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """He walks towards the path beside a faster vehicle, so that it loses sight of him."""
    walker = drive(box((1.5, -0.55, 3.2), (0.4, 1.7, 0.2), landmarks=60), np.array([-0.5, 0, 0]))
    way = replace(drive(clutter(150)) + walker, frames=44, speed_mps=1.5)
    tables, unseen_s = LineCircleFilter(Config(), way.lens), []
    walkers = {looks.tobytes() for looks in way.looks[150:]}
    for corners, motion in way:
        tables.step(corners, motion)
        if not any(looks.tobytes() in walkers for looks in corners.appearance):
            for row in published(tables.objects):
                unseen_s.append(float(tables.objects.unseen_s[row]))
                assert tables.objects.right[row] < 0
                assert tables.objects.class_id[row] != ObjectClass.STANDING
                assert tables.objects.state[row] != ObjectState.SEEN
    assert unseen_s
    assert max(unseen_s) < 1.3


def test_where_the_speed_is_reported_too_low_the_ground_is_no_object(drive: Drive, clutter: Landmarks) -> None:
    """By half of the speed the ground would be a thing that stands above it, twice as near."""
    random = np.random.default_rng(4)
    ground = np.stack([random.uniform(-1.5, 1.5, 500), np.full(500, 0.3), random.uniform(0.6, 9, 500)], axis=1)
    way = replace(drive(ground) + drive(clutter(100)), frames=24, speed_mps=1.0)
    for tables in steps(way, speed_mps=0.5):
        assert published(tables.objects) == []


@pytest.mark.parametrize("fps", [10.0, 20.0, 40.0])
def test_what_is_reported_does_not_depend_on_the_frame_rate(
    drive: Drive, box: Landmarks, clutter: Landmarks, fps: float
) -> None:
    walker = drive(box((-2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=60), np.array([1.2, 0, 0]))
    *_, tables = steps(replace(drive(clutter(150)) + walker, frames=round(1.6 * fps), fps=fps))
    (row,) = published(tables.objects)
    assert tables.objects.class_id[row] == ObjectClass.CROSSING
    assert tables.objects.right[row] == pytest.approx(1.2, rel=0.3)
    assert tables.objects.range[row] == pytest.approx(6.0 - SPEED_MPS * 1.6, rel=0.3)


def remembered_s(way: Any, landmarks: slice, speed_mps: float, border_px: int = 0) -> float:
    """For how long whoever has left the image is reported, or whoever is in it when these landmarks are seen no more.

    The vehicle then goes on so slowly that nothing flows. Corners are lost at the border of the image.
    """
    tables, mine, seen = LineCircleFilter(Config(), way.lens), looks_of(way, landmarks), False
    for shown, motion in way:
        x = shown.pixel[:, 0]
        corners = shown.of((x >= border_px) & (x < way.lens.width - border_px))
        in_sight = any(looks.tobytes() in mine for looks in corners.appearance)
        if seen and not in_sight:
            break
        seen = in_sight
        tables.step(corners, motion)
    assert published(tables.objects)
    for step in range(200):
        tables.step(without(corners, mine), replace(motion, speed_mps=speed_mps))
        if not published(tables.objects):
            return float(step * motion.dt_s)
    return math.inf


@pytest.mark.parametrize(
    ("start_m", "right_mps", "about_s"), [((1.5, 3.8), -0.45, 2.8), ((0.9, 3.2), 0.4, 1.0)], ids=["comes", "leaves"]
)
def test_who_left_the_image_at_its_side_is_remembered_longer_if_he_walks_towards_the_path(
    drive: Drive, box: Landmarks, clutter: Landmarks, start_m: tuple[float, float], right_mps: float, about_s: float
) -> None:
    x, z = start_m
    walker = drive(box((x, -0.55, z), (0.4, 1.7, 0.2), landmarks=60), np.array([right_mps, 0, 0]))
    way = replace(drive(clutter(150)) + walker, frames=60, speed_mps=1.5)
    assert remembered_s(way, slice(150, None), 0.1) == pytest.approx(about_s, abs=0.3)


@pytest.mark.parametrize(
    ("hidden", "about_s"), [(slice(200), 6.0), (slice(140, 200), 2.0)], ids=["nothing", "what lies behind him"]
)
def test_who_was_lost_right_before_a_vehicle_that_stands_is_there_until_it_sees_through_him(
    drive: Drive, box: Landmarks, clutter: Landmarks, hidden: slice, about_s: float
) -> None:
    walker = drive(box((1.0, -0.55, 3.3), (0.4, 1.7, 0.2), landmarks=60), np.array([-0.5, 0, 0]))
    way = replace(drive(clutter(140)) + walker, frames=30, speed_mps=1.5)
    assert remembered_s(way, hidden, 0.1) == pytest.approx(about_s, abs=0.2)


@pytest.mark.parametrize(
    ("stirs_s", "hidden", "about_s"),
    [(0, slice(200), 6.0), (20, slice(200), 26.0), (20, slice(140, 200), 2.6)],
    ids=["still", "stirs", "seen through"],
)
def test_who_was_lost_right_before_a_vehicle_at_rest_is_there_as_long_as_he_stirs(
    drive: Drive, box: Landmarks, clutter: Landmarks, stirs_s: int, hidden: slice, about_s: float
) -> None:
    """So near he fills the image, no corner of him lasts, and nobody stands so still that nothing changes.

    What stirs where the background is seen is somebody else.
    """
    walker = drive(box((1.0, -0.55, 3.3), (0.4, 1.7, 0.2), landmarks=60), np.array([-0.5, 0, 0]))
    way = replace(drive(clutter(140)) + walker, frames=30, speed_mps=1.5)
    tables, lost = LineCircleFilter(Config(), way.lens), looks_of(way, hidden)
    for corners, motion in way:
        tables.step(corners, motion, small=grey_image(tables, 60))
    assert published(tables.objects)
    for step in range(600):
        grey = 60 + 60 * (step // 10 % 2) * (step < stirs_s * FPS)
        tables.step(without(corners, lost), replace(motion, speed_mps=0.0), small=grey_image(tables, grey))
        if not published(tables.objects):
            break
    assert step / FPS == pytest.approx(about_s, abs=0.6)


def test_what_had_few_edges_and_was_lost_right_before_a_vehicle_at_rest_is_hardly_waited_for(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    thing = drive(box((0.0, -0.2, 3.6), (0.35, 0.5, 0.0), landmarks=5))
    way = replace(drive(clutter(150)) + thing, frames=24)
    tables, lost = LineCircleFilter(Config(filter=Filter(rebel_support=3)), way.lens), looks_of(way, slice(None))
    for corners, motion in way:
        tables.step(corners, motion)
    assert published(tables.objects)
    stays = 0
    while published(tables.objects) and stays < 200:
        tables.step(without(corners, lost), replace(motion, speed_mps=0.0))
        stays += 1
    assert stays / FPS == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize(("right_mps", "frames", "about_s"), [(0.5, 50, 1.0), (-0.8, 50, 1.0), (0.15, 150, 0.8)])
def test_who_walks_out_of_the_image_before_a_vehicle_at_rest_is_not_waited_for(
    drive: Drive, box: Landmarks, clutter: Landmarks, right_mps: float, frames: int, about_s: float
) -> None:
    """He did not stop at its border: nothing is missed there, though the last that was seen of a slow one is inside."""
    walker = drive(box((0.0, -0.3, 1.3), (0.35, 1.5, 0.15), landmarks=80), np.array([right_mps, 0, 0]))
    way = replace(drive(clutter(150)) + walker, frames=frames, speed_mps=0.0)
    assert remembered_s(way, slice(150, None), 0.0, border_px=10) == pytest.approx(about_s, abs=0.15)


def ids_after(way: Any, velocity_mps: Any, speed_mps: float) -> tuple[LineCircleFilter, int, list[list[int]]]:
    """The filter, the id of the only object of a drive, and those of each image after somebody moves on otherwise.

    Somebody: the landmarks after the first 150.
    """
    velocity = np.zeros_like(way.points_m)
    velocity[150:] = velocity_mps
    after = replace(way, points_m=way.in_camera(way.frames - 1), velocity_mps=velocity, frames=30, speed_mps=speed_mps)
    tables = LineCircleFilter(Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, motion)
    (before,) = tables.objects.id[published(tables.objects)].tolist()
    ids = []
    for corners, motion in list(after)[1:]:
        tables.step(corners, motion)
        ids.append(tables.objects.id[published(tables.objects)].tolist())
    return tables, before, ids


@pytest.mark.parametrize("speed_mps", [0.0, 0.5])
@pytest.mark.parametrize("right_mps", [0.5, -0.5])
def test_who_stops_going_ahead_and_turns_aside_at_once_stays_one_object(
    drive: Drive, box: Landmarks, clutter: Landmarks, right_mps: float, speed_mps: float
) -> None:
    """His edges break the motion of his object, and found another one: nobody is left behind where he was."""
    leads = drive(box((0.05, -0.3, 1.2), (0.35, 1.5, 0.15), landmarks=80), np.array([0, 0, 0.25]))
    way = replace(drive(clutter(150)) + leads, frames=30, speed_mps=0.5)
    tables, before, ids = ids_after(way, (right_mps, 0, 0.33), speed_mps)
    assert ids == [[before]] * 29
    assert tables.objects.right[published(tables.objects)] * right_mps > 0


@pytest.mark.parametrize("speed_mps", [0.0, 0.4])
@pytest.mark.parametrize("right_mps", [0.9, -0.9])
@pytest.mark.parametrize("range_m", [1.6, 2.0])
def test_who_stood_right_before_a_vehicle_and_walks_on_stays_one_object(
    drive: Drive, box: Landmarks, clutter: Landmarks, range_m: float, right_mps: float, speed_mps: float
) -> None:
    """Nobody is left behind where he stood."""
    stands = drive(box((0.05, -0.3, range_m), (0.35, 1.5, 0.15), landmarks=80))
    way = replace(drive(clutter(150)) + stands, frames=30, speed_mps=0.6)
    tables, before, ids = ids_after(way, (right_mps, 0, 0.2), speed_mps)
    assert ids == [[before]] * 29
    assert tables.objects.right[published(tables.objects)] * right_mps > 0


@pytest.mark.parametrize("then_mps", [(-0.9, 0.0, 0.0), (0.0, 0.0, 0.9)], ids=["turns round", "turns away"])
@pytest.mark.parametrize("speed_mps", [0.0, 0.6])
def test_who_crosses_and_turns_at_once_is_soon_one_object_again(
    drive: Drive, box: Landmarks, clutter: Landmarks, speed_mps: float, then_mps: tuple[float, float, float]
) -> None:
    walker = drive(box((-1.35, -0.3, 2.6), (0.35, 1.5, 0.15), landmarks=80), np.array([0.9, 0, 0]))
    way = replace(drive(clutter(150)) + walker, frames=30, speed_mps=speed_mps)
    _, before, ids = ids_after(way, then_mps, speed_mps)
    assert all(before in each for each in ids)
    assert sum(len(each) > 1 for each in ids) <= 2


def wandering(way: Any, his: set[bytes], sigma_px: float, seed: int) -> Iterator[tuple[Corners, Motion]]:
    """A drive in which the corners of somebody wander about their places, as on clothes and limbs."""
    random = np.random.default_rng(seed)
    off: dict[bytes, npt.NDArray[np.float64]] = {looks: np.zeros(2) for looks in sorted(his)}
    for corners, motion in way:
        position = corners.position.copy()
        for row, looks in enumerate(corners.appearance):
            if looks.tobytes() in his:
                off[looks.tobytes()] = 0.8 * off[looks.tobytes()] + random.normal(0, 0.6 * sigma_px, 2)
                position[row] += off[looks.tobytes()]
        pixel = np.rint(position).clip(0, (way.lens.width - 1, way.lens.height - 1)).astype(corners.pixel.dtype)
        yield Corners(pixel, position, corners.appearance), motion


@pytest.mark.parametrize("speed_mps", [0.0, 0.6])
@pytest.mark.parametrize("seed", range(4))
def test_a_walker_far_off_whose_corners_wander_by_two_px_stays_one_object(
    drive: Drive, box: Landmarks, clutter: Landmarks, seed: int, speed_mps: float
) -> None:
    """His circle does not always move as his object did, and founds no other one."""
    walker = drive(box((-2.5, -0.6, 8.0), (0.45, 1.7, 0.15), landmarks=12), np.array([0.8, 0, 0]))
    way = replace(drive(clutter(300)) + walker, frames=90, speed_mps=speed_mps)
    tables, ids = LineCircleFilter(Config(), way.lens), []
    for corners, motion in wandering(way, looks_of(way, slice(300, None)), 2.0, seed):
        tables.step(corners, motion)
        ids.append(tables.objects.id[published(tables.objects)].tolist())
    assert ids[20:] == [ids[20]] * 70
    assert len(ids[20]) == 1


def test_a_few_edges_do_not_bring_back_who_was_lost_right_before_a_vehicle_at_rest(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """They lay beside him, and would show for ever that he is there."""
    thing = drive(box((0.0, -0.2, 2.0), (0.4, 0.9, 0.0), landmarks=60))
    way = replace(drive(clutter(400)) + thing, frames=24, speed_mps=1.0)
    tables, his = LineCircleFilter(Config(), way.lens), looks_of(way, slice(400, None))
    for corners, motion in way:
        tables.step(corners, motion)
    (row,) = published(tables.objects)
    stayed = 0
    while row in published(tables.objects) and stayed < 10 * FPS:
        tables.step(without(corners, his), replace(motion, speed_mps=0.0))
        if stayed > 2:
            beside = np.abs(tables.edges.x[: tables.edges.count] - tables.objects.x[row])
            tables.edges.square[np.argsort(beside)[:3]] = row
        stayed += 1
    assert stayed / FPS < 7.0


def ground_before(metres: float, points: int) -> npt.NDArray[np.float64]:
    """Landmarks on the ground, up to so far."""
    random = np.random.default_rng(1)
    across, away = random.uniform(-1.2, 1.2, points), random.uniform(0.6, metres, points)
    return np.stack([across, np.full(points, 0.3), away], axis=1)


@pytest.mark.parametrize("hidden_m", [0.0, 0.1])
def test_who_comes_is_not_near_enough_to_stand_where_the_ground_is_seen_beneath_him(
    drive: Drive, box: Landmarks, clutter: Landmarks, hidden_m: float
) -> None:
    """He looms as what stands at a third of his range; of his legs, a part shows no corner."""
    walker = drive(
        box((0.3, -0.55 - hidden_m / 2, 5.0), (0.4, 1.7 - hidden_m, 0.1), landmarks=60), np.array([0, 0, -0.8])
    )
    way = drive(ground_before(3.7, 600)) + drive(clutter(150)) + walker
    *_, tables = steps(replace(way, frames=30, speed_mps=0.4))
    (row,) = published(tables.objects)
    assert tables.objects.class_id[row] == ObjectClass.ONCOMING
    assert tables.objects.range[row] > 3.0
    assert tables.objects.ttc[row] == pytest.approx(3.26 / 1.2, rel=0.15)


def test_an_object_ends_where_the_ground_begins(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    """Where what looms as he does would stand, the ground moves just so, and a few edges there are taken for his."""
    walker = drive(box((0.3, -0.55, 5.0), (0.4, 1.7, 0.1), landmarks=60), np.array([0, 0, -0.8]))
    way = replace(drive(ground_before(3.7, 600)) + drive(clutter(150)) + walker, frames=30, speed_mps=0.4)
    for tables in steps(way):
        edges, bottom_y = tables.edges, 0.0
        for row in published(tables.objects):
            bottom_y = float(tables.objects.y[row] + tables.objects.height[row] / 2)
            beneath = np.abs(edges.x - tables.objects.x[row]) < tables.objects.width[row] / 2
            beneath &= np.abs(edges.y - (way.lens.cy + 40 / tables.objects.looming[row])) < 15
            edges.square[: edges.count][beneath[: edges.count]] = row
    assert 0 < bottom_y < way.lens.cy + way.lens.fy * 0.3 / 3.26 + 5


def test_who_slows_down_is_not_shown_by_edges_beside_him(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    """Most of his edges then contradict his motion, and all of them tell the new one, but none that he left behind."""
    walker = drive(box((-0.9, -0.3, 2.6), (0.35, 1.5, 0.15), landmarks=80), np.array([0.6, 0, 0]))
    way = replace(drive(clutter(600)) + walker, frames=30, speed_mps=0.0)
    velocity = np.concatenate([np.zeros((600, 3)), np.tile([0.1, 0, 0], (80, 1))])
    slower = replace(way, points_m=way.in_camera(29), velocity_mps=velocity, frames=12)
    shown: list[list[tuple[int, float]]] = [[], []]
    for leaves_some in (0, 1):
        tables = LineCircleFilter(Config(), way.lens)
        for corners, motion in way:
            tables.step(corners, motion)
        (row,) = published(tables.objects)
        for corners, motion in list(slower)[1:]:
            edges = tables.edges
            beside = np.abs(edges.x[: edges.count] - tables.objects.x[row]) / tables.objects.width[row]
            behind = np.flatnonzero((beside > 0.7) & (beside < 0.95))
            assert len(behind)
            edges.square[behind[: leaves_some * len(behind)]] = row
            tables.step(corners, motion)
            shown[leaves_some].append((int(tables.objects.support[row]), float(tables.objects.width[row])))
    assert max(support for support, _ in shown[1]) > 10
    assert shown[1] == shown[0]


@pytest.mark.parametrize(("range_m", "about_s"), [(1.3, 1.8), (3.5, 0.4)], ids=["near", "farther off"])
def test_who_is_lost_on_the_way_is_remembered_longer_where_he_is_near(
    drive: Drive, box: Landmarks, clutter: Landmarks, range_m: float, about_s: float
) -> None:
    walker = drive(box((-0.38 * range_m, -0.3, range_m), (0.4, 1.2, 0.1), landmarks=60), np.array([0.5, 0, 0.6]))
    way = replace(drive(clutter(150)) + walker, frames=60, speed_mps=0.6)
    mine, lost_s, last_s = looks_of(way, slice(150, None)), 24 / FPS, 0.0
    tables = LineCircleFilter(Config(), way.lens)
    for seq, (corners, motion) in enumerate(way):
        tables.step(corners if seq / FPS < lost_s else without(corners, mine), motion)
        if published(tables.objects):
            last_s = (seq + 1) / FPS
    assert last_s - lost_s == pytest.approx(about_s, abs=0.11)


@pytest.mark.parametrize(
    ("side_m", "right_mps", "stays"),
    [(1.2, 0.0, True), (1.2, 1.8, False), (0.3, 0.0, False)],
    ids=["in the way", "leaving it", "small"],
)
def test_what_is_lost_shortly_before_a_fast_vehicle_meets_it_is_there_until_then(
    drive: Drive, box: Landmarks, clutter: Landmarks, side_m: float, right_mps: float, stays: bool
) -> None:
    """It grows too fast for its corners to be tracked: from 7 m on, at 6 m/s, none is found.

    What is small in the image does not, and is lost for another reason.
    """
    ahead = drive(box((0.1, -0.4, 13.0), (side_m, side_m, 0.0), landmarks=60), np.array([right_mps, 0, 0]))
    way = replace(drive(clutter(150)) + ahead, frames=38, speed_mps=6.0)
    mine, lost = looks_of(way, slice(150, None)), 20
    tables, reported, shown = LineCircleFilter(Config(), way.lens), [], []
    for seq, (corners, motion) in enumerate(way):
        tables.step(corners if seq < lost else without(corners, mine), motion)
        reported.append(len(published(tables.objects)))
        shown.append(bool((tables.rebel.active & (tables.rebel.trust >= TR_S)).any()))
    assert reported[lost - 1] == 1
    assert shown[lost - 1]
    if stays:
        assert set(reported[lost:]) == {1}
        assert all(shown[lost:])
    else:
        assert set(reported[lost + round(0.6 * FPS) :]) == {0}
        assert not any(shown[lost + round(0.6 * FPS) :])


def test_what_does_not_loom_is_not_waited_for_though_its_contact_seems_near(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """As what was left of turmoil, whose motion is unknown: it would stay where it is, always about to be met."""
    ahead = drive(box((0.1, -0.4, 13.0), (1.2, 1.2, 0.0), landmarks=60))
    way = replace(drive(clutter(150)) + ahead, frames=36, speed_mps=6.0)
    mine, lost = looks_of(way, slice(150, None)), 20
    tables, reported = LineCircleFilter(Config(), way.lens), []
    for seq, (corners, motion) in enumerate(way):
        tables.step(corners if seq < lost else without(corners, mine), motion)
        if seq == lost:
            (row,) = published(tables.objects)
            tables.objects.looming[row] = 0.0
        reported.append(len(published(tables.objects)))
    assert reported[lost - 1] == 1
    assert set(reported[lost + round(0.6 * FPS) :]) == {0}


@pytest.mark.parametrize(("range_m", "speed_mps"), [(6.0, 2.0), (7.0, 2.5), (6.5, 2.2)])
def test_who_stops_before_he_is_in_the_way_is_not_waited_for(
    drive: Drive, box: Landmarks, clutter: Landmarks, range_m: float, speed_mps: float
) -> None:
    """His corners are not lost, as those of something that grows too fast would be: they tell that he stands."""
    walker = drive(box((-0.27 * range_m, -0.4, range_m), (0.4, 1.4, 0.2), landmarks=60), np.array([0.6, 0, 0]))
    way = replace(drive(clutter(150)) + walker, frames=26, speed_mps=speed_mps)
    stopped = replace(way, points_m=way.in_camera(25), velocity_mps=np.zeros((210, 3)), frames=20)
    tables = LineCircleFilter(Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, motion)
    (row,) = published(tables.objects)
    assert tables.objects.probability[row] > 0.5
    assert tables.objects.ttc[row] < 2.0
    for seq, (corners, motion) in enumerate(list(stopped)[1:]):
        tables.step(corners, motion)
        assert seq < 0.5 * FPS or not published(tables.objects)


def test_without_a_speed_who_is_lost_nearby_is_remembered_for_a_second(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """Nobody knows then whether the vehicle stands before him, or when it is there."""
    walker = drive(box((-0.38, -0.05, 1.0), (0.4, 0.6, 0.1), landmarks=60), np.array([0.5, 0, 0.6]))
    way = replace(drive(clutter(150)) + walker, frames=70, speed_mps=0.6)
    mine, seen_last, last = looks_of(way, slice(150, None)), 23, 0
    tables = LineCircleFilter(Config(), way.lens)
    for seq, (corners, motion) in enumerate(way):
        tables.step(corners if seq <= seen_last else without(corners, mine), replace(motion, speed_mps=math.nan))
        if published(tables.objects):
            last = seq
            assert tables.objects.range[published(tables.objects)][0] < 1.5
    assert seen_last < last <= seen_last + 1.2 * FPS


def test_the_few_corners_left_of_what_is_near_do_not_show_how_it_moves(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    """What is very near shows few corners; a hand that swings back would make its range grow while it comes closer."""
    walker = drive(box((0.2, -0.35, 1.7), (0.4, 1.2, 0.1), landmarks=56))
    hand = drive(box((0.2, -0.1, 1.7), (0.35, 0.2, 0.05), landmarks=4, seed=5), np.array([0.0, 0, 0.45]))
    way = replace(drive(clutter(150)) + walker, frames=34, speed_mps=0.5)
    way = replace(way + hand, from_s=20 / FPS)
    mine = looks_of(way, slice(150, 206))
    tables, ranges_m = LineCircleFilter(Config(), way.lens), []
    for seq, (corners, motion) in enumerate(way):
        tables.step(corners if seq < 20 else without(corners, mine), motion)
        ranges_m.append([float(tables.objects.range[row]) for row in published(tables.objects)])
    assert len(ranges_m[19]) == 1
    assert all(len(each) == 1 for each in ranges_m[20:])
    assert all(after[0] < before[0] for before, after in pairwise(ranges_m[20:]))
