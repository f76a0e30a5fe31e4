"""Compile every module of lcf_edge that has a .pxd beside it into one extension; all else is in pyproject.toml.

A .pxd that defines its functions itself (``cdef inline``) is a header: the .py beside it serves the uncompiled.
Where nothing can be compiled the package is installed as it is, pure Python: right, and slow.
``LCF_EDGE_COMPILED=1``: fail instead. ``LCF_EDGE_PURE=1``: compile nothing.
"""

import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import zlib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from logging import WARNING
from pathlib import Path

import Cython
from Cython.Build import cythonize
from Cython.Compiler import Options
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import CCompilerError, ExecError, PlatformError

PACKAGE = Path("lcf_edge")
BOOTSTRAP = "lcf_edge/_compiled.c"
EXTENSION = "lcf_edge._compiled"
SHARED = "lcf_edge._memoryviews"  # Cython's code for them, once for all modules
DIRECTIVES = {
    "language_level": 3,
    "boundscheck": False,
    "wraparound": False,
    "cdivision": True,
    "initializedcheck": False,
    "infer_types": True,
    "annotation_typing": False,
    "auto_pickle": False,
    "always_allow_keywords": False,  # a function of one argument takes it by position: half of the wrapper
    "binding": False,  # plain built-in functions take less room than those that can be looked into
}
Options.docstrings = False  # they are in the source
MACROS = [
    ("Py_LIMITED_API", "0x030B0000"),  # Python 3.11 and later
    ("CYTHON_LIMITED_API", "1"),
    ("CYTHON_CLINE_IN_TRACEBACK", "0"),
    ("CYTHON_COMPRESS_STRINGS", "1"),  # names and signatures, by zlib: 29 kB less than by Cython's own compression
    ("CYTHON_PEP489_MULTI_PHASE_INIT", "0"),  # a module is made once, as is the extension: 28 kB less
    ("NDEBUG", "1"),  # Python's own flags have it, unless CFLAGS replaces them: without, 20 kB of assertions
]
FLAGS = ["-O2", "-fvect-cost-model=dynamic"]  # as fast as -O3, and a twelfth smaller
FLAGS += ["-ffp-contract=off"]  # fused multiply-adds would make aarch64 differ from x86-64
FLAGS += ["-DCYTHON_INLINE=CYTHON_UNUSED"]  # the compiler itself knows what is worth inlining: a sixth smaller, as fast
FLAGS += ["-fno-align-functions", "-fno-align-jumps", "-fno-align-loops"]  # as fast, 4 % smaller
FLAGS += ["-fstrict-overflow"]  # Python's own flags say that sums wrap around, which keeps loops from being vectors
FLAGS += ["-fno-math-errno", "-fno-trapping-math"]  # nobody asks for either: square roots without a call
FLAGS += ["-flto=auto", "-fno-fat-lto-objects"]  # what modules have alike is in it once: a fifteenth smaller, as fast
FLAGS += ["-g0", "-fno-asynchronous-unwind-tables", "-fno-unwind-tables"]  # a tenth smaller
FLAGS += ["-Wno-unused-function"]  # Cython's own decompressor
FLAGS += ["-fvisibility=hidden"]  # of each module only what makes it is asked for by name: 7 kB less
LINKED = ["-s", "-flto=auto", "-Wl,-z,noseparate-code"]
LINKED += ["-flto-partition=one"]  # divided into parts, GCC 12 leaves loops of some parts without vectors

# What takes little of a frame, or loses little by it, is made small instead: a quarter smaller, and a tenth slower;
# and what takes hardly any, smaller still.
SMALL, SMALLEST = "-Os", "-Oz"  # the latter is known to GCC from 12
LITTLE = {"coarse_motion"}
LEAST = {"_memoryviews", "alpha", "axis_bias", "baselines", "body_ahead", "circles", "coarse_circles", "columns"}
LEAST |= {"derotation", "driving", "edge_equations", "edge_expert", "edge_rows", "error_matrix", "feedback", "flow"}
LEAST |= {"flow_fit", "ground_speed", "group_motion", "heading", "hot_pixels", "image_plane", "key_frames", "leaps"}
LEAST |= {"least_squares", "line_expert", "normal_circles", "object_belief", "object_circles", "object_prediction"}
LEAST |= {"patch_circles", "patches", "path", "range_belief", "rebel_circles", "rebel_detection", "rebel_groups"}
LEAST |= {"rest", "sample_ring", "scene_records", "settings", "situation", "speed_change", "spread", "square_expert"}
LEAST |= {"stillness", "turmoil"}

# A changed declaration changes the layout of what other modules share: all are compiled anew.
_DECLARED = b"".join(path.read_bytes() for path in sorted(PACKAGE.rglob("*.pxd")))
_OF_THIS_BUILD = zlib.crc32(Path(__file__).read_bytes() + Cython.__version__.encode() + _DECLARED)
CACHE = Path("build/compiled", f"{_OF_THIS_BUILD:08x}")
OBJECTS = CACHE / f"{sysconfig.get_platform()}-{sys.implementation.cache_tag}"


