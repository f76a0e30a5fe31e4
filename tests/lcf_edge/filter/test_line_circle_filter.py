"""The whole step: laws that hold whatever comes in."""

import gc
import math
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lcf_edge.config import Config, Memory, load
from lcf_edge.filter import Corners, LineCircleFilter, Motion, line_expert
from lcf_edge.filter.inputs import APPEARANCE_SAMPLES
from lcf_edge.filter.line_circle_filter import GROUND_SLOPE_RAD, Step
from lcf_edge.lens import Lens
from lcf_edge.messages import ObjectClass, Sizes

SMALL = Config(
    memory=Memory(
        corners=400,
        edges_normal=90,
        edges_rebel=20,
        chains=15,
        circles_normal=8,
        circles_rebel=3,
        groups=6,
        psi=2,
        objects=2,
    )
)
TRUST = SMALL.filter

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]


def random_corners(number: int, lens: Lens, seed: int) -> Corners:
    """Corners of noise: anywhere, of a few looks, so that many match by chance."""
    random = np.random.default_rng(seed)
    pixel = random.integers(0, (lens.width, lens.height), (number, 2), np.int32)
    looks = np.repeat(random.integers(60, 196, (7, 1), np.uint8), APPEARANCE_SAMPLES, axis=1)
    return Corners(pixel, pixel.astype(np.float32), looks[random.integers(0, 7, number)])


def motion(
    dt_s: float = 0.05,
    speed_mps: float = 1.0,
    yaw_rate_radps: float = 0.0,
    sigma_rad: float = 0.0,
    axis: tuple[float, float, float] = (0, 0, 0),
) -> Motion:
    turn = np.array(axis) + np.array([0, yaw_rate_radps * dt_s, 0])
    return Motion(dt_s, cv2.Rodrigues(turn)[0], sigma_rad, speed_mps, yaw_rate_radps)


def columns(tables: LineCircleFilter) -> dict[str, npt.NDArray[Any]]:
    """Every array of the tables, by name."""
    return {
        f"{name}.{column}": values
        for name in ("edges", "normal", "rebel", "objects", "psi", "groups", "corners")
        for column, values in getattr(tables, name).arrays.items()
    }


def left_behind(tables: LineCircleFilter, step: Step) -> bytes:
    """All that a step leaves behind."""
    used = b"".join(values.tobytes() for values in columns(tables).values())
    return used + step.omitted.tobytes() + repr(step.sizes).encode()


def check(tables: LineCircleFilter, step: Step, corners: Corners, memory: Memory, lens: Lens) -> None:
    """What holds after every step."""
    sizes, edges, n = step.sizes, tables.edges, tables.edges.count
    assert sizes.corners == len(corners) == len(step.omitted)
    assert sizes.omitted == np.count_nonzero(step.omitted)
    assert sizes.edges_normal + sizes.edges_rebel == n
    limited = {field.name for field in fields(Sizes)} & set(Memory.__struct_fields__)
    for name in limited - {"corners"}:  # these are limited before the filter
        assert 0 <= getattr(sizes, name) <= getattr(memory, name), name
    assert sizes.evicted >= 0

    for name in ("x", "y", "beta", "speed", "bl", "trust", "deviation", "origin_x", "origin_y"):
        assert np.isfinite(getattr(edges, name)[:n]).all(), name
    assert (edges.trust[:n] <= TRUST.tr_max).all()
    assert (edges.bl[:n] > 0).all()
    breaks = edges.rebel[:n] | (edges.suspect_keys[:n] > 0)
    for circles, rebel in ((tables.normal, False), (tables.rebel, True)):
        live = circles.active
        for name in ("x", "y", "radius", "beta", "speed", "trust"):
            assert np.isfinite(getattr(circles, name)[live]).all(), name
        assert (circles.x[live] >= -lens.width).all()
        assert (circles.x[live] <= 2 * lens.width).all()
        assert (circles.radius[live] > 0).all()
        assert (circles.trust[live] >= TRUST.tr_cr).all()
        assert (circles.trust[live] <= TRUST.tr_max).all()
        assert (circles.ttc[live] > 0).all()
        assert len(np.unique(circles.id[live])) == np.count_nonzero(live)
        owner = edges.circle[:n][edges.rebel[:n] == rebel]
        assert live[owner[owner >= 0]].all()

    ids = np.concatenate([circles.id[circles.active] for circles in (tables.normal, tables.rebel)])
    assert len(np.unique(ids)) == len(ids)
    check_objects(tables, memory)

    psi = tables.psi
    for name in ("x", "y", "width", "height"):
        assert np.isfinite(getattr(psi, name)[psi.active]).all(), name
    circles = tables.rebel
    x = np.concatenate([edges.x[:n][breaks], circles.x[circles.active]])
    y = np.concatenate([edges.y[:n][breaks], circles.y[circles.active]])
    places = zip(x.tolist(), y.tolist(), strict=True)
    line_expert.list_live(psi.columns)
    assert all(line_expert.psi_at(psi.columns, *place) < 0 for place in places)


