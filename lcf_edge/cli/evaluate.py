"""``lcf-edge evaluate``: many recordings, one report."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from lcf_edge.errors import LcfError
from lcf_edge.evaluate import report
from lcf_edge.evaluate.evaluation import Question
from lcf_edge.evaluate.evaluation import evaluate as write_report
from lcf_edge.evaluate.one_recording import Task
from lcf_edge.evaluate.report import Numbers, RecordingRow, Report
from lcf_edge.evaluate.workers import Outcome, by_cluster, by_processes
from lcf_edge.printable import counted

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Work:
    """Who does it: processes here, as many as there are processors (``jobs`` None), or a Dask cluster."""

    jobs: int | None = None
    scheduler: str | None = None


def evaluate(question: Question, folder: Path, work: Work, warn: Say) -> list[str]:
    """Evaluate recordings into a folder. Return the summary, line by line.

    Raises ``UsageError``, ``ConfigError``, ``SinkError``, and ``LcfError`` when no recording could be read.
    """

    def outcomes(tasks: Sequence[Task]) -> Iterator[Outcome]:
        if work.scheduler is not None:
            done = by_cluster(tasks, work.scheduler, warn)
        else:
            jobs = work.jobs or len(os.sched_getaffinity(0))
            done = by_processes(tasks, min(jobs, len(tasks) or 1))
        with tqdm(done, total=len(tasks), unit="recording", disable=None, file=sys.stderr) as steps:
            yield from steps

    written = write_report(question, folder, outcomes)
    for row in written.report.recordings:
        if row.error:
            warn(f"{row.name}: left out: {row.error}")
    if not written.report.read:
        raise LcfError(f"{folder}: not one of the recordings could be read; {written.page} says why")
    return [*_summary(written.report, written.before), f"report    {written.page}"]


def _summary(now: Report, before: Report | None) -> list[str]:
    failed = len(now.recordings) - len(now.read)
    lines = [f"read      {counted(len(now.read), 'recording')}" + (f", {failed} left out" if failed else "")]
    known = {row.name: row for row in before.read} if before else {}
    for has_truth, title in ((True, "with truth"), (False, "without truth, as if nothing moved and nothing were met")):
        rows = [row for row in now.read if row.has_truth == has_truth]
        if rows:
            lines.append(f"{len(rows)} {title}")
            same = [known[row.name] for row in rows if row.name in known]
            lines += _numbers(rows, same if before else None)
    if before is not None:
        lines.append(f"differ    {sum(row.differing or 0 for row in now.read)} frames")
    return lines


def _numbers(rows: list[RecordingRow], before: list[RecordingRow] | None) -> list[str]:
    now, then = _figures(report.total(rows)), _figures(report.total(before)) if before else {}
    return [
        f"{word:<9} {number} {rest}" + (f" (was {then[word][0]})" if word in then else "")
        for word, (number, rest) in now.items()
    ]


def _figures(total: Numbers) -> dict[str, tuple[str, str]]:
    """Return lines with each number and what it counts."""
    figures = {}
    if total.due:
        figures["found"] = f"{total.found} of {total.due}", "threats in view, frame by frame"
    if total.late_s is not None:
        figures["late"] = f"{total.late_s:.2f}", "s until a threat is found, median"
    if total.false_per_frame is not None:
        figures["false"] = f"{total.false_per_frame:.2f}", "rebels on nothing a frame"
        figures["contact"] = f"{total.contacts} of {total.scored}", "images with one below 1 s that does not come"
    if total.median_ms is not None:
        figures["time"] = f"{total.median_ms:.2f} / {total.slow_ms:.2f}", "ms a frame, median / 99 %"
    return figures
