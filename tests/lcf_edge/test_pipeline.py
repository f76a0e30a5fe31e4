"""The pipeline: images and samples in, scenes out; bounded, repeatable, and honest about what it lacks."""

import gc
import sys
import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Camera, Config, Filter, Memory, Vehicle
from lcf_edge.errors import ConfigError
from lcf_edge.lens import Lens
from lcf_edge.messages import Kind, Scene, Sizes, View
from lcf_edge.pipeline import Pipeline, run
from lcf_edge.recording.read import Recording
from lcf_edge.recording.read.recording import UndecodedFrame

Grey = npt.NDArray[np.uint8]
Item = Frame | ImuSample | SpeedSample
Approach = Callable[..., Any]

DEFAULTS = Config()
PINHOLE = Lens(320, 240, 250.0, 250.0, 159.5, 119.5)
LENSES = {
    "pinhole": PINHOLE,
    "barrel": Lens(320, 240, 180.0, 180.0, 150.0, 125.0, "radial-tangential", (-0.28, 0.07, 0.0002, 1.8e-5)),
    "fisheye": Lens(320, 240, 120.0, 120.0, 159.5, 119.5, "equidistant", (0.0, 0.0, 0.0, 0.0)),
    "wider than a plane image holds": Lens(320, 240, 90.0, 90.0, 159.5, 119.5, "equidistant", (0.0,) * 4),
}
SMALL = Memory(
    corners=200,
    edges_normal=90,
    edges_rebel=20,
    chains=15,
    circles_normal=8,
    circles_rebel=3,
    groups=6,
    psi=2,
)


@dataclass(frozen=True)
class Step:
    """What came of one frame."""

    scene: Scene
    view: View


def outcomes(items: Iterable[Item], config: Config = DEFAULTS, lens: Lens = PINHOLE) -> list[Step]:
    pipeline = Pipeline(config, lens)
    return list(processed(pipeline, items))


def processed(pipeline: Pipeline, items: Iterable[Item]) -> Iterator[Step]:
    for item in items:
        if isinstance(item, Frame):
            yield Step(pipeline.process(item), pipeline.view())
        else:
            pipeline.add(item)


def comparable(scene: Scene) -> tuple[Any, ...]:
    """All of a scene but how long it took, for comparing to the bit."""
    values = (getattr(scene, field.name) for field in fields(scene) if field.name != "timing")
    return tuple(value.tobytes() if isinstance(value, np.ndarray) else repr(value) for value in values)


def capacities(memory: Memory) -> Sizes:
    names = [field.name for field in fields(Sizes) if field.name not in ("omitted", "evicted")]
    return Sizes(**{name: getattr(memory, name) for name in names}, omitted=memory.corners)


def check(outcome: Step, config: Config, lens: Lens) -> None:
    """What holds of every outcome, whatever came in."""
    scene, view = outcome.scene, outcome.view
    sizes, most = scene.sizes, capacities(config.memory)
    for field in fields(Sizes):
        if field.name != "evicted":
            assert 0 <= getattr(sizes, field.name) <= getattr(most, field.name), field.name

    assert (scene.image_width, scene.image_height) == (lens.width, lens.height)
    rows = scene.circles
    assert len(rows) <= sizes.circles_normal + sizes.circles_rebel
    for name in ("x", "y", "radius", "direction", "speed", "trust", "bearing", "elevation"):
        assert np.isfinite(rows[name]).all(), name
    assert (rows["radius"] > 0).all()
    assert (rows["trust"] <= config.filter.tr_max).all()
    assert (rows["trust"] >= config.filter.tr_s).all()
    assert (rows["ttc"] > 0).all()  # inf: none, never NaN
    for kind in Kind:
        ids = rows["id"][rows["kind"] == kind]
        assert len({*ids.tolist()}) == len(ids)
    for region in scene.psi:
        assert np.isfinite([region[name] for name in ("x", "y", "width", "height", "trust")]).all()
        assert min(region["width"], region["height"]) > 0

    assert view.corners.shape == (sizes.corners, 2)
    assert view.omitted.shape == (sizes.corners,)
    assert np.count_nonzero(view.omitted) == sizes.omitted
    assert view.edges.shape == (sizes.edges_normal, 2)
    assert view.rebels.shape == (sizes.edges_rebel, 2)
    assert view.groups.shape == (sizes.groups, 3)
    assert view.edge_group.shape == (sizes.edges_normal,)
    assert view.edge_group.min(initial=-1) >= -1
    assert view.edge_group.max(initial=-1) < sizes.groups
    assert view.focus.shape == (2,)
    for name in ("corners", "edges", "rebels", "groups", "focus"):
        assert getattr(view, name).dtype == np.float32, name
    assert (view.corners >= 0).all()
    assert (view.corners <= (lens.width - 1, lens.height - 1)).all()


