"""``python -m benchmarks.closed_loop``: compares methods by driving the same worlds with the same planner.

Every driver drives through every world. The planner with the ground truth of everything in sight is the upper bound, a
blind vehicle the lower one. Prints the tables and writes them to ``benchmarks/results/drive.md``; writes a video of the
worst drive.
"""

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import cv2
from tqdm import tqdm

from benchmarks import drive_video, report
from benchmarks.drivers import BLIND, CIRCLES, NAMES, OBJECTS, TRUTH, TruthDriver, driver
from benchmarks.report import Table, number
from hil_mocks.closed_loop import worlds
from hil_mocks.closed_loop.loop import Log, Moment, drive
from hil_mocks.closed_loop.outcome import Outcome, brakes, judge, pool
from hil_mocks.closed_loop.world import World

_SIGHTED = (TRUTH, BLIND)  # they need no images


class _Judged:
    """A driver, with the planner with ground truth, which is asked but does not drive."""

    def __init__(self, world: World, name: str) -> None:
        self._driver, self._truth = driver(world, name), TruthDriver(world)
        self.right: list[bool] = []

    def decide(self, moment: Moment) -> float:
        """The speed that the driver wants now, m/s."""
        self.right.append(brakes(self._truth.decide(moment), moment.cruise_mps))
        return self._driver.decide(moment)


@dataclass(frozen=True, slots=True)
class Result:
    """One world, each driver."""

    seed: int
    cruise_mps: float
    condition: str
    events: tuple[str, ...]
    outcomes: dict[str, Outcome] = field(default_factory=dict)


def contest(seed: int, names: Sequence[str], wait_s: float = 1.0) -> Result:
    """Run drivers through the world of a seed; ``wait_s``: how long they stand before a box that ends their course."""
    cv2.setNumThreads(1)
    world = worlds.make(seed).changed(arrived_s=wait_s)
    result = Result(seed, world.cruise_mps, world.condition, world.events)
    logs: dict[str, Log] = {}
    rights: dict[str, list[bool]] = {}
    for name in (TRUTH, BLIND, *(name for name in names if name not in _SIGHTED)):
        judged = _Judged(world, name)
        logs[name] = drive(world, judged, with_images=name not in _SIGHTED)
        rights[name] = judged.right
    for name in names:
        result.outcomes[name] = judge(logs[name], rights[name], world.fps, logs[TRUTH], logs[BLIND])
    return result


def tables(results: Sequence[Result], names: Sequence[str]) -> list[Table]:
    """All worlds; by cruise speed; by fault of sensors or light; by what was hit."""
    found = [_table("All worlds", results, names)]
    for low, high in worlds.CRUISES_MPS:
        some = [result for result in results if low <= result.cruise_mps < high]
        found.append(_table(f"Cruise speed {low:g} to {high:g} m/s", some, names))
    found += [
        _table(condition.capitalize(), [result for result in results if result.condition == condition], names)
        for condition in dict.fromkeys(worlds.CONDITIONS)
    ]
    return [*(table for table in found if table.rows), _hits(results, names)]


def _table(title: str, results: Sequence[Result], names: Sequence[str]) -> Table:
    rows = []
    for name in names if results else ():
        whole = pool([result.outcomes[name] for result in results])
        share = number(100 * whole.for_nothing / whole.brakings, 1) + " %" if whole.brakings else "-"
        rows.append(
            (
                name,
                str(whole.threats),
                str(len(whole.collisions)),
                str(whole.unseen),
                number(whole.contact_mps, 2) if whole.collisions else "-",
                str(whole.brakings),
                str(whole.for_nothing),
                share,
                number(100 * whole.mean_speed_share, 1) + " %",
            )
        )
    heads = (
        "driver",
        "threats",
        "collisions",
        "out of view",
        "at m/s",
        "brakings",
        "for nothing",
        "",
        "mean speed of that with the truth",
    )
    return Table(f"{title} ({len(results)} worlds)", heads, rows)


def _hits(results: Sequence[Result], names: Sequence[str]) -> Table:
    hit: dict[str, Counter[str]] = defaultdict(Counter)
    for result in results:
        for name in names:
            for contact in result.outcomes[name].collisions:
                hit[contact.name.partition("_")[0]][name] += 1
    rows = [(what, *(str(count[name]) for name in names)) for what, count in sorted(hit.items())]
    return Table("What was run into", ("", *names), rows)


def worst(results: Sequence[Result], name: str) -> Result:
    """Return the world in which a driver did worst: collisions, then false brakings, then speed."""

    def badness(result: Result) -> tuple[float, ...]:
        outcome = result.outcomes[name]
        return sum(each.speed_mps for each in outcome.collisions), outcome.for_nothing, -outcome.mean_speed_share

    return max(results, key=badness)


def _run(seeds: Sequence[int], names: Sequence[str], wait_s: float, jobs: int) -> Iterator[Result]:
    if jobs == 1:
        yield from (contest(seed, names, wait_s) for seed in seeds)
        return
    with ProcessPoolExecutor(jobs) as pool_of_processes:
        yield from pool_of_processes.map(contest, seeds, [names] * len(seeds), [wait_s] * len(seeds))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the requested worlds; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.closed_loop", description=__doc__)
    parser.add_argument("--worlds", type=int, default=12, help="how many (default 12)")
    parser.add_argument("--seed", type=int, default=0, help="of the first (default 0)")
    parser.add_argument("--drivers", default=",".join(NAMES), help="with commas (default all: %(default)s)")
    parser.add_argument("--wait", type=float, default=1.0, help="before a box that ends the course, s (default 1)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--video", type=Path, default=Path("drive-out"), help="folder of the video (default drive-out)")
    options = parser.parse_args(arguments)
    names = options.drivers.split(",")
    unknown = sorted(set(names) - set(NAMES))
    if unknown or options.worlds < 1 or options.seed < 0 or options.jobs < 1:
        sys.stderr.write(f"benchmarks.closed_loop: {', '.join(unknown) or 'a number'}: unknown or too small\n")
        return 2
    seeds = range(options.seed, options.seed + options.worlds)
    results = []
    with tqdm(total=len(seeds), disable=None, file=sys.stderr, ncols=80) as bar:
        for result in _run(seeds, names, options.wait, options.jobs):
            results.append(result)
            bar.update()
    data = {"seeds": [seeds[0], seeds[-1]], "drivers": names, "results": results}
    title = f"Closed loop, seeds {seeds[0]} to {seeds[-1]}"
    sys.stdout.write(report.write("drive", title, tables(results, names), data) + "\n")
    filmed = next((name for name in (OBJECTS, CIRCLES, *names) if name in names and name not in _SIGHTED), None)
    if filmed:
        result = worst(results, filmed)
        path = drive_video.write(worlds.make(result.seed), filmed, options.video)
        sys.stdout.write(f"worst drive of {filmed}: world {result.seed}, {', '.join(result.events)}: {path}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
