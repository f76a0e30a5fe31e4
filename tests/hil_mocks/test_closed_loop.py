"""A vehicle in a rendered world: the same seed gives the same bytes, and its world is honest."""

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.samples import Frame, ImuSample, SpeedSample
from hil_mocks.closed_loop import worlds
from hil_mocks.closed_loop.course import Course
from hil_mocks.closed_loop.events import BLOCKED, EVENTS
from hil_mocks.closed_loop.exact import Exact, Memory, exact_of_drive
from hil_mocks.closed_loop.live import LiveDriver, world_of
from hil_mocks.closed_loop.loop import Contact, Log, Moment, drive
from hil_mocks.closed_loop.outcome import brakings, judge, pool
from hil_mocks.closed_loop.vehicle import Build, Vehicle
from hil_mocks.closed_loop.world import Bodies, Body, Leg, World, touch
from lcf_edge.messages import ObjectClass, ObjectState
from lcf_edge.rendered.drives import Lens, Paint
from lcf_edge.rendered.projection import Stage
from lcf_edge.rendered.scenes import make
from lcf_edge.rendered.truth import truth

SMALL = Lens(320, 240, 250.0)
STRAIGHT = Course(20.0)
QUIET = 1e-9


class Watching:
    """Wants a speed, and keeps what it is shown."""

    def __init__(self, *targets_mps: float) -> None:
        self.targets_mps, self.moments = targets_mps, []

    def decide(self, moment: Moment) -> float:
        self.moments.append(moment)
        return self.targets_mps[min(len(self.moments), len(self.targets_mps)) - 1]


def body(x: float, z: float, *legs: Leg, name="walker_0", width=0.5, length=0.3) -> Body:
    return Body(name, width, 1.7, length, x, z, 0.0, Paint(3), legs, walker=True)


def world(*bodies: Body, **values) -> World:
    usual = World(0, (), "fair", STRAIGHT, 1.0, Build(), bodies, start_mps=1.0, lens=SMALL)
    return replace(usual, **values)


def ended(drawn: World, driver: Watching, seconds: float = math.inf) -> Log:
    course = Course(min(seconds * drawn.cruise_mps, drawn.course.length_m))
    return drive(replace(drawn, course=course), driver, with_images=False)


def digest(drawn: World) -> str:
    seen = Watching(drawn.cruise_mps)
    log = drive(replace(drawn, course=Course(1.5 * drawn.cruise_mps), lens=SMALL), seen)
    bytes_of = hashlib.sha256()
    for moment in seen.moments:
        bytes_of.update(moment.frame.image.tobytes())
        bytes_of.update(repr((moment.samples, moment.known)).encode())
    return bytes_of.hexdigest() + repr(log)


def test_the_same_seed_gives_the_same_bytes() -> None:
    assert digest(worlds.make(5)) == digest(worlds.make(5))


def test_another_seed_gives_others() -> None:
    assert digest(worlds.make(5)) != digest(worlds.make(6))


def test_what_is_decided_changes_the_next_images() -> None:
    slow, fast = Watching(0.2), Watching(1.0)
    for driver in (slow, fast):
        drive(world(body(0.0, 6.0), course=Course(1.5)), driver)
    first = [driver.moments[0].frame.image for driver in (slow, fast)]
    later = [driver.moments[20].frame.image for driver in (slow, fast)]
    assert np.array_equal(*first)
    assert not np.array_equal(*later)


def test_a_decision_takes_effect_after_the_delay_and_no_sooner() -> None:
    build = Build(delay_s=0.2)
    driver = Watching(0.0)
    log = ended(world(build=build), driver, 1.0)
    assert log.speed_mps[: round(0.2 * 20) + 1] == [1.0] * 5
    assert log.speed_mps[6] < 1.0


def test_it_brakes_and_accelerates_within_its_limits() -> None:
    log = ended(world(), Watching(*[0.0] * 30, *[1.0] * 60), 2.0)
    change = np.diff(log.speed_mps) * 20
    assert change.min() >= -Build().braking_mps2 - QUIET
    assert change.max() <= Build().acceleration_mps2 + QUIET
    assert min(log.speed_mps) == 0.0


@pytest.mark.parametrize("kind", ["differential", "bicycle"])
def test_it_keeps_to_its_course(kind: str) -> None:
    waves = tuple((at, 0.25 * math.sin(at)) for at in np.linspace(0, 12, 40).tolist())
    vehicle = Vehicle(Build(kind), Course(12.0, waves), 1.0)
    aside = []
    vehicle.command(-1.0, 1.0)
    for step in range(2400):
        vehicle.step(step / 200, 1 / 200, 0.4)
        aside.append(vehicle.course.locate(vehicle.position, vehicle.travelled_m)[1])
    assert np.abs(aside).max() < 0.1
    assert vehicle.travelled_m == pytest.approx(12.0, abs=0.1)


