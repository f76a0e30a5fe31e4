"""Memory: what the program needs, what it may take, and what is free."""

import re
from collections.abc import Iterator

from lcf_edge.daemon.memory import check_budget, needs_mib
from lcf_edge.doctor.finding import Context, Finding, fail, ok, short, warn
from lcf_edge.errors import ConfigError


def check(context: Context) -> Iterator[Finding]:
    """Compare need with budget, and budget with what is free."""
    budget_mib = context.config.memory.budget_mib
    try:
        check_budget(context.config)
        needed_mib = sum(needs_mib(context.config).values())
    except ConfigError as error:
        raised = re.search(r"to (\d+)$", str(error))
        remedy = context.again(f"memory.budget_mib={raised[1]}") if raised else ""
        yield fail("memory", short(error), remedy)
        return
    yield ok("memory", f"needs about {needed_mib:.0f} MiB of memory.budget_mib = {budget_mib:g}")
    yield from _free(context, budget_mib)


def _free(context: Context, budget_mib: float) -> Iterator[Finding]:
    meminfo = (context.proc / "meminfo").read_text(encoding="ascii")
    sizes_mib = {name: int(kib) / 1024 for name, kib in re.findall(r"^(\w+):\s+(\d+) kB$", meminfo, re.MULTILINE)}
    available_mib = sizes_mib.get("MemAvailable", 0.0)
    text = f"{available_mib:.0f} MiB of {sizes_mib.get('MemTotal', 0.0):.0f} are available"
    swapped_mib = sizes_mib.get("SwapTotal", 0.0) - sizes_mib.get("SwapFree", 0.0)
    if context.daemon is None and available_mib < budget_mib:
        yield fail("memory", f"{text}, the budget is {budget_mib:g}", "ps --sort=-rss -eo rss,comm | head")
    elif swapped_mib > 0.1 * sizes_mib.get("MemTotal", 0.0):
        yield warn(
            "memory",
            f"{text}, but {swapped_mib:.0f} MiB are in swap: something takes too much",
            "ps --sort=-rss -eo rss,comm | head",
        )
    else:
        yield ok("memory", text)
