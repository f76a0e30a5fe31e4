"""Stamps follow the system clock, exactly between its steps, and a stop cuts every wait short."""

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.daemon.clock import STEP_NS, StoppableClock, SystemTime
from lcf_edge.dates import utc


class Clocks:
    """A monotonic and a system clock that run at one rate; each reading takes ``reading_ns``."""

    def __init__(self, reading_ns: int = 100) -> None:
        self.now_ns = 10**12
        self.offset_ns = 1_700_000_000 * 10**9
        self.reading_ns = reading_ns

    def monotonic_ns(self) -> int:
        self.now_ns += self.reading_ns
        return self.now_ns

    def system_ns(self) -> int:
        return self.monotonic_ns() + self.offset_ns


@given(st.integers(-(10**18), 10**18).filter(lambda step_ns: abs(step_ns) > 2 * STEP_NS))
def test_a_step_is_noticed_once_and_stamps_follow(step_ns: int) -> None:
    clocks = Clocks()
    time = SystemTime(clocks.monotonic_ns, clocks.system_ns)
    assert time.notice() == 0
    clocks.offset_ns += step_ns
    assert abs(time.notice() - step_ns) <= 1000
    assert time.notice() == 0
    assert time.steps == 1
    assert abs(time.system_ns(clocks.now_ns) - clocks.now_ns - clocks.offset_ns) <= 1000


@given(st.integers(0, 2**62), st.integers(0, 10**12))
def test_between_steps_intervals_are_exact_and_the_way_back_too(stamp_ns: int, later_ns: int) -> None:
    clocks = Clocks()
    time = SystemTime(clocks.monotonic_ns, clocks.system_ns)
    before = time.system_ns(stamp_ns)
    clocks.offset_ns += STEP_NS // 2  # noise of reading two clocks
    assert time.notice() == 0
    assert time.system_ns(stamp_ns + later_ns) - before == later_ns
    assert time.monotonic_ns(before) == stamp_ns


def test_a_reading_that_was_interrupted_is_no_step() -> None:
    clocks = Clocks()
    time = SystemTime(clocks.monotonic_ns, clocks.system_ns)
    clocks.reading_ns = 50_000_000  # the process was held up at every reading
    assert time.notice() == 0


def test_the_clocks_of_this_machine_have_not_been_set_since() -> None:
    assert SystemTime().notice() == 0


def test_a_stop_ends_a_wait_and_those_to_come() -> None:
    clock = StoppableClock()
    sleeper = threading.Thread(target=clock.sleep_s, args=(3600.0,))
    sleeper.start()
    clock.stop()
    sleeper.join(20.0)
    assert not sleeper.is_alive()
    assert clock.stopped
    clock.sleep_s(3600.0)


@pytest.mark.parametrize(
    ("system_ns", "text"),
    [(0, "1970-01-01"), (2**63, "2262-04-11"), (10**30, "9999-12-31"), (-(10**30), "0001-01-01")],
)
def test_any_time_is_a_date(system_ns: int, text: str) -> None:
    assert utc(system_ns).date().isoformat() == text
