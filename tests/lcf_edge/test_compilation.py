"""The compiled extension: what it holds, that it gives the bytes of its Python, and when it is not used."""

import ast
import os
import platform
import re
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

from lcf_edge import compilation
from lcf_edge.compilation import examined, extension, sources, uncompiled
from release.trial import MAX_EXTENSION_KB
from tests.emulation import needs_the_processor

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "lcf_edge"

STAY_PYTHON = {"appearance": {"appearance"}}
"""Functions of compiled modules that are meant to stay Python: they allocate, and call the loops."""

DECLARATIONS = {path for path in PACKAGE.rglob("*.pxd") if path.with_suffix(".py").exists()}
PAIRS = {path for path in DECLARATIONS if not re.search(r"^cdef inline ", path.read_text("utf-8"), re.MULTILINE)}

needs_extension = pytest.mark.skipif(bool(uncompiled()), reason=uncompiled())


def in_another_process(code: str, **environment: str) -> str:
    done = subprocess.run(
        (sys.executable, "-c", code),
        env={**os.environ, **environment},
        cwd=ROOT,
        check=True,
        capture_output=True,
        text=True,
    )
    return done.stdout


# What is compiled


@needs_extension
def test_every_module_with_declarations_is_in_the_extension_and_comes_from_it() -> None:
    names = {".".join(path.relative_to(ROOT).with_suffix("").parts) for path in PAIRS}
    assert extension().modules == {*names, "lcf_edge._memoryviews"}
    assert {import_module(name).__file__ for name in names} == {extension().path}


@needs_extension
@pytest.mark.skipif(platform.machine() != "x86_64", reason="the size is that for x86-64")
def test_the_extension_is_so_small_that_the_one_for_64_bit_arm_stays_below_what_a_release_allows() -> None:
    larger_kb = 70.0  # its pages have 64 kB
    assert Path(str(extension().path)).stat().st_size / 1e3 + larger_kb < MAX_EXTENSION_KB


@pytest.mark.parametrize("declarations", sorted(PAIRS), ids=lambda path: path.stem)
def test_no_function_of_a_compiled_module_silently_stays_python(declarations: Path) -> None:
    declared = set(re.findall(r"^\s*(?:cdef|cpdef)\b[^(\n]*?(\w+)\(", declarations.read_text("utf-8"), re.MULTILINE))
    written = {
        node.name
        for node in ast.walk(ast.parse(declarations.with_suffix(".py").read_text("utf-8")))
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("__")
    }
    assert written - declared == STAY_PYTHON.get(declarations.stem, set())
    assert declared <= written


@pytest.mark.parametrize("declarations", sorted(DECLARATIONS), ids=lambda path: path.stem)
def test_a_compiled_module_is_plain_python_and_only_its_declarations_know_cython(declarations: Path) -> None:
    tree = ast.parse(declarations.with_suffix(".py").read_text("utf-8"))
    imported = {
        name.split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in [getattr(node, "module", None) or "", *(alias.name for alias in node.names)]
    }
    named = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    assert not {"cython", "Cython"} & (imported | named)


_MEMORY = f"""
from importlib import import_module
from pathlib import Path
import cv2, msgspec, numpy
import lcf_edge.config, lcf_edge.messages
def anonymous_kb():
    lines = Path("/proc/self/smaps_rollup").read_text().splitlines()
    return sum(int(line.split()[1]) for line in lines if line.startswith("Anonymous:"))
before = anonymous_kb()
for name in {sorted(".".join(path.relative_to(ROOT).with_suffix("").parts) for path in PAIRS)}:
    import_module(name)
print(anonymous_kb() - before)
"""


@needs_extension
@needs_the_processor("the emulator's own memory counts")
def test_the_extension_takes_less_than_2_mib_of_memory_besides_the_pages_of_its_file() -> None:
    """Those are the page cache's: shared by all processes, and given up when memory is short."""
    assert int(in_another_process(_MEMORY)) < 2048


# Compiled and not, it is the same


_APPEARANCE = """
import zlib, numpy as np
from lcf_edge.corners.appearance import appearance
random = np.random.default_rng(3)
image = random.integers(0, 256, (48, 64), np.uint8)
pixel = np.stack((random.integers(7, 57, 40), random.integers(7, 41, 40)), axis=1).astype(np.int32)
print(zlib.crc32(appearance(image, pixel).tobytes()))
"""

_PICTURES = """
import zlib, numpy as np
from lcf_edge.corners.image_quality import ImageQuality, sharpness
from lcf_edge.corners.repeats import Repeats
from lcf_edge.ego_motion.stillness import Stillness
random, repeats, quality, stillness = np.random.default_rng(3), Repeats(), ImageQuality(), Stillness(62, 45)
pixel = np.stack((random.integers(7, 55, 60), random.integers(7, 38, 60)), axis=1).astype(np.int32)
told = []
for frame in range(30):
    image = random.integers(0, 256, (45, 62), np.uint8) if frame % 3 else np.full((45, 62), 8 * frame, np.uint8)
    moved = pixel + np.array((frame // 20, 0), np.int32)
    told += [repeats.is_repeat(50_000_000 * frame, image), sharpness(image), quality.notes(image, 60)]
    told += [stillness.look(50_000_000 * frame, moved)]
print(told)
"""

