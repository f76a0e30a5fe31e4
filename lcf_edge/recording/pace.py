"""Which part of a recording is replayed, and how fast."""

import math
from dataclasses import dataclass

SLOWEST, FASTEST = 0.01, 100.0  # multiples of real time


@dataclass(frozen=True, slots=True)
class Pace:
    """The options of a replay."""

    start_s: float = 0.0  # after the first image
    duration_s: float = math.inf
    speed: float | None = None  # multiple of real time; None: as fast as possible
    loop: bool = False  # begin again at the end
    step: bool = False  # wait before each frame
