"""The unit: what systemd itself says of it, and what it must agree with in the program."""

import re
import shutil
import subprocess
from collections import defaultdict
from pathlib import Path

import pytest

from lcf_edge.config import Config
from lcf_edge.daemon.descriptors import RESERVED
from lcf_edge.daemon.loop import FRAME_WAIT_S
from lcf_edge.daemon.service import ENDS_WITHIN_S, TICK_S
from lcf_edge.gate.entrances import MAX_PARTIES
from lcf_edge.gate.gate import MAX_GREETERS, MAX_STRANGERS
from lcf_edge.zenoh_link.session import _UNLESS_THE_FILE_SAYS, CLOSING_S

SHIPPED = Path(__file__).parents[2] / "systemd"
UNIT = SHIPPED / "lcf-edge.service"
INSTANCES_UNIT = SHIPPED / "lcf-edge@.service"
GATE_MIB = 32  # of the daemon's own
GATE_UNIT = SHIPPED / "lcf-edge-gate.service"
MAX_EXPOSURE = 2.0
OF_AN_INSTANCE = {  # what it has in place of the plain unit's
    "Description": "Line-Circle filter, %i: camera and IMU in, objects and circles out over Zenoh",
    "After": r"network.target var-lib-private-lcf\x2dedge\x2d%i.mount",
    "ExecStart": "/opt/lcf-edge/bin/lcf-edge run -c /etc/lcf-edge/%i.toml",
    "SyslogIdentifier": "lcf-edge@%i",
    "WorkingDirectory": "%S/lcf-edge-%i",
    "User": "lcf-edge-%i",  # systemd would take one for all, by the name before the @
    "StateDirectory": "lcf-edge-%i",
}
KERNEL_NAMES = {
    "videodev": {"video4linux", "media"},  # the latter by the module mc, which it needs
    "i2c-dev": {"i2c"},
    "industrialio": {"iio"},
    "usbserial": {"ttyUSB"},
    "cdc-acm": {"ttyACM"},
}
BUILT_IN = {"ttyAMA", "ttyS", "dma_heap"}  # the processor's own ports, and memory: no module where there is one

needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here")


def settings() -> dict[str, list[str]]:
    """Of [Service], the values of each key in their order."""
    keys: dict[str, list[str]] = defaultdict(list)
    for name, value in re.findall(r"^(\w+)=(.*)$", UNIT.read_text(encoding="utf-8").split("[Service]")[1], re.M):
        keys[name].append(value)
    return keys


def words(name: str) -> set[str]:
    return {word for value in settings()[name] for word in value.split()}


def as_started(unit: Path) -> str:
    """The name of a unit that runs; of a template there are only instances."""
    return unit.name.replace("@.", "@front.")


@needs_systemd
@pytest.mark.parametrize("shipped", [UNIT, INSTANCES_UNIT, GATE_UNIT], ids=lambda path: path.name)
def test_systemd_finds_no_fault_but_the_program_that_is_not_here(tmp_path: Path, shipped: Path) -> None:
    unit = tmp_path / as_started(shipped)
    unit.write_text(
        shipped.read_text(encoding="utf-8").replace("/opt/lcf-edge/bin/lcf-edge", "/bin/true"), encoding="utf-8"
    )
    done = subprocess.run(("systemd-analyze", "verify", unit), check=False, capture_output=True, text=True)
    keys = [line for line in done.stderr.splitlines() if unit.name in line]
    assert keys == []


@needs_systemd
@pytest.mark.parametrize("unit", [UNIT, INSTANCES_UNIT, GATE_UNIT], ids=lambda path: path.name)
def test_little_is_exposed(tmp_path: Path, unit: Path) -> None:
    started = tmp_path / as_started(unit)
    started.write_bytes(unit.read_bytes())
    done = subprocess.run(
        (
            "systemd-analyze",
            "security",
            "--offline=true",
            f"--threshold={MAX_EXPOSURE * 10:.0f}",
            "--no-pager",
            started,
        ),
        check=False,
        capture_output=True,
        text=True,
    )
    if "unrecognized option" in done.stderr:
        pytest.skip("this systemd-analyze has no --offline")
    assert done.returncode == 0, done.stdout.splitlines()[-1:]
    exposure = re.search(r"exposure level for [\w.@-]+: ([\d.]+)", done.stdout)
    assert exposure
    assert float(exposure[1]) <= MAX_EXPOSURE


def test_an_instance_is_the_plain_unit_but_for_what_two_cannot_share() -> None:
    def lines(unit: Path) -> list[str]:
        keys = unit.read_text(encoding="utf-8").split("[Unit]")[1].splitlines()
        return [line for line in keys if line.partition("=")[0] not in OF_AN_INSTANCE]

    assert lines(INSTANCES_UNIT) == lines(UNIT)
    own = dict(re.findall(r"^(\w+)=(.*)$", INSTANCES_UNIT.read_text(encoding="utf-8"), re.M))
    assert {name: own[name] for name in OF_AN_INSTANCE} == OF_AN_INSTANCE


