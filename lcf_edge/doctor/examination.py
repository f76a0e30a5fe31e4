"""All checks in a sensible order, each within a time limit."""

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from queue import Empty, SimpleQueue

from drivers.errors import DriverError
from lcf_edge.doctor import (
    board,
    calibration,
    camera,
    clock,
    configuration,
    health,
    imu,
    instances,
    memory,
    network,
    permissions,
    service,
    software,
)
from lcf_edge.doctor.finding import Check, Context, Finding, fail, short
from lcf_edge.errors import LcfError

LIMIT_S = 30.0


@dataclass(frozen=True, slots=True)
class Step:
    """A check; ``needs_config``: it is skipped while the configuration is unusable."""

    subject: str
    check: Check
    needs_config: bool = True


STEPS = (
    Step("configuration", configuration.check, needs_config=False),
    Step("software", software.check, needs_config=False),
    Step("board", board.check, needs_config=False),
    Step("clock", clock.check, needs_config=False),
    Step("memory", memory.check),
    Step("service", service.check, needs_config=False),
    Step("instances", instances.check),
    Step("network", network.check),
    Step("daemon", health.check),
    Step("permissions", permissions.check),
    Step("camera", camera.check),
    Step("imu", imu.check),
    Step("calibration", calibration.check),
)


def examine(context: Context, steps: Sequence[Step] = STEPS, limit_s: float = LIMIT_S) -> Iterator[Finding]:
    """Yield the findings of all checks as they come.

    A check that is silent for ``limit_s`` is abandoned in its thread, and reported.
    """
    for step in steps:
        if context.error is None or not step.needs_config:
            yield from _within(limit_s, step, context)


def _within(limit_s: float, step: Step, context: Context) -> Iterator[Finding]:
    found: SimpleQueue[Finding | None] = SimpleQueue()
    threading.Thread(target=_run, args=(step, context, found.put), name=step.subject, daemon=True).start()
    try:
        while (finding := found.get(timeout=limit_s)) is not None:
            yield finding
    except Empty:
        text = (
            f"does not return within {limit_s:g} s: a device hangs in its driver; unplug it, or switch power off and on"
        )
        yield fail(step.subject, text, "sudo dmesg | tail -n 20")


def _run(step: Step, context: Context, put: Callable[[Finding | None], None]) -> None:
    try:
        for finding in step.check(context):
            put(finding)
    except OSError as error:  # a file failed that the check did not expect to fail
        put(fail(step.subject, f"{error.filename or 'a device'}: {error.strerror}"))
    except (LcfError, DriverError, ValueError) as error:  # ValueError: the kernel's text has an unknown form
        put(fail(step.subject, short(error)))
    finally:
        put(None)
