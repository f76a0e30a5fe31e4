"""A figure to judge a calibration by; needs Matplotlib."""

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lcf_edge.calibrate.result import Result
from lcf_edge.errors import UsageError
from lcf_edge.sinks import cannot_write, check_output

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
BLUE, RED, GREEN = "#1f77b4", "#d62728", "#2ca02c"
AXIS_COLOURS = (RED, GREEN, BLUE)  # x, y, z


def check_report(path: Path, suffixes: Sequence[str] = SUFFIXES) -> None:
    """Refuse a file that cannot be written, before any measurement. Raises ``UsageError``, ``SinkError``."""
    if importlib.util.find_spec("matplotlib") is None:
        raise UsageError(f"{path}: an image needs Matplotlib: pip install 'lcf-edge[plot]'")
    check_output(path, tuple(suffixes))


def save_report(result: Result, path: Path) -> None:
    """Draw ``result``; 1300×600 px as PNG. Raises ``SinkError``."""
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(13, 6), dpi=100, layout="constrained")
    result.paint(figure)
    save_figure(figure, path)


def save_figure(figure: "Figure", path: Path) -> None:
    """Write the figure to a file. Raises ``SinkError``."""
    try:
        figure.savefig(path)
    except OSError as error:
        raise cannot_write(path, error) from error


def plain(axes: "Axes", title: str) -> None:
    """Apply the common style to a plot of curves."""
    axes.set_title(title, loc="left")
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
