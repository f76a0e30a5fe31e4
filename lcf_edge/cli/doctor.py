"""``lcf-edge doctor``: problems of a vehicle's computer, devices and configuration, and how to fix them."""

import os
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from lcf_edge.doctor.configuration import context_of
from lcf_edge.doctor.examination import examine
from lcf_edge.doctor.finding import Finding, Severity
from lcf_edge.errors import LcfError
from lcf_edge.printable import printable

WriteLine = Callable[[str], None]

_COLOURS = {Severity.OK: "32", Severity.WARN: "33", Severity.FAIL: "31"}
_WIDE = len("configuration")
_LONGEST = 4096  # characters of a path


class UnfitError(LcfError):
    """A check found something that does not work."""


def doctor(path: Path | None, settings: Sequence[str], *, as_json: bool, write_line: WriteLine) -> None:
    """Run all checks and report each finding as it is found.

    Raises ``UnfitError`` when something failed, and ``ConfigError`` for an unusable configuration, after the checks
    that do not need one.
    """
    context = context_of(path, settings)
    coloured = sys.stdout.isatty() and not os.environ.get("NO_COLOR")
    levels: Counter[Severity] = Counter()
    for finding in examine(context):
        levels[finding.level] += 1
        write_line(json_line(finding) if as_json else line(finding, coloured=coloured))
    if context.error is not None:
        raise context.error
    if levels[Severity.FAIL]:
        raise UnfitError(f"{_count(levels[Severity.FAIL], 'check')} failed; fix the first one and look again")
    if not as_json:
        write_line(f"\nnothing failed, {_count(levels[Severity.WARN], 'warning')}")


def line(finding: Finding, *, coloured: bool = False) -> str:
    """Return a finding as text; its remedy on a line of its own that can be pasted."""
    level = finding.level.value
    shown = f"\x1b[{_COLOURS[finding.level]}m{level:<4}\x1b[0m" if coloured else f"{level:<4}"
    text = f"{shown}  {finding.subject:<{_WIDE}}  {printable(finding.text, _LONGEST)}"
    return f"{text}\n{'':<{_WIDE + 8}}{printable(finding.remedy, _LONGEST)}" if finding.remedy else text


def json_line(finding: Finding) -> str:
    """A finding as a JSON object."""
    values = {"level": finding.level.value, "subject": finding.subject, "text": finding.text, "remedy": finding.remedy}
    return msgspec.json.encode(values).decode()


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'s' * (number != 1)}"
