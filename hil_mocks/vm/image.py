"""The machine's disk: Debian from packages, the project installed as a user would, kept until either changes.

Needs root, for ``mmdebstrap`` and ``chroot``. For another processor than this computer's, Debian's programs are
emulated while the disk is made, and the project comes as the wheel that ``make wheels`` would make. The cache is the
folder that ``LCF_EDGE_HIL_CACHE`` names, or ``~/.cache/lcf-edge/hil``: a folder for each set of packages; a changed
project is only installed anew.
"""

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from lcf_edge.errors import LcfError
from release import wheels as cross
from release.debian import EMULATION, MACHINES, ReleaseError, let_run
from release.elsewhere import installed as python_here
from release.foreign_pip import OF_DEBIAN_12, command_for, locked_for, options_for

PROJECT = Path(__file__).parents[2]
PACKAGES = (
    "linux-image-{debian}",
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
    "share",
    "systemd",
    "pyproject.toml",
    "setup.py",
    "README.md",
    "LICENSE",
    "Makefile",
    LOCK,
)
HERE = "x86_64"
TOOLS = {"mmdebstrap": "mmdebstrap", "mke2fs": "e2fsprogs", "openssl": "openssl", "dh_builddeb": "debhelper"}
"""What brings them on Debian and its relatives."""

MORE_TOOLS = {
    "x86_64": {"qemu-system-x86_64": "qemu-system-x86"},
    "aarch64": {"qemu-system-aarch64": "qemu-system-arm", "arch-test": "arch-test", **EMULATION},
}
SIZE_MIB = 2200

_BUILD_VIMC = r"""chroot "$1" sh -ec '
cd /usr/src
tar -xf linux-source-*.tar.xz --wildcards "*/drivers/media/test-drivers/vimc/*"
vimc=$(echo $PWD/linux-source-*/drivers/media/test-drivers/vimc)
kernel=$(ls /lib/modules)
make -C /lib/modules/$kernel/build M=$vimc CONFIG_VIDEO_VIMC=m modules
install -D -m 644 $vimc/vimc.ko -t /lib/modules/$kernel/updates
depmod $kernel
rm -rf linux-source-* linux-headers-*'"""
"""A camera of the kernel's media controller: in the kernel's sources, and not in Debian's kernel."""

_BUILD_I2C_STUB = r"""chroot "$1" sh -ec '
cd /usr/src
tar -xf linux-source-*.tar.xz --wildcards "*/drivers/i2c/i2c-stub.c"
stub=$(echo $PWD/linux-source-*/drivers/i2c)
kernel=$(ls /lib/modules)
echo "obj-m := i2c-stub.o" > $stub/Makefile
make -C /lib/modules/$kernel/build M=$stub modules
install -D -m 644 $stub/i2c-stub.ko -t /lib/modules/$kernel/updates'"""
"""An I2C bus, which Debian's kernel has on x86-64 alone."""

BUILDING_S = 7200.0  # one step at most; emulated ones are slow

_UNITS = "etc/systemd/system"
_MASKED = (
    "getty@tty1.service",
    "serial-getty@ttyS0.service",
    "serial-getty@ttyAMA0.service",
    "apt-daily.timer",
    "apt-daily-upgrade.timer",
)
_NETWORK = "[Match]\nName=eth0\n\n[Network]\nAddress=10.0.2.15/24\nLinkLocalAddressing=no\nIPv6AcceptRA=no\n"

_JOURNAL = "[Journal]\nStorage=volatile\nRateLimitBurst=0\nForwardToConsole=yes\nMaxLevelConsole=notice\n"


@dataclass(frozen=True, slots=True)
class System:
    """A release of Debian, its Python, packages beside ``PACKAGES``, what is done to it after them, the processor."""

    suite: str
    python: str
    packages: tuple[str, ...] = ()
    hooks: tuple[str, ...] = ()
    processor: str = HERE


