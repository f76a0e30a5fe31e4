"""The drop-in of docs/network.md for a socket in the file system: the group gets scenes, another user does not."""

import re
from collections.abc import Iterator

import pytest

from hil_mocks.vm.daemon import DEFAULT_SETTINGS, PATIENCE_S, WEBCAM, Daemon
from hil_mocks.vm.image import PROJECT
from hil_mocks.vm.machine import Machine

ENDPOINT = "unixsock-stream//run/lcf-edge/zenoh.sock"
DROP_INS = "/run/systemd/system/lcf-edge.service.d"
PLANNER = f"""
import threading
from lcf_edge.client import scenes
threading.Timer(60, lambda: __import__("os")._exit(3)).start()
print(next(scenes("{ENDPOINT}")).seq > 0, flush=True)
__import__("os")._exit(0)
"""
PYTHON = "/opt/lcf-edge/bin/python /mnt/planner.py"


@pytest.fixture(scope="module")
def listening(machine: Machine, daemon: Daemon) -> Iterator[None]:
    """As documented."""
    document = (PROJECT / "docs/network.md").read_text(encoding="utf-8").partition("### Programs on the rover")[2]
    toml, ini = (re.findall(rf"```{kind}\n(.*?)```", document, re.DOTALL)[0] for kind in ("toml", "ini"))
    assert ENDPOINT in toml
    (machine.share / "group.conf").write_text(ini, encoding="ascii")
    (machine.share / "planner.py").write_text(PLANNER, encoding="ascii")
    machine.run(
        "groupadd --system rover;"
        f"install -D -m 644 -t {DROP_INS} /mnt/group.conf; systemctl daemon-reload; systemctl stop lcf-edge"
    )
    daemon.configure(f"{WEBCAM}\n{toml}")
    machine.run("systemctl reset-failed lcf-edge; systemctl start lcf-edge", PATIENCE_S)
    yield
    machine.run(f"rm {DROP_INS}/group.conf; systemctl daemon-reload")
    daemon.start(DEFAULT_SETTINGS)


def test_the_socket_is_of_its_group(machine: Machine, listening: None) -> None:
    assert listening is None
    assert machine.run("stat -c '%G %a' /run/lcf-edge/zenoh.sock").split() == ["rover", "770"]


def test_who_is_of_the_group_gets_scenes_and_nobody_else(machine: Machine, listening: None) -> None:
    assert listening is None
    as_nobody = "setpriv --reuid 65534 --clear-groups --regid"
    assert machine.run(f"{as_nobody} rover {PYTHON}", PATIENCE_S) == "True"
    assert machine.tried(f"{as_nobody} 65534 {PYTHON}", PATIENCE_S).status == 3
