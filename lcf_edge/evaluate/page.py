"""The report as a page for a browser: one file that shows the images beside it, without scripts."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

from lcf_edge.evaluate import report
from lcf_edge.evaluate.report import ImageRow, Numbers, RecordingRow, Report
from lcf_edge.printable import counted

Value = float | None


@dataclass(frozen=True, slots=True)
class Measure:
    """A column. ``of``: its number; ``worse``: which way is worse, 1 up, -1 down, 0 neither."""

    title: str
    hint: str
    of: Callable[[Numbers], Value]
    decimals: int
    worse: int

    def text(self, numbers: Numbers) -> str:
        """Return the number as text, or a dash where there is none."""
        value = self.of(numbers)
        return "–" if value is None else f"{value:.{self.decimals}f}"


MEASURES = (
    Measure("found, %", "threats found, of those in view, frame by frame", lambda n: _share(n.found, n.due), 0, -1),
    Measure("after, s", "until a threat is found, median of those found", lambda n: n.late_s, 2, 1),
    Measure("on nothing", "rebel circles on nothing, per frame", lambda n: n.false_per_frame, 2, 1),
    Measure("contacts", "frames with a contact below 1 s that does not come", lambda n: n.contacts, 0, 1),
    Measure("step, ms", "time per frame, median", lambda n: n.median_ms, 2, 0),
    Measure("slow, ms", "99 % of the frames are faster", lambda n: n.slow_ms, 2, 0),
)

KINDS = ("found", "missed", "on nothing", "contact")
"""What a frame can be counted as, see ``report.Event``."""


def _share(part: int, whole: int) -> Value:
    return 100 * part / whole if whole else None


def page(result: Report, before: Report | None = None) -> str:
    """The page of a report; ``before``: the one to compare with."""
    template = files("lcf_edge.evaluate").joinpath("page.html").read_text(encoding="utf-8")
    known = {row.name: row for row in before.read} if before else {}
    parts = {
        "{{HEAD}}": _head(result, before),
        "{{TOTALS}}": _totals(result, known),
        "{{TABLE}}": _table(result, known),
        "{{FAILED}}": _failed(result),
        "{{RECORDINGS}}": "".join(
            _section(row, number) for number, row in enumerate(result.recordings, 1) if not row.error
        ),
    }
    marks = re.compile("|".join(map(re.escape, parts)))
    return marks.sub(lambda mark: parts[mark[0]], template)  # in one pass: a name may look like a mark


def _head(result: Report, before: Report | None) -> str:
    def line(word: str, one: Report) -> str:
        settings = "".join(f" <code>{escape(setting)}</code>" for setting in one.settings)
        return (
            f"<p><b>{word}</b> lcf-edge {escape(one.version)}{settings}, {escape(one.date)}, {escape(one.computer)}</p>"
        )

    if before is None:
        return line("", result)
    return line("now:", result) + line("before:", before)


def _totals(result: Report, known: dict[str, RecordingRow]) -> str:
    """Return the sums: of recordings with truth, and of those without, in which every report counts as false."""
    parts = []
    for has_truth, title in ((True, "With truth"), (False, "Without truth: as if nothing moved and nothing were met")):
        rows = [row for row in result.read if row.has_truth == has_truth]
        if not rows:
            continue
        same = [known[row.name] for row in rows if row.name in known]
        now, then = report.total(rows), report.total(same) if same else None
        cells = "".join(_tile(measure, now, then) for measure in MEASURES)
        parts.append(
            f"<h2>{title}</h2><p>{counted(len(rows), 'recording')}, {counted(now.pictures, 'frame')}, "
            f"{now.scored} of them scored</p>"
        )
        parts.append(f'<div class="tiles">{cells}</div>')
    return "".join(parts)


def _tile(measure: Measure, now: Numbers, then: Numbers | None) -> str:
    change = f'<span class="was">was {measure.text(then)}</span>' if then else ""
    return (
        f'<div class="tile" title="{escape(measure.hint)}"><span>{measure.title}</span>'
        f"<b{_mark(measure, now, then)}>{measure.text(now)}</b>{change}</div>"
    )


def _mark(measure: Measure, now: Numbers, then: Numbers | None) -> str:
    """Return the CSS class for how a number has changed."""
    if then is None or not measure.worse:
        return ""
    new, old = measure.of(now), measure.of(then)
    if new is None or old is None or f"{new:.{measure.decimals}f}" == f"{old:.{measure.decimals}f}":
        return ""
    return ' class="worse"' if (new - old) * measure.worse > 0 else ' class="better"'


def _table(result: Report, known: dict[str, RecordingRow]) -> str:
    heads = "".join(f'<th title="{escape(measure.hint)}">{measure.title}</th>' for measure in MEASURES)
    differ = '<th title="frames on which the verdict is another">differ</th>' if known else ""
    rows = "".join(
        _row(row, number, known.get(row.name), differing=bool(known))
        for number, row in enumerate(result.recordings, 1)
        if not row.error
    )
    return f'<div class="wide"><table><tr><th>recording</th><th>frames</th>{heads}{differ}</tr>{rows}</table></div>'


def _row(row: RecordingRow, number: int, before: RecordingRow | None, *, differing: bool) -> str:
    then = before.numbers if before else None
    star = "" if row.has_truth else '<abbr title="no truth: every rebel counts as on nothing">*</abbr>'
    cells = "".join(
        f"<td{_mark(measure, row.numbers, then)}>{measure.text(row.numbers)}"
        + (f'<span class="was">{measure.text(then)}</span>' if then else "")
        + "</td>"
        for measure in MEASURES
    )
    differ = f"<td>{'–' if row.differing is None else row.differing}</td>" if differing else ""
    name = f'<a href="#r{number}">{escape(row.name)}</a>{star}'
    return f"<tr><th>{name}</th><td>{row.numbers.pictures}</td>{cells}{differ}</tr>"


def _failed(result: Report) -> str:
    failed = [row for row in result.recordings if row.error]
    if not failed:
        return ""
    items = "".join(f"<li><b>{escape(row.name)}</b> {escape(row.error)}</li>" for row in failed)
    return f"<h2>Not read</h2><ul>{items}</ul>"


def _section(row: RecordingRow, number: int) -> str:
    settings = "".join(f"<code>{escape(setting)}</code> " for setting in row.settings)
    warnings = "".join(f"<li>{escape(warning)}</li>" for warning in row.warnings)
    threats = "".join(
        f"<tr><th>{escape(each.name)}</th><td>{each.found} of {each.due}</td>"
        f"<td>{'never' if each.late_s is None else f'{each.late_s:.2f}'}</td></tr>"
        for each in row.threats
    )
    table = f"<table><tr><th>threat</th><th>found in</th><th>after, s</th></tr>{threats}</table>" if threats else ""
    return (
        f'<section id="r{number}"><h3>{escape(row.name)}</h3><p>{settings}</p>'
        + (f"<ul>{warnings}</ul>" if warnings else "")
        + _strip(row)
        + f'<div class="wide">{table}</div>'
        + f'<div class="pictures">{_figures(row.pictures)}</div></section>'
    )


def _strip(row: RecordingRow) -> str:
    """Return a timeline as a drawing: a line for each kind of event, from the first frame to the last."""
    kinds = [kind for kind in KINDS if any(event.what == kind for event in row.events)]
    if not kinds:
        return ""
    lines = ""
    for kind in kinds:
        bars = "".join(
            f'<rect x="{event.first}" y="0" width="{event.last - event.first + 1}" height="1"/>'
            for event in row.events
            if event.what == kind
        )
        lines += (
            f'<span>{kind}</span><svg class="{kind.replace(" ", "-")}" viewBox="0 0 {row.numbers.pictures} 1" '
            f'preserveAspectRatio="none" role="img" aria-label="{kind}">{bars}</svg>'
        )
    return f'<div class="strip">{lines}<span></span><span class="ends"><i>first frame</i><i>last</i></span></div>'


def _figures(pictures: Sequence[ImageRow]) -> str:
    return "".join(
        f'<figure><img loading="lazy" src="{image.file}" alt="frame {image.seq}">'
        f"<figcaption>{image.seq}{': ' if image.why else ''}{escape(image.why)}</figcaption></figure>"
        for image in pictures
    )
