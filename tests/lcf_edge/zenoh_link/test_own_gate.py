"""What a daemon has before its loopback port by default: no local program ends it, and planners notice nothing."""

import os
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from lcf_edge.cdr import decode_diagnostics
from lcf_edge.config import Publish, Zenoh
from lcf_edge.errors import PublishError
from lcf_edge.gate.entrances import MAX_OF_ONE_USER
from lcf_edge.gate.key_limits import MAX_NEW_LEVELS
from lcf_edge.tallies import PLACES
from lcf_edge.zenoh_link.own_gate import OwnGate, behind, gated

BUDGET_MIB = 85.0
ALLOWED_MIB = 10.0
MAX_BYTES = 3 * 2**30  # of addresses: without a gate it would take all memory
MAX_MIB = 120.0
PATIENCE = 60  # diagnostics come once a second
PATIENCE_S = 20.0
COMERS = 2 * MAX_OF_ONE_USER
SILENT = 150  # programs that say hello, and nothing more
HELLO = bytes.fromhex("0c00410942" + "11" * 5 + "00000000")
HOLDS = {"deep": ["/".join("a" * 40)], "wild": ["**/a/" * 10 + "b"]}
MANY = [f"lcf/**/{n}/**" for n in range(3000)]

Daemon = subprocess.Popen[str]


@pytest.fixture
def daemon(without_camera: Callable[..., Daemon]) -> Daemon:
    """As installed, but for the port; it may take no more than a part of this computer."""
    daemon = without_camera(f"memory.budget_mib={BUDGET_MIB}", "camera.width=320", "camera.height=240")
    resource.prlimit(daemon.pid, resource.RLIMIT_AS, (MAX_BYTES, MAX_BYTES))
    return daemon


@pytest.fixture
def local(start: Any, endpoint: str) -> Callable[[], Any]:
    patient = {"connect__timeout_ms": 10_000}
    return lambda: start(mode="client", listen__endpoints=[], connect__endpoints=[endpoint], **patient)


def gate_of(daemon: Daemon) -> int:
    """The process."""
    of_threads = Path(f"/proc/{daemon.pid}/task").glob("*/children")
    (child,) = [child for children in of_threads for child in children.read_text(encoding="ascii").split()]
    return int(child)


def link_status(planner: Any) -> dict[str, str]:
    """Its counts, in the next diagnostics."""
    (sample,) = planner.receive("lcf/diagnostics")
    return next(dict(one.values) for one in decode_diagnostics(sample.payload).status if one.name == "link")


def until(planner: Any, count: str) -> int:
    """Wait for a count."""
    for _ in range(PATIENCE):
        values = link_status(planner)
        if int(values.get(count, 0)):
            return int(values[count])
    pytest.fail(f"no {count}")


def test_two_keys_that_end_zenoh_do_not_end_the_daemon(
    daemon: Daemon, local: Callable[[], Any], resident_mib: Callable[[Daemon], float]
) -> None:
    planner = local()
    planner.subscribe("lcf/diagnostics")
    for keys in HOLDS.values():
        local().tell("offer", keys=keys)
    assert until(planner, "gate refused")
    for _ in range(3):
        assert link_status(planner)
        assert resident_mib(daemon) < MAX_MIB
    assert local().get("lcf/query/schema")


def test_many_keys_with_wildcards_do_not_hold_it_up(daemon: Daemon, local: Callable[[], Any]) -> None:
    assert daemon
    planner = local()
    planner.subscribe("lcf/diagnostics")
    local().tell("offer", keys=MANY)
    assert until(planner, "gate refused")
    assert local().get("lcf/query/schema")


