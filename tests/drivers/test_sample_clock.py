"""Stamps of samples are as steady as the device's own clock, whatever happens to the samples on their way."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.sample_clock import BLOCKS, MAX_AHEAD_NS, SampleClock

Times = npt.NDArray[np.float64]
START_S = 1000.0
LEARNT_S = 1.5  # a rate that is off is known by then
FRAME_S = 0.04


@dataclass
class Way:
    """How samples come from a device to the program; all are late, none is early."""

    kind: str
    seed: int

    def arrivals(self, made: Times) -> Times:
        rng = np.random.default_rng(self.seed)
        if self.kind == "one by one":
            come = made
        elif self.kind == "latency timer":  # of an FTDI adapter
            timer_s, phase_s = 0.016 * rng.uniform(0.999, 1.001), rng.uniform(0, 0.016)
            come = np.ceil((made - phase_s) / timer_s) * timer_s + phase_s
        else:  # bursts of 1 to 10
            ends = np.cumsum(rng.integers(1, 11, len(made)))
            come = made[np.minimum(ends[np.searchsorted(ends, np.arange(len(made)), "right")] - 1, len(made) - 1)]
        batches, batch = np.unique(come, return_inverse=True)
        scheduling = rng.exponential(0.0005, len(batches)).clip(0, 0.002)
        scheduling += 0.03 * (rng.random(len(batches)) < 0.003)  # something else had the processor
        return np.maximum.accumulate(batches + scheduling)[batch]


ways = st.builds(Way, st.sampled_from(["one by one", "latency timer", "bursts"]), st.integers(0, 10_000))
rates = st.sampled_from([50.0, 100.0, 200.0, 400.0, 1000.0])


def made_at(rate_hz: float, seconds: float, drift_per_s: float = 0.0) -> Times:
    """When a device makes its samples; ``drift_per_s``: share by which its period grows each second."""
    elapsed = np.arange(int(seconds * rate_hz)) / rate_hz
    return START_S + elapsed * (1 + drift_per_s * elapsed / 2)


def stamps(clock: SampleClock, arrivals: Times) -> Times:
    """Stamps of samples; those that came at once are told at once. All in s."""
    times, counts = np.unique(arrivals, return_counts=True)
    found = [clock.stamps_ns(round(time * 1e9), int(count)) for time, count in zip(times, counts, strict=True)]
    stamps_ns = [stamp for batch in found for stamp in batch]
    assert all(later > earlier for earlier, later in pairwise(stamps_ns))
    return np.array(stamps_ns) / 1e9


def worst_interval_error(stamped: Times, made: Times, rate_hz: float) -> float:
    """Largest error of the time between samples that are a frame interval apart, as a share of it."""
    apart = max(1, round(FRAME_S * rate_hz))
    late = stamped - made
    return float(np.max(np.abs(late[apart:] - late[:-apart]) / (made[apart:] - made[:-apart])))


@settings(max_examples=60, deadline=None)
@given(rates, st.floats(-0.05, 0.05), ways)
def test_intervals_are_right_to_one_percent_once_the_rate_is_learnt(nominal_hz: float, off: float, way: Way) -> None:
    rate_hz = nominal_hz * (1 + off)
    made = made_at(rate_hz, 6.0)
    clock = SampleClock(nominal_hz)
    learnt = made > START_S + LEARNT_S

    stamped = stamps(clock, way.arrivals(made))

    assert worst_interval_error(stamped[learnt], made[learnt], rate_hz) < 0.01
    assert clock.rate_hz == pytest.approx(rate_hz, rel=2e-3)
    assert np.all(stamped[learnt] > made[learnt] - 0.006)  # what is seen of the delay is one poll and the scheduler's
    assert np.all(stamped[learnt] < made[learnt] + 0.006 + max(0.016, 1 / rate_hz))


@settings(max_examples=20, deadline=None)
@given(ways, st.floats(-0.05, 0.05), st.floats(0.2, 1.0))
def test_a_turn_integrated_over_a_frame_interval_is_right_to_one_percent(way: Way, off: float, swing_hz: float) -> None:
    rate_hz = 200.0 * (1 + off)
    made = made_at(rate_hz, 6.0)

    def turned(time: Times) -> Times:  # 1 rad/s that swings by a half
        return time - 0.5 * np.cos(2 * np.pi * swing_hz * time) / (2 * np.pi * swing_hz)

    rate = 1 + 0.5 * np.sin(2 * np.pi * swing_hz * made)
    stamped = stamps(SampleClock(200.0), way.arrivals(made))
    learnt = stamped > START_S + LEARNT_S
    stamped -= np.median((stamped - made)[learnt])  # a delay that is always there is configured

    found = np.concatenate([[0], np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(stamped))])
    begins = np.arange(START_S + LEARNT_S, stamped[-1] - FRAME_S, FRAME_S)
    angles = np.interp(begins + FRAME_S, stamped, found) - np.interp(begins, stamped, found)
    truth = turned(begins + FRAME_S) - turned(begins)

    assert np.max(np.abs(angles / truth - 1)) < 0.01


@settings(max_examples=10, deadline=None)
@given(ways, st.sampled_from([-1e-4, 1e-4]))
def test_a_rate_that_drifts_is_followed(way: Way, drift_per_s: float) -> None:
    made = made_at(200.0, 20.0, drift_per_s)
    learnt = made > START_S + LEARNT_S

    stamped = stamps(SampleClock(200.0), way.arrivals(made))

    assert worst_interval_error(stamped[learnt], made[learnt], 200.0) < 0.01
    assert np.max(np.abs((stamped - made)[learnt])) < 0.025


@pytest.mark.parametrize("rate_hz", [10.0, 50.0, 100.0, 400.0])
def test_a_nominal_rate_that_is_plainly_wrong_is_unlearnt(rate_hz: float) -> None:
    made = made_at(rate_hz, 10.0)
    clock = SampleClock(200.0)

    stamped = stamps(clock, Way("one by one", 0).arrivals(made))

    settled = made > START_S + 4
    assert worst_interval_error(stamped[settled], made[settled], rate_hz) < 0.01
    assert clock.rate_hz == pytest.approx(rate_hz, rel=2e-3)


def test_the_first_samples_are_stamped_back_from_their_arrival() -> None:
    assert SampleClock(100.0).stamps_ns(1_000_000_000, 3) == [980_000_000, 990_000_000, 1_000_000_000]


def test_a_first_sample_that_came_late_does_not_put_the_others_into_the_future() -> None:
    clock = SampleClock(100.0)
    arrivals_ns = [1_008_000_000, 1_010_000_000, 1_020_000_000, 1_030_000_000]

    stamps_ns = [clock.stamps_ns(arrival_ns, 1)[0] for arrival_ns in arrivals_ns]

    assert stamps_ns == [1_008_000_000, 1_013_000_000, 1_020_000_000, 1_030_000_000]  # half a period at least apart


def test_no_samples_no_stamps() -> None:
    clock = SampleClock(100.0)

    assert clock.stamps_ns(5, 0) == clock.stamps_of_steps_ns(5, []) == []


@settings(max_examples=20, deadline=None)
@given(ways, st.integers(1, 300))
def test_samples_known_to_be_lost_leave_a_gap_of_their_length(way: Way, lost: int) -> None:
    made = made_at(200.0, 6.0)
    arrivals = way.arrivals(made)
    gap = slice(800, 800 + lost)
    clock = SampleClock(200.0)

    before = stamps(clock, arrivals[: gap.start])
    (first,) = clock.stamps_ns(round(arrivals[gap.stop] * 1e9), 1, lost)

    assert first / 1e9 - before[-1] == pytest.approx((lost + 1) / 200, rel=0.01)


@settings(max_examples=20, deadline=None)
@given(ways, st.integers(20, 2000))
def test_a_gap_that_nobody_counted_is_noticed(way: Way, lost: int) -> None:
    made = np.delete(made_at(200.0, 8.0 + lost / 200), slice(800, 800 + lost))

    stamped = stamps(SampleClock(200.0), way.arrivals(made))

    settled = made > made[800] + 1.0
    assert np.max(np.abs((stamped - made)[settled])) < 0.02
    assert worst_interval_error(stamped[settled], made[settled], 200.0) < 0.01


def test_a_backlog_is_no_gap() -> None:
    made = made_at(200.0, 6.0)
    arrivals = made.copy()
    arrivals[600:700] = made[700] + np.repeat(np.arange(5) * 1e-3, 20)  # the program slept for 0.5 s
    arrivals[700:] = np.maximum(arrivals[700:], arrivals[699])

    stamped = stamps(SampleClock(200.0), arrivals)

    assert worst_interval_error(stamped[300:], made[300:], 200.0) < 0.01


def test_a_restart_begins_anew_and_time_still_goes_on() -> None:
    clock = SampleClock(200.0)
    made = made_at(100.0, 3.0)
    before = stamps(clock, made)
    assert clock.rate_hz == pytest.approx(100.0, rel=1e-2)

    clock.restart()

    assert clock.rate_hz == 200.0
    assert clock.stamps_ns(round(made[-1] * 1e9) + 1, 1)[0] > round(before[-1] * 1e9)


@settings(max_examples=20, deadline=None)
@given(ways, st.integers(0, 10_000))
def test_with_ticks_of_the_device_samples_need_not_be_even(way: Way, seed: int) -> None:
    steps_us = np.random.default_rng(seed).integers(1000, 9000, 1500)
    made = START_S + np.cumsum(steps_us) * 1.02e-6  # the device's microseconds are 2 % long
    arrivals = way.arrivals(made)
    clock = SampleClock(1e6)
    found: list[int] = []
    for time in np.unique(arrivals):
        found += clock.stamps_of_steps_ns(round(time * 1e9), [int(step) for step in steps_us[arrivals == time]])

    late = np.array(found) / 1e9 - made
    learnt = made > START_S + LEARNT_S
    assert np.max(np.abs(np.diff(late[learnt])) / np.diff(made[learnt])) < 0.01


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 10**10), st.integers(0, 20), st.integers(0, 10**6)), max_size=60))
def test_stamps_increase_whatever_is_reported(calls: list[tuple[int, int, int]]) -> None:
    clock = SampleClock(200.0)
    arrival_ns, last_ns = 0, None
    for pause_ns, count, lost in calls:
        arrival_ns += pause_ns
        for stamp_ns in clock.stamps_ns(arrival_ns, count, lost):
            assert last_ns is None or stamp_ns > last_ns
            last_ns = stamp_ns


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 10**8), st.lists(st.integers(1, 10**6), max_size=20)), max_size=60))
def test_no_stamp_runs_away_from_its_arrival_whatever_the_device_tells(calls: list[tuple[int, list[int]]]) -> None:
    clock = SampleClock(1e6)
    arrival_ns = made = 0
    for pause_ns, steps in calls:
        arrival_ns += pause_ns
        made += len(steps)
        for stamp_ns in clock.stamps_of_steps_ns(arrival_ns, steps):
            assert stamp_ns <= arrival_ns + MAX_AHEAD_NS + made


def test_memory_does_not_grow() -> None:
    clock = SampleClock(1000.0)
    stamps(clock, made_at(1000.0, 30.0))

    assert len(clock._blocks) <= BLOCKS


def test_a_rate_must_be_one() -> None:
    with pytest.raises(ValueError, match="positive"):
        SampleClock(0.0)
