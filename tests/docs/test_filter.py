"""The page about the filter names what is there."""

import re
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_constants_that_are_named_exist(text: Callable[[str], str]) -> None:
    sources = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "lcf_edge").rglob("*.py"))
    named = set(re.findall(r"`([A-Z][A-Z_]+)`", text("docs/filter.md")))
    assert named
    assert {name for name in named if not re.search(rf"^{name} = ", sources, re.MULTILINE)} == set()


def test_every_module_of_the_filter_is_described(text: Callable[[str], str]) -> None:
    """Except those that only hold records or what others share."""
    modules = {path.name for path in (ROOT / "lcf_edge/filter").glob("*.py")}
    records = {"__init__.py", "inputs.py", "columns.py", "edge_rows.py"}
    shared = records | {"circles.py", "memory.py", "rounding.py"}
    described = set(re.findall(r"\(\.\./lcf_edge/filter/(\w+\.py)\)", text("docs/filter.md")))
    assert described == modules - shared
