"""Running statistics in fixed memory: the rate of records, and durations."""

import math
from collections.abc import Iterable

import numpy as np

_SMOOTHED_OVER = 64  # intervals
_FINEST_S, _COARSEST_S = 1e-5, 10.0
_RESOLUTION = 1.03  # ratio of neighbouring bins
_BINS = math.ceil(math.log(_COARSEST_S / _FINEST_S, _RESOLUTION)) + 1


class IntervalMeter:
    """Rate and jitter of stamped records, smoothed over some 60 of them.

    ``rate_hz``: NaN before the second. ``jitter_s``: standard deviation of the interval between two.
    """

    def __init__(self) -> None:
        self.last_ns: int | None = None
        self._count = 0
        self._mean_s = math.nan
        self._variance_s2 = 0.0

    def add(self, stamps_ns: Iterable[int]) -> None:
        """Take the stamps of new records."""
        for stamp_ns in stamps_ns:
            if self.last_ns is not None:
                self._take((stamp_ns - self.last_ns) / 1e9)
            self.last_ns = stamp_ns

    def _take(self, interval_s: float) -> None:
        self._count = min(self._count + 1, _SMOOTHED_OVER)
        if self._count == 1:
            self._mean_s = interval_s
            return
        share, off_s = 1 / self._count, interval_s - self._mean_s
        self._mean_s += share * off_s
        self._variance_s2 = (1 - share) * (self._variance_s2 + share * off_s * off_s)

    def restart(self) -> None:
        """Begin anew after a pause that says nothing about the rate."""
        self.last_ns = None

    @property
    def rate_hz(self) -> float:
        """Records a second."""
        return 1 / self._mean_s if self._mean_s > 0 else math.nan

    @property
    def jitter_s(self) -> float:
        """1 sigma of the interval."""
        return math.sqrt(self._variance_s2)


class DurationHistogram:
    """Durations from 10 µs to 10 s, in steps of 3 %; counts of the last one or two ``turn``s."""

    def __init__(self) -> None:
        self._now, self._before = [0] * _BINS, [0] * _BINS

    def add(self, seconds: float) -> None:
        """Count one duration."""
        place = math.log(max(seconds, _FINEST_S) / _FINEST_S, _RESOLUTION)
        self._now[min(math.ceil(place), _BINS - 1)] += 1

    def turn(self) -> None:
        """Forget what is older than the last turn."""
        self._now, self._before = [0] * _BINS, self._now

    def percentile_s(self, percent: float) -> float:
        """Return the upper edge, s, of the bin that completes this share of the durations; NaN: there are none."""
        counts = np.add(self._now, self._before)
        total = int(counts.sum())
        if not total:
            return math.nan
        place = int(np.searchsorted(np.cumsum(counts), total * percent / 100))
        return float(_FINEST_S * _RESOLUTION**place)
