"""The machine's disk: Debian 12 from packages, the project installed as a user would, kept until either changes.

Needs root, for ``mmdebstrap`` and ``chroot``. The cache is the folder that ``LCF_EDGE_HIL_CACHE`` names, or
``~/.cache/lcf-edge/hil``: a folder for each set of packages; a changed project is only installed anew.
"""

import hashlib
import os
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from lcf_edge.errors import LcfError

PROJECT = Path(__file__).parents[2]
SUITE, PYTHON = "bookworm", "3.11"
PACKAGES = (
    "linux-image-amd64",
    "systemd",
    "systemd-sysv",
    "udev",
    "dbus",
    "libnss-systemd",
    "kmod",
    "iproute2",
    "gcc",
    "make",
    "python3",
    "python3-dev",
    "python3-venv",
    "v4l-utils",
)
LEFT_OUT = (
    "/usr/share/doc/*",
    "/usr/share/man/*",
    "/usr/share/locale/*",
    "/lib/modules/*/kernel/drivers/gpu/*",
    "/lib/modules/*/kernel/drivers/net/ethernet/*",
    "/lib/modules/*/kernel/drivers/net/wireless/*",
    "/lib/modules/*/kernel/sound/*",
)
BOOTS_WITH = ("virtio_pci", "virtio_blk", "ext4")
LOCK = "requirements.lock"
SOURCES = (
    "lcf_edge",
    "drivers",
    "hil_mocks",
    "systemd",
    "pyproject.toml",
    "setup.py",
    "README.md",
    "LICENSE",
    "Makefile",
    LOCK,
)
TOOLS = {  # what brings them on Debian and its relatives
    "mmdebstrap": "mmdebstrap",
    "qemu-system-x86_64": "qemu-system-x86",
    "mke2fs": "e2fsprogs",
    "openssl": "openssl",
}
SIZE_MIB = 2200
BUILDING_S = 900.0  # one step at most

_UNITS = "etc/systemd/system"
_MASKED = ("getty@tty1.service", "serial-getty@ttyS0.service", "apt-daily.timer", "apt-daily-upgrade.timer")
_NETWORK = "[Match]\nName=eth0\n\n[Network]\nAddress=10.0.2.15/24\nLinkLocalAddressing=no\nIPv6AcceptRA=no\n"

_JOURNAL = "[Journal]\nStorage=volatile\nRateLimitBurst=0\nForwardToConsole=yes\nMaxLevelConsole=notice\n"


class ImageError(LcfError):
    """The image cannot be made."""


@dataclass(frozen=True, slots=True)
class Image:
    """What a machine boots."""

    kernel: Path
    initrd: Path
    disk: Path


def missing() -> str:
    """What stands in the way of a machine here and how to get it, in one line; empty: nothing does."""
    tools = sorted(package for tool, package in TOOLS.items() if shutil.which(tool) is None)
    wants = [f"{', '.join(tools)} (apt-get install {' '.join(tools)})"] if tools else []
    wants += ["root (sudo make hil)"] if os.geteuid() != 0 else []
    wants += ["an x86-64 computer"] if os.uname().machine != "x86_64" else []
    return f"no virtual machine here, it needs {' and '.join(wants)}" if wants else ""


def cache() -> Path:
    """Where images are kept."""
    return Path(os.environ.get("LCF_EDGE_HIL_CACHE") or Path.home() / ".cache/lcf-edge/hil")


def image() -> Image:
    """The image of this working copy, made as far as it is not there. Raises ``ImageError``."""
    place = cache() / _digest([SUITE, *PACKAGES, *LEFT_OUT, *BOOTS_WITH])
    root, wheels, disk, known = (
        place / name
        for name in (
            "root",
            f"wheels-{_digest([PYTHON, *_builders(), *_contents([PROJECT / LOCK])])}",
            "disk.img",
            "project",
        )
    )
    _once(root, _install_debian)
    _once(wheels, _fetch)
    project = _digest(_contents(PROJECT / name for name in SOURCES))
    if not known.exists() or known.read_text(encoding="ascii") != project:
        known.unlink(missing_ok=True)
        _install_project(root, wheels)
        _prepare(root)
        _make_disk(root, disk)
        known.write_text(project, encoding="ascii")
    return Image(root / "vmlinuz", root / "initrd.img", disk)


def _once(folder: Path, make: Callable[[Path], object]) -> None:
    """Make a folder unless it is there, whole."""
    if not folder.exists():
        unfinished = folder.with_name("unfinished")
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.parent.mkdir(parents=True, exist_ok=True)
        make(unfinished)
        unfinished.rename(folder)


