"""Speeds from other processes are taken when they make sense; whatever else arrives is a count."""

import time
from collections.abc import Callable, Iterator
from math import inf, isnan, nan
from typing import Any

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

from lcf_edge.config import Config, Publish, Vehicle, Zenoh
from lcf_edge.zenoh_link import MAX_MESSAGE_BYTES, opened_session
from lcf_edge.zenoh_link.link import Link
from lcf_edge.zenoh_link.speed_input import CAPACITY, MAX_BYTES, REFUSALS, SpeedInput

ODOMETRY = "nav_msgs/msg/Odometry"
TWIST = "geometry_msgs/msg/TwistStamped"
NOW_NS = 1_700_000_000_000_000_000

Velocity = Callable[..., bytes]


@pytest.fixture
def link(session: zenoh.Session) -> Iterator[Link]:
    link = Link(session, Config())
    yield link
    link.close()


@pytest.fixture(scope="module")
def speeds() -> Iterator[tuple[zenoh.Session, SpeedInput]]:
    """An input whose clock stands still, and the session that it listens on."""
    with opened_session(Zenoh(listen=[])) as session:
        taken = SpeedInput(session, Publish(), now_ns=lambda: NOW_NS)
        yield session, taken
        taken.close()


@pytest.fixture
def heard(speeds: tuple[zenoh.Session, SpeedInput]) -> Callable[..., dict[str, int]]:
    """What the input counts for one payload."""
    session, taken = speeds

    def put(payload: bytes, encoding: str = "application/cdr") -> dict[str, int]:
        before = dict(taken.counts)
        session.put("lcf/speed", payload, encoding=encoding)  # within a session the receiver runs at once
        assert len(taken.take()) == taken.counts["taken"] - before["taken"]
        return {what: n - before[what] for what, n in taken.counts.items() if n != before[what]}

    return put


@pytest.mark.parametrize("little_endian", [True, False], ids=["little-endian", "big-endian"])
@pytest.mark.parametrize("encoding", ["zenoh/bytes", "application/cdr", "application/cdr;{kind}"])
@pytest.mark.parametrize("kind", [ODOMETRY, TWIST])
def test_a_speed_of_another_process_is_taken(
    link: Link, peer: Any, velocity: Velocity, kind: str, encoding: str, little_endian: bool
) -> None:
    stamp_ns, before_ns = time.time_ns(), time.monotonic_ns()
    payload = velocity(1.5, 0.25, kind=kind, stamp_ns=stamp_ns, little_endian=little_endian)
    peer.put("lcf/speed", payload, encoding.format(kind=kind))
    peer.get("lcf/query/config")  # what is asked on the same connection is answered after what was put before
    ((arrived_ns, speed),) = link.take_speeds()
    assert (speed.stamp_ns, speed.speed_mps, speed.yaw_rate_radps) == (stamp_ns, 1.5, 0.25)
    assert before_ns < arrived_ns < time.monotonic_ns()
    assert link.take_speeds() == []
    assert link.counts["speed taken"] == 1


def test_an_unknown_yaw_rate_stays_unknown(speeds: Any, velocity: Velocity) -> None:
    session, taken = speeds
    session.put("lcf/speed", velocity(1.5, nan, stamp_ns=NOW_NS))
    assert isnan(taken.take()[0][1].yaw_rate_radps)


@pytest.mark.parametrize(
    ("values", "refusal"),
    [
        ({"speed_mps": nan}, "not finite"),
        ({"speed_mps": -inf}, "not finite"),
        ({"yaw_rate_radps": inf}, "not finite"),
        ({"speed_mps": 1e30}, "out of range"),
        ({"speed_mps": -70.1}, "out of range"),
        ({"yaw_rate_radps": -1e30}, "out of range"),
        ({"stamp_ns": NOW_NS - 501_000_000}, "stale"),
        ({"stamp_ns": 0}, "stale"),
        ({"stamp_ns": -(2**30) * 10**9}, "stale"),
        ({"stamp_ns": NOW_NS + 101_000_000}, "from the future"),
        ({"stamp_ns": (2**31 - 1) * 10**9}, "from the future"),
    ],
    ids=str,
)
@pytest.mark.parametrize("kind", [ODOMETRY, TWIST])
def test_what_cannot_be_is_refused(
    heard: Any, velocity: Velocity, kind: str, values: dict[str, float], refusal: str
) -> None:
    assert heard(velocity(**({"stamp_ns": NOW_NS, "kind": kind} | values))) == {refusal: 1}


@pytest.mark.parametrize("age_ns", [-100_000_000, 0, 500_000_000])
def test_a_clock_may_be_a_little_off(heard: Any, velocity: Velocity, age_ns: int) -> None:
    assert heard(velocity(stamp_ns=NOW_NS - age_ns)) == {"taken": 1}


