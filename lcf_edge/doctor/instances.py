"""Other units of this computer, one for each camera: what they must not share."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

from drivers.imu.registry import DRIVERS
from lcf_edge.config import Config, load
from lcf_edge.config.endpoint import bare
from lcf_edge.doctor.finding import Context, Finding, edit, fail, ok
from lcf_edge.doctor.service import properties_of, starts_at_boot, unit_of
from lcf_edge.errors import ConfigError

_RUNS = ("active", "activating", "reloading")


def check(context: Context) -> Iterator[Finding]:
    """Compare this configuration with those of the units that run or start at boot; empty: there are no others."""
    path_here, unit = context.path.absolute(), unit_of(context.path, context.installed)
    if path_here.parent != context.installed:
        return
    for path in sorted(context.installed.glob("*.toml")):
        other = unit_of(path, context.installed)
        if path == path_here or not _is_used(context, other):
            continue
        try:
            same = collisions(context.config, load(path))
        except ConfigError:
            continue  # doctor -c with that file reports it
        if same:
            yield fail("instances", f"{unit} and {other} both have {', '.join(same)}", edit(context.path))
        else:
            yield ok("instances", f"{unit} and {other} do not conflict")


def collisions(one: Config, other: Config) -> list[str]:
    """Return what two daemons on a computer must not share but do, as keys with their values."""
    mine, theirs = _own(one), _own(other)
    return [f"{key} = {value}" for key, value in mine if (key, value) in theirs]


def _own(config: Config) -> list[tuple[str, str]]:
    """Return keys and values that no other daemon on the computer may have."""
    own = [("zenoh.listen", bare(endpoint)) for endpoint in config.zenoh.listen]
    own += [("publish.prefix", config.publish.prefix), ("publish.frame_id", config.publish.frame_id)]
    own.append(("publish.robot", config.publish.robot))
    if config.record.when != "never":
        own.append(("record.folder", str(Path(config.record.folder))))
    if config.metrics.port:
        own.append(("metrics.port", str(config.metrics.port)))
    if config.metrics.textfile:
        own.append(("metrics.textfile", config.metrics.textfile))
    if config.camera.driver != "recording":
        own.append(("camera.device", config.camera.device))
    return own + _imu(config)


def _imu(config: Config) -> list[tuple[str, str]]:
    imu = config.imu
    driver = DRIVERS.get(imu.driver)
    if driver is None:
        return []
    if driver.interface == "serial":
        return [("imu.port", imu.port)]
    if driver.interface == "iio":
        return [("imu.device", imu.device or "the first")]
    return [("imu.bus and address", f"{imu.bus}, {f'{imu.address:#x}' if imu.address else imu.driver}")]


def _is_used(context: Context, unit: str) -> bool:
    try:
        properties = properties_of(context, unit)
    except (FileNotFoundError, subprocess.TimeoutExpired):
        return False
    return starts_at_boot(properties) or properties.get("ActiveState") in _RUNS
