"""The two ends of the virtual machine's line, without a machine: commands in, outcomes out."""

import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from hil_mocks.vm.guest import bno055
from hil_mocks.vm.guest.agent import Command, Outcome, carry_out, serve
from hil_mocks.vm.machine import Machine, MachineError

PATIENCE_S = 20.0


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    """A machine whose guest is a thread of this process."""
    host, guest = socket.socketpair()

    def answer() -> None:
        with guest, guest.makefile("rb") as incoming, guest.makefile("wb") as outgoing:
            serve(incoming, outgoing)

    thread = threading.Thread(target=answer)
    thread.start()
    made = Machine.__new__(Machine)
    made.patience = 1.0
    made.folder, made._agent, made._number, made._read = tmp_path, host, 0, b""
    for name in ("qemu.txt", "console.txt"):
        (tmp_path / name).write_text(f"{name} says this\n")
    yield made
    host.close()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()


def test_a_command_runs_in_a_shell_and_tells_what_it_wrote() -> None:
    assert carry_out(Command(7, "echo one; echo two >&2; exit 3", 10)) == Outcome(7, 3, "one\ntwo\n")


def test_one_that_takes_too_long_is_ended() -> None:
    assert carry_out(Command(1, "echo begun; exec sleep 60", 0.2)).status == 124


def test_nothing_is_asked_of_a_standard_input() -> None:
    assert carry_out(Command(1, "cat", 10)) == Outcome(1, 0, "")


def test_what_is_no_command_is_passed_over(tmp_path: Path) -> None:
    place = tmp_path / "lines"
    place.write_bytes(b"\xff\n{}\n\n" + msgspec.json.encode(Command(1, "echo still there", 10)) + b"\n")
    with place.open("rb") as incoming, (tmp_path / "answers").open("wb") as outgoing:
        serve(incoming, outgoing)
    assert msgspec.json.decode((tmp_path / "answers").read_bytes()) == msgspec.to_builtins(
        Outcome(1, 0, "still there\n")
    )


def test_it_runs_on_a_device() -> None:
    port, device = os.openpty()
    command = (sys.executable, "-m", "hil_mocks.vm.guest.agent", os.ttyname(device))
    with subprocess.Popen(command, cwd=Path(__file__).parents[2]) as agent:
        try:
            os.write(port, msgspec.json.encode(Command(5, "pwd", 10)) + b"\n")
            answer = b""
            while b'"number":5,"status":0' not in answer:  # the terminal's echo comes first
                answer += os.read(port, 4096)
        finally:
            agent.kill()
    os.close(device)
    os.close(port)


def test_the_host_gets_the_output_or_an_error_with_it(machine: Machine) -> None:
    assert machine.run("echo hello") == "hello"
    with pytest.raises(MachineError, match=r"exit status 4 .* exit 4\nwhy"):
        machine.run("echo why; exit 4")


def test_waiting_ends_with_success_or_in_time(machine: Machine, tmp_path: Path) -> None:
    machine.wait_until(f"test -e {tmp_path}")
    with pytest.raises(MachineError, match="exit status 124"):
        machine.wait_until("false", 0.5)


def test_an_outcome_that_comes_too_late_is_no_other_commands(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hil_mocks.vm.machine.REPLY_S", -9.9)
    with pytest.raises(MachineError, match=r"the machine does not answer; .*console.txt says this"):
        machine.tried("sleep 0.5; echo late", 10)
    monkeypatch.setattr("hil_mocks.vm.machine.REPLY_S", 20.0)
    assert machine.run("echo now") == "now"


def test_the_journal_begins_where_it_is_asked_to(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = "[    1.5] rover systemd[1]: one\n[   12.25] rover lcf-edge[7]: two\n   and more of it\n"
    monkeypatch.setattr(machine, "tried", lambda *_: Outcome(1, 0, lines))
    assert machine.journal(10) == "[   12.25] rover lcf-edge[7]: two\n   and more of it"


def test_the_registers_are_those_of_the_data_sheet() -> None:
    ((accel, gyro),) = bno055.counts(iter([[0.0, 0.0, 1.0, 0.1, -9.81, 0.0]]))
    assert accel == (10).to_bytes(2, "little") + (-981).to_bytes(2, "little", signed=True) + bytes(2)
    assert gyro == bytes(4) + (917).to_bytes(2, "little")  # 57.3 °/s
