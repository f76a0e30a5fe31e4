"""Whether an accelerometer measures gravity at rest: distinguishes chips with the same identity."""

import math
from collections.abc import Iterable, Sequence

from drivers.samples import STANDARD_GRAVITY_MPS2, ImuSample

WINDOW_S = 0.5
STILL_RADPS = 0.05  # range of an axis's rates at rest; the gyro's bias does not matter
STILL_MPS2 = 1.0


class Gravity:
    """Examines windows of ``WINDOW_S`` until one is at rest."""

    def __init__(self, rate_hz: float) -> None:
        self._window_samples = max(round(WINDOW_S * rate_hz), 4)
        self._window: list[ImuSample] = []
        self._known = False

    def measured_g(self, samples: Iterable[ImuSample]) -> float | None:
        """Return gravity, g, once, after the vehicle has rested; None: not known yet, or already returned."""
        if self._known:
            return None
        for sample in samples:
            self._window.append(sample)
            if len(self._window) == self._window_samples:
                window, self._window = self._window, []
                if _rests(window):
                    self._known = True
                    return math.hypot(*_mean([sample.accel for sample in window])) / STANDARD_GRAVITY_MPS2
        return None


def _rests(window: Sequence[ImuSample]) -> bool:
    turns = zip(*(sample.gyro for sample in window), strict=True)
    pushes = zip(*(sample.accel for sample in window), strict=True)
    return all(max(axis) - min(axis) < STILL_RADPS for axis in turns) and all(
        max(axis) - min(axis) < STILL_MPS2 for axis in pushes
    )


def _mean(vectors: Sequence[tuple[float, float, float]]) -> list[float]:
    return [sum(axis) / len(vectors) for axis in zip(*vectors, strict=True)]
