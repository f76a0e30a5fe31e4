"""The Debian package: what is in it, where, and whether Debian's own checker has anything to say.

The program in it is a small one here. That it installs and what it leaves is tried by ``make deb``.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from hil_mocks.small_wheel import wheel_of
from lcf_edge import __version__
from release import deb
from release.bundle import PYTHONS
from release.debian import MACHINES, run
from release.foreign_pip import command_for

ROOT = Path(__file__).parents[2]
PLACE = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["lcf-edge"]
HERE = MACHINES["x86_64"]
THIS_PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"

needs_tools = pytest.mark.skipif(
    not all(map(shutil.which, ("make", "dpkg-deb", "dpkg-architecture", "dh_builddeb"))) or os.geteuid() != 0,
    reason="no debhelper here, or not root",
)


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.fixture
def package(tmp_path: Path) -> Path:
    wheel = wheel_of(tmp_path / "built", __version__)
    (tmp_path / "wheels").mkdir()
    return deb.pack(HERE, wheel, tmp_path / "wheels", tmp_path / "dist", ("-Zxz", "-z0"))


@needs_tools
def test_what_make_install_puts_into_a_system_is_where_packages_have_it(package: Path, tmp_path: Path) -> None:
    assert package.name == f"lcf-edge_{__version__}_amd64.deb"
    root = tmp_path / "root"
    run("dpkg-deb", "--extract", str(package), str(root))
    found = {str(path.relative_to(root)) for path in root.rglob("*") if not path.is_dir()}
    assert {
        "etc/lcf-edge/config.toml",
        "usr/bin/lcf-edge",
        "usr/lib/modules-load.d/lcf-edge.conf",
        "usr/lib/systemd/system/lcf-edge-gate.service",
        "usr/lib/systemd/system/lcf-edge.service",
        "usr/lib/systemd/system/lcf-edge@.service",
        "usr/lib/sysusers.d/lcf-edge.conf",
        "usr/lib/udev/rules.d/70-lcf-edge.rules",
        "usr/share/bash-completion/completions/lcf-edge",
        "usr/share/doc/lcf-edge/CHANGELOG.md",
        "usr/share/doc/lcf-edge/changelog.gz",
        "usr/share/doc/lcf-edge/copyright",
        "usr/share/doc/lcf-edge/docs/install.md",
        "usr/share/doc/lcf-edge/examples/foxglove_layout.json",
        "usr/share/doc/lcf-edge/examples/network/zenoh.json5",
        "usr/share/fish/vendor_completions.d/lcf-edge.fish",
        "usr/share/man/man1/lcf-edge.1.gz",
        "usr/share/zsh/vendor-completions/_lcf-edge",
    } <= found
    assert {name.split("/")[0] for name in found} == {"etc", "usr"}
    assert [name for name in found if name.startswith("usr/local/")] == []
    assert (root / "usr/bin/lcf-edge").readlink() == Path("../lib/lcf-edge/bin/lcf-edge")
    for unit in (root / "usr/lib/systemd/system").iterdir():
        told = unit.read_text(encoding="utf-8")
        assert "/opt/" not in told
        assert "ExecStart=/usr/lib/lcf-edge/bin/lcf-edge " in told
    assert run("dpkg-deb", "--info", str(package), "conffiles").split() == ["/etc/lcf-edge/config.toml"]


@needs_tools
def test_it_is_for_the_pythons_whose_packages_it_has(package: Path) -> None:
    needed = run("dpkg-deb", "--field", str(package), "Depends")
    assert f"python3 (>= {PYTHONS[0]}), python3 (<< 3.{int(PYTHONS[-1].split('.')[1]) + 1})" in needed


@needs_tools
def test_one_for_another_processor_is_packed_here(tmp_path: Path) -> None:
    (tmp_path / "wheels").mkdir()
    wheel = wheel_of(tmp_path / "built", __version__)
    package = deb.pack(MACHINES["aarch64"], wheel, tmp_path / "wheels", tmp_path / "dist", ("-Zxz", "-z0"))
    assert run("dpkg-deb", "--field", str(package), "Architecture").strip() == "arm64"


@needs_tools
@pytest.mark.skipif(shutil.which("lintian") is None, reason="no lintian here")
def test_lintian_has_nothing_to_say(package: Path) -> None:
    deb.check(package)


@pytest.mark.skipif(THIS_PYTHON not in PYTHONS, reason="of another Python than a package has")
def test_a_python_finds_what_fits_all_and_what_fits_it_alone(tmp_path: Path) -> None:
    common = wheel_of(tmp_path / "built", "1.0")
    place = tmp_path / "environment"
    deb.environment("x86_64", [common], place)
    (place / f"lib/python{THIS_PYTHON}/site-packages/mine.py").touch()
    (place / "bin/python3").unlink()
    (place / "bin/python3").symlink_to(sys.executable)
    (place / "pyvenv.cfg").write_text(f"home = {Path(sys.executable).resolve().parent}\n", encoding="utf-8")
    command = (place / "bin/python", "-P", "-c", "import lcf_edge, mine; lcf_edge.main()")
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert done.stdout == "lcf-edge 1.0\n"


def test_its_command_is_the_program(tmp_path: Path) -> None:
    command = tmp_path / "lcf-edge"
    command.write_text(command_for(sys.executable))
    command.chmod(0o755)
    assert run(str(command), "--version") == f"lcf-edge {__version__}\n"


def test_a_wheels_name_tells_whether_it_fits_one_python_or_all() -> None:
    names = {
        "numpy-2.5.5-cp313-cp313-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl": "3.13",
        "eclipse_zenoh-1.10.2-cp39-abi3-manylinux_2_17_x86_64.manylinux2014_x86_64.whl": "",
        "pyserial-3.5-py2.py3-none-any.whl": "",
    }
    assert {name: deb.python_of(Path(name)) for name in names} == names


def test_the_licences_of_all_that_is_in_it_are_told() -> None:
    locked = re.findall(r"^([a-z0-9-]+)==\S+ (?!; sys_platform == 'win32')", text("requirements.lock"), re.MULTILINE)
    assert len(locked) > 20
    told = text("debian/copyright")
    assert [name for name in locked if f"Comment: the package {name} of PyPI\n" not in told] == []


def test_version_and_addresses_are_the_projects() -> None:
    assert text("debian/changelog").startswith(f"lcf-edge ({__version__}) ")
    control = text("debian/control")
    assert f"Homepage: {PLACE['home']}\n" in control
    (maintainer,) = re.findall(r"^Maintainer: (.+)$", control, re.MULTILINE)
    assert f" -- {maintainer}  " in text("debian/changelog")
    assert f"Upstream-Contact: {maintainer}\n" in text("debian/copyright")


def test_the_document_tells_the_commands() -> None:
    told = text("docs/install.md")
    for command in ("sudo make deb", "sudo apt install ./lcf-edge_*.deb", "apt remove lcf-edge", "apt purge lcf-edge"):
        assert command in told