def check_objects(tables: LineCircleFilter, memory: Memory) -> None:
    """Each number of an object is known, with its sigma, or neither is."""
    objects, live = tables.objects, tables.objects.active
    assert np.count_nonzero(live) == tables.objects.count <= memory.objects
    assert len(np.unique(objects.id[live])) == np.count_nonzero(live)
    for name in ("x", "y", "width", "height", "trust", "age_s", "unseen_s", "probability"):
        assert np.isfinite(getattr(objects, name)[live]).all(), name
    assert (objects.trust[live] <= TRUST.tr_max).all()
    published = live & (objects.trust >= TRUST.tr_s)
    assert ((objects.probability[published] >= 0) & (objects.probability[published] <= 1)).all()
    assert (objects.ttc[published] > 0).all()
    assert np.isfinite(objects.range[published & (objects.class_id == ObjectClass.STANDING)]).all()
    for name in ("ttc", "range", "lateral", "forward", "right", "closest"):
        values, sigmas = getattr(objects, name)[published], getattr(objects, f"{name}_sigma")[published]
        known = np.isfinite(values)
        assert (sigmas[known] >= 0).all(), name
        assert np.isnan(sigmas[~known]).all(), name


def driven(
    tables: LineCircleFilter, frames: Iterable[tuple[Corners, Motion]], memory: Memory, lens: Lens
) -> Iterator[Step]:
    for corners, moved in frames:
        step = tables.step(corners, moved)
        check(tables, step, corners, memory, lens)
        yield step


@pytest.fixture(scope="session")
def street(drive: Drive, clutter: Landmarks, box: Landmarks) -> Any:
    """Something of everything: clutter, a walker who crosses, a wall ahead."""
    walker = drive(box((-2.2, -0.6, 6), (0.5, 1.2, 0.3)), np.array([1.2, 0, 0]))
    wall = drive(box((0.05, -0.4, 7), (0.5, 0.9, 0.0), seed=5))
    return drive(clutter(250)) + walker + wall


# Bounds

moved = st.builds(
    motion,
    dt_s=st.sampled_from([0.01, 0.05, 0.3, 1.0, 7.0]),
    speed_mps=st.sampled_from([0.0, 0.5, 3.0, -1.0, 30.0, math.nan]),
    yaw_rate_radps=st.sampled_from([0.0, 0.3, -2.0]),
    sigma_rad=st.sampled_from([0.0, 0.001, 0.2]),
    axis=st.tuples(*[st.floats(-0.1, 0.1)] * 3),
)


@settings(max_examples=60)
@given(st.lists(st.tuples(st.integers(0, 400), moved, st.integers(0, 3)), min_size=2, max_size=8))
def test_whatever_comes_the_laws_hold(lens: Lens, frames: list[tuple[int, Motion, int]]) -> None:
    tables = LineCircleFilter(SMALL, lens)
    given_frames = ((random_corners(number, lens, seed), way) for number, way, seed in frames)
    assert len(list(driven(tables, given_frames, SMALL.memory, lens))) == len(frames)


def test_on_a_street_the_laws_hold(street: Any, lens: Lens) -> None:
    steps = list(driven(LineCircleFilter(Config(), lens), street, Config().memory, lens))
    assert max(step.sizes.circles_rebel for step in steps) > 0
    assert max(step.sizes.psi for step in steps) > 0
    assert max(step.sizes.objects for step in steps) > 0
    assert all(step.sizes.evicted == 0 for step in steps)


