"""ψ through whole steps: what it is written on, how long it lasts, what it gives way to."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from lcf_edge.config import Config, Filter, Vehicle
from lcf_edge.filter import LineCircleFilter, line_expert
from lcf_edge.filter.line_circle_filter import Step
from lcf_edge.filter.settings import REFERENCE_FOCAL_PX
from lcf_edge.filter.tables import PsiTable
from lcf_edge.messages import Shape

DEFAULTS = Config()
TR_S, TR_MAX = DEFAULTS.filter.tr_s, DEFAULTS.filter.tr_max

Drive = Callable[..., Any]
Landmarks = Callable[..., npt.NDArray[np.float64]]


def steps(drive: Any, config: Config = DEFAULTS) -> Iterator[tuple[int, LineCircleFilter, Step]]:
    tables = LineCircleFilter(config, drive.lens)
    for seq, (corners, motion) in enumerate(drive):
        yield seq, tables, tables.step(corners, motion)


def ids(tables: LineCircleFilter) -> dict[int, int]:
    """Row of each ψ region by its identity."""
    rows = np.flatnonzero(tables.psi.active)
    return dict(zip(tables.psi.id[rows].tolist(), rows.tolist(), strict=True))


def inside(tables: LineCircleFilter, at: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    """Which places (n, 2) lie inside ψ."""
    line_expert.list_live(tables.psi.columns)
    return np.array([line_expert.psi_at(tables.psi.columns, *place) >= 0 for place in at.tolist()], np.bool_)


@pytest.fixture(scope="session")
def crowd(drive: Drive, clutter: Landmarks) -> Any:
    """Landmarks that stand left and right of the path."""
    return drive(clutter(250))


# Written


def test_what_passes_by_is_omitted_once_it_is_trusted(crowd: Any) -> None:
    omitted = [step.sizes.omitted for _, _, step in steps(crowd)]
    first = next(seq for seq, number in enumerate(omitted) if number)
    assert first >= TR_MAX - TR_S  # a circle gains one a frame
    assert max(omitted) > 50


def test_a_region_is_written_by_a_circle_at_the_most_trust_which_falls_back_to_the_standard(crowd: Any) -> None:
    known: set[int] = set()
    for _, tables, _ in steps(crowd):
        for number, row in ids(tables).items():
            if number not in known:
                circle = tables.psi.circle[row]
                assert tables.psi.trust[row] == TR_MAX
                assert tables.normal.active[circle]
                assert tables.normal.trust[circle] == TR_S
                assert tables.psi.x[row] == tables.normal.x[circle]
                assert tables.psi.y[row] == tables.normal.y[circle]
        known |= ids(tables).keys()
    assert known


def test_two_regions_are_never_of_one_circle(crowd: Any) -> None:
    for _, tables, _ in steps(crowd):
        circle = tables.psi.circle[tables.psi.active]
        assert len(np.unique(circle)) == len(circle)


@pytest.mark.parametrize(
    ("size_m", "shape"),
    [((0.5, 0.5, 0.0), Shape.CIRCLE), ((0.6, 0.08, 0.0), Shape.RECTANGLE)],
    ids=["as high as wide", "long"],
)
def test_a_rectangle_is_taken_where_it_fits_better(
    drive: Drive, box: Landmarks, size_m: tuple[float, float, float], shape: Shape
) -> None:
    middle = (-2.56, -0.51, 8.0)  # of one of the squares in which newborn circles are gathered
    row = drive(box(middle, size_m, landmarks=40), frames=10)
    squares = Config(filter=Filter(bs_px=64 * REFERENCE_FOCAL_PX / row.lens.fx))  # of 64 px in this image
    tables = next(tables for _, tables, _ in steps(row, squares) if tables.psi.active.any())
    assert {Shape(int(shape)) for shape in tables.psi.shape[tables.psi.active]} == {shape}


@pytest.mark.parametrize("right_m", [-0.2, 0.0, 0.2])
def test_nothing_on_the_path_is_omitted_however_far(crowd: Any, drive: Drive, box: Landmarks, right_m: float) -> None:
    """It stands 6 s ahead: no threat yet, but none that may be overlooked."""
    far = drive(box((right_m, -0.4, 12.0), (0.3, 0.7, 0.0)))
    way = crowd + far
    seen = range(len(crowd.points_m), len(way.points_m))
    for seq, tables, _ in steps(way):
        assert not inside(tables, way.in_image(seq)[seen]).any()


def test_a_wide_vehicle_omits_less(crowd: Any) -> None:
    def omitted(half_width_m: float) -> int:
        config = Config(vehicle=Vehicle(half_width_m=half_width_m))
        return sum(step.sizes.omitted for _, _, step in steps(crowd, config))

    assert omitted(0.3) > omitted(1.0) > omitted(3.0) == 0


@pytest.mark.parametrize("speed_mps", [0.0, -1.0, np.nan])
def test_nothing_is_omitted_unless_the_vehicle_is_known_to_drive_forward(crowd: Any, speed_mps: float) -> None:
    drives = np.nan_to_num(speed_mps, nan=1.0)
    tables = LineCircleFilter(DEFAULTS, crowd.lens)
    for corners, motion in replace(crowd, speed_mps=drives):
        assert tables.step(corners, replace(motion, speed_mps=speed_mps)).sizes.psi == 0


# Kept


def test_a_region_goes_along_with_what_it_was_written_on(crowd: Any, psi_at: Callable[..., Any]) -> None:
    held: dict[int, npt.NDArray[np.intp]] = {}
    compared = 0
    for seq, tables, _ in steps(crowd):
        at = crowd.in_image(seq)
        holder = psi_at(tables.psi, *at.T)
        for number, row in ids(tables).items():
            before = held.setdefault(number, np.flatnonzero(holder == row))
            if len(before) >= 6:
                here = tables.psi.x[row], tables.psi.y[row]
                reach = 0.5 * max(tables.psi.width[row], tables.psi.height[row])
                assert np.median(np.hypot(*(at[before] - here).T)) < reach
                compared += 1
    assert compared > 20


def test_a_region_expires_so_that_its_place_is_looked_at_again(crowd: Any) -> None:
    life: dict[int, int] = {}
    for _, tables, _ in steps(crowd):
        for number in ids(tables):
            life[number] = life.get(number, 0) + 1
    frames = DEFAULTS.filter.psi_life_s * crowd.fps
    assert 2 <= max(life.values()) <= frames + 1


def test_edges_under_a_region_keep_their_trust(crowd: Any) -> None:
    """They are only predicted: not seen, but not missed either."""
    before = np.empty(0)
    held = 0
    for _, tables, _ in steps(crowd):
        n = tables.edges.count
        under = tables.edges.held[:n].copy()
        landmark = crowd.landmarks(tables)
        trust = np.full(len(crowd.points_m), -1.0)
        trust[landmark] = np.where(under, tables.edges.trust[:n], -1)
        if len(before):
            both = (trust >= 0) & (before >= 0)
            held += np.count_nonzero(both)
            assert (trust[both] == before[both]).all()
        before = trust
    assert held > 100


# Given up


def test_a_region_never_covers_what_breaks_the_flow(crowd: Any, drive: Drive, box: Landmarks) -> None:
    """A walker comes from behind the clutter, where ψ is."""
    way = crowd + drive(box((-3.5, -0.5, 7), (0.5, 1.2, 0.3)), np.array([1.6, 0, 0]))
    omitted = 0
    for _, tables, step in steps(replace(way, frames=30)):
        edges, n = tables.edges, tables.edges.count
        breaks = edges.rebel[:n] | (edges.suspect_keys[:n] > 0)
        assert not inside(tables, np.stack([edges.x[:n], edges.y[:n]], axis=1)[breaks]).any()
        circles = tables.rebel
        assert not inside(tables, np.stack([circles.x, circles.y], axis=1)[circles.active]).any()
        omitted += step.sizes.omitted
    assert omitted


def loneliest(psi: PsiTable) -> int:
    """The region that is farthest from all others, so that what is in it is in no other."""
    rows = np.flatnonzero(psi.active)
    place = psi.x[rows] + 1j * psi.y[rows]
    away = np.abs(place[:, None] - place)
    np.fill_diagonal(away, np.inf)
    return int(rows[away.min(axis=1).argmax()])


def test_a_region_ends_at_once_where_something_new_appears(crowd: Any) -> None:
    tables = LineCircleFilter(DEFAULTS, crowd.lens)
    for seq, (corners, motion) in enumerate(crowd):
        if tables.psi.active.any():
            row = loneliest(tables.psi)
            number, x, y = tables.psi.id[row], tables.psi.x[row], tables.psi.y[row]
            new = np.array([x, y]) + np.random.default_rng(seq).uniform(-8, 8, (40, 2))
            pixel = np.concatenate([corners.pixel, np.rint(new).astype(np.int32)])
            looks = np.random.default_rng(seq).integers(0, 256, (40, 16), np.uint8)
            both = replace(
                corners,
                pixel=pixel,
                position=pixel.astype(np.float32),
                appearance=np.concatenate([corners.appearance, looks]),
            )
            step = tables.step(both, motion)
            assert number not in ids(tables)
            assert not step.omitted[-40:].any()
            return
        tables.step(corners, motion)
    pytest.fail("no region was written")


def test_a_region_ends_at_once_where_what_was_there_is_hidden(crowd: Any) -> None:
    tables = LineCircleFilter(DEFAULTS, crowd.lens)
    for corners, motion in crowd:
        if tables.psi.active.any():
            number = int(tables.psi.id[np.flatnonzero(tables.psi.active)[0]])
            away = ~inside(tables, corners.position)
            rest = replace(
                corners,
                pixel=corners.pixel[away],
                position=corners.position[away],
                appearance=corners.appearance[away],
            )
            tables.step(rest, motion)
            assert number not in ids(tables)
            return
        tables.step(corners, motion)
    pytest.fail("no region was written")


def test_no_region_is_written_where_trust_cannot_be_won(crowd: Any) -> None:
    few = Config(filter=Filter(circle_support=200))
    assert all(step.sizes.psi == 0 for _, _, step in steps(crowd, few))
