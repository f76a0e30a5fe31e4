"""The document of the attacks lists what is attacked."""

from collections.abc import Callable

from tests.fuzz.targets import TARGETS

Rows = Callable[[str, str], list[list[str]]]


def test_every_parser_is_listed(rows: Rows) -> None:
    assert [row[0].strip("`") for row in rows("docs/fuzzing.md", "## Parsers")] == list(TARGETS)
