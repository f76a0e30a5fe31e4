"""The program, its packages, and the computer that it runs on."""

import platform
import re
import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec

from lcf_edge import __version__
from lcf_edge.compilation import SLOWER, Compiled, extension
from lcf_edge.doctor.finding import Context, Finding, fail, ok, warn

NEEDED: Mapping[str, tuple[tuple[int, int], tuple[int, int]]] = {
    "numpy": ((2, 0), (3, 0)),
    "opencv-python-headless": ((4, 10), (6, 0)),
    "eclipse-zenoh": ((1, 5), (2, 0)),
}
"""First version that works, and first that may not."""

_MODULES = {"plot": "matplotlib", "view": "aiohttp", "watch": "rich"}


def check(_: Context) -> Iterator[Finding]:
    """Check versions."""
    yield _computer(sys.maxsize > 2**32)
    yield from packages({name: _installed(name) for name in NEEDED})
    yield compilation(extension())
    missing = [extra for extra, module in _MODULES.items() if find_spec(module) is None]
    if missing:
        yield ok(
            "software",
            f"optional, not installed: {', '.join(missing)} (pip install 'lcf-edge[{','.join(missing)}]')",
        )


def packages(installed: Mapping[str, str]) -> Iterator[Finding]:
    """Return findings about versions; "": unknown."""
    for name, (least, below) in NEEDED.items():
        numbers = tuple(map(int, re.findall(r"\d+", installed[name])[:2]))
        if numbers and not least <= numbers < below:
            supported = f">={least[0]}.{least[1]},<{below[0]}"
            text = f"{name} {installed[name]} is untested; supported: {supported}"
            yield (fail if numbers < least else warn)("software", text, f"pip install '{name}{supported}'")
    versions = ", ".join(f"{name} {version}" for name, version in installed.items() if version)
    yield ok("software", f"lcf-edge {__version__}, Python {platform.python_version()}, {versions}")


def compilation(compiled: Compiled) -> Finding:
    """Check whether the filter runs compiled."""
    if not compiled.reason:
        return ok("software", "the filter runs compiled")
    text = f"the filter runs uncompiled, about {SLOWER} times slower: {compiled.reason}"
    return warn("software", text, compiled.command)


def _computer(is_64_bit: bool) -> Finding:
    text = f"{platform.system()} {platform.release()} on {platform.machine()}"
    if is_64_bit:
        return ok("software", f"{text}, 64 bits")
    return fail("software", f"{text}: 32-bit Python, for which there is no Zenoh; install a 64-bit system")


def _installed(name: str) -> str:
    for same in (name, name.removesuffix("-headless")):
        try:
            return version(same)
        except PackageNotFoundError:
            continue
    return ""
