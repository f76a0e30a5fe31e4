"""What an evaluation writes: the numbers in ``report.json``, and a line a frame of each recording in ``frames/``."""

import math
from collections.abc import Sequence
from pathlib import Path
from statistics import median

import msgspec
import numpy as np

from drivers.samples import Frame
from lcf_edge.errors import UsageError
from lcf_edge.evaluate.score import Circles, Score

FILE = "report.json"
FORMAT = 1
MAX_BYTES = 2**30


class Rebel(msgspec.Struct, frozen=True, array_like=True):
    """A rebel circle, px of the image. ``ttc_s``: None: no contact."""

    x: float
    y: float
    r: float
    ttc_s: float | None


class FrameLine(msgspec.Struct, frozen=True):
    """One frame: what was reported, and the verdict on it where it was scored."""

    stamp_ns: int
    seq: int
    rebels: list[Rebel]
    scored: bool = False
    found: tuple[str, ...] = ()
    missed: tuple[str, ...] = ()
    false: int = 0
    contact: bool = False

    @property
    def verdict(self) -> tuple[bool, frozenset[str], int, bool]:
        """The part by which two evaluations of a frame are compared."""
        return self.scored, frozenset(self.found), self.false, self.contact


class ThreatRow(msgspec.Struct, frozen=True):
    """One threat. ``late_s``: from the first image in which it was due to the first in which it was found."""

    name: str
    due: int
    found: int
    late_s: float | None


class Numbers(msgspec.Struct, frozen=True):
    """Of one recording, or of all. ``due``, ``found``: threats, frame by frame; times in ms a frame."""

    pictures: int = 0
    scored: int = 0
    due: int = 0
    found: int = 0
    false: int = 0
    contacts: int = 0
    late_s: float | None = None
    median_ms: float | None = None
    slow_ms: float | None = None  # 99th percentile

    @property
    def false_per_frame(self) -> float | None:
        """Rebels on nothing."""
        return self.false / self.scored if self.scored else None


class Event(msgspec.Struct, frozen=True, array_like=True):
    """Consecutive frames with the same verdict, by their places in the recording.

    ``what``: found, missed (a threat), on nothing (a rebel), contact (that does not come).
    """

    what: str
    first: int
    last: int


class ImageRow(msgspec.Struct, frozen=True):
    """An image of the report, and why it is there. ``file``: below the report's folder."""

    seq: int
    stamp_ns: int
    why: str
    file: str = ""


class RecordingRow(msgspec.Struct, frozen=True):
    """One recording. ``error``: why it could not be read at all; then the numbers are none.

    ``differing``: frames whose verdict differs from that of the other report; None: not compared.
    """

    name: str
    path: str
    error: str = ""
    has_truth: bool = False
    settings: list[str] = []
    numbers: Numbers = Numbers()
    threats: list[ThreatRow] = []
    events: list[Event] = []
    warnings: list[str] = []
    differing: int | None = None
    pictures: list[ImageRow] = []
    frames: str = ""  # file below the report's folder


class Report(msgspec.Struct, frozen=True):
    """The whole report. ``label``: version and settings, as text."""

    format: int
    version: str
    label: str
    date: str
    computer: str
    settings: list[str]
    recordings: list[RecordingRow]

    @property
    def read(self) -> list[RecordingRow]:
        """The recordings that could be read."""
        return [row for row in self.recordings if not row.error]


def line_of(frame: Frame, reported: Circles) -> FrameLine:
    """A frame that is not scored yet, with its ``rebels``."""
    circles = [
        Rebel(
            round(float(each["x"]), 1),
            round(float(each["y"]), 1),
            round(float(each["radius"]), 1),
            round(float(each["ttc"]), 2) if np.isfinite(each["ttc"]) else None,
        )
        for each in reported
    ]
    return FrameLine(frame.stamp_ns, frame.seq, circles)


def numbers(score: Score) -> Numbers:
    """The numbers of a score."""
    times = sorted(score.step_ms)
    return Numbers(
        pictures=len(times),
        scored=score.scored,
        due=score.due,
        found=score.found,
        false=score.false,
        contacts=score.contacts,
        late_s=_known(score.latency_s),
        median_ms=round(times[len(times) // 2], 3) if times else None,
        slow_ms=round(times[min(int(0.99 * len(times)), len(times) - 1)], 3) if times else None,
    )


def threats(score: Score) -> list[ThreatRow]:
    """The threats of a recording."""
    return [ThreatRow(name, each.due, each.found, _known(each.late_s)) for name, each in score.threats.items()]


def events(lines: Sequence[FrameLine]) -> list[Event]:
    """Return the events, in the order in which they begin."""
    runs: list[Event] = []
    open_runs: dict[str, int] = {}
    for place, line in enumerate(lines):
        said = {
            "found": bool(line.found),
            "missed": bool(line.missed),
            "on nothing": line.false > 0,
            "contact": line.contact,
        }
        for what, holds in said.items():
            if not holds:
                continue
            last = open_runs.get(what)
            if last is not None and runs[last].last == place - 1:
                runs[last] = Event(what, runs[last].first, place)
            else:
                open_runs[what] = len(runs)
                runs.append(Event(what, place, place))
    return runs


def _known(value: float) -> float | None:
    return None if math.isnan(value) else round(value, 3)


def total(rows: list[RecordingRow]) -> Numbers:
    """Return the sum of recordings; times are the median recording's."""

    def middle(values: list[float | None]) -> float | None:
        reported = [value for value in values if value is not None]
        return round(median(reported), 3) if reported else None

    every = [row.numbers for row in rows]
    return Numbers(
        pictures=sum(each.pictures for each in every),
        scored=sum(each.scored for each in every),
        due=sum(each.due for each in every),
        found=sum(each.found for each in every),
        false=sum(each.false for each in every),
        contacts=sum(each.contacts for each in every),
        late_s=middle([threat.late_s for row in rows for threat in row.threats]),
        median_ms=middle([each.median_ms for each in every]),
        slow_ms=middle([each.slow_ms for each in every]),
    )


def read(path: Path) -> tuple[Report, Path]:
    """A report, and the folder that its files lie in. ``path``: that folder, or the file. Raises ``UsageError``."""
    file = path / FILE if path.is_dir() else path
    try:
        if file.stat().st_size > MAX_BYTES:
            raise UsageError(f"{file}: too large for a report of lcf-edge evaluate")
        report = msgspec.json.decode(file.read_bytes(), type=Report)
    except OSError as error:
        raise UsageError(f"{file}: cannot be read ({error.strerror}); name what lcf-edge evaluate wrote") from error
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise UsageError(f"{file}: not a report of lcf-edge evaluate ({error})") from error
    if report.format != FORMAT:
        raise UsageError(f"{file}: a report of format {report.format}, not {FORMAT}; evaluate again")
    return report, file.parent
