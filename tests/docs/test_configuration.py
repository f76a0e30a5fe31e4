"""The tables of keys tell what the configuration is."""

import re
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path

import msgspec
import pytest
from msgspec import inspect

from lcf_edge.config import PAPER, Config, to_toml

ROOT = Path(__file__).parents[2]
DOCUMENT = "docs/configuration.md"
TABLES = {table.name: table.type for table in msgspec.structs.fields(Config)}
UNITS = {"px": "px", "s": "s", "m": "m", "rad": "rad", "mps": "m/s", "radps": "rad/s", "mib": "MiB"}

Rows = Callable[[str, str], list[list[str]]]


def described(kind: inspect.Type) -> str:
    """A type as the document writes it."""
    match kind:
        case inspect.UnionType():
            return next(described(one) for one in kind.types if not isinstance(one, inspect.NoneType))
        case inspect.LiteralType():
            return ", ".join(f"`{value}`" for value in kind.values)
        case inspect.BoolType():
            return "true or false"
        case inspect.StrType():
            return "text"
        case inspect.ListType():
            return "list of " + re.sub(r"^(number|text|list)", r"\1s", described(kind.item_type))
        case inspect.IntType() | inspect.FloatType():
            limits = ((">", kind.gt), ("≥", kind.ge), ("<", kind.lt), ("≤", kind.le))
            name = "integer" if isinstance(kind, inspect.IntType) else "number"
            return f"{name} {', '.join(f'{sign} {limit:g}' for sign, limit in limits if limit is not None)}".strip()
    raise AssertionError(kind)


def values(cells: Iterable[tuple[str, str]]) -> dict[str, object]:
    """Keys and values of code cells."""
    return tomllib.loads("\n".join(f"{key.strip('`')} = {value.strip('`')}" for key, value in cells))


@pytest.mark.parametrize("table", TABLES)
def test_every_key_has_its_type_and_default(rows: Rows, table: str) -> None:
    written = {row[0].strip("`"): row for row in rows(DOCUMENT, f"## {table}")}
    types = {field.name: described(inspect.type_info(field.type)) for field in msgspec.structs.fields(TABLES[table])}
    assert {key: row[1] for key, row in written.items()} == types
    assert list(written) == list(types)
    defaults = values((key, row[3]) for key, row in written.items() if row[3] != "unset")
    assert defaults == tomllib.loads(to_toml(Config()))[table]
    assert all(row[-1] for row in written.values())


def test_the_column_of_the_paper_is_its_profile(rows: Rows) -> None:
    written = rows(DOCUMENT, "## filter")
    assert values((row[0], row[4] or row[3]) for row in written) == msgspec.to_builtins(PAPER)


@pytest.mark.parametrize("table", TABLES)
def test_units_are_those_of_the_names(rows: Rows, table: str) -> None:
    for key, _, unit, *_ in rows(DOCUMENT, f"## {table}"):
        suffix = re.search(r"_([a-z]+)`$", key)
        if suffix and suffix[1] in UNITS and key != "`tr_s`":  # the paper's Tr_s
            assert unit == UNITS[suffix[1]], key


def test_keys_that_are_not_read_are_marked_so(rows: Rows) -> None:
    sources = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "lcf_edge").rglob("*.py"))
    written = [row for table in TABLES for row in rows(DOCUMENT, f"## {table}")]
    marked = {row[0].strip("`") for row in written if "Not read" in row[-1]}
    keys = {row[0].strip("`") for row in written}
    assert marked == {key for key in keys if not re.search(rf"\.{key}\b|get\(\"{key}\"\)", sources)}


@pytest.mark.parametrize("document", sorted((ROOT / "docs").glob("*.md")), ids=lambda path: path.name)
def test_keys_that_are_named_exist(document: Path) -> None:
    for table, key in re.findall(rf"`({'|'.join(TABLES)})\.(\w+)", document.read_text(encoding="utf-8")):
        assert (table, key) == ("zenoh", "open") or key in {f.name for f in msgspec.structs.fields(TABLES[table])}
