"""What a calibration returns, and how it refuses."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lcf_edge.errors import LcfError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Value = str | int | float | list[float] | list[list[float]] | list[list[list[float]]]


class CalibrationError(LcfError):
    """The data do not determine the result; the text says why and what to do."""


@dataclass(frozen=True)
class Result:
    """``findings``: lines by which to judge the result; ``values``: keys of one ``table`` of the configuration."""

    findings: tuple[str, ...]
    table: str
    values: Mapping[str, Value]
    paint: "Callable[[Figure], None]"  # draws the report
