"""docs/api.md shows the public modules as they are."""

import pytest

from docs import api
from lcf_edge import client

PAGE = api.PAGE.read_text(encoding="utf-8")


def test_the_page_is_up_to_date() -> None:
    assert api.page() == PAGE, "run python docs/api.py"


@pytest.mark.parametrize("name", client.__all__)
def test_all_that_a_planner_imports_is_described(name: str) -> None:
    assert f"\n### {name}\n" in PAGE


@pytest.mark.parametrize("name", [name for module, names in api.PARTS for name in names])
def test_every_entry_says_what_it_is(name: str) -> None:
    _, _, entry = PAGE.partition(f"\n### {name}\n\n")
    assert len(entry.partition("\n### ")[0]) > 40
