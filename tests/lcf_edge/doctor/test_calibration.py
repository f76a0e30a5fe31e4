"""What is not configured about the vehicle."""

import shlex
import stat
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from lcf_edge.cli.arguments import parser
from lcf_edge.config import Camera, Config, Imu, Vehicle
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.doctor import calibration
from lcf_edge.doctor.daemon import Daemon
from lcf_edge.doctor.finding import Context, Finding, Severity

Machine = Callable[..., Context]
AXES = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]


def warned(context: Context) -> list[str]:
    return [finding.text.split()[0] for finding in calibration.check(context) if finding.level is Severity.WARN]


def test_defaults_are_warned_of_one_by_one(machine: Machine) -> None:
    found = list(calibration.check(machine(Config(imu=Imu(driver="mpu6050")))))
    assert [finding.text.split()[0] for finding in found] == [
        "camera.intrinsics",
        "camera.height_m",
        "imu.axes",
        "speed",
    ]
    assert all(finding.level is Severity.WARN and finding.remedy for finding in found)


def test_what_is_set_is_good(machine: Machine) -> None:
    camera = Camera(intrinsics=[500.0, 501.0, 320.0, 241.0])
    config = Config(camera=camera, imu=Imu(driver="mpu6050", axes=AXES), vehicle=Vehicle(speed_mps=1.0))
    assert warned(machine(config, given=frozenset({"camera.height_m", "camera.pitch_rad"}))) == []


def test_a_mounting_that_is_set_to_the_default_is_measured(machine: Machine) -> None:
    assert "camera.height_m" in warned(machine(given=frozenset({"camera.pitch_rad"})))
    assert "camera.height_m" not in warned(machine(given=frozenset({"camera.height_m", "camera.pitch_rad"})))


def learnt(machine: Machine, pitch_rad: str, sigma_rad: str, *, configured_rad: float = 0.0) -> list[Finding]:
    """What is said of the pitch when the daemon that runs has learnt this."""
    values = {"camera_pitch_rad": pitch_rad, "camera_pitch_sigma_rad": sigma_rad}
    context = machine(Config(camera=Camera(pitch_rad=configured_rad)), path=Path("/etc/lcf-edge/config.toml"))
    status = DeviceStatus("pipeline", Level.OK, "runs", values)
    context.__dict__["daemon"] = Daemon("tcp/127.0.0.1:7447", {"pipeline": status}, "")
    return [finding for finding in calibration.check(context) if "driving shows" in finding.text]


def test_a_mounting_that_driving_contradicts_is_warned_of_with_the_key_to_set(machine: Machine) -> None:
    (found,) = learnt(machine, "0.0350", "0.0030")
    assert found.level is Severity.WARN
    assert found.text == "camera.pitch_rad is 0, driving shows 0.035 ± 0.003"
    assert found.remedy == "sudoedit /etc/lcf-edge/config.toml  # [camera] pitch_rad = 0.035"


@pytest.mark.parametrize(
    ("pitch_rad", "sigma_rad", "configured_rad"),
    [("0.0350", "0.0030", 0.03), ("0.0350", "0.0200", 0.0), ("0.0150", "0.0010", 0.0)],
    ids=["as told", "not sure", "less than a degree"],
)
def test_a_mounting_that_may_be_right_is_good(
    machine: Machine, pitch_rad: str, sigma_rad: str, configured_rad: float
) -> None:
    (found,) = learnt(machine, pitch_rad, sigma_rad, configured_rad=configured_rad)
    assert found.level is Severity.OK


def test_a_camera_that_turns_show_elsewhere_than_configured_is_warned_of(machine: Machine) -> None:
    """In metres before the axle; 0.2 m more or less are good."""
    for ahead_m, sigma_m, level in (("0.45", "0.05", Severity.WARN), ("0.15", "0.01", Severity.OK)):
        context = machine(path=Path("/etc/lcf-edge/config.toml"))
        values = {"camera_ahead_m": ahead_m, "camera_ahead_sigma_m": sigma_m}
        status = DeviceStatus("pipeline", Level.OK, "runs", values)
        context.__dict__["daemon"] = Daemon("tcp/127.0.0.1:7447", {"pipeline": status}, "")
        (found,) = [finding for finding in calibration.check(context) if "driving shows" in finding.text]
        assert found.level is level
        assert found.text == f"camera.ahead_m is 0, driving shows {float(ahead_m):.3f} ± {float(sigma_m):.3f}"


def test_what_a_daemon_of_another_version_reports_is_left_alone(machine: Machine) -> None:
    assert learnt(machine, "unknown", "0.0030") == []


def test_intrinsics_of_another_size_are_noticed(machine: Machine) -> None:
    config = Config(camera=Camera(width=640, height=480, intrinsics=[1000.0, 1000.0, 640.0, 360.0]))
    found = next(calibration.check(machine(config)))
    assert found.level is Severity.WARN
    assert "are they of another size?" in found.text


def test_the_accelerometer_alone_is_no_speed(machine: Machine) -> None:
    config = Config(imu=Imu(driver="mpu6050", axes=AXES), vehicle=Vehicle(speed_source="imu"))
    *_, speed = calibration.check(machine(config))
    assert speed.level is Severity.WARN
    assert "drifts" in speed.text


def calibrations(context: Context) -> list[str]:
    """The remedies that measure."""
    found = calibration.check(context)
    return [finding.remedy for finding in found if "lcf-edge calibrate" in finding.remedy.partition("#")[0]]


def test_remedies_pasted_one_after_the_other_make_the_file_and_keep_what_is_in_it(
    machine: Machine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "etc dir" / "a rover.toml"
    remedies = calibrations(machine(Config(imu=Imu(driver="mpu6050")), path=file))
    assert len(remedies) == 2
    program = tmp_path / "bin" / "lcf-edge"
    program.parent.mkdir()
    program.write_text('#!/bin/sh\necho "# $1 $2" >> "$4"\n')  # calibrate WHAT -c FILE --write
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent), prepend=":")
    for remedy in remedies:
        subprocess.run(remedy, shell=True, check=True, umask=0o077)
    assert file.read_text() == "# calibrate camera\n# calibrate imu\n"
    assert stat.S_IMODE(file.stat().st_mode) == 0o644


def test_the_remedy_is_a_command_that_the_program_understands(machine: Machine, tmp_path: Path) -> None:
    file = tmp_path / "a rover.toml"
    file.touch()
    remedies = calibrations(machine(Config(imu=Imu(driver="mpu6050")), path=file))
    assert remedies
    for remedy in remedies:
        program, *arguments = shlex.split(remedy, comments=True)
        assert program == "lcf-edge"
        assert parser().parse_args(arguments).write


def test_the_configuration_of_the_machine_is_written_by_root(machine: Machine) -> None:
    context = machine(path=Path("/etc/no-such-folder/config.toml"))
    assert context.calibrate("imu") == (
        "test -e /etc/no-such-folder/config.toml || "
        "sudo install -D -m 644 /dev/null /etc/no-such-folder/config.toml && "
        "sudo lcf-edge calibrate imu -c /etc/no-such-folder/config.toml --write"
    )
    assert machine(path=Path("/etc/passwd")).calibrate("imu") == "sudo lcf-edge calibrate imu -c /etc/passwd --write"
