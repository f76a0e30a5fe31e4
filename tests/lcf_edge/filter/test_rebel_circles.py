"""C_r: rebels that go together, why they rebel, when and where they will be met."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Camera, Config, Filter, Vehicle
from lcf_edge.filter import LineCircleFilter, rebel_circles, rebel_detection, rebel_groups
from lcf_edge.filter.baselines import Baselines
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.coarse_circles import CoarseGroups
from lcf_edge.filter.coarse_motion import CoarseMotion
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.patch_circles import PatchGroups
from lcf_edge.filter.patches import Patches
from lcf_edge.filter.rebel_detection import Verdicts
from lcf_edge.filter.rebel_groups import RebelGroups
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CircleTable, EdgeTable
from lcf_edge.filter.turmoil import Turmoil
from lcf_edge.lens import Lens
from lcf_edge.messages import Cause

PINHOLE = Pinhole(500.0, 500.0, 319.5, 239.5)
SETTINGS = Settings(Filter(), PINHOLE)
TR_CR, TR_S, TR_MAX = SETTINGS.tr_cr, SETTINGS.tr_s, SETTINGS.tr_max
NEWBORN = 0.5 * (TR_CR + TR_S)
HORIZON_S = 4.0
SEEN_S = 0.4

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]
Situation = Callable[..., Any]
Floats = npt.NDArray[np.float32]


def coarse() -> tuple[CoarseMotion, CoarseGroups]:
    """Nothing is seen in the downscaled image."""
    return CoarseMotion(Lens(640, 480, 500.0, 500.0, 319.5, 239.5), 640), CoarseGroups(0)


class Seen:
    """Rebel edges at ``x``, ``y`` (px) that moved so (px/s) for a while: first rows of a table, and verdicts."""

    def __init__(
        self, edges: EdgeTable, x: Floats, y: Floats, vx: Floats, vy: Floats, around: Any, seen_s: float = SEEN_S
    ) -> None:
        self.edges, self.count = edges, len(x)
        self.verdicts, self.baselines = Verdicts(self.count), Baselines()
        self.breaking = memoryview(np.arange(self.count, dtype=np.int32))
        rows = edges.append(self.count)
        edges.x[rows], edges.y[rows], edges.rebel[rows], edges.trust[rows] = x, y, True, TR_S
        for name, value in (
            ("focus_x", around.focus_x),
            ("focus_y", around.focus_y),
            ("depth_m", seen_s * around.speed_mps),
            ("elapsed_s", seen_s),
        ):
            np.asarray(getattr(self.baselines, name))[:] = value
        self.verdicts.count = self.count
        np.asarray(self.verdicts.row)[:] = np.arange(self.count)
        np.asarray(self.verdicts.x)[:], np.asarray(self.verdicts.y)[:] = x - seen_s * vx, y - seen_s * vy
        for row in range(self.count):
            rebel_detection.judge(self.verdicts, row, edges.columns, self.baselines, around)

    def taken(self) -> RebelGroups:
        """In groups, which are still to be made."""
        groups = RebelGroups(self.edges.capacity, 4)
        columns = self.edges.columns
        rebel_groups.take_rebels(groups, self.count, self.breaking, self.verdicts, columns, self.baselines)
        return groups

    def as_one_group(self, around: Any) -> RebelGroups:
        """In one group, with its statistics."""
        groups = self.taken()
        np.asarray(groups.label)[: self.count] = 0
        rebel_groups.number_groups(groups, 1)
        columns = self.edges.columns
        rebel_groups.average(groups, groups.members, self.verdicts, columns, self.baselines, around)
        return groups


class Scene:
    """Rebel edges that move as described, and the circles that they make."""

    def __init__(self, around: Any, **settings: Any) -> None:
        self.around = around
        self.edges = EdgeTable(50, 50, 10)
        self.circles = CircleTable(4)
        self.groups, self.settings, self.ids = RebelGroups(100, 4), Settings(Filter(**settings), PINHOLE), Ids()

    def update(self, *groups: tuple[float, float, float, float], number: int = 8, flowing: int = 0) -> "Scene":
        """One frame with groups of rebels (x, y, direction in rad, px/s), and normal edges among the first of them."""
        self.edges.remove(np.ones(self.edges.count, np.bool_))
        off = np.random.default_rng(0).uniform(-12, 12, (len(groups), number, 2))
        where = np.array([group[:2] for group in groups]).reshape(-1, 2)
        x, y = (where[:, None] + off).reshape(-1, 2).astype(np.float32).T
        how = np.array([group[2:] for group in groups], np.float32).reshape(-1, 2)
        beta, speed = np.repeat(how, number, axis=0).T
        seen = Seen(self.edges, x, y, speed * np.cos(beta), speed * np.sin(beta), self.around)
        crowd = self.edges.append(flowing)
        self.edges.x[crowd], self.edges.y[crowd] = np.resize(x[:number], flowing), np.resize(y[:number], flowing)
        self.edges.trust[crowd], self.edges.matched[crowd] = TR_MAX, True
        rebel_circles.update(
            self.groups,
            self.edges.columns,
            self.circles.columns,
            seen.verdicts,
            seen.breaking,
            seen.count,
            Patches(0),
            PatchGroups(0),
            Turmoil(640, 480),
            *coarse(),
            seen.baselines,
            self.around,
            self.settings,
            self.ids,
        )
        return self

    @property
    def trust(self) -> list[float]:
        return self.circles.trust[self.circles.active].tolist()


@pytest.fixture
def scene(situation: Situation) -> Scene:
    return Scene(situation())


def standing(around: Any, x: Floats, y: Floats, vx: Floats, vy: Floats) -> CircleTable:
    """Circles that edges make which are judged to stand in the way."""
    scene = Scene(around)
    seen = Seen(scene.edges, x, y, vx, vy, around)
    np.asarray(seen.verdicts.mover)[:], np.asarray(seen.verdicts.incoming)[:] = 0, 1
    return circles_of(scene, seen)


def circles_of(scene: Scene, seen: Seen) -> CircleTable:
    """Circles that these rebels alone make."""
    around, columns, circles = scene.around, scene.edges.columns, scene.circles.columns
    none = Patches(0), PatchGroups(0), Turmoil(640, 480), *coarse()
    rebel_circles.update(
        scene.groups, columns, circles, seen.verdicts, seen.breaking, seen.count, *none, seen.baselines, around,
        scene.settings, scene.ids,
    )  # fmt: skip
    return scene.circles


def thing(number: int) -> tuple[Floats, Floats]:
    """Where edges on something 60 px wide are, off to the left of O."""
    off = np.random.default_rng(1).uniform(-30, 30, (2, number))
    return (190 + off[0]).astype(np.float32), (180 + off[1]).astype(np.float32)


@pytest.mark.parametrize(("level", "makes"), [(False, 1), (True, 0)], ids=["upright", "on the ground"])
def test_paint_on_the_ground_does_not_stand_in_the_way(situation: Situation, level: bool, makes: int) -> None:
    """What is upright looms alike everywhere, the ground the more the farther it is below the horizon."""
    around = situation()
    random = np.random.default_rng(2)
    x, below = random.uniform(300, 340, 12).astype(np.float32), random.uniform(30, 130, 12).astype(np.float32)
    looming_hz = 0.6 * below / 80 if level else np.full(12, 0.6)
    vx, vy = looming_hz * (x - around.focus_x), looming_hz * below
    circles = standing(around, x, (around.horizon_y + below).astype(np.float32), vx, vy)
    assert int(circles.active.sum()) == makes


@pytest.mark.parametrize(("level", "flat"), [(False, False), (True, True)], ids=["upright", "on the ground"])
def test_what_crosses_on_a_collision_course_is_no_paint(situation: Situation, level: bool, flat: bool) -> None:
    """It flows apart about the place where it stays in the image, not about O, and falls short of the ground's flow."""
    around = situation(camera_height_m=0.3)
    random = np.random.default_rng(2)
    x, below = random.uniform(520, 560, 12).astype(np.float32), random.uniform(40, 140, 12).astype(np.float32)
    looming_hz = 0.6 * below / 80 if level else np.full(12, 0.6)
    vx, vy = looming_hz * (x - 540), looming_hz * below
    seen = Seen(EdgeTable(50, 50, 10), x, around.horizon_y + below, vx, vy, around)
    groups = seen.as_one_group(around)
    assert groups.inwards[0] == 12
    assert rebel_groups.is_flat(groups, 0, groups.members, around) == flat


