"""One recording through the pipeline, scored, in the calling process."""

import heapq
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import cv2
import msgspec
import numpy as np

from drivers.samples import Frame
from lcf_edge.config import Config
from lcf_edge.errors import LcfError, UsageError
from lcf_edge.evaluate import report
from lcf_edge.evaluate.corpus import printable_name
from lcf_edge.evaluate.drawings import Colours, beside, draw, encode
from lcf_edge.evaluate.report import FrameLine, ImageRow, RecordingRow
from lcf_edge.evaluate.score import Score, rebels
from lcf_edge.evaluate.truth import Known, read_truth
from lcf_edge.image_limit import limit_opencv
from lcf_edge.pipeline import run
from lcf_edge.printable import printable
from lcf_edge.recording.read import open_recording

EVENTS = 8  # images of a recording, at most, of what went wrong or differs
VIEWS = 3  # typical images of a recording
APART = 10  # frames between two images of the same kind of event

MAX_FRAMES_BYTES = 2**30  # some 300 bytes a frame

_GRAVITY = {"contact that does not come": 3, "missed": 2, "on nothing": 1}
_DIFFERENCES = {"contact": 3, "found": 2, "on nothing": 1}


@dataclass(frozen=True, slots=True)
class Task:
    """A task for another process, perhaps on another computer that sees the same files.

    ``before``: the file of another evaluation's frames, for comparison, which only the process that hands out must see;
    None: there is none.
    """

    name: str
    path: Path
    config: Config
    settings: tuple[str, ...] = ()
    truth: Path | None = None
    before: Path | None = None

    def frames_before(self) -> bytes | None:
        """Read that file. Raises ``UsageError``."""
        try:
            if self.before is None:
                return None
            if self.before.exists() and not self.before.is_file():
                raise UsageError(f"{self.before}: no file; evaluate again")
            if self.before.stat().st_size > MAX_FRAMES_BYTES:
                raise UsageError(f"{self.before}: too large for the frames of a recording; evaluate again")
            return self.before.read_bytes()
        except OSError as error:
            raise UsageError(f"{self.before}: cannot be read ({error.strerror}); evaluate again") from error


@dataclass(frozen=True, slots=True)
class Done:
    """What comes back. ``frames``: a JSON line a frame. ``drawings``: JPEGs, as in ``row.pictures``."""

    row: RecordingRow
    frames: bytes = b""
    drawings: tuple[bytes, ...] = ()


def evaluate(task: Task, frames_before: bytes | None = None) -> Done:
    """Replay a recording and score it. What cannot be read is named in the row's ``error``."""
    limit_opencv()
    cv2.setNumThreads(1)
    row = RecordingRow(task.name, printable_name(str(task.path)), settings=list(task.settings))
    try:
        return _evaluate(task, None if frames_before is None else _by_stamp(frames_before), row)
    except LcfError as error:
        return Done(msgspec.structs.replace(row, error=printable(str(error))))


def _evaluate(task: Task, before: Mapping[int, FrameLine] | None, row: RecordingRow) -> Done:
    truth = read_truth(task.truth)
    recording = open_recording(task.path, task.config)
    score, kept, lines = Score(), _Kept(), []
    views = set(np.linspace(0.1, 0.9, VIEWS).dot(recording.frame_count or 0).astype(int).tolist())
    differing = 0
    for number, (frame, outcome) in enumerate(run(recording, task.config)):
        reported = rebels(outcome.scene.circles)
        known = truth.of(frame.stamp_ns)
        line = report.line_of(frame, reported)
        score.step_ms.append(outcome.scene.timing.total / 1000)
        if known is not None:
            verdict = score.add(frame.stamp_ns, reported, known)
            line = msgspec.structs.replace(
                line,
                scored=True,
                found=verdict.found,
                missed=verdict.missed,
                false=verdict.false,
                contact=verdict.contact,
            )
        lines.append(line)
        other = before.get(frame.stamp_ns) if before is not None else None
        differs = other is not None and other.verdict != line.verdict
        differing += differs
        if differs and other is not None:
            kept.offer(line, *_difference(other, line), _pair(frame, known or (), other, line))
        elif before is None and (line.missed or line.false or line.contact):
            kept.offer(line, *_event(line, known=truth.is_known), _single(frame, known or (), line))
        if number in views and not differs:
            kept.keep(line, "", _single(frame, known or (), line))
    drawings = kept.drawings()
    return Done(
        msgspec.structs.replace(
            row,
            has_truth=truth.is_known,
            numbers=report.numbers(score),
            threats=report.threats(score),
            events=report.events(lines),
            warnings=recording.warnings,
            differing=None if before is None else differing,
            pictures=[drawing for drawing, _ in drawings],
        ),
        _encoded(lines),
        tuple(jpeg for _, jpeg in drawings),
    )


