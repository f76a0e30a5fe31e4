"""Matching: cells find what brute force finds; one to one, cheapest first; by looks; through any lens."""

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Filter
from lcf_edge.filter import line_expert, matching
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.image_plane import ImagePlane, project
from lcf_edge.filter.inputs import APPEARANCE_SAMPLES, Corners
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CornerTable, EdgeTable
from lcf_edge.lens import Lens

WIDTH, HEIGHT = 150, 90  # no multiple of the cells
FISHEYE = Lens(640, 480, 330.0, 330.0, 319.5, 239.5, "equidistant", (0.02, -0.01, 0.0, 0.0))
RADIAL = Lens(640, 480, 400.0, 420.0, 325.0, 230.0, "radial-tangential", (-0.28, 0.07, 0.001, -0.0005, 0.0))

pixels = st.lists(st.tuples(st.integers(0, WIDTH - 1), st.integers(0, HEIGHT - 1)), max_size=40)
places = st.lists(st.tuples(st.floats(0, WIDTH - 1), st.floats(0, HEIGHT - 1), st.floats(0.125, 60)), max_size=8)


def random_looks(number: int, seed: int = 0) -> npt.NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (number, APPEARANCE_SAMPLES), np.uint8)


class Frame:
    """The corners of one frame, and the edges that look for them."""

    def __init__(self, lens: Lens, corners: Corners) -> None:
        self.plane = ImagePlane(lens)
        self.corners, self.edges = CornerTable(max(len(corners), 1)), EdgeTable(300, 10, 10)
        self.index = CornerIndex(lens.width, lens.height, max(len(corners), 1))
        self.fill(corners)

    def fill(self, corners: Corners) -> None:
        words = corners.appearance.view(np.uint64)
        matching.take_corners(self.corners.columns, corners.pixel, corners.position, words)
        matching.fill(self.index, self.corners.columns)

    def expect(self, x: Any, y: Any, looks: npt.NDArray[np.uint8], gate: float = 12.0) -> slice:
        """Edges that are predicted there, and were far away before."""
        rows = self.edges.append(len(x))
        self.edges.predicted_x[rows], self.edges.predicted_y[rows] = x, y
        self.edges.x[rows], self.edges.y[rows] = -1e6, -1e6
        self.edges.appearance[rows], self.edges.bl[rows], self.edges.trust[rows] = looks, gate, 5.0
        return rows

    def find(self, slack_px: float = 0.0) -> list[int]:
        """Corner of each edge, -1: none."""
        columns = self.edges.columns, self.corners.columns
        pairs = matching.find(self.index, self.plane, *columns, slack_px, SETTINGS)
        found = self.edges.corner[: self.edges.count]
        assert pairs == np.count_nonzero(found >= 0)
        taken = found[found >= 0]
        assert len(np.unique(taken)) == len(taken)
        assert not self.corners.free[taken].any()
        return [int(row) for row in found]


PINHOLE = Pinhole(500.0, 500.0, 319.5, 239.5)
SETTINGS = Settings(Filter(appearance_max=14.0, appearance_share=100.0), PINHOLE)


# Places


def corners_at(at: list[tuple[int, int]], looks: npt.NDArray[np.uint8] | None = None) -> Corners:
    pixel = np.array(at, np.int32).reshape(-1, 2)
    return Corners(pixel, pixel.astype(np.float32), random_looks(len(at)) if looks is None else looks)


SMALL = Lens(WIDTH, HEIGHT, 100.0, 100.0, 74.5, 44.5)


@given(pixels, places)
def test_corners_are_found_where_brute_force_finds_them(
    at: list[tuple[int, int]], wanted: list[tuple[float, float, float]]
) -> None:
    """Within a round gate, whatever the cells."""
    same = np.full((len(at), APPEARANCE_SAMPLES), 100, np.uint8)
    for x, y, gate in wanted:
        frame = Frame(SMALL, corners_at(at, same))
        frame.expect([x], [y], np.full((1, APPEARANCE_SAMPLES), 100, np.uint8), gate)
        (corner,) = frame.find()
        away = [float(np.hypot(u - x, v - y)) for u, v in at]
        within = [distance for distance in away if distance <= gate]
        assert (corner >= 0) == bool(within)
        if within:
            assert away[corner] == pytest.approx(min(within))


@given(pixels, places, st.floats(0.125, 12))
def test_places_and_corners_coincide_as_brute_force_says(
    at: list[tuple[int, int]], wanted: list[tuple[float, float, float]], reach: float
) -> None:
    frame = Frame(SMALL, corners_at(at))
    frame.corners.psi[: len(at)], frame.corners.expected[: len(at)] = 0, False
    met = [
        bool(line_expert.coincides(frame.index, frame.plane, frame.corners.columns, x, y, reach)) for x, y, _ in wanted
    ]
    places_ = np.array([place[:2] for place in wanted]).reshape(-1, 2)
    near = (np.abs(places_[:, None] - np.array(at).reshape(-1, 2)) <= reach).all(axis=2)
    assert met == near.any(axis=1).tolist()
    assert frame.corners.expected[: len(at)].tolist() == near.any(axis=0).tolist()


