"""Prometheus' text format (version 0.0.4) of the diagnostics."""

import re
from collections.abc import Sequence

from lcf_edge.diagnostics import DeviceStatus

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"


def prometheus_text(statuses: Sequence[DeviceStatus], robot: str) -> bytes:
    """Return the level of each part, and each of its values that is a number.

    ``rate_hz`` of the camera becomes ``lcf_edge_camera_rate_hz``; a fill such as ``2/32`` becomes two, which end in
    ``_used`` and ``_capacity``. What is no number is left out.
    """
    label = f'robot="{_escaped(robot)}"'
    lines = [
        "# HELP lcf_edge_level How a part is: 0 ok, 1 warning, 2 error, 3 nothing new for too long.",
        "# TYPE lcf_edge_level gauge",
        *(f'lcf_edge_level{{{label},part="{_escaped(one.name)}"}} {int(one.level)}' for one in statuses),
    ]
    typed = set()
    for status in statuses:
        for key, value in status.values.items():
            for name, number in _numbers(f"lcf_edge_{status.name}_{key}", value):
                if name not in typed:  # names that differ only in punctuation become one
                    typed.add(name)
                    lines += [f"# TYPE {name} untyped", f"{name}{{{label}}} {number}"]
    return ("\n".join(lines) + "\n").encode(errors="replace")


def _numbers(name: str, value: str) -> list[tuple[str, str]]:
    name = re.sub(r"[^a-z0-9_]+", "_", name.lower())
    parts = value.split("/")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        return []
    names = {1: [name], 2: [f"{name}_used", f"{name}_capacity"]}.get(len(parts), [])
    written = (repr(number).replace("inf", "Inf").replace("nan", "NaN") for number in numbers)
    return list(zip(names, written, strict=False))


def _escaped(text: str) -> str:
    return text.replace("\\", r"\\").replace('"', r"\"").replace("\n", r"\n")