@given(st.floats(0.0, 19.0), st.floats(-1.0, 1.0))
def test_a_place_on_the_course_is_found_again(at_m: float, right_m: float) -> None:
    course = Course(20.0, ((0.0, 0.0), (5.0, 0.2), (15.0, -0.2)))
    found = course.locate(np.array(course.place(at_m, right_m)), at_m)
    assert found == pytest.approx((at_m, right_m), abs=0.06)


def test_what_is_run_into_is_reported_once_with_the_speed_and_taken_away() -> None:
    driver = Watching(1.0)
    log = ended(world(body(0.0, 3.0)), driver, 5.0)
    assert [(contact.name, round(contact.speed_mps, 2)) for contact in log.contacts] == [("walker_0", 1.0)]
    assert log.contacts[0].time_s == pytest.approx(2.85, abs=0.03)
    assert not driver.moments[-1].known


@pytest.mark.parametrize("arrived_s", [1.0, 3.0])
def test_before_a_box_that_ends_its_course_the_vehicle_stands_for_as_long_as_is_asked(arrived_s: float) -> None:
    blocked = world(body(0.0, 3.0), blocked=True, start_mps=0.0, arrived_s=arrived_s, course=Course(1.0))
    log = ended(blocked, Watching(0.0))
    assert log.arrived
    assert log.seconds == pytest.approx(arrived_s, abs=0.11)


def test_nobody_walks_into_a_vehicle_that_stands() -> None:
    walker = body(0.0, 5.0, Leg(0.0, -5.0, 1.0))
    drawn = world(walker, start_mps=0.0)
    vehicle, bodies = Vehicle(drawn.build, drawn.course), Bodies(drawn)
    for _ in range(1500):
        bodies.step(0.01, vehicle)
        assert not touch(vehicle.footprint, bodies.footprints()[0])
    assert bodies.position[0, 1] < -2.0  # he went round it


@pytest.mark.parametrize("half_width_m", [0.3, 0.6])
@pytest.mark.parametrize("speed_mps", [0.4, 0.8])
def test_who_meets_a_vehicle_on_his_way_goes_past_it_and_on(half_width_m: float, speed_mps: float) -> None:
    way = (Leg(0.0, z, speed_mps) for z in (3.0, 1.5, 0.0, -0.4, -1.5, -5.0))
    drawn = world(body(0.1, 4.0, *way), start_mps=0.0, build=Build(half_width_m=half_width_m))
    vehicle, bodies = Vehicle(drawn.build, drawn.course), Bodies(drawn)
    for _ in range(3500):
        bodies.step(0.01, vehicle)
        assert bodies.velocity[0, 1] <= 0.01  # he never turns back to a place that the vehicle is at
    assert bodies.position[0, 1] == pytest.approx(-5.0, abs=0.1)


def test_nobody_walks_through_a_box() -> None:
    walker = body(0.1, 5.0, Leg(0.0, 12.0, 1.2))
    drawn = world(walker, body(0.0, 8.0, name="box", width=1.0, length=1.0), start_mps=0.0)
    vehicle, bodies = Vehicle(drawn.build, drawn.course), Bodies(drawn)
    for _ in range(1500):
        bodies.step(0.01, vehicle)
        assert not touch(*bodies.footprints())
    assert bodies.position[0, 1] == pytest.approx(12.0, abs=0.1)


@pytest.mark.parametrize("aside_m", [1.1, 1.2, 1.3, 1.4])
def test_who_is_hemmed_in_moves_steadily(aside_m: float) -> None:
    boxes = (body(side * aside_m, 0.5, name=f"box_{side}", width=1.0, length=1.0) for side in (-1, 1))
    drawn = world(body(0.1, 3.0, Leg(0.0, -3.0, 1.0)), *boxes, start_mps=0.0)
    vehicle, bodies = Vehicle(drawn.build, drawn.course), Bodies(drawn)
    before, turned = bodies.velocity[0].copy(), bodies.heading[0]
    for _ in range(800):
        bodies.step(0.01, vehicle)
        assert np.hypot(*(bodies.velocity[0] - before)) <= (3.0 + 4.0) * 0.01  # what legs and evading demand
        assert bodies.heading[0] == turned or np.hypot(*bodies.velocity[0]) > 0.1
        before, turned = bodies.velocity[0].copy(), bodies.heading[0]


def test_a_leg_waits_for_the_vehicle() -> None:
    driver = Watching(1.0)
    ended(world(body(-1.5, 6.0, Leg(3.0, 6.0, 1.0, from_m=2.0))), driver, 4.0)
    starts = [moment.time_s for moment in driver.moments if moment.known and moment.known[0].moving]
    assert starts[0] == pytest.approx(2.05, abs=0.06)


