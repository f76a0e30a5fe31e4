"""Line expert: which corners are omitted, which circle gathers which corner, which ψ ends at once."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.filter import line_expert
from lcf_edge.filter.tables import NO_CIRCLE, CircleTable, GroupTable, PsiTable
from lcf_edge.messages import Shape

TR_CR = 2.0

Places = npt.NDArray[np.float32]
PsiAt = Callable[[PsiTable, Places, Places], npt.NDArray[np.int32]]


def f32(*values: float) -> npt.NDArray[np.float32]:
    return np.array(values, np.float32)


def psi(*regions: tuple[Shape, float, float, float, float], active: bool = True) -> PsiTable:
    """ψ with regions (Ty, x, y, width, height)."""
    table = PsiTable(8)
    for row, (shape, x, y, width, height) in enumerate(regions):
        table.shape[row], table.x[row], table.y[row] = shape, x, y
        table.width[row], table.height[row] = width, height
        table.active[row] = active
    return table


def circles(*rows: tuple[float, float, float, float], capacity: int = 8) -> CircleTable:
    """C with circles (x, y, radius, trust)."""
    table = CircleTable(capacity)
    for row, (x, y, radius, trust) in enumerate(rows):
        table.x[row], table.y[row], table.radius[row], table.trust[row] = x, y, radius, trust
        table.active[row] = True
    return table


def collect(groups: GroupTable, normal: CircleTable, rebel: CircleTable) -> int:
    return int(line_expert.collect(groups.columns, normal.columns, rebel.columns, TR_CR))


def gathered(normal: CircleTable, rebel: CircleTable | None = None, capacity: int = 8) -> GroupTable:
    groups = GroupTable(capacity)
    collect(groups, normal, rebel or CircleTable(4))
    return groups


def circle_at(groups: GroupTable, x: Places, y: Places) -> list[int]:
    """Row of the normal circle behind the group that holds each point."""
    return [line_expert.circle_at(groups.columns, *place) for place in zip(x.tolist(), y.tolist(), strict=True)]


# ψ, Ty 0, 1, 2

X, Y = f32(100, 129, 131, 100, 100, 125), f32(50, 50, 50, 69, 71, 65)


def test_type_0_omits_nothing(psi_at: PsiAt) -> None:
    assert (psi_at(psi(), X, Y) == NO_CIRCLE).all()
    assert (psi_at(psi((Shape.CIRCLE, 100, 50, 60, 60), active=False), X, Y) == NO_CIRCLE).all()


def test_type_1_omits_what_is_nearer_than_the_radius(psi_at: PsiAt) -> None:
    assert psi_at(psi((Shape.CIRCLE, 100, 50, 60, 60)), X, Y).tolist() == [0, 0, -1, 0, 0, 0]
    assert psi_at(psi((Shape.CIRCLE, 100, 50, 40, 40)), X, Y).tolist() == [0, -1, -1, 0, -1, -1]


def test_type_2_omits_what_lies_between_the_sides(psi_at: PsiAt) -> None:
    assert psi_at(psi((Shape.RECTANGLE, 100, 50, 60, 40)), X, Y).tolist() == [0, 0, -1, 0, -1, 0]


@pytest.mark.parametrize("shape", Shape)
def test_the_border_itself_is_not_omitted(shape: Shape, psi_at: PsiAt) -> None:
    assert psi_at(psi((shape, 100, 50, 60, 60)), f32(130, 70, 100), f32(50, 50, 80)).tolist() == [-1, -1, -1]


def test_the_regions_that_hold_a_corner_are_its_holders(psi_at: PsiAt) -> None:
    table = psi((Shape.CIRCLE, 100, 50, 60, 60), (Shape.RECTANGLE, 140, 50, 60, 60), (Shape.CIRCLE, 300, 300, 9, 9))
    assert psi_at(table, f32(80, 160, 300, 200, 120), f32(50, 50, 300, 200, 50)).tolist() == [0, 1, 2, -1, 1]


# λ (eq. 1)


def test_a_group_gathers_the_corners_within_its_radius() -> None:
    groups = gathered(circles((100, 50, 30, 3), (300, 50, 10, 3)))
    assert groups.assign(f32(100, 129.9, 130, 305, 315), f32(50, 50, 50, 55, 50)).tolist() == [0, 0, -1, 1, -1]


def test_where_groups_overlap_the_most_trusted_one_gathers() -> None:
    groups = gathered(circles((100, 50, 30, 4), (120, 50, 30, 5), (140, 50, 30, 3)))
    assert circle_at(groups, f32(75, 110, 125, 160), f32(50, 50, 50, 50)) == [0, 1, 1, 2]


def test_only_circles_above_the_critical_trust_make_groups() -> None:
    normal = circles((100, 50, 30, 2.0), (200, 50, 30, 2.5), (300, 50, 30, 5))
    normal.active[2] = False
    groups = gathered(normal)
    assert groups.count == 1
    assert circle_at(groups, f32(100, 200, 300), f32(50, 50, 50)) == [NO_CIRCLE, 1, NO_CIRCLE]


def test_a_rebel_circle_gathers_but_names_no_normal_circle() -> None:
    groups = gathered(circles((100, 50, 30, 3)), circles((200, 50, 30, 4)))
    assert groups.count == 2
    x, y = f32(100, 200), f32(50, 50)
    assert (groups.assign(x, y) >= 0).all()
    assert circle_at(groups, x, y) == [0, NO_CIRCLE]


def test_a_full_table_keeps_the_most_trusted_and_says_how_many_found_no_place() -> None:
    groups = GroupTable(2)
    normal = circles((100, 50, 9, 3), (200, 50, 9, 5), (300, 50, 9, 2.5), (400, 50, 9, 4))
    left = collect(groups, normal, CircleTable(4))
    assert (groups.count, left) == (2, 2)
    assert circle_at(groups, f32(100, 200, 300, 400), f32(50, 50, 50, 50)) == [-1, 1, -1, 3]


def test_without_circles_there_are_no_groups() -> None:
    groups = gathered(CircleTable(4))
    assert groups.count == 0
    assert circle_at(groups, f32(1, 2), f32(3, 4)) == [-1, -1]
    assert groups.assign(f32(), f32()).shape == (0,)


coordinate = st.integers(0, 200)


@given(
    st.lists(st.tuples(coordinate, coordinate, st.integers(1, 80), st.sampled_from([1, 2.5, 3, 4, 5])), max_size=6),
    st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=10),
)
def test_groups_are_those_of_equation_1(
    rows: list[tuple[float, float, float, float]], at: list[tuple[int, int]]
) -> None:
    groups = gathered(circles(*rows))
    x, y = f32(*(p[0] for p in at)), f32(*(p[1] for p in at))
    for place, row in zip(at, circle_at(groups, x, y), strict=True):
        trusts = [
            trust for cx, cy, bs, trust in rows if trust > TR_CR and (place[0] - cx) ** 2 + (place[1] - cy) ** 2 < bs**2
        ]
        assert (row == NO_CIRCLE) == (not trusts)
        if trusts:
            assert rows[row][3] == max(trusts)


# What is not as predicted ends ψ


def ends(*, edges: int, missing: int = 0, new: int = 0) -> bool:
    """Whether ψ ends over so many edges; so many have no corner, and so many corners have no edge."""
    table = psi((Shape.CIRCLE, 100, 50, 60, 60), (Shape.CIRCLE, 300, 50, 60, 60))
    table.edges[0], table.missing[0], table.new[0] = edges, missing, new
    line_expert.end_surprised(table.columns)
    assert table.active[1]
    return not table.active[0]


def test_a_region_that_looks_as_predicted_goes_on() -> None:
    assert not ends(edges=20)
    assert not ends(edges=20, missing=2, new=2)
    assert not ends(edges=0)


def test_a_region_ends_when_something_hides_what_was_there() -> None:
    assert ends(edges=20, missing=18)
    assert ends(edges=20, missing=20)


def test_a_region_ends_when_something_new_comes_in() -> None:
    assert ends(edges=20, new=30)
    assert ends(edges=0, new=12)


def test_a_region_ends_when_something_else_takes_the_place_in_equal_number() -> None:
    assert ends(edges=20, missing=16, new=16)
