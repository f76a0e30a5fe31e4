"""A package where it will be installed: by ``apt`` in Debian 12 and 13 as their mirrors have them, without a network.

It is installed, filters, is installed once more over a changed configuration and a recording, which stay, also when it
is removed; purged it must leave nothing.
"""

import shutil
import tempfile
from pathlib import Path

from release.bundle_trial import FILTERS, SUITES, files_of, in_root
from release.debian import Machine, ReleaseError, installed, run

PACKAGES = ("python3", "libstdc++6", "systemd", "udev")
KEPT = {"etc/lcf-edge/config.toml": "[camera]\nfps = 30.0\n", "var/lib/private/lcf-edge/drive.mcap": "drive"}
_OF_APT = ("var/lib/dpkg/", "var/lib/apt/", "var/cache/", "var/log/", "var/lib/systemd/deb-systemd-helper-")
_GROUPS = ("etc/group", "etc/gshadow")  # which stay


def try_out(machine: Machine, package: Path) -> str:
    """What was tried, in one line. Raises ``ReleaseError`` where the package does not do what it should."""
    outcomes = []
    for suite in SUITES:
        with tempfile.TemporaryDirectory() as place:
            root = Path(place, "root")
            run("cp", "-a", str(installed(machine, suite, PACKAGES)), str(root))
            shutil.copy(package, root / package.name)
            (root / "dev/null").touch()  # nothing here is a device
            outcomes.append(f"Debian {suite}: {_tried_in(root, package.name)}")
    return "; ".join(outcomes)


def _tried_in(root: Path, name: str) -> str:
    before = _left_in(root)
    (root / "opt/lcf-edge").mkdir()
    try:
        in_root(root, "dpkg", "--install", f"/{name}")
    except ReleaseError as error:
        if "first run sudo make uninstall" not in str(error):
            raise
    else:
        raise ReleaseError(f"{name}: it is installed beside what make install has put there")
    (root / "opt/lcf-edge").rmdir()
    apt(root, "install", f"/{name}")
    in_root(root, "/usr/lib/lcf-edge/bin/python", "-P", "-c", FILTERS)
    in_root(root, "lcf-edge", "--version")
    python = in_root(root, "/usr/lib/lcf-edge/bin/python", "-V").strip()
    size_mb = sum(path.lstat().st_size for path in (root / "usr/lib/lcf-edge").rglob("*") if path.is_file()) / 1e6
    for path, text in KEPT.items():
        (root / path).write_text(text, encoding="ascii")
    apt(root, "install", "--reinstall", f"/{name}")
    apt(root, "remove", "lcf-edge")
    for path, text in KEPT.items():
        if (root / path).read_text(encoding="ascii") != text:
            raise ReleaseError(f"{name}: /{path} is not kept")
    if left := sorted(_left_in(root) - before - set(KEPT) - {"var/lib/lcf-edge"}):
        raise ReleaseError(f"{name}: {len(left)} files stay when it is removed, as {left[0]}")
    apt(root, "purge", "lcf-edge")
    if left := sorted(_left_in(root) - before):
        raise ReleaseError(f"{name}: {len(left)} files stay when it is purged, as {left[0]}")
    return f"{python}, compiled, {size_mb:.0f} MB installed, nothing left when purged"


def apt(root: Path, *arguments: str) -> None:
    """In that system as root, asked nothing. Raises ``ReleaseError``."""
    in_root(root, "apt-get", "--yes", "--quiet", *arguments, DEBIAN_FRONTEND="noninteractive")


def _left_in(root: Path) -> set[str]:
    """Without what is apt's own."""
    found = files_of(root)
    return {name for name in found if not name.startswith(_OF_APT) and name.rstrip("-") not in _GROUPS}