def test_on_a_street_the_laws_hold_in_small_tables(street: Any, lens: Lens) -> None:
    steps = list(driven(LineCircleFilter(SMALL, lens), street, SMALL.memory, lens))
    assert all(step.sizes.evicted > 0 for step in steps[:3])


def test_5000_corners_into_small_tables_are_held_and_evictions_are_counted(lens: Lens) -> None:
    tables = LineCircleFilter(SMALL, lens)
    frames = [(random_corners(5000, lens, seed), motion()) for seed in range(3)]
    room = tables.edges.capacity
    for step in driven(tables, frames, SMALL.memory, lens):
        assert step.sizes.edges_normal > 0.8 * SMALL.memory.edges_normal
        assert step.sizes.evicted >= 5000 - 2 * room


def test_in_a_full_table_the_trusted_stay(street: Any, lens: Lens) -> None:
    """Noise does not push out what has proven itself."""
    tables = LineCircleFilter(SMALL, lens)
    list(driven(tables, street, SMALL.memory, lens))
    n = tables.edges.count
    trusted = {a.tobytes() for a in tables.edges.appearance[:n][tables.edges.trust[:n] >= TRUST.tr_max]}
    assert trusted
    list(driven(tables, [(random_corners(400, lens, 1), motion())], SMALL.memory, lens))
    left = {a.tobytes() for a in tables.edges.appearance[: tables.edges.count]}
    assert len(trusted & left) > 0.8 * len(trusted)


@pytest.mark.parametrize("speed_mps", [0.0, 0.3, 2.0, 3.0, -1.0])  # 2.4 m/s is assumed while it is unknown
@pytest.mark.parametrize("unknown", [range(10), range(10, 16)], ids=["at first", "for a while"])
def test_a_speed_that_becomes_known_makes_no_rebels_of_what_stands(
    drive: Drive, clutter: Landmarks, lens: Lens, speed_mps: float, unknown: range
) -> None:
    tables = LineCircleFilter(Config(), lens)
    rebels = []
    for seq, (corners, moved) in enumerate(drive(clutter(250), speed_mps=speed_mps)):
        tables.step(corners, replace(moved, speed_mps=math.nan) if seq in unknown else moved)
        rebels.append(tables.edges.rebels)
    assert max(rebels) == 0


@pytest.mark.parametrize("unknown", [range(10), range(10, 16)], ids=["at first", "for a while"])
def test_nor_does_one_far_above_the_assumed_make_circles_of_it(
    drive: Drive, clutter: Landmarks, lens: Lens, unknown: range
) -> None:
    """At 8 m/s all seems to be three times as near: an edge or two beside the path break the flow for a moment."""
    tables = LineCircleFilter(Config(), lens)
    for seq, (corners, moved) in enumerate(drive(clutter(250), speed_mps=8.0)):
        tables.step(corners, replace(moved, speed_mps=math.nan) if seq in unknown else moved)
        assert tables.edges.rebels <= 2
        assert not tables.rebel.active.any()
    assert tables.edges.rebels == 0


ODD = {
    "speed unknown": motion(speed_mps=math.nan),
    "standing": motion(speed_mps=0.0),
    "reversing": motion(speed_mps=-2.0),
    "a gap of seconds": motion(dt_s=7.0, speed_mps=0.0),
    "hardly any time": motion(dt_s=0.001, speed_mps=0.0),
    "rotation uncertain": motion(sigma_rad=0.3),
}
ABSURD = {
    "far too fast": motion(speed_mps=60.0),
    "a gap of seconds on the way": motion(dt_s=7.0, speed_mps=20.0),
    "rotation unknown": motion(sigma_rad=math.pi, dt_s=7.0),
    "turned to the side": motion(axis=(0.0, math.pi / 2, 0.0)),
    "turned over": motion(axis=(1.0, 2.0, -1.0)),
}


def with_odd_motion(street: Any, odd: Motion) -> list[tuple[Corners, Motion]]:
    frames = list(street)
    frames[12] = (frames[12][0], odd)
    return frames


@pytest.mark.parametrize("odd", (ODD | ABSURD).values(), ids=ODD | ABSURD)
def test_odd_motion_in_the_middle_of_a_drive_breaks_no_law(street: Any, lens: Lens, odd: Motion) -> None:
    frames = with_odd_motion(street, odd)
    assert len(list(driven(LineCircleFilter(Config(), lens), frames, Config().memory, lens))) == len(frames)


