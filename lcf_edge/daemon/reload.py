"""Which keys can change while the daemon runs, and which need a restart."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from lcf_edge.config import Config

PIPELINE_KEYS: Mapping[str, frozenset[str]] = {
    "camera": frozenset(
        {"intrinsics", "horizontal_fov_rad", "distortion_model", "distortion", "height_m", "pitch_rad", "yaw_rad"}
    ),
    "imu": frozenset({"axes", "time_offset_s", "gyro_noise_radps"}),
    "vehicle": frozenset({"half_width_m", "height_m", "horizon_s", "speed_mps"}),
    "filter": frozenset(field.name for field in msgspec.structs.fields(Config().filter)),
    "memory": frozenset(field.name for field in msgspec.structs.fields(Config().memory)) - {"budget_mib"},
}
"""A change of these makes a new pipeline, whose tables are empty."""

OTHER_KEYS: Mapping[str, frozenset[str]] = {
    "camera": frozenset({"ahead_m", "left_m"}),
    "memory": frozenset({"budget_mib"}),
    "log": frozenset({"level"}),
}
"""A change of these takes effect at once."""


def changed(old: Config, new: Config) -> set[str]:
    """Return the dotted keys that differ."""
    before, after = msgspec.to_builtins(old), msgspec.to_builtins(new)
    return {f"{table}.{key}" for table, keys in after.items() for key in keys if keys[key] != before[table][key]}


def wants_pipeline(keys: set[str]) -> set[str]:
    """Return those of ``keys`` that make a new pipeline."""
    return {key for key in keys if _in(PIPELINE_KEYS, key)}


def wants_restart(keys: set[str]) -> set[str]:
    """Return those of ``keys`` that need a restart."""
    return {key for key in keys if not _in(PIPELINE_KEYS, key) and not _in(OTHER_KEYS, key)}


def _in(tables: Mapping[str, frozenset[str]], key: str) -> bool:
    table, _, name = key.partition(".")
    return name in tables.get(table, ())


def merged(old: Config, new: Config) -> Config:
    """Return ``new`` with the values of ``old`` for keys that need a restart."""
    tables: dict[str, Any] = {}
    for key in wants_restart(changed(old, new)):
        table, _, name = key.partition(".")
        kept = tables.get(table, getattr(new, table))
        tables[table] = msgspec.structs.replace(kept, **{name: getattr(getattr(old, table), name)})
    return msgspec.structs.replace(new, **tables)


Signature = tuple[int, int, int] | None


def signature(path: Path) -> Signature:
    """Return something that changes when the file is written or replaced; None: there is no file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino
