"""Tables: fixed capacities, rows that keep together, the least trusted leaves."""

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.filter.tables import NO_CIRCLE, EdgeTable

COLUMNS = (
    "x",
    "y",
    "beta",
    "speed",
    "bl",
    "trust",
    "deviation",
    "origin_x",
    "origin_y",
    "born_key",
    "circle",
    "suspect_keys",
)


def numbered(rows: int, normal: int = 20, rebel: int = 10, chains: int = 10) -> EdgeTable:
    """Row i holds i in every column."""
    table = EdgeTable(normal, rebel, chains)
    table.append(rows)
    number = np.arange(rows)
    for name in COLUMNS:
        getattr(table, name)[:rows] = number
    table.key_x[:rows] = table.key_y[:rows] = number[:, None]
    table.appearance[:rows] = number[:, None]
    table.suspect_keys[:rows] = 0
    return table


def whole(table: EdgeTable) -> npt.NDArray[np.float64]:
    """The number in each row, the same in all of its columns."""
    n = table.count
    number = table.x[:n].copy()
    for name in COLUMNS[:-1]:
        assert (getattr(table, name)[:n] == number).all(), name
    assert (table.key_x[:n] == number[:, None]).all()
    assert (table.key_y[:n] == number[:, None]).all()
    assert (table.appearance[:n] == number[:, None]).all()
    return number


@given(st.lists(st.booleans(), min_size=1, max_size=30))
def test_the_living_stay_whole_and_packed_when_others_are_removed(dead: list[bool]) -> None:
    table = numbered(len(dead))
    table.remove(np.array(dead))
    assert sorted(whole(table).tolist()) == [row for row, gone in enumerate(dead) if not gone]


def test_new_rows_are_empty_whoever_was_there_before() -> None:
    table = numbered(30)
    table.suspect_keys[:30], table.rebel[:30] = 1, True
    table.remove(np.arange(30) >= 10)
    rows = table.append(20)
    assert (rows.start, rows.stop, table.count) == (10, 30, 30)
    for name in COLUMNS:
        assert (getattr(table, name)[rows] == (NO_CIRCLE if name == "circle" else 0)).all(), name
    assert not table.rebel[rows].any()


def test_a_row_that_moves_into_a_gap_has_its_history() -> None:
    table = numbered(10)
    table.remove(np.arange(10) == 7)
    assert whole(table)[7] == 9


def test_the_least_trusted_leave_the_youngest_of_equals_first() -> None:
    table = numbered(6)
    table.trust[:6] = [5, 2, 3, 2, 2, 4]
    table.born_key[:6] = [0, 7, 1, 9, 8, 1]
    assert table.least_trusted(np.ones(6, bool), 4).tolist() == [3, 4, 1, 2]
    assert table.least_trusted(np.arange(6) != 3, 2).tolist() == [4, 1]


def test_trimming_holds_each_kind_to_its_own_capacity_and_counts() -> None:
    table = numbered(30, normal=20, rebel=10, chains=3)
    table.rebel[:6] = True
    table.suspect_keys[10:18] = 1
    evicted = table.trim()
    n = table.count
    assert n - np.count_nonzero(table.rebel[:n]) == 20
    assert np.count_nonzero(table.rebel[:n]) == 6
    assert np.count_nonzero(table.suspect_keys[:n]) == 3
    assert evicted == 4 + 5
    assert set(whole(table).tolist()) == set(range(30)) - {6, 7, 8, 9}  # trust is the row's number
    assert table.trim() == 0
