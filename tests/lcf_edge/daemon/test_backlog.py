"""The backlog is bounded in bytes; what does not fit is counted; nothing else is lost."""

import threading

from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.daemon.backlog import Backlog


@given(
    st.integers(1, 100),
    st.lists(st.tuples(st.booleans(), st.integers(0, 60), st.integers(0, 10)), max_size=60),
)
def test_every_item_is_taken_in_order_or_counted(limit: int, steps: list[tuple[bool, int, int]]) -> None:
    backlog: Backlog[int] = Backlog(limit)
    put: list[int] = []
    taken: list[int] = []
    for number, (puts, size, reserve) in enumerate(steps):
        if puts:
            was_empty = len(put) == len(taken)
            fits = backlog.put(number, size, reserve)
            assert fits or not was_empty
            put += [number] * fits
            assert backlog.bytes <= limit or was_empty or not fits
        else:
            taken += backlog.take(size, 0)
    backlog.close()
    while not backlog.ended:
        taken += backlog.take(0, 0)
    assert taken == put
    assert backlog.bytes == 0
    assert len(put) + backlog.dropped == sum(puts for puts, _, _ in steps)


def test_who_waits_gets_what_comes_and_is_let_go_at_the_end() -> None:
    backlog: Backlog[str] = Backlog(10)
    got: list[list[str]] = []
    waiting = threading.Thread(target=lambda: got.extend(backlog.take(5, 20.0) for _ in range(2)))
    waiting.start()
    backlog.put("item", 5)
    backlog.close()
    waiting.join(20.0)
    assert got == [["item"], []]
    assert backlog.ended