@pytest.mark.parametrize("odd", ODD.values(), ids=ODD)
def test_odd_motion_in_the_middle_of_a_drive_is_got_over(street: Any, lens: Lens, odd: Motion) -> None:
    frames = with_odd_motion(street, odd)
    *_, last = driven(LineCircleFilter(Config(), lens), frames, Config().memory, lens)
    assert last.sizes.edges_normal > 0.7 * len(frames[-1][0])


@pytest.mark.parametrize("speed_mps", [0.0, -2.0])
def test_coming_to_rest_or_turning_back_breaks_no_law(street: Any, lens: Lens, speed_mps: float) -> None:
    there = list(street)
    then = there[-1:] * 24 if speed_mps == 0 else there[::-1]
    frames = there + [(corners, replace(way, speed_mps=speed_mps)) for corners, way in then]
    assert len(list(driven(LineCircleFilter(Config(), lens), frames, Config().memory, lens))) == len(frames)


def test_frames_without_a_corner_break_no_law_and_everything_is_forgotten(street: Any, lens: Lens) -> None:
    tables = LineCircleFilter(Config(), lens)
    nothing = random_corners(0, lens, 0)
    frames = [(nothing, motion()), *street, *[(nothing, motion(speed_mps=2.0))] * 40]
    *_, last = driven(tables, frames, Config().memory, lens)
    assert (last.sizes.edges_normal, last.sizes.circles_normal, last.sizes.psi) == (0, 0, 0)
    assert (last.sizes.edges_rebel, last.sizes.circles_rebel) == (0, 0)


def test_a_lens_that_distorts_changes_no_law(street: Any) -> None:
    lens = Lens(640, 480, 330.0, 330.0, 319.5, 239.5, "equidistant", (0.02, -0.01, 0.0, 0.0))
    tables = LineCircleFilter(Config(), lens)
    steps = list(driven(tables, replace(street, lens=lens), Config().memory, lens))
    assert max(step.sizes.circles_rebel for step in steps) > 0
    assert max(step.sizes.psi for step in steps) > 0


# Memory


def test_what_a_table_takes_is_said(lens: Lens) -> None:
    small, large = (LineCircleFilter(config, lens).table_bytes() for config in (SMALL, Config()))
    assert small.keys() == large.keys()
    for name in small:
        assert 0 < small[name] <= large[name], name
    assert sum(small.values()) < sum(large.values())


def test_the_horizon_is_the_surer_the_better_the_flow_shows_it(street: Any, lens: Lens) -> None:
    """As sure as configured without any; on a street that flows surer, but no surer than the ground is flat."""
    tables = LineCircleFilter(Config(), lens)
    configured = Config().filter.pitch_sigma_rad
    assert tables._around.horizon_sigma_rad == configured
    for corners, way in street:
        tables.step(corners, way)
    assert GROUND_SLOPE_RAD < tables._around.horizon_sigma_rad < configured


def test_no_table_is_ever_allocated_again(street: Any, lens: Lens) -> None:
    tables = LineCircleFilter(SMALL, lens)
    before = {name: values.ctypes.data for name, values in columns(tables).items()}
    size = tables.table_bytes()
    for corners, way in street:
        tables.step(corners, way)
    assert {name: values.ctypes.data for name, values in columns(tables).items()} == before
    assert tables.table_bytes() == size


OURS = [tracemalloc.Filter(True, "*/lcf_edge/*"), tracemalloc.Filter(True, "*/numpy/*")]


def test_a_step_allocates_nothing_that_stays(street: Any, lens: Lens) -> None:
    tables = LineCircleFilter(Config(), lens)
    frames = list(street)
    for corners, way in frames:
        tables.step(corners, way)
    sizes = []
    tracemalloc.start()
    try:
        for _ in range(5):
            for corners, way in frames[-10:]:
                tables.step(corners, way)
            gc.collect()
            kept = tracemalloc.take_snapshot().filter_traces(OURS)  # other tests may have left threads that allocate
            sizes.append(sum(trace.size for trace in kept.traces))
    finally:
        tracemalloc.stop()
    assert sizes[-1] - sizes[0] < 16384  # 40 steps: not even 100 numbers from each