def test_an_index_is_filled_anew() -> None:
    frame = Frame(SMALL, corners_at([(0, 0)] * 5))
    for at in ([(3, 4), (100, 80)], [(70, 20)], []):
        frame.fill(corners_at(at))
        start = np.asarray(frame.index.start)
        assert start[0] == 0
        assert start[-1] == len(at)
        assert sorted(np.asarray(frame.index.order)[: len(at)].tolist()) == list(range(len(at)))


@given(pixels)
def test_corners_stand_in_the_order_of_their_cells_and_within_one_in_their_own(at: list[tuple[int, int]]) -> None:
    frame = Frame(SMALL, corners_at(at))
    order = np.asarray(frame.index.order)[: len(at)].tolist()
    cells = [matching.cell_of(frame.index, *pixel) for pixel in at]
    assert order == sorted(range(len(at)), key=lambda row: cells[row])


# One to one


def test_who_is_turned_down_chooses_again() -> None:
    """Two edges like the first corner best; the farther one takes the second."""
    looks = np.repeat(random_looks(1), 2, axis=0)
    frame = Frame(SMALL, corners_at([(50, 50), (58, 50)], looks))
    frame.expect([50, 52], [50, 50], looks)
    assert frame.find() == [0, 1]


def test_the_cheapest_of_all_pairs_is_always_taken() -> None:
    frame = Frame(SMALL, corners_at([(50, 50)], random_looks(1)))
    frame.expect([52, 50, 47], [50, 50, 50], np.repeat(random_looks(1), 3, axis=0))
    assert frame.find() == [-1, 0, -1]


# Looks


def test_difference_is_the_mean_absolute_one() -> None:
    one, other = random_looks(50), random_looks(50, seed=1)
    pixel = [(x % WIDTH, 0) for x in range(50)]
    frame = Frame(SMALL, corners_at(pixel, other))
    frame.expect(np.zeros(50), np.zeros(50), one)
    order = np.asarray(frame.index.order)
    for place in range(50):
        expected = np.abs(one.astype(float)[7] - other[order[place]]).mean()
        assert matching.difference(frame.edges.columns, 7, frame.index, place) == expected


def test_a_faint_corner_must_look_more_alike_than_a_strong_one() -> None:
    settings = Settings(Filter(appearance_max=28.0, appearance_share=0.5), PINHOLE)
    contrast = np.array([0, 4, 10, 30, 127])
    looks = np.where(np.arange(16) % 2, 128 + contrast[:, None], 128 - contrast[:, None]).astype(np.uint8)
    frame = Frame(SMALL, corners_at([]))
    frame.expect(np.zeros(5), np.zeros(5), looks)
    columns = frame.edges.columns
    needed = [matching.likeness_needed(matching.contrast(columns, row), settings) for row in range(5)]
    assert needed == sorted(needed)
    assert needed[0] > 0
    assert needed[-1] == 28.0
    assert needed[2] - needed[1] == pytest.approx(0.5 * (10 - 4))