def test_the_gyro_shows_how_the_vehicle_turns_and_the_wheels_how_fast_it_is() -> None:
    turning = Course(10.0, ((0.0, 0.2), (10.0, 0.2)))
    driver = Watching(1.0)
    drive(world(course=turning), driver, with_images=False)
    samples = [sample for moment in driver.moments[60:] for sample in moment.samples]
    yaw = [sample.gyro[1] for sample in samples if isinstance(sample, ImuSample)]
    wheels = [(sample.speed_mps, sample.yaw_rate_radps) for sample in samples if isinstance(sample, SpeedSample)]
    assert np.mean(yaw) == pytest.approx(-0.2, abs=0.01)
    assert np.mean(wheels, axis=0) == pytest.approx((1.0, 0.2), abs=0.02)
    ticks = np.array(wheels)[:, 0] * 2 * 2000 / 50
    assert ticks == pytest.approx(np.rint(ticks), abs=1e-6)


def test_samples_come_in_order_of_time_and_some_after_the_image() -> None:
    driver = Watching(1.0)
    ended(world(), driver, 1.0)
    drive(world(course=Course(1.0)), driver)
    for moment in driver.moments[-10:]:
        stamps = [sample.stamp_ns for sample in moment.samples]
        assert stamps == sorted(stamps)
        assert 0 < stamps[-1] - moment.frame.stamp_ns < 20_000_000


def test_without_gyro_and_odometry_there_are_no_samples() -> None:
    driver = Watching(1.0)
    ended(world(gyro=False, odometry=False), driver, 1.0)
    assert not any(moment.samples for moment in driver.moments)


def test_the_truth_of_a_rendered_drive_is_that_of_its_scenes() -> None:
    spec = make("crossing", 3, width=320, height=240, focal_px=250.0)
    stage = Stage(spec)
    for time_s in (1.0, 4.0):
        view = stage.view(time_s)
        known = {each.number: each for each in exact_of_drive(stage, view)}
        for thing in truth(stage, view, 0).objects:
            if thing.depth_m > 0:
                same = known[thing.id]
                assert (same.ttc_s, same.range_m, same.threat) == (thing.ttc_s, thing.depth_m, thing.threat)
                assert same.in_sight == thing.in_sight
                assert same.moving == thing.moving


def test_the_truth_says_where_the_middle_of_a_body_is_seen() -> None:
    driver = Watching(0.0)
    drawn = world(body(1.0, 6.0), camera_height_m=0.3)
    ended(drawn, driver, 0.2)
    (seen,) = driver.moments[0].known
    assert seen.bearing_rad == pytest.approx(math.atan2(1.0, 6.0), abs=0.01)
    assert seen.elevation_rad == pytest.approx(math.atan2(1.7 / 2 - 0.3, math.hypot(1.0, 6.0)), abs=0.01)


def shape_of(course: Course) -> str:
    """The kind of a course, by its curvature."""
    turns = [course.curvature(at) for at in np.linspace(0.0, course.length_m, 61).tolist()]
    if min(turns) < 0 < max(turns):
        return "slalom"
    if not any(turns):
        return "straight"
    return "arc" if turns[-1] else "bend"


def test_every_kind_of_event_fault_and_drive_comes_up_among_the_worlds() -> None:
    drawn = [worlds.make(seed) for seed in range(120)]
    assert {event for each in drawn for event in each.events} == {*EVENTS, BLOCKED}
    assert {each.condition for each in drawn} == set(worlds.CONDITIONS)
    assert {each.build.kind for each in drawn} == {"bicycle", "differential"}
    assert {each.start_mps == 0 for each in drawn} == {bool(each.waits_m) for each in drawn} == {True, False}
    assert min(each.cruise_mps for each in drawn) < 0.4
    assert max(each.cruise_mps for each in drawn) > 3.8
    assert {shape_of(each.course) for each in drawn} == set(worlds.COURSES)


def test_the_memory_of_the_truth_tells_for_a_while_of_what_is_hidden() -> None:
    seen = Exact(
        number=0,
        name="walker_0",
        box=(0.0, 0.0, 20.0, 40.0),
        visible=1.0,
        range_m=4.0,
        bearing_rad=0.0,
        elevation_rad=0.0,
        beside_m=0.1,
        v_forward_mps=0.0,
        v_right_mps=1.0,
        ttc_s=2.0,
        lateral_m=0.1,
        closest_s=2.0,
        threat=True,
        class_id=ObjectClass.CROSSING,
    )
    hidden = replace(seen, visible=0.0)
    memory = Memory()
    assert memory.objects(0.0, [hidden]).size == 0
    assert memory.objects(0.1, [seen])["state"].tolist() == [ObjectState.SEEN]
    assert memory.objects(0.5, [hidden])["state"].tolist() == [ObjectState.HIDDEN]
    assert memory.objects(5.0, [hidden]).size == 0


