"""The systemd unit of this configuration: installed, enabled, running, and how it last ended."""

import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path

from lcf_edge.config import DEFAULT_PATH
from lcf_edge.doctor.finding import Context, Finding, fail, ok, warn

UNIT = "lcf-edge"
ANSWER_S = 5.0
_PROPERTIES = (
    "LoadState",
    "UnitFileState",
    "ActiveState",
    "SubState",
    "Result",
    "NRestarts",
    "ExecMainStatus",
    "MemoryMax",
)
_ENDS = {
    "watchdog": "the pipeline hung and the watchdog killed it",
    "oom-kill": "it took more memory than MemoryMax",
    "timeout": "it did not start or stop in time",
    "signal": "a signal killed it",
}


def unit_of(path: Path, installed: Path) -> str:
    """Return the unit of a configuration: lcf-edge@front for front.toml in the units' folder, else lcf-edge."""
    file = path.absolute()
    is_instance = file.parent == installed and file.suffix == ".toml" and file.name != DEFAULT_PATH.name
    return f"{UNIT}@{file.stem}" if is_instance else UNIT


def check(context: Context) -> Iterator[Finding]:
    """Check the unit as systemd sees it."""
    unit = unit_of(context.path, context.installed)
    try:
        properties = properties_of(context, unit)
    except FileNotFoundError:
        yield ok("service", "no systemd here: nothing starts lcf-edge at boot")
    except subprocess.TimeoutExpired:
        yield warn("service", f"systemd does not answer within {ANSWER_S:g} s", f"systemctl status {unit}")
    else:
        if not properties:
            yield ok("service", "systemd does not run here: nothing starts lcf-edge at boot")
        else:
            yield from judged(properties, context.config.memory.budget_mib, unit)


def properties_of(context: Context, unit: str) -> Mapping[str, str]:
    """Return a unit's properties; empty: no systemd runs. Raises ``FileNotFoundError`` and ``TimeoutExpired``."""
    done = subprocess.run(
        (*context.systemctl, "show", f"{unit}.service", f"--property={','.join(_PROPERTIES)}"),
        capture_output=True,
        text=True,
        timeout=ANSWER_S,
        check=False,
    )
    return dict(line.partition("=")[::2] for line in done.stdout.splitlines())


def judged(properties: Mapping[str, str], budget_mib: float, unit: str = UNIT) -> Iterator[Finding]:
    """Return findings about a unit's properties, as ``systemctl show`` lists them."""
    if properties.get("LoadState") == "not-found":
        yield ok("service", "not installed: nothing starts lcf-edge at boot (sudo make install, in the source)")
        return
    if properties.get("LoadState") != "loaded":
        yield fail("service", f"the unit is {properties.get('LoadState')}", f"systemd-analyze verify {unit}.service")
        return
    yield from _state(properties, unit)
    if not starts_at_boot(properties):
        yield warn("service", "does not start at boot", f"sudo systemctl enable {unit}")
    limit = properties.get("MemoryMax", "")
    if limit.isdigit() and int(limit) / 2**20 < budget_mib * 4 / 3:
        yield warn(
            "service",
            f"MemoryMax is {int(limit) / 2**20:.0f} MiB, memory.budget_mib = {budget_mib:g} and a third is more",
            f"sudo systemctl set-property {unit} MemoryMax={budget_mib * 4 / 3:.0f}M",
        )


def starts_at_boot(properties: Mapping[str, str]) -> bool:
    """Whether a unit with these properties is enabled."""
    return properties.get("UnitFileState") in ("enabled", "enabled-runtime")


def _state(properties: Mapping[str, str], unit: str) -> Iterator[Finding]:
    journal = f"journalctl -u {unit} -n 30 --no-pager"
    result, restarts = properties.get("Result", ""), properties.get("NRestarts", "0")
    if properties.get("ActiveState") == "failed":
        if properties.get("ExecMainStatus") == "2":
            file = f" -c {DEFAULT_PATH.parent}/{unit.partition('@')[2]}.toml" if "@" in unit else ""
            yield fail("service", "failed: its configuration cannot be used", f"lcf-edge config{file}")
        else:
            why = _ENDS.get(result, f"{result}, exit status {properties.get('ExecMainStatus')}")
            again = f"sudo systemctl reset-failed {unit} && sudo systemctl start {unit}"
            yield fail("service", f"failed: {why}", f"{journal}; {again}")
    elif properties.get("ActiveState") != "active":
        yield warn(
            "service", f"{properties.get('ActiveState')} ({properties.get('SubState')})", f"sudo systemctl start {unit}"
        )
    elif restarts != "0":
        yield warn("service", f"running, restarted automatically {restarts} times", journal)
    else:
        yield ok("service", f"{properties.get('SubState')}, never restarted")
