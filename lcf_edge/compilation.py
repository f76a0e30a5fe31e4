"""Imports the filter's modules from the compiled extension, if one was built from exactly these sources.

The extension ``lcf_edge._compiled`` holds every module that has a ``.pxd`` beside its ``.py`` (setup.py). Without it,
or when one of those files has changed since, all of them run as plain Python: correct, but slow. ``LCF_EDGE_PURE=1``
forces that.
"""

import os
import sys
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.machinery import ExtensionFileLoader, ModuleSpec
from importlib.util import spec_from_file_location
from pathlib import Path
from types import ModuleType

PACKAGE = Path(__file__).parent
SLOWER = 100  # times, approximately
_INSTALL = "sudo apt install gcc python3-dev  # and install again; or install a wheel"
_EXTENSION, _SHARED = "lcf_edge._compiled", "lcf_edge._memoryviews"


@dataclass(frozen=True, slots=True)
class Compiled:
    """The extension and its modules; or why it is not used, and the command that fixes that."""

    path: str = ""
    modules: frozenset[str] = frozenset()
    reason: str = ""
    command: str = ""
    outdated: bool = False  # it exists, but was built from other sources


def uncompiled() -> str:
    """Return why the filter runs uncompiled, and the remedy, in one line; empty: it is compiled."""
    compiled = extension()
    if not compiled.reason:
        return ""
    return f"the filter runs uncompiled, about {SLOWER} times slower: {compiled.reason}; {compiled.command}"


@cache
def extension() -> Compiled:
    """Return the extension; it is examined once."""
    if os.environ.get("LCF_EDGE_PURE") == "1":
        return Compiled(reason="LCF_EDGE_PURE is set", command="unset LCF_EDGE_PURE")
    try:
        compiled = import_module(_EXTENSION)
    except ModuleNotFoundError:
        return Compiled(reason="it was installed without a compiler", command=_INSTALL)
    except ImportError as error:
        return Compiled(reason=f"its extension cannot be loaded ({error})", command=_INSTALL)
    return examined(str(compiled.__file__), compiled.MODULES, compiled.SOURCES, sources())


def examined(path: str, modules: str, made_of: str, present: Mapping[str, str]) -> Compiled:
    """Compare the extension at ``path`` with the sources that are ``present``."""
    then = dict(each.split(":") for each in made_of.split())
    changed = sorted(name for name in {*then, *present} if then.get(name) != present.get(name))
    if changed:
        reason = f"{', '.join(changed)} changed since it was compiled"
        return Compiled(reason=reason, command="make compile  # or install again", outdated=True)
    return Compiled(path, frozenset(modules.split()))


def sources() -> dict[str, str]:
    """Return the CRC-32 of every source of the extension, by path within the package."""
    declarations = list(PACKAGE.rglob("*.pxd"))
    modules = (path.with_suffix(".py") for path in declarations)
    files = (*declarations, *(module for module in modules if module.exists()))
    return {str(path.relative_to(PACKAGE)): f"{zlib.crc32(path.read_bytes()):08x}" for path in files}


def use_compiled() -> None:
    """Import compiled modules from the extension from now on."""
    sys.meta_path.insert(0, _Finder())


class _Finder:
    """Finds the modules of the extension, which is examined when the first of them is imported."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        del target
        if path is None or not fullname.startswith("lcf_edge."):
            return None
        declaration = Path(path[0], fullname.rpartition(".")[2] + ".pxd")
        if fullname != _SHARED and not declaration.exists():
            return None
        compiled = extension()
        if fullname not in compiled.modules:
            return None
        return spec_from_file_location(fullname, loader=ExtensionFileLoader(fullname, compiled.path))