@pytest.mark.parametrize(
    ("speed_mps", "down_pxps", "flat"),
    [(1.0, -60.0, True), (0.0, -60.0, False), (0.0, 10.0, True)],
    ids=["driving", "at rest", "at rest earlier than it knew"],
)
def test_before_a_vehicle_at_rest_nothing_is_flat_that_moves_towards_the_focus(
    situation: Situation, speed_mps: float, down_pxps: float, flat: bool
) -> None:
    """Paint and reflections on the floor do not."""
    around = situation(speed_mps=1.0)
    x, y = np.linspace(300, 340, 12).astype(np.float32), np.linspace(390, 400, 12).astype(np.float32)
    seen = Seen(EdgeTable(50, 50, 10), x, y, np.zeros(12), np.full(12, down_pxps), around)
    groups = seen.as_one_group(around)
    around.speed_mps = speed_mps
    assert groups.inwards[0] == 12
    assert rebel_groups.is_flat(groups, 0, groups.members, around) == flat


# Grouping

CROSSING = (300.0, 150.0, 0.0, 120.0)


def test_rebels_that_go_together_make_one_circle(scene: Scene) -> None:
    scene.update(CROSSING)
    assert scene.trust == [NEWBORN]
    (row,) = np.flatnonzero(scene.circles.active)
    assert scene.circles.support[row] == 8
    assert math.hypot(scene.circles.x[row] - 300, scene.circles.y[row] - 150) < 8
    assert scene.circles.beta[row] == pytest.approx(0.0, abs=1e-3)
    assert scene.circles.speed[row] == pytest.approx(120, rel=1e-3)
    assert scene.circles.radius[row] <= SETTINGS.bs_px