# The same in, the same out


def test_the_same_drive_gives_the_same_bytes(approach: Approach) -> None:
    once, again = (outcomes(approach()) for _ in range(2))
    assert [comparable(each.scene) for each in once] == [comparable(each.scene) for each in again]
    assert any(len(each.scene.circles) for each in once)
    assert any(len(each.scene.psi) for each in once)


class Recorded(Recording):
    """A recording in memory."""

    def __init__(self, items: Iterable[Item], lens: Lens | None) -> None:
        super().__init__(Path("memory"))
        self.lens = lens
        self._recorded = list(items)

    def _items(self) -> Iterator[Any]:
        for item in self._recorded:
            if isinstance(item, Frame):
                image = item.image
                yield UndecodedFrame(item.stamp_ns, str(item.seq), lambda image=image: image)
            else:
                yield item


def test_an_image_can_be_looked_at_before_its_samples_have_come(approach: Approach) -> None:
    drive = list(approach())
    pipeline, samples, scenes = Pipeline(DEFAULTS, PINHOLE), [], []
    for item in drive:
        if isinstance(item, Frame):
            look = pipeline.look(item)
            for sample in samples:
                pipeline.add(sample)
            samples.clear()
            scenes.append(pipeline.follow(look))
        else:
            samples.append(item)
    assert [comparable(scene) for scene in scenes] == [comparable(each.scene) for each in outcomes(drive)]


@pytest.mark.parametrize("lens", [PINHOLE, LENSES["barrel"]], ids=["pinhole", "barrel"])
def test_a_replay_is_the_same_as_feeding_the_pipeline_live(approach: Approach, lens: Lens) -> None:
    drive = list(approach(lens=lens))
    live = outcomes(drive, lens=lens)
    replayed = list(run(Recorded(drive, lens), DEFAULTS))
    assert [comparable(outcome.scene) for _, outcome in replayed] == [comparable(each.scene) for each in live]
    assert [(frame.seq, frame.stamp_ns) for frame, _ in replayed] == [
        (each.scene.seq, each.scene.stamp_ns) for each in live
    ]


def test_the_lens_of_the_recording_fits_itself_to_the_images(approach: Approach) -> None:
    lens = LENSES["barrel"]
    drive = list(approach(lens=lens, frames=6))
    double = lens.scaled(640, 480)
    (_, outcome), *_ = run(Recorded(drive, double), Config())
    assert (outcome.scene.image_width, outcome.scene.image_height) == (320, 240)
    assert [comparable(o.scene) for _, o in run(Recorded(drive, double), Config())] == [
        comparable(each.scene) for each in outcomes(drive, lens=double.scaled(320, 240))
    ]


def test_intrinsics_of_the_configuration_come_before_those_of_the_recording(approach: Approach) -> None:
    drive = list(approach(frames=6))
    camera = Camera(width=320, height=240, intrinsics=[250.0, 250.0, 159.5, 119.5])
    wrong = LENSES["fisheye"]
    config = Config(camera=camera)
    assert [comparable(outcome.scene) for _, outcome in run(Recorded(drive, wrong), config)] == [
        comparable(each.scene) for each in outcomes(drive, config)
    ]


# What is missing


def test_a_whole_drive_has_nothing_to_note(approach: Approach) -> None:
    first, *rest = outcomes(approach())
    assert "first frame" in first.scene.notes
    assert {note for each in rest[:5] for note in each.scene.notes} <= {"gyro bias unknown"}
    assert {note for each in rest[5:] for note in each.scene.notes} == set()
    assert [each.scene.vehicle_speed for each in rest] == pytest.approx([2.0] * len(rest))


def test_without_imu_the_result_says_so(approach: Approach) -> None:
    seen = outcomes(approach(imu=False))
    assert all("no imu" in each.scene.notes for each in seen)
    assert any(len(each.scene.circles) for each in seen)


