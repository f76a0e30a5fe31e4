"""The order, the limits of time, and what is left when the configuration cannot be used."""

import shlex
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from drivers.errors import DeviceLostError
from lcf_edge.config import Config
from lcf_edge.doctor import configuration
from lcf_edge.doctor.configuration import check, context_of
from lcf_edge.doctor.examination import STEPS, Step, examine
from lcf_edge.doctor.finding import Context, Finding, Severity, edit, ok
from lcf_edge.errors import ConfigError

Machine = Callable[..., Context]
Raise = Callable[[Context], Iterator[Finding]]


def good(_: Context) -> Iterator[Finding]:
    yield ok("good", "one")
    yield ok("good", "two")


def raising(error: Exception) -> Raise:
    def raises(_: Context) -> Iterator[Finding]:
        yield ok("bad", "first")
        raise error

    return raises


def test_findings_come_in_the_order_of_the_checks(machine: Machine) -> None:
    steps = (Step("a", good), Step("b", lambda _: iter([ok("b", "three")])))
    assert [finding.text for finding in examine(machine(), steps)] == ["one", "two", "three"]


def test_a_check_that_hangs_is_reported_and_left_behind(machine: Machine) -> None:
    released = threading.Event()

    def hangs(_: Context) -> Iterator[Finding]:
        yield ok("camera", "there")
        released.wait()

    there, hung, *others = examine(machine(), (Step("camera", hangs), Step("good", good)), limit_s=0.1)
    released.set()
    assert there.text == "there"
    assert (hung.level, hung.subject) == (Severity.FAIL, "camera")
    assert hung.text.startswith("does not return within 0.1 s")
    assert hung.remedy
    assert [finding.text for finding in others] == ["one", "two"]


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (DeviceLostError("/dev/i2c-1: is gone; plug it in"), "/dev/i2c-1: is gone"),
        (PermissionError(13, "Permission denied", "/sys/secret"), "/sys/secret: Permission denied"),
        (ValueError("invalid literal for int()"), "invalid literal for int()"),
    ],
)
def test_a_check_that_breaks_off_fails_in_one_line(machine: Machine, error: Exception, text: str) -> None:
    first, broken, *others = examine(machine(), (Step("bad", raising(error)), Step("good", good)))
    assert first.text == "first"
    assert (broken.level, broken.subject, broken.text) == (Severity.FAIL, "bad", text)
    assert len(others) == 2


def test_without_a_configuration_the_rest_is_looked_at(machine: Machine) -> None:
    steps = (Step("camera", good), Step("board", lambda _: iter([ok("board", "cool")]), needs_config=False))
    assert [finding.text for finding in examine(machine(error=ConfigError("wrong")), steps)] == ["cool"]
    assert {step.subject for step in STEPS if not step.needs_config} == {
        "configuration",
        "software",
        "board",
        "clock",
        "service",
    }


def test_the_configuration_shows_where_it_comes_from(tmp_path: Path) -> None:
    file = tmp_path / "rover.toml"
    file.write_text("[camera]\nheight_m = 0.4\n")
    context = context_of(file, ["vehicle.speed_mps=1.0"])
    assert context.given == {"camera.height_m", "vehicle.speed_mps"}
    (found,) = check(context)
    assert (found.level, found.text) == (Severity.OK, f"{file} is valid")


def test_a_remedy_keeps_what_was_asked_for(tmp_path: Path) -> None:
    context = context_of(tmp_path / "none.toml", [])
    assert context.again() == f"{context.program} doctor -c {tmp_path}/none.toml"
    context = Context(Config(), tmp_path / "a rover.toml", ('zenoh.listen=["tcp/[::1]:7"]',), program="lcf-edge")
    command = context.again("imu.bus=3")
    words = ["lcf-edge", "doctor", "-c", f"{tmp_path}/a rover.toml", "--set", 'zenoh.listen=["tcp/[::1]:7"]']
    assert shlex.split(command, comments=True) == [*words, "--set", "imu.bus=3"]


def test_the_configuration_of_a_recording_sets_every_key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(configuration, "load", lambda *_: Config())
    assert {"camera.height_m", "log.level"} <= context_of(Path("drive.mcap"), []).given


def test_a_file_of_any_name_can_be_pasted() -> None:
    assert edit(Path("/home/a b;reboot/$x.toml")) == "${EDITOR:-nano} '/home/a b;reboot/$x.toml'"
    assert edit(Path("/etc/it's"), "why") == "sudoedit '/etc/it'\"'\"'s'  # why"


def test_a_wrong_key_fails_with_the_file_to_edit(tmp_path: Path) -> None:
    file = tmp_path / "rover.toml"
    file.write_text("[camera]\nfsp = 30\n")
    (found,) = check(context_of(file, []))
    assert found.level is Severity.FAIL
    assert f"{file}: unknown key camera.fsp; did you mean camera.fps?" in found.text
    assert found.remedy == f"${{EDITOR:-nano}} {file}"
