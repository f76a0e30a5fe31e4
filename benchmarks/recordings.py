"""Real recordings: the results of each method, and images to inspect.

A recording is a folder that the replay reads, with a file ``settings`` in it, and ``truth.jsonl`` if it is annotated:
the corpus, the truth and the score are those of ``lcf-edge evaluate`` (docs/evaluate.md).
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmarks.methods import FILTER, NAMES
from benchmarks.playing import Moment, play_recording
from benchmarks.report import Table, number
from lcf_edge.config import Config, load
from lcf_edge.errors import RecordingError
from lcf_edge.evaluate.corpus import Entry, find
from lcf_edge.evaluate.drawings import WIDTH_PX, Colours, draw
from lcf_edge.evaluate.report import line_of
from lcf_edge.evaluate.score import Score, rebels
from lcf_edge.evaluate.truth import Known, read_truth
from lcf_edge.recording.read import open_recording

VARIABLE = "LCF_EDGE_DATA"
FRAMES = 6  # of each recording on the sheet
_WHITE = (255, 255, 255)


@dataclass(slots=True)
class Result:
    """One recording, scored for each method. ``images``: samples, with the filter's results."""

    name: str
    scores: dict[str, Score]
    images: list[Colours]


def run(folder: Path, into: list[Result]) -> Iterable[str]:
    """Score all methods on the recordings in a folder; return the name of each that is done. Raises RecordingError."""
    entries = [entry for entry in find([folder]) if entry.settings] if folder.is_dir() else []
    if not entries:
        raise RecordingError(f"{folder}: no recordings; each is a folder with a file `settings`")
    for entry in entries:
        into.append(_score(entry, load(None, entry.settings)))
        yield entry.name


def _score(entry: Entry, config: Config) -> Result:
    truth = read_truth(entry.truth)
    result = Result(entry.name, {name: Score() for name in NAMES}, [])
    count = open_recording(entry.path, config).frame_count or 1
    shown = set(np.linspace(0.1 * count, 0.95 * count, FRAMES).astype(int).tolist())
    for number_of, moment in enumerate(play_recording(entry.path, config, NAMES)):
        stamp_ns = moment.frame.stamp_ns
        known = truth.of(stamp_ns)
        for name, scene in moment.scenes.items():
            score = result.scores[name]
            score.step_ms.append(scene.timing.total / 1000)
            if known is not None:
                score.add(stamp_ns, rebels(scene.circles), known)
        if number_of in shown:
            result.images.append(_drawn(moment, known or ()))
    return result


def tables(results: Sequence[Result]) -> list[Table]:
    """One table a measure, a row a recording."""

    def table(title: str, cell: Callable[[Score], str]) -> Table:
        rows = [[each.name, *(cell(each.scores[name]) for name in NAMES)] for each in results]
        return Table(title, ["recording", *NAMES], rows)

    return [
        table("Threats found, of those in sight", lambda s: f"{s.found}/{s.due}" if s.due else "-"),
        table("Found after, s", lambda s: number(s.latency_s, 2)),
        table("Rebels on nothing, an image", lambda s: number(s.false_per_frame, 2)),
        table("Images with a contact below 1 s that does not come", lambda s: str(s.contacts)),
        table("Step, median ms", lambda s: number(s.median_ms, 2)),
    ]


def as_numbers(result: Result) -> dict[str, dict[str, float]]:
    """The numbers of each method."""
    return {
        name: {
            "scored": s.scored,
            "due": s.due,
            "found": s.found,
            "false": s.false,
            "contacts": s.contacts,
            "latency_s": s.latency_s,
            "median_ms": s.median_ms,
        }
        for name, s in result.scores.items()
    }


def _drawn(moment: Moment, known: Sequence[Known]) -> Colours:
    """A small image with annotations and the filter's rebels."""
    line = line_of(moment.frame, rebels(moment.scenes[FILTER].circles))
    return draw(moment.frame.image, known, line.rebels, str(line.seq))


def write_sheet(results: Sequence[Result], path: Path) -> Path:
    """Write all images, a row a recording; return where. Raises OSError."""
    rows = []
    for each in results:
        height = max((image.shape[0] for image in each.images), default=0) + 16
        row = np.zeros((height, FRAMES * WIDTH_PX, 3), np.uint8)
        cv2.putText(row, each.name, (3, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.4, _WHITE)
        for place, image in enumerate(each.images):
            row[16 : 16 + image.shape[0], place * WIDTH_PX : (place + 1) * WIDTH_PX] = image
        rows.append(row)
    path.parent.mkdir(parents=True, exist_ok=True)
    _, encoded = cv2.imencode(".png", np.concatenate(rows))
    path.write_bytes(encoded.tobytes())
    return path
