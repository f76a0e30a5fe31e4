"""The last seconds: never more than they may be, never less than there is."""

from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.monitor.live.history import History, ReceivedMessage
from lcf_edge.monitor.live.traces import Point, Traces

SECOND_NS = 10**9

arrivals = st.lists(
    st.tuples(st.sampled_from(["scene", "preview"]), st.integers(0, 3 * SECOND_NS), st.integers(0, 60)), max_size=60
)


@given(arrivals)
def test_it_holds_what_came_within_its_length_and_its_bytes(came: list[tuple[str, int, int]]) -> None:
    limits = {"scene": 100, "preview": 200}
    history = History(5.0, limits)
    now_ns, sent = 0, []
    for topic, pause_ns, size in came:
        now_ns += pause_ns
        sent.append(ReceivedMessage(topic, now_ns, bytes(size)))
        history.add(sent[-1])
    kept = history.messages(now_ns)
    assert kept == sorted(kept, key=lambda message: message.received_ns)
    for topic, limit in limits.items():
        young = [one for one in sent if one.topic == topic and now_ns - one.received_ns <= 5 * SECOND_NS]
        mine = [one for one in kept if one.topic == topic]
        assert sum(len(one.payload) for one in mine) <= limit
        assert mine == young[len(young) - len(mine) :]  # the newest, without a gap
        if len(mine) < len(young):  # one more would have been too much
            assert sum(len(one.payload) for one in young[len(young) - len(mine) - 1 :]) > limit


def test_what_is_old_goes_also_when_nothing_comes() -> None:
    history = History(5.0)
    history.add(ReceivedMessage("scene", 0, b"x"))
    assert history.messages(5 * SECOND_NS)
    assert not history.messages(5 * SECOND_NS + 1)


def test_traces_go_on_when_the_clock_was_set_back() -> None:
    traces = Traces()

    def add(*moments_s: int) -> None:
        for at_s in moments_s:
            traces.add(Point.of(at_s * SECOND_NS, None, 0.0, None))

    def since(at_s: int) -> list[int]:
        return [point.at_ns // SECOND_NS for point in traces.since(at_s * SECOND_NS)]

    add(100, 101, 102)
    assert (since(100), since(102)) == ([101, 102], [])
    add(101)
    assert since(102) == [100, 101]
    add(102)
    assert since(101) == [102]
