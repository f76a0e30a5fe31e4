"""``python -m benchmarks.run``: detection quality and speed of the filter and its peers, in one run.

Prints the tables and writes them to ``benchmarks/results/``; of real recordings a sheet of images besides, to
``bench-out/``.
"""

import argparse
import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
from tqdm import tqdm

from benchmarks import quality, recordings, report, speed
from lcf_edge.errors import LcfError, UsageError
from lcf_edge.rendered.scenes import KINDS

SHEET = Path("bench-out/recordings.png")
_QUICK_KINDS = ("passing", "ahead", "crossing", "turn")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the requested measurements. Return the exit status."""
    options = _parser().parse_args(arguments)
    cv2.setNumThreads(1)
    try:
        kinds = _kinds(options.kinds or ",".join(_QUICK_KINDS if options.quick else KINDS))
        seeds = _numbers(options.seeds or ("0" if options.quick else "0-4"))
        if options.only in (None, "quality"):
            _say(_quality(kinds, seeds))
        if options.only in (None, "recordings"):
            _say(_recordings(options.recordings or os.environ.get(recordings.VARIABLE)))
        if options.only in (None, "speed"):
            _say(_speed(quick=options.quick))
    except (LcfError, OSError) as error:
        sys.stderr.write(f"benchmarks: {error}\n")
        return error.exit_status if isinstance(error, LcfError) else 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.run", description=__doc__)
    parser.add_argument("--seeds", help="of the rendered drives: 0-4 or 0,2,7 (default 0-4)")
    parser.add_argument("--kinds", help=f"of the rendered drives, with commas (default all: {', '.join(KINDS)})")
    parser.add_argument("--only", choices=("quality", "recordings", "speed"), help="one of the parts")
    parser.add_argument(
        "--recordings",
        metavar="FOLDER",
        help=f"of real recordings, each a folder with a file `settings` (default: what {recordings.VARIABLE} names)",
    )
    parser.add_argument("--quick", action="store_true", help="few drives, few frames: does it run?")
    return parser


def _quality(kinds: Sequence[str], seeds: Sequence[int]) -> str:
    found = quality.Quality()
    _progress(quality.run_drives(kinds, seeds, found), len(kinds) * len(seeds))
    data = {
        "seeds": seeds,
        "summary": quality.summary(found),
        "scores": {
            kind: {name: [quality.as_numbers(each) for each in scores] for name, scores in methods.items()}
            for kind, methods in found.scores.items()
        },
        "sizes": found.sizes,
    }
    return report.write(
        "quality", f"Detection quality, seeds {', '.join(map(str, seeds))}", quality.tables(found), data
    )


def _recordings(folder: str | None) -> str:
    if folder is None:
        return f"Real recordings: none; name a folder with --recordings or {recordings.VARIABLE}"
    found: list[recordings.Result] = []
    _progress(recordings.run(Path(folder), found), None)
    sheet = recordings.write_sheet(found, SHEET)
    data = {"recordings": {each.name: recordings.as_numbers(each) for each in found}}
    text = report.write("recordings", "Real recordings", recordings.tables(found), data)
    return f"{text}\nPictures to look at: {sheet}"


def _speed(*, quick: bool) -> str:
    found = speed.Speed()
    _progress(speed.measure(found, quick=quick), None)
    return report.write("speed", "Speed and memory", speed.tables(found), {"speed": found})


def _progress(steps: Iterable[str], total: int | None) -> None:
    with tqdm(steps, total=total, disable=None, file=sys.stderr, ncols=80) as bar:
        for done in bar:
            bar.set_postfix_str(done)


def _kinds(text: str) -> list[str]:
    kinds = text.split(",")
    for kind in kinds:
        if kind not in KINDS:
            raise UsageError(f"--kinds: {kind} is no kind of drive; one of {', '.join(KINDS)}")
    return kinds


def _numbers(text: str) -> list[int]:
    try:
        ends = [[int(end) for end in part.split("-")] for part in text.split(",")]
    except ValueError as error:
        raise UsageError(f"--seeds {text}: write 0-4 or 0,2,7") from error
    return [seed for first, *last in ends for seed in range(first, (last or [first])[0] + 1)]


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


if __name__ == "__main__":
    sys.exit(main())
