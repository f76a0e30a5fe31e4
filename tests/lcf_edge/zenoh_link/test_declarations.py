"""Zenoh keeps what peers declare, without a limit; the daemon keeps to its memory all the same."""

import resource
import socket
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh

from lcf_edge.cdr import decode_diagnostics
from lcf_edge.config import Config, Zenoh
from lcf_edge.zenoh_link.connections import MAX_PER_BYTE, Connections
from lcf_edge.zenoh_link.link import Link
from lcf_edge.zenoh_link.session import open_session

BUDGET_MIB = 85.0  # some 70 are the daemon's
ALLOWED_MIB = 10.0
PATIENCE = 60  # diagnostics come once a second
MANY = 4000  # keys: 6 MiB
KEYS = "lcf/of-the-peer"

Daemon = subprocess.Popen[str]
Pair = tuple[socket.socket, socket.socket]


@pytest.fixture
def daemon(without_camera: Callable[..., Daemon]) -> Daemon:
    """With little memory to spare, and no gate."""
    return without_camera(
        "zenoh.gate=false", f"memory.budget_mib={BUDGET_MIB}", "camera.width=320", "camera.height=240"
    )


@pytest.fixture
def local(start: Any, endpoint: str) -> Callable[[], Any]:
    patient = {"connect__timeout_ms": 10_000}  # the daemon may just open its session anew
    return lambda: start(mode="client", listen__endpoints=[], connect__endpoints=[endpoint], **patient)


def link_status(planner: Any) -> dict[str, int]:
    """Its counts, in the next diagnostics."""
    (sample,) = planner.receive("lcf/diagnostics")
    values = next(dict(one.values) for one in decode_diagnostics(sample.payload).status if one.name == "link")
    return {name: int(count) for name, count in values.items()}


def test_who_declares_too_much_is_cut_and_a_planner_is_not(
    daemon: Daemon, local: Callable[[], Any], resident_mib: Callable[[Daemon], float]
) -> None:
    planner = local()
    planner.subscribe("lcf/diagnostics")
    assert "connections cut" not in link_status(planner)
    for number in range(6):
        local().ask("announce_many", key=f"{KEYS}/{number}", count=MANY)
    last: dict[str, int] = {}
    for _ in range(PATIENCE):
        before, last = last, link_status(planner)
        assert resident_mib(daemon) < BUDGET_MIB + ALLOWED_MIB
        assert last["diagnostics sent"] == before.get("diagnostics sent", last["diagnostics sent"] - 1) + 1
        if "connections cut" in last:
            break
    assert last["connections cut"] >= 1


def test_what_stays_when_a_peer_goes_is_shed_with_the_session(
    daemon: Daemon, local: Callable[[], Any], resident_mib: Callable[[Daemon], float]
) -> None:
    planner = local()
    planner.subscribe("lcf/diagnostics")
    for number in range(14):
        peer = local()
        peer.ask("offer_many", key=f"{KEYS}/{number}", count=MANY)
        peer.end()
    for _ in range(PATIENCE):
        assert resident_mib(daemon) < BUDGET_MIB + ALLOWED_MIB
        last = link_status(planner)
        if "renewals" in last:
            break
    assert last["renewals"] >= 1


def test_a_link_goes_on_after_it_was_opened_anew(
    endpoint: str, start: Any, until_matched: Any, scene: Callable[..., Any]
) -> None:
    opened: list[zenoh.Session] = []

    def open_one() -> zenoh.Session:
        opened.append(open_session(Zenoh(listen=[endpoint])))
        return opened[-1]

    link = Link(open_one(), Config(), open_one)
    link.put_scene(scene(1))
    assert link.renew()
    planner = start(mode="client", connect__endpoints=[endpoint])
    planner.subscribe("lcf/scene")
    until_matched(opened[-1], "lcf/scene")
    link.put_scene(scene(2))
    assert len(planner.receive("lcf/scene")) == 1
    assert len(planner.get("lcf/query/scene")) == 1
    assert planner.tokens("lcf/@alive/*") == ["lcf/@alive/rover"]
    assert link.counts == {"scene sent": 2, "renewals": 1, "query answered": 1}
    link.close()
    assert [session.is_closed() for session in opened] == [True, True]


def test_a_link_without_a_session_loses_what_is_put_and_counts_it(endpoint: str, scene: Callable[..., Any]) -> None:
    def open_none() -> zenoh.Session:
        return open_session(Zenoh(listen=["tcp/192.0.2.1:7447"]))

    link = Link(open_session(Zenoh(listen=[endpoint])), Config(), open_none)
    assert not link.renew()
    assert not link.renew()
    link.put_scene(scene())
    assert not link.has_preview_subscriber()
    assert link.take_speeds() == []
    assert link.counts == {"scene failed": 1, "renewals failed": 2}
    link.close()


@pytest.fixture
def pair() -> Iterator[Pair]:
    """Two that have connected to this process."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        ends = [socket.create_connection(server.getsockname()) for _ in range(2)]
        ours = [server.accept()[0] for _ in ends]
        yield ends[0], ends[1]
        for one in (*ends, *ours):
            one.close()


def test_growth_is_laid_to_those_who_brought_something_by_their_shares(pair: Pair) -> None:
    connections = Connections()
    connections.charge(0.0)
    pair[0].sendall(bytes(30_000))
    pair[1].sendall(bytes(10_000))
    connections.charge(2.0)
    assert connections.charged_mib == pytest.approx(2.0)
    assert connections.cut(1.6) == 0
    assert connections.cut(1.4) == 1
    assert pair[0].recv(1) == b"", "it was shut down"
    assert connections.cut(0.4) == 1


def test_what_the_bytes_over_tcp_do_not_explain_is_laid_to_unix_sockets_alike(pair: Pair, tmp_path: Path) -> None:
    with ExitStack() as files:
        server = files.enter_context(socket.socket(socket.AF_UNIX))
        server.bind(str(tmp_path / "z"))
        server.listen()
        ends = [files.enter_context(socket.socket(socket.AF_UNIX)) for _ in range(2)]
        for end in ends:
            end.connect(server.getsockname())
            files.enter_context(server.accept()[0])
        connections = Connections()
        connections.charge(0.0)
        pair[0].sendall(bytes(100))
        connections.charge(8.0)
        assert connections.charged_mib == pytest.approx(8.0)
        assert connections.cut(4.0) == 0
        assert connections.cut(3.9) == 2
        assert [end.recv(1) for end in ends] == [b"", b""], "they were shut down"


def test_nobody_is_charged_with_more_than_its_bytes_can_have_caused(pair: Pair) -> None:
    connections = Connections()
    connections.charge(0.0)
    before = connections.received_bytes
    pair[0].sendall(bytes(100))
    connections.charge(50.0)
    brought = connections.received_bytes - before
    assert brought >= 100
    assert connections.charged_mib == pytest.approx(brought * MAX_PER_BYTE / 2**20)


def test_without_a_descriptor_nobody_is_charged_and_nothing_is_forgotten(pair: Pair) -> None:
    connections = Connections()
    connections.charge(0.0)
    pair[0].sendall(bytes(30_000))
    most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, most[1]))  # no number is free
    try:
        connections.charge(2.0)
        assert connections.charged_mib == 0.0
        assert connections.cut(0.1) == 0
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, most)
    connections.charge(2.0)
    assert connections.cut(1.0) == 1
