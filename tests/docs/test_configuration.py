"""The tables of keys tell what the configuration is."""

import re
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path

import msgspec
import pytest
from msgspec import inspect

from lcf_edge.config import PAPER, Config, Filter, ImuDriver, to_toml
from lcf_edge.config.config import PixelFormat

ROOT = Path(__file__).parents[2]
DOCUMENT = "docs/configuration.md"
TABLES = {table.name: table.type for table in msgspec.structs.fields(Config)}
UNITS = {"px", "s", "m", "rad", "mps", "radps", "mib", "hz", "g", "dps"}  # at the end of names
LISTED_ELSEWHERE = {  # choices that tables of other pages explain
    ("camera", "format"): (("auto",), "[format](cameras.md#formats)"),
    ("imu", "driver"): (
        ("none", "iio", "recording"),
        "[chip](imus.md#chips-on-i2c), [serial protocol](serial-imu.md#protocols)",
    ),
}

Rows = Callable[[str, str], list[list[str]]]
Text = Callable[[str], str]


def described(kind: inspect.Type) -> str:
    """What a value may be, as the document writes it; empty: anything of its default's type."""
    match kind:
        case inspect.UnionType():
            return next(described(one) for one in kind.types if not isinstance(one, inspect.NoneType))
        case inspect.LiteralType():
            return ", ".join(f"`{value}`" for value in kind.values)
        case inspect.BoolType() | inspect.StrType():
            return ""
        case inspect.ListType():
            return described_list(kind.item_type)
        case inspect.IntType() | inspect.FloatType():
            return described_range(kind)
    raise AssertionError(kind)


def described_list(item: inspect.Type) -> str:
    if isinstance(item, inspect.ListType):
        return "list of " + described(item).replace("list", "lists", 1)
    name = "texts" if isinstance(item, inspect.StrType) else "numbers"
    return f"list of {name} {described(item)}".strip()


def described_range(kind: inspect.IntType | inspect.FloatType) -> str:
    """Limits as TOML would have them: of integers without a decimal point."""

    def limit(value: float) -> str:
        if isinstance(kind, inspect.IntType):
            return str(value)
        return f"{value:g}" if re.search(r"[.e]", f"{value:g}") else f"{value:g}.0"

    if kind.ge is not None and kind.le is not None:
        return f"{limit(kind.ge)}…{limit(kind.le)}"
    signs = ((">", kind.gt), ("≥", kind.ge), ("<", kind.lt), ("≤", kind.le))
    return ", ".join(f"{sign} {limit(value)}" for sign, value in signs if value is not None)


def values(cells: Iterable[tuple[str, str]]) -> dict[str, object]:
    """Keys and values of code cells."""
    return tomllib.loads("\n".join(f"{key.strip('`')} = {value.strip('`')}" for key, value in cells))


def type_of(table: str, name: str, kind: type) -> str:
    """A key's type as the document writes it."""
    own, link = LISTED_ELSEWHERE.get((table, name), ((), ""))
    return ", ".join([*(f"`{value}`" for value in own), link]) if link else described(inspect.type_info(kind))


@pytest.mark.parametrize("table", TABLES)
def test_every_key_has_its_type_and_default(rows: Rows, table: str) -> None:
    written = {row[0].strip("`"): row for row in rows(DOCUMENT, f"## {table}")}
    types = {field.name: type_of(table, field.name, field.type) for field in msgspec.structs.fields(TABLES[table])}
    assert list(written) == list(types)
    for key, row in written.items():
        *_, suffix = key.split("_")
        unit_in_name = "_" in key and suffix in UNITS and key != "tr_s"  # the paper's Tr_s
        units = {""} if unit_in_name else {"", " px", " edges", " grey levels"}
        assert row[1] in {f"{types[key]}{unit}" for unit in units}, key
    defaults = values((key, row[2]) for key, row in written.items() if row[2] != "unset")
    assert defaults == tomllib.loads(to_toml(Config()))[table]
    assert all(row[3] for row in written.values())


@pytest.mark.parametrize(
    ("table", "key", "choices"),
    [
        ("camera", "format", inspect.type_info(PixelFormat)),
        ("imu", "driver", inspect.type_info(ImuDriver)),
    ],
)
def test_choices_that_other_pages_list_are_all_there(text: Text, table: str, key: str, choices: inspect.Type) -> None:
    assert isinstance(choices, inspect.LiteralType)
    own, link = LISTED_ELSEWHERE[table, key]
    listed: set[str] = set(own)
    for page, heading in re.findall(r"\((\S+)#([\w-]+)\)", link):
        section = next(
            part
            for part in re.split(r"^## ", text(f"docs/{page}"), flags=re.MULTILINE)
            if part.partition("\n")[0].lower().replace(" ", "-") == heading
        )
        listed |= set(re.findall(r"^\| `(\w+)`", section, re.MULTILINE)) if key == "driver" else four_letters(section)
    assert listed == set(choices.values)


def four_letters(section: str) -> set[str]:
    """The formats in the first column of a table."""
    cells = (row.split("|")[1] for row in section.splitlines() if row.startswith("| "))
    return set(re.findall(r"\b(?:p[A-Za-z]{3}|[A-Z0-9]{3,4})\b", " ".join(cells)))


def test_units_of_names_are_explained(text: Text) -> None:
    explained = set(re.findall(r"`_(\w+)`", text(DOCUMENT)))
    used = {field.name.rpartition("_")[2] for table in TABLES.values() for field in msgspec.structs.fields(table)}
    assert explained == UNITS <= used


def test_the_profile_of_the_paper(text: Text) -> None:
    (listed,) = re.findall(r"one frame a second, with (`.*?`)\. ", " ".join(text(DOCUMENT).split()))
    differences = tomllib.loads("\n".join(re.findall(r"`([^`]+)`", listed)))
    assert msgspec.convert({"profile": "paper", **differences}, Filter) == PAPER


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
