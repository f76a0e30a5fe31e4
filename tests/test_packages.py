"""Packages point one way: what is shipped needs nothing that only tests have."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def imported(path: Path) -> Iterator[str]:
    """Modules that a file imports, wherever in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield f"{node.module}"


@pytest.mark.parametrize("package", ["benchmarks", "examples", "hil_mocks", "release", "tests"])
def test_nothing_that_is_shipped_needs(package: str) -> None:
    shipped = (path for name in ("lcf_edge", "drivers") for path in (ROOT / name).rglob("*.py"))
    needing = {str(path.relative_to(ROOT)) for path in shipped if package in {m.split(".")[0] for m in imported(path)}}
    assert needing == set()


def test_drivers_need_nothing_of_the_product() -> None:
    needing = {
        path.name for path in (ROOT / "drivers").rglob("*.py") for m in imported(path) if m.startswith("lcf_edge")
    }
    assert needing == set()


def test_what_renders_a_drive_needs_of_the_product_only_itself_and_what_a_sample_is() -> None:
    needed = {m for path in (ROOT / "lcf_edge/rendered").glob("*.py") for m in imported(path)}
    ours = {m for m in needed if m.split(".")[0] in {"lcf_edge", "drivers"}}
    assert {m for m in ours if m.rpartition(".")[0] != "lcf_edge.rendered"} == {"drivers.samples", "lcf_edge.rendered"}
