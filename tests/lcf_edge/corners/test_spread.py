"""Which corners are kept: the strongest, none close to another one, from all over the image."""

from collections import Counter

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.corners.detector import SQUARES, side_px, strongest, strongest_spread
from lcf_edge.corners.spread import Squares, find_poor, keep_distinct, leave_poor

SIDE_PX = 40
WIDTH, HEIGHT = 320, 240


def squares(pixel: npt.NDArray[np.int32], side: int = SIDE_PX) -> list[tuple[int, int]]:
    return [(int(x // side), int(y // side)) for x, y in pixel.tolist()]


Samples = npt.NDArray[np.uint8]


def distinct(
    pixel: npt.NDArray[np.int32], strength: npt.NDArray[np.float32], reach: int, samples: Samples | None = None
) -> list[list[int]]:
    """Those of corners that are kept; without ``samples`` all look alike."""
    if samples is None:
        samples = np.tile(EDGE, (len(pixel), 1))
    pixel, looks, beaten = pixel.copy(), samples.copy(), np.empty(len(pixel), np.uint8)
    count = keep_distinct(pixel.data, strength.copy().data, looks.data, looks.view(np.uint64).data, beaten.data, reach)
    return pixel[:count].tolist()


EDGE: Samples = np.repeat(np.array([78, 178], np.uint8), 8)
CORNER: Samples = np.repeat(np.array([78, 178], np.uint8), (6, 10))


@pytest.mark.parametrize(
    ("strength", "kept"),
    [((1, 2), [[13, 5]]), ((2, 1), [[10, 5]]), ((1, 1), [[10, 5]])],
)
def test_of_two_that_lie_close_the_stronger_is_kept_and_of_equals_the_first(
    strength: tuple[float, ...], kept: list[list[int]]
) -> None:
    pixel = np.array([(10, 5), (13, 5)], np.int32)
    assert distinct(pixel, np.array(strength, np.float32), 3) == kept
    assert distinct(pixel, np.array(strength, np.float32), 2) == pixel.tolist()


@pytest.mark.parametrize(("other", "count"), [(EDGE[::-1], 2), (EDGE + np.uint8(2), 1), (CORNER, 1)])
def test_two_that_lie_close_are_kept_where_they_look_different_by_more_than_noise(other: Samples, count: int) -> None:
    pixel, strength = np.array([(10, 5), (12, 6)], np.int32), np.array([1, 2], np.float32)
    assert len(distinct(pixel, strength, 3, np.array([EDGE, other]))) == count


def test_parts_of_an_image_do_not_rival_each_other() -> None:
    pixel = np.array([(10, 40), (12, 39)], np.int32)  # the second part begins above the end of the first
    assert distinct(pixel, np.array([1, 2], np.float32), 3) == pixel.tolist()


@given(
    places=st.sets(st.tuples(st.integers(0, 30), st.integers(0, 30)), max_size=80),
    reach=st.integers(0, 6),
    seed=st.integers(0, 99),
)
def test_who_leaves_has_a_stronger_one_close_and_who_stays_has_none(
    places: set[tuple[int, int]], reach: int, seed: int
) -> None:
    pixel = np.array([(x, y) for y, x in sorted(places)], np.int32).reshape(-1, 2)
    strength = np.random.default_rng(seed).permutation(len(pixel)).astype(np.float32)
    expected = [
        corner
        for corner, own in zip(pixel.tolist(), strength, strict=True)
        if strength[np.abs(pixel - corner).max(axis=1) <= reach].max() == own
    ]
    assert distinct(pixel, strength, reach) == expected


def test_the_strongest_are_kept() -> None:
    pixel = np.array([(5, 5), (6, 9), (9, 6), (100, 100)], np.int32)
    strength = np.array([3, 9, 5, 1], np.float32)
    kept = [
        strongest_spread(Squares(201, 201, SIDE_PX), pixel, strength, capacity).tolist() for capacity in (1, 2, 3, 4)
    ]
    assert kept == [[1], [1, 3], [1, 2, 3], [0, 1, 2, 3]]


@given(
    places=st.sets(st.tuples(st.integers(0, 200), st.integers(0, 200)), min_size=1, max_size=60),
    capacity=st.integers(1, 60),
    seed=st.integers(0, 99),
)
def test_every_square_keeps_its_strongest_and_none_keeps_more_than_its_share(
    places: set[tuple[int, int]], capacity: int, seed: int
) -> None:
    pixel = np.array(sorted(places), np.int32)
    strength = np.random.default_rng(seed).permutation(len(pixel)).astype(np.float32)
    kept = strongest_spread(Squares(201, 201, SIDE_PX), pixel, strength, capacity)
    assert len(kept) == min(capacity, len(pixel))
    assert (np.diff(kept) > 0).all()
    held = np.isin(np.arange(len(pixel)), kept)
    square = squares(pixel)
    had, keeps = Counter(square), Counter(square[row] for row in kept)
    most = max(keeps.values())
    for name in had:
        rows = np.array([each == name for each in square])
        assert keeps[name] >= min(had[name], most - 1)
        weakest_kept = strength[rows & held].min(initial=np.inf)
        assert weakest_kept > strength[rows & ~held].max(initial=-1)


PLACES = st.sets(st.tuples(st.integers(0, 319), st.integers(0, 239)), max_size=80)


def in_image(places: set[tuple[int, int]]) -> npt.NDArray[np.int32]:
    return np.array(sorted(places), np.int32).reshape(-1, 2)


def image() -> Squares:
    return Squares(WIDTH, HEIGHT, side_px(WIDTH, HEIGHT))


BY_ROW = st.lists(st.integers(0, 5), min_size=12, max_size=12)
"""A number for the squares of each row."""


@given(places=PLACES, most=BY_ROW, seed=st.integers(0, 99))
def test_of_every_square_the_strongest(places: set[tuple[int, int]], most: list[int], seed: int) -> None:
    pixel = in_image(places)
    strength = np.random.default_rng(seed).permutation(len(pixel)).astype(np.float32)
    square = squares(pixel, image().side_px)
    looks = np.random.default_rng(seed).integers(0, 256, (len(pixel), 16), np.uint8)
    expected = []
    for row, name in enumerate(square):
        stronger = sum(strength[other] > strength[row] for other, each in enumerate(square) if each == name)
        if stronger < most[name[1]]:
            expected.append((pixel[row].tolist(), float(strength[row]), looks[row].tolist()))
    found = strongest(image(), (pixel.copy(), strength.copy(), looks.copy()), np.array(most, np.int32))
    assert list(zip(*(each.tolist() for each in found), strict=True)) == expected


@given(places=PLACES, few=BY_ROW, without=st.sets(st.integers(0, 191)))
def test_rectangles_cover_the_poor_squares_once_and_nothing_else(
    places: set[tuple[int, int]], few: list[int], without: set[int]
) -> None:
    looked_at, pixel = image(), in_image(places)
    among = np.ones((looked_at.rows, looked_at.columns), np.uint8)
    among.ravel()[list(without)] = 0
    square = np.empty(len(pixel), np.int32)
    count = find_poor(looked_at, pixel.data, square.data, np.array(few, np.int32).data, among.data)
    covered = np.zeros((looked_at.rows * looked_at.side_px, looked_at.columns * looked_at.side_px), np.int32)
    for left, top, right, bottom in np.asarray(looked_at.rectangles)[:count].tolist():
        covered[top:bottom, left:right] += 1
    held = Counter(squares(pixel, looked_at.side_px))
    poor = [
        [int(held[column, row] < few[row] and among[row, column] != 0) for column in range(looked_at.columns)]
        for row in range(looked_at.rows)
    ]
    assert np.array_equal(covered, np.kron(poor, np.ones((looked_at.side_px, looked_at.side_px), np.int32)))
    assert np.asarray(looked_at.poor).reshape(among.shape).tolist() == poor

    rich = [at for at in pixel.tolist() if not poor[at[1] // looked_at.side_px][at[0] // looked_at.side_px]]
    strength = np.zeros(len(pixel), np.float32)
    looks = np.zeros((len(pixel), 16), np.uint8)
    left_over = leave_poor(looked_at, pixel.data, strength.data, looks.view(np.uint64).data, square.data)
    assert pixel[:left_over].tolist() == rich


@given(size=st.tuples(st.integers(160, 4000), st.integers(120, 3000)))
def test_every_image_has_about_as_many_squares(size: tuple[int, int]) -> None:
    assert size[0] * size[1] / side_px(*size) ** 2 == pytest.approx(SQUARES, rel=0.15)
