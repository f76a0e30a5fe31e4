"""``python -m release.deb``: a Debian package for each processor, of the wheels of which ``bundle`` makes archives.

At ``/usr/lib/lcf-edge`` it has a Python environment for all of ``PYTHONS`` at once. Python looks for packages in the
folder of its own version there: what fits that version alone is in it, and a line leads to what fits all. So nothing is
fetched, built or removed on the vehicle, also when its Debian comes to another Python. The rest of a package is in
``debian/``. ``lintian`` must have nothing to say, and it is tried before it is left there.
"""

import os
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from packaging.utils import parse_wheel_filename

from lcf_edge.errors import LcfError
from release.bundle import PROJECT, PYTHONS, built, documents, fetch, system_files
from release.deb_trial import try_out
from release.debian import Machine, chosen, get_tools, run
from release.foreign_pip import OF_DEBIAN_12, command_for, options_for

TOOLS = {"dh_builddeb": "debhelper", "dpkg-architecture": "dpkg-dev", "lintian": "lintian"}
PLACE = "usr/lib/lcf-edge"
PACKED = ("-Zxz", "-z1")  # more takes minutes for little


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the packages; return the exit status."""
    try:
        machines = chosen("deb", __doc__, "package", arguments)
        get_tools(machines, "deb", TOOLS)
        for machine in machines:
            wheel = built(machine, PROJECT / "dist")
            with tempfile.TemporaryDirectory() as place:
                fetch(machine, Path(place))
                package = pack(machine, wheel, Path(place), PROJECT / "dist")
            sys.stdout.write(f"{package.relative_to(PROJECT)}: {package.stat().st_size / 1e6:.0f} MB\n")
            check(package)
            sys.stdout.write(f"    {try_out(machine, package)}\n")
    except LcfError as error:
        sys.stderr.write(f"deb: {error}\n")
        return error.exit_status
    return 0


def pack(machine: Machine, wheel: Path, wheels: Path, folder: Path, packed: Sequence[str] = PACKED) -> Path:
    """The package, of the project's wheel and a folder with all others. Raises ``ReleaseError``.

    ``packed``: what ``dpkg-deb`` is told of the compression.
    """
    with tempfile.TemporaryDirectory() as place:
        source = Path(place, "lcf-edge")
        shutil.copytree(PROJECT / "debian", source / "debian")
        documents(source / "documents")
        root = source / "debian/lcf-edge"
        system_files(root)
        environment(machine.name, [wheel, *sorted(wheels.glob("*.whl"))], root / PLACE)
        first, last = PYTHONS[0], PYTHONS[-1]
        major, _, minor = last.partition(".")
        rules = ("debian/rules", "binary", f"FIRST={first}", f"AFTER={major}.{int(minor) + 1}")
        apart = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
        architecture = ("dpkg-architecture", f"--host-arch={machine.debian}", "--force", "--command")
        run(*architecture, " ".join((*rules, f"PACKED='{' '.join(packed)}'")), folder=source, environment=apart)
        (package,) = source.glob("*.deb")
        folder.mkdir(exist_ok=True)
        return Path(shutil.copy(package, folder))


def environment(machine: str, wheels: Sequence[Path], place: Path) -> None:
    """A Python environment at ``place`` of these wheels, for all of ``PYTHONS``. Raises ``ReleaseError``."""
    (place / "bin").mkdir(parents=True)
    (place / "bin/python3").symlink_to("/usr/bin/python3")
    (place / "bin/python").symlink_to("python3")
    (place / "bin/lcf-edge").write_text(command_for(f"/{PLACE}/bin/python"), encoding="ascii")
    (place / "bin/lcf-edge").chmod(0o755)
    (place / "pyvenv.cfg").write_text("home = /usr/bin\ninclude-system-site-packages = false\n", encoding="ascii")
    of_all = [wheel for wheel in wheels if wheel.name.partition("-")[0] != "pip" and not python_of(wheel)]
    install(machine, PYTHONS[0], of_all, place / "lib/python3/site-packages")
    for python in PYTHONS:
        packages = place / f"lib/python{python}/site-packages"
        install(machine, python, [wheel for wheel in wheels if python_of(wheel) == python], packages)
        (packages / "lcf-edge.pth").write_text("../../python3/site-packages\n", encoding="ascii")


def python_of(wheel: Path) -> str:
    """The one Python that it fits, as ``3.11``; empty: it fits all."""
    pythons = {tag.abi for tag in parse_wheel_filename(wheel.name)[3] if tag.abi.startswith("cp")}
    return f"3.{pythons.pop().removeprefix('cp3')}" if len(pythons) == 1 else ""


def install(machine: str, python: str, wheels: Sequence[Path], folder: Path) -> None:
    """Put wheels into a folder to import from, without the commands that they bring. Raises ``ReleaseError``."""
    folder.mkdir(parents=True)
    options = ["--no-deps", "--no-index", "--no-compile", "--ignore-requires-python"]
    options += options_for(machine, python, OF_DEBIAN_12)
    into = ("install", "--quiet", "--disable-pip-version-check", "--target", str(folder))
    if wheels:
        run(sys.executable, "-m", "pip", *into, *options, *map(str, wheels))
    for name in ("bin", "share"):
        shutil.rmtree(folder / name, ignore_errors=True)


def check(package: Path) -> None:
    """Raises ``ReleaseError`` with what ``lintian`` finds."""
    run("lintian", "--allow-root", "--fail-on=error,warning", str(package))


if __name__ == "__main__":
    sys.exit(main())
