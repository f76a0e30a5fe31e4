"""``python -m release.bundle``: an archive for each processor that installs the daemon where there is no network.

In it: the project's wheel, which ``release.wheels`` made, the wheels of ``requirements.lock`` for each Python of
``PYTHONS`` and pip itself, all with their hashes; what ``make install`` puts into a system beside the program;
the documentation; and ``setup``, which installs, goes back and removes (``release/setup.sh``). Any processor's is made
on any, and tried before it is left there.
"""

import hashlib
import os
import re
import shutil
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from pathlib import Path

from lcf_edge.errors import LcfError
from release.bundle_trial import try_out
from release.debian import Machine, ReleaseError, chosen, run
from release.foreign_pip import OF_DEBIAN_12, locked_for, options_for

PROJECT = Path(__file__).parents[1]
PYTHONS = ("3.11", "3.12", "3.13")  # of Debian 12, Ubuntu 24.04 and Debian 13
LOCK = "requirements.lock"
PIP_LOCK = "release/pip.lock"


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the archives; return the exit status."""
    try:
        for machine in chosen("bundle", __doc__, "archive", arguments):
            wheel = built(machine, PROJECT / "dist")
            lock = (PROJECT / LOCK).read_text(encoding="utf-8")
            with tempfile.TemporaryDirectory() as place:
                fetch(machine, Path(place))
                archive = pack(machine.name, wheel, Path(place), lock, PROJECT / "dist")
            sys.stdout.write(f"{archive.relative_to(PROJECT)}: {archive.stat().st_size / 1e6:.0f} MB\n")
            sys.stdout.write(f"    {try_out(machine, archive)}\n")
    except LcfError as error:
        sys.stderr.write(f"bundle: {error}\n")
        return error.exit_status
    return 0


def built(machine: Machine, folder: Path) -> Path:
    """The project's wheel for a machine. Raises ``ReleaseError`` unless there is one and no other."""
    wheels = sorted(folder.glob(f"lcf_edge-*_{machine.name}.whl"))
    if len(wheels) != 1:
        found = ", ".join(wheel.name for wheel in wheels) or "none"
        raise ReleaseError(f"{folder}: one wheel for {machine.name} is needed, there is {found}; sudo make wheels")
    return wheels[0]


def fetch(machine: Machine, folder: Path) -> None:
    """The wheels of the lock for that machine and every Python, and pip's. Raises ``ReleaseError``."""
    options = ["--no-deps", "--require-hashes", "--dest", str(folder)]
    lock = "\n".join((PROJECT / name).read_text(encoding="utf-8") for name in (LOCK, PIP_LOCK))
    with tempfile.TemporaryDirectory() as place:
        for python in PYTHONS:
            wanted = Path(place, python)
            wanted.write_text(locked_for(lock, python), encoding="utf-8")
            download = (sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check")
            run(*download, *options, *options_for(machine.name, python, OF_DEBIAN_12), "-r", str(wanted))


def pack(machine: str, wheel: Path, wheels: Path, lock: str, folder: Path) -> Path:
    """The archive, of the project's wheel and a folder with all others. Raises ``ReleaseError``.

    ``lock``: of the others but pip; the project's own hash is added, so that every package is held to one.
    """
    number = wheel.name.split("-")[1]
    own = f"lcf-edge=={number} --hash=sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}\n"
    name = f"lcf-edge-{number}-{machine}"
    with tempfile.TemporaryDirectory() as place:
        content = Path(place, name)
        shutil.copytree(wheels, content / "wheels")
        shutil.copy(wheel, content / "wheels")
        documents(content / "doc")
        shutil.copy(PROJECT / "LICENSE", content / "doc")
        shutil.copy(PROJECT / "release/setup.sh", content / "setup")
        system_files(content / "system")
        shutil.rmtree(content / "system/var")  # folders that setup makes
        (content / LOCK).write_text(f"{lock}\n{own}", encoding="utf-8")
        (content / "machine").write_text(f"{machine}\n", encoding="ascii")
        (content / "pythons").write_text("".join(f"{python}\n" for python in PYTHONS), encoding="ascii")
        (content / "version").write_text(f"{number}-{_digest(content)}\n", encoding="ascii")
        archive = folder / f"{name}.tar"  # of wheels, which are compressed
        folder.mkdir(exist_ok=True)
        with tarfile.open(archive, "w") as tar:
            tar.add(content, name, filter=_plain)
    return archive


def documents(folder: Path) -> None:
    """What there is to read and to copy, into ``folder``."""
    shutil.copytree(PROJECT / "docs", folder / "docs", ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    shutil.copytree(PROJECT / "examples", folder / "examples", ignore=shutil.ignore_patterns("__*__*"))
    for name in ("README.md", "CHANGELOG.md", "SECURITY.md"):
        shutil.copy(PROJECT / name, folder)


def system_files(root: Path) -> None:
    """What ``make install`` puts into a system beside the program, into ``root``. Raises ``ReleaseError``."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("MAKE")}
    run("make", "install", "FILES_ONLY=1", f"DESTDIR={root}", folder=PROJECT, environment=environment)


def _digest(content: Path) -> str:
    """Two archives of one number are two versions unless all is the same."""
    digest = hashlib.sha256()
    for path in sorted(path for path in content.rglob("*") if path.is_file()):
        digest.update(f"{path.relative_to(content)}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()[:8]


def _plain(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    """As root's, and as if made at no time: the same content is the same archive."""
    entry.uid = entry.gid = 0
    entry.uname = entry.gname = "root"
    entry.mtime = 0
    is_program = entry.isdir() or re.fullmatch(r"[^/]+/setup", entry.name)
    entry.mode = 0o755 if is_program else 0o644
    return entry


if __name__ == "__main__":
    sys.exit(main())
