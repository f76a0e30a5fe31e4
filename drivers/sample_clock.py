"""Sample times inferred from arrival times: the device's own steady rate, with the jitter removed.

A device makes sample n at ``start + n * period`` of its own clock; the sample arrives later, delayed by a serial
adapter's latency timer, polling or the scheduler, and never earlier. So arrivals lie on or above a straight line, and
the estimate is the highest line below them all: it contains the edge of their lower convex hull that spans the mean
index (the linear program of Zhang, Liu & Xia, "Clock Synchronization Algorithms for Network Measurements", INFOCOM
2002). A constant delay is not observable here: that is what ``imu.time_offset_s`` is for.
"""

from collections import deque
from collections.abc import Sequence
from itertools import accumulate, pairwise

FIRST_BLOCK_NS = 50e6  # of each block only the arrival with the smallest delay is kept
BLOCK_NS = 200e6
BLOCKS = 50  # kept: a drifting rate is tracked within 10 s
NOMINAL_TRUST_NS = 0.25e9  # after this only the measured rate counts, not the nominal one
RATE_TRUST_NS = 2.5e9  # the same for a rate known before a gap
KNOWN_NS = 0.5e9  # a rate measured for this long is known
ASTRAY_PERIODS = 1.5  # off the line: samples missed, or counted twice; polling explains up to 1
ASTRAY_NS = 10e6  # … and at least this far
LATE_NS = 100e6  # … and late for this long: a backlog clears faster
LATE_CALLS = 5
MAX_AHEAD_NS = 100_000_000  # of the arrival: until the rate is known, stamps may be early or late
SLEW = 0.005  # share by which stamps are stretched to follow the line once the rate is known
FIRST_SLEW = 0.5  # … and shrunk, at most, before

Point = tuple[int, float]  # sample, ns since the base