@pytest.mark.parametrize(
    "other",
    [
        (300.0, 150.0, math.pi, 120.0),
        (300.0, 150.0, 1.5, 120.0),
        (500.0, 150.0, 0.0, 120.0),
        (300.0, 150.0, 0.0, 420.0),
    ],
    ids=["the other way", "across", "elsewhere", "much faster"],
)
def test_rebels_that_do_not_go_together_make_two(scene: Scene, other: tuple[float, float, float, float]) -> None:
    assert scene.update(CROSSING, other).trust == [NEWBORN, NEWBORN]


@pytest.mark.parametrize(
    ("y", "other_pxps", "height_m", "groups"),
    [(430.0, 20.0, 0.5, 1), (430.0, 120.0, 0.5, 2), (330.0, 20.0, 0.5, 2), (430.0, 20.0, 0.0, 2)],
    ids=["near", "near, but not alike", "farther off", "height unknown"],
)
def test_groups_far_apart_in_the_image_are_one_where_what_is_seen_is_near(
    situation: Situation, y: float, other_pxps: float, height_m: float, groups: int
) -> None:
    around = situation(camera_height_m=height_m)  # at row 430 the ground is 1.3 m off: 0.3 m are 114 px
    scene = Scene(around).update((200.0, y - 110, math.pi, 20.0), (200.0, y, math.pi, other_pxps))
    assert scene.groups.groups == groups


@pytest.mark.parametrize(
    ("ranges_m", "makes"),
    [((1.5, 1.5, 1.5), 1), ((4.0, 4.0, 4.0), 0), ((1.5, 1.1, 0.8), 0)],
    ids=["near", "farther off", "at different ranges"],
)
def test_few_rebels_far_apart_on_something_plain_that_stands_near_are_one(
    situation: Situation, ranges_m: tuple[float, ...], makes: int
) -> None:
    around = situation()  # they are 80 px apart: 0.24 m at 1.5 m
    x, y = np.array([220.0, 300.0, 380.0], np.float32), np.array([150.0, 160.0, 150.0], np.float32)
    looming_hz = around.speed_mps / np.array(ranges_m)
    vx, vy = looming_hz * (x - around.focus_x), looming_hz * (y - around.focus_y)
    assert int(standing(around, x, y, vx, vy).active.sum()) == makes


@pytest.mark.parametrize(("range_m", "groups"), [(1.2, 1), (0.3, 2)], ids=["stand", "seem to"])
def test_two_who_seem_to_stand_right_before_a_vehicle_that_starts_stay_two(
    situation: Situation, range_m: float, groups: int
) -> None:
    """Who moved while it was at rest seems as near as anything at which its first motion explains his."""
    around = situation()
    apart_px = min(0.25 * 500 / range_m, 300.0)
    x, still = np.array([150.0, 150.0 + apart_px], np.float32), np.full(2, 150.0, np.float32)
    looming_hz = around.speed_mps / range_m
    vx, vy = looming_hz * (x - around.focus_x), looming_hz * (still - around.focus_y)
    seen = Seen(EdgeTable(50, 50, 10), x, still, vx, vy, around)
    np.asarray(seen.verdicts.mover)[:], np.asarray(seen.verdicts.incoming)[:] = 0, 1
    taken = seen.taken()
    rebel_groups.cluster(taken, seen.verdicts, seen.edges.columns, around, SETTINGS)
    assert len({lowest(taken, row) for row in range(2)}) == groups


@pytest.mark.parametrize("number", range(1, 6))
def test_too_few_rebels_make_no_circle(scene: Scene, number: int) -> None:
    assert bool(scene.update(CROSSING, number=number).trust) == (number >= SETTINGS.rebel_support)


def linked(x: Floats, y: Floats, vx: Floats, vy: Floats, around: Any) -> list[int]:
    """Group of each rebel."""
    seen = Seen(EdgeTable(50, 50, 10), x, y, vx, vy, around)
    groups = seen.taken()
    rebel_groups.cluster(groups, seen.verdicts, seen.edges.columns, around, SETTINGS)
    return [lowest(groups, row) for row in range(seen.count)]


def lowest(groups: RebelGroups, row: int) -> int:
    """The lowest rebel of a rebel's cluster."""
    while groups.label[row] != row:
        row = groups.label[row]
    return row


def test_parts_of_an_object_that_grows_are_linked_though_they_fly_apart(situation: Situation) -> None:
    x, y = (part.astype(np.float32) for part in np.random.default_rng(1).uniform(-30, 30, (2, 25)))
    assert len(set(linked(300 + x, 150 + y, 0.8 * x, 0.8 * y, situation()))) == 1