DEBIAN_12 = System("bookworm", "3.11")
DEBIAN_13_WITH_LIBCAMERA = System(
    "trixie",
    "3.13",
    ("libcamera-ipa", "linux-headers-{debian}", "linux-source", "python3-libcamera", "xz-utils"),
    (_BUILD_VIMC,),
)
DEBIAN_13_ON_ARM = replace(DEBIAN_13_WITH_LIBCAMERA, hooks=(_BUILD_I2C_STUB, _BUILD_VIMC), processor="aarch64")


class ImageError(LcfError):
    """The image cannot be made."""


@dataclass(frozen=True, slots=True)
class Image:
    """What a machine boots."""

    processor: str
    kernel: Path
    initrd: Path
    disk: Path


def missing(processor: str = HERE) -> str:
    """What stands in the way of a machine here and how to get it, in one line; empty: nothing does."""
    needed = {**TOOLS, **MORE_TOOLS[processor], **MACHINES[processor].tools}
    tools = sorted({package for tool, package in needed.items() if shutil.which(tool) is None})
    wants = [f"{', '.join(tools)} (apt-get install {' '.join(tools)})"] if tools else []
    wants += ["root (sudo make hil)"] if os.geteuid() != 0 else []
    wants += ["an x86-64 computer"] if os.uname().machine != HERE else []
    return f"no virtual machine here, it needs {' and '.join(wants)}" if wants else ""


def cache() -> Path:
    """Where images are kept."""
    return Path(os.environ.get("LCF_EDGE_HIL_CACHE") or Path.home() / ".cache/lcf-edge/hil")


def image(system: System = DEBIAN_12) -> Image:
    """The image of this working copy, made as far as it is not there. Raises ``ImageError``."""
    place = cache() / _digest([system.suite, *_packages(system), *LEFT_OUT, *BOOTS_WITH, *system.hooks])
    root, wheels, disk, known = (
        place / name
        for name in (
            "root",
            f"wheels-{_digest([system.python, *_builders(), *_contents([PROJECT / LOCK])])}",
            "disk.img",
            "project",
        )
    )
    _let_run(system)
    _once(root, lambda folder: _install_debian(system, folder))
    _once(wheels, lambda folder: _fetch(system, folder))
    project = _digest(_contents(PROJECT / name for name in SOURCES))
    if not known.exists() or known.read_text(encoding="ascii") != project:
        known.unlink(missing_ok=True)
        _install_project(system, root, wheels)
        _prepare(root)
        _make_disk(root, disk)
        known.write_text(project, encoding="ascii")
    return Image(system.processor, root / "vmlinuz", root / "initrd.img", disk)


def _once(folder: Path, make: Callable[[Path], object]) -> None:
    """Make a folder unless it is there, whole."""
    if not folder.exists():
        unfinished = folder.with_name("unfinished")
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.parent.mkdir(parents=True, exist_ok=True)
        make(unfinished)
        unfinished.rename(folder)


def _let_run(system: System) -> None:
    """Let this computer start its programs."""
    if system.processor != HERE:
        try:
            let_run(MACHINES[system.processor])
        except ReleaseError as error:
            raise ImageError(str(error)) from error


def _packages(system: System) -> list[str]:
    debian = MACHINES[system.processor].debian
    return [package.format(debian=debian) for package in (*PACKAGES, *system.packages)]


def _install_debian(system: System, root: Path) -> None:
    initramfs = (
        'mkdir -p "$1/etc/initramfs-tools/conf.d"; echo MODULES=list > "$1/etc/initramfs-tools/conf.d/hil"; '
        f'echo {" ".join(BOOTS_WITH)} | tr " " "\\n" > "$1/etc/initramfs-tools/modules"'
    )
    options = [f"--dpkgopt=path-exclude={path}" for path in LEFT_OUT]
    options += ["--variant=minbase", "--mode=root", "--format=directory", f"--setup-hook={initramfs}"]
    if system.processor != HERE:
        options += [f"--architectures={MACHINES[system.processor].debian}"]
    options += [f"--customize-hook={hook}" for hook in system.hooks]
    _do("mmdebstrap", *options, f"--include={','.join(_packages(system))}", system.suite, str(root))


def _builders() -> list[str]:
    """What builds the project."""
    project = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))
    needed: list[str] = project["build-system"]["requires"]
    return needed


