"""Board, clock, memory, service, permissions and software, on files and programs that play the machine's."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from lcf_edge.compilation import Compiled
from lcf_edge.config import Camera, Config, Imu, Memory, Record
from lcf_edge.doctor import board, clock, memory, permissions, service, software
from lcf_edge.doctor.clock import SystemClock
from lcf_edge.doctor.finding import Context, Finding, Severity

Machine = Callable[..., Context]
Write = Callable[[str, str], None]
NO_FOLDER = Config(record=Record(folder="/no-such-folder"))
GOOD_CLOCK = SystemClock(1.8e9, synchronised=True, max_error_s=0.002, resolution_s=1e-9, source="tsc")
RUNNING = {
    "LoadState": "loaded",
    "UnitFileState": "enabled",
    "ActiveState": "active",
    "SubState": "running",
    "Result": "success",
    "NRestarts": "0",
    "ExecMainStatus": "0",
    "MemoryMax": str(128 * 2**20),
}


def bad(findings: list[Finding]) -> Finding:
    """The only one that is not as it should be."""
    (found,) = [finding for finding in findings if finding.level is not Severity.OK]
    return found


# Board.


def test_a_cool_board_is_reported_with_name_and_temperature(machine: Machine, write: Write) -> None:
    write("sys/firmware/devicetree/base/model", "Raspberry Pi 4 Model B Rev 1.4\0")
    write("sys/class/thermal/thermal_zone0/temp", "48312\n")
    write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "ondemand\n")
    heat, governor, disk = board.check(machine(Config(record=Record(folder="/"))))
    assert (heat.level, heat.text) == (
        Severity.OK,
        "Raspberry Pi 4 Model B Rev 1.4: 48 °C, not throttled",
    )
    assert (governor.level, governor.text) == (Severity.OK, "processor governor: ondemand")
    assert "GiB are free in / " in f"{disk.text} "


@pytest.mark.parametrize(
    ("files", "text"),
    [
        ({"class/thermal/thermal_zone0/temp": "84000"}, "84 °C, about to slow down"),
        ({"devices/platform/soc/soc:firmware/get_throttled": "50005"}, "under-voltage"),
        ({"devices/platform/soc/soc:firmware/get_throttled": "8"}, "slowed down (soft temperature limit)"),
        ({"devices/system/cpu/cpu0/cpufreq/scaling_governor": "powersave"}, "held at a low clock (powersave)"),
    ],
)
def test_what_slows_a_board_down_is_reported(machine: Machine, write: Write, files: dict[str, str], text: str) -> None:
    for name, content in files.items():
        write(f"sys/{name}", content)
    found = bad(list(board.check(machine(NO_FOLDER))))
    assert found.level is Severity.WARN
    assert text in found.text


def test_powersave_of_a_driver_that_steers_itself_is_good(machine: Machine, write: Write) -> None:
    write("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave")
    write("sys/devices/system/cpu/cpu0/cpufreq/scaling_driver", "intel_pstate")
    assert all(finding.level is Severity.OK for finding in board.check(machine(NO_FOLDER)))


def test_a_full_disk_is_reported(machine: Machine) -> None:
    full = Config(record=Record(folder="/", free_mib=1e12))
    assert "nothing is recorded, record.free_mib" in bad(list(board.check(machine(full)))).text


# Clock.


def test_the_clock_of_this_machine_can_be_read(machine: Machine) -> None:
    kept, fine = clock.check(machine(sys=Path("/sys")))
    assert kept.text.startswith(("synchronised", "not synchronised"))
    assert fine.level is Severity.OK


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"now_s": 1000.0}, "it says 1970: it was never set"),
        ({"synchronised": False}, "not synchronised"),
        ({"resolution_s": 0.004}, "the monotonic clock steps by 4.0 ms"),
    ],
)
def test_a_clock_that_is_wrong_or_coarse_is_reported(wrong: dict[str, float], text: str) -> None:
    assert all(finding.level is Severity.OK for finding in clock.judged(GOOD_CLOCK))
    found = bad(list(clock.judged(replace(GOOD_CLOCK, **wrong))))  # type: ignore[arg-type]
    assert found.level is Severity.WARN
    assert found.text.startswith(text)


# Memory.


def meminfo(available_mib: int, swapped_mib: int = 0) -> str:
    sizes = {"MemTotal": 1000, "MemAvailable": available_mib, "SwapTotal": 500, "SwapFree": 500 - swapped_mib}
    return "".join(f"{name}: {mib * 1024:>12} kB\n" for name, mib in sizes.items())


def test_a_budget_that_is_too_small_comes_with_one_that_is_not(machine: Machine, write: Write) -> None:
    write("proc/meminfo", meminfo(900))
    found = bad(list(memory.check(machine(Config(memory=Memory(budget_mib=40))))))
    assert found.level is Severity.FAIL
    assert "MiB are needed" in found.text
    budget_mib = float(found.remedy.partition("budget_mib=")[2].split()[0])
    assert all(f.level is Severity.OK for f in memory.check(machine(Config(memory=Memory(budget_mib=budget_mib)))))


@pytest.mark.parametrize(
    ("meminfo_text", "level"),
    [(meminfo(500), Severity.OK), (meminfo(60), Severity.FAIL), (meminfo(500, 200), Severity.WARN)],
)
def test_the_budget_must_be_free_and_nothing_swapped(
    machine: Machine, write: Write, meminfo_text: str, level: Severity
) -> None:
    write("proc/meminfo", meminfo_text)
    assert [finding.level for finding in memory.check(machine())] == [Severity.OK, level]


# Service.


@pytest.fixture
def systemctl(tmp_path: Path) -> Callable[[str], tuple[str, ...]]:
    """A program that answers as systemctl would."""

    def make(script: str) -> tuple[str, ...]:
        (tmp_path / "systemctl").write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / "systemctl").chmod(0o755)
        return (str(tmp_path / "systemctl"),)

    return make


def test_systemd_is_asked_for_the_unit(machine: Machine, systemctl: Callable[[str], tuple[str, ...]]) -> None:
    answer = "\n".join(f"{key}={value}" for key, value in RUNNING.items())
    asks = f"""[ "$1 $2" = "show lcf-edge.service" ] && echo "{answer}" """
    (found,) = service.check(machine(systemctl=systemctl(asks)))
    assert (found.level, found.text) == (Severity.OK, "running, never restarted")


def test_a_systemd_that_hangs_is_left(
    machine: Machine, systemctl: Callable[[str], tuple[str, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(service, "ANSWER_S", 0.1)
    (found,) = service.check(machine(systemctl=systemctl("exec sleep 60")))
    assert (found.level, found.text) == (Severity.WARN, "systemd does not answer within 0.1 s")


@pytest.mark.parametrize("command", ["/no/such/program", "/bin/false"])
def test_without_systemd_it_says_so(machine: Machine, command: str) -> None:
    (found,) = service.check(machine(systemctl=(command,)))
    assert found.level is Severity.OK
    assert "systemd" in found.text


@pytest.mark.parametrize(
    ("state", "level", "text", "remedy"),
    [
        ({"LoadState": "not-found"}, Severity.OK, "not installed", ""),
        ({"LoadState": "masked"}, Severity.FAIL, "the unit is masked", "systemd-analyze verify lcf-edge.service"),
        ({"UnitFileState": "disabled"}, Severity.WARN, "does not start at boot", "sudo systemctl enable lcf-edge"),
        (
            {"ActiveState": "inactive", "SubState": "dead"},
            Severity.WARN,
            "inactive (dead)",
            "sudo systemctl start lcf-edge",
        ),
        ({"NRestarts": "3"}, Severity.WARN, "running, restarted automatically 3 times", "journalctl -u lcf-edge"),
        ({"ActiveState": "failed", "Result": "watchdog"}, Severity.FAIL, "failed: the pipeline hung", "journalctl"),
        ({"ActiveState": "failed", "Result": "oom-kill"}, Severity.FAIL, "failed: it took more memory", "journalctl"),
        (
            {"ActiveState": "failed", "Result": "exit-code", "ExecMainStatus": "2"},
            Severity.FAIL,
            "failed: its configuration cannot be used",
            "lcf-edge config",
        ),
        (
            {"MemoryMax": str(100 * 2**20)},
            Severity.WARN,
            "MemoryMax is 100 MiB",
            "sudo systemctl set-property lcf-edge",
        ),
    ],
)
def test_every_state_of_the_unit(state: dict[str, str], level: Severity, text: str, remedy: str) -> None:
    found = list(service.judged(RUNNING | state, 96.0))
    worst = next((finding for finding in found if finding.level is not Severity.OK), found[0])
    assert worst.level is level
    assert worst.text.startswith(text)
    assert worst.remedy.startswith(remedy)


def test_no_limit_of_memory_is_enough_for_every_budget() -> None:
    assert all(f.level is Severity.OK for f in service.judged(RUNNING | {"MemoryMax": "infinity"}, 1e6))


# Permissions.


def test_only_the_groups_of_configured_devices_are_looked_at(machine: Machine) -> None:
    nothing = Config(camera=Camera(driver="recording", recording="drive"), imu=Imu())
    assert list(permissions.check(machine(nothing))) == []
    both = Config(imu=Imu(driver="csv"))
    assert [("video" in f.text, "dialout" in f.text) for f in permissions.check(machine(both))] == [
        (True, False),
        (False, True),
    ]


def test_a_device_of_another_group_is_reported(machine: Machine, write: Write, tmp_path: Path) -> None:
    write("dev/video0", "")
    os.chown(tmp_path / "dev/video0", -1, os.getgid())
    found = bad(list(permissions.check(machine())))
    assert "/dev/video0 belongs to the group " in found.text
    assert found.remedy.startswith(f"sudo chgrp video {tmp_path}/dev/video0")


def test_a_group_that_does_not_exist_is_made(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(permissions, "needed", lambda _: [("no-such-group", "-")])
    found = bad(list(permissions.check(machine())))
    assert found.remedy.startswith("sudo groupadd --system no-such-group")


# Software.


def test_versions_of_this_environment_are_good(machine: Machine) -> None:
    levels = [finding.level for finding in software.check(machine()) if "uncompiled" not in finding.text]
    assert set(levels) == {Severity.OK}


def test_a_filter_that_runs_uncompiled_is_reported_with_the_remedy() -> None:
    assert software.compilation(Compiled("_compiled.abi3.so")).level is Severity.OK
    found = software.compilation(Compiled(reason="it was installed without a compiler", command="sudo apt install gcc"))
    assert found.level is Severity.WARN
    assert found.text == "the filter runs uncompiled, about 100 times slower: it was installed without a compiler"
    assert found.remedy == "sudo apt install gcc"


@pytest.mark.parametrize(
    ("version", "level"),
    [("0.10.1", Severity.FAIL), ("1.4.9", Severity.FAIL), ("1.5.0", Severity.OK), ("2.0.0", Severity.WARN)],
)
def test_a_version_out_of_range_is_reported(version: str, level: Severity) -> None:
    first, *_ = software.packages({"numpy": "2.1.0", "opencv-python-headless": "4.10.0", "eclipse-zenoh": version})
    assert first.level is level
    if level is not Severity.OK:
        assert first.remedy == "pip install 'eclipse-zenoh>=1.5,<2'"
