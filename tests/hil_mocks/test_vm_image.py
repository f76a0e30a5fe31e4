"""What the image of the virtual machine is made of, and what is said where it cannot be made."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hil_mocks.vm import image
from hil_mocks.vm.machine import BOARDS
from release.debian import MACHINES
from release.foreign_pip import locked_for

ROOT = Path(__file__).parents[2]


def test_what_is_missing_is_one_line_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda tool: None if tool in {"mmdebstrap", "mke2fs"} else f"/usr/bin/{tool}")
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    assert "e2fsprogs, mmdebstrap (apt-get install e2fsprogs mmdebstrap) and root (sudo make hil)" in image.missing()
    monkeypatch.setattr("shutil.which", lambda tool: f"/usr/bin/{tool}")
    monkeypatch.setattr("os.geteuid", lambda: 0)
    if os.uname().machine == "x86_64":
        assert image.missing() == ""


def test_64_bit_arm_wants_its_own_tools(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("shutil.which", lambda _: None)
    wanted = image.missing("aarch64").partition("apt-get install ")[2].rstrip(")")
    for package in ("qemu-system-arm", "qemu-user-static", "binfmt-support", "arch-test", "gcc-aarch64-linux-gnu"):
        assert package in wanted.split()
    assert "qemu-system-arm" not in image.missing()
    assert set(BOARDS) == set(image.MORE_TOOLS) == set(MACHINES)


def test_the_packages_of_a_processor_are_its_own() -> None:
    assert "linux-image-amd64" in image._packages(image.DEBIAN_12)
    assert {"linux-image-arm64", "linux-headers-arm64"} <= set(image._packages(image.DEBIAN_13_ON_ARM))


@pytest.mark.parametrize(("where_possible", "status"), [("", 1), ("1", 0)])
def test_where_it_cannot_be_it_says_so_and_does_not_pretend(tmp_path: Path, where_possible: str, status: int) -> None:
    environment = os.environ | {"PATH": str(tmp_path), "LCF_EDGE_HIL_WHERE_POSSIBLE": where_possible}
    command = (sys.executable, "-m", "pytest", "hil_mocks/vm", "-p", "no:cacheprovider")
    done = subprocess.run(command, cwd=ROOT, check=False, capture_output=True, text=True, env=environment, timeout=120)
    assert done.returncode == status
    (line,) = [line for line in (done.stdout + done.stderr).splitlines() if "hil:" in line]
    assert "apt-get install debhelper e2fsprogs gcc-x86-64-linux-gnu mmdebstrap openssl qemu-system-x86" in line
    assert "passed" not in done.stdout


def test_the_lock_is_read_for_the_guests_python_and_not_for_this_one() -> None:
    lock = "one==1 \\\n    --hash=sha256:1\ntwo==2 ; python_full_version < '3.12' \\\n    --hash=sha256:2\n"
    lock += (
        "two==3 ; python_full_version >= '3.12' \\\n    --hash=sha256:3\nfour==4 ; sys_platform == 'win32' --hash=4\n"
    )
    kept = [line.split() for line in locked_for(lock, "3.11").splitlines()]
    assert kept == [["one==1", "--hash=sha256:1"], ["two==2", "--hash=sha256:2"]]
    kept = [line.split() for line in locked_for(lock, "3.13").splitlines()]
    assert kept == [["one==1", "--hash=sha256:1"], ["two==3", "--hash=sha256:3"]]


def test_the_digest_is_that_of_names_and_contents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(image, "PROJECT", tmp_path)
    (tmp_path / "package" / "__pycache__").mkdir(parents=True)
    file = tmp_path / "package" / "one.py"
    file.write_text("1")
    (tmp_path / "package" / "__pycache__" / "one.pyc").write_text("1")
    known = image._contents([tmp_path / "package"])
    assert len(known) == 1
    file.write_text("2")
    changed = image._contents([tmp_path / "package"])
    file.rename(file.with_name("two.py"))
    assert len({*known, *changed, *image._contents([tmp_path / "package"])}) == 3


def test_a_step_that_fails_tells_its_last_words() -> None:
    with pytest.raises(image.ImageError, match="sh: exit status 3: why it failed"):
        image._do("sh", "-c", "echo why it failed >&2; exit 3")
    with pytest.raises(image.ImageError, match="no-such-program"):
        image._do("no-such-program")


def test_the_guest_gets_what_the_project_needs_and_what_builds_it() -> None:
    assert "\nnumpy==" in (image.PROJECT / image.LOCK).read_text(encoding="utf-8")
    assert {"setuptools", "Cython"} <= {re.split(r"\W", one)[0] for one in image._builders()}


def test_the_cache_is_where_the_environment_says(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("LCF_EDGE_HIL_CACHE", str(tmp_path))
    assert image.cache() == tmp_path
    monkeypatch.delenv("LCF_EDGE_HIL_CACHE")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert image.cache() == tmp_path / ".cache/lcf-edge/hil"
