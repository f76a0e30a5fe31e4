"""What docs/desk.md has typed into three terminals works together, with another port."""

import json
import re
import shlex
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

Blocks = Callable[[str, str], list[str]]
Start = Callable[[str], "subprocess.Popen[str]"]


@pytest.fixture
def start(place: Path, endpoint: str) -> Iterator[Start]:
    """Runs a line of the document in the folder of the demo."""
    with ExitStack() as stack:

        def begin(line: str) -> "subprocess.Popen[str]":
            _, command, *arguments = shlex.split(line)
            where = ["--set", f'zenoh.listen=["{endpoint}"]'] if command == "run" else ["--connect", endpoint]
            process = subprocess.Popen(
                (sys.executable, "-u", "-m", "lcf_edge", command, *arguments, *where),
                cwd=place,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
            stack.callback(end, process)
            return process

        yield begin


def end(process: "subprocess.Popen[str]") -> None:
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=20)


def test_daemon_table_and_page(blocks: Blocks, start: Start) -> None:
    run_line, watch_line, view_line = (
        line
        for block in blocks("docs/desk.md", "bash")
        for line in block.replace("\\\n", "").splitlines()
        if "/dev/" not in line
    )
    daemon = start(run_line)
    assert daemon.stderr
    assert any("ready: receiving frames" in line for line in daemon.stderr)
    table = start(f"{watch_line} --json")
    assert table.stdout
    assert "circles" in json.loads(table.stdout.readline())
    page = start(f"{view_line} --port 0")
    assert page.stdout
    (address,) = re.findall(r"http://127\.0\.0\.1:\d+/?", page.stdout.readline())
    with urllib.request.urlopen(address) as answer:
        assert answer.status == 200
