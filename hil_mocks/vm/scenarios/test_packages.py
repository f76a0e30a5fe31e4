"""The Debian package and the archive as services of a machine without a network.

Each is installed, upgraded and removed; the archive also goes back, by itself from a version that does not start.
"""

import shutil
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from hil_mocks.small_wheel import wheel_of
from hil_mocks.vm.conftest import PROCESSORS, RESULTS, booted
from hil_mocks.vm.daemon import CONFIGURATION, DEFAULT_SETTINGS, PATIENCE_S, STATE, UNIT, Daemon
from hil_mocks.vm.image import DEBIAN_12, DEBIAN_13_WITH_LIBCAMERA, PROJECT, System
from hil_mocks.vm.machine import Machine
from release import bundle, deb, wheels
from release.debian import MACHINES

SYSTEMS = (DEBIAN_12, DEBIAN_13_WITH_LIBCAMERA)
INSTALLS_S = 300.0
LEFT = "find /etc /opt /usr/lib /usr/local /var/lib ! -path '/var/lib/dpkg/*' -name '*lcf-edge*'"
APT = "DEBIAN_FRONTEND=noninteractive apt-get --yes --quiet"
IS_COMPILED = "import sys; from lcf_edge.compilation import uncompiled; sys.exit(uncompiled() or 0)"


