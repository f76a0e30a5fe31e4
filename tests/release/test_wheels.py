"""What is released is whole, and what the trial of a wheel compares. The trial itself is ``make wheels``."""

import os
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from release import wheels
from release.debian import MACHINES, ReleaseError, run
from release.manual import COMPLETIONS, MANUAL
from release.trial import extension_kb, results

ROOT = Path(__file__).parents[2]
PACKAGES = ("lcf_edge", "drivers")


def files() -> set[str]:
    """Of the packages, without what is built."""
    found = (path for name in PACKAGES for path in (ROOT / name).rglob("*") if path.is_file())
    return {str(path.relative_to(ROOT)) for path in found if "__pycache__" not in path.parts and path.suffix != ".so"}


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source package, unpacked."""
    place = tmp_path_factory.mktemp("source")
    with tarfile.open(wheels.source_package(place)) as archive:
        archive.extractall(place, filter="data")
    return next(path for path in place.iterdir() if path.is_dir())


def test_the_source_package_is_whole(source: Path) -> None:
    others = {"setup.py", "pyproject.toml", "Makefile", "README.md", "CHANGELOG.md", "LICENSE", "docs/install.md"}
    others |= {"SECURITY.md", "Containerfile", ".containerignore"}
    others |= {"tests/conftest.py", "hil_mocks/serial_imu.py", "benchmarks/run.py", "release/wheels.py"}
    others |= {"systemd/lcf-edge.service"}
    packed = {str(path.relative_to(source)) for path in source.rglob("*")}
    assert (files() | others) - packed == set()
    assert [name for name in packed if name.endswith((".so", ".pyc"))] == []


def test_a_wheel_holds_every_file_of_the_packages_but_the_extensions_own_c_and_nothing_else(source: Path) -> None:
    options = ("--quiet", "--no-build-isolation", "--no-deps", "--wheel-dir", str(source / "built"))
    run(
        *(sys.executable, "-m", "pip", "wheel", *options, "."),
        folder=source,
        environment={**os.environ, "LCF_EDGE_PURE": "1", "LCF_EDGE_COMPILED": ""},
    )
    (wheel,) = (source / "built").iterdir()
    with zipfile.ZipFile(wheel) as archive:
        packed = {name for name in archive.namelist() if ".dist-info/" not in name}
    shared = {name for name in packed if ".data/data/share/" in name}
    packed -= shared
    assert packed == files() - {"lcf_edge/_compiled.c"}
    assert {name.partition("/data/share/")[2] for name in shared} == {MANUAL, *COMPLETIONS.values()}
    assert wheel.name.endswith("-py3-none-any.whl")  # nothing was compiled, and it says so


@pytest.mark.parametrize("extensions", [0, 2])
def test_a_wheel_without_the_one_extension_is_refused(tmp_path: Path, extensions: int) -> None:
    with zipfile.ZipFile(tmp_path / "one.whl", "w") as archive:
        for number in range(extensions):
            archive.writestr(f"lcf_edge/{number}.abi3.so", bytes(1000))
    with pytest.raises(ReleaseError, match=f"one.whl: {extensions} extensions"):
        extension_kb(tmp_path / "one.whl")


def test_results_are_compared_without_their_times(tmp_path: Path) -> None:
    (tmp_path / "results.jsonl").write_text('{"seq": 1, "timing_us": {"total": 9}}\n', encoding="utf-8")
    assert list(results(tmp_path / "results.jsonl")) == [{"seq": 1}]


def test_each_machine_is_cross_compiled_by_its_own_compiler() -> None:
    assert {name: machine.gcc for name, machine in MACHINES.items()} == {
        "x86_64": "x86_64-linux-gnu-gcc",
        "aarch64": "aarch64-linux-gnu-gcc",
    }
    assert all(machine.gcc in machine.tools for machine in MACHINES.values())


def test_a_machine_for_which_there_is_no_wheel_is_refused_in_one_line() -> None:
    done = subprocess.run(
        (sys.executable, "-m", "release.wheels", "riscv64"), cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert done.stderr == "wheels: riscv64: no wheel is made for it; one of x86_64, aarch64\n"


def test_a_step_that_fails_tells_its_last_words() -> None:
    with pytest.raises(ReleaseError, match="exit status 3: why it failed"):
        run("sh", "-c", "echo why it failed >&2; exit 3")
