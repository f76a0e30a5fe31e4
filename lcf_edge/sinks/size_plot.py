"""The paper's last figure: rows in use of each table, frame by frame, against the corners of a map."""

import importlib.util
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from drivers.samples import Frame
from lcf_edge.errors import UsageError
from lcf_edge.messages import PipelineScene, Sizes, View
from lcf_edge.sinks import cannot_write, check_output
from lcf_edge.sinks.sink import Sink

SUFFIXES = (".png", ".svg", ".pdf")

_TABLES = {
    "corners": "corners of the frame",
    "edges_normal": "normal edges $E_n$",
    "edges_rebel": "rebel edges $E_r$",
    "chains": r"chains $\alpha$",
    "groups": r"groups $\lambda$",
    "circles_normal": "normal circles $C_n$",
    "circles_rebel": "rebel circles $C_r$",
    "psi": r"regions $\psi$",
    "objects": "objects",
}
_COLOURS = ("#b8860b", "#1f77b4", "#d62728", "#8c564b", "#2ca02c", "#17becf", "#e377c2", "#7f7f7f", "#9467bd")


class SizePlot(Sink):
    """Collects the sizes of the tables and draws them at the end.

    Raises ``UsageError`` when Matplotlib is missing or the name has no known suffix, ``SinkError`` when the
    file cannot be written: at once, not after a long replay.
    """

    name = "plot"

    def __init__(self, path: Path) -> None:
        if importlib.util.find_spec("matplotlib") is None:
            raise UsageError(f"{path}: a plot needs Matplotlib: pip install 'lcf-edge[plot]'")
        check_output(path, SUFFIXES)
        self.path = path
        self._sizes: list[Sizes] = []

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:  # noqa: ARG002
        """Keep the sizes of one frame."""
        self._sizes.append(scene.sizes)

    def close(self) -> None:
        """Draw and write the plot, if there were frames; 1400×800 px as PNG. Raises ``SinkError``."""
        if not self._sizes:
            return
        # Imported here, because Matplotlib takes much memory.
        from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
        from matplotlib.figure import Figure  # noqa: PLC0415
        from matplotlib.ticker import FuncFormatter  # noqa: PLC0415

        frames = np.arange(1, len(self._sizes) + 1)
        piled_up = np.cumsum([sizes.corners for sizes in self._sizes])
        figure = Figure(figsize=(10, 5.71), dpi=140, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        axes.set_yscale("symlog", linthresh=1.0, linscale=0.3)  # logarithmic, but with a place for an empty table
        axes.set(ylim=(-0.15, 2.0 * max(piled_up[-1], 10)), xlim=(1, max(len(frames), 2)))
        ends: list[tuple[float, str, str]] = []
        axes.plot(frames, piled_up, color="black", linewidth=2.2)
        ends.append((float(piled_up[-1]), "a map of every corner", "black"))
        for (name, label), colour in zip(_TABLES.items(), _COLOURS, strict=True):
            rows = np.array([getattr(sizes, name) for sizes in self._sizes])
            axes.plot(frames, rows, color=colour, linewidth=1.3)
            ends.append((float(rows[-1]), label, colour))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
        axes.set_title("Rows kept by the Line-Circle filter and by a map of everything", loc="left")
        axes.set_xlabel("frame")
        axes.set_ylabel("rows (log scale)")
        axes.grid(alpha=0.25, which="major")
        axes.spines[["top", "right"]].set_visible(False)
        figure.draw_without_rendering()  # places the axes, so that heights are known
        to_axes = axes.transData + axes.transAxes.inverted()
        heights = _spread(to_axes.transform([(1.0, value) for value, _, _ in ends])[:, 1], 0.045)
        for (value, label, colour), height in zip(ends, heights, strict=True):
            axes.annotate(
                f"{label}: {value:,.0f}",
                xy=(1.0, height),
                xycoords="axes fraction",
                xytext=(8, 0),
                textcoords="offset points",
                va="center",
                color=colour,
                fontsize=9,
                annotation_clip=False,
            )
        try:
            figure.savefig(self.path)
        except OSError as error:
            raise cannot_write(self.path, error) from error


def _spread(heights: npt.NDArray[np.float64], min_gap: float) -> npt.NDArray[np.float64]:
    """Return heights from 0 up, with neighbours pushed apart to at least ``min_gap``."""
    order = np.argsort(heights, kind="stable")
    placed = heights[order]
    for _ in range(200):
        push = np.maximum(min_gap - np.diff(placed), 0.0) / 2
        placed[1:] += push
        placed[:-1] -= push
        placed = np.maximum(placed, 0.0)
    spread = np.empty_like(placed)
    spread[order] = placed
    return spread
