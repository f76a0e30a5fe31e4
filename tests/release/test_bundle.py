"""The archive for vehicles without a network: what is in it, and what its setup does to a system and keeps.

The program in it is a small one here.
"""

import ensurepip
import hashlib
import os
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from hil_mocks.small_wheel import wheel_of
from release import bundle
from release.debian import MACHINES, ReleaseError

ROOT = Path(__file__).parents[2]
HERE = os.uname().machine
CONFIGURATION = "etc/lcf-edge/config.toml"
DRIVE = "var/lib/private/lcf-edge/drive.mcap"
UNIT = "etc/systemd/system/lcf-edge.service"
Pack = Callable[..., Path]

pytestmark = pytest.mark.skipif(
    shutil.which("make") is None or not any(Path(ensurepip.__file__).parent.glob("_bundled/pip-*.whl")),
    reason="no make, or no pip in this Python",
)


@pytest.fixture
def pack(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Pack:
    """An archive of that version, unpacked: the folder with its setup."""
    monkeypatch.setattr(bundle, "PYTHONS", (f"{sys.version_info.major}.{sys.version_info.minor}",))

    def make(version: str, machine: str = HERE) -> Path:
        wheels = tmp_path / f"wheels-{version}"
        wheels.mkdir(exist_ok=True)
        (pip,) = Path(ensurepip.__file__).parent.glob("_bundled/pip-*.whl")
        shutil.copy(pip, wheels)
        wheel = wheel_of(tmp_path / "built", version)
        archive = bundle.pack(machine, wheel, wheels, "", tmp_path / "dist")
        with tarfile.open(archive) as packed:
            packed.extractall(tmp_path / "unpacked", filter="data")
        return tmp_path / "unpacked" / archive.stem

    return make


def setup(place: Path, image: Path, *arguments: str, status: int = 0) -> str:
    """What a setup says."""
    environment = {**os.environ, "DESTDIR": str(image), "PYTHON": sys.executable}
    done = subprocess.run(
        (place / "setup", *arguments), check=False, capture_output=True, text=True, env=environment, umask=0o077
    )
    assert done.returncode == status, done.stderr
    return done.stdout + done.stderr


def version_in(image: Path) -> str:
    """Of the current program, as its own Python says it."""
    python = image / "opt/lcf-edge/bin/python"
    command = (python, "-P", "-c", "import lcf_edge; lcf_edge.main()")
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def image(tmp_path: Path) -> Path:
    (tmp_path / "image").mkdir()
    return tmp_path / "image"


def test_one_command_installs_what_make_install_does(pack: Pack, image: Path, tmp_path: Path) -> None:
    assert "is installed" in setup(pack("1.0"), image)
    assert version_in(image) == "lcf-edge 1.0"
    other = tmp_path / "made"
    subprocess.run(("make", "install", "FILES_ONLY=1", f"DESTDIR={other}"), cwd=ROOT, check=True, capture_output=True)
    made = {path.relative_to(other): path for path in other.rglob("*") if path.is_file()}
    assert len(made) >= len(("unit", "rules", "groups", "modules", "configuration"))
    for name, path in made.items():
        assert (image / name).read_bytes() == path.read_bytes()
        assert (image / name).stat().st_mode == path.stat().st_mode
    command = image / "usr/local/bin/lcf-edge"
    assert command.readlink() == Path("/opt/lcf-edge/bin/lcf-edge")
    assert str(image) not in (image / "opt/lcf-edge/bin/lcf-edge").read_text(encoding="utf-8")
    assert (image / "opt/lcf-edge/doc/docs/install.md").is_file()
    assert (image / "opt/lcf-edge/doc/examples/network/zenoh.json5").is_file()


def test_an_upgrade_keeps_configuration_and_recordings_and_the_version_before(pack: Pack, image: Path) -> None:
    setup(pack("1.0"), image)
    (image / CONFIGURATION).write_text("[camera]\nfps = 30.0\n", encoding="utf-8")
    (image / DRIVE).touch()
    for version in ("2.0", "3.0"):
        setup(pack(version), image)
        assert version_in(image) == f"lcf-edge {version}"
    assert (image / CONFIGURATION).read_text(encoding="utf-8") == "[camera]\nfps = 30.0\n"
    assert (image / DRIVE).exists()
    kept = {path.name.split("-")[0] for path in (image / "opt/lcf-edge-versions").iterdir()}
    assert kept == {"2.0", "3.0", "previous"}


def test_back_is_the_version_before_with_its_own_unit_and_back_again_is_the_new_one(pack: Pack, image: Path) -> None:
    setup(pack("1.0"), image)
    newer = pack("2.0")
    (newer / "system" / UNIT).write_text("[Unit]\n", encoding="ascii")
    (newer / "system/etc/udev/rules.d/71-new.rules").touch()
    setup(newer, image)
    assert (image / UNIT).read_text(encoding="ascii") == "[Unit]\n"
    installed = image / "opt/lcf-edge"
    assert "1.0-" in setup(installed, image, "rollback")
    assert version_in(image) == "lcf-edge 1.0"
    assert (image / UNIT).read_bytes() == (ROOT / "systemd/lcf-edge.service").read_bytes()
    assert not (image / "etc/udev/rules.d/71-new.rules").exists()
    setup(installed, image, "rollback")
    assert version_in(image) == "lcf-edge 2.0"


def test_without_a_version_before_there_is_no_way_back(pack: Pack, image: Path) -> None:
    setup(pack("1.0"), image)
    assert "there is no version before 1.0-" in setup(image / "opt/lcf-edge", image, "rollback", status=1)
    assert version_in(image) == "lcf-edge 1.0"


def test_removed_configuration_and_recordings_stay_and_purged_nothing_does(pack: Pack, image: Path) -> None:
    place = pack("1.0")
    setup(place, image)
    (image / DRIVE).touch()
    setup(image / "opt/lcf-edge", image, "remove")
    left = {str(path.relative_to(image)) for path in image.rglob("*") if path.is_file() or path.is_symlink()}
    assert left == {CONFIGURATION, DRIVE, "var/lib/lcf-edge"}
    setup(place, image)
    setup(image / "opt/lcf-edge", image, "remove", "--purge")
    assert [path for path in image.rglob("*") if path.is_file() or path.is_symlink()] == []


def test_a_package_that_was_changed_is_refused_and_the_version_that_runs_stays(pack: Pack, image: Path) -> None:
    setup(pack("1.0"), image)
    changed = pack("2.0")
    wheel = wheel_of(changed / "wheels", "2.0")
    with zipfile.ZipFile(wheel, "a") as archive:
        archive.writestr("lcf_edge/more.py", "")
    assert "DO NOT MATCH THE HASHES" in setup(changed, image, status=1)
    assert version_in(image) == "lcf-edge 1.0"
    assert len(list((image / "opt/lcf-edge-versions").iterdir())) == 1


def test_a_folder_of_make_install_another_processor_and_another_python_are_refused_in_one_line(
    pack: Pack, image: Path
) -> None:
    place = pack("1.0")
    (place / "pythons").write_text("3.9\n3.10\n", encoding="ascii")
    assert "this archive is for Python 3.9 3.10 and" in setup(place, image, status=1)
    (place / "machine").write_text("riscv64\n", encoding="ascii")
    assert setup(place, image, status=1).startswith("lcf-edge: this archive is for riscv64 and this computer is")
    (image / "opt/lcf-edge").mkdir(parents=True)
    output = setup(place, image, status=1)
    assert "comes from make install; first run sudo make uninstall" in output
    assert output.count("\n") == 1


def test_the_debian_package_is_left_alone(pack: Pack, image: Path) -> None:
    (image / "usr/lib/lcf-edge").mkdir(parents=True)
    told = setup(pack("1.0"), image, status=1)
    assert told.startswith("lcf-edge: the Debian package is installed; first run sudo apt remove lcf-edge")
    assert told.count("\n") == 1
    make = ("make", "install-program", f"DESTDIR={image}")
    done = subprocess.run(make, cwd=ROOT, check=False, capture_output=True, text=True)
    assert done.returncode != 0
    assert done.stderr.startswith("the Debian package is installed: sudo apt remove lcf-edge\n")


def test_make_install_leaves_an_archives_installation_alone(tmp_path: Path) -> None:
    (tmp_path / "opt").mkdir()
    (tmp_path / "opt/lcf-edge").symlink_to("lcf-edge-versions/1.0")
    done = subprocess.run(
        ("make", "install-program", f"DESTDIR={tmp_path}"), cwd=ROOT, check=False, capture_output=True, text=True
    )
    assert done.returncode != 0
    assert "comes from an archive: sudo" in done.stderr


def test_what_setup_does_not_know_is_told_how_to_write(pack: Pack, image: Path) -> None:
    assert setup(pack("1.0"), image, "remove", "--all", status=2).startswith("usage: setup [install]")


def test_the_same_content_is_the_same_archive(pack: Pack, tmp_path: Path) -> None:
    def digest() -> str:
        pack("1.0")
        return hashlib.sha256((tmp_path / f"dist/lcf-edge-1.0-{HERE}.tar").read_bytes()).hexdigest()

    assert digest() == digest()


def test_without_its_wheel_a_machine_has_no_archive(tmp_path: Path) -> None:
    with pytest.raises(ReleaseError, match="one wheel for aarch64 is needed, there is none; sudo make wheels"):
        bundle.built(MACHINES["aarch64"], tmp_path)


def test_the_document_tells_the_pythons_and_the_commands() -> None:
    output = (ROOT / "docs/install.md").read_text(encoding="utf-8")
    assert f"Python {', '.join(bundle.PYTHONS[:-1])} and {bundle.PYTHONS[-1]}" in output
    assert "/opt/lcf-edge/setup rollback" in output
    assert "/opt/lcf-edge/setup remove" in output
