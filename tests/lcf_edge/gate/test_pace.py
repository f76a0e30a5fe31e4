"""How fast a party may speak."""

from lcf_edge.gate.pace import AT_ONCE, MAX_PER_S, Pace

NOW_S = [0.0]


def waited_s(messages: int, times: int, each_s: float) -> float:
    """In all, by somebody who says so many messages at a time, so often, each after so long."""
    NOW_S[0], waited_s = 0.0, 0.0
    pace = Pace(lambda: NOW_S[0])
    for _ in range(times):
        NOW_S[0] += each_s
        wait_s = pace.wait_s(messages)
        NOW_S[0] += wait_s
        waited_s += wait_s
    return waited_s


def test_who_sends_the_speed_never_waits() -> None:
    assert waited_s(3, 10_000, 0.01) == 0


def test_so_many_may_come_at_once() -> None:
    assert waited_s(AT_ONCE, 1, 1.0) == 0


def test_a_flood_is_slowed_down_to_what_is_allowed() -> None:
    assert waited_s(1, 10 * MAX_PER_S, 0.0) > 9.0
    assert waited_s(MAX_PER_S, 10, 0.0) > 9.0
