"""Who comes through the gate of this computer, as it knows them."""

import os
import shutil
import socket
import subprocess
import sys

import pytest

from lcf_edge.gate import entrances

ONLY_PROCESSES = "mount -t proc -o subset=pid proc /proc && exec"  # as the unit sees it (ProcSubset=pid)
WHO = """
import socket
from lcf_edge.gate.entrances import _user
listening = socket.create_server(("127.0.0.1", 0))
outer = socket.create_connection(listening.getsockname())
print(_user(listening.accept()[0]))
"""


@pytest.mark.parametrize(("family", "host"), [(socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")])
def test_a_user_is_known_by_the_number(family: socket.AddressFamily, host: str) -> None:
    try:
        listening = socket.create_server((host, 0), family=family)
    except OSError:
        pytest.skip("no such addresses here")
    with listening, socket.create_connection(listening.getsockname()[:2]), listening.accept()[0] as inner:
        assert entrances._user(inner) == f"user {os.getuid()}"


@pytest.mark.skipif(os.getuid() != 0 or shutil.which("unshare") is None, reason="needs to mount")
def test_a_user_is_known_where_only_processes_are_shown() -> None:
    done = subprocess.run(
        ("unshare", "--mount", "sh", "-c", f'{ONLY_PROCESSES} "$@"', "sh", sys.executable, "-c", WHO),
        capture_output=True,
        text=True,
        check=False,
    )
    if "mount:" in done.stderr:
        pytest.skip("mounting is not permitted here")
    assert done.stdout == "user 0\n", done.stderr
