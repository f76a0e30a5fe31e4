"""Which part of a recording is replayed, and how fast."""

import math
from dataclasses import dataclass

SLOWEST, FASTEST = 0.01, 100.0  # times as fast as it was made


@dataclass(frozen=True, slots=True)
class Pace:
    """The options of a replay."""

    start_s: float = 0.0  # after the first picture
    duration_s: float = math.inf
    speed: float | None = None  # 1: as fast as it was made; None: as fast as it goes
    loop: bool = False  # begin again at the end
    step: bool = False  # wait before each picture
