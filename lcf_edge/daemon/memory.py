"""The memory budget of the whole process: checked at startup, monitored, and enforced by shedding."""

import os
import weakref
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from lcf_edge.config import Config
from lcf_edge.daemon.log import LOGGER
from lcf_edge.errors import ConfigError
from lcf_edge.lens import Lens
from lcf_edge.pipeline import Pipeline

PROGRAM_MIB = 68.0
"""MiB of Python, NumPy, OpenCV, an open Zenoh session and the program, without tables and images."""

SHED_AT = 0.9  # of the budget
GROWN_MIB = 1.0
_STATM = Path("/proc/self/statm")
_MIB = 2**20

_FRAME_BYTES_A_PIXEL = 12  # buffers of the driver (2 bytes, 4 of them), one waiting, one in work, scratch
RECORDER_MIB = 6.0
"""MiB of the format's library, a chunk on its way to the disk and a file's index, without ``record.buffer_mib``."""

_CORNER_BYTES = 1500  # work space for one corner in detection and matching


class ResidentMemory:
    """Measures the resident memory of this process, MiB, by one descriptor that it keeps open."""

    def __init__(self, statm: Path = _STATM) -> None:
        self._file = os.open(statm, os.O_RDONLY | os.O_CLOEXEC)
        self._close = weakref.finalize(self, os.close, self._file)

    def __call__(self) -> float:
        """Return the resident memory, MiB."""
        return int(os.pread(self._file, 128, 0).split()[1]) * os.sysconf("SC_PAGE_SIZE") / _MIB


def needs_mib(config: Config) -> dict[str, float]:
    """Return the need of each part, MiB, without the preview, which is given up first. Raises ``ConfigError``."""
    camera = config.camera
    pixels = camera.width * camera.height
    table_bytes = sum(Pipeline(config, Lens.from_config(camera, camera.width, camera.height)).table_bytes().values())
    needs = {
        "the program": PROGRAM_MIB,
        "images": pixels * _FRAME_BYTES_A_PIXEL / _MIB,
        "tables": (table_bytes + config.memory.corners * _CORNER_BYTES) / _MIB,
    }
    if config.record.when != "never":
        needs["recording"] = RECORDER_MIB + config.record.buffer_mib
    return needs


_REMEDIES = {
    "images": "lower camera.width and camera.height",
    "tables": "lower the other keys of memory",
    "recording": "lower record.buffer_mib",
}


def check_budget(config: Config) -> None:
    """Refuse a configuration that needs more than its budget. Raises ``ConfigError`` that says what to lower."""
    needs = needs_mib(config)
    needed_mib = sum(needs.values())
    limit_mib = SHED_AT * config.memory.budget_mib
    if needed_mib <= limit_mib:
        return
    most = max(_REMEDIES, key=lambda part: needs.get(part, 0))
    remedy = f"{_REMEDIES[most]}, or raise it" if limit_mib > PROGRAM_MIB else "raise it"
    parts = ", ".join(f"{part} {size_mib:.0f}" for part, size_mib in needs.items())
    raise ConfigError(
        f"memory.budget_mib: about {needed_mib:.0f} MiB are needed ({parts}), {SHED_AT:.0%} of the budget of "
        f"{config.memory.budget_mib:g} is less; {remedy} to {needed_mib / SHED_AT + 1:.0f}"
    )


@dataclass(frozen=True, slots=True)
class Shedding:
    """Something that can be given up."""

    name: str
    give_up: Callable[[], object]


class MemoryWatch:
    """Gives up something when more than ``SHED_AT`` of the budget is resident, and more if that was not enough.

    Freed memory seldom returns to the system: it was enough unless ``GROWN_MIB`` more are resident, or more than the
    budget.
    ``resident_mib``: at the last ``check``. ``shed``: what was given up; it stays so until a restart.
    """

    def __init__(self, budget_mib: float, order: Sequence[Shedding], measure_mib: Callable[[], float]) -> None:
        self.budget_mib = budget_mib
        self.resident_mib = measure_mib()
        self._order = list(order)
        self._mark_mib = SHED_AT * budget_mib
        self._measure_mib = measure_mib
        self.shed: list[str] = []

    def check(self) -> None:
        """Measure, and give up the next item if it is too much; one a call, so that it can take effect."""
        self.resident_mib = self._measure_mib()
        if self.resident_mib <= self._mark_mib or not self._order:
            return
        self._mark_mib = min(self.resident_mib + GROWN_MIB, self.budget_mib)
        thing = self._order.pop(0)
        thing.give_up()
        self.shed.append(thing.name)
        LOGGER.warning(
            "memory: %.0f MiB of a budget of %g are resident, gave up %s; raise memory.budget_mib or lower memory.*",
            self.resident_mib,
            self.budget_mib,
            thing.name,
        )
