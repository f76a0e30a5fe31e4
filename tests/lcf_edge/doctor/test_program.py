"""A remedy calls the program in a way that works."""

import shlex
import subprocess
from pathlib import Path

import pytest

from lcf_edge import __version__
from lcf_edge.doctor.configuration import context_of
from lcf_edge.doctor.program import program


@pytest.fixture
def environment(tmp_path: Path) -> Path:
    """An environment with the program in it."""
    script = tmp_path / "an environment" / "bin" / "lcf-edge"
    script.parent.mkdir(parents=True)
    script.touch(0o755)
    return script.parents[1]


def test_its_name_is_enough_where_the_system_has_it(environment: Path, tmp_path: Path) -> None:
    (tmp_path / "system").mkdir()
    (tmp_path / "system" / "lcf-edge").symlink_to(environment / "bin" / "lcf-edge")
    assert program(environment, f"{tmp_path}/system") == "lcf-edge"


def test_where_the_system_has_none_or_another_it_is_the_path(environment: Path, tmp_path: Path) -> None:
    path = f"'{tmp_path}/an environment/bin/lcf-edge'"
    assert program(environment, f"{tmp_path}/system") == path
    (tmp_path / "system").mkdir()
    (tmp_path / "system" / "lcf-edge").touch(0o755)
    assert program(environment, f"{tmp_path}/system") == path


@pytest.mark.parametrize("environment_has_it", [True, False])
def test_what_is_recommended_here_runs_in_an_empty_folder(tmp_path: Path, environment_has_it: bool) -> None:
    program_line = context_of(None, []).program if environment_has_it else program(tmp_path)
    done = subprocess.run(
        [*shlex.split(program_line), "--version"], cwd=tmp_path, env={}, check=True, capture_output=True, text=True
    )
    assert done.stdout == f"lcf-edge {__version__}\n"