def test_who_comes_again_and_again_with_other_keys_fills_no_memory_and_no_places(
    daemon: Daemon, local: Callable[[], Any], resident_mib: Callable[[Daemon], float]
) -> None:
    planner = local()
    planner.subscribe("lcf/diagnostics")
    link_status(planner)
    for number in range(COMERS):
        local().tell("offer_many", key=f"lcf/{number}", count=MAX_NEW_LEVELS // 3)
    assert until(planner, "gate refused")
    assert local().get("lcf/query/schema")
    values = link_status(planner)
    assert "renewals" not in values
    assert resident_mib(daemon) < BUDGET_MIB


def test_a_gate_that_is_killed_comes_again(daemon: Daemon, local: Callable[[], Any]) -> None:
    planner = local()
    planner.subscribe("lcf/diagnostics")
    link_status(planner)
    before = gate_of(daemon)
    os.kill(before, signal.SIGKILL)
    assert until(planner, "gate restarts") == 1
    assert gate_of(daemon) != before
    assert local().get("lcf/query/schema")


def test_the_gate_ends_with_the_daemon_however_it_ends_and_leaves_no_folder(endpoint: str, tmp_path: Path) -> None:
    command = ("-m", "lcf_edge", "run", "--set", f'zenoh.listen=["{endpoint}"]', "--set", "camera.device=/dev/none")
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    with subprocess.Popen((sys.executable, *command), stderr=subprocess.PIPE, text=True, env=environment) as daemon:
        assert daemon.stderr
        assert next(line for line in daemon.stderr if "ready" in line)
        gate = gate_of(daemon)
        end = os.pidfd_open(gate)
        assert list(tmp_path.glob("lcf-edge-*/zenoh"))
        daemon.kill()
    ended, _, _ = select.select([end], [], [], PATIENCE_S)
    os.close(end)
    assert ended
    assert not list(tmp_path.glob("lcf-edge-*"))


def test_programs_that_only_say_hello_keep_nobody_out(daemon: Daemon, local: Callable[[], Any], endpoint: str) -> None:
    assert daemon
    port = int(endpoint.rpartition(":")[2])
    with ExitStack() as held:
        for number in range(SILENT):
            one = held.enter_context(socket.create_connection(("127.0.0.1", port)))
            one.sendall((b"", HELLO, b"\xff\xff", b"\x02\x00\x01")[number % 4])
        assert local().get("lcf/query/schema")


def test_programs_that_say_hello_and_are_gone_take_no_place_with_them(
    daemon: Daemon, local: Callable[[], Any], endpoint: str
) -> None:
    assert daemon
    port = int(endpoint.rpartition(":")[2])
    for _ in range(2 * PLACES):
        with socket.create_connection(("127.0.0.1", port)) as one:
            one.sendall(HELLO)
            one.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # a reset at the end
    assert local().get("lcf/query/schema")


def test_one_user_has_not_all_places(daemon: Daemon, local: Callable[[], Any]) -> None:
    assert daemon
    first = local()
    first.subscribe("lcf/diagnostics")
    link_status(first)
    for _ in range(MAX_OF_ONE_USER - 1):
        assert local().ask("connected")
    assert "gate refused" not in link_status(first)
    local()
    assert until(first, "gate refused")


def test_which_endpoints_get_a_gate() -> None:
    mixed = ["tcp/127.0.0.1:7447", "tcp/[::1]:7448", "tcp/localhost:7449"]
    open_ones = ["tcp/0.0.0.0:7450", "tls/127.0.0.1:7451", "unixsock-stream//run/a", "tcp/127.0.0.1:7452#bind=lo"]
    options = Zenoh(listen=[*mixed, *open_ones])
    assert gated(options, Publish()) == mixed
    assert behind(options, Publish(), "unixsock-stream//x").listen == ["unixsock-stream//x", *open_ones]


@pytest.mark.parametrize(
    ("options", "publish"),
    [
        (Zenoh(gate=False), Publish()),
        (Zenoh(mode="router"), Publish()),
        (Zenoh(mode="client", connect=["tcp/127.0.0.1:7447"], listen=[]), Publish()),
        (Zenoh(connect=["tcp/192.0.2.1:7447"]), Publish()),
        (Zenoh(gossip=True), Publish()),
        (Zenoh(), Publish(ros2=True)),
    ],
)
def test_who_connects_to_others_or_is_found_by_them_has_none(options: Zenoh, publish: Publish) -> None:
    assert gated(options, publish) == []


@pytest.fixture
def own_gate() -> Iterator[Callable[[str], OwnGate]]:
    gates: list[OwnGate] = []

    def make(endpoint: str) -> OwnGate:
        gates.append(OwnGate([endpoint], "lcf", print))
        return gates[-1]

    yield make
    for gate in gates:
        gate.close()


def test_a_port_that_is_taken_is_named_with_the_remedy(own_gate: Callable[[str], OwnGate], endpoint: str) -> None:
    own_gate(endpoint)
    with pytest.raises(PublishError, match=f"^{endpoint}: already in use; stop the other program or set zenoh.listen"):
        own_gate(endpoint)


def test_nobody_else_can_reach_the_socket_behind_it(own_gate: Callable[[str], OwnGate], endpoint: str) -> None:
    gate = own_gate(endpoint)
    folder = Path(gate.endpoint.partition("/")[2]).parent
    assert folder.stat().st_mode & 0o777 == 0o700
    gate.close()
    assert not folder.exists()
