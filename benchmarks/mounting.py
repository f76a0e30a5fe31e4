"""``python -m benchmarks.mounting``: whether the learnt mounting of the camera is as uncertain as it says.

Rendered drives are played from a configuration that is right and from one that is 2° off. What is learnt by the end of
each is compared with the truth. Prints the table and writes it to ``benchmarks/results/mounting.md``.
"""

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
from msgspec.structs import replace
from tqdm import tqdm

from benchmarks import report
from benchmarks.methods import FilterMethod
from benchmarks.playing import config_of, feed
from benchmarks.report import Table, number
from lcf_edge.lens import Lens
from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import Drive

OFF_RAD = math.radians(2.0)
STARTS = {"right": (0.0, 0.0), "2° off": (OFF_RAD, -OFF_RAD)}  # error of the configured pitch and yaw


@dataclass(frozen=True, slots=True)
class Learnt:
    """Of one drive: error and 1 sigma of the learnt mounting, rad."""

    kind: str
    start: str
    pitch_rad: float
    pitch_sigma_rad: float
    yaw_rad: float
    yaw_sigma_rad: float


def learn(drive: Drive) -> list[Learnt]:
    """Play a drive, whose camera looks along the vehicle, from each of ``STARTS``."""
    methods = {}
    for start, (pitch_rad, yaw_rad) in STARTS.items():
        config = config_of(drive)
        camera = replace(config.camera, pitch_rad=drive.camera_pitch_rad + pitch_rad, yaw_rad=yaw_rad)
        lens = Lens.from_config(camera, drive.lens.width, drive.lens.height)
        methods[start] = FilterMethod(replace(config, camera=camera), lens)
    for _ in feed(drive, methods):
        pass
    found = []
    for start, method in methods.items():
        learnt = method.pipeline.mounting
        pitch_rad = learnt.pitch_rad - drive.camera_pitch_rad
        found.append(Learnt(drive.kind, start, pitch_rad, learnt.pitch_sigma_rad, learnt.yaw_rad, learnt.yaw_sigma_rad))
    return found


def table(found: Sequence[Learnt]) -> Table:
    """Errors, and the shares of them within one and two sigmas."""
    rows = []
    for start in STARTS:
        some = [each for each in found if each.start == start]
        for angle, errors, sigmas in (
            ("pitch", [each.pitch_rad for each in some], [each.pitch_sigma_rad for each in some]),
            ("yaw", [each.yaw_rad for each in some], [each.yaw_sigma_rad for each in some]),
        ):
            off = np.abs(np.array(errors) / np.array(sigmas))
            worst = int(np.argmax(off))
            rows.append(
                (
                    f"{angle}, configured {start}",
                    number(math.degrees(float(np.median(np.abs(errors)))), 2) + "°",
                    number(math.degrees(float(np.median(sigmas))), 2) + "°",
                    f"{100 * float(np.mean(off < 1)):.0f} %",
                    f"{100 * float(np.mean(off < 2)):.0f} %",
                    f"{math.degrees(errors[worst]):.2f}° ({some[worst].kind})",
                )
            )
    return Table(
        "At the end of the drive",
        ("", "error, median", "sigma, median", "inside one", "inside two", "most sigmas off"),
        rows,
    )


def _play(task: tuple[str, int]) -> list[Learnt]:
    cv2.setNumThreads(1)
    return learn(scenes.make(*task))


def _run(tasks: Sequence[tuple[str, int]], jobs: int) -> Iterator[list[Learnt]]:
    if jobs == 1:
        yield from map(_play, tasks)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(_play, tasks)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, and write it to ``benchmarks/results``."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mounting", description=__doc__)
    parser.add_argument("--kinds", default="all", help="of rendered drives, with commas (default all)")
    parser.add_argument("--seeds", default="90,91", help="with commas (default %(default)s)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    options = parser.parse_args(arguments)
    kinds = scenes.KINDS if options.kinds == "all" else tuple(options.kinds.split(","))
    seeds = [int(seed) for seed in options.seeds.split(",")]
    found: list[Learnt] = []
    tasks = [(kind, seed) for kind in kinds for seed in seeds]
    with tqdm(total=len(tasks), disable=None, file=sys.stderr, ncols=80) as bar:
        for some in _run(tasks, options.jobs):
            found += some
            bar.update()
    title = f"Learnt mounting, {len(kinds)} kinds of rendered drives, seeds {options.seeds}"
    sys.stdout.write(report.write("mounting", title, [table(found)], {"seeds": seeds, "drives": found}) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