@pytest.mark.parametrize(
    ("way", "groups"),
    [((1.0, 0.0), 1), ((-1.0, 0.0), 2), ((0.0, 1.0), 2)],
    ids=["apart", "towards each other", "past each other"],
)
def test_two_of_which_one_comes_towards_the_other_are_two_though_something_could_grow_as_fast(
    situation: Situation, way: tuple[float, float], groups: int
) -> None:
    x, y = np.array([300.0, 336.0], np.float32), np.full(2, 150.0, np.float32)
    side = 22 * np.array([-1.0, 1.0], np.float32)
    assert len(set(linked(x, y, way[0] * side, way[1] * side, situation()))) == groups


def test_links_reach_through_neighbours_and_no_farther_than_they_do(situation: Situation) -> None:
    step = np.float32(0.9 * SETTINGS.rebel_link_px)
    x = step * np.arange(10, dtype=np.float32)
    x[5:] += step
    still = np.zeros(10, np.float32)
    label = linked(x, still + 150, still + 100, still, situation())
    assert len(set(label[:5])) == len(set(label[5:])) == 1
    assert label[0] != label[9]


@pytest.mark.parametrize(
    ("speed_pxps", "slower", "groups"),
    [(400, 1.0, 1), (400, 0.8, 1), (400, 0.6, 6), (60, 1.0, 6)],
    ids=["fast", "nearly alike", "not alike", "slow"],
)
def test_few_rebels_far_apart_on_something_that_passes_fast_go_together(
    situation: Situation, speed_pxps: float, slower: float, groups: int
) -> None:
    x = 90 * np.arange(6, dtype=np.float32)
    still = np.zeros(6, np.float32)
    vx = np.where(np.arange(6) % 2, slower, 1.0).astype(np.float32) * speed_pxps
    assert len(set(linked(x, still + 150, vx, still, situation()))) == groups


@pytest.mark.parametrize(
    ("top_px", "flowing", "other_pxps", "makes"),
    [(150.0, 0, 100.0, 1), (260.0, 0, 100.0, 0), (150.0, 9, 100.0, 0), (150.0, 0, 0.0, 1), (150.0, 0, -100.0, 2)],
    ids=["a body", "on the ground", "edges that flow between", "half of them", "two bodies"],
)
def test_few_rebels_far_apart_go_together_where_what_is_upright_hides_all_that_flows(
    situation: Situation, top_px: float, flowing: int, other_pxps: float, makes: int
) -> None:
    """Something large and plain that moves slowly in the image: its corners are 60 px apart, with nothing between."""
    around = situation()
    columns, rows = np.meshgrid([200.0, 260.0, 320.0], [0.0, 60.0])
    x, y = columns.ravel().astype(np.float32), (top_px + rows.ravel()).astype(np.float32)
    vx = np.where(np.arange(6) % 2, other_pxps, 100.0).astype(np.float32)
    scene = Scene(around)
    seen = Seen(scene.edges, x, y, vx, np.zeros(6, np.float32), around)
    between = scene.edges.append(flowing)
    across, down = np.meshgrid([230.0, 260.0, 290.0], [10.0, 30.0, 50.0])
    scene.edges.x[between], scene.edges.y[between] = across.ravel()[:flowing], top_px + down.ravel()[:flowing]
    scene.edges.trust[between], scene.edges.matched[between] = TR_MAX, True
    assert int(circles_of(scene, seen).active.sum()) == makes


def test_a_few_rebels_in_a_crowd_that_flows_make_and_keep_no_circle(situation: Situation) -> None:
    few = SETTINGS.rebel_support
    assert not Scene(situation()).update(CROSSING, number=few, flowing=40).trust
    scene = Scene(situation())
    for _ in range(4):
        scene.update(CROSSING, number=few)
    (trust,) = scene.trust
    assert scene.update(CROSSING, number=few, flowing=40).trust == [trust - 1]


def test_what_moves_has_a_quarter_of_the_edges_where_it_is(situation: Situation) -> None:
    assert Scene(situation()).update(CROSSING, number=5, flowing=10).trust
    assert not Scene(situation()).update(CROSSING, number=5, flowing=25).trust


# Trust


def test_an_aligned_circle_gains_one_a_frame_up_to_the_most(scene: Scene) -> None:
    seen = [scene.update(CROSSING).trust[0] for _ in range(6)]
    assert seen == [min(NEWBORN + frame, TR_MAX) for frame in range(6)]


def test_a_circle_of_few_rebels_is_reported_a_frame_later_than_one_of_many(situation: Situation) -> None:
    def reported_after(number: int) -> int:
        scene = Scene(situation())
        return next(frame for frame in range(10) if scene.update(CROSSING, number=number).trust[0] >= TR_S)

    assert [reported_after(number) for number in (3, 4, 5, 8)] == [2, 2, 1, 1]


def test_a_deviated_circle_takes_the_new_direction_and_loses_one(scene: Scene) -> None:
    for _ in range(3):
        scene.update(CROSSING)
    before = scene.trust[0]
    assert scene.update((*CROSSING[:2], 0.8, 120.0)).trust == [before - 1]
    (row,) = np.flatnonzero(scene.circles.active)
    assert scene.circles.beta[row] == pytest.approx(0.8, abs=1e-3)


