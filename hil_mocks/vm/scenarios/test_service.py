"""The unit under systemd: start, confinement, watchdog, limits, end."""

import pytest

from hil_mocks.vm.daemon import DEFAULT_SETTINGS, PATIENCE_S, UNIT, Daemon, Subscriber
from hil_mocks.vm.machine import Machine

STOPS_S = 2.0
MAX_EXPOSURE = 1.6  # of systemd-analyze; 0.4 of it are the gate, which tells users apart and lowers its priority


@pytest.fixture
def started(daemon: Daemon) -> Daemon:
    """Running, with frames."""
    if daemon.show("ActiveState") != "active":
        daemon.start(DEFAULT_SETTINGS)
    daemon.subscriber.wait_for_scenes()
    return daemon


def test_it_is_ready_when_frames_come_and_tells_its_status(daemon: Daemon, subscriber: Subscriber) -> None:
    daemon.start(DEFAULT_SETTINGS)
    assert daemon.show("ActiveState") == "active"
    daemon.machine.wait_until(f"systemctl show {UNIT} -p StatusText | grep -E '[1-9].* frames/s, .* circles'")
    subscriber.wait_for_scenes()
    assert (subscriber.scenes[-1].image_width, subscriber.scenes[-1].image_height) == (320, 180)


def test_it_is_a_user_of_its_own_without_rights(started: Daemon) -> None:
    status = dict(
        line.split(":\t", 1)
        for line in started.machine.run(f"cat /proc/{started.pid}/status").splitlines()
        if "\t" in line
    )
    uids = set(map(int, status["Uid"].split()))
    assert len(uids) == 1
    assert 61184 <= uids.pop() <= 65519  # systemd's dynamic users
    assert int(status["CapEff"], 16) == int(status["CapBnd"], 16) == 0
    assert (status["NoNewPrivs"].strip(), status["Seccomp"].strip()) == ("1", "2")


def test_it_is_little_exposed(machine: Machine) -> None:
    output = machine.run(f"systemd-analyze security {UNIT} --no-pager | tail -1")
    assert float(output.split(": ")[1].split()[0]) <= MAX_EXPOSURE


def test_it_sees_a_file_system_that_cannot_be_written_but_for_its_own_folder(started: Daemon) -> None:
    inside = f"nsenter --target {started.pid} --mount touch"
    assert "Read-only file system" in started.machine.tried(f"{inside} /etc/probe").output
    started.machine.run(f"{inside} /var/lib/lcf-edge/probe && rm /var/lib/private/lcf-edge/probe")


def test_the_watchdog_ends_a_frozen_daemon_and_it_comes_back(started: Daemon, begun_s: float) -> None:
    restarts = started.restarts
    started.machine.run(f"kill -STOP {started.pid}")
    started.wait_for_restart(restarts)
    assert "Watchdog timeout" in started.machine.journal(begun_s)
    started.subscriber.wait_for_scenes()


def test_killed_it_comes_back(started: Daemon) -> None:
    restarts = started.restarts
    started.machine.run(f"kill -KILL {started.pid}")
    started.wait_for_restart(restarts)
    started.subscriber.wait_for_scenes()


def test_a_reload_is_over_when_systemctl_returns(started: Daemon, begun_s: float) -> None:
    started.configure("log.level = 'info'\n" + DEFAULT_SETTINGS.replace("[camera]", "[camera]\nheight_m = 0.7"))
    started.machine.run(f"systemctl reload {UNIT}")
    assert "reload: changed camera.height_m" in started.machine.journal(begun_s)
    pid = started.pid
    started.subscriber.wait_for_scenes()
    assert started.pid == pid


def test_it_stops_in_order_within_two_seconds(started: Daemon, begun_s: float) -> None:
    started.stop()
    took_us = int(started.show("InactiveEnterTimestampMonotonic")) - int(started.show("ActiveExitTimestampMonotonic"))
    assert started.show("Result") == "success"
    assert "abandoned" not in started.machine.journal(begun_s)
    assert took_us / 1e6 < STOPS_S


def test_a_configuration_that_cannot_work_is_not_tried_again(daemon: Daemon, begun_s: float) -> None:
    daemon.configure(DEFAULT_SETTINGS + "nonsense = 1\n")
    assert daemon.machine.tried(f"systemctl start {UNIT}").status != 0
    assert (daemon.show("ExecMainStatus"), daemon.show("ActiveState"), daemon.restarts) == ("2", "failed", 0)
    assert "unknown key zenoh.nonsense" in daemon.machine.journal(begun_s)


def test_over_its_memory_it_is_killed_and_comes_back(started: Daemon, begun_s: float) -> None:
    restarts = started.restarts
    limit = "12M"  # what could be read again from files is not enough to get below
    started.machine.run(f"systemctl set-property --runtime {UNIT} MemoryMax={limit}")
    try:
        restarted = f"test $(systemctl show {UNIT} --property=NRestarts --value) -gt {restarts}"
        started.machine.wait_until(restarted, PATIENCE_S)
    finally:
        started.machine.run(f"systemctl set-property --runtime {UNIT} MemoryMax=144M")
    started.wait_for_restart(restarts)
    assert "oom-kill" in started.machine.journal(begun_s)
    started.subscriber.wait_for_scenes()


def test_it_starts_from_a_root_that_is_read_only(daemon: Daemon) -> None:
    daemon.start(DEFAULT_SETTINGS)
    daemon.stop()
    daemon.machine.run("mount -o remount,ro /")
    try:
        daemon.machine.run(f"systemctl start {UNIT}", 90)
        daemon.subscriber.wait_for_scenes()
    finally:
        daemon.machine.run("mount -o remount,rw /")
