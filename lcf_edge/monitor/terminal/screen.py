"""The terminal's contents: as much as fits, the most urgent first."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
import numpy.typing as npt
from rich.console import Console, ConsoleOptions, RenderResult
from rich.text import Text

from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import Cause, Kind, ObjectClass, ObjectState
from lcf_edge.monitor.live.monitor import Presence, Snapshot
from lcf_edge.monitor.live.traces import TABLES, Figures
from lcf_edge.printable import printable

STALE_S = 1.0  # older scenes are stale
_TABLE_HEAD = 2  # lines: how many there are, the names of the columns
_MAX_ILL_DEVICES = 100  # devices with problems that are listed at most, the worst first
_MIN_CIRCLES = 3  # shown before anything below them
_PROBABLY = 0.5

_LEVELS = {Level.OK: "green", Level.WARN: "yellow", Level.ERROR: "bold red", Level.STALE: "bold yellow"}
_WORST_FIRST = (Level.ERROR, Level.STALE, Level.WARN)
_CAUSES = {Cause.NONE: "rebel", Cause.CROSSING: "crossing", Cause.INCOMING: "incoming", Cause.LEADING: "leading"}


@dataclass(frozen=True, slots=True)
class Column:
    """One value of an object or a circle."""

    name: str
    min_columns: int  # a narrower terminal goes without it
    text: Callable[[np.void], str]
    columns: int | None = None  # least width, so that columns do not move; None: that of its name


def _figure(
    field: str, digits: int, factor: float = 1.0, *, sign: bool = False, sigma: bool = False
) -> Callable[[np.void], str]:
    """``sigma``: with that of the figure, if it is known."""

    def text(row: np.void) -> str:
        value = float(row[field]) * factor
        if not math.isfinite(value):
            return "-"
        spread = float(row[f"{field}_sigma"]) * factor if sigma else math.nan
        return f"{value:{'+' if sign else ''}z.{digits}f}" + (f" ±{spread:.{digits}f}" if math.isfinite(spread) else "")

    return text


def _circle_name(circle: np.void) -> str:
    return _CAUSES[Cause(circle["cause"])] if circle["kind"] == Kind.REBEL else "normal"


def _object_name(thing: np.void) -> str:
    return ObjectClass(thing["class_id"]).name.lower().replace("_", " ")


OBJECT_COLUMNS = (
    Column("object", 0, _object_name, 10),
    Column("contact s", 0, _figure("ttc", 1, sigma=True)),
    Column("bearing °", 50, _figure("bearing", 1, math.degrees(1), sign=True)),
    Column("range m", 40, _figure("range", 1, sigma=True)),
    Column("lateral m", 60, _figure("lateral", 1, sign=True, sigma=True)),
    Column("met %", 0, _figure("probability", 0, 100)),
    Column("ahead m/s", 100, _figure("v_forward", 1, sign=True)),
    Column("right m/s", 100, _figure("v_right", 1, sign=True)),
    Column("in sight", 80, lambda thing: ObjectState(thing["state"]).name.lower()),
    Column("trust", 110, _figure("trust", 1)),
    Column("id", 70, lambda thing: str(thing["id"]), 4),
)
CIRCLE_COLUMNS = (
    Column("circle", 0, _circle_name, 8),
    Column("contact s", 0, _figure("ttc", 1)),
    Column("bearing °", 0, _figure("bearing", 1, math.degrees(1), sign=True)),
    Column("range m", 40, _figure("range", 1)),
    Column("lateral m", 50, _figure("lateral", 1, sign=True)),
    Column("elevation °", 80, _figure("elevation", 1, math.degrees(1), sign=True)),
    Column("support", 60, lambda circle: str(circle["support"])),
    Column("trust", 60, _figure("trust", 1)),
    Column("id", 70, lambda circle: str(circle["id"]), 4),
)


@dataclass(frozen=True, slots=True)
class Screen:
    """A snapshot as it looks at ``now_ns`` (system clock, ns). Fits into the given height."""

    snapshot: Snapshot
    endpoint: str
    now_ns: int

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Render, as rich calls it."""
        height = options.height or console.height
        free = options.update(height=None)

        def lines(parts: Sequence[Text]) -> int:
            return sum(1 if part.no_wrap else len(console.render_lines(part, free, pad=False)) for part in parts)

        connection = self._connection if self.snapshot.replay is None else self._replay
        head = [connection(options.is_terminal), self._figures(options.max_width)]
        ill, well = self._devices()
        scene = self.snapshot.scene
        rebels = 0 if scene is None else int((scene.circles["kind"] == Kind.REBEL).sum())
        objects = self._objects(options.max_width, height - lines(head) - 1)  # one line is for the number of circles
        circles = _MIN_CIRCLES if objects else max(rebels, _MIN_CIRCLES)
        left = height - lines([*head, *objects]) - _TABLE_HEAD - circles
        foot: list[Text] = []
        for part in (*([one] for one in ill), [*well, self._tables()]):  # what is wrong comes first
            if lines(foot + part) > left:
                break
            foot += part
        rest = self._circles(options.max_width, height - lines([*head, *objects, *foot]))
        yield from (*head, *objects, *rest, *foot)

    def _connection(self, is_terminal: bool) -> Text:
        snapshot = self.snapshot
        age_s = snapshot.scene_age_s(self.now_ns)
        since = f"since {_clock(snapshot.since_ns)} ({_duration((self.now_ns - snapshot.since_ns) / 1e9)})"
        state = {
            Presence.SOUGHT: Text(f"waiting for a daemon {since}", "bold yellow"),
            Presence.AWAY: Text(f"daemon away {since}", "bold red"),
            Presence.THERE: Text("live", "bold green")
            if age_s < STALE_S
            else Text("there, no scenes" + ("" if math.isinf(age_s) else f" for {_duration(age_s)}"), "bold yellow"),
        }[snapshot.presence]
        robots = Text(f"  {printable(', '.join(snapshot.robots))}" if snapshot.robots else "", "bold")
        rest = f"  {self.endpoint}  {_clock(self.now_ns)}{'  q: end' if is_terminal else ''}"
        return Text.assemble(state, robots, (rest, "dim"), no_wrap=True, overflow="ellipsis")

    def _replay(self, is_terminal: bool) -> Text:
        replay = self.snapshot.replay
        assert replay is not None
        state = Text("plays", "bold green") if replay.playing else Text("paused", "bold yellow")
        where = f"  {replay.position_s:.2f} of {replay.length_s:.2f} s  x{replay.speed:g}"
        count = len(replay.alarms_s)
        alarms = f"  {count} alarm{'s' * (count != 1)}{'' if replay.searched else ' so far'}"
        keys = "  space, s: step, \u2190\u2192, p n: alarm, + -, q" if is_terminal else ""
        name = Text(f"  {printable(', '.join(self.snapshot.robots))}", "bold")
        return Text.assemble(state, name, where, alarms, (keys, "dim"), no_wrap=True, overflow="ellipsis")

    def _figures(self, width: int) -> Text:
        """Rates, times, speed, memory: as many as fit, each whole."""
        snapshot, figures = self.snapshot, Figures(self.snapshot.diagnostics)
        parts = []
        if snapshot.broken:
            parts.append(f"{snapshot.broken} payloads refused")
        if snapshot.scene is not None and math.isfinite(snapshot.rate_hz):
            parts.append(f"{snapshot.rate_hz:.1f} scenes/s")
        if math.isfinite(snapshot.latency_s):
            parts.append(f"latency {1e3 * snapshot.latency_s:.0f} ms")
        if (p99_ms := figures.number("pipeline", "latency_p99_ms")) is not None:
            parts.append(f"99% {p99_ms:.0f} ms")
        if snapshot.scene is not None:
            speed_mps = snapshot.scene.vehicle_speed
            parts.append(f"speed {speed_mps:.2f} m/s" if math.isfinite(speed_mps) else "speed unknown")
        if (resident_mib := figures.number("memory", "resident_mib")) is not None:
            parts.append(f"memory {resident_mib:.0f} of {printable(figures.text('memory', 'budget_mib'), 9)} MiB")
        if (temperature_c := figures.number("board", "temperature_c")) is not None:
            parts.append(f"{temperature_c:.0f} °C")
        while len(parts) > 1 and len("  ".join(parts)) > width:
            parts.pop()
        return Text("  ".join(parts), no_wrap=True, overflow="ellipsis")

    def _objects(self, width: int, lines: int) -> Sequence[Text]:
        """The table, the most urgent first; nothing where there are none."""
        scene = self.snapshot.scene
        if scene is None or not len(scene.objects) or lines < 1:
            return []
        rows = urgent(scene.objects)
        met = int((rows["probability"] >= _PROBABLY).sum())
        count = [(f"{len(rows)} object{'s' * (len(rows) != 1)}  ", ""), (f"{met} to be met", "bold red" if met else "")]

        def style(thing: np.void) -> str:
            if thing["probability"] >= _PROBABLY:
                return "bold red"
            return "cyan" if thing["state"] == ObjectState.SEEN else "dim cyan"

        return self._table(OBJECT_COLUMNS, count, rows, style, width, lines)

    def _circles(self, width: int, lines: int) -> Sequence[Text]:
        """The table, rebels first."""
        scene = self.snapshot.scene
        if scene is None or lines < 1:
            return []
        rows = ordered(scene.circles)
        rebels = int((rows["kind"] == Kind.REBEL).sum())
        first = (str(rebels), "bold red" if rebels else "")
        count = [first, (f" rebel{'s' * (rebels != 1)}  {len(rows) - rebels} normal  {len(scene.psi)} ψ", "")]

        def style(circle: np.void) -> str:
            return "bold red" if circle["kind"] == Kind.REBEL else "green"

        return self._table(CIRCLE_COLUMNS, count, rows, style, width, lines)

    def _table(
        self,
        all_columns: Sequence[Column],
        count: Sequence[tuple[str, str]],
        rows: npt.NDArray[np.void],
        style: Callable[[np.void], str],
        width: int,
        lines: int,
    ) -> Sequence[Text]:
        """Their number, and below it as many as fit; the others are counted."""
        shown = rows[: max(lines - _TABLE_HEAD, 0)]
        hidden = f", {len(rows) - len(shown)} not shown" if len(shown) < len(rows) else ""
        head = Text.assemble(*count, hidden, no_wrap=True, overflow="ellipsis")
        columns = [column for column in all_columns if width >= column.min_columns]
        stale = self.snapshot.scene_age_s(self.now_ns) >= STALE_S
        cells = [[column.name for column in columns], *([column.text(row) for column in columns] for row in shown)]
        widths = [
            max(column.columns or 0, *map(len, of))
            for column, of in zip(columns, zip(*cells, strict=True), strict=True)
        ]
        styles = ["dim", *("dim" if stale else style(row) for row in shown)]
        table = [_line(texts, widths, how) for texts, how in zip(cells, styles, strict=True)]
        return [head, *table] if lines > _TABLE_HEAD else [head]

    def _devices(self) -> tuple[list[Text], list[Text]]:
        """A line for each device with a problem, the worst first; one for all others."""
        diagnostics = self.snapshot.diagnostics
        if diagnostics is None:
            return [], []
        well = [status for status in diagnostics.status if status.level is Level.OK]
        ill = [status for status in diagnostics.status if status.level is not Level.OK]
        ill.sort(key=lambda status: _WORST_FIRST.index(status.level))
        ok = [Text.assemble(("ok  ", "green"), ", ".join(_with_rate(status) for status in well))] if well else []
        return [_device(status) for status in ill[:_MAX_ILL_DEVICES]], ok

    def _tables(self) -> Text:
        figures = Figures(self.snapshot.diagnostics)
        fills = ((table, figures.fill(table)) for table in TABLES)
        texts = [f"{table.replace('_', ' ')} {fill[0]}/{fill[1]}" for table, fill in fills if fill is not None]
        return Text("  ".join(texts), "dim")


