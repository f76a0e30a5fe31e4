"""C_n: which edges go together, how trust rises and falls, which circles pass by."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Filter
from lcf_edge.filter import normal_circles
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.normal_circles import Flowing
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CircleTable, EdgeTable
from lcf_edge.lens import Lens

FOCUS = (319.5, 239.5)
SETTINGS = Filter()
# Newborn circles are gathered in squares of BS_λ about O: places in the middle of one.
LOWER_RIGHT, UPPER_LEFT, UPPER_RIGHT, RIGHT, FAR = (
    tuple(np.array(FOCUS) + SETTINGS.bs_px * np.array(cell))
    for cell in ((2.5, 0.5), (-2.5, -0.5), (2.5, -1.5), (1.5, 0.5), (3.5, 1.5))
)
TR_CR, TR_S, TR_MAX = SETTINGS.tr_cr, SETTINGS.tr_s, SETTINGS.tr_max
NEWBORN = 0.5 * (TR_CR + TR_S)

Places = npt.NDArray[np.float32]
Situation = Callable[..., Any]


def cluster(x: float, y: float, number: int = 12, size_px: float = 24.0, seed: int = 0) -> Places:
    """(n, 2) places around one."""
    return (np.random.default_rng(seed).uniform(-0.5, 0.5, (number, 2)) * size_px + (x, y)).astype(np.float32)


class Scene:
    """Trusted normal edges and the circles that they make."""

    def __init__(self, around: Any, capacity: int = 16, **settings: Any) -> None:
        self.around = around
        around.dt_s = 1.0
        self.edges = EdgeTable(200, 10, 10)
        self.circles = CircleTable(capacity)
        self.flowing, self.ids = Flowing(210, capacity), Ids()
        self.settings = Settings(Filter(**settings), around.pinhole)

    def add(self, places: Places, expansion: float = 0.5) -> slice:
        """Edges that flow out at so much of their distance a second."""
        rows = self.edges.append(len(places))
        self.edges.trust[rows] = TR_S
        self.place(rows, places)
        r = np.hypot(places[:, 0] - FOCUS[0], places[:, 1] - FOCUS[1])
        self.edges.speed[rows] = expansion * r
        return rows

    def place(self, rows: slice, places: Places) -> None:
        self.edges.x[rows], self.edges.y[rows] = places.T

    def remove(self, rows: slice) -> None:
        dead = np.zeros(self.edges.count, np.bool_)
        dead[rows] = True
        self.edges.remove(dead)

    def update(self, times: int = 1) -> "Scene":
        nobody = np.zeros(self.circles.capacity, np.uint8)
        for _ in range(times):
            normal_circles.update(
                self.flowing,
                self.edges.columns,
                self.circles.columns,
                memoryview(nobody),
                self.around,
                self.settings,
                self.ids,
            )
        return self

    def of(self, rows: slice) -> set[int]:
        """Circles of the edges; -1: none."""
        return set(self.edges.circle[rows].tolist())

    @property
    def trust(self) -> list[float]:
        return self.circles.trust[self.circles.active].tolist()


@pytest.fixture
def scene(situation: Situation) -> Scene:
    return Scene(situation())


# Groups by direction, speed and place


def test_edges_that_go_together_make_a_circle_around_them(scene: Scene) -> None:
    places = cluster(*LOWER_RIGHT)
    rows = scene.add(places)
    (row,) = scene.update().of(rows)
    assert scene.circles.active[row]
    assert scene.circles.support[row] == len(places)
    assert (scene.circles.x[row], scene.circles.y[row]) == pytest.approx(places.mean(axis=0).tolist(), abs=1e-3)
    away = np.hypot(*(places - places.mean(axis=0)).T)
    assert np.mean(away < scene.circles.radius[row]) > 0.8
    assert scene.circles.beta[row] == pytest.approx(math.atan2(*(places.mean(axis=0) - FOCUS)[::-1]), abs=1e-3)
    assert scene.circles.expansion[row] == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ((LOWER_RIGHT, 0.5), (UPPER_LEFT, 0.5)),
        ((LOWER_RIGHT, 0.5), (UPPER_RIGHT, 0.5)),
        ((RIGHT, 0.5), (FAR, 0.5)),
        ((LOWER_RIGHT, 0.25), (LOWER_RIGHT, 1.0)),
    ],
    ids=["opposite ways", "other direction", "same direction, far away", "other depth at the same place"],
)
def test_what_does_not_go_together_makes_circles_of_its_own(scene: Scene, one: Any, other: Any) -> None:
    first, second = (scene.add(cluster(*where), expansion) for where, expansion in (one, other))
    scene.update(3)
    assert len(scene.of(first)) == len(scene.of(second)) == 1
    assert scene.of(first) != scene.of(second)
    assert -1 not in scene.of(first) | scene.of(second)


def test_circles_are_compact_however_wide_the_crowd(situation: Situation) -> None:
    scene = Scene(situation(), capacity=64)
    places = np.random.default_rng(1).uniform([10, 10], [630, 470], (200, 2)).astype(np.float32)
    scene.add(places)
    for _ in range(6):
        scene.update()
        active = scene.circles.active
        assert active.any()
        assert scene.circles.radius[active].max() <= SETTINGS.bs_px
        row = scene.edges.circle[: scene.edges.count]
        member = row >= 0
        off = np.hypot(places[:, 0] - scene.circles.x[row], places[:, 1] - scene.circles.y[row])
        assert off[member].max() < 2 * SETTINGS.bs_px


@pytest.mark.parametrize("number", range(1, 8))
def test_too_few_edges_make_no_circle(scene: Scene, number: int) -> None:
    scene.add(cluster(*LOWER_RIGHT, number))
    assert scene.update().circles.count == (number >= SETTINGS.circle_support)


def test_only_trusted_normal_edges_that_are_seen_count(scene: Scene) -> None:
    doubtful, rebels, chains, held = (scene.add(cluster(*at)) for at in (LOWER_RIGHT, UPPER_LEFT, UPPER_RIGHT, FAR))
    scene.edges.trust[doubtful] = TR_S - 0.5
    scene.edges.rebel[rebels] = True
    scene.edges.suspect_keys[chains] = 1
    scene.edges.held[held] = True
    assert scene.update().circles.count == 0


# Trust


def test_a_newborn_stands_between_the_critical_and_the_standard_trust(scene: Scene) -> None:
    scene.add(cluster(*LOWER_RIGHT))
    assert scene.update().trust == [NEWBORN]


def test_an_aligned_circle_gains_one_a_frame_up_to_the_most(scene: Scene) -> None:
    scene.add(cluster(*LOWER_RIGHT))
    seen = [scene.update().trust[0] for _ in range(6)]
    assert seen == [min(NEWBORN + frame, TR_MAX) for frame in range(6)]


def test_a_deviated_circle_is_updated_and_loses_one(scene: Scene) -> None:
    """Its edges still lie in it, but go out in another direction than it."""
    places = cluster(*RIGHT, size_px=20)
    rows = scene.add(places)
    trust = scene.update(3).trust[0]
    before = scene.circles.y[scene.circles.active][0]
    turn = 1.6 * SETTINGS.eps_beta_rad / 5
    turned = places + np.float32([0, math.hypot(*(np.array(RIGHT) - FOCUS)) * math.tan(turn)])
    scene.place(rows, turned)
    assert scene.update().trust == [trust - 1]
    assert scene.circles.y[scene.circles.active][0] > before


def test_a_circle_without_its_edges_loses_one_a_frame_until_it_goes(scene: Scene) -> None:
    rows = scene.add(cluster(*LOWER_RIGHT))
    trust = scene.update(4).trust[0]
    scene.remove(rows)
    while trust - 1 >= TR_CR:
        trust -= 1
        assert scene.update().trust == [trust]
    assert scene.update().trust == []


def test_nobody_belongs_to_a_circle_that_is_gone(scene: Scene) -> None:
    rows = scene.add(cluster(*LOWER_RIGHT))
    scene.update(2)
    scene.edges.trust[rows] = TR_CR  # they no longer count, but are still there
    scene.update(3)
    assert scene.circles.count == 0
    assert scene.of(rows) == {-1}


def test_a_circle_that_lost_most_of_its_edges_is_unmatched(scene: Scene) -> None:
    rows = scene.add(cluster(*LOWER_RIGHT, number=20))
    trust = scene.update(3).trust[0]
    gone = slice(rows.start, rows.start + 14)
    scene.place(gone, cluster(*UPPER_LEFT, number=14))
    scene.update()
    assert sorted(scene.trust) == sorted([trust - 1, NEWBORN])


def test_in_a_full_table_a_newborn_replaces_only_what_is_trusted_less(situation: Situation) -> None:
    scene = Scene(situation(), capacity=1)
    first = scene.add(cluster(*LOWER_RIGHT))
    scene.update(2)
    second = scene.add(cluster(*UPPER_LEFT, number=20))
    assert scene.update().circles.columns.evicted == 1
    assert scene.of(first) == {0}
    assert scene.of(second) == {-1}


def test_identities_are_new_and_kept(scene: Scene) -> None:
    rows = scene.add(cluster(*LOWER_RIGHT))
    scene.update()
    (first,) = scene.circles.id[scene.circles.active]
    scene.update(3)
    assert scene.circles.id[scene.circles.active].tolist() == [first]
    scene.remove(rows)
    scene.update(6)
    scene.add(cluster(*LOWER_RIGHT))
    scene.update()
    (second,) = scene.circles.id[scene.circles.active]
    assert 0 != first != second != 0


# Prediction, and what passes by


def test_the_prediction_goes_out_from_the_focus_and_grows(situation: Situation, lens: Lens) -> None:
    circles = CircleTable(2)
    circles.active[0] = True
    circles.x[0], circles.y[0] = FOCUS[0] + 100, FOCUS[1] - 50
    circles.radius[0], circles.expansion[0] = 20, 0.5
    normal_circles.predict(circles.columns, ImagePlane(lens), situation(dt_s=0.1))
    assert (circles.x[0], circles.y[0]) == pytest.approx((FOCUS[0] + 105, FOCUS[1] - 52.5))
    assert circles.radius[0] == pytest.approx(21)


@pytest.mark.parametrize(
    ("right_m", "yaw_rate_radps", "passes"),
    [(2.0, 0.0, True), (-2.0, 0.0, True), (0.2, 0.0, False), (-2.0, 0.5, False), (2.0, 0.5, True), (0.0, 0.5, False)],
    ids=["right", "left", "ahead", "where a left turn leads", "right of a left turn", "ahead in a turn, which may end"],
)
def test_only_what_lies_beside_the_path_passes_by(
    right_m: float, yaw_rate_radps: float, passes: bool, situation: Situation
) -> None:
    around = situation(yaw_rate_radps=yaw_rate_radps, half_width_m=0.3)
    ahead_m = 4.0
    circles = CircleTable(1)
    circles.active[0] = True
    circles.x[0], circles.y[0] = around.focus_x + 500 * right_m / ahead_m, 200
    circles.radius[0], circles.expansion[0] = 25, around.speed_mps / ahead_m
    assert bool(normal_circles.passes_by(circles.columns, 0, around)) is passes


@pytest.mark.parametrize("speed_mps", [math.nan, 0.0, -1.0])
def test_nothing_is_known_to_pass_by_when_the_vehicle_does_not_drive_forward(
    speed_mps: float, situation: Situation
) -> None:
    circles = CircleTable(1)
    circles.active[0], circles.x[0], circles.expansion[0], circles.radius[0] = True, 600, 0.5, 20
    assert not normal_circles.passes_by(circles.columns, 0, situation(speed_mps=speed_mps))


def test_the_mean_expansion_is_that_of_the_circles_in_use_weighted_by_their_edges() -> None:
    circles = CircleTable(4)
    assert normal_circles.mean_expansion(circles.columns) == 0
    circles.active[:], circles.expansion[:], circles.support[:] = (1, 0, 1, 1), (0.5, 9.0, -0.2, 0.0), (3, 5, 1, 4)
    assert normal_circles.mean_expansion(circles.columns) == pytest.approx((3 * 0.5 + 0.2) / 8)