@pytest.mark.parametrize(
    ("kind", "encoding", "refusal"),
    [
        (TWIST, f"application/cdr;{ODOMETRY}", "wrong type"),
        (ODOMETRY, f"application/cdr;{TWIST}", "wrong type"),
        (ODOMETRY, "application/cdr;sensor_msgs/msg/Imu", "wrong type"),
        (ODOMETRY, "application/json", None),
    ],
)
def test_what_is_announced_as_something_else_is_refused(
    heard: Any, velocity: Velocity, kind: str, encoding: str, refusal: str | None
) -> None:
    assert heard(velocity(kind=kind, stamp_ns=NOW_NS), encoding) == {refusal or "taken": 1}


@pytest.mark.parametrize("kind", [ODOMETRY, TWIST])
def test_a_message_of_any_other_length_is_refused(heard: Any, velocity: Velocity, kind: str) -> None:
    payload = velocity(kind=kind, stamp_ns=NOW_NS)
    encoding = f"application/cdr;{kind}"
    assert heard(payload, encoding) == {"taken": 1}
    refused = [heard(payload[:length], encoding) for length in range(len(payload))]
    assert sum(count == {"malformed": 1} for count in refused) >= len(payload) - 1
    assert {"taken": 1} not in refused, "not even where an Odometry is cut to the length of a TwistStamped"
    assert heard(payload + b"\0") == {"malformed": 1}
    assert heard(payload + payload) == {"malformed": 1}
    assert heard(payload + bytes(MAX_BYTES)) == {"too large": 1}


@given(st.binary(max_size=MAX_BYTES + 10), st.sampled_from([b"", b"\0\1\0\0", b"\0\0\0\0"]))
def test_any_bytes_are_one_count(speeds: Any, body: bytes, start: bytes) -> None:
    session, taken = speeds
    before = taken.counts.total()
    session.put("lcf/speed", start + body)
    taken.take()
    assert taken.counts.total() == before + 1


@given(data=st.data())
def test_a_damaged_message_is_one_count(speeds: Any, velocity: Velocity, data: st.DataObject) -> None:
    session, taken = speeds
    payload = bytearray(velocity(kind=data.draw(st.sampled_from([ODOMETRY, TWIST])), stamp_ns=NOW_NS))
    for _ in range(data.draw(st.integers(1, 8))):
        payload[data.draw(st.integers(0, len(payload) - 1))] = data.draw(st.integers(0, 255))
    before = taken.counts.total()
    session.put("lcf/speed", bytes(payload))
    for _, speed in taken.take():
        assert abs(speed.speed_mps) <= 70
    assert taken.counts.total() == before + 1


def test_the_newest_wait_and_the_others_are_counted(speeds: Any, velocity: Velocity) -> None:
    session, taken = speeds
    before = taken.counts["overtaken"]
    for n in range(CAPACITY + 5):
        session.put("lcf/speed", velocity(stamp_ns=NOW_NS + n))
    waiting = [speed.stamp_ns - NOW_NS for _, speed in taken.take()]
    assert waiting == list(range(5, CAPACITY + 5))
    assert taken.counts["overtaken"] - before == 5


def test_megabytes_are_a_count_and_what_comes_after_them_is_heard(link: Link, peer: Any, velocity: Velocity) -> None:
    peer.put("lcf/speed", bytes(MAX_MESSAGE_BYTES // 2), count=3)
    peer.put("lcf/speed", bytes(4 * MAX_MESSAGE_BYTES), count=3)  # not even put together
    peer.put("lcf/speed", velocity())
    peer.get("lcf/query/config")
    assert len(link.take_speeds()) == 1
    assert link.counts == {"speed too large": 3, "speed taken": 1, "query answered": 1}


@pytest.mark.parametrize("source", ["imu", "constant", "none"])
def test_who_does_not_use_speeds_does_not_listen(
    session: zenoh.Session, peer: Any, source: Any, velocity: Velocity
) -> None:
    link = Link(session, Config(vehicle=Vehicle(speed_source=source, speed_mps=1.0)))
    other = session.declare_publisher("lcf/speed")
    session.put("lcf/speed", velocity())
    peer.get("lcf/query/config")
    assert not other.matching_status.matching
    assert link.take_speeds() == []
    assert link.counts == {"query answered": 1}
    link.close()


def test_every_reason_is_one_that_is_reported() -> None:
    with opened_session(Zenoh(listen=[])) as session:
        assert set(SpeedInput(session, Publish()).counts) == {"taken", "overtaken", *REFUSALS}
