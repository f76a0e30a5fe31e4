"""Matching: cells find what brute force finds; one to one, cheapest first; by looks; through any lens."""

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.filter.inputs import APPEARANCE_SAMPLES, Corners
from lcf_edge.filter.matching import (
    CELL_SHIFT,
    CornerIndex,
    Found,
    Matcher,
    difference,
    likeness_needed,
    one_to_one,
)
from lcf_edge.lens import Lens

WIDTH, HEIGHT = 150, 90  # no multiple of the cells
FISHEYE = Lens(640, 480, 330.0, 330.0, 319.5, 239.5, "equidistant", (0.02, -0.01, 0.0, 0.0))

pixels = st.lists(st.tuples(st.integers(0, WIDTH - 1), st.integers(0, HEIGHT - 1)), max_size=40)
places = st.lists(
    st.tuples(st.floats(0, WIDTH - 1, width=32), st.floats(0, HEIGHT - 1, width=32), st.floats(0.125, 60, width=32)),
    max_size=8,
)


def random_looks(number: int, seed: int = 0) -> npt.NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (number, APPEARANCE_SAMPLES), np.uint8)


# Places


def pixel_array(at: list[tuple[int, int]]) -> npt.NDArray[np.int32]:
    return np.array(at, np.int32).reshape(-1, 2)


@given(pixels, places)
def test_candidates_are_those_of_brute_force(
    at: list[tuple[int, int]], wanted: list[tuple[float, float, float]]
) -> None:
    """All corners, once each, whose cell meets the square around a place."""
    index = CornerIndex(WIDTH, HEIGHT)
    index.fill(pixel_array(at))
    x, y, gate = np.array(wanted, np.float32).reshape(-1, 3).T
    found = sorted(zip(*(part.tolist() for part in index.candidates(x, y, gate)), strict=True))
    side = 1 << CELL_SHIFT
    expected = [
        (place, corner)
        for place, corner in itertools.product(range(len(x)), range(len(at)))
        if all(
            cell * side <= middle + gate[place] and middle - gate[place] < (cell + 1) * side
            for middle, cell in zip((x[place], y[place]), (c // side for c in at[corner]), strict=True)
        )
    ]
    assert found == expected


@given(pixels, places, st.floats(0.125, 12, width=32))
def test_places_and_corners_coincide_as_brute_force_says(
    at: list[tuple[int, int]], wanted: list[tuple[float, float, float]], reach: float
) -> None:
    matcher = Matcher(Lens(WIDTH, HEIGHT, 100.0, 100.0, 74.5, 44.5))
    x, y, _ = np.array(wanted, np.float32).reshape(-1, 3).T
    pixel = pixel_array(at)
    near = (np.abs(np.stack([x, y], axis=1)[:, None] - pixel) <= reach).all(axis=2)
    matcher.fill(pixel)
    places_met, corners_met = matcher.coincide(x, y, np.arange(len(pixel)), reach)
    assert places_met.tolist() == near.any(axis=1).tolist()
    assert corners_met.tolist() == near.any(axis=0).tolist()


def test_an_index_is_filled_anew() -> None:
    index = CornerIndex(WIDTH, HEIGHT)
    gate = np.float32(200)
    for at in ([(3, 4), (100, 80)], [(70, 20)], []):
        index.fill(pixel_array(at))
        _, what = index.candidates(np.array([70], np.float32), np.array([40], np.float32), gate)
        assert sorted(what.tolist()) == list(range(len(at)))


# One to one

pairs = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6), st.integers(0, 20)), max_size=30)


def greedy(listed: list[tuple[int, int, int]]) -> list[int]:
    """Cheapest first, the earlier of equals: what each round approaches."""
    edges, corners, chosen = set[int](), set[int](), list[int]()
    for at in sorted(range(len(listed)), key=lambda k: listed[k][2]):
        edge, corner, _ = listed[at]
        if edge not in edges and corner not in corners:
            edges.add(edge)
            corners.add(corner)
            chosen.append(at)
    return chosen


@given(pairs)
def test_pairs_are_one_to_one_and_the_cheapest(listed: list[tuple[int, int, int]]) -> None:
    edge, corner, cost = np.array(listed, np.intp).reshape(-1, 3).T
    arguments = edge, corner, cost.astype(np.float32), 7, 7
    chosen = one_to_one(*arguments)
    assert len(np.unique(edge[chosen])) == len(np.unique(corner[chosen])) == len(chosen)
    assert set(chosen.tolist()) <= set(greedy(listed))
    assert bool(len(chosen)) == bool(listed)
    if listed:
        assert int(np.argmin(cost)) in chosen
    assert one_to_one(*arguments).tolist() == chosen.tolist()


def test_who_is_turned_down_chooses_again() -> None:
    edge, corner = np.array([0, 1, 1]), np.array([0, 0, 1])
    assert one_to_one(edge, corner, np.array([1, 2, 3], np.float32), 2, 2).tolist() == [0, 2]


# Looks


def test_difference_is_the_mean_absolute_one() -> None:
    one, other = random_looks(50), random_looks(50, seed=1)
    expected = np.abs(one.astype(float) - other).mean(axis=1)
    assert difference(one, other) == pytest.approx(expected)
    assert difference(one[:0], other[:0]).shape == (0,)


def test_a_faint_corner_must_look_more_alike_than_a_strong_one() -> None:
    contrast = np.array([0, 4, 10, 30, 127])
    looks = np.where(np.arange(16) % 2, 128 + contrast[:, None], 128 - contrast[:, None]).astype(np.uint8)
    needed = likeness_needed(looks, 28.0, 0.5)
    assert (np.diff(needed) >= 0).all()
    assert needed[0] > 0
    assert needed[-1] == 28.0
    assert needed[2] - needed[1] == pytest.approx(0.5 * (10 - 4))


