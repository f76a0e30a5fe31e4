"""Who waits for a daemon that has ended waits no longer, and sees what it said."""

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest

from tests.lcf_edge.daemon.process import Process, scenes_of, wait_for

SAYS_WHY = "import sys; sys.exit('camera: on fire')"


@pytest.mark.parametrize(
    "wait",
    [
        lambda process, endpoint, _: next(scenes_of(process, endpoint)),
        lambda process, _, __: wait_for(process, lambda: None),
        lambda _, __, manager: manager.until("READY=1"),
    ],
    ids=["for a scene", "for anything", "for what systemd is told"],
)
def test_a_wait_ends_with_the_process(wait: Callable[[Process, str, Any], object], endpoint: str, manager: Any) -> None:
    manager.daemon = subprocess.Popen((sys.executable, "-c", SAYS_WHY), stderr=subprocess.PIPE, text=True)
    with pytest.raises(pytest.fail.Exception, match=r"it has ended, with exit status 1: camera: on fire"):
        wait(manager.daemon, endpoint, manager)


def test_what_a_process_left_when_it_ended_is_found() -> None:
    with subprocess.Popen((sys.executable, "-c", ""), text=True) as process:
        looks: list[bool | None] = [None, True]

        def look() -> bool | None:
            process.wait()
            return looks.pop(0)

        assert wait_for(process, look)