def test_without_speed_the_result_says_so_and_knows_no_distances(approach: Approach) -> None:
    ground_unknown = Config(camera=Camera(height_m=0.0))
    seen = outcomes(approach(odometry=False, imu=False), ground_unknown)
    assert all("no speed" in each.scene.notes for each in seen)
    assert np.isnan([each.scene.vehicle_speed for each in seen]).all()
    circles = np.concatenate([each.scene.circles for each in seen])
    assert (circles["kind"] == Kind.REBEL).any()
    assert np.isnan(circles["range"]).all()
    assert np.isnan(circles["lateral"]).all()


def test_a_constant_speed_needs_no_sensor(approach: Approach) -> None:
    config = Config(vehicle=Vehicle(speed_mps=1.5))
    seen = outcomes(approach(odometry=False, imu=False, frames=4), config)
    assert {each.scene.vehicle_speed for each in seen} == {1.5}
    assert not any("no speed" in each.scene.notes for each in seen)


def test_an_image_without_corners_is_noted_and_the_next_goes_on(approach: Approach) -> None:
    drive = list(approach())
    blank = [
        replace(item, image=np.zeros_like(item.image)) if isinstance(item, Frame) and item.seq == 10 else item
        for item in drive
    ]
    notes = {each.scene.seq: each.scene.notes for each in outcomes(blank)}
    assert {seq for seq, note in notes.items() if "no corners" in note} == {10}


def test_refused_samples_are_counted_with_what_the_recording_skipped(approach: Approach) -> None:
    drive = list(approach(frames=4))
    wild = ImuSample(drive[0].stamp_ns - 1, (1e3, 0.0, 0.0), (0.0, 0.0, 0.0))
    recording = Recorded([wild, *drive, wild], PINHOLE)
    assert len(list(run(recording, Config()))) == 4
    assert recording.skipped == {"imu out of range": 2}
    assert len(list(run(recording, Config()))) == 4
    assert recording.skipped == {"imu out of range": 2}  # each run counts anew


def test_hours_of_samples_before_the_first_image_change_nothing(approach: Approach) -> None:
    drive = list(approach(frames=6))
    start_ns = drive[0].stamp_ns
    before = [ImuSample(start_ns - (5000 - i) * 10_000_000, (0.0, 0.0, 0.0), (0.0, -9.81, 0.0)) for i in range(5000)]
    recording = Recorded([*before, *drive], PINHOLE)
    seen = [outcome.scene for _, outcome in run(recording, Config())]
    assert not recording.skipped
    assert all("no imu" not in scene.notes for scene in seen)


def test_an_image_that_stands_still_is_noted_although_the_odometry_goes_on(approach: Approach) -> None:
    drive = list(approach(imu=False))
    image = next(item.image for item in drive if isinstance(item, Frame))
    frozen = [replace(item, image=image) if isinstance(item, Frame) else item for item in drive]
    *_, last = outcomes(frozen, Config(camera=Camera(height_m=0.3)))
    assert "stands still" in last.scene.notes
    assert last.scene.vehicle_speed == pytest.approx(2.0)  # as reported
    assert not any("stands still" in each.scene.notes for each in outcomes(drive))


# Positions


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_positions_are_px_of_the_input_frame(approach: Approach, lens: Lens) -> None:
    seen = outcomes(approach(lens=lens), lens=lens)
    circles = np.concatenate([each.scene.circles for each in seen])
    assert len(circles) > 10  # the largest circle has an angle, and holds less where a radian has few px
    assert (circles["x"] >= 0).all()
    assert (circles["x"] <= lens.width - 1).all()
    assert (circles["y"] >= 0).all()
    assert (circles["y"] <= lens.height - 1).all()
    assert np.allclose(seen[-1].view.focus, (lens.cx, lens.cy), atol=4.0)  # as far as corners of whole px show it
    for each in seen[5:]:
        kept = each.view.corners[~each.view.omitted]
        estimated = np.concatenate([each.view.edges, each.view.rebels])
        away = np.hypot(*(kept[:, None] - estimated).transpose(2, 0, 1)).min(axis=1)
        assert np.median(away) < 1.5  # most corners have their estimated edge right there


def test_bearings_are_angles_at_the_lens_not_in_the_image(approach: Approach) -> None:
    lens = LENSES["fisheye"]
    circles = np.concatenate([each.scene.circles for each in outcomes(approach(lens=lens, frames=40), lens=lens)])
    ideal = lens.undistort(np.stack([circles["x"], circles["y"]], axis=1))
    bearing, elevation = lens.bearing(ideal[:, 0], ideal[:, 1])
    assert np.allclose(circles["bearing"], bearing, atol=1e-3)
    assert np.allclose(circles["elevation"], elevation, atol=1e-3)
    assert np.abs(circles["bearing"]).max() > 0.5


