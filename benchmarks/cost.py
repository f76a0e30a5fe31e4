"""``python -m benchmarks.cost``: instructions and cache misses per frame, and the time that they take on a vehicle.

A virtual machine has no hardware counters, and the vehicle's computer is not at hand. So valgrind counts on x86-64,
with the caches of the vehicle's processors simulated, and with ``--wheel FILE``, as root, qemu counts the instructions
on 64-bit Arm. The cost of a frame is the difference between a short and a long run, divided by the difference in
frames.
"""

import argparse
import os
import re
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.report import Table, write
from lcf_edge.errors import LcfError
from lcf_edge.rendered import scenes
from release.debian import MACHINES, run, unpacked
from release.trial import PACKAGES, SUITE, install

FEW, MANY = 20, 60
PARTS = ("detect", "whole")
HERE = Path(__file__).parent


@dataclass(frozen=True, slots=True)
class Core:
    """A processor core and its assumed properties.

    Caches: bytes, ways; the first one is two, of instructions and of data. ``ipc``: instructions a cycle while no cache
    misses. ``near_ns``: a miss of the first cache that the last one serves; ``far_ns``: one that memory serves.
    """

    name: str
    instructions: tuple[int, int]
    first: tuple[int, int]
    last: tuple[int, int]
    clock_ghz: float
    ipc: float
    near_ns: float
    far_ns: float

    def options(self) -> list[str]:
        """Of valgrind."""
        caches = {"I1": self.instructions, "D1": self.first, "LL": self.last}
        return [f"--{name}={size},{ways},64" for name, (size, ways) in caches.items()]

    def ms(self, cost: "Cost", instructions: float) -> tuple[float, float]:
        """Time of so many instructions: with every miss hidden behind other work, and with none."""
        least = instructions / self.ipc / self.clock_ghz / 1e6
        stalls = (cost.first_misses - cost.last_misses) * self.near_ns + cost.last_misses * self.far_ns
        return least, least + stalls / 1e6


CORES = (
    Core("Cortex-A72, 1.8 GHz (Raspberry Pi 4)", (49152, 3), (32768, 2), (1 << 20, 16), 1.8, 1.3, 9.0, 130.0),
    Core("Cortex-A76, 2.4 GHz (Raspberry Pi 5)", (65536, 4), (65536, 4), (1 << 21, 16), 2.4, 2.2, 6.0, 110.0),
)


@dataclass(frozen=True, slots=True)
class Cost:
    """Of one frame."""

    instructions: float
    first_misses: float = 0.0  # of the first cache, instructions and data
    last_misses: float = 0.0  # of the last one

    def __sub__(self, other: "Cost") -> "Cost":
        return Cost(
            self.instructions - other.instructions,
            self.first_misses - other.first_misses,
            self.last_misses - other.last_misses,
        )

    def __truediv__(self, frames: int) -> "Cost":
        return Cost(self.instructions / frames, self.first_misses / frames, self.last_misses / frames)


def of_a_frame(count: Callable[[str, int], Cost], part: str) -> Cost:
    """``count`` says what a run of so many frames of a part costs."""
    return (count(part, MANY) - count(part, FEW)) / (MANY - FEW)


def frames_run(drive: Path, part: str, frames: int) -> tuple[str, ...]:
    """What Python runs; ``-P``: else ``benchmarks/drivers.py`` would be imported for ``drivers``."""
    return "-P", str(HERE / "cost_of_frames.py"), str(drive), part, str(frames)


def by_valgrind(drive: Path, core: Core) -> Callable[[str, int], Cost]:
    """Count on this processor with the caches of the given core."""

    def count(part: str, frames: int) -> Cost:
        options = ["--tool=cachegrind", "--cache-sim=yes", "--cachegrind-out-file=/dev/null", *core.options()]
        child = (sys.executable, *frames_run(drive, part, frames))
        return read_cachegrind(run("sh", "-c", 'exec "$@" 2>&1', "sh", "valgrind", *options, *child))

    return count