def _line(texts: Sequence[str], widths: Sequence[int], style: str) -> Text:
    """A row of a table: the first text to the left, numbers to the right. Rich's own table takes six times as long."""
    padded = [text.rjust(width) for text, width in zip(texts, widths, strict=True)]
    padded[0] = texts[0].ljust(widths[0])
    return Text(" ".join(padded), style, no_wrap=True, overflow="ellipsis", end="\n")


def urgent(objects: npt.NDArray[np.void]) -> npt.NDArray[np.void]:
    """What will probably be met first, soonest contact first, then by id so that rows keep their places."""
    met = objects["probability"] >= _PROBABLY
    contact_s = np.where(np.isfinite(objects["ttc"]), objects["ttc"], np.inf)
    return objects[np.lexsort((objects["id"], contact_s, ~met))]


def ordered(circles: npt.NDArray[np.void]) -> npt.NDArray[np.void]:
    """Rebels first, soonest contact first, then by id so that rows keep their places."""
    rebel = circles["kind"] == Kind.REBEL
    contact_s = np.where(rebel & np.isfinite(circles["ttc"]), circles["ttc"], np.inf)
    return circles[np.lexsort((circles["id"], contact_s, ~rebel))]


def _device(status: DeviceStatus) -> Text:
    text = printable(f"{status.name}: {status.message}")
    return Text.assemble((f"{status.level.name.lower()}  ", _LEVELS[status.level]), text)


def _with_rate(status: DeviceStatus) -> str:
    rate_hz = status.values.get("rate_hz", "nan")
    return printable(status.name if rate_hz in {"nan", ""} else f"{status.name} {rate_hz} Hz")


def _clock(moment_ns: int) -> str:
    return datetime.fromtimestamp(moment_ns / 1e9).astimezone().strftime("%H:%M:%S")


def _duration(seconds: float) -> str:
    """Return a short text of constant width."""
    whole = max(int(seconds), 0)
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60} min" if whole < 3600 else f"{whole // 3600} h {whole % 3600 // 60:02} min"
