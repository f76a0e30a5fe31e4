"""The board: heat, power, the processor's governor, room on the disk."""

import os
from collections.abc import Iterator

from lcf_edge.daemon.board import read_board
from lcf_edge.doctor.finding import Context, Finding, ok, warn

HOT_C = 80.0  # at which a Raspberry Pi begins to slow down
_OWN_GOVERNORS = ("intel_pstate", "amd-pstate-epp")  # with these, "powersave" is not slow
_MIB = 2**20


def check(context: Context) -> Iterator[Finding]:
    """Heat, power, governor, disk."""
    yield from _heat(context)
    yield from _governor(context)
    yield from _disk(context)


def _heat(context: Context) -> Iterator[Finding]:
    board = read_board(context.sys)
    model = _text(context, "firmware/devicetree/base/model") or _text(context, "class/dmi/id/product_name")
    heat = "no temperature reported" if board.temperature_c is None else f"{board.temperature_c:.0f} °C"
    name = model or "this board"
    if "under-voltage" in board.slowed:
        yield warn("board", f"{name}: under-voltage", "vcgencmd get_throttled  # 0x0 with a supply of 5 V and 3 A")
    elif board.slowed:
        yield warn("board", f"{name}: {heat}, slowed down ({', '.join(board.slowed)}); cool it")
    elif board.temperature_c is not None and board.temperature_c >= HOT_C:
        yield warn("board", f"{name}: {heat}, about to slow down; cool it")
    else:
        yield ok("board", f"{name}: {heat}, not throttled")


def _governor(context: Context) -> Iterator[Finding]:
    folder = context.sys / "devices/system/cpu/cpu0/cpufreq"
    governor = _text(context, "devices/system/cpu/cpu0/cpufreq/scaling_governor")
    driver = _text(context, "devices/system/cpu/cpu0/cpufreq/scaling_driver")
    if governor == "powersave" and driver not in _OWN_GOVERNORS:
        everywhere = str(folder / "scaling_governor").replace("cpu0", "cpu*")
        yield warn(
            "board", "the processor is held at a low clock (powersave)", f"echo ondemand | sudo tee {everywhere}"
        )
    elif governor:
        yield ok("board", f"processor governor: {governor}")


def _disk(context: Context) -> Iterator[Finding]:
    record = context.config.record
    try:
        room = os.statvfs(record.folder)
    except OSError:  # the recorder creates it, or only root may look
        return
    free_mib = room.f_bavail * room.f_frsize / _MIB
    summary = f"{free_mib / 1024:.1f} GiB are free in {record.folder}"
    if free_mib < record.free_mib:
        text = f"{summary}: nothing is recorded, record.free_mib = {record.free_mib:g} are left free"
        yield warn("board", text, f"sudo du -h {record.folder}/")
    else:
        yield ok("board", summary)


def _text(context: Context, name: str) -> str:
    try:
        return (context.sys / name).read_text(encoding="utf-8", errors="replace").strip("\0\n ")
    except OSError:
        return ""