# Purity


def test_the_same_input_gives_the_same_bytes(street: Any, lens: Lens) -> None:
    once, again = LineCircleFilter(Config(), lens), LineCircleFilter(Config(), lens)
    for corners, way in street:
        assert left_behind(once, once.step(corners, way)) == left_behind(again, again.step(corners, way))


@settings(max_examples=15)
@given(st.lists(st.tuples(st.integers(0, 300), moved, st.integers(0, 3)), min_size=2, max_size=5))
def test_the_same_noise_gives_the_same_bytes(lens: Lens, frames: list[tuple[int, Motion, int]]) -> None:
    once, again = LineCircleFilter(SMALL, lens), LineCircleFilter(SMALL, lens)
    for number, way, seed in frames:
        corners = random_corners(number, lens, seed)
        assert left_behind(once, once.step(corners, way)) == left_behind(again, again.step(corners, way))


def test_the_input_is_left_as_it_was(street: Any, lens: Lens) -> None:
    tables = LineCircleFilter(Config(), lens)
    for corners, way in street:
        before = [each.copy() for each in (corners.pixel, corners.position, corners.appearance, way.rotation)]
        tables.step(corners, way)
        after = (corners.pixel, corners.position, corners.appearance, way.rotation)
        assert all(np.array_equal(*both) for both in zip(before, after, strict=True))


@pytest.mark.parametrize("yaw_rate_radps", [0.0, 0.2])
def test_mirrored_input_gives_mirrored_output(street: Any, lens: Lens, yaw_rate_radps: float) -> None:
    there = replace(street, yaw_rate_radps=yaw_rate_radps)
    tables, mirror = LineCircleFilter(Config(), lens), LineCircleFilter(Config(), lens)
    seen = 0
    for (corners, way), (other_corners, other_way) in zip(there, there.mirrored(), strict=True):
        tables.step(corners, way)
        mirror.step(other_corners, other_way)
        for name in ("normal", "rebel"):
            circles, others = getattr(tables, name), getattr(mirror, name)
            rows, other_rows = (np.flatnonzero(table.active) for table in (circles, others))
            assert len(rows) == len(other_rows), name
            here = np.stack([circles.x, circles.y, circles.radius, circles.trust], axis=1)[rows]
            image = np.stack([lens.width - 1 - others.x, others.y, others.radius, others.trust], axis=1)[other_rows]
            apart = np.abs(here[:, None] - image).max(axis=2)
            assert apart.min(axis=1, initial=np.inf).max(initial=0) < 0.5, name
            assert apart.min(axis=0, initial=np.inf).max(initial=0) < 0.5, name
            seen += len(rows)
        assert tables.psi.count == mirror.psi.count
    assert seen > 100


# Profiles


@pytest.mark.parametrize(
    ("profile", "fps", "speed_mps"), [("rover", 20.0, 2.0), ("rover", 60.0, 2.0), ("paper", 1.0, 0.05)]
)
def test_both_profiles_tell_what_passes_from_what_moves(
    drive: Drive, clutter: Landmarks, box: Landmarks, profile: str, fps: float, speed_mps: float
) -> None:
    """The paper's rover drives at 5 cm/s and takes one frame a second: a fortieth of the time."""
    config = load(settings=[f"filter.profile={profile}", "vehicle.horizon_s=4" if fps > 1 else "vehicle.horizon_s=60"])
    slower = speed_mps / 2.0
    seconds = 1.2 / slower
    rows = drive(clutter(250), speed_mps=speed_mps, fps=fps, frames=int(seconds * fps))
    walker = drive(box((-1.5, -0.6, 5), (0.5, 1.2, 0.3)), slower * np.array([1.2, 0, 0]))
    way = rows + walker
    tables = LineCircleFilter(config, way.lens)
    steps = [tables.step(corners, moved) for corners, moved in way]
    last = steps[-1].sizes
    rebels = way.rebels(tables)
    of_walker = {number for number in rebels if number >= len(rows.points_m)}
    assert last.circles_normal >= 5
    assert max(step.sizes.psi for step in steps) > 0
    assert last.circles_rebel >= 1
    assert len(of_walker) > 0.5 * len(walker.points_m)
    assert len(rebels - of_walker) <= 0.02 * len(rows.points_m)
