"""A wheel where nothing can be compiled: a Debian with Python alone, of the wheel's processor, emulated if need be.

There it filters a rendered drive, and must find the very same as the sources that this process runs, on its own
processor; and so must a part of it as the Python that it was compiled from.
"""

import json
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

from lcf_edge.rendered import scenes
from release.debian import Machine, ReleaseError, run, unpacked
from release.foreign_pip import options_for

SUITE, PYTHON = "trixie", "3.13"
PACKAGES = ("python3", "libstdc++6", "libc-bin", "tzdata")
SECONDS = 2.0  # of the drive
_SHORT_S = 0.5  # uncompiled and emulated is slow
MAX_EXTENSION_KB = 1500
_COMPILED = "import sys; from lcf_edge.compilation import extension; sys.exit(extension().reason or 0)"


class Trial:
    """One drive for all wheels."""

    def __init__(self) -> None:
        self._place = tempfile.TemporaryDirectory()
        self._drive = scenes.write(scenes.make("two_crossing", 0, seconds=SECONDS), Path(self._place.name, "drive"))
        self._short = scenes.write(_short(), Path(self._place.name, "short"))

    def run(self, machine: Machine, wheel: Path) -> str:
        """What was tried, in one line. Raises ``ReleaseError`` where the wheel does not do what the sources do."""
        size_kb = extension_kb(wheel)
        if size_kb > MAX_EXTENSION_KB:
            raise ReleaseError(f"{wheel.name}: the extension has {size_kb:.0f} kB, more than {MAX_EXTENSION_KB}")
        root = Path(self._place.name, machine.name)
        run("cp", "-a", str(unpacked(machine, SUITE, PACKAGES)), str(root))
        install(machine, wheel, root / "wheel")
        for drive in (self._drive, self._short):
            run("cp", "-a", str(drive), str(root))
        if compilers := [path.name for path in (root / "usr/bin").iterdir() if path.name.endswith(("gcc", "cc"))]:
            raise ReleaseError(f"{machine.name}: {compilers[0]} is there, so the trial shows nothing")
        _run(root, "-c", _COMPILED)
        if _replayed(root, "short") != _replayed(root, "short", LCF_EDGE_PURE="1"):
            raise ReleaseError(f"{wheel.name}: compiled it finds something else than uncompiled")
        found = _replayed(root, "drive")
        same = sum(one == other for one, other in zip(found, self._expected, strict=True))
        if same < len(found):
            raise ReleaseError(f"{wheel.name}: {len(found) - same} of {len(found)} results differ from the sources'")
        emulated = "" if machine.is_this else ", emulated"
        return (
            f"extension {size_kb:.0f} kB; Debian {SUITE}, Python {PYTHON}, {machine.name}{emulated}: compiled as "
            f"uncompiled, {len(found)} frames as here (SHA-256 {digest(found)})"
        )

    @cached_property
    def _expected(self) -> list[dict[str, Any]]:
        file = Path(self._place.name, "results.jsonl")
        run(sys.executable, "-m", "lcf_edge", "replay", str(self._drive), "-o", str(file))
        return list(results(file))


def _short() -> scenes.Drive:
    return scenes.make("two_crossing", 0, seconds=_SHORT_S, width=320, height=240, focal_px=250.0)


def install(machine: Machine, wheel: Path, folder: Path) -> None:
    """As pip would there, from what fits that system."""
    options = [*options_for(machine.name, PYTHON), "--target", str(folder)]
    run(sys.executable, "-m", "pip", "install", "--quiet", *options, str(wheel))


def _run(root: Path, *arguments: str, **settings: str) -> None:
    environment = {"PYTHONPATH": "/wheel", "HOME": "/", "PATH": "/usr/sbin:/usr/bin", **settings}
    run("chroot", str(root), "/usr/bin/python3", *arguments, environment=environment)


def _replayed(root: Path, drive: str, **settings: str) -> list[dict[str, Any]]:
    _run(root, "-m", "lcf_edge", "replay", f"/{drive}", "-o", "/results.jsonl", **settings)
    return list(results(root / "results.jsonl"))


def results(file: Path) -> Iterator[dict[str, Any]]:
    """Lines of results, without how long each frame took."""
    for line in file.read_text(encoding="utf-8").splitlines():
        result = json.loads(line)
        del result["timing_us"]
        yield result


def digest(found: list[dict[str, Any]]) -> str:
    """To compare by eye."""
    return sha256(json.dumps(found).encode()).hexdigest()[:16]


def extension_kb(wheel: Path) -> float:
    """Size of the compiled extension, stripped."""
    with zipfile.ZipFile(wheel) as archive:
        sizes = [entry.file_size for entry in archive.infolist() if entry.filename.endswith(".so")]
    if len(sizes) != 1:
        raise ReleaseError(f"{wheel.name}: {len(sizes)} extensions, where there is to be one")
    return sizes[0] / 1e3
