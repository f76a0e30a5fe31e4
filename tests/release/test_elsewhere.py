"""Where the tests find another Python. That they pass with it is ``make test-all`` and ``make test-arm64``."""

import os
import platform
import sys
from pathlib import Path

import pytest
from hypothesis import settings

from release import elsewhere
from release.debian import MACHINES, Machine, ReleaseError

THIS = f"{sys.version_info.major}.{sys.version_info.minor}"


@pytest.fixture
def here() -> Machine:
    """This computer's processor."""
    return MACHINES[platform.machine()]


@pytest.fixture
def other() -> Machine:
    """The other one."""
    return next(machine for machine in MACHINES.values() if not machine.is_this)


def test_a_python_that_this_computer_has_is_taken(here: Machine) -> None:
    python = elsewhere.find(here, THIS)
    assert python.root is None
    assert Path(python.program).name == f"python{THIS}"


@pytest.mark.parametrize(("version", "suite"), [("3.11", "bookworm"), ("3.13", "trixie"), ("3.14", "forky")])
def test_another_processors_is_that_of_the_debian_that_has_it(
    other: Machine, version: str, suite: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        elsewhere, "unpacked", lambda machine, suite, packages, *_: Path(machine.debian, suite, packages[0])
    )
    assert elsewhere.find(other, version).root == Path(other.debian, suite, "python3")


def test_one_that_is_nowhere_is_reported_and_the_others_go_on(here: Machine, tmp_path: Path) -> None:
    with pytest.raises(ReleaseError, match=r"no python3\.99 on this computer"):
        elsewhere.find(here, "3.99")
    assert elsewhere._tested(here, "3.99", tmp_path, ()).startswith("not tested: there is no python3.99")


@pytest.mark.parametrize(("value", "status"), [(1, 0), (2, 1)], ids=["passes", "fails"])
def test_what_is_tested_is_the_project_with_its_packages(
    here: Machine, tmp_path: Path, value: int, status: int
) -> None:
    (tmp_path / "project.py").write_text("VALUE = 1\n")
    (tmp_path / "test_it.py").write_text(f"import project\ndef test_it(): assert project.VALUE == {value}\n")
    packages = Path(pytest.__file__).parents[1]
    assert elsewhere.Python(THIS, sys.executable).test(here, packages, tmp_path, ("-q", "test_it.py")) == status


def test_an_emulated_processor_is_asked_for_fewer_examples(other: Machine, tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text(
        "from hypothesis import settings\nsettings.register_profile('emulated', max_examples=7)\n"
    )
    (tmp_path / "test_it.py").write_text(
        "from hypothesis import settings\ndef test_it(): assert settings().max_examples == 7\n"
    )
    packages = Path(pytest.__file__).parents[1]
    assert elsewhere.Python(THIS, sys.executable).test(other, packages, tmp_path, ("-q", "test_it.py")) == 0
    assert settings.get_profile("emulated").max_examples < settings.get_profile("lcf-edge").max_examples


def test_what_the_tests_need_is_what_the_project_says() -> None:
    needed = {requirement.split(">")[0] for requirement in elsewhere._requirements()}
    assert {"numpy", "aiohttp", "foxglove-sdk", "av", "distributed", "pytest", "hypothesis"} <= needed
    assert not any(name.startswith("lcf-edge") for name in needed)


def test_a_package_that_is_published_as_source_alone_becomes_a_wheel_first(
    other: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps = []

    def do(*command: str) -> str:
        steps.append(command)
        if "install" in command:
            Path(command[command.index("--target") + 1]).mkdir()
        return ""

    monkeypatch.setattr(elsewhere, "run", do)
    monkeypatch.setenv("LCF_EDGE_RELEASE_CACHE", str(tmp_path))
    elsewhere.packages(other, "3.13")
    wheel, install = steps
    assert [need.split(">")[0] for need in wheel if ">" in need] == list(elsewhere.WITHOUT_A_WHEEL)
    assert "--only-binary=:all:" in install
    assert install[install.index("--find-links") + 1] == wheel[wheel.index("--wheel-dir") + 1]


def test_an_unpacked_debian_has_the_users_groups_and_names_of_an_installed_one(tmp_path: Path) -> None:
    masters = tmp_path / "usr/share/base-passwd"
    masters.mkdir(parents=True)
    (tmp_path / "etc").mkdir()
    (masters / "passwd.master").write_text("root::0:0:root:/root:/bin/bash\n")
    (masters / "group.master").write_text("video:*:44:\n")
    elsewhere._set_up(tmp_path)
    held = {path.name: path.read_text().split(":")[0].split() for path in (tmp_path / "etc").iterdir()}
    assert held == {"passwd": ["root"], "group": ["video"], "hosts": ["127.0.0.1", "localhost"]}


@pytest.mark.skipif(os.geteuid() == 0, reason="root may do it")
def test_without_root_it_says_what_to_do(capsys: pytest.CaptureFixture[str]) -> None:
    assert elsewhere.main(["aarch64", "3.13"]) == 1
    assert "(sudo make test-" in capsys.readouterr().err


def test_byte_code_is_made_ahead_with_the_names_that_it_has_there_and_what_fails_is_left(tmp_path: Path) -> None:
    (tmp_path / "whole.py").write_text("def where(): raise ValueError\n")
    (tmp_path / "of_python_2.py").write_text("print 'old'\n")
    elsewhere.compile_ahead(sys.executable, tmp_path, "/project")
    (made,) = tmp_path.glob("__pycache__/*.pyc")
    assert made.name == f"whole.{sys.implementation.cache_tag}.pyc"
    assert b"/project/whole.py" in made.read_bytes()
    assert str(tmp_path).encode() not in made.read_bytes()