_EGO_MOTION = """
import zlib, numpy as np
from drivers.samples import ImuSample, SpeedSample
from lcf_edge.config import Imu, Vehicle
from lcf_edge.ego_motion.estimator import EgoMotionEstimator
random, ego = np.random.default_rng(3), EgoMotionEstimator(Imu(), Vehicle())
outputs = []
for frame in range(60):
    for ms in range(0, 50, 5):
        stamp_ns, gyro, force = 50_000_000 * frame + 1_000_000 * ms, random.normal(0.01, 0.1, 3), random.normal(0, 1, 3)
        if frame % 20 < 18:  # then a gap
            ego.add_imu(ImuSample(stamp_ns, tuple(gyro.tolist()), tuple((force - (0, 9.81, 0)).tolist())))
        if ms % 20 == 0 and frame % 30 < 20:
            ego.add_speed(SpeedSample(stamp_ns, frame // 10 % 2, float(gyro[1])))
    motion = ego.advance(50_000_000 * frame, frame % 10 == 0)
    ego.correct(random.normal(0, 1e-3, 3), np.full(3, 1e-3), 0.5)
    outputs += [motion.rotation.tobytes(), repr((motion.rotation_sigma_rad, motion.speed_mps, motion.notes)).encode()]
print(zlib.crc32(b"".join(outputs)))
"""


@needs_extension
@pytest.mark.parametrize("code", [_APPEARANCE, _PICTURES, _EGO_MOTION], ids=["appearance", "pictures", "ego-motion"])
def test_uncompiled_gives_the_same_bytes(code: str) -> None:
    assert in_another_process(code) == in_another_process(code, LCF_EDGE_PURE="1")


def test_it_can_be_asked_to_run_uncompiled_and_says_so() -> None:
    code = (
        "from lcf_edge import compilation; from lcf_edge.corners import appearance; "
        "print(appearance.__file__); print(compilation.uncompiled())"
    )
    file, output = in_another_process(code, LCF_EDGE_PURE="1").splitlines()
    assert file == str(PACKAGE / "corners/appearance.py")
    assert output == (
        f"the filter runs uncompiled, about {compilation.SLOWER} times slower: "
        "LCF_EDGE_PURE is set; unset LCF_EDGE_PURE"
    )


# When it is not used


def test_an_extension_of_other_sources_is_never_used() -> None:
    made_of = "a.py:00000001 a.pxd:00000002"
    same = {"a.py": "00000001", "a.pxd": "00000002"}
    used = examined("_compiled.so", "lcf_edge.a", made_of, same)
    assert (used.path, used.modules, used.reason) == ("_compiled.so", {"lcf_edge.a"}, "")
    for other in ({**same, "a.py": "00000009"}, {**same, "b.pxd": "1"}, {"a.py": "00000001"}):
        left = examined("_compiled.so", "lcf_edge.a", made_of, other)
        assert (left.path, left.modules, left.outdated) == ("", frozenset(), True)
        assert "changed since it was compiled" in left.reason
        assert left.command.startswith("make compile")


@needs_extension
def test_a_changed_source_runs_as_it_stands(tmp_path: Path) -> None:
    copy = tmp_path / "lcf_edge"
    copy.mkdir()
    for name in ("__init__.py", "compilation.py", Path(extension().path).name, *sources()):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_bytes((PACKAGE / name).read_bytes())
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); "
        "import lcf_edge.corners.appearance as module; from lcf_edge.compilation import uncompiled; "
        "print(module.__file__, module.BORDER_PX, uncompiled())"
    )
    assert in_another_process(code) == f"{copy / Path(extension().path).name} 7 \n"
    changed = copy / "corners/appearance.py"
    changed.write_text(changed.read_text("utf-8").replace("BORDER_PX = 7", "BORDER_PX = 8"), encoding="utf-8")
    output = in_another_process(code)
    assert output.startswith(f"{changed} 8 the filter runs uncompiled")
    assert "corners/appearance.py changed since it was compiled" in output


def test_the_sources_are_declarations_and_the_modules_beside_them() -> None:
    assert {"corners/appearance.py", "corners/appearance.pxd"} <= set(sources())
    assert {name.rpartition(".")[2] for name in sources()} == {"py", "pxd"}


# The build


def test_make_installs_what_builds_it_as_the_project_asks_for() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    makefile = (ROOT / "Makefile").read_text("utf-8")
    assert [need for need in project["build-system"]["requires"] if f'"{need}"' not in makefile] == []


@pytest.mark.skipif(not (ROOT / "build/compiled").exists(), reason="translating all modules takes a minute")
def test_where_cflags_replaces_pythons_own_flags_the_extension_is_compiled_as_elsewhere(tmp_path: Path) -> None:
    compiler = tmp_path / "cc"
    compiler.write_text(f'#!/bin/sh\necho "$*" >> {tmp_path}/told\nexit 1\n', encoding="ascii")
    compiler.chmod(0o755)
    environment = {name: value for name, value in os.environ.items() if name != "LCF_EDGE_COMPILED"}
    subprocess.run(
        (sys.executable, "setup.py", "--quiet", "build_ext", "--build-lib", tmp_path, "--build-temp", tmp_path),
        env={**environment, "CC": str(compiler), "CFLAGS": "-Iheaders"},
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    calls = (tmp_path / "told").read_text(encoding="utf-8").splitlines()
    told = next(call for call in calls if " -c " in call).split()
    assert {"-Iheaders", "-DNDEBUG=1", "-fstrict-overflow", "-O2"} <= set(told)
