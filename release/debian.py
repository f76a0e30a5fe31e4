"""Debian from its packages: unpacked, where nothing of it has to run, or installed.

Needs root for ``mmdebstrap``, as everything else of a release does. Unpacked roots are kept in the folder that
``LCF_EDGE_RELEASE_CACHE`` names, or ``~/.cache/lcf-edge/release``.
"""

import argparse
import hashlib
import os
import platform
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from lcf_edge.errors import LcfError

STEP_S = 1800.0  # at most; emulated ones are slow
_FOLDERS = ("bin", "lib", "lib64", "sbin")  # links into /usr that an installed Debian has


class ReleaseError(LcfError):
    """A step of a release failed."""


@dataclass(frozen=True, slots=True)
class Machine:
    """A processor, as Python names it, as Debian names it, and how to get there from another."""

    name: str
    debian: str
    tools: Mapping[str, str]  # command: the Debian package that brings it

    @property
    def gcc(self) -> str:
        """The compiler for it."""
        return f"{self.name}-linux-gnu-gcc"

    @property
    def is_this(self) -> bool:
        """Whether no emulation is needed."""
        return platform.machine() == self.name


MACHINES = {
    "x86_64": Machine("x86_64", "amd64", {"x86_64-linux-gnu-gcc": "gcc-x86-64-linux-gnu"}),
    "aarch64": Machine("aarch64", "arm64", {"aarch64-linux-gnu-gcc": "gcc-aarch64-linux-gnu"}),
}
_TOOLS = {"mmdebstrap": "mmdebstrap", "arch-test": "arch-test"}
EMULATION = {"qemu-aarch64-static": "qemu-user-static", "update-binfmts": "binfmt-support"}


def chosen(program: str, about: str | None, made: str, arguments: Sequence[str] | None) -> list[Machine]:
    """The machines that the command line of ``release.PROGRAM`` names, all if none. Raises ``ReleaseError``.

    ``made``: what is made for each.
    """
    parser = argparse.ArgumentParser(prog=f"python -m release.{program}", description=about)
    parser.add_argument("machines", nargs="*", metavar="MACHINE", help=f"of {', '.join(MACHINES)} (all)")
    names = parser.parse_args(arguments).machines or list(MACHINES)
    if unknown := [name for name in names if name not in MACHINES]:
        raise ReleaseError(f"{unknown[0]}: no {made} is made for it; one of {', '.join(MACHINES)}")
    return [MACHINES[name] for name in names]


def get_tools(machines: Sequence[Machine], target: str = "wheels", more: Mapping[str, str] | None = None) -> None:
    """Install what a target of the Makefile misses. Raises ``ReleaseError`` where that cannot be done.

    ``more``: commands that it needs beside the usual ones, and the packages that bring them.
    """
    tools = _TOOLS | dict(more or {})
    for machine in machines:
        tools |= machine.tools
    if not all(machine.is_this for machine in machines):
        tools |= EMULATION
    missing = sorted({package for tool, package in tools.items() if shutil.which(tool) is None})
    if os.geteuid() != 0:
        wants = f"and {' '.join(missing)} " if missing else ""
        raise ReleaseError(f"make {target} needs root {wants}(sudo make {target})")
    if missing:
        run("apt-get", "update", "--quiet")
        run("apt-get", "install", "--yes", "--quiet", "--no-install-recommends", *missing)
    for machine in machines:
        if not machine.is_this:
            let_run(machine)


def let_run(machine: Machine) -> None:
    """Let the kernel start programs of another processor."""
    if not Path("/proc/sys/fs/binfmt_misc/register").exists():
        run("mount", "-t", "binfmt_misc", "binfmt_misc", "/proc/sys/fs/binfmt_misc")
    run("update-binfmts", "--enable", f"qemu-{machine.name}")


def cache() -> Path:
    """Where unpacked roots are kept."""
    return Path(os.environ.get("LCF_EDGE_RELEASE_CACHE") or Path.home() / ".cache/lcf-edge/release")


def unpacked(machine: Machine, suite: str, packages: Sequence[str], *options: str) -> Path:
    """A folder with these packages and all that they need, as ``suite`` has them. ``options``: of ``mmdebstrap``."""
    named = hashlib.sha256(" ".join(packages).encode()).hexdigest()[:8]
    links = "; ".join(f'mkdir -p "$1/usr/{name}"; ln -s usr/{name} "$1/{name}"' for name in _FOLDERS)
    return _kept(machine, suite, packages, named, "--variant=extract", f"--setup-hook={links}", *options)


def installed(machine: Machine, suite: str, packages: Sequence[str]) -> Path:
    """A folder with a Debian that has ``apt`` and in which these packages are set up, by its own programs."""
    named = "apt-" + hashlib.sha256(" ".join(packages).encode()).hexdigest()[:8]
    return _kept(machine, suite, packages, named, "--variant=apt")


def _kept(machine: Machine, suite: str, packages: Sequence[str], named: str, *options: str) -> Path:
    root = cache() / f"{suite}-{machine.debian}-{named}"
    if not root.exists():
        unfinished = root.with_name("unfinished")
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.parent.mkdir(parents=True, exist_ok=True)
        usual = ("--quiet", "--mode=root", "--format=directory", f"--architectures={machine.debian}")
        run("mmdebstrap", *usual, *options, f"--include={','.join(packages)}", suite, str(unfinished))
        shutil.rmtree(unfinished / "dev")  # nothing here is a device
        (unfinished / "dev").mkdir()
        unfinished.rename(root)
    return root


def run(*command: str, folder: Path | None = None, environment: Mapping[str, str] | None = None) -> str:
    """Run one step; return what it said. Raises ``ReleaseError`` with the last lines of a step that failed."""
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            check=False,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=STEP_S,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ReleaseError(f"{command[0]}: {error}") from error
    if done.returncode:
        last = " | ".join((done.stderr or done.stdout).strip().splitlines()[-5:])
        raise ReleaseError(f"{' '.join(command[:4])}: exit status {done.returncode}: {last}")
    return done.stdout
