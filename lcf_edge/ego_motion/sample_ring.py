"""The latest samples of a sensor, and their values over the interval between two exposures. No clock, no I/O."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from lcf_edge.filter.memory import Doubles, doubles, memory_of

Stamps: TypeAlias = Any  # int64, ns: typed memory when compiled, else a memoryview

MAX_STAMP_NS = 2**62  # beyond any real stamp
RESTART_AFTER = 5  # samples in order, but behind the newest: then the newest was wrong
PERIODS = 16  # of the latest samples, whose median is the period
MIN_ROWS = 3  # of a window
INF = float("inf")


def stamps(capacity: int) -> Stamps:
    """Zeros."""
    return memory_of(np.zeros(capacity, np.int64))


class Span:
    """From one exposure to the next, ``dt_s``."""

    def __init__(self, start_ns: int, end_ns: int) -> None:
        self.start_ns, self.end_ns = start_ns, end_ns
        self.dt_s = (end_ns - start_ns) * 1e-9


class Track:
    """Samples over a span, interpolated linearly; ``count`` rows are in use.

    ``times_s``: (rows,), the first 0 and the last dt; ``values``: (rows, columns).
    """

    def __init__(self, rows: int, columns: int) -> None:
        self.count = 2
        self.columns = columns
        self.times_s = doubles(rows)
        self.values = doubles(rows, columns)

    def mean(self) -> list[float]:
        """Return the mean over time of each column."""
        last = self.count - 1
        whole_s = self.times_s[last]
        means = []
        for k in range(self.columns):
            total = 0.0
            for i in range(last):
                step_s = self.times_s[i + 1] - self.times_s[i] if whole_s > 0 else 1.0
                total += step_s * (self.values[i + 1, k] + self.values[i, k])
            means.append(0.5 * total / (whole_s if whole_s > 0 else last))
        return means

    def turn(self, error_x: float, error_y: float, error_z: float, rotation: Doubles) -> None:
        """Integrate the rates, rad/s, in the first three columns to a rotation (3, 3) of directions.

        The errors are subtracted from the rates. Ṙ = R·[ω]× for the camera's orientation, so a fixed direction turns by
        exp(-[ω]× dt) in the camera's axes; from sample to sample ω is the mean of both. Multiplied as quaternions.
        """
        w, x, y, z = 1.0, 0.0, 0.0, 0.0
        for i in range(1, self.count):
            dt_s = self.times_s[i] - self.times_s[i - 1]
            rx = -0.5 * (self.values[i, 0] - error_x + (self.values[i - 1, 0] - error_x)) * dt_s
            ry = -0.5 * (self.values[i, 1] - error_y + (self.values[i - 1, 1] - error_y)) * dt_s
            rz = -0.5 * (self.values[i, 2] - error_z + (self.values[i - 1, 2] - error_z)) * dt_s
            angle = math.sqrt(rx * rx + ry * ry + rz * rz)
            c, s = math.cos(angle / 2), math.sin(angle / 2) / angle if angle > 0 else 0.5
            a, b, d = s * rx, s * ry, s * rz
            w, x, y, z = (
                c * w - a * x - b * y - d * z,
                c * x + a * w + b * z - d * y,
                c * y + b * w + d * x - a * z,
                c * z + d * w + a * y - b * x,
            )
        scale = 2 / (w * w + x * x + y * y + z * z)
        rotation[0, 0] = 1 - scale * (y * y + z * z)
        rotation[0, 1] = scale * (x * y - w * z)
        rotation[0, 2] = scale * (x * z + w * y)
        rotation[1, 0] = scale * (x * y + w * z)
        rotation[1, 1] = 1 - scale * (x * x + z * z)
        rotation[1, 2] = scale * (y * z - w * x)
        rotation[2, 0] = scale * (x * z - w * y)
        rotation[2, 1] = scale * (y * z + w * x)
        rotation[2, 2] = 1 - scale * (x * x + y * y)

    def hold(self, dt_s: float, values: Sequence[float]) -> None:
        """Hold constant values for ``dt_s``."""
        self.count = 2
        self.times_s[0], self.times_s[1] = 0.0, dt_s
        for k in range(self.columns):
            self.values[0, k] = self.values[1, k] = values[k]


class Window:
    """Rows ``first`` to before ``last`` of a ring."""

    def __init__(self) -> None:
        self.first = self.last = 0


class Ring:
    """The latest samples of one sensor, in time order; the oldest make room for new ones.

    ``stamps_ns``: (capacity,), ``values``: (capacity, columns); ``count`` rows are in use. ``used_ns``: samples up to
    here are no longer needed. ``refused`` counts refused samples, by sensor and reason.
    """

    def __init__(self, sensor: str, capacity: int, columns: int, refused: Counter[str]) -> None:
        self.used_ns = MAX_STAMP_NS
        self.count = 0
        self.sensor, self.capacity, self.columns = sensor, capacity, columns
        self.refused = refused
        self.stamps_ns = stamps(capacity)
        self.values = doubles(capacity, columns)
        self.behind = 0  # samples in order, but behind the newest
        self.behind_ns = 0
        self.periods_ns = stamps(PERIODS)

    def refuse(self, reason: str, count: int = 1) -> None:
        """Count refused samples."""
        self.refused[f"{self.sensor} {reason}"] += count

    def add(self, stamp_ns: int, values: Sequence[float]) -> None:
        """Append a sample; a wrong stamp far ahead does not shut out all that follow (``RESTART_AFTER``)."""
        if abs(stamp_ns) > MAX_STAMP_NS:
            self.refuse("out of range")
            return
        if self.is_behind(stamp_ns):
            self.refuse("stamp goes back")
            return
        if self.count == self.capacity:
            self.make_room()
        self.stamps_ns[self.count] = stamp_ns
        for k in range(self.columns):
            self.values[self.count, k] = values[k]
        self.count += 1

    def is_behind(self, stamp_ns: int) -> bool:
        """Whether a stamp is refused because it is not later than the newest; the newest may be found to be wrong."""
        if self.count and stamp_ns <= self.stamps_ns[self.count - 1]:
            self.behind = self.behind + 1 if stamp_ns > self.behind_ns else 1
            self.behind_ns = stamp_ns
            if self.behind < RESTART_AFTER:
                return True
            self.count = 0
        self.behind = 0
        return False

    def make_room(self) -> None:
        """Drop the oldest quarter at once, so that adding stays cheap."""
        leaving = self.capacity // 4
        missed = 0
        for i in range(leaving):
            missed += self.stamps_ns[i] > self.used_ns
        if missed:
            self.refuse("overflow", missed)
        self.count -= leaving
        for i in range(self.count):
            self.stamps_ns[i] = self.stamps_ns[i + leaving]
            for k in range(self.columns):
                self.values[i, k] = self.values[i + leaving, k]

    def after(self, stamp_ns: int) -> int:
        """Return the row of the first sample later than ``stamp_ns``."""
        low, high = 0, self.count
        while low < high:
            middle = (low + high) // 2
            if self.stamps_ns[middle] <= stamp_ns:
                low = middle + 1
            else:
                high = middle
        return low

    def age_s(self, now_ns: int) -> float:
        """Return the age, s, of the latest sample not later than ``now_ns``; inf: none."""
        i = self.after(now_ns)
        return (now_ns - self.stamps_ns[i - 1]) * 1e-9 if i else INF

    def period_s(self) -> float:
        """Return the median interval of the latest samples, s; 0: fewer than two."""
        n = min(self.count - 1, PERIODS)
        if n < 1:
            return 0.0
        for i in range(n):
            row = self.count - n + i
            period_ns = self.stamps_ns[row] - self.stamps_ns[row - 1]
            k = i
            while k > 0 and self.periods_ns[k - 1] > period_ns:  # insertion sort
                self.periods_ns[k] = self.periods_ns[k - 1]
                k -= 1
            self.periods_ns[k] = period_ns
        return self.periods_ns[n // 2] * 1e-9

    def covers(self, span: Span, gap_limit_s: float) -> bool:
        """Whether a sample lies in ``span`` or nearer to it than the limit."""
        if not self.count:
            return False
        before_ns, beyond_ns = self.stamps_ns[0] - span.end_ns, span.start_ns - self.stamps_ns[self.count - 1]
        return max(before_ns, beyond_ns) <= gap_limit_s * 1e9

    def held_s(self, span: Span) -> float:
        """Return the time of ``span`` beyond the last sample or before the first, s, for which one is held."""
        first = max(0, self.after(span.start_ns) - 1)
        last = min(self.after(span.end_ns), self.count - 1)
        held_ns = max(0, self.stamps_ns[first] - span.start_ns) + max(0, span.end_ns - self.stamps_ns[last])
        return held_ns * 1e-9

    def gap_s(self, span: Span, gap_limit_s: float) -> float:
        """Return the time of ``span``, s, between samples that are farther apart than the limit."""
        first = max(0, self.after(span.start_ns) - 1)
        last = min(self.after(span.end_ns), self.count - 1)
        gap_ns = 0
        for i in range(first, last):
            if self.stamps_ns[i + 1] - self.stamps_ns[i] > gap_limit_s * 1e9:
                gap_ns += min(self.stamps_ns[i + 1], span.end_ns) - max(self.stamps_ns[i], span.start_ns)
        return gap_ns * 1e-9

    def between(self, span: Span, track: Track) -> None:
        """Write the samples over ``span``, interpolated at both its ends, or held where none lies beyond."""
        first = self.after(span.start_ns)
        last = max(first, self.after(span.end_ns - 1))
        track.count = last - first + 2
        track.times_s[0] = 0.0
        self.interpolate(span.start_ns, first, track, 0)
        for i in range(first, last):
            track.times_s[i - first + 1] = (self.stamps_ns[i] - span.start_ns) * 1e-9
            for k in range(self.columns):
                track.values[i - first + 1, k] = self.values[i, k]
        track.times_s[track.count - 1] = span.dt_s
        self.interpolate(span.end_ns, last, track, track.count - 1)

    def interpolate(self, stamp_ns: int, i: int, track: Track, row: int) -> None:
        """Set a row of a track by interpolation between the rows ``i`` - 1 and ``i``, or to the only one of them."""
        if i in (0, self.count):
            for k in range(self.columns):
                track.values[row, k] = self.values[max(0, i - 1), k]
            return
        before_ns = self.stamps_ns[i - 1]
        share = float(stamp_ns - before_ns) / (self.stamps_ns[i] - before_ns)
        for k in range(self.columns):
            track.values[row, k] = (1 - share) * self.values[i - 1, k] + share * self.values[i, k]

    def find_latest(self, window: Window, now_ns: int, length_ns: int, gap_limit_s: float) -> bool:
        """Set a window to the last ``length_ns``; return False if the samples do not reach back or have gaps."""
        start_ns = now_ns - length_ns
        window.first, window.last = max(0, self.after(start_ns) - 1), self.after(now_ns)
        if window.last - window.first < MIN_ROWS or self.stamps_ns[window.first] > start_ns:
            return False
        for i in range(window.first + 1, window.last):
            if self.stamps_ns[i] - self.stamps_ns[i - 1] > gap_limit_s * 1e9:
                return False
        return True

    def repeats(self, window: Window, begin: int, end: int) -> int:
        """Return how many rows of a window repeat the columns ``begin`` to before ``end`` of the row before."""
        count = 0
        for i in range(window.first + 1, window.last):
            k = begin
            while k < end and self.values[i, k] == self.values[i - 1, k]:
                k += 1
            count += k == end
        return count

    def largest(self, window: Window, column: int) -> float:
        """Return the largest magnitude in a column of a window."""
        most = 0.0
        for i in range(window.first, window.last):
            most = max(most, math.fabs(self.values[i, column]))
        return most

    def average(self, first: int, last: int) -> list[float]:
        """Return the mean of each column over the rows ``first`` to before ``last``."""
        means = []
        for k in range(self.columns):
            total = 0.0
            for i in range(first, last):
                total += self.values[i, k]
            means.append(total / (last - first))
        return means

    def deviation(self, window: Window, means: Sequence[float]) -> list[float]:
        """Return the standard deviation of each column over a window."""
        found = []
        for k in range(self.columns):
            mean, total = float(means[k]), 0.0
            for i in range(window.first, window.last):
                total += (self.values[i, k] - mean) * (self.values[i, k] - mean)
            found.append(math.sqrt(total / (window.last - window.first)))
        return found

    def newest(self, window: Window) -> list[float]:
        """Return the last row of a window."""
        return [float(self.values[window.last - 1, k]) for k in range(self.columns)]
