"""Groups that own the devices, and whether this user is a member."""

import getpass
import grp
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from drivers.imu.registry import DRIVERS, Interface
from lcf_edge.config import Config
from lcf_edge.doctor.finding import Context, Finding, ok, warn

_GROUPS: Mapping[Interface, str] = {"i2c": "i2c", "serial": "dialout", "iio": "iio"}


def group_of(driver: str) -> str:
    """Return the group that may use the device of ``imu.driver``; "" for none."""
    return _GROUPS[DRIVERS[driver].interface] if driver in DRIVERS else ""


def check(context: Context) -> Iterator[Finding]:
    """Check each group that the configured devices need."""
    for group, pattern in needed(context.config):
        yield _group(group, sorted(context.dev.glob(pattern)))


def join(group: str) -> str:
    """Return the command that adds this user to a group."""
    return f"sudo usermod -aG {group} $USER  # then log in again"


def owner(path: Path) -> str:
    """Return group and mode of a device, as "group video, crw-rw----"; "" when it does not exist."""
    try:
        status = path.stat()
    except OSError:
        return ""
    return f"{_name(status.st_gid)}, mode {status.st_mode & 0o777:o}"


def needed(config: Config) -> list[tuple[str, str]]:
    """Return groups, and the nodes in /dev that should belong to them."""
    nodes = {"video": "video*", "i2c": f"i2c-{config.imu.bus}", "dialout": _inside(config.imu.port), "iio": "iio:*"}
    video = "" if config.camera.driver == "recording" else "video"
    return [(group, nodes[group]) for group in (video, group_of(config.imu.driver)) if group]


def _inside(path: str) -> str:
    """Return a path in /dev as a glob pattern relative to it."""
    return path.removeprefix("/dev/").lstrip("/") or "-"


def _group(group: str, nodes: list[Path]) -> Finding:
    try:
        found = grp.getgrnam(group)
    except KeyError:
        return warn("permissions", f"there is no group {group}", f"sudo groupadd --system {group}  # {_MAKE}")
    others = [node for node in nodes if not _belongs(node, found.gr_gid)]
    user = getpass.getuser()
    if others:
        text = f"{others[0]} belongs to the {owner(others[0])}, and should be for the group {group}"
        return warn("permissions", text, f"sudo chgrp {group} {others[0]} && sudo chmod g+rw {others[0]}  # {_MAKE}")
    if os.geteuid() == 0:
        return ok("permissions", f"root may open everything; others need the group {group}")
    if found.gr_gid in (os.getegid(), *os.getgroups()):
        return ok("permissions", f"{user} is in the group {group}")
    if user in found.gr_mem:
        return warn(
            "permissions", f"{user} is in the group {group}, but only from the next login on", f"newgrp {group}"
        )
    return warn("permissions", f"{user} is not in the group {group}", join(group))


_MAKE = "sudo make install, in the source, brings rules that last"


def _belongs(node: Path, gid: int) -> bool:
    """Whether the group may read and write it."""
    status = node.stat()
    return status.st_gid == gid and status.st_mode & 0o060 == 0o060


def _name(gid: int) -> str:
    try:
        return f"group {grp.getgrgid(gid).gr_name}"
    except KeyError:
        return f"group {gid}"
