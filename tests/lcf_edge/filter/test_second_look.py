"""An edge that the detector does not see again is found where the picture still shows it, and nowhere else."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Filter
from lcf_edge.corners.appearance import appearance, smoothed
from lcf_edge.filter import edge_expert, matching, second_look
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.memory import memory_of
from lcf_edge.filter.second_look import SecondLook
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CircleTable, CornerTable, EdgeTable
from lcf_edge.lens import Lens

LENS = Lens(160, 120, 120.0, 120.0, 79.5, 59.5)
BARREL = Lens(160, 120, 120.0, 120.0, 79.5, 59.5, "radial-tangential", (-0.2, 0.03, 0.0, 0.0))
SETTINGS = Settings(Filter(), Pinhole(120.0, 120.0, 79.5, 59.5))
HERE = (80, 60)
BL_PX = 5.0

Grey = npt.NDArray[np.uint8]


def blobs(seed: int = 3, shift: tuple[float, float] = (0.0, 0.0)) -> Grey:
    """Soft blobs of all sizes, which look different everywhere."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[:120, :160].astype(float)
    picture = np.full((120, 160), 128.0)
    for _ in range(250):
        at_x, at_y, size = random.uniform(0, 160), random.uniform(0, 120), random.uniform(1.5, 4)
        away2 = (x - at_x - shift[0]) ** 2 + (y - at_y - shift[1]) ** 2
        picture += random.uniform(-70, 70) * np.exp(-away2 / (2 * size * size))
    return np.asarray(np.clip(picture, 0, 255), np.uint8)


def bar(shift: tuple[float, float]) -> Grey:
    """A bright line that climbs to the right."""
    y, x = np.mgrid[:120, :160].astype(float)
    away = (x - HERE[0] - shift[0]) * 0.5 + (y - HERE[1] - shift[1]) * 0.866
    return np.asarray(90 + 120 * np.exp(-away * away / 8), np.uint8)


@dataclass
class Scene:
    """One edge, first seen at ``place`` in ``before``; the picture is ``now``. ``predicted``: px of the pinhole."""

    before: Grey
    now: Grey
    others: list[tuple[int, int]] = field(default_factory=list)  # corners that the detector sees now
    lens: Lens = LENS
    place: tuple[int, int] = HERE
    predicted: tuple[float, float] = HERE
    capacity: int = 20

    def __post_init__(self) -> None:
        self.edges, self.corners = EdgeTable(20, 1, 1), CornerTable(self.capacity)
        rows = self.edges.append(1)
        self.edges.predicted_x[rows], self.edges.predicted_y[rows] = self.predicted
        self.edges.appearance[rows] = appearance(smoothed(self.before), np.array([self.place], np.int32))
        self.edges.corner[rows], self.edges.bl[rows], self.edges.trust[rows] = -1, BL_PX, 4.0
        pixel = np.array(self.others, np.int32).reshape(-1, 2)
        words = appearance(smoothed(self.now), pixel).view(np.uint64)
        position = pixel.astype(np.float32)
        matching.take_corners(self.corners.columns, memory_of(pixel), memory_of(position), memory_of(words))
        self.index = CornerIndex(self.lens.width, self.lens.height, self.capacity)
        matching.fill(self.index, self.corners.columns)

    def look(self) -> tuple[float, float] | None:
        """Where the edge is found, px of the ideal pinhole; None: nowhere."""
        found = second_look.find(
            SecondLook(self.lens.width),
            memory_of(smoothed(self.now).reshape(-1)),
            self.index,
            ImagePlane(self.lens),
            self.edges.columns,
            self.corners.columns,
            SETTINGS,
        )
        corner = int(self.edges.corner[0])
        assert (corner >= 0) == (found == 1)
        return (float(self.corners.x[corner]), float(self.corners.y[corner])) if found else None


