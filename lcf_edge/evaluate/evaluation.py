"""The whole evaluation: hands out the recordings of a corpus, and writes the results into a folder."""

import platform
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from lcf_edge import __version__
from lcf_edge.config import Config, load
from lcf_edge.config.attached import attached_configuration
from lcf_edge.errors import ConfigError, LcfError, UsageError
from lcf_edge.evaluate import report
from lcf_edge.evaluate.corpus import Entry, find, printable_name
from lcf_edge.evaluate.one_recording import Done, Task
from lcf_edge.evaluate.page import page
from lcf_edge.evaluate.report import RecordingRow, Report
from lcf_edge.evaluate.workers import Outcome
from lcf_edge.printable import printable
from lcf_edge.recording.read.rosbag import bag_files
from lcf_edge.sinks import cannot_write

PAGE = "index.html"
_FRAMES = re.compile(r"frames/\d{4,9}\.jsonl", re.ASCII)

Work = Callable[[Sequence[Task]], Iterator[Outcome]]


@dataclass(frozen=True, slots=True)
class Question:
    """What is to be evaluated, and how. ``truth``: a file, for one recording, or a folder with ``NAME.jsonl``."""

    places: Sequence[Path]
    config: Path | None = None
    settings: Sequence[str] = ()
    truth: Path | None = None
    against: Path | None = None


@dataclass(frozen=True, slots=True)
class Written:
    """A written report. ``before``: the one that it was compared with."""

    report: Report
    before: Report | None
    page: Path


def evaluate(question: Question, folder: Path, work: Work) -> Written:
    """Evaluate recordings and write the report into a folder. Raises ``UsageError``, ``ConfigError``, ``SinkError``."""
    load(question.config, question.settings)  # errors that concern all recordings are reported at once
    entries = find(question.places)
    before, before_folder = report.read(question.against) if question.against else (None, Path())
    if question.truth is not None and not question.truth.is_dir() and len(entries) > 1:
        raise UsageError(f"{question.truth}: truth of one recording, and {len(entries)} are named; name a folder")
    frames_before = _frames(before, before_folder) if before else {}
    _prepare(folder, question.against)
    rows: dict[str, RecordingRow] = {}
    tasks = []
    for entry in entries:
        try:
            tasks.append(_task(entry, question, frames_before))
        except (LcfError, OSError, UnicodeDecodeError) as error:
            rows[entry.name] = RecordingRow(entry.name, printable_name(str(entry.path)), error=printable(str(error)))
    numbers = {entry.name: number for number, entry in enumerate(entries, 1)}
    for task, done in work(tasks):
        if isinstance(done, str):
            rows[task.name] = RecordingRow(
                task.name, printable_name(str(task.path)), error=printable(done), settings=list(task.settings)
            )
        else:
            rows[task.name] = _keep(done, folder, numbers[task.name])
    result = Report(
        format=report.FORMAT,
        version=__version__,
        label=" ".join([__version__, *question.settings]),
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        computer=f"{platform.machine()}, Python {platform.python_version()}",
        settings=[*(["-c " + str(question.config)] if question.config else []), *question.settings],
        recordings=[rows[entry.name] for entry in entries],
    )
    _write(folder / report.FILE, msgspec.json.format(msgspec.json.encode(result), indent=1))
    _write(folder / PAGE, page(result, before).encode())
    return Written(result, before, folder / PAGE)


def _task(entry: Entry, question: Question, before: Mapping[str, Path]) -> Task:
    words = entry.settings
    truth = entry.truth
    if question.truth is not None:
        truth = question.truth / f"{entry.name}.jsonl" if question.truth.is_dir() else question.truth
        truth = truth if truth.exists() else None
    return Task(
        entry.name,
        entry.path,
        _config(entry, question, words),
        tuple(words),
        truth.resolve() if truth is not None else None,
        before.get(entry.name),
    )


def _config(entry: Entry, question: Question, words: Sequence[str]) -> Config:
    """Load the named file, else the recording's own configuration, with the settings beside the recording on top."""
    return load(question.config or _holder(entry.path), [*words, *question.settings])


def _holder(recording: Path) -> Path | None:
    """Return the file that holds a recording's configuration; None: it has none."""
    first = next((path for path in bag_files(recording) if path.suffix.lower() == ".mcap"), None)
    with suppress(ConfigError):
        if first is not None:
            attached_configuration(first)
            return first
    return None


def _frames(of: Report, folder: Path) -> dict[str, Path]:
    """The files of a report's frames, by the names of the recordings. Raises ``UsageError``."""
    for row in of.read:
        if row.frames and not _FRAMES.fullmatch(row.frames):  # a foreign report could name any file
            raise UsageError(f"{folder}: {row.frames} is not a report's file of frames; evaluate again")
    return {row.name: folder / row.frames for row in of.read if row.frames}


def _prepare(folder: Path, against: Path | None) -> None:
    if against is not None and folder.exists() and folder.samefile(against if against.is_dir() else against.parent):
        raise UsageError(f"{folder}: holds the report to compare with; name another folder with --out")
    try:
        for path in (folder / "frames", folder / "pictures"):
            path.mkdir(parents=True, exist_ok=True)
            for old in path.glob("[0-9][0-9][0-9][0-9]*"):  # of an earlier report here
                old.unlink()
        probe = folder / PAGE
        with probe.open("ab"):
            pass
    except OSError as error:
        raise cannot_write(folder, error) from error


def _keep(done: Done, folder: Path, number: int) -> RecordingRow:
    """Write the files of a recording; return the row that names them."""
    row = done.row
    if row.error:
        return row
    frames = f"frames/{number:04d}.jsonl"
    _write(folder / frames, done.frames)
    pictures = []
    for image, data in zip(row.pictures, done.drawings, strict=True):
        file = f"pictures/{number:04d}-{image.seq:06d}.jpg"
        _write(folder / file, data)
        pictures.append(msgspec.structs.replace(image, file=file))
    return msgspec.structs.replace(row, frames=frames, pictures=pictures)


def _write(path: Path, data: bytes) -> None:
    try:
        path.write_bytes(data)
    except OSError as error:
        raise cannot_write(path, error) from error
