"""The server of the page as a process."""

import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest

PATIENCE_S = 60.0


class View:
    """``lcf-edge view`` on a free port. ``address``: the one that it prints."""

    def __init__(self, endpoint: str, *more: str) -> None:
        command = (sys.executable, "-m", "lcf_edge", "view", "--connect", endpoint, "--port", "0", *more)
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout
        self.first_line = self.process.stdout.readline()
        self.address = self.first_line.split()[1] if self.first_line else ""

    def end(self, number: int = signal.SIGTERM) -> tuple[int, str]:
        """Exit status, and what it said on standard error."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        _, errors = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, errors


@pytest.fixture(scope="session")
def serving() -> type[View]:
    return View


@pytest.fixture
def view(endpoint: str) -> Iterator[Callable[..., View]]:
    views: list[View] = []

    def begin(*more: str) -> View:
        views.append(View(endpoint, *more))
        return views[-1]

    yield begin
    for one in views:
        _, errors = one.end()
        assert errors == ""


@pytest.fixture(scope="package")
def seen(rover_at: Any) -> Iterator[tuple[Any, View]]:
    """A rover and a view of it, for tests that leave both as they are."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    rover, view = rover_at(endpoint), View(endpoint)
    yield rover, view
    assert view.end() == (0, "")
    rover.leave()
