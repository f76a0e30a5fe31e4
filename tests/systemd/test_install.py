"""What `make install` and `make uninstall` put into a system and leave there."""

import os
import shutil
import stat
import subprocess
from pathlib import Path

import pytest

from lcf_edge.config import Config, load
from release.manual import COMPLETIONS, MANUAL

ROOT = Path(__file__).parents[2]
SHIPPED = ROOT / "systemd"
CONFIGURATION = "etc/lcf-edge/config.toml"
INSTALLED = {
    "etc/systemd/system/lcf-edge.service": "lcf-edge.service",
    "etc/systemd/system/lcf-edge@.service": "lcf-edge@.service",
    "etc/systemd/system/lcf-edge-gate.service": "lcf-edge-gate.service",
    "etc/udev/rules.d/70-lcf-edge.rules": "70-lcf-edge.rules",
    "etc/sysusers.d/lcf-edge.conf": "lcf-edge.sysusers",
    "etc/modules-load.d/lcf-edge.conf": "lcf-edge.modules",
    CONFIGURATION: "config.toml",
}
SHARED = {f"usr/local/share/{path}": ROOT / "share" / path for path in (MANUAL, *COMPLETIONS.values())}

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="no make here")


def make(*arguments: str) -> str:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    done = subprocess.run(
        ("make", *arguments), cwd=ROOT, check=True, capture_output=True, text=True, env=environment, umask=0o077
    )
    return done.stdout


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def image(tmp_path: Path) -> Path:
    """An image into which all but the program was installed."""
    make("install", "FILES_ONLY=1", f"DESTDIR={tmp_path}")
    return tmp_path


def test_every_file_comes_to_its_place_whatever_the_umask(image: Path) -> None:
    paths = {place: SHIPPED / name for place, name in INSTALLED.items()} | SHARED
    assert files(image) == {place: path.read_bytes() for place, path in paths.items()}
    assert {stat.S_IMODE((image / place).stat().st_mode) for place in paths} == {0o644}
    assert stat.S_IMODE((image / "etc/lcf-edge").stat().st_mode) == 0o755


def test_nothing_is_left_to_be_made_at_the_start_so_the_root_may_be_read_only(image: Path) -> None:
    state = image / "var/lib/lcf-edge"
    assert state.readlink() == Path("private/lcf-edge")
    assert state.is_dir()
    assert stat.S_IMODE((image / "var/lib/private").stat().st_mode) == 0o700


def test_a_second_time_changes_nothing_and_keeps_the_configuration(image: Path) -> None:
    (image / CONFIGURATION).write_text("[camera]\nfps = 30.0\n", encoding="utf-8")
    before = files(image)
    make("install", "FILES_ONLY=1", f"DESTDIR={image}")
    assert files(image) == before
    assert list((image / "var/lib/private/lcf-edge").iterdir()) == []


def test_uninstall_leaves_configuration_and_recordings(image: Path) -> None:
    (image / "var/lib/lcf-edge/drive.mcap").touch()
    (image / "opt/lcf-edge/bin").mkdir(parents=True)
    make("uninstall", f"DESTDIR={image}")
    assert set(files(image)) == {CONFIGURATION, "var/lib/private/lcf-edge/drive.mcap"}
    assert not (image / "opt/lcf-edge").exists()
    make("uninstall", f"DESTDIR={image}")  # nothing there is no error


def test_purge_leaves_nothing(image: Path) -> None:
    for unit in ("lcf-edge", "lcf-edge@", "lcf-edge@front", "lcf-edge-gate"):
        drop_in = image / f"etc/systemd/system/{unit}.service.d/override.conf"
        drop_in.parent.mkdir()
        drop_in.touch()
    recorded = image / "var/lib/private/lcf-edge-front/drive.mcap"
    recorded.parent.mkdir()
    recorded.touch()
    (image / "etc/lcf-edge/front.toml").touch()
    make("uninstall", "PURGE=1", f"DESTDIR={image}")
    assert files(image) == {}
    assert not (image / "var/lib/lcf-edge").is_symlink()


def test_the_program_is_an_environment_of_its_own_with_a_command_on_the_path() -> None:
    plan = make("install", "--dry-run", "PYTHON=python3.11")
    assert 'umask 022; python3.11 -m venv "/opt/lcf-edge"' in plan
    assert '"/opt/lcf-edge/bin/python" -m pip install' in plan
    assert 'ln -sfn /opt/lcf-edge/bin/lcf-edge "/usr/local/bin/lcf-edge"' in plan


def test_a_wheel_takes_the_place_of_the_source() -> None:
    plan = make("install", "--dry-run", "WHEEL=dist/one.whl")
    assert 'pip install --quiet --disable-pip-version-check --no-deps "dist/one.whl"' in plan
    assert "mktemp" not in plan
    assert "mktemp" in make("install", "--dry-run")


@pytest.mark.parametrize("destination", ["image", "/image/"])
def test_an_image_knows_nothing_of_where_it_was_made_and_the_running_system_is_left_alone(destination: str) -> None:
    folder = "/image" if destination == "/image/" else f"{ROOT}/image"
    plan = make("install", "--dry-run", f"DESTDIR={destination}")
    assert f'sed -i "s|{folder}/|/|g"' in plan
    assert "systemd-sysusers" not in plan
    assert f'if test -z "{folder}" -a -d /run/systemd/system; then' in plan


@pytest.mark.parametrize("destination", ["", "/"])
def test_without_an_image_it_is_this_system(destination: str) -> None:
    plan = make("install", "--dry-run", f"DESTDIR={destination}")
    assert "systemd-sysusers lcf-edge.conf" in plan
    assert 'if test -z "" -a -d /run/systemd/system; then' in plan
    assert "sed -i" not in plan


def test_the_shipped_configuration_is_that_of_a_system_without_one() -> None:
    assert load(SHIPPED / "config.toml") == Config()


def test_what_it_suggests_is_valid(tmp_path: Path) -> None:
    text = (SHIPPED / "config.toml").read_text(encoding="utf-8")
    lines = [line.removeprefix("# ") if line.startswith("# ") and " = " in line else line for line in text.splitlines()]
    suggested = tmp_path / "config.toml"
    suggested.write_text("\n".join(lines), encoding="utf-8")
    config = load(suggested)
    assert (config.camera.fps, config.imu.bus, config.vehicle.speed_mps) == (30.0, 1, 1.0)
    assert config.camera.intrinsics
    assert config.imu.axes


def test_the_document_names_every_place_and_variable() -> None:
    text = (ROOT / "docs/install.md").read_text(encoding="utf-8")
    places = (*INSTALLED, "opt/lcf-edge", "usr/local/bin/lcf-edge")
    assert [place for place in places if f"`/{place}`" not in text] == []
    assert [name for name in ("PYTHON", "DESTDIR", "WHEEL", "FILES_ONLY", "PURGE") if f"{name}=" not in text] == []
