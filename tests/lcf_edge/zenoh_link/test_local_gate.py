"""The gate for programs on the rover: they do as on loopback, but none of them ends the daemon by its keys."""

import os
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

PATIENCE_S = 20.0
WILD = [[f"**/{n}/**" for n in range(1000)]]
DEEP = [["/".join("a" * 40)], ["**/a/" * 10 + "b"]]


@pytest.fixture
def path() -> Iterator[Path]:
    with TemporaryDirectory(prefix="lcf-") as folder:
        yield Path(folder) / "zenoh.sock"


@pytest.fixture
def endpoint(path: Path) -> str:
    return f"unixsock-stream/{path}"


class Gate:
    def __init__(self, path: Path) -> None:
        command = (sys.executable, "-m", "lcf_edge", "gate", "--port", "0", "--to", str(path))
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout
        self.endpoint, _, leads = self.process.stdout.readline().partition(" leads to ")
        assert leads == f"unixsock-stream/{path} for programs on this computer\n"

    def until_told(self, what: str) -> bool:
        """Whether it says so in time; else it is ended."""
        assert self.process.stderr
        ending = threading.Timer(PATIENCE_S, self.process.terminate)
        ending.start()
        try:
            return any(what in line for line in self.process.stderr)
        finally:
            ending.cancel()


@pytest.fixture
def gate(path: Path, without_camera: Callable[..., subprocess.Popen[str]]) -> Iterator[Gate]:
    """Before a daemon."""
    assert without_camera()
    gate = Gate(path)
    yield gate
    gate.process.terminate()
    _, said = gate.process.communicate(timeout=PATIENCE_S)
    assert gate.process.returncode == 0
    assert "Traceback" not in said


@pytest.fixture
def local(start: Any, gate: Gate) -> Callable[[], Any]:
    """Any program."""

    def connect() -> Any:
        peer = start(mode="client", listen__endpoints=[], connect__endpoints=[gate.endpoint])
        assert peer.ask("connected")
        return peer

    return connect


def test_programs_read_and_ask_as_on_loopback(local: Callable[[], Any]) -> None:
    reader = local()
    reader.subscribe("**")
    assert reader.receive("**", 1, PATIENCE_S)
    assert reader.get("lcf/**")
    assert reader.tokens("lcf/@alive/**") == ["lcf/@alive/rover"]


@pytest.mark.parametrize("offers", [WILD, DEEP], ids=["many-keys", "one-key"])
def test_a_program_whose_keys_are_too_much_is_cut_and_told_by_its_user(
    gate: Gate, local: Callable[[], Any], offers: list[list[str]]
) -> None:
    for keys in offers:
        local().ask("offer", keys=keys)
    assert gate.until_told(f"of user {os.getuid()}")
    assert local().get("lcf/query/schema")


@pytest.mark.parametrize("wrong", [[], ["--to", "7448"], ["--to", "/run/a", "--listen", "0.0.0.0"]])
def test_without_certificates_it_is_for_this_computer_only(wrong: list[str]) -> None:
    done = subprocess.run(
        (sys.executable, "-m", "lcf_edge", "gate", *wrong), check=False, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert re.fullmatch(r"lcf-edge: gate: without --tls .*\n", done.stderr)
