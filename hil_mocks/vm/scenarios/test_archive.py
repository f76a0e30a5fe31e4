"""The archive of ``make bundle`` under systemd: a version that does not start gives way to the one before.

The programs in the archives are small ones that only say that they are ready, under the true unit.
"""

import tarfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from hil_mocks.small_wheel import wheel_of
from hil_mocks.vm.daemon import PATIENCE_S, UNIT
from hil_mocks.vm.machine import Machine, MachineError
from release import bundle

STARTS = """
import os, signal, socket, sys

def main():
    if sys.argv[1:] == ["--version"]:
        print("lcf-edge {version}")
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.connect(os.environ["NOTIFY_SOCKET"])
        systemd.send(b"READY=1\\nSTATUS={version} runs")
        while signal.sigtimedwait([signal.SIGTERM], 1.0) is None:
            systemd.send(b"WATCHDOG=1")
"""
STARTS_NOT = """
import sys

def main():
    if sys.argv[1:] == ["--version"]:
        print("lcf-edge {version}")
        return
    sys.exit("{version} does not start")
"""
SETUP_S = 2 * PATIENCE_S
KEPT = "/opt/of-make-install"
PUT_BACK = (
    f"mv {KEPT} /opt/lcf-edge && ln -sfn /opt/lcf-edge/bin/lcf-edge /usr/local/bin/lcf-edge"
    " && make -C /usr/src/lcf-edge install FILES_ONLY=1"
)


@pytest.fixture(scope="module")
def free(machine: Machine) -> Iterator[Machine]:
    """Without the program that `make install` put there, which is put back."""
    machine.run(f"systemctl stop {UNIT}; mv /opt/lcf-edge {KEPT}")
    yield machine
    machine.tried("/opt/lcf-edge/setup remove", SETUP_S)
    machine.run(PUT_BACK, SETUP_S)


def unpacked(machine: Machine, folder: Path, version: str, program: str) -> str:
    """Where the machine sees an archive of that version."""
    processor = machine.run("uname -m")
    wheel = wheel_of(folder / "built", version, program)
    (folder / "wheels").mkdir(exist_ok=True)
    archive = bundle.pack(processor, wheel, folder / "wheels", "", folder / "dist")
    with tarfile.open(archive) as packed:
        packed.extractall(machine.share, filter="data")
    place = f"/mnt/{archive.stem}"
    machine.run(f"cp /usr/share/python-wheels/pip-*.whl {place}/wheels/")
    return place


def status(machine: Machine) -> str:
    return machine.run(f"systemctl show {UNIT} --property=StatusText --value")


def test_a_version_that_does_not_start_gives_way_to_the_one_before(free: Machine, tmp_path: Path) -> None:
    free.run(f"{unpacked(free, tmp_path, '1.0', STARTS)}/setup", SETUP_S)
    free.run(f"systemctl start {UNIT}", PATIENCE_S)
    assert status(free) == "1.0 runs"
    newer = unpacked(free, tmp_path, "2.0", STARTS_NOT)
    with pytest.raises(MachineError, match=r"2\.0-\w+ does not start, so 1\.0-\w+ runs again; journalctl -u lcf-edge"):
        free.run(f"{newer}/setup", SETUP_S)
    assert status(free) == "1.0 runs"
    assert free.run(f"systemctl is-active {UNIT}") == "active"
    assert "/1.0-" in free.run("readlink -f /opt/lcf-edge")
    assert "2.0" not in free.run("ls /opt/lcf-edge-versions")


def test_back_and_back_again_each_runs(free: Machine, tmp_path: Path) -> None:
    free.run(f"{unpacked(free, tmp_path, '3.0', STARTS)}/setup", SETUP_S)
    assert status(free) == "3.0 runs"
    for version in ("1.0", "3.0"):
        free.run("/opt/lcf-edge/setup rollback", SETUP_S)
        assert status(free) == f"{version} runs"


def test_removed_it_runs_no_more_and_its_unit_is_gone(free: Machine) -> None:
    free.run("/opt/lcf-edge/setup remove", SETUP_S)
    assert free.run(f"systemctl show {UNIT} --property=LoadState,ActiveState --value").split() == [
        "not-found",
        "inactive",
    ]
