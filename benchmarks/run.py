"""``python -m benchmarks.run``: detection quality and speed of the filter and its peers, in one run.

Prints the tables and writes them to ``benchmarks/results/``.
"""

import argparse
import sys
from collections.abc import Iterable, Sequence

import cv2
from tqdm import tqdm

from benchmarks import quality, report, speed
from hil_mocks.scenes import KINDS
from lcf_edge.errors import LcfError, UsageError

_QUICK_KINDS = ("passing", "ahead", "crossing", "turn")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked for; answers with the exit status."""
    options = _parser().parse_args(arguments)
    cv2.setNumThreads(1)
    try:
        kinds = _kinds(options.kinds or ",".join(_QUICK_KINDS if options.quick else KINDS))
        seeds = _numbers(options.seeds or ("0" if options.quick else "0-4"))
        if options.only in (None, "quality"):
            _say(_quality(kinds, seeds))
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
    parser.add_argument("--only", choices=("quality", "speed"), help="one of the two parts")
    parser.add_argument("--quick", action="store_true", help="few drives, few frames: does it run?")
    return parser


def _quality(kinds: Sequence[str], seeds: Sequence[int]) -> str:
    found = quality.Quality()
    _progress(quality.run_drives(kinds, seeds, found), len(kinds) * len(seeds))
    _progress(quality.run_recordings(found), None)
    data = {
        "seeds": seeds,
        "summary": quality.summary(found),
        "scores": {
            kind: {name: [quality.as_numbers(each) for each in scores] for name, scores in methods.items()}
            for kind, methods in found.scores.items()
        },
        "sizes": found.sizes,
        "recordings": found.recordings,
    }
    return report.write(
        "quality", f"Detection quality, seeds {', '.join(map(str, seeds))}", quality.tables(found), data
    )


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
