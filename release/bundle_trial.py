"""An archive where it will be installed: Debian 12 and 13 with Python and the usual commands, and no network.

It is installed, filters by its own Python, installed once more, removed, and must leave no more than it should.
"""

import tarfile
import tempfile
from pathlib import Path

from release.debian import Machine, ReleaseError, run, unpacked

SUITES = ("bookworm", "trixie")
PACKAGES = ("python3", "libstdc++6", "libc-bin", "tzdata", "dash", "coreutils", "findutils", "grep", "sed")
FILTERS = "from lcf_edge.compilation import extension; import cv2, numpy, zenoh, sys; sys.exit(extension().reason or 0)"


def try_out(machine: Machine, archive: Path) -> str:
    """What was tried, in one line. Raises ``ReleaseError`` where the archive does not do what it should."""
    outcomes = []
    for suite in SUITES:
        with tempfile.TemporaryDirectory() as place:
            root = Path(place, "root")
            run("cp", "-a", str(unpacked(machine, suite, PACKAGES)), str(root))
            with tarfile.open(archive) as packed:
                packed.extractall(root / "archive", filter="data")
            (root / "dev/null").touch()  # nothing here is a device
            outcomes.append(f"Debian {suite}: {_tried_in(root, archive.stem)}")
    return "; ".join(outcomes)


def _tried_in(root: Path, name: str) -> str:
    before = _files(root)
    in_root(root, f"/archive/{name}/setup")
    in_root(root, "/opt/lcf-edge/bin/python", "-P", "-c", FILTERS)
    python = in_root(root, "/opt/lcf-edge/bin/python", "-V").strip()
    size_mb = sum(path.lstat().st_size for path in (root / "opt").rglob("*") if path.is_file()) / 1e6
    in_root(root, f"/archive/{name}/setup")
    in_root(root, "/opt/lcf-edge/setup", "remove", "--purge")
    if left := sorted(_files(root) - before):
        raise ReleaseError(f"{name}: {len(left)} files stay when it is removed, as {left[0]}")
    return f"{python}, compiled, {size_mb:.0f} MB installed, nothing left when removed"


def in_root(root: Path, *command: str, **settings: str) -> str:
    """Run in that system as root, without a network. Raises ``ReleaseError``."""
    environment = {"HOME": "/", "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "PYTHONDONTWRITEBYTECODE": "1", **settings}
    return run("unshare", "--net", "chroot", str(root), *command, environment=environment)


def files_of(root: Path) -> set[str]:
    """All files and links below."""
    return {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file() or path.is_symlink()}


def _files(root: Path) -> set[str]:
    """Without those of Python and of the archive itself."""
    return {name for name in files_of(root) if "__pycache__" not in name and not name.startswith("archive/")}