def _fetch(system: System, wheels: Path) -> None:
    """The packages that `make install` takes, for the guest's Python, whatever this one is."""
    download = (sys.executable, "-m", "pip", "download", "--quiet", *_for_guest(system), "--dest", str(wheels))
    wheels.mkdir()
    locked = wheels / LOCK
    locked.write_text(locked_for((PROJECT / LOCK).read_text(encoding="utf-8"), system.python), encoding="utf-8")
    _do(*download, "--no-deps", "--require-hashes", "-r", str(locked))
    _do(*download, *_builders())


def _for_guest(system: System) -> list[str]:
    """Options that make pip take what fits there."""
    return options_for(system.processor, system.python, OF_DEBIAN_12)


def _install_project(system: System, root: Path, wheels: Path) -> None:
    """As docs/install.md says, without a network; for another processor from outside, with a wheel."""
    source = root / "usr/src/lcf-edge"
    shutil.rmtree(source, ignore_errors=True)
    source.mkdir(parents=True)
    for name in SOURCES:
        copy = shutil.copytree if (PROJECT / name).is_dir() else shutil.copy
        copy(PROJECT / name, source / name)
    if system.processor == HERE:
        _make_install(root, wheels)
    else:
        _install_from_outside(system, root, wheels)
    (site_packages,) = (root / "opt/lcf-edge/lib").glob("python3*/site-packages")
    agent = site_packages / "hil_mocks/vm"  # no part of the product, so an earlier installation left its own behind
    shutil.rmtree(agent, ignore_errors=True)
    shutil.copytree(PROJECT / "hil_mocks/vm", agent)


def _make_install(root: Path, wheels: Path) -> None:
    """By the system's own programs."""
    shutil.copytree(wheels, root / "wheels", dirs_exist_ok=True)
    environment = ("-i", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "HOME=/root", "PIP_NO_INDEX=1", "PIP_FIND_LINKS=/wheels")
    install = ("make", "-C", "/usr/src/lcf-edge", "install")
    _do("unshare", "-n", "chroot", str(root), "env", *environment, *install)
    shutil.rmtree(root / "wheels")


def _install_from_outside(system: System, root: Path, wheels: Path) -> None:
    """The same by this computer's pip, since an emulated one takes half an hour."""
    program = root / "opt/lcf-edge"
    shutil.rmtree(program, ignore_errors=True)
    _do("chroot", str(root), "python3", "-m", "venv", "--without-pip", "/opt/lcf-edge")
    packages = program / f"lib/python{system.python}/site-packages"
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-compile", "--no-index"]
    install += ["--find-links", str(wheels), *_for_guest(system), "--target", str(packages)]
    install += ["--ignore-requires-python"]  # pip would ask its own
    _do(*install, "--require-hashes", "-r", str(wheels / LOCK))
    with tempfile.TemporaryDirectory() as place:
        _do(*install, str(_cross_compiled(system, Path(place))))
    (program / "bin/lcf-edge").write_text(command_for("/opt/lcf-edge/bin/python"), encoding="ascii")
    (program / "bin/lcf-edge").chmod(0o755)
    command = root / "usr/local/bin/lcf-edge"
    command.unlink(missing_ok=True)
    command.symlink_to("/opt/lcf-edge/bin/lcf-edge")
    compiling = ("-m", "compileall", "-q", "-j0")
    if python := python_here(system.python):
        _do(python, *compiling, "-s", str(root), str(packages))
    else:
        _do("chroot", str(root), "python3", *compiling, f"/{packages.relative_to(root)}")
    _do("make", "-C", str(PROJECT), "install", f"DESTDIR={root}", "FILES_ONLY=1")


def _cross_compiled(system: System, folder: Path) -> Path:
    """The project's wheel for that processor, in ``folder``."""
    try:
        with tempfile.TemporaryDirectory() as place:
            source = cross.source_package(Path(place))
            return cross.build(MACHINES[system.processor], source, folder)
    except ReleaseError as error:
        raise ImageError(str(error)) from error


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
