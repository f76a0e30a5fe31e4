"""What leaps across the image is found by the shift that its edges agree on."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Filter
from lcf_edge.filter import leaps, matching
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.image_plane import ImagePlane
from lcf_edge.filter.leaps import Leaps
from lcf_edge.filter.matching import CornerIndex
from lcf_edge.filter.memory import memory_of
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CornerTable, EdgeTable
from lcf_edge.lens import Lens

LENS = Lens(640, 480, 500.0, 500.0, 319.5, 239.5)
SETTINGS = Settings(Filter(), Pinhole(500.0, 500.0, 319.5, 239.5))
REACH_PX = 102.0  # 0.16 of the image's width
RIGHT = np.array([70, 0])

Places = npt.NDArray[np.int64]


def spread(number: int, seed: int = 1) -> Places:
    """Places inside one part of the image, some px apart."""
    cells = np.random.default_rng(seed).choice(49, number, replace=False)
    return np.stack([250 + 9 * (cells % 7), 170 + 9 * (cells // 7)], axis=1)


def looks(number: int, seed: int = 2) -> npt.NDArray[np.uint8]:
    random = np.random.default_rng(seed).integers(0, 256, (number, 16))
    return (random * 0.6 + 50).astype(np.uint8)


@dataclass
class Frame:
    """Edges that were just seen at ``before``, and the corners that are there now."""

    before: Places
    appearance: npt.NDArray[np.uint8]
    after: Places
    seen: npt.NDArray[np.uint8]
    edges: EdgeTable = field(default_factory=lambda: EdgeTable(200, 1, 1))
    corners: CornerTable = field(default_factory=lambda: CornerTable(200))

    def found(self) -> list[int]:
        """The corner of each edge, -1: none."""
        n = len(self.before)
        rows = self.edges.append(n)
        self.edges.x[rows], self.edges.y[rows] = self.before.T
        self.edges.appearance[rows], self.edges.matched[rows], self.edges.corner[rows] = self.appearance, True, -1
        index = CornerIndex(LENS.width, LENS.height, 200)
        pixel = np.ascontiguousarray(self.after, np.int32)
        words = np.ascontiguousarray(self.seen).view(np.uint64)
        columns = self.corners.columns
        matching.take_corners(columns, memory_of(pixel), memory_of(pixel.astype(np.float32)), memory_of(words))
        matching.fill(index, columns)
        leaps.find(Leaps(200), index, ImagePlane(LENS), self.edges.columns, columns, SETTINGS)
        return [int(corner) for corner in self.edges.corner[rows]]


@given(st.floats(Filter().leap_px + 6, REACH_PX - 6), st.floats(0, 2 * np.pi), st.integers(0, 1000))
def test_what_leaps_as_a_whole_is_found(far_px: float, towards_rad: float, seed: int) -> None:
    before, look = spread(12, seed), looks(12, seed)
    shift = np.rint(far_px * np.array([np.cos(towards_rad), np.sin(towards_rad)])).astype(int)
    order = np.random.default_rng(seed).permutation(12)
    found = Frame(before, look, (before + shift)[order], look[order]).found()
    assert found == np.argsort(order).tolist()


def test_a_third_that_is_gone_does_not_hide_the_shift_of_the_others() -> None:
    before, look = spread(12), looks(12)
    found = Frame(before, look, before[:8] + RIGHT, look[:8]).found()
    assert found == [*range(8), -1, -1, -1, -1]


@pytest.mark.parametrize("shift", [(20, 0), (150, 0)])
def test_what_is_near_by_or_too_far_is_not_looked_for(shift: tuple[int, int]) -> None:
    before, look = spread(12), looks(12)
    assert Frame(before, look, before + shift, look).found() == [-1] * 12


def test_corners_that_agree_on_no_shift_are_left_alone() -> None:
    before, look = spread(12), looks(12)
    random = np.random.default_rng(5)
    angle = random.uniform(0, 2 * np.pi, 12)
    after = before + np.rint(random.uniform(50, 95, 12) * [np.cos(angle), np.sin(angle)]).astype(int).T
    assert Frame(before, look, after, look).found() == [-1] * 12


def test_a_pattern_that_repeats_is_left_alone() -> None:
    """Two shifts that explain it equally well are none."""
    before, look = spread(12), looks(12)
    after = np.concatenate([before + RIGHT, before - RIGHT])
    assert Frame(before, look, after, np.concatenate([look, look])).found() == [-1] * 12


def test_where_most_edges_are_found_nothing_is_looked_for() -> None:
    before, look = spread(12), looks(12)
    frame = Frame(before, look, before + RIGHT, look)
    others = frame.edges.append(30)
    frame.edges.x[others], frame.edges.y[others] = 270.0, 200.0
    frame.edges.matched[others], frame.edges.corner[others] = True, 0
    assert frame.found() == [-1] * 12
