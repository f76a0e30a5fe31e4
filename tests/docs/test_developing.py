"""docs/developing.md shows the code as it is."""

import re
from pathlib import Path

import pytest

from docs import shape

ROOT = Path(__file__).parents[2]
PAGE = shape.PAGE.read_text(encoding="utf-8")


def test_the_drawing_is_up_to_date() -> None:
    assert shape.DRAWING.read_text(encoding="utf-8") == shape.svg(), "run python docs/shape.py"


def test_the_table_of_columns_is_up_to_date() -> None:
    assert shape.page() == PAGE, "run python docs/shape.py"


def test_every_part_of_the_code_is_in_the_drawing() -> None:
    drawn = {part for layer in shape.LAYERS for part in layer}
    packages = {path.parent.name for path in (ROOT / "lcf_edge").glob("*/__init__.py")}
    assert packages <= drawn


def test_no_arrow_goes_up() -> None:
    layer = {part: number for number, parts in enumerate(shape.LAYERS) for part in parts}
    up = [(part, to) for part, targets in shape.imports().items() for to in targets if layer[to] <= layer[part]]
    assert up == []


def test_an_arrow_that_a_longer_way_implies_is_left_out() -> None:
    arrows = {
        "cli": {"daemon", "pipeline", "config"},
        "daemon": {"pipeline"},
        "pipeline": {"config"},
        "config": {"cli"},
    }
    assert shape.reduced(arrows) == [
        ("cli", "daemon"),
        ("daemon", "pipeline"),
        ("pipeline", "config"),
        ("config", "cli"),
    ]


@pytest.mark.parametrize("path", sorted(set(re.findall(r"`((?:lcf_edge|drivers|hil_mocks|tests)/[\w/.]+)`", PAGE))))
def test_what_a_recipe_names_is_there(path: str) -> None:
    assert "NAME" in path or (ROOT / path).exists()