def test_no_setting_is_given_twice_by_mistake() -> None:
    several = {name for name, values in settings().items() if len(values) > 1}
    assert several == {"DeviceAllow", "SystemCallFilter"}


def test_the_process_may_take_its_budget_and_some_more() -> None:
    (most,) = settings()["MemoryMax"]
    budget_mib = Config().memory.budget_mib
    assert budget_mib * 1.25 <= float(most.removesuffix("M")) - GATE_MIB <= budget_mib * 1.5


def test_the_watchdog_waits_for_a_few_feedings_and_a_stop_for_the_program() -> None:
    (watchdog_s,), (stop_s,) = settings()["WatchdogSec"], settings()["TimeoutStopSec"]
    assert float(watchdog_s) >= 3 * max(TICK_S, FRAME_WAIT_S)
    assert float(stop_s) > ENDS_WITHIN_S + 2 * CLOSING_S


def test_the_document_tells_the_limits_of_the_unit() -> None:
    keys = (SHIPPED.parent / "docs/install.md").read_text(encoding="utf-8").split("\n## The unit\n")[1]
    unit = dict(re.findall(r"^(\w+)=(.*)$", UNIT.read_text(encoding="utf-8"), re.M))
    assert f"after {unit['TimeoutStartSec']} s without either it has failed" in keys
    assert f"{unit['WatchdogSec']} s without a turn of the pipeline" in keys
    assert f"after {unit['RestartSec']} s, however often" in keys
    assert f"killed after {unit['TimeoutStopSec']} s" in keys
    assert f"{unit['MemoryMax'].removesuffix('M')} MiB (`MemoryMax`)" in keys


def test_a_wrong_configuration_is_not_tried_again_and_anything_else_forever() -> None:
    assert settings()["RestartPreventExitStatus"] == ["2"]
    assert settings()["Restart"] == ["on-failure"]
    assert "\nStartLimitIntervalSec=0\n" in UNIT.read_text(encoding="utf-8")


def test_every_group_is_made_if_it_is_missing() -> None:
    rows = [line.split() for line in (SHIPPED / "lcf-edge.sysusers").read_text(encoding="utf-8").splitlines()]
    assert {row[1] for row in rows if row[0] == "g"} == words("SupplementaryGroups")


def test_every_kind_of_device_is_known_to_the_kernel_before_the_start() -> None:
    lines = (SHIPPED / "lcf-edge.modules").read_text(encoding="utf-8").splitlines()
    modules = {line for line in lines if not line.startswith("#")}
    allowed = {word.removeprefix("char-") for word in words("DeviceAllow") if word != "rw"}
    assert set().union(*(KERNEL_NAMES[module] for module in modules)) == allowed - BUILT_IN


def test_the_rules_name_no_group_that_the_unit_has_not() -> None:
    rules = (SHIPPED / "70-lcf-edge.rules").read_text(encoding="utf-8")
    assert set(re.findall(r'GROUP="(\w+)"', rules)) <= words("SupplementaryGroups")


def test_the_names_that_the_documents_and_the_configuration_use_are_made() -> None:
    rules = (SHIPPED / "70-lcf-edge.rules").read_text(encoding="utf-8")
    made = {f"/dev/{name}" for name in re.findall(r'SYMLINK\+="([\w/-]+)"', rules)}
    texts = (SHIPPED / "config.toml", SHIPPED.parent / "docs/install.md")
    used = {name for text in texts for name in re.findall(r"/dev/lcf-edge/\w+", text.read_text(encoding="utf-8"))}
    assert used
    assert used <= made


def test_a_reload_needs_no_program_that_a_minimal_system_lacks() -> None:
    assert settings()["ExecReload"] == ["/bin/sh -c 'kill -HUP $MAINPID'"]  # /bin/kill is of a package of its own


def test_the_gate_may_open_what_its_bounds_need_and_no_more() -> None:
    unit = dict(re.findall(r"^(\w+)=(.*)$", GATE_UNIT.read_text(encoding="utf-8"), re.M))
    assert MAX_STRANGERS + 2 * MAX_GREETERS + 2 * MAX_PARTIES + 32 <= int(unit["LimitNOFILE"]) <= 256


def test_the_daemon_may_open_what_its_sessions_need() -> None:
    sessions, pending = int(_UNLESS_THE_FILE_SAYS["transport/unicast/max_sessions"]), 100
    assert sessions + pending + RESERVED + 64 <= int(settings()["LimitNOFILE"][0]) <= 1024
