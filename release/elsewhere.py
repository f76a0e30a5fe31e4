"""``python -m release.elsewhere MACHINE PYTHON… -- TESTS``: the tests with other Pythons and on another processor.

What is tested is the source package with the extension of the wheel, unpacked; beside it lies what the tests need, as
pip would pick it there. A Python is this computer's where it has that one, else that of a Debian, unpacked; another
processor is emulated. Each Python's outcome is told in one line at the end.
"""

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from packaging.requirements import Requirement

from lcf_edge.errors import LcfError
from release import wheels
from release.debian import MACHINES, Machine, ReleaseError, cache, get_tools, run, unpacked
from release.foreign_pip import options_for

SUITES = {"3.11": "bookworm", "3.13": "trixie", "3.14": "forky"}
"""The Debian that has it."""

PACKAGES = (
    *("python3", "libstdc++6", "libc-bin", "tzdata", "openssl", "procps", "mount"),
    *("base-passwd", "bash", "dash", "coreutils", "grep", "sed"),
)
EXPIRED_TOO = '--aptopt=Acquire::Check-Valid-Until "false"'
"""Debian testing's lists hold for a week, and a mirror may be behind; they are signed all the same."""

TESTS_NEED = "test"
WITHOUT_A_WHEEL = ("argparse-manpage",)
"""Packages in Python alone that are published as source only; pip takes no source for another computer."""

EMULATED_TIMEOUT_S = 3600  # of one test

_IN_ROOT = """
mount -t proc proc "$0/proc"
mount --rbind /dev "$0/dev"
mount -t tmpfs tmpfs "$0/tmp"
mount --bind "$1" "$0/packages"
mount --bind "$2" "$0/project"
root=$0; shift 2
exec chroot "$root" /usr/bin/env --chdir=/project "$@"
"""


@dataclass(frozen=True, slots=True)
class Python:
    """Where a Python is: a program of this computer, or a folder that holds a Debian."""

    version: str
    program: str = ""
    root: Path | None = None

    def test(self, machine: Machine, packages: Path, project: Path, tests: Sequence[str]) -> int:
        """Run pytest, which tells what it does; return its exit status."""
        arguments = ["-m", "pytest", "-p", "no:cacheprovider", *tests]
        if not machine.is_this:
            arguments += ["-o", f"timeout={EMULATED_TIMEOUT_S}", "--hypothesis-profile=emulated"]
        if self.root is None:
            with tempfile.TemporaryDirectory() as place:
                run(self.program, "-m", "venv", "--without-pip", place)
                _import_from(Path(place, "lib", f"python{self.version}", "site-packages"), project, packages)
                return subprocess.run([f"{place}/bin/python", *arguments], cwd=project, check=False).returncode
        for name in ("packages", "project", "proc", "dev", "tmp"):
            (self.root / name).mkdir(exist_ok=True)
        _set_up(self.root)
        _import_from(self.root / f"usr/local/lib/python{self.version}/dist-packages", "/project", "/packages")
        settings = ["-i", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "HOME=/tmp", "LANG=C.UTF-8"]
        settings += ["GIT_PYTHON_REFRESH=quiet"]  # else what imports GitPython needs git
        apart = ["unshare", "--mount", "sh", "-ec", _IN_ROOT]
        places = [str(self.root), str(packages), str(project)]
        return subprocess.run([*apart, *places, *settings, "python3", *arguments], check=False).returncode


def _set_up(root: Path) -> None:
    """What an installed Debian has, and an unpacked one has not: the system's users, groups and own name."""
    for name in ("passwd", "group"):
        shutil.copy(root / f"usr/share/base-passwd/{name}.master", root / "etc" / name)
    (root / "etc/hosts").write_text("127.0.0.1 localhost\n", encoding="ascii")


def _import_from(site_packages: Path, *folders: Path | str) -> None:
    """What a Python imports from, also one that a test starts with an environment of its own."""
    site_packages.mkdir(parents=True, exist_ok=True)
    (site_packages / "lcf-edge.pth").write_text("".join(f"{folder}\n" for folder in folders), encoding="utf-8")