# Bounds


@pytest.mark.parametrize("memory", [Memory(), SMALL], ids=["shipped", "small"])
@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_no_table_exceeds_its_capacity(approach: Approach, lens: Lens, memory: Memory) -> None:
    config = Config(memory=memory)
    seen = outcomes(approach(lens=lens), config, lens)
    for each in seen:
        check(each, config, lens)
    if memory == SMALL:
        assert sum(each.scene.sizes.evicted for each in seen) > 0


def test_tables_of_one_row_are_tables(approach: Approach) -> None:
    config = Config(memory=Memory(**dict.fromkeys(Memory.__struct_fields__, 1)))
    for each in outcomes(approach(frames=8), config):
        check(each, config, PINHOLE)


def test_the_largest_tables_take_20_000_corners(noise: Callable[..., Grey]) -> None:
    memory = Memory(corners=32767, edges_normal=32767)
    config = Config(memory=memory, filter=Filter(fast_adaptive=False, fast_threshold=8))
    lens = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
    busy, empty = (Frame(0, 0, noise()), Frame(50_000_000, 1, np.zeros((480, 640), np.uint8)))
    seen = outcomes((busy, empty), config, lens)
    for each in seen:
        check(each, config, lens)
    assert seen[0].scene.sizes.corners > 20_000


def test_the_budget_holds_the_tables_or_the_pipeline_is_not_built() -> None:
    bent = replace(LENSES["barrel"].scaled(640, 480))
    needed = sum(Pipeline(Config(), bent).table_bytes().values()) / 2**20
    assert needed > 8 * 640 * 480 / 2**20  # the lens's own table is part of it
    Pipeline(Config(memory=Memory(budget_mib=needed * 1.001)), bent)
    with pytest.raises(ConfigError, match=r"^memory\.budget_mib: .* lower the other keys of memory"):
        Pipeline(Config(memory=Memory(budget_mib=needed * 0.999)), bent)


def test_a_step_keeps_no_memory(noise: Callable[..., Grey]) -> None:
    """Neither Python objects nor arrays; freed arrays below 1 KiB are NumPy's to keep, a few of each size."""
    lens = Lens(64, 48, 50.0, 50.0, 31.5, 23.5)
    pipeline = Pipeline(DEFAULTS, lens)
    images = [noise(seed, 64, 48) for seed in range(4)]
    black = np.zeros((48, 64), np.uint8)

    def drive(first: int, last: int) -> tuple[int, int]:
        """Objects, and bytes of arrays, after frames of noise and a few black ones that empty the tables."""
        for seq in range(first, last):
            stamp_ns = seq * 50_000_000
            for part in range(5):
                sample_ns = stamp_ns - (4 - part) * 10_000_000
                pipeline.add(ImuSample(sample_ns, (0.0, 0.01 * part, 0.0), (0.0, -9.81, 0.0)))
            pipeline.add(SpeedSample(stamp_ns, 1.0, 0.0))
            pipeline.process(Frame(stamp_ns, seq, images[seq % 4] if seq < last - 8 else black))
        gc.collect()
        objects = sys.getallocatedblocks()
        return objects, sum(trace.size for trace in tracemalloc.take_snapshot().traces if trace.size >= 1024)

    tracemalloc.start()
    try:
        drive(0, 30)
        objects, array_bytes = drive(30, 60)
        objects_later, array_bytes_later = drive(60, 210)
    finally:
        tracemalloc.stop()
    assert objects_later - objects < 100  # of 150 frames
    assert array_bytes_later - array_bytes < 4096


# Time


def at_times(approach: Approach, times_ns: Iterable[int], **changed: Any) -> list[Frame]:
    drive = [item for item in approach(imu=False, odometry=False, **changed) if isinstance(item, Frame)]
    return [replace(frame, stamp_ns=ns) for frame, ns in zip(drive, times_ns, strict=False)]


