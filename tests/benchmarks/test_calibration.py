"""Whether the calibration counts what it says, with objects made by hand."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks import calibration, report
from benchmarks.calibration import Calibration, match, tables
from benchmarks.drivers import NAMES, TRUTH, driver, objects_of_circles
from hil_mocks.closed_loop import worlds
from hil_mocks.closed_loop.course import Course
from hil_mocks.closed_loop.exact import Exact, Memory
from hil_mocks.closed_loop.loop import drive
from lcf_edge.messages import CIRCLE, PSI_REGION, Cause, Kind, ObjectClass, ObjectState, Scene
from lcf_edge.rendered.drives import Drive, Profile

WALKER = Exact(
    number=3,
    name="walker_3",
    box=(300.0, 200.0, 40.0, 120.0),
    visible=1.0,
    range_m=5.0,
    bearing_rad=0.0,
    elevation_rad=0.0,
    beside_m=0.1,
    v_forward_mps=0.0,
    v_right_mps=1.0,
    ttc_s=2.0,
    lateral_m=0.3,
    closest_s=2.0,
    threat=True,
    class_id=ObjectClass.CROSSING,
)
LEAVER = replace(WALKER, beside_m=2.0, lateral_m=4.0, threat=False)


def rows(table: str, found: Calibration) -> dict[str, tuple[str, ...]]:
    chosen = next(each for each in tables(found) if each.title.startswith(table))
    return {row[0]: tuple(row[1:]) for row in chosen.rows}


def reported(*bodies: Exact, **changes: float) -> np.ndarray:
    """What the truth would say, changed."""
    objects = Memory().objects(0.0, bodies)
    for name, value in changes.items():
        objects[name] = value
    return objects


def seen(*frames: tuple[np.ndarray, list[Exact]], fps: float = 20.0) -> Calibration:
    found = Calibration()
    for number, (objects, known) in enumerate(frames):
        found.see("drive", number / fps, objects, known, 0.3)
    return found


def test_the_truth_itself_reaches_every_goal() -> None:
    goals = rows("Goals", seen(*[(reported(WALKER), [WALKER])] * 40))
    assert [goals[name][1] for name in goals if "contact below 4 s" in name] == ["100.0 %"] * 4
    assert goals["walkers: one object"][1] == "100.0 %"
    assert goals["walkers: one id as long as in sight"][1] == "100.0 %"
    assert goals["objects on nothing"][1] == "0.0 %"


def test_a_contact_denied_is_an_error_and_a_range_unknown_is_no_range() -> None:
    goals = rows("Goals", seen((reported(WALKER, ttc=math.inf, range=math.nan), [WALKER])))
    assert goals["contact below 4 s: contact within 15 %"][1] == "0.0 %"
    assert goals["contact below 4 s: range known"][1] == "0.0 %"


def test_honest_sigmas_hold_68_and_95_percent_of_the_truths() -> None:
    random = np.random.default_rng(1)
    frames = [(reported(WALKER, lateral=0.3 + random.normal(0, 0.2), lateral_sigma=0.2), [WALKER]) for _ in range(4000)]
    one, two, *_ = rows("Truths inside", seen(*frames))["lateral"]
    assert float(one.split()[0]) == pytest.approx(68.3, abs=3)
    assert float(two.split()[0]) == pytest.approx(95.4, abs=1.5)


def test_sigmas_are_shown_by_class_and_by_range() -> None:
    near = replace(WALKER, range_m=2.0, class_id=ObjectClass.ONCOMING)
    found = seen(
        (reported(WALKER, range=5.5, range_sigma=0.4), [WALKER]),
        (reported(near, range=5.5, range_sigma=0.4), [near]),
    )
    both = {**rows("Truths inside one and two sigmas, by true class", found)}
    both |= rows("Truths inside one and two sigmas, by true range", found)
    assert {name: cells[1] for name, cells in both.items()} == {
        "crossing": "0.0 %, 100.0 % of 1",
        "oncoming": "0.0 %, 0.0 % of 1",
        "3 to 6 m": "0.0 %, 100.0 % of 1",
        "0 to 3 m": "0.0 %, 0.0 % of 1",
    }


def test_a_contact_denied_has_no_sigma_and_is_counted_apart() -> None:
    found = seen((reported(WALKER), [WALKER]), (reported(WALKER, ttc=math.inf, ttc_sigma=math.nan), [WALKER]))
    assert rows("Truths inside", found)["ttc"] == ("100.0 %", "100.0 %", "0.00", "1", "50.0 %")


def test_two_objects_on_one_walker_are_several_and_another_id_ends_a_life() -> None:
    twice = np.concatenate([reported(WALKER), reported(WALKER, id=9)])
    other = reported(WALKER, id=9)
    goals = rows("Goals", seen(*[(twice, [WALKER])] * 20, *[(other, [WALKER])] * 20))
    assert float(goals["walkers: several"][1].split()[0]) > 30
    assert goals["walkers: one id as long as in sight"][1] == "0.0 %"
    assert goals["walkers: frames with the id that lives longest"][1] == "50.0 %"


def test_who_leaves_and_is_said_to_stand_is_counted() -> None:
    objects = reported(LEAVER, class_id=ObjectClass.STANDING, ttc=1.0, lateral=0.1)
    found = seen((objects, [LEAVER]), (reported(LEAVER), [LEAVER]))
    assert (found.leaving, found.leaving_standing, found.leaving_imminent) == (2, 1, 1)


def test_what_is_only_predicted_is_not_compared() -> None:
    assert not seen((reported(WALKER, state=ObjectState.COASTING), [WALKER])).pairs


def test_a_probability_is_compared_with_how_often_it_comes_true() -> None:
    said = [(reported(WALKER, probability=0.5), [WALKER]), (reported(LEAVER, probability=0.5), [LEAVER])]
    assert rows("Probability", seen(*said))["0.3 to 0.7"] == ("50.0 %", "50.0 %", "2")


@given(st.floats(0, 640), st.floats(0, 480), st.floats(1, 300))
def test_an_object_lies_on_a_body_only_if_its_middle_is_in_the_grown_box(x: float, y: float, size: float) -> None:
    inside = abs(x - 320) <= 20 + 10 + 8 and abs(y - 260) <= 60 + 30 + 8
    assert match(reported(WALKER, x=x, y=y, width=size, height=size), [WALKER]) == [WALKER if inside else None]


def test_of_two_bodies_the_one_whose_box_it_shares_is_meant() -> None:
    behind = replace(WALKER, number=5, name="clutter_5", box=(250.0, 190.0, 300.0, 150.0))
    assert match(reported(WALKER), [behind, WALKER]) == [WALKER]


def test_the_tables_of_nothing_are_empty() -> None:
    assert rows("Goals", Calibration())["walkers: one object"][1] == "-"


def test_it_runs_on_rendered_drives(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(report, "RESULTS", tmp_path)
    make = calibration.scenes.make
    monkeypatch.setattr(
        calibration.scenes, "make", lambda kind, seed: make(kind, seed, seconds=1.0, width=320, height=240)
    )
    assert calibration.main(["--worlds", "0", "--kinds", "crossing", "--drives", "1", "--of", "circles"]) == 0
    printed = capsys.readouterr().out
    assert "# Calibration of circles: 1 rendered drive of each of 1 kind" in printed
    assert "### Goals" in printed
    assert (tmp_path / "calibration_circles.md").read_text(encoding="utf-8") in printed
    written = json.loads((tmp_path / "calibration_circles.json").read_text(encoding="utf-8"))
    assert [table["title"] for table in written["tables"]] == [table.title for table in tables(Calibration())]


# What circles tell a planner.


def scene_of(**values: float) -> tuple[Scene, Drive]:
    circles = np.zeros(1, CIRCLE)
    usual = {"kind": Kind.REBEL, "cause": Cause.INCOMING, "x": 319.5, "y": 260.0, "radius": 20.0, "trust": 4.0}
    usual |= {"ttc": 2.0, "range": 3.0, "lateral": 0.1}
    for name, value in (usual | values).items():
        circles[name] = value
    still = Profile(((0.0, 0.0),))
    drive = Drive("test", 0, 1.0, 20.0, still, still, ())
    return Scene(0, 0, 640, 480, 1.5, circles, np.zeros(0, PSI_REGION)), drive


def test_an_incoming_circle_stands_and_will_be_met() -> None:
    made = objects_of_circles(*scene_of())
    assert made["class_id"].tolist() == [ObjectClass.STANDING]
    assert made["probability"].tolist() == [1.0]
    assert made[["range", "ttc"]].tolist() == [(3.0, 2.0)]


def test_a_crossing_circle_goes_to_where_it_will_be_missed() -> None:
    made = objects_of_circles(*scene_of(cause=Cause.CROSSING, lateral=-1.0))
    assert made["v_right"] == pytest.approx(-0.5)
    assert made["v_forward"] == pytest.approx(0.0)


def test_of_a_peers_mover_the_foot_tells_the_range() -> None:
    made = objects_of_circles(*scene_of(cause=Cause.CROSSING, bearing=math.nan, y=270.0, speed=50.0, direction=0.0))
    assert made["range"] == pytest.approx(0.5 * 500 / (290 - 239.5))
    assert made["lateral"] == pytest.approx(made["range"] * 50 / 500 * 2)


def test_circles_without_trust_and_normal_ones_are_left_out() -> None:
    assert not len(objects_of_circles(*scene_of(trust=2.0)))
    assert not len(objects_of_circles(*scene_of(kind=Kind.NORMAL)))


@pytest.mark.parametrize("name", NAMES)
def test_every_driver_wants_a_speed(name: str) -> None:
    world = worlds.make(5).changed(course=Course(0.3), start_mps=1.0)
    log = drive(world, driver(world, name), with_images=name not in (TRUTH, "blind"))
    assert log.target_mps
    assert all(0 <= target_mps <= world.cruise_mps for target_mps in log.target_mps)
