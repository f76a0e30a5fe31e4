"""The gate's unit before the daemon's: planners with a certificate get scenes through it, strangers get nothing."""

import socket
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from hil_mocks.vm.daemon import WEBCAM, Daemon
from hil_mocks.vm.image import PROJECT
from hil_mocks.vm.machine import Machine, MachineError
from hil_mocks.vm.scenarios.test_network import DROP_IN, KEY, STRANGERS_WAIT_S, certify, connected

UNIT = "lcf-edge-gate"
BEHIND = '\n[zenoh]\nlisten = ["tls/127.0.0.1:7448"]\nconfig_file = "/etc/lcf-edge/zenoh.json5"\n'
DROP_INS = "/run/systemd/system/lcf-edge.service.d"
STRANGERS = 150
MAX_EXPOSURE = 1.5  # of systemd-analyze


@pytest.fixture(scope="module")
def gated(machine: Machine, daemon: Daemon) -> Iterator[Path]:
    """Daemon and gate as docs/network.md says. Return the folder with certificates."""
    folder = machine.share / "gate"
    (folder / "inner").mkdir(parents=True)
    for name, authority in (("ca", "ca"), ("rover", "ca"), ("planner", "ca"), ("other", "other"), ("thief", "other")):
        certify(folder, name, authority)
    certify(folder, "inner-ca", "inner-ca")
    certify(folder / "inner", "planner", "../inner-ca")
    settings = (PROJECT / "examples/network/zenoh.json5").read_text(encoding="utf-8")
    settings = settings.replace("/etc/lcf-edge/tls/rover.key", KEY)
    (folder / "zenoh.json5").write_text(settings, encoding="utf-8")
    (folder / "tls.conf").write_text(DROP_IN, encoding="ascii")
    machine.run(
        "install -D -m 644 -t /etc/lcf-edge/tls /mnt/gate/ca.pem /mnt/gate/inner-ca.pem /mnt/gate/rover.pem;"
        "install -m 600 -t /etc/lcf-edge/tls /mnt/gate/rover.key;"
        "install -D -m 600 -t /etc/lcf-edge/tls/inner /mnt/gate/inner/planner.pem /mnt/gate/inner/planner.key;"
        "install -m 644 -t /etc/lcf-edge /mnt/gate/zenoh.json5;"
        f"install -D -m 644 -t {DROP_INS} /mnt/gate/tls.conf; systemctl daemon-reload"
    )
    daemon.start(WEBCAM + BEHIND)
    machine.run(f"systemctl start {UNIT}")
    machine.wait_until("ss -ltn | grep -q :7447")
    yield folder
    machine.run(f"systemctl stop {UNIT}; rm {DROP_INS}/tls.conf; systemctl daemon-reload")


def test_a_planner_gets_scenes_through_the_gate(machine: Machine, gated: Path) -> None:
    planner = connected(machine, gated, "planner", "ca")
    try:
        planner.wait_for_scenes()
        planner.wait_for_status("camera", "delivers")
    finally:
        planner.close()


def test_a_stranger_gets_nothing_through_it(machine: Machine, gated: Path) -> None:
    thief = connected(machine, gated, "thief", "ca")
    try:
        with pytest.raises(MachineError, match="not within"):
            thief.wait_for(lambda: thief.scenes, "a scene", STRANGERS_WAIT_S)
    finally:
        thief.close()


def test_strangers_neither_end_the_gate_nor_keep_a_planner_out(machine: Machine, gated: Path) -> None:
    with ExitStack() as strangers:
        for _ in range(STRANGERS):
            with suppress(OSError):  # it had to give way
                one = strangers.enter_context(socket.create_connection(("127.0.0.1", machine.port), 10.0))
                one.sendall(b"GET / HTTP/1.0\r\n\r\n")
        planner = connected(machine, gated, "planner", "ca")
        try:
            planner.wait_for_scenes()
        finally:
            planner.close()
    assert machine.run(f"systemctl show {UNIT} -p ActiveState -p NRestarts").split() == [
        "NRestarts=0",
        "ActiveState=active",
    ]
    machine.wait_until(f"journalctl -b -q -u {UNIT} | grep 'no certificate'")
    assert "Traceback" not in machine.run(f"journalctl -b -q --no-pager -u {UNIT}")


def test_the_gate_is_a_user_of_its_own_and_little_exposed(machine: Machine, gated: Path) -> None:
    assert gated
    pid = int(machine.run(f"systemctl show {UNIT} --property=MainPID --value"))
    assert machine.run(f"stat -c %U /proc/{pid}") == UNIT
    output = machine.run(f"systemd-analyze security {UNIT} --no-pager | tail -1")
    assert float(output.split(": ")[1].split()[0]) <= MAX_EXPOSURE