@pytest.mark.parametrize("gap_s", [1.0, 5.0, 3600.0])
def test_after_a_gap_it_goes_on_as_after_a_start(approach: Approach, gap_s: float) -> None:
    config = Config(vehicle=Vehicle(speed_mps=2.0))
    steps = [50_000_000 * i + (round(gap_s * 1e9) if i >= 12 else 0) for i in range(24)]
    seen = outcomes(at_times(approach, steps), config)
    for each in seen:
        check(each, config, PINHOLE)
    assert len(seen[-1].scene.circles) > len(seen[-1].scene.circles[:5])
    assert seen[-1].scene.sizes.edges_normal > 100


def test_repeated_and_earlier_stamps_do_no_harm(approach: Approach) -> None:
    config = Config(vehicle=Vehicle(speed_mps=2.0))
    seen = outcomes(at_times(approach, [0, 0, 0, 50, 100, 100, 60, 150, 200, 0, 0, 250, 300]), config)
    for each in seen:
        check(each, config, PINHOLE)
    assert len(seen) == 13


def test_an_image_that_comes_once_more_is_its_scene_once_more_with_contacts_nearer(approach: Approach) -> None:
    config = Config(vehicle=Vehicle(speed_mps=2.0))
    items = at_times(approach, [number * 60_000_000 for number in range(20)])
    twice: list[Item] = []
    for item in items:
        twice.append(item)
        if isinstance(item, Frame) and item.seq >= 5:  # by then it is known how much images change
            twice.append(replace(item, stamp_ns=item.stamp_ns + 30_000_000))
    seen = outcomes(twice, config)
    new = [each for each in seen if "repeated picture" not in each.scene.notes]
    assert [comparable(each.scene) for each in new] == [comparable(each.scene) for each in outcomes(items, config)]
    approaching = closest = 0
    for before, again in zip(seen[5::2], seen[6::2], strict=True):
        assert again.scene.stamp_ns == before.scene.stamp_ns + 30_000_000
        assert "repeated picture" in again.scene.notes
        for rows, later in ((before.scene.circles, again.scene.circles), (before.scene.objects, again.scene.objects)):
            assert np.array_equal(rows["id"], later["id"])
            np.testing.assert_allclose(later["ttc"], np.maximum(rows["ttc"] - 0.03, 0), rtol=1e-5)
            approaching += int(np.isfinite(rows["ttc"]).sum())
        passing = before.scene.objects["closest"]
        np.testing.assert_allclose(again.scene.objects["closest"], np.maximum(passing - 0.03, 0), rtol=1e-5)
        closest += int(np.isfinite(passing).sum())
    assert min(approaching, closest) > 10


IMAGE_KINDS = st.sampled_from(("wall", "noise", "black", "half"))
STEPS_NS = st.sampled_from((0, 1, 10**6, 33 * 10**6, 5 * 10**7, 10**9, 10**11, -(10**8)))


@settings(max_examples=25, phases=(Phase.explicit, Phase.generate))  # to shrink a drive takes minutes
@given(
    plan=st.lists(st.tuples(IMAGE_KINDS, STEPS_NS), min_size=2, max_size=12),
    lens=st.sampled_from(sorted(LENSES)),
    memory=st.sampled_from((Memory(), SMALL)),
    rates=st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    profile=st.sampled_from(("rover", "paper")),
)
@example(  # standing still, between gaps
    plan=[("wall", 10**11), ("half", 5 * 10**7), ("wall", 5 * 10**7), ("wall", 10**11)],
    lens="pinhole",
    memory=DEFAULTS.memory,
    rates=[0.0, 0.0, 0.0],
    profile="rover",
)
def test_whatever_comes_in_the_outcome_is_in_order(
    approach: Approach,
    noise: Callable[..., Grey],
    plan: list[tuple[str, int]],
    lens: str,
    memory: Memory,
    rates: list[float],
    profile: str,
) -> None:
    drive = approach(lens=LENSES[lens])
    config = Config(memory=memory, filter=Filter(profile=profile))
    pipeline = Pipeline(config, LENSES[lens])
    stamp_ns = 10**12
    for seq, (kind, step_ns) in enumerate(plan):
        image = drive.image(seq) if kind != "noise" else noise(seq, 320, 240)
        if kind in ("black", "half"):
            image[:, : 320 if kind == "black" else 160] = 0
        stamp_ns += step_ns
        pipeline.add(ImuSample(stamp_ns, (rates[0], rates[1], rates[2]), (0.0, -9.81, 0.0)))
        pipeline.add(SpeedSample(stamp_ns, rates[0], rates[1]))
        scene = pipeline.process(Frame(stamp_ns, seq, image))
        check(Step(scene, pipeline.view()), config, LENSES[lens])
