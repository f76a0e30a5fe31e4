"""``lcf-edge doctor`` as it is typed."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from lcf_edge.cli.command_line import main
from lcf_edge.cli.doctor import line
from lcf_edge.doctor import camera, imu
from lcf_edge.doctor.finding import Finding, Severity
from lcf_edge.rendered import scenes

LEVELS = {level.value for level in Severity}

Doctor = Callable[..., int]


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of a second with IMU and odometry."""
    made = scenes.make("crossing", 3, seconds=1.0, fps=20.0, width=320, height=240, focal_px=250.0)
    return scenes.write(made, tmp_path_factory.mktemp("drive"))


@pytest.fixture
def doctor(drive: Path, endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Doctor:
    """Run it on the recorded drive, with more arguments."""
    monkeypatch.setattr(camera, "SECONDS", 0.3)
    monkeypatch.setattr(imu, "SECONDS", 0.3)
    (tmp_path / "config.toml").write_text(
        f'camera = {{driver = "recording", recording = "{drive}", width = 320, height = 240}}\n'
        f'imu.driver = "recording"\nzenoh.listen = ["{endpoint}"]\n'
    )
    return lambda *arguments: main(["doctor", "-c", str(tmp_path / "config.toml"), *arguments])


def test_on_a_recording_nothing_fails(doctor: Doctor, capsys: pytest.CaptureFixture[str]) -> None:
    assert doctor() == 0
    said, errors = capsys.readouterr()
    assert errors == ""
    *lines, empty, last = said.splitlines()
    assert (empty, last.partition(",")[0]) == ("", "nothing failed")
    found = [line_text.split()[:2] for line_text in lines if not line_text.startswith(" ")]
    assert {level for level, _ in found} <= LEVELS
    subjects = list(dict.fromkeys(subject for _, subject in found))
    assert subjects[0] == "configuration"
    assert subjects[-3:] == ["camera", "imu", "calibration"]
    assert {"software", "board", "clock", "memory", "service", "network", "daemon"} <= set(subjects)


def test_json_is_one_object_a_line(doctor: Doctor, capsys: pytest.CaptureFixture[str]) -> None:
    assert doctor("--json") == 0
    found = [json.loads(line_text) for line_text in capsys.readouterr().out.splitlines()]
    assert all(set(one) == {"level", "subject", "text", "remedy"} and one["level"] in LEVELS for one in found)
    assert any(one["subject"] == "camera" and "/s, jitter" in one["text"] for one in found)


def test_a_failure_is_exit_status_1_and_one_line(doctor: Doctor, capsys: pytest.CaptureFixture[str]) -> None:
    assert doctor("--set", "camera.driver=v4l2", "--set", "camera.device=/dev/no-such-camera") == 1
    said, errors = capsys.readouterr()
    assert "\nfail  camera         /dev/no-such-camera: no such camera" in said
    assert errors == "lcf-edge: 1 check failed; fix the first one and look again\n"


def test_a_wrong_configuration_is_exit_status_2_and_the_rest_is_reported(
    doctor: Doctor, capsys: pytest.CaptureFixture[str]
) -> None:
    assert doctor("--set", "camera.fsp=30") == 2
    said, errors = capsys.readouterr()
    assert said.startswith("fail  configuration  --set: unknown key camera.fsp; did you mean camera.fps?")
    assert "ok    software" in said
    assert "  camera  " not in said
    assert errors == "lcf-edge: --set: unknown key camera.fsp; did you mean camera.fps?\n"


@pytest.mark.parametrize(
    "setting",
    [
        "camera.device={place}/file",
        "camera.device={place}/fifo",
        "camera.device={place}",
        "camera.device=Some Webcam",
        "imu.port={place}/file",
        "imu.port={place}/fifo",
        "imu.port={place}",
        "imu.port=/dev/full",
    ],
)
def test_what_is_no_device_fails_in_one_line(
    doctor: Doctor, capsys: pytest.CaptureFixture[str], tmp_path: Path, setting: str
) -> None:
    (tmp_path / "file").write_text("no device")
    os.mkfifo(tmp_path / "fifo")
    subject = setting.partition(".")[0]
    driver = {"camera": "camera.driver=v4l2", "imu": "imu.driver=csv"}[subject]
    assert doctor("--set", driver, "--set", setting.format(place=tmp_path), "--json") == 1
    found = [json.loads(line_text) for line_text in capsys.readouterr().out.splitlines()]
    assert [one["subject"] for one in found if one["level"] == "fail"] == [subject]


@pytest.mark.parametrize(("no_color", "colours"), [("", True), ("1", False)])
def test_colours_are_for_terminals_that_want_them(no_color: str, colours: bool) -> None:
    terminal, end = os.openpty()
    command = [sys.executable, "-m", "lcf_edge", "doctor", "--set", "camera.fsp=30"]  # ends at once
    done = subprocess.run(
        command, stdout=end, stderr=subprocess.PIPE, env={**os.environ, "NO_COLOR": no_color}, check=False
    )
    said = os.read(terminal, 4096).decode()
    os.close(terminal)
    os.close(end)
    assert done.returncode == 2
    assert said.startswith("\x1b[31mfail\x1b[0m  configuration" if colours else "fail  configuration")


def test_names_of_others_do_not_command_the_terminal() -> None:
    line_text = line(Finding(Severity.FAIL, "network", "taken by \x1b]0;mine\x07\x9b2J\n, process 7", "kill 7"))
    assert all(part.isprintable() for part in line_text.split("\n"))
    assert len(line_text.split("\n")) == 2


def test_the_remedy_is_below_and_can_be_pasted() -> None:
    line_text = line(Finding(Severity.WARN, "clock", "wrong", "sudo timedatectl set-ntp true"))
    first, remedy = line_text.splitlines()
    assert first == "warn  clock          wrong"
    assert remedy == " " * first.index("wrong") + "sudo timedatectl set-ntp true"
