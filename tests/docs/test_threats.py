"""The threat model names the bounds that the program has."""

import re
from pathlib import Path

from lcf_edge.gate import gate
from lcf_edge.view import doorkeeper, server
from lcf_edge.zenoh_link.admission import LARGEST_MESSAGE_BYTES, access_control
from lcf_edge.zenoh_link.session import _UNLESS_THE_FILE_SAYS

ROOT = Path(__file__).parents[2]
DOCUMENT = " ".join((ROOT / "docs/network.md").read_text(encoding="utf-8").split())
GATE_UNIT = (ROOT / "systemd/lcf-edge-gate.service").read_text(encoding="utf-8")


def test_the_bounds_of_the_gate() -> None:
    assert f"{gate.MOST_STRANGERS} places, the oldest gives way; {gate.HANDSHAKE_S:g} s each; 96 MiB" in DOCUMENT
    assert f"{gate.MOST_OF_ONE} connections of one name, {gate.MOST_PARTIES} of all" in DOCUMENT
    assert "MemoryMax=96M" in GATE_UNIT
    assert "CPUQuota=50%" in GATE_UNIT


def test_the_bounds_of_the_daemon() -> None:
    sessions = _UNLESS_THE_FILE_SAYS["transport/unicast/max_sessions"]
    waiting_s = int(_UNLESS_THE_FILE_SAYS["transport/unicast/accept_timeout"]) / 1000
    assert f"{sessions} sessions; 100 connections that are not yet sessions, {waiting_s:g} s each" in DOCUMENT
    assert f"messages of {LARGEST_MESSAGE_BYTES // 1024} KiB" in DOCUMENT


def test_the_bounds_of_the_page() -> None:
    most, within_s = doorkeeper.MOST_CONNECTIONS, doorkeeper.REQUEST_WITHIN_S
    assert f"{most} connections, {within_s:g} s to a request, {server.MOST_BROWSERS} browsers" in DOCUMENT


def test_what_a_local_program_may_do() -> None:
    taken = {
        key for rule in access_control("lcf")["rules"] if rule["flows"] == ["ingress"] for key in rule["key_exprs"]
    }
    local = DOCUMENT.partition("Whoever can run a program")[2].partition("What else it sends")[0]
    assert taken == set(re.findall(r"`(lcf/[^`]+|\*\*)`", local))
