"""Turmoil: what tumbles keeps no corner; where none is found again, though it should be, the flow is broken."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Camera, Config, Memory
from lcf_edge.filter import Corners, LineCircleFilter
from lcf_edge.filter.inputs import APPEARANCE_SAMPLES
from lcf_edge.messages import Cause, ObjectClass, ObjectState

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]

CAMERA_M = 0.5
CONFIG = Config(camera=Camera(height_m=CAMERA_M))
AHEAD, ASIDE = (320.0, 260.0), (90.0, 260.0)  # px of an image of 640 x 480; O is in its middle
HALF_PX = 60.0
CORNERS = 60  # of what is in turmoil
FLUTTERING = 250  # about somebody with few corners: hardly one of all is found again


@dataclass(frozen=True)
class Storm:
    """A drive among landmarks, with corners about ``place`` that are other ones in each frame; iterating gives a step.

    ``half_px``: half its side. ``stay``: corners that it keeps from ``stay_from`` on. ``from_seq``, ``until_seq``: only
    from there on, and no more then. ``all_of_it``: of the landmarks none is found again either, as in an image that
    shakes.
    """

    drive: Any
    place: tuple[float, float] = AHEAD
    half_px: float = HALF_PX
    from_seq: int = 4
    until_seq: int = 1000
    stay: int = 0
    stay_from: int = 0
    all_of_it: bool = False

    def __iter__(self) -> Iterator[tuple[Corners, Any]]:
        random, others = np.random.default_rng(0), np.random.default_rng(1)
        kept = (
            np.rint(self.place + others.uniform(-self.half_px, self.half_px - 1, (self.stay, 2))).astype(np.int32),
            others.integers(0, 256, (self.stay, APPEARANCE_SAMPLES), np.uint8),
        )
        for seq, (corners, motion) in enumerate(self.drive):
            there = np.abs(corners.position - self.place).max(axis=1) < self.half_px
            shown = Corners(corners.pixel[~there], corners.position[~there], corners.appearance[~there])
            raging = self.from_seq <= seq < self.until_seq
            if raging:
                pixel = np.rint(self.place + random.uniform(-self.half_px, self.half_px - 1, (CORNERS, 2))).astype(
                    np.int32
                )
                looks = random.integers(0, 256, (CORNERS, APPEARANCE_SAMPLES), np.uint8)
                if seq >= self.stay_from:
                    pixel[: self.stay], looks[: self.stay] = kept
                shown = _with(shown, Corners(pixel, pixel.astype(np.float32), looks))
            if raging and self.all_of_it:
                looks = random.integers(0, 256, shown.appearance.shape, np.uint8)
                shown = Corners(shown.pixel, shown.position, looks)
            yield shown, motion


def _with(some: Corners, more: Corners) -> Corners:
    return Corners(
        np.concatenate([some.pixel, more.pixel]),
        np.concatenate([some.position, more.position]),
        np.concatenate([some.appearance, more.appearance]),
    )


def after(storm: Storm, config: Config = CONFIG) -> tuple[LineCircleFilter, int]:
    """The filter after it, and the number of frames in which it reported a rebel circle without a cause."""
    tables, told = LineCircleFilter(config, storm.drive.lens), 0
    for corners, motion in storm:
        tables.step(corners, motion)
        told += len(reported(tables, config))
    return tables, told


def reported(tables: LineCircleFilter, config: Config = CONFIG) -> list[int]:
    """Rows of rebel circles in turmoil."""
    rebel = tables.rebel
    trusted = rebel.active & (rebel.trust >= config.filter.tr_s) & (rebel.cause == Cause.NONE)
    return np.flatnonzero(trusted).tolist()


@pytest.fixture(scope="module")
def calm(drive: Drive, clutter: Landmarks) -> Any:
    """A rover at 2 m/s among what stands."""
    return drive(clutter(400), sigma_rad=1e-4)


def test_it_is_a_rebel_circle_without_reported_motion(calm: Any) -> None:
    tables, told = after(Storm(calm))
    assert told > 10
    (c,) = reported(tables)
    rebel = tables.rebel
    assert np.hypot(rebel.x[c] - AHEAD[0], rebel.y[c] - AHEAD[1]) < HALF_PX / 2
    assert HALF_PX < rebel.width[c] < 4 * HALF_PX
    assert (rebel.speed[c], rebel.ttc[c]) == (0.0, np.inf)
    assert np.isnan(rebel.lateral[c])


def test_it_is_reported_within_half_a_second_and_forgotten_after_it(calm: Any) -> None:
    _, told = after(Storm(replace(calm, frames=4 + 10)))
    assert told
    tables, _ = after(Storm(replace(calm, frames=40), until_seq=20))
    assert not reported(tables)


def test_its_range_is_that_of_the_ground_under_it(calm: Any) -> None:
    tables, _ = after(Storm(calm))
    (c,) = reported(tables)
    rebel = tables.rebel
    foot_px = rebel.y[c] + rebel.height[c] / 2 - tables.focus[1]
    assert rebel.range[c] == pytest.approx(CAMERA_M * calm.lens.fy / foot_px)
    tables, _ = after(Storm(calm), Config(camera=Camera(height_m=0.0)))
    (c,) = reported(tables)
    assert np.isnan(tables.rebel.range[c])


def test_it_is_an_object_of_which_hardly_more_than_its_place_is_known(calm: Any) -> None:
    tables, _ = after(Storm(calm))
    objects = tables.objects
    (o,) = np.flatnonzero(objects.active & (objects.trust >= CONFIG.filter.tr_s))
    assert np.hypot(objects.x[o] - AHEAD[0], objects.y[o] - AHEAD[1]) < HALF_PX / 2
    assert objects.state[o] == ObjectState.SEEN
    assert objects.class_id[o] in {ObjectClass.UNKNOWN, ObjectClass.STANDING}
    assert objects.range_sigma[o] > 0.1 * objects.range[o]


def test_what_was_to_be_met_and_is_still_in_turmoil_moves_otherwise(
    drive: Drive, clutter: Landmarks, box: Landmarks
) -> None:
    """It looms without bound as its contact comes; then only its place is known."""
    comes = drive(box((0.3, 0.0, 6.0), (0.5, 0.8, 0.2), 30, seed=3), np.array([0.0, 0.0, -0.5]))
    way = replace(drive(clutter(400), sigma_rad=1e-4) + comes, frames=90)
    tables = LineCircleFilter(CONFIG, way.lens)
    objects, ids = tables.objects, set()
    for seq, (plain, stormy) in enumerate(zip(way, Storm(way, half_px=80.0), strict=True)):
        tables.step(*(plain if seq < 26 else stormy))
        for o in np.flatnonzero(objects.active & (objects.trust >= CONFIG.filter.tr_s)):
            ids.add(int(objects.id[o]))
            assert max(objects.width[o], objects.height[o]) < 2 * way.lens.width
            assert objects.range[o] > 0
            assert objects.range_sigma[o] > 0
            assert not objects.closest[o] < 0
    assert ids == {1}
    (o,) = np.flatnonzero(objects.active & (objects.trust >= CONFIG.filter.tr_s))
    assert np.hypot(objects.x[o] - AHEAD[0], objects.y[o] - AHEAD[1]) < HALF_PX / 2


def test_corners_inside_it_expect_no_motion_of_it(calm: Any) -> None:
    """Else the next ones would not be looked for where they are, and it would never end."""
    tables, _ = after(Storm(replace(calm, frames=20)))
    edges = tables.edges
    n = edges.count
    inside = (np.abs(edges.x[:n] - AHEAD[0]) < HALF_PX) & (np.abs(edges.y[:n] - AHEAD[1]) < HALF_PX)
    assert inside.any()
    assert not edges.suspect_keys[:n][inside].any()


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({"until_seq": 4}, id="without it"),
        pytest.param({"until_seq": 5}, id="one bad image"),
        pytest.param({"all_of_it": True}, id="all the image is lost"),
        pytest.param({"place": (620.0, 20.0), "half_px": 20.0}, id="at the image's border"),
    ],
)
def test_other_reasons_to_lose_corners_are_none(calm: Any, changes: dict[str, Any]) -> None:
    assert after(replace(Storm(calm), **changes))[1] == 0


def test_beside_a_fast_vehicle_what_stands_is_lost_too_and_beside_one_that_rests_it_is_not(calm: Any) -> None:
    fast = replace(calm, speed_mps=4.0, fps=8.0)
    assert after(Storm(fast, place=ASIDE))[1] == 0
    resting = replace(calm, speed_mps=0.0, fps=8.0)
    assert after(Storm(resting, place=ASIDE))[1] > 0


def test_the_ground_before_a_fast_vehicle_is_lost_as_well(calm: Any) -> None:
    """An image that shakes has many corners there, and finds few of them again, however far all else is."""
    near = Storm(replace(calm, speed_mps=3.0), place=(320.0, 420.0), half_px=40.0)
    assert after(near)[1] == 0
    assert after(near, Config(camera=Camera(height_m=3.0)))[1] > 0


def test_in_a_quick_turn_it_is_not_looked_for(calm: Any) -> None:
    assert after(Storm(replace(calm, speed_mps=1.0, yaw_rate_radps=1.0)))[1] == 0


def test_where_rebels_show_more_it_is_left_to_them(drive: Drive, clutter: Landmarks, box: Landmarks) -> None:
    """Somebody crosses, whose clothes flutter."""
    walker = drive(box((-0.6, 0.0, 4.0), (0.5, 0.8, 0.2), 10, seed=3), np.array([1.0, 0.0, 0.0]))
    tables = LineCircleFilter(CONFIG, walker.lens)
    causes, raging = set(), 0
    random = np.random.default_rng(0)
    for seq, (corners, motion) in enumerate(drive(clutter(300)) + walker):
        middle = np.nanmean(walker.in_image(seq), axis=0)
        pixel = np.rint(middle + random.uniform(-HALF_PX, HALF_PX, (FLUTTERING, 2))).astype(np.int32)
        looks = random.integers(0, 256, (FLUTTERING, APPEARANCE_SAMPLES), np.uint8)
        tables.step(_with(corners, Corners(pixel, pixel.astype(np.float32), looks)), motion)
        rebel = tables.rebel
        causes |= set(rebel.cause[rebel.active].tolist())
        raging += int((np.asarray(tables._turmoil.place) >= 0).any())
    assert raging > 5
    assert Cause.CROSSING in causes
    assert Cause.NONE not in causes


def test_it_is_turmoil_though_one_edge_in_seven_is_found_again(calm: Any) -> None:
    assert after(Storm(replace(calm, speed_mps=0.0, frames=40), stay=9))[1] > 0


@pytest.mark.parametrize(("stay", "goes_on"), [(13, True), (40, False)], ids=["one in five found", "two in three"])
def test_a_circle_goes_on_while_most_edges_are_still_lost(calm: Any, stay: int, goes_on: bool) -> None:
    """As many as that make no circle, and end none."""
    resting = replace(calm, speed_mps=0.0, frames=40)
    assert not after(Storm(resting, stay=stay))[1]
    tables, _ = after(Storm(resting, stay=stay, stay_from=16))
    assert bool(reported(tables)) == goes_on


@dataclass(frozen=True)
class Cover:
    """A drive among landmarks, and from ``from_seq`` on something plain before a part of the image.

    ``step_px``: by which it comes in from the left in a frame, until it hides all left of ``right_px``. ``leaves``:
    every so-many landmark behind it is seen all the same. ``images``: in which it hides anything.
    """

    drive: Any
    right_px: float = 260.0
    step_px: float = 60.0
    from_seq: int = 12
    leaves: int = 1000
    images: int = 1000

    def __iter__(self) -> Iterator[tuple[Corners, Any]]:
        for seq, (corners, motion) in enumerate(self.drive):
            seen = np.ones(len(corners.pixel), bool)
            if self.from_seq <= seq < self.from_seq + self.images:
                edge_px = min(self.right_px, (seq - self.from_seq + 1) * self.step_px)
                seen = (corners.position[:, 0] > edge_px) | (np.arange(len(seen)) % self.leaves == 0)
            yield Corners(corners.pixel[seen], corners.position[seen], corners.appearance[seen]), motion


def covered(cover: Cover) -> list[bool]:
    """For each frame whether a rebel circle without a cause is reported."""
    tables, told = LineCircleFilter(CONFIG, cover.drive.lens), []
    for corners, motion in cover:
        tables.step(corners, motion)
        told.append(bool(reported(tables)))
    return told


@pytest.fixture(scope="module")
def slow(drive: Drive, clutter: Landmarks) -> Any:
    """A rover at 0.3 m/s among what stands."""
    return drive(clutter(700), sigma_rad=1e-4, speed_mps=0.3, frames=20)


def test_what_comes_before_the_camera_without_a_corner_is_noticed_by_what_it_hides(slow: Any) -> None:
    told = covered(Cover(slow))
    assert not any(told[:12])
    assert any(told[12:18])


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({"from_seq": 100}, id="nothing comes"),
        pytest.param({"right_px": 700.0, "step_px": 700.0}, id="all the image is hidden: it may be the lens"),
        pytest.param({"right_px": 60.0}, id="a narrow thing, far off"),
        pytest.param({"leaves": 3}, id="one in three is seen through it: leaves, or glare"),
    ],
)
def test_other_reasons_to_lose_what_was_trusted_are_none(slow: Any, changes: dict[str, Any]) -> None:
    assert not any(covered(replace(Cover(slow), **changes)))


@pytest.mark.parametrize(("images", "begun"), [(1, False), (6, True)])
def test_what_hides_much_of_a_single_image_may_be_a_fence_passed_closely(slow: Any, images: int, begun: bool) -> None:
    """At ten images a second, where one lasts as long as what comes before the camera must."""
    step_px = 60.0 if begun else 260.0
    passes = Cover(replace(slow, fps=10.0), step_px=step_px, images=images)
    tables, circles = LineCircleFilter(CONFIG, slow.lens), 0
    for corners, motion in passes:
        tables.step(corners, motion)
        circles += int(np.count_nonzero(tables.rebel.active))
    assert (circles > 0) == begun


def test_what_sweeps_over_the_whole_image_is_one_circle_until_it_covers_it_and_then(slow: Any) -> None:
    """A car that crosses right before the camera leaps a quarter of the image in each frame."""
    sweeps = Cover(slow, right_px=700.0, step_px=150.0)
    tables, told = LineCircleFilter(CONFIG, slow.lens), []
    for corners, motion in sweeps:
        tables.step(corners, motion)
        told.append([int(tables.rebel.id[c]) for c in reported(tables)])
    assert told[17]
    assert told[19] == told[17]


@pytest.mark.parametrize("all_of_it", [True, False])
def test_an_image_in_which_hardly_an_edge_is_found_is_covered(calm: Any, all_of_it: bool) -> None:
    tables, _ = after(Storm(calm, all_of_it=all_of_it))
    assert tables._around.is_blind == all_of_it


def test_a_full_table_counts_it(calm: Any) -> None:
    config = Config(camera=Camera(height_m=CAMERA_M), memory=Memory(circles_rebel=1))
    tables = LineCircleFilter(config, calm.lens)
    evicted = 0
    both = zip(Storm(calm), Storm(calm, place=(200.0, 200.0)), strict=True)
    for (corners, motion), (more, _) in both:
        evicted += tables.step(_with(corners, more), motion).sizes.evicted
    assert evicted > 0


@pytest.mark.parametrize("changes", [True, False])
def test_fine_texture_that_keeps_no_corner_is_none_if_the_downscaled_image_stands(calm: Any, changes: bool) -> None:
    """As tree tops or a row of parked motorcycles; what tumbles changes there too."""
    random, tiles = np.random.default_rng(4), np.ones((6, 6), np.uint8)
    small = np.kron(random.integers(0, 256, (10, 14), np.uint8), tiles)[:, :80].copy()
    column, row = (round(each * 80 / 640) - 9 for each in AHEAD)
    tables, told = LineCircleFilter(CONFIG, calm.lens), 0
    for corners, motion in Storm(calm):
        if changes:
            small[row : row + 18, column : column + 18] = np.kron(random.integers(0, 256, (3, 3), np.uint8), tiles)
        tables.step(corners, motion, small=small)
        told += len(reported(tables))
    assert (told > 10) == changes
    assert (told == 0) != changes