class SampleClock:
    """Recovers a device's own steady rate from the arrival times of its samples.

    Stamps are strictly increasing, also across ``restart``. A rate that is off nominal is known after about 1 s; until
    then the nominal one is used. A gap of uncounted samples is detected when later ones stay late for ``LATE_NS``; up
    to 1.5 lost samples pass as jitter. Stamps of a device whose clock runs away are at most ``MAX_AHEAD_NS`` in the
    future, and 1 ns more for each sample. Memory is ``BLOCKS`` points.
    """

    def __init__(self, nominal_rate_hz: float) -> None:
        if not nominal_rate_hz > 0:
            raise ValueError(f"a rate must be positive, not {nominal_rate_hz} Hz")
        self._nominal_ns = 1e9 / nominal_rate_hz
        self._last_ns: int | None = None
        self.restart()

    @property
    def rate_hz(self) -> float:
        """The rate recovered so far, by the monotonic clock."""
        return 1e9 / self._period_ns

    def restart(self) -> None:
        """Restart, after the device was initialised again."""
        self._anchor(self._nominal_ns, NOMINAL_TRUST_NS)

    def _anchor(self, period_ns: float, trust_ns: float) -> None:
        """Forget the arrivals; use ``period_ns`` until arrivals over more than ``trust_ns`` show otherwise."""
        self._period_ns = self._prior_ns = period_ns
        self._trust_ns = trust_ns
        self._base_ns: int | None = None  # of the arrivals below
        self._sample = 0  # the newest
        self._offset_ns = 0.0  # of sample 0, since the base
        self._blocks: deque[Point] = deque(maxlen=BLOCKS)
        self._lowest: Point = (0, 0.0)  # of the block that is still open
        self._block_ns = 0.0  # when it began
        self._seen_ns = 0.0  # what the rate was taken from
        self._on_time_ns = 0.0  # when an arrival was last not late
        self._late_calls = 0

    def stamps_ns(self, arrival_ns: int, count: int, lost: int = 0) -> list[int]:
        """Return the stamps of ``count`` samples, oldest first, ns.

        All were available at ``arrival_ns``, the newest had just been made; ``lost`` samples are known to be missing
        before them.
        """
        return self.stamps_of_steps_ns(arrival_ns, [lost + 1] + [1] * (count - 1)) if count > 0 else []

    def stamps_of_steps_ns(self, arrival_ns: int, steps: Sequence[int]) -> list[int]:
        """The same for samples made ``steps`` periods (1 or more) after the one before.

        With ticks of a device's own clock as periods, samples need not be evenly spaced.
        """
        if not steps:
            return []
        self._sample += sum(steps)
        if self._base_ns is None or self._out_of_step(arrival_ns - self._base_ns):
            self._base_ns, self._sample = arrival_ns, 0
        self._take((self._sample, float(arrival_ns - self._base_ns)))
        oldest = self._sample - sum(steps)
        return [
            self._stamp_ns(self._base_ns, oldest + since, step, arrival_ns)
            for since, step in zip(accumulate(steps), steps, strict=True)
        ]

    def _out_of_step(self, now_ns: float) -> bool:
        """Whether samples were missed or counted twice, so that the line must be refitted; keeps the rate."""
        delay_ns = self._delay_ns((self._sample, now_ns))
        astray_ns = max(ASTRAY_PERIODS * self._period_ns, ASTRAY_NS)
        if delay_ns < astray_ns:
            self._on_time_ns = now_ns
            self._late_calls = 0
        else:
            self._late_calls += 1
        late = self._late_calls >= LATE_CALLS and now_ns - self._on_time_ns > LATE_NS
        rate_known = self._seen_ns > KNOWN_NS  # else the rate may be wrong
        astray = rate_known and (late or delay_ns < -astray_ns)
        if astray:
            self._anchor(self._period_ns, RATE_TRUST_NS)
        return astray

    def _take(self, point: Point) -> None:
        """Update the line with an arrival of the newest sample."""
        if point[1] - self._block_ns > min(max(self._seen_ns / 8, FIRST_BLOCK_NS), BLOCK_NS):
            self._blocks.append(self._lowest)
            self._lowest, self._block_ns = point, point[1]
            if len(self._blocks) > 1:
                self._fit()
        elif self._delay_ns(point) < self._delay_ns(self._lowest):
            self._lowest = point
        self._offset_ns += min(self._delay_ns(point), 0.0)  # nothing arrives before it was made

    def _fit(self) -> None:
        self._seen_ns = self._blocks[-1][1] - self._blocks[0][1]
        seen = min(self._seen_ns / self._trust_ns, 1.0)
        period_ns = self._prior_ns + seen * (_slope_below(self._blocks) - self._prior_ns)
        self._period_ns = period_ns
        self._offset_ns = min(now_ns - sample * period_ns for sample, now_ns in self._blocks)

    def _delay_ns(self, point: Point) -> float:
        return point[1] - self._offset_ns - point[0] * self._period_ns

    def _stamp_ns(self, base_ns: int, sample: int, step: int, arrival_ns: int) -> int:
        stamp_ns = base_ns + round(self._offset_ns + sample * self._period_ns)
        if self._last_ns is not None:
            step_ns = step * self._period_ns
            slew = SLEW if self._seen_ns > KNOWN_NS else FIRST_SLEW
            stamp_ns = max(stamp_ns, self._last_ns + max(round((1 - slew) * step_ns), 1))
            if self._seen_ns > KNOWN_NS:
                stamp_ns = min(stamp_ns, self._last_ns + max(round((1 + slew) * step_ns), 1))
            stamp_ns = max(min(stamp_ns, arrival_ns + MAX_AHEAD_NS), self._last_ns + 1)
        self._last_ns = stamp_ns
        return stamp_ns


def _slope_below(points: deque[Point]) -> float:
    """Slope of the line below all points and closest to them, ns per sample."""
    hull: list[Point] = []
    for x, y in points:
        while len(hull) > 1:
            (x1, y1), (x2, y2) = hull[-2:]
            if (y2 - y1) * (x - x2) < (y - y2) * (x2 - x1):
                break
            hull.pop()
        hull.append((x, y))
    mean = sum(x for x, _ in points) / len(points)
    return next((y2 - y1) / (x2 - x1) for (x1, y1), (x2, y2) in pairwise(hull) if x2 >= mean)
