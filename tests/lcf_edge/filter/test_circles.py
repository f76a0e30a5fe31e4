"""A row for a new circle: free, or that of the circle that is trusted least; what does not fit is counted."""

import pytest

from lcf_edge.config import Filter
from lcf_edge.filter import circles as shared
from lcf_edge.filter.flow import Pinhole
from lcf_edge.filter.settings import Settings
from lcf_edge.filter.tables import CircleTable, EdgeTable

SETTINGS = Settings(Filter(), Pinhole(500.0, 500.0, 319.5, 239.5))
NEWBORN = SETTINGS.tr_new


class Table:
    """Circles with these trusts, None: a free row; an edge belongs to each."""

    def __init__(self, *trusts: float | None) -> None:
        self.circles, self.edges = CircleTable(len(trusts)), EdgeTable(len(trusts), 1, 1)
        self.edges.append(len(trusts))
        for row, trust in enumerate(trusts):
            self.edges.circle[row] = row
            self.circles.active[row] = trust is not None
            self.circles.trust[row] = trust or 0.0

    def take(self) -> int:
        return int(shared.row_for_newborn(self.edges.columns, self.circles.columns, False, SETTINGS))

    @property
    def evicted(self) -> int:
        return int(self.circles.columns.evicted)


def test_a_free_row_is_taken_and_nothing_is_evicted() -> None:
    table = Table(NEWBORN - 1, None, None)
    assert table.take() == 1
    assert table.evicted == 0
    assert table.circles.active.tolist() == [True, False, False]


def test_in_a_full_table_the_least_trusted_circle_leaves_and_counts() -> None:
    table = Table(NEWBORN, NEWBORN - 0.25, NEWBORN - 0.5, NEWBORN)
    assert table.take() == 2
    assert table.evicted == 1
    assert table.circles.active.tolist() == [True, True, False, True]
    assert table.edges.circle[:4].tolist() == [0, 1, -1, 3]


@pytest.mark.parametrize("trust", [NEWBORN, NEWBORN + 1])
def test_among_circles_trusted_as_much_there_is_no_row_and_the_new_one_counts(trust: float) -> None:
    table = Table(trust, trust)
    assert [table.take(), table.take()] == [-1, -1]
    assert table.evicted == 2
    assert table.circles.active.all()