class BuildOneExtension(build_ext):
    """Compiles in parallel, and only what has changed."""

    def build_extensions(self) -> None:
        """Compile and link; where there is no compiler or no Python.h, say so and leave it."""
        try:
            super().build_extensions()
        except (CCompilerError, ExecError, PlatformError, OSError) as error:
            if os.environ.get("LCF_EDGE_COMPILED") == "1":
                raise
            self.announce(
                f"lcf-edge: not compiled, so the filter is slow: install gcc and python3-dev ({error})", WARNING
            )
            self.extensions = []
            if wheel := self.distribution.command_obj.get("bdist_wheel"):
                wheel.root_is_pure, wheel.py_limited_api = True, False

    def build_extension(self, ext: Extension) -> None:
        """Compile what is newer than its object file, and link."""
        bootstrap, *modules = ext.sources
        asked = [*self.compiler.compiler_so, SMALLEST, "-E", "-xc", os.devnull]
        self.smallest = SMALLEST if subprocess.run(asked, capture_output=True, check=False).returncode == 0 else SMALL
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            ext.extra_objects = list(pool.map(lambda source: self._compiled(source, ext), modules))
        ext.sources = [bootstrap]
        self.force = True  # the check sums may have changed where no module did
        super().build_extension(ext)

    def _compiled(self, source: str, ext: Extension) -> str:
        made = OBJECTS / Path(source).with_suffix(".o")
        if not made.exists() or made.stat().st_mtime < Path(source).stat().st_mtime:
            stem = Path(source).stem
            small = [SMALL] if stem in LITTLE else [self.smallest] if stem in LEAST else []
            flags = ext.extra_compile_args + small
            self.compiler.compile([source], str(OBJECTS), ext.define_macros, extra_postargs=flags)
        return str(made)


def extensions() -> list[Extension]:
    """The one extension, or none. MODULES tells it what it holds, SOURCES which files that was made of."""
    declarations = sorted(PACKAGE.rglob("*.pxd"))
    beside = [path.with_suffix(".py") for path in declarations if path.with_suffix(".py").exists()]
    modules = {".".join(path.with_suffix("").parts): path for path in beside if not is_header(path.with_suffix(".pxd"))}
    if os.environ.get("LCF_EDGE_PURE") == "1" or not modules:
        return []
    stems = [path.stem for path in modules.values()]
    if twice := {stem for stem in stems if stems.count(stem) > 1}:
        raise SystemExit(f"setup.py: modules of one extension need names of their own: {', '.join(sorted(twice))}")
    translated = cythonize(
        [Extension(SHARED, []), *(Extension(name, [str(path)]) for name, path in modules.items())],
        build_dir=str(CACHE),
        compiler_directives=DIRECTIVES,
        shared_utility_qualified_name=SHARED,
        quiet=True,
    )
    sums = (f"{path.relative_to(PACKAGE)}:{zlib.crc32(path.read_bytes()):08x}" for path in (*declarations, *beside))
    return [
        Extension(
            EXTENSION,
            [BOOTSTRAP, *(source for each in translated for source in each.sources)],
            define_macros=[*MACROS, ("SOURCES", quoted(sums)), ("MODULES", quoted((SHARED, *modules)))],
            extra_compile_args=FLAGS,
            extra_link_args=LINKED,
            py_limited_api=True,
        )
    ]


def is_header(declaration: Path) -> bool:
    """Whether a .pxd has its functions' code itself."""
    return re.search(r"^cdef inline ", declaration.read_text(encoding="utf-8"), re.MULTILINE) is not None


def quoted(words: Iterable[str]) -> str:
    """A string of C."""
    return f'"{" ".join(words)}"'


def urls(place: dict[str, str]) -> dict[str, str]:
    """What PyPI's page leads to."""
    return {
        "Homepage": place["home"],
        "Documentation": place["files"] + "README.md#where-to-go-next",
        "Changelog": place["files"] + "CHANGELOG.md",
    }


def readme(place: dict[str, str]) -> str:
    """The README with links that lead somewhere from PyPI's page, where relative ones do not."""
    text = re.sub(
        r"(!\[[^\]]*\]\()(?!https:)", rf"\1{place['pictures']}", Path("README.md").read_text(encoding="utf-8")
    )
    return re.sub(r"((?<!!)\[[^\]]*\]\()(?!https:|#)", rf"\1{place['files']}", text)


PLACE = tomllib.loads(Path("pyproject.toml").read_text(encoding="utf-8"))["tool"]["lcf-edge"]
setup(
    project_urls=urls(PLACE),
    long_description=readme(PLACE),
    long_description_content_type="text/markdown",
    ext_modules=extensions(),
    cmdclass={"build_ext": BuildOneExtension},
    options={"bdist_wheel": {"py_limited_api": "cp311"}},
)