def test_a_circle_without_rebels_loses_one_a_frame_until_it_goes(situation: Situation) -> None:
    scene = Scene(situation(horizon_s=1.0))
    for _ in range(4):
        scene.update(CROSSING)
    trust = scene.trust[0]
    while trust - 1 >= TR_CR:
        trust -= 1
        assert scene.update().trust == [trust]
    assert scene.update().trust == []


@pytest.mark.parametrize("fps", [5.0, 20.0, 60.0])
def test_a_contact_that_does_not_come_is_not_always_about_to_come(situation: Situation, fps: float) -> None:
    """A circle that was taken for near, and whose edges do not loom."""
    scene = Scene(situation(dt_s=1 / fps)).update(CROSSING)
    (row,) = np.flatnonzero(scene.circles.active)
    scene.circles.ttc[row] = 3 / fps
    for _ in range(12):
        rebel_circles.predict(scene.circles.columns, scene.around)
        scene.circles.trust[row], scene.circles.x[row] = TR_MAX, CROSSING[0]
        scene.update(CROSSING)
    assert scene.circles.ttc[row] > 15 / fps


def test_what_is_about_to_be_met_coasts_when_it_is_large(situation: Situation) -> None:
    for extent_px, keeps in ((80.0, True), (20.0, False)):
        scene = Scene(situation())
        scene.update((200, 200, 0.0, 60.0)).update((203, 200, 0.0, 60.0)).update((206, 200, 0.0, 60.0))
        scene.circles.ttc[:], scene.circles.width[:], scene.circles.height[:] = 0.2 * HORIZON_S, extent_px, extent_px
        before = scene.trust
        assert (scene.update().trust == before) == keeps


@pytest.mark.parametrize(("yaw_rate_radps", "keeps"), [(0.25, True), (-0.25, True), (0.4, False), (-0.4, False)])
def test_what_is_lost_in_a_turn_does_not_coast(yaw_rate_radps: float, keeps: bool, situation: Situation) -> None:
    """A quarter of a radian before contact is a turn."""
    scene = Scene(situation(yaw_rate_radps=yaw_rate_radps))
    scene.update((200, 200, 0.0, 60.0)).update((203, 200, 0.0, 60.0)).update((206, 200, 0.0, 60.0))
    scene.circles.ttc[:], scene.circles.width[:], scene.circles.height[:] = 0.2 * HORIZON_S, 80.0, 80.0
    before = scene.trust
    assert (scene.update().trust == before) == keeps


def test_what_was_seen_twice_alone_does_not_coast(situation: Situation) -> None:
    scene = Scene(situation())
    scene.update((200, 200, 0.0, 60.0)).update((203, 200, 0.0, 60.0))
    scene.circles.ttc[:], scene.circles.width[:], scene.circles.height[:] = 0.2 * HORIZON_S, 80.0, 80.0
    (before,) = scene.trust
    assert scene.update().trust == [before - 1]


def test_what_is_about_to_be_met_ends_when_its_extent_has_left_the_image(situation: Situation, lens: Lens) -> None:
    scene = Scene(situation())
    scene.update((200, 200, 0.0, 60.0)).update((203, 200, 0.0, 60.0)).update((206, 200, 0.0, 60.0))
    circles = scene.circles
    row = int(np.flatnonzero(circles.active)[0])

    def stays(x: float, ttc_s: float) -> bool:
        circles.active[row], circles.ttc[row], circles.width[row], circles.height[row] = True, ttc_s, 100.0, 60.0
        circles.x[row], circles.y[row] = x, 240.0
        rebel_circles.end_outside(circles.columns, ImagePlane(lens), scene.around, SETTINGS)
        return bool(circles.active[row])

    assert stays(680.0, 0.2 * HORIZON_S)
    assert not stays(695.0, 0.2 * HORIZON_S)
    assert not stays(680.0, HORIZON_S)
    assert stays(630.0, HORIZON_S)


def test_what_is_about_to_be_met_and_hides_all_that_flows_stays_until_contact(situation: Situation, lens: Lens) -> None:
    scene = Scene(situation())
    scene.update((200, 200, 0.0, 60.0)).update((203, 200, 0.0, 60.0)).update((206, 200, 0.0, 60.0))
    circles = scene.circles
    circles.ttc[:], circles.width[:], circles.height[:] = 0.2 * HORIZON_S, 80.0, 80.0
    scene.around.flow_is_seen = False
    (before,) = scene.trust
    circles.unseen_s[:] = HORIZON_S  # longer than anything coasts
    assert scene.update().trust == [before]
    circles.x[:] = 900.0  # it ran out of the image, as what crosses does
    rebel_circles.end_outside(circles.columns, ImagePlane(lens), scene.around, SETTINGS)
    assert scene.trust == [before]
    scene.around.flow_is_seen = True
    rebel_circles.end_outside(circles.columns, ImagePlane(lens), scene.around, SETTINGS)
    assert scene.trust == []


