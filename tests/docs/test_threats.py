"""The threat model names the bounds that the program has."""

import re
from pathlib import Path

from drivers.imu import serial_imu
from lcf_edge.calibrate.drawing.server import MAX_DRAWING_BYTES
from lcf_edge.daemon import memory, peers
from lcf_edge.gate import entrances, gate, key_limits, pace
from lcf_edge.monitor.web import server
from lcf_edge.recording.read.images import _BYTES_A_PIXEL, _DECODER_BYTES
from lcf_edge.web import doorkeeper
from lcf_edge.zenoh_link.admission import MAX_MESSAGE_BYTES, access_control
from lcf_edge.zenoh_link.queryables import Queryables
from lcf_edge.zenoh_link.session import _UNLESS_THE_FILE_SAYS, MAX_SESSIONS

ROOT = Path(__file__).parents[2]
DOCUMENT = " ".join((ROOT / "docs/network.md").read_text(encoding="utf-8").split())
GATE_UNIT = (ROOT / "systemd/lcf-edge-gate.service").read_text(encoding="utf-8")


def test_the_bounds_of_the_gate() -> None:
    assert f"{gate.MAX_STRANGERS} places, the oldest gives way; {entrances.HANDSHAKE_S:g} s each; 96 MiB" in DOCUMENT
    assert f"{entrances.MAX_OF_ONE_NAME} connections of one name, {entrances.MAX_PARTIES} of all" in DOCUMENT
    users = f"{entrances.MAX_OF_ONE_USER} connections of one user, {entrances.MAX_PARTIES} of all"
    assert (
        f"{gate.MAX_STRANGERS} places until it greets, {gate.MAX_GREETERS} until it has a session, {users}" in DOCUMENT
    )
    assert "MemoryMax=96M" in GATE_UNIT
    assert "CPUQuota=50%" in GATE_UNIT


def test_what_a_party_may_say() -> None:
    levels, max_bytes = key_limits.MAX_LEVELS, key_limits.MAX_KEY_BYTES
    assert key_limits.MAX_BRANCHES == 2
    assert f"a key of more than {levels} levels, {max_bytes} bytes or two of `**` and `$*`" in DOCUMENT
    assert f"more than {key_limits.MAX_WILD} different keys with wildcards of one name" in DOCUMENT
    assert f"more than {key_limits.MAX_DECLARED_BYTES // 1024} KiB of keys on one connection" in DOCUMENT
    most, per_s = key_limits.MAX_NEW_LEVELS, key_limits.NEW_LEVELS_PER_S
    assert f"different keys of one name may have {most} levels in all, and {per_s} more a second" in DOCUMENT
    assert f"they notice after {'a second' if gate.PENALTY_S == 1 else gate.PENALTY_S}" in DOCUMENT
    assert f"the gate reads {pace.MAX_PER_S} messages a second" in DOCUMENT


def test_the_bounds_of_the_daemon() -> None:
    sessions = _UNLESS_THE_FILE_SAYS["transport/unicast/max_sessions"]
    waiting_s = int(_UNLESS_THE_FILE_SAYS["transport/unicast/accept_timeout"]) / 1000
    assert f"{sessions} sessions; 100 connections that are not yet sessions, {waiting_s:g} s each" in DOCUMENT
    assert f"messages of {MAX_MESSAGE_BYTES // 1024} KiB" in DOCUMENT


def test_what_is_done_about_memory_that_peers_fill() -> None:
    assert f"Above {memory.SHED_AT * 100:g} % of `memory.budget_mib`" in DOCUMENT
    assert f"at least {peers.CUT_AT_MIB:g} MiB was filled" in DOCUMENT
    assert peers.CHECK_S == 1 / 20
    assert "twenty times a second" in DOCUMENT
    assert f"sessions beyond {MAX_SESSIONS}" in DOCUMENT


def test_the_bounds_of_a_serial_imu() -> None:
    kilobytes, samples = serial_imu.MAX_BYTES_PER_S // 1000, serial_imu.MAX_SAMPLES_PER_S
    reads = serial_imu.MAX_READS_PER_S
    assert f"{kilobytes} kB, {samples} samples and {reads} reads a second; the excess is dropped" in DOCUMENT


def test_the_bound_of_videos() -> None:
    assert f"{_DECODER_BYTES // 2**20} MiB and {_BYTES_A_PIXEL} bytes for each pixel of the first image" in DOCUMENT


def test_every_loss_that_is_counted_is_reported() -> None:
    counts = {
        "scene failed",
        "scene unfit",
        "bytes received",
        "sessions",
        "connections cut",
        "renewals",
        "gate refused",
    }
    queries = Queryables.COUNTED - {"answered"}
    assert [one for one in counts | {f"query {one}" for one in queries} if f"`{one}`" not in DOCUMENT] == []


def test_the_bounds_of_the_page() -> None:
    most, within_s = doorkeeper.MAX_CONNECTIONS, doorkeeper.REQUEST_WITHIN_S
    assert f"{most} connections, {within_s:g} s to a request, {server.MAX_BROWSERS} browsers" in DOCUMENT
    drawn = f"{most} connections, {within_s:g} s to a request, drawings of {MAX_DRAWING_BYTES // 1024} KiB"
    assert drawn in DOCUMENT


def test_what_a_local_program_may_do() -> None:
    taken = {
        key for rule in access_control("lcf")["rules"] if rule["flows"] == ["ingress"] for key in rule["key_exprs"]
    }
    local = DOCUMENT.partition("Any program on the computer")[2].partition("Anything else it sends")[0]
    assert taken == set(re.findall(r"`(lcf/[^`]+|\*\*)`", local))
