"""The drivers know devices, and nothing of what is made with them."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

DRIVERS = Path(__file__).parents[2] / "drivers"


def imported(source: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module


@pytest.mark.parametrize("source", sorted(DRIVERS.rglob("*.py")), ids=lambda path: str(path.relative_to(DRIVERS)))
def test_a_driver_imports_neither_the_application_nor_its_stand_ins(source: Path) -> None:
    assert not {name for name in imported(source) if name.split(".")[0] in ("lcf_edge", "hil_mocks")}
