"""``lcf-edge`` as a process of its own: who waits for something from it waits no longer than it runs, and sees why."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import NoReturn, TypeVar

import pytest

from lcf_edge.messages import Scene
from lcf_edge.zenoh_link import scenes
from tests.emulation import SLOWNESS

PATIENCE_S = 30.0 * SLOWNESS
LOOK_S = 0.02

Process = subprocess.Popen[str]
Found = TypeVar("Found")


def ended(process: Process) -> tuple[int, str, list[str]]:
    """Exit status, what it printed, what it said."""
    out, errors = process.communicate(timeout=PATIENCE_S)
    assert "Traceback" not in errors
    return process.returncode, out, errors.splitlines()


def end(process: Process) -> None:
    """However it went; what it said stands beside a test's failure."""
    if process.poll() is None:
        process.kill()
    sys.stderr.write(process.communicate()[1])


def scenes_of(process: Process, endpoint: str) -> Iterator[Scene]:
    """What it publishes, as long as it runs."""
    with closing(scenes(endpoint)) as received:

        def end_with_it() -> None:
            process.wait()
            received.close()

        threading.Thread(target=end_with_it).start()
        yield from received
    _fail(process)


def line_of(process: Process, part: str) -> str:
    """The next line on its standard error that has ``part`` in it."""
    assert process.stderr
    read = []
    for line in process.stderr:
        if part in line:
            return line
        read.append(line)
    pytest.fail(f"it has ended without a line with {part!r}: {''.join(read)}")


def wait_for(process: Process, look: Callable[[], Found | None]) -> Found:
    """What ``look`` finds, as soon as it finds something."""
    end_s = time.monotonic() + PATIENCE_S
    runs = True
    while (found := look()) is None:
        if not runs:
            _fail(process)
        assert time.monotonic() < end_s
        time.sleep(LOOK_S)
        runs = process.poll() is None  # before the next look, for what it left
    return found


def _fail(process: Process) -> NoReturn:
    errors = process.communicate(timeout=PATIENCE_S)[1]
    pytest.fail(f"it has ended, with exit status {process.returncode}: {errors}")