def _event(line: FrameLine, *, known: bool) -> tuple[int, str]:
    """Return how grave an error is, and its name."""
    what = "contact that does not come" if line.contact else "missed" if line.missed else "on nothing"
    text = f"missed: {', '.join(line.missed)}" if what == "missed" else what
    return _GRAVITY[what], text if known else "reported"


def _difference(before: FrameLine, now: FrameLine) -> tuple[int, str]:
    if before.contact != now.contact:
        return _DIFFERENCES["contact"], "a contact that does not come " + ("is new" if now.contact else "is gone")
    gained, lost = set(now.found) - set(before.found), set(before.found) - set(now.found)
    if gained or lost:
        texts = [f"{word}: {', '.join(sorted(names))}" for word, names in (("found", gained), ("lost", lost)) if names]
        return _DIFFERENCES["found"], ", ".join(texts)
    return _DIFFERENCES["on nothing"], f"on nothing {now.false}, was {before.false}"


def _single(frame: Frame, known: Sequence[Known], line: FrameLine) -> Callable[[], Colours]:
    return lambda: draw(frame.image, known, line.rebels, str(line.seq))


def _pair(frame: Frame, known: Sequence[Known], before: FrameLine, now: FrameLine) -> Callable[[], Colours]:
    return lambda: beside(
        draw(frame.image, known, before.rebels, f"{now.seq} before"),
        draw(frame.image, known, now.rebels, f"{now.seq} now"),
    )


class _Kept:
    """The images that a report shows of a recording: the gravest events, and some typical ones."""

    def __init__(self) -> None:
        self._order = count()
        self._events: list[tuple[int, int, ImageRow, bytes]] = []  # a heap, the least grave first
        self._views: list[tuple[ImageRow, bytes]] = []
        self._last: dict[int, int] = {}  # seq of the last image of each gravity

    def offer(self, line: FrameLine, gravity: int, why: str, drawing: Callable[[], Colours]) -> None:
        """Keep an image if it is graver than one of those kept, and not close to the one before it."""
        if line.seq - self._last.get(gravity, -APART) < APART:
            return
        if len(self._events) == EVENTS and gravity <= self._events[0][0]:
            return
        self._last[gravity] = line.seq
        row = ImageRow(line.seq, line.stamp_ns, why)
        heapq.heappush(self._events, (gravity, -next(self._order), row, encode(drawing())))
        if len(self._events) > EVENTS:
            heapq.heappop(self._events)

    def keep(self, line: FrameLine, why: str, drawing: Callable[[], Colours]) -> None:
        """Keep an image in any case."""
        self._views.append((ImageRow(line.seq, line.stamp_ns, why), encode(drawing())))

    def drawings(self) -> list[tuple[ImageRow, bytes]]:
        """All of them, events first, each kind in the order of time."""
        events = [(row, data) for _, _, row, data in self._events]
        shown = {row.seq for row, _ in events}
        views = [(row, data) for row, data in self._views if row.seq not in shown]
        return sorted(events, key=_seq) + sorted(views, key=_seq)


def _seq(drawing: tuple[ImageRow, bytes]) -> int:
    return drawing[0].seq


def _encoded(lines: Iterable[FrameLine]) -> bytes:
    return b"".join(msgspec.json.encode(line) + b"\n" for line in lines)


def _by_stamp(lines: bytes) -> Mapping[int, FrameLine]:
    try:
        return {line.stamp_ns: line for line in msgspec.json.Decoder(FrameLine).decode_lines(lines)}
    except msgspec.MsgspecError as error:
        raise LcfError(f"the report compared with has frames that cannot be read ({error}); evaluate again") from error
