"""The latest samples of a sensor, and what they say about the interval between two exposures. No clock, no I/O."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

LARGEST_STAMP_NS = 2**62  # what no stamp says
_RESTART_AFTER = 5  # samples in order, but behind the newest: then the newest was wrong


@dataclass(frozen=True, slots=True)
class Span:
    """From one exposure to the next."""

    start_ns: int
    end_ns: int

    @property
    def dt_s(self) -> float:
        return (self.end_ns - self.start_ns) * 1e-9


Track = tuple[Floats, Floats]
"""Times (n,), s, the first 0 and the last dt, and values (n, columns) to be joined by straight lines."""


class Ring:
    """The latest samples of one sensor, in time order; the oldest make room for new ones."""

    def __init__(self, sensor: str, capacity: int, columns: int, refused: Counter[str]) -> None:
        self.used_ns = LARGEST_STAMP_NS  # samples up to here are not missed when they leave
        self._sensor = sensor
        self._refused = refused
        self._stamps_ns = np.zeros(capacity, np.int64)
        self._values = np.zeros((capacity, columns))
        self._count = 0
        self._behind = 0  # samples in order, but behind the newest
        self._behind_ns = 0

    def refuse(self, reason: str, count: int = 1) -> None:
        self._refused[f"{self._sensor} {reason}"] += count

    def add(self, stamp_ns: int, values: Sequence[float] | Floats) -> None:
        """Append a sample; a wrong stamp far ahead does not shut out all that follow (``_RESTART_AFTER``)."""
        if abs(stamp_ns) > LARGEST_STAMP_NS:
            self.refuse("out of range")
            return
        if self._count and stamp_ns <= self._stamps_ns[self._count - 1]:
            self._behind = self._behind + 1 if stamp_ns > self._behind_ns else 1
            self._behind_ns = stamp_ns
            if self._behind < _RESTART_AFTER:
                self.refuse("stamp goes back")
                return
            self._count = 0
        self._behind = 0
        if self._count == len(self._stamps_ns):
            self._make_room()
        self._stamps_ns[self._count] = stamp_ns
        self._values[self._count] = values
        self._count += 1

    def _make_room(self) -> None:
        leaving = len(self._stamps_ns) // 4  # many at once, so that adding stays cheap
        missed = int(np.count_nonzero(self._stamps_ns[:leaving] > self.used_ns))
        if missed:
            self.refuse("overflow", missed)
        self._count -= leaving
        self._stamps_ns[: self._count] = self._stamps_ns[leaving:]
        self._values[: self._count] = self._values[leaving:]

    def age_s(self, now_ns: int) -> float:
        """Age of the latest sample that is not later than ``now_ns``; inf: none."""
        i = self._after(now_ns)
        return float(now_ns - self._stamps_ns[i - 1]) * 1e-9 if i else inf

    def period_s(self) -> float:
        """Median interval of the latest samples; 0: fewer than two."""
        intervals = np.sort(np.diff(self._stamps_ns[max(0, self._count - 17) : self._count]))
        return float(intervals[len(intervals) // 2]) * 1e-9 if len(intervals) else 0.0

    def covers(self, span: Span, gap_limit_s: float) -> bool:
        """Whether a sample lies in ``span`` or nearer to it than the limit."""
        if not self._count:
            return False
        first_ns, last_ns = self._stamps_ns[0], self._stamps_ns[self._count - 1]
        return bool(max(first_ns - span.end_ns, span.start_ns - last_ns) <= gap_limit_s * 1e9)

    def unmeasured_s(self, span: Span, gap_limit_s: float) -> tuple[float, float]:
        """Time of ``span`` for which a sample was held beyond the last (or first) one, and time in gaps."""
        around = slice(max(0, self._after(span.start_ns) - 1), self._after(span.end_ns) + 1)
        stamps_ns = self._stamps_ns[: self._count][around]
        intervals_ns = np.diff(stamps_ns)
        gap_ns = 0
        for i in np.flatnonzero(intervals_ns > gap_limit_s * 1e9):
            gap_ns += min(stamps_ns[i + 1], span.end_ns) - max(stamps_ns[i], span.start_ns)
        held_ns = max(0, stamps_ns[0] - span.start_ns) + max(0, span.end_ns - stamps_ns[-1])
        if held_ns > gap_limit_s * 1e9:
            return 0.0, float(gap_ns + held_ns) * 1e-9
        return float(held_ns) * 1e-9, float(gap_ns) * 1e-9

    def between(self, span: Span) -> Track:
        """Samples over ``span``, interpolated at both its ends, held where there is none beyond them."""
        first = self._after(span.start_ns)
        last = max(first, self._after(span.end_ns - 1))
        times_s, values = np.empty(last - first + 2), np.empty((last - first + 2, self._values.shape[1]))
        times_s[0], times_s[-1] = 0.0, span.dt_s
        times_s[1:-1] = (self._stamps_ns[first:last] - span.start_ns) * 1e-9
        values[0], values[-1] = self._at(span.start_ns, first), self._at(span.end_ns, last)
        values[1:-1] = self._values[first:last]
        return times_s, values

    def latest(self, now_ns: int, length_s: float, gap_limit_s: float) -> Floats | None:
        """Values (n, columns) of the last ``length_s``; None if they do not reach back or have gaps."""
        start_ns = now_ns - round(length_s * 1e9)
        first, last = max(0, self._after(start_ns) - 1), self._after(now_ns)
        stamps_ns = self._stamps_ns[first:last]
        if last - first < 3 or stamps_ns[0] > start_ns or np.diff(stamps_ns).max() > gap_limit_s * 1e9:
            return None
        return self._values[first:last]

    def _after(self, stamp_ns: int) -> int:
        """Row of the first sample later than ``stamp_ns``."""
        return int(np.searchsorted(self._stamps_ns[: self._count], stamp_ns, side="right"))

    def _at(self, stamp_ns: int, i: int) -> Floats:
        """Value between the rows ``i`` - 1 and ``i``, or at the end that is there."""
        if i in (0, self._count):
            held: Floats = self._values[max(0, i - 1)]
            return held
        before, after = self._stamps_ns[i - 1 : i + 1].tolist()
        share = (stamp_ns - before) / (after - before)
        between: Floats = (1 - share) * self._values[i - 1] + share * self._values[i]
        return between


def mean(times_s: Floats, values: Floats) -> Floats:
    """Mean over time, along the first axis, of straight lines between the values."""
    if times_s[-1] <= 0:
        times_s = np.linspace(0.0, 1.0, len(times_s))
    mean: Floats = 0.5 * (np.diff(times_s) @ (values[1:] + values[:-1])) / times_s[-1]
    return mean
