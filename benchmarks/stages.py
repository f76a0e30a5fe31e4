"""Where the filter's time goes: its steps on one drive, each timed by itself."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.methods import FILTER, FilterMethod
from benchmarks.playing import feed
from hil_mocks.drives import Drive
from lcf_edge.config import Config
from lcf_edge.filter import LineCircleFilter
from lcf_edge.lens import Lens

STEPS = {
    "_take": "0. corners taken, sorted by cells",
    "_derotate": "0. rotation out, circles and ψ predicted",
    "_predict": "1. edges predicted",
    "_omit": "2. ψ omits, and looks in passing",
    "_collect": "2. λ groups",
    "_find": "3. corners found for edges",
    "_refine": "3. rotation that the gyro missed",
    "_update": "4. edges classified, updated, deleted",
    "_add": "4. new edges",
    "_detect": "5. key frame, α, rebels",
    "_update_circles": "6. circles, 7. feedback",
}
_WARM_UP = 20


@dataclass(frozen=True, slots=True)
class Stage:
    """One step of the filter; µs a frame, medians."""

    name: str
    median: float
    share: float  # of all steps


def measure(drive: Drive, config: Config) -> list[Stage]:
    """Run the drive and time each step of the filter."""
    method = FilterMethod(config, Lens.from_config(config.camera, drive.lens.width, drive.lens.height))
    spent = {name: _timed(method.pipeline.filter, path) for path, name in STEPS.items()}
    for _ in feed(drive, {FILTER: method}):
        pass
    medians = {name: float(np.median(times_us[_WARM_UP:])) for name, times_us in spent.items()}
    total = sum(medians.values())
    return [Stage(name, median, median / total) for name, median in medians.items()]


def _timed(filters: LineCircleFilter, name: str) -> list[float]:
    """Let a method of the filter note how long each call takes, µs."""
    method: Callable[..., Any] = getattr(filters, name)
    times_us: list[float] = []

    def timed(*arguments: Any) -> Any:
        started = time.perf_counter_ns()
        result = method(*arguments)
        times_us.append((time.perf_counter_ns() - started) / 1000)
        return result

    setattr(filters, name, timed)
    return times_us
