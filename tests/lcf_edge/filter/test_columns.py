"""Who writes which column is what the tables say, and the loops know every column by its name."""

import ast
from collections import defaultdict
from pathlib import Path

import pytest

from lcf_edge.filter import tables
from lcf_edge.filter.tables import Column

FILTER = Path(tables.__file__).parent
COLUMNS: dict[str, tuple[Column, ...]] = {
    "EdgeColumns": tables.EDGE_COLUMNS,
    "CircleColumns": tables.CIRCLE_COLUMNS,
    "ObjectColumns": tables.OBJECT_COLUMNS,
    "PsiColumns": tables.PSI_COLUMNS,
    "GroupColumns": tables.GROUP_COLUMNS,
    "CornerColumns": tables.CORNER_COLUMNS,
}
MOVES_ROWS = "edge_rows"
ALIASES = {"words": "appearance"}  # the same memory


def written(module: Path) -> dict[str, set[str]]:
    """Columns that the functions of a module assign to, by the type of the table."""
    columns = defaultdict(set)
    for function in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if not isinstance(function, ast.FunctionDef):
            continue
        kinds = {
            argument.arg: argument.annotation.id
            for argument in function.args.args
            if isinstance(argument.annotation, ast.Name)
        }
        for place in ast.walk(function):
            if not (isinstance(place, ast.Subscript) and isinstance(place.ctx, ast.Store)):
                continue
            match place.value:
                case ast.Attribute(value=ast.Name(id=table), attr=column) if kinds.get(table) in COLUMNS:
                    columns[kinds[table]].add(ALIASES.get(column, column))
    return columns


@pytest.mark.parametrize("kind", COLUMNS)
def test_each_column_is_written_by_the_modules_that_its_table_names(kind: str) -> None:
    writers = defaultdict(set)
    for module in FILTER.glob("*.py"):
        if module.stem != MOVES_ROWS:
            for column in written(module)[kind]:
                writers[column].add(module.stem)
    assert dict(writers) == {column.name: set(column.writers) for column in COLUMNS[kind]}


@pytest.mark.parametrize("kind", COLUMNS)
def test_each_column_is_known_to_the_loops(kind: str) -> None:
    (loops,) = (
        node
        for node in ast.walk(ast.parse((FILTER / "columns.py").read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef) and node.name == kind
    )
    known = {
        node.attr for node in ast.walk(loops) if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
    }
    assert {ALIASES.get(name, name) for name in known - {"count", "live_count", "capacity", "evicted"}} == {
        column.name for column in COLUMNS[kind]
    }


def test_a_copied_edge_takes_all_that_outlives_a_frame_along() -> None:
    copied = written(FILTER / f"{MOVES_ROWS}.py")["EdgeColumns"]
    rewritten = {"predicted_x", "predicted_y", "predicted_speed", "corner", "best", "cost", "psi"}
    assert copied == {column.name for column in tables.EDGE_COLUMNS} - rewritten


@pytest.mark.parametrize("kind", COLUMNS)
def test_each_column_has_a_meaning(kind: str) -> None:
    assert all(column.meaning for column in COLUMNS[kind])
    assert len({column.name for column in COLUMNS[kind]}) == len(COLUMNS[kind])
