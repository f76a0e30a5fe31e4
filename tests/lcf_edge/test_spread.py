"""Which corners are kept when there are too many: the strongest, from all over the picture."""

from collections import Counter

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.spread import FEW, SQUARES, Squares, strongest_spread

SIDE_PX = 40


def squares(pixel: npt.NDArray[np.int32], side_px: int = SIDE_PX) -> list[tuple[int, int]]:
    return [(int(x // side_px), int(y // side_px)) for x, y in pixel.tolist()]


def test_the_strongest_are_kept() -> None:
    pixel = np.array([(5, 5), (6, 9), (9, 6), (100, 100)], np.int32)
    strength = np.array([3, 9, 5, 1], np.float32)
    kept = [strongest_spread(pixel, strength, capacity, SIDE_PX).tolist() for capacity in (1, 2, 3, 4)]
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
    kept = strongest_spread(pixel, strength, capacity, SIDE_PX)
    assert len(kept) == min(capacity, len(pixel))
    assert (np.diff(kept) > 0).all()
    held = np.isin(np.arange(len(pixel)), kept)
    square = squares(pixel)
    had, keeps = Counter(square), Counter(square[row] for row in kept)
    most = max(keeps.values())
    for name in had:
        rows = np.array([each == name for each in square])
        assert keeps[name] >= min(had[name], most - 1)
        weakest_held = strength[rows & held].min(initial=np.inf)
        assert weakest_held > strength[rows & ~held].max(initial=-1)


PLACES = st.sets(st.tuples(st.integers(0, 319), st.integers(0, 239)), max_size=80)


def in_picture(places: set[tuple[int, int]]) -> npt.NDArray[np.int32]:
    return np.array(sorted(places), np.int32).reshape(-1, 2)


@given(places=PLACES, most=st.integers(1, 5), seed=st.integers(0, 99))
def test_of_every_square_the_strongest(places: set[tuple[int, int]], most: int, seed: int) -> None:
    picture, pixel = Squares(320, 240, 700), in_picture(places)
    strength = np.random.default_rng(seed).permutation(len(pixel)).astype(np.float32)
    strongest = picture.strongest(pixel, strength, most)
    assert (np.diff(strongest) > 0).all()
    square = squares(pixel, picture.side_px)
    for name in set(square):
        rows = sorted((row for row, each in enumerate(square) if each == name), key=lambda row: -strength[row])
        assert [row for row in rows if row in strongest] == rows[:most]


@given(places=PLACES)
def test_runs_cover_the_poor_squares_once_and_nothing_else(places: set[tuple[int, int]]) -> None:
    picture, pixel = Squares(320, 240, 700), in_picture(places)
    poor = picture.poor(pixel)
    covered = np.zeros((240, 320), np.int32)
    for left, top, right, bottom in picture.runs(poor):
        covered[top:bottom, left:right] += 1
    every = np.stack(np.meshgrid(np.arange(320), np.arange(240)), axis=-1).reshape(-1, 2).astype(np.int32)
    assert np.array_equal(covered.ravel(), picture.at(poor, every))
    held = Counter(squares(pixel, picture.side_px))
    assert [bool(each) for each in picture.at(poor, pixel)] == [
        held[name] < FEW for name in squares(pixel, picture.side_px)
    ]


@given(size=st.tuples(st.integers(160, 4000), st.integers(120, 3000)), target=st.integers(200, 4000))
def test_every_picture_has_about_as_many_squares(size: tuple[int, int], target: int) -> None:
    picture = Squares(*size, target)
    assert size[0] * size[1] / picture.side_px**2 == pytest.approx(SQUARES, rel=0.15)
    assert picture.most == pytest.approx(4 * target / SQUARES, abs=0.5)
