"""C_r from S: objects correct their circles, and one that will be met keeps one."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Config, Filter
from lcf_edge.filter import LineCircleFilter, object_circles
from lcf_edge.filter.circles import Ids
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CircleTable, EdgeTable, ObjectTable
from lcf_edge.lens import Lens
from lcf_edge.messages import Cause, ObjectClass, ObjectState

LENS = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
SETTINGS = Settings(Filter(), Pinhole(500.0, 500.0, 319.5, 239.5))
TR_S = Filter().tr_s

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]
Situation = Callable[..., Any]


def steps(way: Any) -> Iterator[LineCircleFilter]:
    """The filter after each frame."""
    tables = LineCircleFilter(Config(), way.lens)
    for corners, motion in way:
        tables.step(corners, motion)
        yield tables


def published(objects: ObjectTable) -> list[int]:
    """Rows of published objects."""
    return np.flatnonzero(objects.active & (objects.trust >= TR_S)).tolist()


class Known:
    """One object 60 px wide and 80 px tall that stands ahead, trusted and seen, and two circles that are not in use."""

    def __init__(self, around: Any, probability: float = 0.9, state: ObjectState = ObjectState.SEEN) -> None:
        self.around, self.edges, self.ids = around, EdgeTable(10, 2, 2), Ids()
        self.objects, self.circles = ObjectTable(1), CircleTable(2)
        objects = self.objects
        objects.active[0], objects.trust[0], objects.state[0], objects.support[0] = True, TR_S, state, 9
        objects.x[0], objects.y[0], objects.width[0], objects.height[0] = 350.0, 260.0, 60.0, 80.0
        objects.class_id[0], objects.probability[0] = ObjectClass.STANDING, probability
        objects.ttc[0], objects.range[0], objects.lateral[0] = 2.0, 3.0, 0.1
        objects.looming[0], objects.middle[0], objects.reference[0] = 0.5, 3.0, around.speed_mps

    def set(self, **values: float) -> None:
        for name, value in values.items():
            getattr(self.objects, name)[0] = value

    def add_circle(self, c: int, x: float, trust: float, square: int = -1) -> None:
        circles = self.circles
        circles.active[c], circles.trust[c], circles.square[c], circles.id[c] = True, trust, square, 70 + c
        circles.x[c], circles.y[c] = x, 260.0

    def update(self) -> None:
        rows = self.objects.columns, self.circles.columns, self.edges.columns
        object_circles.update(*rows, ImagePlane(LENS), self.around, SETTINGS, self.ids)

    def trusted(self) -> list[int]:
        """Rows of circles that are published."""
        return np.flatnonzero(self.circles.active & (self.circles.trust >= TR_S)).tolist()


# What will be met keeps a circle


def test_what_will_be_met_has_a_circle_though_no_edge_breaks_the_flow(situation: Situation) -> None:
    known = Known(situation())
    known.update()
    (c,) = known.trusted()
    circles = known.circles
    assert circles.columns.evicted == 0
    assert (circles.x[c], circles.y[c], circles.radius[c]) == (350.0, 260.0, 40.0)
    assert (circles.width[c], circles.height[c], circles.support[c]) == (60.0, 80.0, 9)
    assert (circles.ttc[c], circles.range[c], circles.lateral[c]) == (2.0, 3.0, pytest.approx(0.1))
    assert (circles.cause[c], circles.square[c]) == (Cause.INCOMING, 0)
    assert circles.id[c] > 0


def test_it_keeps_the_one_that_it_has(situation: Situation) -> None:
    known = Known(situation())
    known.update()
    (c,) = known.trusted()
    identity = int(known.circles.id[c])
    known.circles.trust[c] -= 1  # as of a circle that no rebel shows
    known.update()
    assert known.trusted() == [c]
    assert known.circles.id[c] == identity


def test_a_circle_of_its_own_that_was_not_trusted_is(situation: Situation) -> None:
    known = Known(situation())
    known.add_circle(1, 300.0, TR_S - 1, square=0)
    known.update()
    assert known.trusted() == [1]
    assert known.circles.id[1] == 71


@pytest.mark.parametrize(("x", "square"), [(375.0, -1), (400.0, 0)], ids=["inside", "own"])
def test_a_trusted_circle_is_enough(situation: Situation, x: float, square: int) -> None:
    known = Known(situation())
    known.add_circle(0, x, TR_S, square)
    known.update()
    assert known.trusted() == [0]
    assert known.circles.x[0] == x


def test_a_circle_beside_it_shows_something_else(situation: Situation) -> None:
    known = Known(situation())
    known.add_circle(0, 400.0, TR_S)
    known.update()
    assert known.trusted() == [0, 1]


@pytest.mark.parametrize("state", [ObjectState.HIDDEN, ObjectState.COASTING])
def test_what_is_not_seen_gets_none(situation: Situation, state: ObjectState) -> None:
    known = Known(situation(), state=state)
    known.update()
    assert known.trusted() == []


def test_what_is_not_met_more_likely_than_not_gets_none(situation: Situation) -> None:
    known = Known(situation(), probability=0.5)
    known.update()
    assert known.trusted() == []


@pytest.mark.parametrize(("support", "ttc_s", "shown"), [(6, 1.9, False), (7, 1.9, True), (6, 2.0, True)])
def test_what_only_a_few_edges_say_is_met_soon_gets_none(
    situation: Situation, support: int, ttc_s: float, shown: bool
) -> None:
    known = Known(situation())
    known.set(support=support, ttc=ttc_s)
    known.update()
    assert bool(known.trusted()) == shown


LARGE = {"height": 200.0, "trust": 5.0, "ttc": 1.9, "range": 1.5}  # and well trusted, and soon met


@pytest.mark.parametrize("state", [ObjectState.SEEN, ObjectState.COASTING])
def test_what_is_large_and_was_well_trusted_keeps_its_circle_to_the_end_though_its_edges_are_lost(
    situation: Situation, state: ObjectState
) -> None:
    known = Known(situation(), state=state)
    known.set(**LARGE, support=2)
    known.update()
    assert len(known.trusted()) == 1


@pytest.mark.parametrize(
    "but",
    [
        {"state": ObjectState.HIDDEN},
        {"height": 30.0, "width": 30.0},
        {"trust": 3.9},
        {"ttc": 2.0, "state": ObjectState.COASTING},
        {"range": 1.4},
        {"probability": 0.5},
    ],
    ids=lambda but: next(iter(but)),
)
def test_but_not_what_is_hidden_small_less_trusted_met_later_very_near_or_unlikely_to_be_met(
    situation: Situation, but: dict[str, float]
) -> None:
    known = Known(situation())
    known.set(**(LARGE | {"support": 2} | but))
    known.update()
    assert known.trusted() == []


def test_an_object_that_is_not_published_gets_none(situation: Situation) -> None:
    known = Known(situation())
    known.objects.trust[0] = TR_S - 0.5
    known.update()
    assert known.trusted() == []


def test_a_full_table_is_counted(situation: Situation) -> None:
    known = Known(situation())
    for c in (0, 1):
        known.add_circle(c, 100.0, TR_S)
    known.update()
    assert known.circles.columns.evicted == 1
    assert known.trusted() == [0, 1]


def test_after_every_frame_what_is_seen_and_will_be_met_has_a_circle(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    way = drive(clutter(150)) + drive(box((0.0, -0.4, 7.0), (0.5, 0.9, 0.0), landmarks=8))
    due = 0
    for tables in steps(replace(way, frames=40)):
        objects, circles = tables.objects, tables.rebel
        for o in published(objects):
            if objects.state[o] != ObjectState.SEEN or not objects.probability[o] > 0.5:
                continue
            due += 1
            aside, below = np.abs(circles.x - objects.x[o]), np.abs(circles.y - objects.y[o])
            inside = (aside <= 0.5 * objects.width[o]) & (below <= 0.5 * objects.height[o])
            assert (circles.active & (circles.trust >= TR_S) & (inside | (circles.square == o))).any()
    assert due > 5


# What has left the image


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(("in_sight_px", "ends"), [(14.0, True), (16.0, False)])
def test_circles_end_with_a_quarter_of_what_is_seen_no_more_in_the_image(
    situation: Situation, side: int, in_sight_px: float, ends: bool
) -> None:
    """Of an object 60 px wide, which itself goes on."""
    known = Known(situation(), state=ObjectState.COASTING)
    border_x, inward = (0.0, 1) if side < 0 else (LENS.width - 1.0, -1)
    known.objects.x[0] = border_x + inward * (in_sight_px - 30.0)
    known.add_circle(0, border_x, 5.0, square=0)
    known.update()
    assert known.circles.active[0] != ends
    assert known.objects.active[0]


@pytest.mark.parametrize("why", ["seen", "nothing flows", "of another"])
def test_other_circles_at_the_border_go_on(situation: Situation, why: str) -> None:
    state = ObjectState.SEEN if why == "seen" else ObjectState.COASTING
    known = Known(situation(flow_is_seen=why != "nothing flows"), state=state)
    known.objects.x[0] = -20.0
    known.add_circle(0, 0.0, 5.0, square=-1 if why == "of another" else 0)
    known.update()
    assert known.circles.active[0]


# What circles take from their object


def test_circles_of_what_crosses_take_cause_range_and_miss_from_their_object(
    drive: Drive, box: Landmarks, clutter: Landmarks
) -> None:
    walker = drive(box((-2.2, -0.55, 6.0), (0.4, 1.7, 0.2), landmarks=60), np.array([1.2, 0, 0]))
    circles_reported = 0
    for tables in steps(replace(drive(clutter(150)) + walker, frames=24)):
        objects, circles = tables.objects, tables.rebel
        for o in published(objects):
            if objects.class_id[o] != ObjectClass.CROSSING or objects.probability[o] > 0.5:
                continue
            for c in np.flatnonzero(circles.active & (circles.square == o)):
                circles_reported += 1
                assert circles.cause[c] == Cause.CROSSING
                for number in ("range", "lateral"):
                    of_both = getattr(circles, number)[c], getattr(objects, number)[o]
                    assert of_both[0] == pytest.approx(of_both[1], nan_ok=True)
    assert circles_reported > 5


# New edges in its circles


@pytest.mark.parametrize(
    ("trust", "moves_pxps"), [(TR_S, (-40.0, 30.0)), (SETTINGS.tr_cr, (90.0, 0.0))], ids=["known", "unsure"]
)
def test_a_new_edge_in_a_rebel_circle_starts_with_the_motion_of_its_object(
    situation: Situation, trust: float, moves_pxps: tuple[float, float]
) -> None:
    """The object goes to the left and looms; while it is not sure, its circle tells."""
    known = Known(situation())
    known.add_circle(0, 350.0, TR_S, square=0)
    circles, objects, edges, around = known.circles, known.objects, known.edges, known.around
    circles.beta[0], circles.speed[0], circles.radius[0], circles.ttc[0] = 0.0, 90.0, 20.0, np.inf
    circles.cause[0] = Cause.CROSSING
    objects.trust[0], objects.sideways[0] = trust, -50.0 / around.pinhole.fx
    row = edges.append(1).start
    edges.x[row], edges.y[row] = around.focus_x + 20.0, around.horizon_y + 60.0
    circles.x[0], circles.y[0] = edges.x[row], edges.y[row]
    object_circles.join_rebels(edges.columns, row, circles.columns, objects.columns, around, SETTINGS)
    velocity = edges.speed[row] * np.array([np.cos(edges.beta[row]), np.sin(edges.beta[row])])
    assert velocity == pytest.approx(moves_pxps)
    assert edges.suspect_keys[row] == 1
