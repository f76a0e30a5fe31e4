"""The points that docs/planners.md gives to a costmap lie where the circles are."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from lcf_edge.records import CIRCLE, Kind


@pytest.fixture(scope="module")
def points(blocks: Callable[[str, str], list[str]]) -> Any:
    (code,) = (block for block in blocks("docs/planners.md", "python") if "def points" in block)
    names: dict[str, Any] = {}
    exec(code, names)
    return names["points"]


def circle(**fields: float) -> np.ndarray[Any, Any]:
    row = np.zeros(1, CIRCLE)
    row["kind"] = Kind.REBEL
    for name, value in fields.items():
        row[name] = value
    return row


def test_what_is_right_and_above_is_ahead_to_the_right_and_up(points: Any) -> None:
    found = points(circle(range=4.0, bearing=np.arctan(0.25), elevation=np.arctan(0.1), radius=27.7))
    np.testing.assert_allclose(found[:, 0], 4.0)
    np.testing.assert_allclose(found[:, 1], np.linspace(-1.2, -0.8, 5), atol=1e-3)
    np.testing.assert_allclose(found[:, 2], 0.4, atol=1e-6)


def test_what_passes_or_has_no_range_is_no_obstacle(points: Any) -> None:
    assert points(circle(range=np.nan)).shape == (0, 3)
    assert points(circle(kind=Kind.NORMAL, range=2.0)).shape == (0, 3)