@settings(max_examples=25)
@given(st.integers(0, 2000))
def test_nothing_stands_in_another_or_on_the_course(seed: int) -> None:
    drawn = worlds.make(seed)
    prints = Bodies(drawn).footprints()
    still = [row for row, each in enumerate(drawn.bodies) if each.name.startswith(("clutter", "beside"))]
    for row in still:
        for other in still:
            assert other <= row or not touch(prints[row], prints[other])
        for corner in prints[row]:
            assert drawn.course.clearance(corner) > drawn.build.half_width_m + 0.05


def test_worlds_refuse_a_negative_seed() -> None:
    with pytest.raises(ValueError, match="seed >= 0"):
        worlds.make(-1)


# What came of a drive.


def log_of(*targets_mps: float, contacts: tuple[Contact, ...] = ()) -> Log:
    count = len(targets_mps)
    in_view: list[frozenset[int]] = [frozenset()] * count
    return Log([1.0] * count, list(targets_mps), list(targets_mps), in_view, list(contacts), 10.0, 10.0)


def test_a_sliver_at_the_border_is_not_in_sight() -> None:
    edge_m = 5.0 * SMALL.width / 2 / SMALL.focal_px
    log = ended(world(body(edge_m + 0.4, 5.2), body(0.5, 8.0, name="box"), start_mps=0.0), Watching(0.0), 0.1)
    assert log.in_view[0] == {1}


def test_a_braking_is_one_until_it_is_over() -> None:
    log = log_of(1.0, 0.5, 0.9, 0.2, 1.0, 1.0, 0.0)
    assert [(each.first, each.last) for each in brakings(log, [True] * 7, 20.0)] == [(1, 3), (6, 6)]


def test_a_braking_is_for_nothing_unless_the_truth_brakes_at_about_that_time() -> None:
    log = log_of(*[1.0] * 40, 0.0, *[1.0] * 40)
    near, far = [False] * 81, [False] * 81
    near[25], far[5] = True, True
    assert [each.for_nothing for each in brakings(log, near, 20.0)] == [False]
    assert [each.for_nothing for each in brakings(log, far, 20.0)] == [True]


def test_what_the_truth_hits_too_counts_for_nobody() -> None:
    one, two = Contact(1, "walker_1", 1.0, 1.0), Contact(2, "cart_2", 2.0, 3.0)
    log, blind, sighted = (log_of(1.0, contacts=hit) for hit in ((one, two), (one, two), (one,)))
    found = judge(log, [False], 20.0, sighted, blind)
    assert (found.threats, found.collisions, found.contact_mps) == (1, (two,), 3.0)
    assert pool([found, found]).threats == 2
    assert pool([found, found]).mean_speed_share == 1.0


@pytest.mark.parametrize(
    ("first", "last", "unseen"),
    [
        pytest.param(3.8, 4.0, 1, id="too late to stop"),
        pytest.param(2.5, 2.7, 0, id="in time"),
        pytest.param(0.5, 1.0, 1, id="so long before that it is forgotten"),
        pytest.param(0.5, 4.0, 0, id="all the time"),
    ],
)
def test_who_came_from_out_of_view_is_told(first: float, last: float, unseen: int) -> None:
    """At 1 m/s it takes a second to stop; the contact is after four."""
    log = log_of(*[1.0] * 100, contacts=(Contact(7, "walker_7", 4.0, 1.0),))
    for seq in range(round(first * 20), round(last * 20)):
        log.in_view[seq] = frozenset({7})
    found = judge(log, [True] * 100, 20.0, log_of(1.0), log_of(1.0, contacts=tuple(log.contacts)))
    assert (len(found.collisions), found.unseen) == (1, unseen)
    assert pool([found, found]).unseen == 2 * unseen


# In real time.


def test_the_devices_get_what_the_world_delivers_by_one_clock() -> None:
    watching, live = Watching(1.0), LiveDriver(fps=1000.0)
    drive(world(course=Course(0.3)), watching)
    for moment in watching.moments:
        live.decide(moment)
    for kind in (Frame, ImuSample, SpeedSample):
        sent = [item for moment in watching.moments for item in (*moment.samples, moment.frame) if type(item) is kind]
        came = live.come(kind)
        assert len(came) == len(sent)
        assert {a.stamp_ns - b.stamp_ns for a, b in zip(came, sent, strict=True)} == {live.offset_ns}


def test_the_newest_speed_is_obeyed_and_what_is_none_is_left_alone() -> None:
    live = LiveDriver(fps=1000.0)
    for line in ("1.5\n", "stop\n", "nan\n", ""):
        live.obey(line)
    assert live.target_mps == 1.5


def test_in_real_time_it_starts_at_rest() -> None:
    assert all(world_of(seed).start_mps == 0.0 for seed in range(4))
