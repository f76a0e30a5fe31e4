"""Values of the last minutes: one point for each message of diagnostics, once a second."""

import math
import threading
from collections import deque
from dataclasses import dataclass
from typing import Self

import msgspec

from lcf_edge.cdr import DiagnosticArray
from lcf_edge.messages import Kind, Scene

POINTS = 300
_MAX_DIGITS = 9  # of a number of rows
TABLES = (
    "objects",
    "corners",
    "edges_normal",
    "edges_rebel",
    "chains",
    "circles_normal",
    "circles_rebel",
    "groups",
    "psi",
)


class Point(msgspec.Struct, frozen=True):
    """Figures at one moment; None: unknown."""

    at_ns: int  # system clock of this machine
    rate_hz: float | None
    latency_p50_ms: float | None
    latency_p99_ms: float | None
    detect_p50_ms: float | None
    filter_p50_ms: float | None
    resident_mib: float | None
    budget_mib: float | None
    temperature_c: float | None
    objects: int | None
    rebels: int | None
    normals: int | None
    psi: int | None
    fill: dict[str, tuple[int, int]]  # rows in use and capacity, by table

    @classmethod
    def of(cls, at_ns: int, scene: Scene | None, rate_hz: float, diagnostics: DiagnosticArray) -> Self:
        """Return the point of one message; ``scene``: the newest one, None: there is no current one."""
        figures = Figures(diagnostics)
        rebels = None if scene is None else int((scene.circles["kind"] == Kind.REBEL).sum())
        return cls(
            at_ns,
            rate_hz if math.isfinite(rate_hz) else None,
            figures.number("pipeline", "latency_p50_ms"),
            figures.number("pipeline", "latency_p99_ms"),
            figures.number("pipeline", "detect_p50_ms"),
            figures.number("pipeline", "filter_p50_ms"),
            figures.number("memory", "resident_mib"),
            figures.number("memory", "budget_mib"),
            figures.number("board", "temperature_c"),
            None if scene is None else len(scene.objects),
            rebels,
            None if scene is None or rebels is None else len(scene.circles) - rebels,
            None if scene is None else len(scene.psi),
            {table: fill for table in TABLES if (fill := figures.fill(table)) is not None},
        )


@dataclass(frozen=True, slots=True)
class Figures:
    """Reads numbers from the texts of a message; None: there is no such number."""

    diagnostics: DiagnosticArray | None

    def text(self, device: str, name: str) -> str:
        """Return a value as it was sent; empty: there is none."""
        statuses = self.diagnostics.status if self.diagnostics is not None else ()
        return next((status.values.get(name, "") for status in statuses if status.name == device), "")

    def number(self, device: str, name: str) -> float | None:
        """Return a finite number; None: there is none."""
        try:
            value = float(self.text(device, name))
        except ValueError:
            return None
        return value if math.isfinite(value) else None

    def fill(self, table: str) -> tuple[int, int] | None:
        """Return the rows in use of a table, and its capacity."""
        rows, _, capacity = self.text("pipeline", f"{table}_fill").partition("/")
        if not (rows.isdecimal() and capacity.isdecimal()) or max(len(rows), len(capacity)) > _MAX_DIGITS:
            return None
        return int(rows), int(capacity)


class Traces:
    """Holds the last ``POINTS`` points."""

    def __init__(self) -> None:
        self._points: deque[Point] = deque(maxlen=POINTS)
        self._lock = threading.Lock()

    def add(self, point: Point) -> None:
        """Keep a point, dropping the oldest if full, and any later ones if the clock was set back."""
        with self._lock:
            while self._points and self._points[-1].at_ns >= point.at_ns:
                self._points.pop()
            self._points.append(point)

    def since(self, at_ns: int) -> list[Point]:
        """Return points later than that, oldest first; all points, if the clock was set back before it."""
        with self._lock:
            was_set_back = bool(self._points) and self._points[-1].at_ns < at_ns
            return [point for point in self._points if point.at_ns > at_ns or was_set_back]
