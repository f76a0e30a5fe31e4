"""A socket in the file system: whom its permissions do not let in is not let in, and whom they do gets scenes."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from lcf_edge.cdr import decode_diagnostics
from lcf_edge.config import Config, Publish, Zenoh
from lcf_edge.zenoh_link.link import Link
from lcf_edge.zenoh_link.session import open_session

PLANNER = """
import json, os, sys, zenoh
settings = zenoh.Config()
for key, value in json.loads(sys.argv[1]).items():
    settings.insert_json5(key, json.dumps(value))
if os.getuid() == 0:  # who is root is let in everywhere
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
try:
    session = zenoh.open(settings)
except zenoh.ZError:
    print("kept out")
else:
    session.put("lcf/scene", b"fake", congestion_control=zenoh.CongestionControl.BLOCK)
    print(len(list(session.get("lcf/query/schema", timeout=20.0))))
    session.close()
"""
KILLED = "import sys; from lcf_edge.config import *; from lcf_edge.zenoh_link.session import open_session\n"
KILLED += "session = open_session(Zenoh(listen=[sys.argv[1]]), Publish()); print('open', flush=True); sys.stdin.read()"
BUDGET_MIB = 85.0  # some 70 are the daemon's
ALLOWED_MIB = 10.0
PEERS, MANY = 6, 4000  # keys: 6 MiB each
NETWORK = Path(__file__).parents[3] / "docs/network.md"
PATIENCE = 60  # diagnostics come once a second
ALL, NOBODY = 0o666, 0o600 if os.getuid() == 0 else 0


@pytest.fixture
def path() -> Iterator[Path]:
    """With a short name, in a folder that everybody may enter."""
    with TemporaryDirectory(prefix="lcf-") as folder:
        Path(folder).chmod(0o755)
        yield Path(folder) / "zenoh.sock"


@pytest.fixture
def endpoint(path: Path) -> str:
    return f"unixsock-stream/{path}"


def planner(endpoint: str) -> str:
    """What another user's process gets: an answer, or nothing."""
    quiet = '"scouting/multicast/enabled": false, "transport/shared_memory/enabled": false, "listen/endpoints": []'
    settings = f'{{{quiet}, "mode": "client", "connect/endpoints": ["{endpoint}"]}}'
    done = subprocess.run([sys.executable, "-c", PLANNER, settings], check=True, capture_output=True, text=True)
    return done.stdout.strip()


def test_permissions_of_the_file_say_who_is_let_in(path: Path, endpoint: str) -> None:
    link = Link(open_session(Zenoh(listen=[endpoint]), Publish()), Config())
    try:
        path.chmod(NOBODY)
        assert planner(endpoint) == "kept out"
        path.chmod(ALL)
        assert planner(endpoint) == "1"
    finally:
        link.close()


def test_the_umask_of_the_document_lets_in_the_group_and_nobody_else(path: Path, endpoint: str) -> None:
    found = re.search(r"^UMask=(\d+)$", NETWORK.read_text(encoding="utf-8"), re.M)
    assert found
    before = os.umask(int(found[1], 8))
    try:
        session = open_session(Zenoh(listen=[endpoint]), Publish())
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o770
    session.close()  # type: ignore[no-untyped-call]


def test_what_a_killed_daemon_has_left_there_does_not_keep_the_next_from_listening(path: Path, endpoint: str) -> None:
    killed = subprocess.Popen(
        [sys.executable, "-c", KILLED, endpoint], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert killed.stdout
    assert killed.stdout.readline() == "open\n"
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    assert path.exists()
    link = Link(open_session(Zenoh(listen=[endpoint]), Publish()), Config())
    path.chmod(ALL)
    assert planner(endpoint) == "1"
    link.close()


def test_who_declares_too_much_is_cut_there_too(
    endpoint: str, without_camera: Callable[..., Any], start: Any, resident_mib: Callable[[Any], float]
) -> None:
    daemon = without_camera(f"memory.budget_mib={BUDGET_MIB}", "camera.width=320", "camera.height=240")
    client = {
        "mode": "client",
        "listen__endpoints": [],
        "connect__endpoints": [endpoint],
        "connect__timeout_ms": 10_000,
    }
    watching = start(**client)
    watching.subscribe("lcf/diagnostics")
    for number in range(PEERS):
        start(**client).ask("announce_many", key=f"lcf/of-the-peer/{number}", count=MANY)
    for _ in range(PATIENCE):
        (sample,) = watching.receive("lcf/diagnostics")  # who is cut connects again
        link = next(dict(one.values) for one in decode_diagnostics(sample.payload).status if one.name == "link")
        assert resident_mib(daemon) < BUDGET_MIB + ALLOWED_MIB
        if "connections cut" in link:
            break
    assert int(link["connections cut"]) >= 1
