"""The newest wins, samples are kept up to a fixed number, and what is lost is counted."""

import threading

from hypothesis import given
from hypothesis import strategies as st

from drivers.samples import SpeedSample
from lcf_edge.daemon.mailbox import Newest, SampleRing

PATIENCE_S = 20.0


def samples(*stamps_ns: int) -> list[SpeedSample]:
    return [SpeedSample(stamp_ns, 0.0, 0.0) for stamp_ns in stamps_ns]


@given(st.lists(st.booleans(), max_size=60))
def test_every_item_is_taken_or_counted(puts: list[bool]) -> None:
    box: Newest[int] = Newest()
    put, taken = 0, []
    for is_put in puts:
        if is_put:
            box.put(put)
            put += 1
        else:
            taken.append(box.take(0))
    taken.append(box.take(0))
    got = [item for item in taken if item is not None]
    assert len(got) + box.overtaken == put
    assert got == sorted(got)
    assert not put or got[-1] == put - 1


def test_a_taker_is_woken() -> None:
    box: Newest[str] = Newest()
    got: list[str | None] = []
    taker = threading.Thread(target=lambda: got.append(box.take(PATIENCE_S)))
    taker.start()
    box.put("frame")
    taker.join(PATIENCE_S)
    assert got == ["frame"]


def test_nobody_waits_at_one_that_is_closed() -> None:
    box: Newest[str] = Newest()
    taker = threading.Thread(target=box.take, args=(3600.0,))
    taker.start()
    box.close()
    taker.join(PATIENCE_S)
    assert not taker.is_alive()
    box.put("last")
    assert box.take(3600.0) == "last"


@given(st.lists(st.lists(st.integers(0, 99), max_size=9)), st.integers(1, 7))
def test_every_sample_is_taken_or_counted(batches: list[list[int]], capacity: int) -> None:
    ring: SampleRing[SpeedSample] = SampleRing(capacity)
    every = [sample for batch in batches for sample in samples(*batch)]
    for batch in batches:
        ring.put(samples(*batch))
    taken = ring.take()
    assert taken == every[len(every) - len(taken) :]
    assert len(taken) == min(len(every), capacity)
    assert len(taken) + ring.overtaken == len(every)
    assert ring.take() == []


def test_the_sample_after_a_frame_is_waited_for() -> None:
    ring: SampleRing[SpeedSample] = SampleRing(8)
    ring.put(samples(90))
    waiter_started = threading.Event()
    came: list[bool] = []

    def wait() -> None:
        waiter_started.set()
        came.append(ring.wait_until(100, PATIENCE_S, silent_ns=50))

    waiter = threading.Thread(target=wait)
    waiter.start()
    waiter_started.wait(PATIENCE_S)
    ring.put(samples(95))
    ring.put(samples(100))
    waiter.join(PATIENCE_S)
    assert came == [True]


def test_a_sensor_that_is_away_or_was_never_there_is_not_waited_for() -> None:
    ring: SampleRing[SpeedSample] = SampleRing(8)
    assert not ring.wait_until(100, 3600.0, silent_ns=50)
    ring.put(samples(49))
    assert not ring.wait_until(100, 3600.0, silent_ns=50)
    ring.put(samples(99))
    assert not ring.wait_until(100, 0.001, silent_ns=50)
