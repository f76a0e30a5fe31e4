"""``python -m release.wheels``: wheels for x86-64 and 64-bit Arm into ``dist/``, each tried before it is left there.

The source package is made first and the wheels of it, so that both are whole. A wheel is compiled by Debian's
(cross) compiler against Python's headers and the C library of the oldest Debian that has a Python new enough, and its
name says the oldest C library that it runs with, as ``auditwheel`` reads it from the symbols.
"""

import os
import shutil
import sys
import tarfile
import tempfile
from collections.abc import Sequence
from pathlib import Path

from lcf_edge.errors import LcfError
from release.debian import Machine, chosen, get_tools, run, unpacked
from release.trial import Trial

PROJECT = Path(__file__).parents[1]
BUILT_FOR = "bookworm"
HEADERS = ("libpython3-dev", "libc6-dev", "libgcc-12-dev")


def main(arguments: Sequence[str] | None = None) -> int:
    """Build and try; return the exit status."""
    try:
        machines = chosen("wheels", __doc__, "wheel", arguments)
        get_tools(machines)
        source = source_package(PROJECT / "dist")
        trial = Trial()
        for machine in machines:
            wheel = build(machine, source, PROJECT / "dist")
            sys.stdout.write(f"{wheel.relative_to(PROJECT)}: {wheel.stat().st_size / 1e3:.0f} kB\n")
            sys.stdout.write(f"    {trial.run(machine, wheel)}\n")
    except LcfError as error:
        sys.stderr.write(f"wheels: {error}\n")
        return error.exit_status
    return 0


def source_package(folder: Path) -> Path:
    """The source as it is released. Raises ``ReleaseError``."""
    with tempfile.TemporaryDirectory() as place:
        run(sys.executable, "setup.py", "--quiet", "sdist", "--dist-dir", place, folder=PROJECT)
        (made,) = Path(place).iterdir()
        folder.mkdir(exist_ok=True)
        return Path(shutil.copy(made, folder))


def build(machine: Machine, source: Path, folder: Path) -> Path:
    """The wheel for a machine, from the source package. Raises ``ReleaseError``."""
    root = unpacked(machine, BUILT_FOR, HEADERS)
    compiler = f"{machine.gcc} --sysroot={root}"
    environment = {
        **os.environ,
        "LCF_EDGE_COMPILED": "1",
        "CC": compiler,
        "LDSHARED": f"{compiler} -shared",
        "CFLAGS": " ".join(f"-I{path}" for path in sorted(root.glob("usr/include/python3*"))),
        "_PYTHON_HOST_PLATFORM": f"linux-{machine.name}",  # what distutils builds for
        "PATH": os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath))),
    }
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        with tarfile.open(source) as archive:
            archive.extractall(place, filter="data")
        (unpacked_source,) = place.iterdir()
        options = ("--quiet", "--no-build-isolation", "--no-deps", "--wheel-dir", str(place / "built"))
        run(sys.executable, "-m", "pip", "wheel", *options, ".", folder=unpacked_source, environment=environment)
        (built,) = (place / "built").iterdir()
        run("auditwheel", "repair", "--wheel-dir", str(place / "named"), str(built), environment=environment)
        (named,) = (place / "named").iterdir()
        for older in folder.glob(f"{named.name.split('-manylinux')[0]}-*{machine.name}.whl"):
            older.unlink()
        return Path(shutil.copy(named, folder))


if __name__ == "__main__":
    sys.exit(main())
