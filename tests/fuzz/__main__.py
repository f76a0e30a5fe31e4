"""``python -m tests.fuzz [PARSER …]``: attack each parser in a process of its own; status 1: something was found."""

import argparse
import json
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

from tests.fuzz.hunt import MEMORY, kept
from tests.fuzz.targets import TARGETS, chosen

REGRESSIONS = Path(__file__).with_name("regressions")
PATIENCE_S = 60.0  # beyond the time of the hunt: start, shrinking, one last input


def hunted(name: str, seconds: float, seed: int, findings: Path) -> dict[str, str]:
    """Attack by mutation; the findings, and a line about them on standard output."""
    with tempfile.TemporaryDirectory(dir=MEMORY) as folder:
        current = Path(folder, "current")
        command = [sys.executable, "-m", "tests.fuzz.hunt", name, str(seconds), str(seed), str(findings), str(current)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=seconds + PATIENCE_S, check=False)
        except subprocess.TimeoutExpired:
            return {"the process hangs": kept(findings, current.read_bytes())}
        if done.returncode:
            data = current.read_bytes() if current.exists() else b""
            last = (done.stderr.strip().splitlines() or ["no word"])[-1]
            return {f"the process ended with {done.returncode}: {last}": kept(findings, data)}
    report = json.loads(done.stdout.splitlines()[-1])
    inputs, outcomes, grown_mib = (report[key] for key in ("inputs", "outcomes", "grown_mib"))
    say(f"{name:<22} {inputs:>8} inputs {inputs / seconds:>8.0f}/s {outcomes:>5} outcomes {grown_mib:>6.1f} MiB more")
    return dict(report["findings"])


def covered(name: str, seconds: float, seed: int, findings: Path) -> dict[str, str]:
    """Attack guided by coverage."""
    command = [sys.executable, "-m", "tests.fuzz.coverage", name, str(int(seconds)), str(seed), str(findings)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds + PATIENCE_S, check=False)
    lines = done.stderr.splitlines()
    numbers = [line for line in lines if "cov:" in line or "number_of_executed_units" in line]
    say(f"{name:<22} {' '.join(' '.join(numbers[-2:]).split())[:90]}")
    if not done.returncode:
        return {}
    kept_as = next(
        (line.rpartition("Test unit written to ")[2] for line in lines if "Test unit written to" in line), ""
    )
    what = next((line for line in lines if "Error:" in line or "ERROR:" in line), f"status {done.returncode}")
    return {what.strip(): kept_as}


def say(text: str) -> None:
    """A line, at once."""
    print(text, flush=True)  # noqa: T201


def main() -> int:
    """Run. Return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("parsers", nargs="*", metavar="PARSER", help=f"of {', '.join(TARGETS)}; default: all")
    parser.add_argument("--seconds", type=float, default=10.0, help="for each parser (default: 10)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--engine", choices=("auto", "mutation", "coverage"), default="auto")
    parser.add_argument("--findings", type=Path, default=REGRESSIONS, help="folder (default: the regressions)")
    arguments = parser.parse_args()
    unknown = set(arguments.parsers) - set(TARGETS)
    if unknown:
        parser.error(f"no parser {', '.join(sorted(unknown))}; there are {', '.join(TARGETS)}")
    guided = arguments.engine == "coverage" or (arguments.engine == "auto" and find_spec("atheris") is not None)
    found = False
    for name in chosen(arguments.parsers):
        attack = covered if guided else hunted
        for what, where in attack(name, arguments.seconds, arguments.seed, arguments.findings / name).items():
            found = True
            say(f"{name:<22} FOUND {what}: {where}")
    return int(found)


if __name__ == "__main__":
    sys.exit(main())
