"""Every process keeps to its memory, and the budgets agree with what holds processes to them."""

import re
from pathlib import Path

import pytest

from benchmarks.budgets import BUDGETS, Use, measure, tables
from lcf_edge.config import Config

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def used() -> dict[str, Use]:
    return measure(1.0, drive_s=2.0)


@pytest.mark.parametrize("process", BUDGETS)
def test_a_process_keeps_to_its_memory(used: dict[str, Use], process: str) -> None:
    assert 10 < used[process].peak_mib < BUDGETS[process].memory_mib


def test_every_process_was_busy_and_the_daemon_beside_it(used: dict[str, Use]) -> None:
    assert all(use.core_share > 0 for use in used.values())
    alone = {process for process, use in used.items() if use.daemon_share is None}
    assert alone == {"run", "record"}
    assert all(use.daemon_share > 0 for use in used.values() if use.daemon_share is not None)


def test_budgets_are_those_that_configuration_and_unit_enforce() -> None:
    unit = (ROOT / "systemd/lcf-edge-gate.service").read_text(encoding="utf-8")
    assert f"MemoryMax={BUDGETS['gate'].memory_mib:g}M" in unit
    assert BUDGETS["run"].memory_mib == BUDGETS["record"].memory_mib == Config().memory.budget_mib


def test_the_page_of_operation_tells_the_budgets() -> None:
    page = (ROOT / "docs/operation.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `lcf-edge (\w+)` \| (\d+) % \| (\d+) MiB \|", page, re.M)
    assert rows == [
        (process, f"{100 * budget.core_share:g}", f"{budget.memory_mib:g}") for process, budget in BUDGETS.items()
    ]


def test_the_table_has_a_row_for_each_process() -> None:
    (table,) = tables(dict.fromkeys(BUDGETS, Use(0.1, 50.0, None)))
    assert [row[0].partition(":")[0] for row in table.rows] == list(BUDGETS)
    assert {len(row) for row in table.rows} == {len(table.columns)}
