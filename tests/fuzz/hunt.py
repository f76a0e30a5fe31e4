"""One process that attacks one parser: any exception, warning, hang or growth of memory is a finding.

A finding's input is made small and kept in a file named by its hash; ``Report`` goes to standard output as JSON. The
input in hand stands in ``current`` of the folder, for whoever finds this process dead.
"""

import hashlib
import json
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path

from tests.fuzz.mutation import Mutator
from tests.fuzz.targets import TARGETS, Take, Target

HANG_S = 5.0
ENDLESS_BYTES = 8 * 2**30  # of address space: the machine's protection, not a parser's measure
SHRINK_S = 2.0
MEMORY = "/dev/shm" if Path("/dev/shm").is_dir() else None  # where files cost nothing
_KIB_A_MIB = 1024


class HangError(Exception):
    """An input took too long."""


@dataclass
class Report:
    """What became of a hunt: ``outcomes`` that differ, ``findings`` (what, and the file with the input)."""

    name: str
    inputs: int = 0
    outcomes: int = 0
    grown_mib: float = 0.0
    findings: dict[str, str] = field(default_factory=dict)


@contextmanager
def strict() -> Iterator[None]:
    """Warnings are errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


@contextmanager
def alarmed() -> Iterator[None]:
    """What ``tried`` waits for too long raises ``HangError``."""

    def hang(*_: object) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, hang)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def peak_mib(*, afresh: bool = False) -> float:
    """The most memory that this process had resident, ever or since it was last measured ``afresh`` (proc(5))."""
    if afresh:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    return int(status.partition("VmHWM:")[2].split()[0]) / _KIB_A_MIB


def tried(take: Take, data: bytes) -> str:
    """What became of an input. Raises whatever the parser raises, and ``HangError``."""
    signal.setitimer(signal.ITIMER_REAL, HANG_S)
    try:
        return take(data)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def place(error: BaseException) -> str:
    """What a finding is called: the same mistake has the same name."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "site-packages" not in frame.filename]
    where = frames[-1] if frames else None
    return f"{type(error).__name__} at {Path(where.filename).name}:{where.lineno}" if where else type(error).__name__


def shrunk(take: Take, data: bytes, name: str) -> bytes:
    """A smaller input with the same finding, as far as ``SHRINK_S`` reaches."""
    end_s = time.monotonic() + SHRINK_S
    step = max(len(data) // 2, 1)
    while step and time.monotonic() < end_s:
        at = 0
        while at < len(data) and time.monotonic() < end_s:
            shorter = data[:at] + data[at + step :]
            try:
                tried(take, shorter)
                at += step
            except Exception as error:  # noqa: BLE001  # anything is what is looked for
                if place(error) == name:
                    data = shorter
                else:
                    at += step
        step //= 2
    return data


def kept(folder: Path, data: bytes) -> str:
    """Write an input that is a finding. Return the name of its file."""
    path = folder / hashlib.sha256(data).hexdigest()[:12]
    folder.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)
    return str(path)


def hunt(target: Target, seconds: float, seed: int, findings: Path, current: Path) -> Report:
    """Attack for so long."""
    report = Report(target.name)
    seeds = list(target.seeds())
    mutator = Mutator(seeds, target.tokens, seed)
    outcomes: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(dir=MEMORY) as scratch, target.opened(Path(scratch)) as take, strict(), alarmed():
        for data in seeds:
            outcomes[tried(take, data)] += 1
        begun_mib, end_s = peak_mib(afresh=True), time.monotonic() + seconds
        while time.monotonic() < end_s:
            data = mutator.draw()
            current.write_bytes(data)
            report.inputs += 1
            try:
                outcome = tried(take, data)
            except Exception as error:  # noqa: BLE001  # anything is what is looked for
                name = place(error)
                if name not in report.findings:
                    report.findings[name] = kept(findings, shrunk(take, data, name))
                continue
            if peak_mib() - begun_mib > target.grows_mib:  # told once: the mark was passed for ever
                report.findings[f"memory grown by {peak_mib() - begun_mib:.0f} MiB"] = kept(findings, data)
                break
            outcomes[outcome] += 1
            if outcomes[outcome] == 1:
                mutator.keep(data)
        report.grown_mib = round(peak_mib() - begun_mib, 1)
    report.outcomes = len(outcomes)
    return report


def main() -> None:
    """``python -m tests.fuzz.hunt NAME SECONDS SEED FINDINGS CURRENT``"""
    name, seconds, seed, findings, current = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_AS, (ENDLESS_BYTES, ENDLESS_BYTES))
    report = hunt(TARGETS[name], float(seconds), int(seed), Path(findings), Path(current))
    print(json.dumps(asdict(report)))  # noqa: T201


if __name__ == "__main__":
    main()
