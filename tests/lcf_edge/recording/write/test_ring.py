"""The ring keeps the last seconds, within its bytes."""

from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.recording.write.messages import SCENE, RecordedMessage
from lcf_edge.recording.write.ring import Ring, size_bytes


@given(st.lists(st.tuples(st.integers(0, 10**9), st.integers(0, 5000), st.integers(0, 20_000)), max_size=40))
def test_it_keeps_the_newest_that_fit_and_are_young_enough(steps: list[tuple[int, int, int]]) -> None:
    ring, added, now_ns = Ring(2.0), [], 0
    for step_ns, size, limit_bytes in steps:
        now_ns += step_ns
        added.append(RecordedMessage(SCENE, now_ns, bytes(size)))
        ring.add(added[-1], limit_bytes)
        assert ring.bytes <= limit_bytes
    kept_bytes = ring.bytes
    kept = ring.take()
    assert kept == added[len(added) - len(kept) :]
    assert kept_bytes == sum(map(size_bytes, kept))
    assert all(message.stamp_ns >= now_ns - 2 * 10**9 for message in kept)
    assert ring.bytes == 0
    assert ring.take() == []


def test_with_room_enough_nothing_young_leaves() -> None:
    ring = Ring(2.0)
    for index in range(100):
        ring.add(RecordedMessage(SCENE, index * 10**8, b"x"), 10**6)
    assert [message.stamp_ns for message in ring.take()] == [index * 10**8 for index in range(79, 100)]