def main(arguments: Sequence[str] | None = None) -> int:
    """Test; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m release.elsewhere", description=__doc__)
    parser.add_argument("machine", choices=list(MACHINES))
    parser.add_argument("pythons", nargs="+", metavar="PYTHON")
    parser.add_argument("--tests", nargs=argparse.REMAINDER, default=[], help="what pytest is told (all of tests)")
    wanted = parser.parse_args(arguments)
    machine = MACHINES[wanted.machine]
    outcomes = {}
    try:
        get_tools([machine], "test-all" if machine.is_this else "test-arm64")
        with tempfile.TemporaryDirectory() as place:
            project = _project(machine, Path(place))
            for version in wanted.pythons:
                sys.stdout.write(f"Python {version}, {machine.name}\n")
                sys.stdout.flush()
                outcomes[version] = _tested(machine, version, project, wanted.tests)
    except LcfError as error:
        sys.stderr.write(f"tests: {error}\n")
        return error.exit_status
    for version, outcome in outcomes.items():
        sys.stdout.write(f"Python {version}, {machine.name}: {outcome or 'passed'}\n")
    return 1 if any(outcomes.values()) else 0


def _tested(machine: Machine, version: str, project: Path, tests: Sequence[str]) -> str:
    """What went wrong; empty: nothing."""
    try:
        python, needed = find(machine, version), packages(machine, version)
        if python.root is not None and not machine.is_this and (compiler := installed(version)):
            for folder, seen_as in (python.root / "usr/lib", "/usr/lib"), (needed, "/packages"), (project, "/project"):
                compile_ahead(compiler, folder, seen_as)
        status = python.test(machine, needed, project, tests)
    except ReleaseError as error:
        return f"not tested: {error}"
    return f"failed, pytest's exit status {status}" if status else ""


def find(machine: Machine, version: str) -> Python:
    """A Python of that version for that processor. Raises ``ReleaseError``."""
    if machine.is_this and (program := installed(version)):
        return Python(version, program)
    if version not in SUITES:
        raise ReleaseError(f"there is no python{version} on this computer, and no Debian has it")
    return Python(version, root=unpacked(machine, SUITES[version], PACKAGES, EXPIRED_TOO))


def compile_ahead(python: str, folder: Path, seen_as: str) -> None:
    """Let that Python make the byte code of what one of its version will run, which takes an emulated one minutes.

    ``seen_as``: the folder's name there. Files that are of no Python of today stay as they are.
    """
    command = (python, "-m", "compileall", "-q", "-j0", "-s", str(folder), "-p", seen_as, str(folder))
    subprocess.run(command, check=False, capture_output=True)


def installed(version: str) -> str:
    """This computer's, on the path or kept by pyenv; empty: none."""
    kept = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv").glob(
        f"versions/{version}.*/bin/python{version}"
    )
    for program in (f"python{version}", *map(str, sorted(kept))):
        found = shutil.which(program)
        if found and subprocess.run((found, "-c", ""), check=False, capture_output=True).returncode == 0:
            return found
    return ""


def packages(machine: Machine, version: str) -> Path:
    """A folder with all that the tests import, kept. Raises ``ReleaseError``."""
    needed = _requirements()
    named = hashlib.sha256(" ".join(needed).encode()).hexdigest()[:8]
    folder = cache() / f"packages-{machine.name}-{version}-{named}"
    if not folder.exists():
        unfinished = folder.with_name("unfinished-packages")
        shutil.rmtree(unfinished, ignore_errors=True)
        pip = (sys.executable, "-m", "pip")
        with tempfile.TemporaryDirectory() as made:
            sources = [need for need in needed if Requirement(need).name in WITHOUT_A_WHEEL]
            run(*pip, "wheel", "--quiet", "--no-deps", "--wheel-dir", made, *sources)
            install = (*pip, "install", "--quiet", "--no-compile", "--target", str(unfinished), "--find-links", made)
            run(*install, *options_for(machine.name, version), *needed)
        unfinished.rename(folder)
    return folder


def _requirements() -> list[str]:
    """Of the project, and of its tests."""
    project = tomllib.loads((wheels.PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

    def of(extra: str) -> set[str]:
        needed: set[str] = set()
        for need in project["optional-dependencies"][extra]:
            itself = Requirement(need).name == project["name"]
            needed |= set().union(*map(of, Requirement(need).extras)) if itself else {need}
        return needed

    return sorted({*project["dependencies"], *of(TESTS_NEED)})


def _project(machine: Machine, place: Path) -> Path:
    """The source package with its extension, below ``place``. Raises ``ReleaseError``."""
    source = wheels.source_package(place)
    wheel = wheels.build(machine, source, place)
    with tarfile.open(source) as archive:
        archive.extractall(place, filter="data")
    (project,) = (path for path in place.iterdir() if path.is_dir())
    with zipfile.ZipFile(wheel) as archive:
        for name in archive.namelist():
            if name.endswith(".so"):
                archive.extract(name, project)
    return project


if __name__ == "__main__":
    sys.exit(main())