def test_circles_stay_while_something_covers_the_image_for_up_to_a_second(situation: Situation) -> None:
    scene = Scene(situation())
    scene.update((200, 200, 0.0, 60.0)).update((203, 200, 0.0, 60.0)).update((206, 200, 0.0, 60.0))
    circles, around = scene.circles, scene.around
    (row,) = np.flatnonzero(circles.active)
    circles.speed[row] = 500.0
    around.is_blind = True
    before = circles.x[row], circles.ttc[row]
    for _ in range(round(0.9 / around.dt_s)):
        rebel_circles.predict(circles.columns, around)
        assert scene.update().trust == [TR_S]
        assert (circles.x[row], circles.ttc[row]) == before
    circles.unseen_s[row] = 1.0
    assert scene.update().trust == [TR_S - 1]


def test_a_circle_that_is_not_seen_again_with_the_image_is_reported_no_more(situation: Situation) -> None:
    scene = Scene(situation())
    scene.update((200, 200, 0.0, 60.0)).update((203, 200, 0.0, 60.0)).update((206, 200, 0.0, 60.0))
    scene.around.is_blind = True
    assert scene.update().trust == [TR_S]
    scene.around.is_blind = False
    assert scene.update().trust == [TR_S - 1]


def test_what_is_unseen_ends_at_its_contact_whatever_it_hides(situation: Situation) -> None:
    scene = Scene(situation())
    scene.update((200, 200, 0.0, 60.0)).update((203, 200, 0.0, 60.0)).update((206, 200, 0.0, 60.0))
    scene.circles.ttc[:], scene.circles.width[:], scene.circles.height[:] = -0.01, 80.0, 80.0
    scene.around.flow_is_seen = False
    assert scene.update().trust == []


def test_what_a_nearer_circle_hides_waits_behind_it(situation: Situation) -> None:
    scene = Scene(situation())
    two = ((300, 130, 0.0, 60.0), (300, 250, math.pi, 60.0))  # neither flat on the ground
    scene.update(*two).update(*two)
    hidden, nearer = np.flatnonzero(scene.circles.active)[np.argsort(scene.circles.y[scene.circles.active])]
    scene.circles.ttc[hidden], scene.circles.ttc[nearer] = 0.9 * HORIZON_S, 0.5 * HORIZON_S
    scene.circles.trust[hidden] = trust = TR_MAX
    scene.circles.trust[nearer] = TR_MAX
    scene.update()
    assert scene.circles.trust[hidden] == trust - 1
    scene.circles.y[nearer] = 140.0  # before it
    scene.update()
    assert scene.circles.trust[hidden] == trust - 1


def test_the_extent_grows_at_once_and_shrinks_slowly(scene: Scene) -> None:
    scene.update((200, 200, 0.0, 60.0))
    scene.circles.width[:] = 100.0
    scene.update((203, 200, 0.0, 60.0))
    shrunk = scene.circles.width[0]
    assert 40 < shrunk < 100
    scene.circles.width[:] = 1.0
    scene.update((206, 200, 0.0, 60.0))
    assert 20 < scene.circles.width[0] < shrunk


def test_a_circle_keeps_its_identity_and_another_has_another(scene: Scene) -> None:
    away = (500.0, 150.0, 0.0, 120.0)
    scene.update(CROSSING)
    (first,) = scene.circles.id[scene.circles.active]
    scene.update(CROSSING, away)
    ids = scene.circles.id[scene.circles.active].tolist()
    assert first in ids
    assert 0 not in ids
    assert len(set(ids)) == 2


# Prediction


def test_without_a_time_to_contact_the_centre_goes_on_as_it_went(situation: Situation) -> None:
    circles = CircleTable(1)
    circles.active[0], circles.x[0], circles.y[0], circles.radius[0] = True, 100, 50, 20
    circles.speed[0], circles.beta[0], circles.ttc[0] = 60, math.pi / 2, math.inf
    rebel_circles.predict(circles.columns, situation(dt_s=0.5))
    assert (circles.x[0], circles.y[0], circles.radius[0]) == pytest.approx((100, 80, 20), abs=1e-3)


@pytest.mark.parametrize(("dt_s", "steps"), [(0.05, 10), (0.01, 50)])
def test_what_looms_grows_as_its_range_shrinks(dt_s: float, steps: int, situation: Situation) -> None:
    """A disc of 0.5 m that comes at constant velocity from 4 m away, 2 s before contact, 0.4 m to the right."""
    circles = CircleTable(1)
    circles.active[0], circles.radius[0], circles.ttc[0] = True, 500 * 0.25 / 4, 2.0
    circles.x[0], circles.y[0] = 320 + 500 * 0.4 / 4, 240
    circles.speed[0], circles.beta[0] = 500 * 0.4 / 4 / 2.0, 0.0  # x/τ
    for _ in range(steps):
        rebel_circles.predict(circles.columns, situation(dt_s=dt_s))
    left_m = 4 * (1 - 0.5 / 2.0)
    assert circles.ttc[0] == pytest.approx(1.5, rel=1e-3)
    assert circles.radius[0] == pytest.approx(500 * 0.25 / left_m, rel=1e-3)
    assert circles.x[0] == pytest.approx(320 + 500 * 0.4 / left_m, abs=1.0)


