"""``lcf-edge calibrate`` as a person runs it: devices or a recording in; prompts, TOML, an image, a file out."""

import os
import pty
import re
import signal
import subprocess
import sys
import threading
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import pytest

from drivers.errors import DeviceMissingError
from drivers.samples import Frame, ImuSample
from lcf_edge.calibrate.sources import LiveSource
from lcf_edge.cli.command_line import main
from lcf_edge.config import load
from lcf_edge.errors import ConfigError

Make = Callable[..., Any]

COMMAND = (sys.executable, "-m", "lcf_edge", "calibrate")


@pytest.fixture(scope="module")
def recording(turntable: Make, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of the turntable: the IMU's axes are the camera's, its clock is 20 ms behind."""
    folder: Path = tmp_path_factory.mktemp("turned")
    table = turntable(seconds=4.0, offset_s=0.02)
    (folder / "mav0/cam0/data").mkdir(parents=True)
    (folder / "mav0/imu0").mkdir()
    rows = []
    for frame in table.frames():
        cv2.imwrite(str(folder / f"mav0/cam0/data/{frame.stamp_ns}.png"), frame.image)
        rows.append(f"{frame.stamp_ns},{frame.stamp_ns}.png")
    samples = [f"{s.stamp_ns}," + ",".join(map(str, (*s.gyro, *s.accel))) for s in table.samples()]
    for sensor, lines in (("cam0", rows), ("imu0", samples)):
        (folder / f"mav0/{sensor}/data.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "mav0/cam0/sensor.yaml").write_text(
        "camera_model: pinhole\nresolution: [240, 180]\nintrinsics: [210, 210, 119.5, 89.5]\n"
        "distortion_model: none\ndistortion_coefficients: []\n",
        encoding="utf-8",
    )
    (folder / "mav0/imu0/sensor.yaml").write_text(  # a claim that is to be measured, not believed
        "T_BS:\n  rows: 4\n  cols: 4\n  data: [0,1,0,0, -1,0,0,0, 0,0,1,0, 0,0,0,1]\n", encoding="utf-8"
    )
    return folder


def test_what_it_prints_is_toml_and_what_it_writes_is_used(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, report = tmp_path / "rover.toml", tmp_path / "report.png"
    file.write_text("# my rover\n", encoding="utf-8")
    options = ["--from", str(recording), "-c", str(file), "--write"]
    assert main(["calibrate", "time", *options, "--report", str(report)]) == 0
    out = capsys.readouterr().out
    assert tomllib.loads(out)["imu"]["time_offset_s"] == pytest.approx(0.02, abs=0.002)
    assert f"# written to {file}" in out
    assert cv2.imread(str(report)).shape == (600, 1300, 3)
    assert main(["calibrate", "imu", "--by-camera", "--snap", "5", *options]) == 0
    assert "ms apart" not in capsys.readouterr().out
    assert load(file).imu.axes == [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]


@pytest.mark.parametrize(
    ("arguments", "message", "status"),
    [
        (["camera", "--board", "charuco:8x6:30mm"], "0 usable views of charuco:8x6:30mm", 1),
        (["foe"], "camera", 1),
        (["imu"], "the samples end before this was seen: rest on level ground", 1),
        (["imu", "--at-rest"], "it moved while it should rest", 1),
        (["camera", "--board", "chess"], "--board chess: write it as", 2),
        (["camera", "--views", "3"], "write a number between 8 and 100", 2),
        (["imu", "--snap", "90"], "write a number between 0 and 45", 2),
        (["time", "--write", "-c", "missing.toml"], "missing.toml: cannot be read", 2),
        (["time", "--report", "report.txt"], "report.txt: the name must end in .png", 2),
        (["imu", "--at-rest", "--by-camera"], "not allowed with", 2),
        ([], "required: WHAT", 2),
    ],
)
def test_errors_are_one_line(
    recording: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str, status: int
) -> None:
    options = ["--from", str(recording)] if arguments else []
    assert main(["calibrate", *arguments, *options]) == status
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 1
    assert errors[0].startswith("lcf-edge: ")
    assert message in errors[0]


@pytest.mark.parametrize("name", ["board.png", "board.pdf", "board.svg"])
def test_a_board_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    path = tmp_path / name
    assert main(["calibrate", "camera", "--board", "charuco:5x4:40mm", "--print-board", str(path)]) == 0
    assert re.search(r"240 x 200 mm; print it at 100 %", capsys.readouterr().out)
    assert path.stat().st_size > 1000


def live(recording: Path) -> list[str]:
    return ["camera.driver=recording", f"camera.recording={recording}", "imu.driver=recording", "camera.fps=20"]


def test_devices_deliver_side_by_side_and_are_let_go(recording: Path) -> None:
    before = threading.active_count()
    items = LiveSource(load(None, live(recording)), camera=True, imu=True).items()
    kinds: set[type] = set()
    while kinds != {Frame, ImuSample}:
        kinds.add(type(next(items)))
    close(items)
    assert threading.active_count() == before


def close(items: Iterator[Any]) -> None:
    items.close()  # type: ignore[attr-defined]


def test_a_device_that_is_not_there_is_reported() -> None:
    with pytest.raises(ConfigError, match=r"imu.driver: none is configured"):
        LiveSource(load(None, []), camera=True, imu=True)
    with pytest.raises(DeviceMissingError, match=r"/dev/no-such-camera"):
        next(LiveSource(load(None, ["camera.device=/dev/no-such-camera"]), camera=True, imu=False).items())


def test_on_a_terminal_it_prompts_and_ctrl_c_ends_it(recording: Path) -> None:
    ours, theirs = pty.openpty()
    settings = [option for setting in live(recording) for option in ("--set", setting)]
    with subprocess.Popen([*COMMAND, "imu", *settings], stdin=theirs, stdout=theirs, stderr=theirs) as process:
        os.close(theirs)
        shown = ""
        while "turned" not in shown:
            shown += os.read(ours, 4096).decode()
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 130
    while chunk := _read(ours):
        shown += chunk
    os.close(ours)
    assert shown.startswith("Let the vehicle stand on level ground: hands off, motors off.")
    assert "Traceback" not in shown
    assert shown.endswith("\x1b[K")


def _read(terminal: int) -> str:
    try:
        return os.read(terminal, 4096).decode()
    except OSError:  # nobody has its other end open any more
        return ""