def _install_debian(root: Path) -> None:
    initramfs = (
        'mkdir -p "$1/etc/initramfs-tools/conf.d"; echo MODULES=list > "$1/etc/initramfs-tools/conf.d/hil"; '
        f'echo {" ".join(BOOTS_WITH)} | tr " " "\\n" > "$1/etc/initramfs-tools/modules"'
    )
    options = [f"--dpkgopt=path-exclude={path}" for path in LEFT_OUT]
    options += ["--variant=minbase", "--mode=root", "--format=directory", f"--setup-hook={initramfs}"]
    _do("mmdebstrap", *options, f"--include={','.join(PACKAGES)}", SUITE, str(root))


def _builders() -> list[str]:
    """What builds the project."""
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    needed: list[str] = project["build-system"]["requires"]
    return needed


def _fetch(wheels: Path) -> None:
    """The packages that `make install` takes, for the guest's Python, whatever this one is."""
    platforms = ["manylinux2014_x86_64", *(f"manylinux_2_{minor}_x86_64" for minor in range(17, 37))]
    options = [f"--platform={platform}" for platform in platforms]
    options += ["--only-binary=:all:", f"--python-version={PYTHON}", "--implementation=cp", "--dest", str(wheels)]
    download = (sys.executable, "-m", "pip", "download", "--quiet", *options)
    _do(*download, "--require-hashes", "-r", str(PROJECT / LOCK))
    _do(*download, *_builders())


def _install_project(root: Path, wheels: Path) -> None:
    """As docs/install.md says, without a network."""
    source = root / "usr/src/lcf-edge"
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir(parents=True)
    for name in SOURCES:
        copy = shutil.copytree if (PROJECT / name).is_dir() else shutil.copy
        copy(PROJECT / name, source / name)
    shutil.copytree(wheels, root / "wheels", dirs_exist_ok=True)
    environment = ("-i", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "HOME=/root", "PIP_NO_INDEX=1", "PIP_FIND_LINKS=/wheels")
    _do("unshare", "-n", "chroot", str(root), "env", *environment, "make", "-C", "/usr/src/lcf-edge", "install")
    shutil.rmtree(root / "wheels")


def _prepare(root: Path) -> None:
    """What makes the system a guest."""
    units = root / _UNITS
    shutil.copy(Path(__file__).parent / "guest/hil-agent.service", units)
    (root / "etc/systemd/network/eth0.network").write_text(_NETWORK, encoding="ascii")
    (root / "etc/systemd/journald.conf").write_text(_JOURNAL, encoding="ascii")
    wanted = units / "multi-user.target.wants"
    wanted.mkdir(exist_ok=True)
    for unit in (units / "hil-agent.service", Path("/lib/systemd/system/systemd-networkd.service")):
        link = wanted / unit.name
        link.unlink(missing_ok=True)
        link.symlink_to(f"../{unit.name}" if unit.parent == units else unit)
    for name in _MASKED:
        (units / name).unlink(missing_ok=True)
        (units / name).symlink_to("/dev/null")
    (root / "etc/fstab").write_text("/dev/vda / ext4 defaults 0 1\n", encoding="ascii")
    (root / "etc/hostname").write_text("rover\n", encoding="ascii")


def _make_disk(root: Path, disk: Path) -> None:
    disk.unlink(missing_ok=True)
    _do("truncate", "-s", f"{SIZE_MIB}M", str(disk))
    _do("mke2fs", "-q", "-F", "-t", "ext4", "-d", str(root), str(disk))


def _do(*command: str) -> None:
    """Run one step. Raises ``ImageError`` with the last lines of what it said."""
    try:
        done = subprocess.run(
            command, check=False, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=BUILDING_S
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ImageError(f"{command[0]}: {error}") from error
    if done.returncode:
        last = " | ".join((done.stderr or done.stdout).strip().splitlines()[-5:])
        raise ImageError(f"{command[0]}: exit status {done.returncode}: {last}")


def _contents(paths: Iterable[Path]) -> list[str]:
    """Names and contents of all files below."""
    files = sorted(file for path in paths for file in ([path] if path.is_file() else path.rglob("*")))
    return [
        f"{file.relative_to(PROJECT)} {hashlib.sha256(file.read_bytes()).hexdigest()}"
        for file in files
        if file.is_file() and "__pycache__" not in file.parts
    ]


def _digest(parts: Iterable[str]) -> str:
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