# Cause, time to contact, lateral miss: whole steps


def settled(drive: Any, config: Config | None = None) -> tuple[LineCircleFilter, list[int], int]:
    """The filter, the rows of its published rebel circles, and the number of the last frame."""
    tables = LineCircleFilter(config or Config(), drive.lens)
    for corners, motion in drive:
        tables.step(corners, motion)
    rebel = tables.rebel
    return tables, np.flatnonzero(rebel.active & (rebel.trust >= TR_S)).tolist(), drive.frames - 1


def beside_the_path(landmarks: int = 250) -> npt.NDArray[np.float64]:
    """(n, 3) landmarks on the ground left and right."""
    random = np.random.default_rng(3)
    side = random.choice([-1.0, 1.0], landmarks)
    x, z = side * random.uniform(0.4, 3.0, landmarks), random.uniform(1.0, 12.0, landmarks)
    return np.stack([x, np.full(landmarks, 0.3), z], axis=1)


def test_a_wall_ahead_is_incoming_with_its_time_to_contact(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    for wall_m in (6.0, 7.0, 8.0):
        way = drive(clutter(150)) + drive(box((0.0, -0.4, wall_m), (0.5, 0.9, 0.0), landmarks=40))
        tables, rows, last = settled(replace(way, frames=26))
        assert rows
        left_m = wall_m - 2.0 * last / 20
        for row in rows:
            assert tables.rebel.cause[row] == Cause.INCOMING
            assert tables.rebel.ttc[row] == pytest.approx(left_m / 2.0, rel=0.05)
            assert tables.rebel.range[row] == pytest.approx(left_m, rel=0.05)
            assert abs(tables.rebel.lateral[row]) < 0.15


@pytest.mark.parametrize("closing_mps", [0.6, 1.5])
def test_what_comes_towards_us_has_the_time_of_its_closing_speed(
    drive: Drive, box: Landmarks, closing_mps: float
) -> None:
    way = drive(box((0.0, -0.4, 7.0), (0.6, 1.0, 0.0), landmarks=40), np.array([0, 0, -closing_mps]), frames=26)
    tables, rows, last = settled(way)
    assert rows
    left_s = 7.0 / (2.0 + closing_mps) - last / 20
    for row in rows:
        assert tables.rebel.cause[row] == Cause.INCOMING
        assert tables.rebel.ttc[row] == pytest.approx(left_s, rel=0.05)


@pytest.mark.parametrize("side", [-1, 1])
def test_what_crosses_is_crossing_to_the_side_it_goes_to(
    drive: Drive, box: Landmarks, clutter: Landmarks, side: int
) -> None:
    """Most of a walker is above the camera; what stands beside him separates the camera's motion from his."""
    way = drive(clutter(150)) + drive(
        box((-0.8 * side, -1.2, 6.0), (0.5, 0.6, 0.2), landmarks=40), np.array([1.2 * side, 0, 0])
    )
    tables, rows, _ = settled(replace(way, frames=20), Config(vehicle=Vehicle(horizon_s=1.5)))
    assert rows
    for row in rows:
        assert tables.rebel.cause[row] == Cause.CROSSING
        assert np.sign(math.cos(tables.rebel.beta[row])) == side


@pytest.mark.parametrize("velocity_mps", [(0.6, 0.0, -0.6), (0.6, 0.0, 0.0)], ids=["comes nearer", "crosses"])
def test_a_vehicle_that_stands_sees_who_walks_ever_faster_in_the_image(
    drive: Drive, box: Landmarks, clutter: Landmarks, velocity_mps: tuple[float, float, float]
) -> None:
    """The paper's bounds of speeds are multiples of the vehicle's, which is 0."""
    walker = drive(box((-1.2, -0.55, 5.0), (0.4, 1.7, 0.2), landmarks=60), np.array(velocity_mps))
    way = replace(drive(clutter(150)) + walker, frames=40, speed_mps=0.0)
    tables, seen = LineCircleFilter(Config(), way.lens), []
    for corners, motion in way:
        tables.step(corners, motion)
        seen.append(bool((tables.rebel.active & (tables.rebel.trust >= TR_S)).any()))
    assert all(seen[12:])


def test_what_drives_ahead_of_us_is_leading(drive: Drive, box: Landmarks, clutter: Landmarks) -> None:
    """On a ground that is seen to flow: else only what keeps station would show whether the vehicle stands."""
    leader = drive(box((0.0, 0.1, 2.5), (0.6, 0.35, 0.0), landmarks=40), np.array([0, 0, 2.0]))
    tables, rows, _ = settled(replace(drive(beside_the_path()) + drive(clutter(150)) + leader, frames=18))
    assert rows
    assert {int(cause) for cause in tables.rebel.cause[rows]} == {Cause.LEADING}


@pytest.mark.parametrize("yaw_rate_radps", [0.35, -0.35])
def test_on_an_arc_the_miss_is_that_of_the_arc(
    drive: Drive, box: Landmarks, clutter: Landmarks, yaw_rate_radps: float
) -> None:
    """A wall where the turn leads, 1.9 s of it ahead at the end."""
    frames, arc_m = 24, 2.0 / yaw_rate_radps
    turn = yaw_rate_radps * ((frames - 1) / 20 + 1.9)
    middle = (-arc_m * (1 - math.cos(turn)), -0.4, arc_m * math.sin(turn))
    wall = drive(box(middle, (0.3, 0.9, 0.3), landmarks=50), frames=frames, yaw_rate_radps=yaw_rate_radps)
    tables, rows, last = settled(wall + drive(clutter(150)))
    assert rows
    at = wall.in_camera(last).mean(axis=0)
    for row in rows:
        assert tables.rebel.cause[row] == Cause.INCOMING
        assert abs(tables.rebel.lateral[row]) < 0.15
        assert tables.rebel.range[row] == pytest.approx(at[2], rel=0.05)
        assert abs(at[0]) > 0.5  # it does not lie straight ahead


def test_what_lies_straight_ahead_of_a_turn_is_no_rebel(drive: Drive, box: Landmarks) -> None:
    way = drive(box((0.0, -0.4, 7.5), (0.4, 0.9, 0.0), landmarks=40), yaw_rate_radps=0.6)
    _, rows, _ = settled(replace(way, frames=20))
    assert not rows


def test_with_the_speed_unknown_what_comes_on_the_ground_still_has_a_miss(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    comes = drive(box((-1.6, 0.4, 9.0), (0.3, 0.6, 0.0), landmarks=40), np.array([0.5, 0, -1.5]))
    way = drive(clutter(150)) + comes
    tables = LineCircleFilter(Config(camera=Camera(height_m=1.0)), way.lens)
    for corners, motion in way:
        tables.step(corners, replace(motion, speed_mps=math.nan))
    (row,) = np.flatnonzero(tables.rebel.active & (tables.rebel.trust >= TR_S)).tolist()
    assert tables.rebel.lateral[row] == pytest.approx(-1.6 + 0.5 * 9.0 / 3.5, abs=0.1)


def test_with_speed_and_height_unknown_nothing_is_said_in_metres(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    way = drive(clutter(150)) + drive(box((-2, -0.6, 5), (0.5, 1.2, 0.3)), np.array([1.2, 0, 0]))
    tables = LineCircleFilter(Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, replace(motion, speed_mps=math.nan))
    assert tables.rebel.active.any()
    assert np.isnan(tables.rebel.range[tables.rebel.active]).all()
    assert np.isnan(tables.rebel.lateral[tables.rebel.active]).all()


def test_what_is_to_stand_near_must_spread(situation: Situation) -> None:
    """An error of rotation shifts all edges alike."""
    around = situation()
    x, y = thing(8)
    rate = 0.5
    spreads = standing(around, x, y, rate * (x - around.focus_x), rate * (y - around.focus_y))
    assert spreads.count == 1
    shift = np.full_like(x, rate)
    shifted = standing(around, x, y, shift * (x.mean() - around.focus_x), shift * (y.mean() - around.focus_y))
    assert shifted.count == 0


def test_one_edge_that_took_the_place_of_another_shows_no_range(situation: Situation) -> None:
    around = situation()
    x, y = thing(8)
    rate = np.full_like(x, 0.3)
    alone = standing(around, x, y, rate * (x - around.focus_x), rate * (y - around.focus_y))
    rate[np.argmin(x)] = 1.5
    stray = standing(around, x, y, rate * (x - around.focus_x), rate * (y - around.focus_y))
    assert stray.range[0] == pytest.approx(alone.range[0], rel=0.05)


@pytest.mark.parametrize("aside_pxps", [-200.0, 0.0, 200.0])
def test_the_expansion_of_what_moves_is_that_of_its_height_about_the_horizon(
    aside_pxps: float, situation: Situation
) -> None:
    """Motion to the side does not touch it."""
    below = np.linspace(-80, 80, 9)
    for rate in (0.5, 0.0):
        assert own_expansion(situation(horizon_y=240.0), below, rate * below, aside_pxps) == pytest.approx(rate)


def test_what_moves_away_from_a_wrong_horizon_without_growing_does_not_come(situation: Situation) -> None:
    """A car that drives off: the lens, or the camera's pitch, puts the horizon 80 px below it."""
    below = np.linspace(-100, -60, 9)
    assert own_expansion(situation(horizon_y=240.0), below, 0.5 * below) == pytest.approx(0.5)
    assert own_expansion(situation(horizon_y=240.0), below, np.full(9, 0.5 * -80)) == 0


def own_expansion(around: Any, below: Floats, vy: Floats, vx: float = 0.0) -> float:
    """V_e/r of a column of rebels ``below`` px under the horizon that moved so, px/s, for half a second."""
    aside = np.full(len(below), vx)
    x, y = 400 + 0.5 * aside, around.horizon_y + below + 0.5 * vy
    seen = Seen(EdgeTable(50, 50, 10), x, y, aside, vy, around, seen_s=0.5)
    return rebel_groups.own_expansion(seen.as_one_group(around), 0)