def read_cachegrind(output: str) -> Cost:
    """Parse cachegrind's summary. Raises ``LcfError`` if there is none."""
    found = dict(re.findall(r"^==\d+== (\S+) +(?:refs|misses): +([\d,]+)", output, re.MULTILINE))
    try:
        counts = {name: float(number.replace(",", "")) for name, number in found.items()}
        return Cost(counts["I"], counts["I1"] + counts["D1"], counts["LLi"] + counts["LLd"])
    except KeyError as missing:
        raise LcfError(f"valgrind did not count {missing}: {output.strip().splitlines()[-1:]}") from missing


def by_qemu(drive: Path, wheel: Path, place: Path) -> Callable[[str, int], Cost]:
    """Count on 64-bit Arm, with this wheel installed into ``place``."""
    machine = MACHINES["aarch64"]
    root = unpacked(machine, SUITE, PACKAGES)
    install(machine, wheel, place / "wheel")
    plugin = place / "instructions.so"
    run("gcc", "-O2", "-shared", "-fPIC", "-o", str(plugin), str(HERE / "instructions.c"))

    def count(part: str, frames: int) -> Cost:
        child = (str(root / "usr/bin/python3"), *frames_run(drive, part, frames))
        environment = {**os.environ, "PYTHONPATH": str(place / "wheel"), "PYTHONHOME": str(root / "usr")}
        output = run(
            *("sh", "-c", 'exec "$@" 2>&1', "sh", "qemu-aarch64", "-L", str(root), "-plugin", str(plugin), *child),
            environment=environment,
        )
        found = re.search(r"^instructions: (\d+)$", output, re.MULTILINE)
        if found is None:
            raise LcfError(f"qemu counted nothing: {output.strip().splitlines()[-1:]}")
        return Cost(float(found[1]))

    return count


def tables(counted: dict[str, dict[str, Cost]], arm: dict[str, Cost]) -> list[Table]:
    """``counted``: of each core and part; ``arm``: of each part, empty: not counted."""
    rows = [
        [name, part, _millions(cost.instructions), f"{cost.first_misses:,.0f}", f"{cost.last_misses:,.0f}"]
        for name, parts in counted.items()
        for part, cost in parts.items()
    ]
    found = [Table("Of a frame, x86-64", ["caches of", "part", "instructions", "first misses", "last misses"], rows)]
    if arm:
        rows = [[part, _millions(cost.instructions)] for part, cost in arm.items()]
        found.append(Table("Of a frame, 64-bit Arm", ["part", "instructions"], rows))
    rows = []
    for core in CORES:
        for part, cost in counted[core.name].items():
            least, most = core.ms(cost, arm.get(part, cost).instructions)
            rows.append([core.name, part, f"{least:.2f} to {most:.2f}"])
    found.append(Table("Estimate, ms a frame", ["core", "part", "all misses hidden to none"], rows))
    return found


def _millions(number: float) -> str:
    return f"{number / 1e6:.2f} million"


def main(arguments: Sequence[str] | None = None) -> int:
    """Count, print, write; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cost", description=__doc__)
    parser.add_argument("--wheel", type=Path, help="for 64-bit Arm, of make wheels")
    wheel = parser.parse_args(arguments).wheel
    try:
        with tempfile.TemporaryDirectory() as name:
            place = Path(name)
            drive = scenes.write(scenes.make("two_crossing", 1, seconds=MANY / 20), place / "drive")
            counted = {
                core.name: {part: of_a_frame(by_valgrind(drive, core), part) for part in PARTS} for core in CORES
            }
            arm = {}
            if wheel:
                count = by_qemu(drive, wheel.resolve(), place)
                arm = {part: of_a_frame(count, part) for part in PARTS}
        sys.stdout.write(write("cost", "Cost of a frame", tables(counted, arm), {"x86_64": counted, "aarch64": arm}))
    except LcfError as error:
        sys.stderr.write(f"cost: {error}\n")
        return error.exit_status
    return 0


if __name__ == "__main__":
    sys.exit(main())
