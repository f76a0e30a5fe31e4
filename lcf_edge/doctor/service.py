"""The unit of systemd: installed, enabled, running, and how it last ended."""

import subprocess
from collections.abc import Iterator, Mapping

from lcf_edge.doctor.finding import Context, Finding, fail, ok, warn

UNIT = "lcf-edge.service"
ANSWER_S = 5.0
_ASKED = ("LoadState", "UnitFileState", "ActiveState", "SubState", "Result", "NRestarts", "ExecMainStatus", "MemoryMax")
_JOURNAL = "journalctl -u lcf-edge -n 30 --no-pager"
_ENDS = {
    "watchdog": "the pipeline hung and the watchdog killed it",
    "oom-kill": "it took more memory than MemoryMax",
    "start-limit-hit": "it failed ten times in two minutes",
    "timeout": "it did not start or stop in time",
    "signal": "a signal killed it",
}


def check(context: Context) -> Iterator[Finding]:
    """How systemd sees it."""
    try:
        done = subprocess.run(
            (*context.systemctl, "show", UNIT, f"--property={','.join(_ASKED)}"),
            capture_output=True,
            text=True,
            timeout=ANSWER_S,
            check=False,
        )
    except FileNotFoundError:
        yield ok("service", "no systemd here: nothing starts lcf-edge at boot")
        return
    except subprocess.TimeoutExpired:
        yield warn("service", f"systemd does not answer within {ANSWER_S:g} s", "systemctl status lcf-edge")
        return
    told = dict(line.partition("=")[::2] for line in done.stdout.splitlines())
    if not told:
        yield ok("service", "systemd does not run here: nothing starts lcf-edge at boot")
    else:
        yield from judged(told, context.config.memory.budget_mib)


def judged(told: Mapping[str, str], budget_mib: float) -> Iterator[Finding]:
    """What is said of the unit's properties, as ``systemctl show`` tells them."""
    if told.get("LoadState") == "not-found":
        yield ok("service", "not installed: nothing starts lcf-edge at boot (sudo make install, in the source)")
        return
    if told.get("LoadState") != "loaded":
        yield fail("service", f"the unit is {told.get('LoadState')}", f"systemd-analyze verify {UNIT}")
        return
    yield from _state(told)
    if told.get("UnitFileState") not in ("enabled", "enabled-runtime"):
        yield warn("service", "does not start at boot", "sudo systemctl enable lcf-edge")
    limit = told.get("MemoryMax", "")
    if limit.isdigit() and int(limit) / 2**20 < budget_mib * 4 / 3:
        yield warn(
            "service",
            f"MemoryMax is {int(limit) / 2**20:.0f} MiB, memory.budget_mib = {budget_mib:g} and a third is more",
            f"sudo systemctl set-property lcf-edge MemoryMax={budget_mib * 4 / 3:.0f}M",
        )


def _state(told: Mapping[str, str]) -> Iterator[Finding]:
    result, restarts = told.get("Result", ""), told.get("NRestarts", "0")
    if told.get("ActiveState") == "failed":
        if told.get("ExecMainStatus") == "2":
            yield fail("service", "failed: its configuration cannot work", "lcf-edge config")
        else:
            why = _ENDS.get(result, f"{result}, exit status {told.get('ExecMainStatus')}")
            again = "sudo systemctl reset-failed lcf-edge && sudo systemctl start lcf-edge"
            yield fail("service", f"failed: {why}", f"{_JOURNAL}; {again}")
    elif told.get("ActiveState") != "active":
        yield warn("service", f"{told.get('ActiveState')} ({told.get('SubState')})", "sudo systemctl start lcf-edge")
    elif restarts != "0":
        yield warn("service", f"runs, after it was started anew {restarts} times by itself", _JOURNAL)
    else:
        yield ok("service", f"{told.get('SubState')}, never started anew")
