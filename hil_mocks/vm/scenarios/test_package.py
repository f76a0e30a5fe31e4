"""The Debian package under systemd, with a small program in it: upgraded, removed, purged."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from hil_mocks.small_wheel import wheel_of
from hil_mocks.vm.daemon import CONFIGURATION, PATIENCE_S, UNIT
from hil_mocks.vm.machine import Machine
from hil_mocks.vm.scenarios.test_archive import KEPT, PUT_BACK, SETUP_S, STARTS, status
from release import deb
from release.debian import MACHINES

pytestmark = pytest.mark.skipif(shutil.which("dh_builddeb") is None, reason="no debhelper here")
APT = "DEBIAN_FRONTEND=noninteractive apt-get --yes"


@pytest.fixture(scope="module")
def free(machine: Machine) -> Iterator[Machine]:
    """Without what `make install` put there, which is put back."""
    machine.run(f"systemctl stop {UNIT}; mv /opt/lcf-edge {KEPT}; make -C /usr/src/lcf-edge uninstall PURGE=1")
    yield machine
    machine.tried(f"{APT} purge lcf-edge", SETUP_S)
    machine.run(PUT_BACK, SETUP_S)


def package(machine: Machine, folder: Path, program: str) -> str:
    """Where the machine sees a package with that program."""
    (folder / "wheels").mkdir(parents=True)
    wheel = wheel_of(folder / "built", "1.0", program)
    processor = MACHINES[machine.run("uname -m")]
    made = deb.pack(processor, wheel, folder / "wheels", folder / "dist", ("-Zxz", "-z0"))
    shutil.copy(made, machine.share / made.name)
    return f"/mnt/{made.name}"


def test_an_upgrade_restarts_it_and_keeps_the_configuration(free: Machine, tmp_path: Path) -> None:
    free.run(f"{APT} install {package(free, tmp_path / 'older', STARTS)}", SETUP_S)
    assert free.tried(f"systemctl is-active {UNIT}").output.strip() == "inactive"  # whoever installs it starts it
    free.run(f"systemctl start {UNIT}; echo '# mine' >> {CONFIGURATION}", PATIENCE_S)
    assert status(free) == "1.0 runs"
    newer = package(free, tmp_path / "newer", STARTS.replace("{version} runs", "newer runs"))
    free.run(f"{APT} install --reinstall {newer}", SETUP_S)
    assert status(free) == "newer runs"
    assert free.run(f"tail -1 {CONFIGURATION}") == "# mine"


def test_removed_it_runs_no_more_and_purged_nothing_is_left(free: Machine) -> None:
    free.run("touch /var/lib/lcf-edge/drive.mcap")
    free.run(f"{APT} remove lcf-edge", SETUP_S)
    assert free.run(f"systemctl show {UNIT} --property=LoadState,ActiveState --value").split() == [
        "not-found",
        "inactive",
    ]
    free.run(f"test -e {CONFIGURATION} -a -e /var/lib/private/lcf-edge/drive.mcap")
    free.run(f"{APT} purge lcf-edge", SETUP_S)
    free.run("test ! -e /etc/lcf-edge -a ! -e /var/lib/lcf-edge -a ! -e /var/lib/private/lcf-edge")
