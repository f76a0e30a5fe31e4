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
    "_derotate": "0. rotation out, circles and ψ predicted",
    "_edge_expert.predict": "3. edges predicted",
    "_line_expert.omit": "1. ψ omits, and looks in passing",
    "groups.collect": "1. λ groups",
    "_edge_expert.find": "2. corners found for edges",
    "_refine": "3. rotation that the gyro missed",
    "_edge_expert.update": "3. edges classified and updated",
    "_edge_expert.delete": "3. edges deleted",
    "_edge_expert.add": "3. new edges",
    "_edge_expert.join_rebels": "3. new edges inside rebel circles",
    "_alpha.mark_key": "5. key frame",
    "_alpha.detect": "5. α, rebels",
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


def _timed(filters: LineCircleFilter, path: str) -> list[float]:
    """Let a method of the filter, or of one of its parts, note how long each call takes, µs."""
    *owner, name = path.split(".")
    part: Any = filters
    for each in owner:
        part = getattr(part, each)
    method: Callable[..., Any] = getattr(part, name)
    times_us: list[float] = []

    def timed(*arguments: Any) -> Any:
        started = time.perf_counter_ns()
        answer = method(*arguments)
        times_us.append((time.perf_counter_ns() - started) / 1000)
        return answer

    setattr(part, name, timed)
    return times_us