@pytest.fixture(scope="session")
def releases(pytestconfig: pytest.Config, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder: the package, and the archives ``first``, ``second`` and ``broken``, which ends at once, unpacked."""
    machine, folder = MACHINES[PROCESSORS[pytestconfig.option.arch]], tmp_path_factory.mktemp("releases")
    of_others = folder / "wheels"
    of_others.mkdir()
    bundle.fetch(machine, of_others)
    wheel = wheels.build(machine, wheels.source_package(folder), folder)
    deb.pack(machine, wheel, of_others, folder).rename(folder / "lcf-edge.deb")
    lock = (PROJECT / bundle.LOCK).read_text(encoding="utf-8")
    for name, of_project, more in (
        ("first", wheel, ""),
        ("second", wheel, "# a later version\n"),
        ("broken", wheel_of(folder, "9.9"), ""),
    ):
        with tempfile.TemporaryDirectory(dir=folder) as place:
            archive = bundle.pack(machine.name, of_project, of_others, lock + more, Path(place))
            with tarfile.open(archive) as packed:
                packed.extractall(place, filter="data")
            Path(place, archive.stem).rename(folder / name)
    shutil.rmtree(of_others)
    return folder


@pytest.fixture(scope="module", params=SYSTEMS, ids=lambda system: system.suite)
def machine(request: pytest.FixtureRequest, pytestconfig: pytest.Config, releases: Path) -> Iterator[Machine]:
    """With a webcam, and without the program that the other scenarios find installed."""
    system: System = request.param
    if system is not SYSTEMS[0] and PROCESSORS[pytestconfig.option.arch] != system.processor:
        pytest.skip("one system for all scenarios there")
    with booted(pytestconfig, system, RESULTS / f"packages-{system.suite}") as running:
        shutil.copytree(releases, running.share / "releases", copy_function=_linked)
        running.run("modprobe vivid && udevadm settle; make -C /usr/src/lcf-edge uninstall PURGE=1", INSTALLS_S)
        assert running.run(LEFT) == ""
        yield running


def _linked(one: str, other: str) -> None:
    """Without a copy where that can be."""
    try:
        Path(other).hardlink_to(one)
    except OSError:
        shutil.copy2(one, other)


def enabled(daemon: Daemon) -> None:
    """As documented: configured, enabled, started; with frames."""
    daemon.configure(DEFAULT_SETTINGS)
    daemon.machine.run(f"systemctl enable --now {UNIT}", PATIENCE_S)
    daemon.subscriber.wait_for_scenes()


def configuration(machine: Machine) -> str:
    """As it is now."""
    return machine.run(f"cat {CONFIGURATION}") + "\n"


def runs(machine: Machine, pid: int) -> bool:
    """Whether there is such a process."""
    return machine.tried(f"test -e /proc/{pid}").status == 0


def test_the_debian_package_brings_the_service(daemon: Daemon, machine: Machine) -> None:
    machine.run(f"{APT} install /mnt/releases/lcf-edge.deb", INSTALLS_S)
    assert daemon.show("ActiveState") == "inactive"  # who installs it enables it
    enabled(daemon)
    assert "/usr/lib/lcf-edge/" in machine.run(f"tr '\\0' ' ' < /proc/{daemon.pid}/cmdline")
    machine.run(f"/usr/lib/lcf-edge/bin/python -P -c '{IS_COMPILED}'")


def test_an_upgrade_of_the_package_restarts_the_service_as_it_was_configured(daemon: Daemon, machine: Machine) -> None:
    pid = daemon.pid
    machine.run(f"{APT} install --reinstall /mnt/releases/lcf-edge.deb", INSTALLS_S)
    machine.wait_until(f"systemctl is-active {UNIT}", PATIENCE_S)
    assert daemon.pid != pid
    assert configuration(machine) == DEFAULT_SETTINGS
    daemon.subscriber.wait_for_scenes()


def test_the_package_removed_leaves_configuration_and_recordings_and_purged_nothing(
    daemon: Daemon, machine: Machine
) -> None:
    pid = daemon.pid
    machine.run(f"touch {STATE}/drive.mcap; {APT} remove {UNIT}", INSTALLS_S)
    assert not runs(machine, pid)
    assert daemon.show("LoadState") == "not-found"
    assert configuration(machine) == DEFAULT_SETTINGS
    machine.run(f"test -e {STATE}/drive.mcap && {APT} purge {UNIT}", INSTALLS_S)
    assert machine.run(LEFT) == ""


def test_the_archive_brings_the_service(daemon: Daemon, machine: Machine) -> None:
    machine.run("/mnt/releases/first/setup", INSTALLS_S)
    enabled(daemon)
    assert "/opt/lcf-edge/" in machine.run(f"tr '\\0' ' ' < /proc/{daemon.pid}/cmdline")


def test_a_version_that_does_not_start_gives_way_to_the_one_before(daemon: Daemon, machine: Machine) -> None:
    before = machine.run("readlink /opt/lcf-edge")
    outcome = machine.tried("/mnt/releases/broken/setup", INSTALLS_S)
    assert outcome.status == 1
    assert f"does not start, so {before.removeprefix('lcf-edge-versions/')} runs again" in outcome.output
    assert machine.run("readlink /opt/lcf-edge; ls /opt/lcf-edge-versions").split() == [before, Path(before).name]
    assert daemon.show("ActiveState") == "active"
    daemon.subscriber.wait_for_scenes()


def test_a_newer_archive_replaces_what_runs_and_rollback_returns(daemon: Daemon, machine: Machine) -> None:
    first, pid = machine.run("readlink /opt/lcf-edge"), daemon.pid
    machine.run("/mnt/releases/second/setup", INSTALLS_S)
    second = machine.run("readlink /opt/lcf-edge")
    assert second != first
    assert daemon.pid != pid
    daemon.subscriber.wait_for_scenes()
    for expected in (first, second):
        pid = daemon.pid
        machine.run("/opt/lcf-edge/setup rollback", INSTALLS_S)
        assert machine.run("readlink /opt/lcf-edge") == expected
        assert daemon.pid != pid
        daemon.subscriber.wait_for_scenes()
    assert configuration(machine) == DEFAULT_SETTINGS


def test_the_archive_removed_leaves_configuration_and_purged_nothing(daemon: Daemon, machine: Machine) -> None:
    pid = daemon.pid
    machine.run("/opt/lcf-edge/setup remove", INSTALLS_S)
    assert not runs(machine, pid)
    assert daemon.show("LoadState") == "not-found"
    assert configuration(machine) == DEFAULT_SETTINGS
    machine.run("/mnt/releases/first/setup && /opt/lcf-edge/setup remove --purge", INSTALLS_S)
    assert machine.run(LEFT) == ""