@given(st.integers(0, 40), st.floats(-2.5, 2.5), st.floats(-2.5, 2.5))
def test_a_place_that_moved_is_found_to_a_part_of_a_pixel(seed: int, right: float, down: float) -> None:
    place = Scene(blobs(seed), blobs(seed, (right, down))).look()
    if place is not None:  # some places are too plain
        assert place == pytest.approx((HERE[0] + right, HERE[1] + down), abs=0.5)


def test_most_places_are_found() -> None:
    found = [Scene(blobs(seed), blobs(seed, (1.6, -1.2))).look() for seed in range(40)]
    assert sum(place is not None for place in found) > 20


@pytest.mark.parametrize("seed", range(8))
def test_behind_a_lens_it_is_placed_where_the_pinhole_would_see_it(seed: int) -> None:
    before, now = BARREL.undistort_pixels(np.array([130, 132]), np.array([95, 96])).tolist()
    scene = Scene(blobs(seed), blobs(seed, (2.0, 1.0)), lens=BARREL, place=(130, 95), predicted=tuple(before))
    assert scene.look() == pytest.approx(tuple(now), abs=0.6)
    assert math.dist(before, now) > 2.6  # 2.2 px of the frame


@pytest.mark.parametrize("shift", [(0.0, 0.0), (2.0, 1.0), (-1.0, 1.5)])
def test_a_line_which_looks_the_same_all_along_is_no_corner(shift: tuple[float, float]) -> None:
    assert Scene(bar((0.0, 0.0)), bar(shift)).look() is None


def test_what_looks_otherwise_is_not_taken() -> None:
    assert Scene(blobs(3), blobs(4)).look() is None


def test_nothing_is_taken_beyond_the_gate() -> None:
    scene = Scene(blobs(), blobs(shift=(3.0, 1.0)))
    scene.edges.bl[0] = 1.5
    assert scene.look() is None


def test_the_corner_of_another_edge_is_not_found_twice() -> None:
    scene = Scene(blobs(), blobs(), others=[(HERE[0] + 2, HERE[1])])
    assert scene.look() is not None
    scene = Scene(blobs(), blobs(), others=[(HERE[0] + 2, HERE[1])])
    scene.corners.free[0] = False
    assert scene.look() is None


def test_where_things_repeat_nothing_is_taken() -> None:
    tile = blobs()[50:70, 70:90]
    paved = np.tile(tile, (6, 8))
    assert Scene(paved, paved).look() is not None
    assert Scene(paved, paved, others=[(HERE[0] + 20, HERE[1])]).look() is None  # the next tile


def test_a_full_table_takes_no_more() -> None:
    assert Scene(blobs(), blobs(), others=[(20, 20)], capacity=1).look() is None


@pytest.mark.parametrize("held", [False, True])
def test_what_lies_under_psi_is_not_looked_for(held: bool) -> None:
    scene = Scene(blobs(), blobs())
    scene.edges.held[0] = held
    assert (scene.look() is None) is held


@given(st.floats(-10, 170), st.floats(-10, 130))
def test_at_the_border_no_place_outside_the_picture_is_looked_at(x: float, y: float) -> None:
    place = Scene(blobs(), blobs(), predicted=(x, y)).look()
    if place is not None:
        assert 7 <= place[0] < 153
        assert 7 <= place[1] < 113


def test_it_costs_trust_and_keeps_the_look_that_the_detector_saw() -> None:
    scene = Scene(blobs(), blobs(shift=(1.0, 0.0)))
    before = scene.edges.appearance[0].copy()
    assert scene.look() is not None
    none = CircleTable(1)
    columns = scene.edges.columns
    scene.edges.x[0], scene.edges.y[0] = HERE
    scene.edges.circle[0] = -1
    edge_expert.update(columns, none.columns, none.columns, scene.corners.columns, 2.5, 0.05, SETTINGS)
    assert scene.edges.matched[0]
    assert scene.edges.trust[0] == 3.5
    assert np.array_equal(scene.edges.appearance[0], before)