def pair(matcher: Matcher, x: Any, y: Any, looks: Any, corners: Corners, among: Any = None, **other: Any) -> Found:
    number = len(x)
    free = np.zeros(len(corners), np.bool_)
    free[np.arange(len(corners)) if among is None else np.asarray(among, np.intp)] = True
    matcher.fill(corners.pixel)
    return matcher.pair(
        np.asarray(x, np.float32),
        np.asarray(y, np.float32),
        looks,
        np.full(number, other.get("gate", 12.0), np.float32),
        np.full(number, 14.0, np.float32),
        np.asarray(other.get("wanted", np.ones(number)), np.bool_),
        corners,
        free,
    )


def crowd(lens: Lens, number: int = 200, seed: int = 3) -> Corners:
    random = np.random.default_rng(seed)
    cell = random.choice((lens.width // 4 - 20) * (lens.height // 4 - 20), number, replace=False)
    columns = lens.width // 4 - 20
    pixel = (40 + 4 * np.stack([cell % columns, cell // columns], axis=1)).astype(np.int32)
    position = lens.undistort_pixels(pixel[:, 0], pixel[:, 1])
    return Corners(pixel, position, random_looks(number, seed))


@pytest.mark.parametrize("lens", [Lens(640, 480, 500.0, 500.0, 319.5, 239.5), FISHEYE], ids=["pinhole", "fisheye"])
def test_every_edge_finds_the_corner_that_looks_like_it(lens: Lens) -> None:
    """Places are of the ideal pinhole, gates are px of the input frame."""
    corners = crowd(lens)
    order = np.random.default_rng(4).permutation(len(corners))
    off = np.random.default_rng(5).uniform(-5, 5, (len(corners), 2))
    at = lens.undistort((corners.pixel + off).astype(np.float32)[order])
    found = pair(Matcher(lens), *at.T, corners.appearance[order], corners)
    assert sorted(found.edge.tolist()) == list(range(len(corners)))
    assert (order[found.edge] == found.corner).all()


def test_the_gate_is_round_and_holds_its_border() -> None:
    looks = random_looks(1)
    at = np.array([[100, 100], [106, 108], [107, 108]], np.int32)
    for pixel, seen in zip(at, (True, True, False), strict=True):
        corners = Corners(pixel[None], pixel[None].astype(np.float32), looks)
        found = pair(Matcher(Lens(640, 480, 500, 500, 319.5, 239.5)), [100], [100], looks, corners, gate=10.0)
        assert bool(len(found.edge)) is seen


def test_of_equal_looks_the_nearest_wins(lens: Lens) -> None:
    looks = np.repeat(random_looks(1), 3, axis=0)
    pixel = np.array([[100, 100], [104, 100], [110, 100]], np.int32)
    corners = Corners(pixel, pixel.astype(np.float32), looks)
    assert pair(Matcher(lens), [103], [100], looks[:1], corners).corner.tolist() == [1]


def test_what_looks_different_is_no_match_however_near(lens: Lens) -> None:
    corners = Corners(np.array([[100, 100]], np.int32), np.array([[100, 100]], np.float32), random_looks(1))
    assert len(pair(Matcher(lens), [100], [100], random_looks(1, seed=9), corners).edge) == 0


def test_only_wanted_edges_and_listed_corners_meet(lens: Lens) -> None:
    corners = crowd(lens, 40)
    wanted = np.arange(40) % 2 == 0
    among = np.arange(0, 40, 3)
    found = pair(Matcher(lens), *corners.position.T, corners.appearance, corners, among, wanted=wanted)
    assert found.corner.tolist() == found.edge.tolist()
    assert set(found.corner.tolist()) == set(range(0, 40, 6))


def test_edges_outside_the_picture_find_nothing(lens: Lens) -> None:
    corners = crowd(lens, 40)
    x = np.array([-1.0, 640.0, 320.0, np.nan])
    y = np.array([240.0, 240.0, 480.0, 240.0])
    assert len(pair(Matcher(lens), x, y, corners.appearance[:4], corners, gate=640.0).edge) == 0


@given(st.integers(0, 2**31), st.floats(0, 30))
def test_the_same_input_gives_the_same_pairs(lens: Lens, seed: int, spread: float) -> None:
    corners = crowd(lens, 60, seed)
    at = corners.position + np.random.default_rng(seed).normal(0, spread, corners.position.shape)
    once, again = (pair(Matcher(lens), *at.T, corners.appearance // 64 * 64, corners) for _ in range(2))
    assert once.edge.tolist() == again.edge.tolist()
    assert once.corner.tolist() == again.corner.tolist()


@pytest.mark.parametrize("through", [None, FISHEYE], ids=["pinhole", "fisheye"])
def test_in_frame_is_what_the_camera_can_see(lens: Lens, through: Lens | None) -> None:
    camera = through or lens
    edge = np.array([[0, 0], [639, 479], [-2, 240], [641, 240], [320, -2], [320, 481], [320, 240]], np.float32)
    position = camera.undistort(edge)
    expected = [True, True, False, False, False, False, True]
    if camera.is_distorted:  # rounding of the inverse at the very border
        position[:2] += np.array([[0.5, 0.5], [-0.5, -0.5]], np.float32)
    assert Matcher(camera).in_frame(*position.T).tolist() == expected