def crowd(lens: Lens, number: int = 200, seed: int = 3) -> Corners:
    random = np.random.default_rng(seed)
    cell = random.choice((lens.width // 4 - 20) * (lens.height // 4 - 20), number, replace=False)
    columns = lens.width // 4 - 20
    pixel = (40 + 4 * np.stack([cell % columns, cell // columns], axis=1)).astype(np.int32)
    position = lens.undistort_pixels(pixel[:, 0], pixel[:, 1])
    return Corners(pixel, position, random_looks(number, seed))


LENSES = pytest.mark.parametrize(
    "lens",
    [Lens(640, 480, 500.0, 500.0, 319.5, 239.5), FISHEYE, RADIAL],
    ids=["pinhole", "fisheye", "radial-tangential"],
)


@LENSES
def test_every_edge_finds_the_corner_that_looks_like_it(lens: Lens) -> None:
    """Places are of the ideal pinhole, gates are px of the input frame."""
    corners = crowd(lens)
    order = np.random.default_rng(4).permutation(len(corners))
    off = np.random.default_rng(5).uniform(-5, 5, (len(corners), 2))
    at = lens.undistort((corners.pixel + off).astype(np.float32)[order])
    frame = Frame(lens, corners)
    frame.expect(*at.T, corners.appearance[order])
    assert frame.find() == order.tolist()


def test_the_gate_is_round_and_holds_its_border(lens: Lens) -> None:
    looks = random_looks(1)
    for pixel, seen in (((100, 100), True), ((106, 108), True), ((107, 108), False)):
        frame = Frame(lens, corners_at([pixel], looks))
        frame.expect([100], [100], looks, 10.0)
        assert (frame.find() == [0]) is seen


def test_the_uncertainty_of_the_rotation_widens_the_gate(lens: Lens) -> None:
    looks = random_looks(1)
    frame = Frame(lens, corners_at([(115, 100)], looks))
    frame.expect([100], [100], looks, 10.0)
    assert frame.find() == [-1]
    assert frame.find(slack_px=5.0) == [0]


def test_of_equal_looks_the_nearest_wins(lens: Lens) -> None:
    looks = np.repeat(random_looks(1), 3, axis=0)
    frame = Frame(lens, corners_at([(100, 100), (104, 100), (110, 100)], looks))
    frame.expect([103], [100], looks[:1])
    assert frame.find() == [1]


def test_what_looks_different_is_no_match_however_near(lens: Lens) -> None:
    frame = Frame(lens, corners_at([(100, 100)], random_looks(1)))
    frame.expect([100], [100], random_looks(1, seed=9))
    assert frame.find() == [-1]


def test_only_edges_that_are_not_held_and_corners_that_are_free_meet(lens: Lens) -> None:
    corners = crowd(lens, 40)
    frame = Frame(lens, corners)
    rows = frame.expect(*corners.position.T, corners.appearance)
    frame.edges.held[rows] = np.arange(40) % 2 == 1
    frame.corners.free[:40] = np.arange(40) % 3 == 0
    assert frame.find() == [row if row % 6 == 0 else -1 for row in range(40)]


def test_edges_outside_the_image_find_nothing(lens: Lens) -> None:
    corners = crowd(lens, 40)
    frame = Frame(lens, corners)
    frame.expect([-1.0, 640.0, 320.0, np.nan], [240.0, 240.0, 480.0, 240.0], corners.appearance[:4], 640.0)
    assert frame.find() == [-1] * 4


def test_who_finds_nothing_near_its_prediction_looks_farther_around_where_it_was(lens: Lens) -> None:
    """A newborn as far as the leap, another as far as BL at birth, and only what looks twice as alike."""
    looks = random_looks(1)
    for trust, away, seen in ((2.5, 38, True), (2.5, 42, False), (5.0, 11, True), (5.0, 13, False)):
        frame = Frame(lens, corners_at([(300 + away, 200)], looks))
        (row,) = range(300)[frame.expect([100], [100], looks, 5.0)]
        frame.edges.x[row], frame.edges.y[row], frame.edges.trust[row] = 300, 200, trust
        assert (frame.find() == [0]) is seen
    frame.edges.x[row], frame.edges.y[row] = 300 + away, 200
    assert frame.find() == [0]
    frame.edges.rebel[row] = True
    assert frame.find() == [-1]  # what goes its own way is not where it was


@given(st.integers(0, 2**31), st.floats(0, 30))
def test_the_same_input_gives_the_same_pairs(lens: Lens, seed: int, spread: float) -> None:
    corners = crowd(lens, 60, seed)
    at = corners.position + np.random.default_rng(seed).normal(0, spread, corners.position.shape)
    found = []
    for _ in range(2):
        frame = Frame(lens, corners)
        frame.expect(*at.T, corners.appearance // 64 * 64)
        found.append(frame.find())
    assert found[0] == found[1]


# The image


@LENSES
def test_in_the_image_is_what_the_camera_can_see(lens: Lens) -> None:
    edge = np.array([[0, 0], [639, 479], [-2, 240], [641, 240], [320, -2], [320, 481], [320, 240]], np.float32)
    position = lens.undistort(edge)
    expected = [True, True, False, False, False, False, True]
    if lens.is_distorted:  # rounding of the inverse at the very border
        position[:2] += np.array([[0.5, 0.5], [-0.5, -0.5]], np.float32)
    plane = ImagePlane(lens)
    assert [bool(project(plane, *place)) for place in position.tolist()] == expected


@LENSES
@given(st.floats(-900, 900), st.floats(-900, 900))
def test_places_in_the_input_frame_are_those_of_the_lens(lens: Lens, x: float, y: float) -> None:
    plane = ImagePlane(lens)
    at = np.array([[lens.cx + x, lens.cy + y]], np.float32)
    project(plane, *at[0].tolist())
    assert (plane.u, plane.v) == pytest.approx(lens.distort(at)[0].tolist(), abs=1e-3, nan_ok=True)


@given(st.floats(-1e6, 1e6), st.floats(0, 1e6), st.integers(1, 200))
def test_a_place_outside_the_image_has_no_cells_around_it(middle: float, gate: float, cells: int) -> None:
    first, last = matching.first_cell(middle, gate, cells), matching.last_cell(middle, gate, cells)
    assert 0 <= first <= cells
    assert -1 <= last < cells
    met = {cell for cell in range(cells) if cell * 16 <= middle + gate and (cell + 1) * 16 > max(middle - gate, 0)}
    assert met <= set(range(first, last + 1))
