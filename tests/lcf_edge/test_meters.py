"""Rates and percentiles agree with NumPy's, in memory that does not grow."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.meters import DurationHistogram, IntervalMeter


def test_rate_and_jitter_are_those_of_the_stamps() -> None:
    intervals_ns = np.random.default_rng(1).normal(33e6, 2e6, 5000).astype(np.int64)
    meter = IntervalMeter()
    meter.add(np.cumsum(intervals_ns).tolist())
    assert meter.rate_hz == pytest.approx(1e9 / 33e6, rel=0.03)
    assert meter.jitter_s == pytest.approx(2e-3, rel=0.4)


def test_a_pause_says_nothing_about_the_rate() -> None:
    meter = IntervalMeter()
    assert np.isnan(meter.rate_hz)
    meter.add([0, 10**7])
    meter.restart()
    meter.add([10**12, 10**12 + 10**7])
    assert meter.rate_hz == pytest.approx(100)
    assert meter.jitter_s == 0


@given(st.lists(st.floats(2e-5, 9.0), min_size=1, max_size=200), st.floats(1, 100))
def test_a_percentile_is_right_to_three_percent(durations_s: list[float], percent: float) -> None:
    histogram = DurationHistogram()
    for seconds in durations_s:
        histogram.add(seconds)
    exact_s = np.percentile(durations_s, percent, method="inverted_cdf")
    assert exact_s * 0.999 <= histogram.percentile_s(percent) <= exact_s * 1.031


def test_what_is_older_than_two_turns_is_forgotten() -> None:
    histogram = DurationHistogram()
    assert np.isnan(histogram.percentile_s(50))
    histogram.add(5.0)
    histogram.turn()
    histogram.add(1e-3)
    assert histogram.percentile_s(100) == pytest.approx(5.0, rel=0.03)
    histogram.turn()
    assert histogram.percentile_s(100) == pytest.approx(1e-3, rel=0.03)


@pytest.mark.parametrize("seconds", [-1.0, 0.0, 1e9])
def test_absurd_durations_are_counted_at_the_ends(seconds: float) -> None:
    histogram = DurationHistogram()
    histogram.add(seconds)
    assert 0 < histogram.percentile_s(50) < 11
