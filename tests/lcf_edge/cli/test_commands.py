"""The commands, run as a user runs them: exit status, one-line errors, and what they write."""

import json
import os
import pty
import re
import shlex
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
import pytest
import zenoh
from rosbags.highlevel import AnyReader

from drivers.samples import Frame
from lcf_edge.cdr import decode_scene
from lcf_edge.cli.command_line import main
from lcf_edge.cli.findings import findings
from lcf_edge.config import Config, Publish, Zenoh, load
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Cause, Scene
from lcf_edge.recording.read import open_recording
from lcf_edge.rendered import scenes
from lcf_edge.rendered.scenes import ObjectTruth, Truth
from lcf_edge.zenoh_link import ScenePublisher, open_session

FRAMES = 24
PATIENCE_S = 60.0
Done = subprocess.CompletedProcess[str]
COMMAND = (sys.executable, "-m", "lcf_edge")


def lcf_edge(*arguments: object, cwd: Path = Path(), **environment: str) -> Done:
    return subprocess.run(
        [*COMMAND, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
        cwd=cwd,
        env={**os.environ, **environment},
    )


def is_one_line(errors: str, *parts: str) -> bool:
    """One error that contains all of ``parts``, after warnings perhaps; no traceback."""
    *warnings, error = errors.splitlines()
    return (
        all(line.startswith("lcf-edge: warning: ") for line in warnings)
        and error.startswith("lcf-edge: ")
        and all(part in error for part in parts)
    )


class Refused(Protocol):
    """Run a command in this process, and see that it is refused."""

    def __call__(self, *arguments: object, status: int, parts: Sequence[str]) -> None: ...


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Refused:
    monkeypatch.chdir(tmp_path)

    def refuse(*arguments: object, status: int, parts: Sequence[str]) -> None:
        assert main([str(argument) for argument in arguments]) == status
        output, errors = capsys.readouterr()
        assert output == ""
        assert is_one_line(errors, *parts), errors

    return refuse


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of 2.4 s, 320×240."""
    drive = scenes.make("crossing", 3, seconds=FRAMES / 10, fps=10.0, width=320, height=240, focal_px=250.0)
    return scenes.write(drive, tmp_path_factory.mktemp("drive"))


def frame_shapes(video: Path) -> Iterator[tuple[int, ...]]:
    capture = cv2.VideoCapture(str(video))
    while (got := capture.read())[0]:
        yield got[1].shape
    capture.release()


# Usage.


def test_help_and_version_need_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from lcf_edge.cli.command_line import main\n"
        "try: main(['--help'])\n"
        "except SystemExit as end: assert end.code == 0\n"
        "print(sorted({'numpy', 'cv2', 'zenoh', 'msgspec', 'matplotlib'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("[]\n")
    assert {"demo", "replay", "config"} <= set(done.stdout.split())
    assert re.fullmatch(r"lcf-edge \d+\.\d+\.\d+\S*\n", lcf_edge("--version").stdout)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ((), "COMMAND"),
        (("fly",), "invalid choice: 'fly'"),
        (("replay",), "RECORDING"),
        (("replay", ".", "--viedo", "x.mp4"), "--viedo"),
        (("config", "--set"), "--set"),
        (("demo", "--seconds", "much"), "much: write a number between 1 and"),
        (("demo", "--seconds", "nan"), "nan: write a number between 1 and"),
        (("demo", "--seconds", "1e9"), "1e9: write a number between 1 and"),
    ],
)
def test_wrong_usage_is_status_2(refused: Refused, arguments: tuple[str, ...], part: str) -> None:
    refused(*arguments, status=2, parts=(part, "--help"))


@pytest.mark.parametrize(
    ("arguments", "command"),
    [
        (("--sett", "run"), "lcf-edge"),
        (("run", "--sett", "x=1"), "lcf-edge run"),
        (("run", "now"), "lcf-edge run"),
        (("calibrate", "foe", "--sett", "x=1"), "lcf-edge calibrate foe"),
    ],
)
def test_wrong_usage_points_at_the_help_of_the_command(
    refused: Refused, arguments: tuple[str, ...], command: str
) -> None:
    refused(*arguments, status=2, parts=(f"; see {command} --help",))


def test_an_error_is_one_line_in_a_process_of_its_own(tmp_path: Path) -> None:
    done = lcf_edge("replay", tmp_path / "nowhere")
    assert (done.returncode, done.stdout) == (1, "")
    assert is_one_line(done.stderr, "nowhere"), done.stderr
    assert lcf_edge("replay").returncode == 2


# config


@pytest.mark.parametrize("source", ["", "raise OSError", "import no_such_module"])
def test_a_folder_with_the_name_of_the_drivers_is_reported_in_one_line(tmp_path: Path, source: str) -> None:
    (tmp_path / "drivers").mkdir()
    (tmp_path / "drivers" / "__init__.py").write_text(source)
    done = lcf_edge("run", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, "")
    assert is_one_line(done.stderr, f"{tmp_path}/drivers: ", "start in another folder"), done.stderr


def test_config_prints_what_load_reads_back(tmp_path: Path) -> None:
    done = lcf_edge("config", "--set", "vehicle.half_width_m=0.6", "--set", "filter.profile=paper")
    assert (done.returncode, done.stderr) == (0, "")
    file = tmp_path / "config.toml"
    file.write_text(done.stdout, encoding="utf-8")
    assert load(file) == load(None, ["vehicle.half_width_m=0.6", "filter.profile=paper"])


def test_config_shows_the_bytes_of_each_table_and_in_all() -> None:
    text = lcf_edge("config").stdout
    assert tomllib.loads(text)["vehicle"]["horizon_s"] == 4.0
    rows = {
        name: int(size.replace(",", "")) for name, size in re.findall(r"^#   (.+?)  +([\d,]+)$", text, re.MULTILINE)
    }
    in_all = rows.pop("in all")
    assert in_all == sum(rows.values()) > 0
    fewer = lcf_edge("config", "--set", "memory.edges_normal=100", "--set", "memory.corners=100").stdout
    smaller = re.search(r"in all +([\d,]+)", fewer)
    assert smaller
    assert int(smaller[1].replace(",", "")) < in_all


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (
            ("--set", "vehicle.half_widht_m=0.6"),
            ("unknown key vehicle.half_widht_m", ".half_width_m?"),
        ),
        (("--set", "vehicle.half_width_m=wide"), ("vehicle.half_width_m",)),
        (("-c", "nowhere.toml"), ("nowhere.toml", "cannot be read")),
    ],
)
def test_a_wrong_configuration_is_status_2(
    refused: Refused, arguments: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    refused("config", *arguments, status=2, parts=parts)


@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-"])
def test_config_survives_closed_streams(closed: str) -> None:
    command = f"{shlex.join(COMMAND)} config {closed}"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_config_survives_a_terminal_without_greek() -> None:
    done = lcf_edge("config", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr) == (0, "")
    assert "in all" in done.stdout


# replay


@pytest.fixture(scope="module")
def replayed(recording: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Done, Path]:
    """A replay with every file that it can write, and the folder where it wrote."""
    folder = tmp_path_factory.mktemp("replayed")
    done = lcf_edge(
        "replay",
        recording,
        "-o",
        "results.jsonl",
        "--video",
        "overlay.webm",
        "--plot",
        "sizes.png",
        "--mcap",
        "found.mcap",
        "--set",
        "record.format=png",
        cwd=folder,
    )
    return done, folder


def test_replay_prints_a_summary_and_away_from_a_terminal_nothing_else(replayed: tuple[Done, Path]) -> None:
    done, _ = replayed
    assert (done.returncode, done.stderr) == (0, "")
    assert f"frames   {FRAMES}, 2.3 s of recording" in done.stdout
    for word in ("objects", "normal", "rebels", "psi", "detect", "filter", "total"):
        assert word in done.stdout


def test_replay_writes_a_line_for_each_frame(replayed: tuple[Done, Path]) -> None:
    lines = [json.loads(line) for line in (replayed[1] / "results.jsonl").read_bytes().splitlines()]
    assert [line["seq"] for line in lines] == list(range(FRAMES))
    assert all(line["sizes"]["corners"] > 0 for line in lines)
    assert any(line["circles"] for line in lines)


def test_the_video_has_two_panels_and_every_frame(
    replayed: tuple[Done, Path],
) -> None:
    video = replayed[1] / "overlay.webm"
    assert list(frame_shapes(video)) == [(240, 640, 3)] * FRAMES
    assert cv2.VideoCapture(str(video)).get(cv2.CAP_PROP_FPS) == pytest.approx(10.0)


def test_the_plot_is_an_image(replayed: tuple[Done, Path]) -> None:
    image = cv2.imread(str(replayed[1] / "sizes.png"))
    assert image is not None
    assert image.std() > 10


def without_timing(line: bytes) -> dict[str, object]:
    return {name: value for name, value in json.loads(line).items() if name != "timing_us"}


def test_the_recording_of_a_replay_holds_all_that_went_in_and_what_was_found(
    recording: Path, replayed: tuple[Done, Path]
) -> None:
    """To a reader that knows nothing of this program; image, scene and annotations by the same stamp."""
    stamps_ns: dict[str, list[int]] = {}
    drawn = 0
    with AnyReader([replayed[1] / "found.mcap"]) as reader:
        for connection, log_time_ns, raw in reader.messages():
            stamps_ns.setdefault(connection.topic, []).append(log_time_ns)
            if connection.topic == "/lcf/annotations":
                message: Any = reader.deserialize(raw, connection.msgtype)
                drawn += len(message.circles)
                assert message.timestamp.sec * 10**9 + message.timestamp.nanosec == log_time_ns
    seen = [item for item in open_recording(recording, Config()) if isinstance(item, Frame)]
    for topic in ("camera/image_raw/compressed", "camera/camera_info", "scene", "annotations", "markers"):
        assert stamps_ns.pop(f"/lcf/{topic}") == [frame.stamp_ns for frame in seen]
    assert stamps_ns.pop("/tf_static") == [frame.stamp_ns for frame in seen[::10]]
    folder = recording / "mav0"
    for topic, samples in (("imu", folder / "imu0/data.csv"), ("speed", folder / "odom0/data.csv")):
        rows = [line for line in samples.read_text().splitlines() if line[0].isdigit()]
        assert stamps_ns.pop(f"/lcf/{topic}") == [int(row.partition(",")[0]) for row in rows]
    assert (stamps_ns, drawn > 0) == ({}, True)


def test_replayed_itself_it_gives_the_same(replayed: tuple[Done, Path]) -> None:
    found = replayed[1] / "found.mcap"
    again = lcf_edge("replay", found, "-c", found, "-o", "-").stdout.encode().splitlines()
    written = (replayed[1] / "results.jsonl").read_bytes().splitlines()
    assert list(map(without_timing, again)) == list(map(without_timing, written))


def test_a_recording_that_is_there_is_kept(refused: Refused, recording: Path, replayed: tuple[Done, Path]) -> None:
    found = replayed[1] / "found.mcap"
    kept = found.read_bytes()
    refused("replay", recording, "--mcap", found, status=2, parts=("found.mcap: already exists",))
    assert found.read_bytes() == kept


def test_a_disk_that_takes_no_more_of_a_recording_is_one_line(recording: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        ["sh", "-c", 'ulimit -f 1; exec "$@"', "sh", *COMMAND, "replay", str(recording), "--mcap", "found.mcap"],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert is_one_line(done.stderr, "found.mcap: cannot be written (File too large)")


def test_results_on_standard_output_are_the_same_and_the_summary_steps_aside(
    recording: Path, replayed: tuple[Done, Path]
) -> None:
    done = lcf_edge("replay", recording, "-o", "-")
    assert done.returncode == 0
    assert f"frames   {FRAMES}" in done.stderr
    written = (replayed[1] / "results.jsonl").read_bytes().splitlines()
    assert list(map(without_timing, done.stdout.encode().splitlines())) == list(map(without_timing, written))


def test_settings_reach_the_filter(recording: Path) -> None:
    done = lcf_edge("replay", recording, "-o", "-", "--set", "memory.corners=50")
    assert max(json.loads(line)["sizes"]["corners"] for line in done.stdout.splitlines()) <= 50


@pytest.mark.parametrize(
    ("arguments", "status", "parts"),
    [
        (("nowhere",), 1, ("nowhere",)),
        (("{recording}", "-o", "nowhere/results.jsonl"), 1, ("nowhere/results.jsonl: cannot be written",)),
        (("{recording}", "--video", "nowhere/x.webm"), 1, ("nowhere/x.webm: cannot be written",)),
        (("{recording}", "--video", "x.xyz"), 2, ("x.xyz", ".webm")),
        (("{recording}", "--plot", "nowhere/x.png"), 1, ("nowhere/x.png: cannot be written",)),
        (("{recording}", "--plot", "x.txt"), 2, ("x.txt", ".png")),
        (("{recording}", "--mcap", "nowhere/x.mcap"), 1, ("nowhere/x.mcap: cannot be written",)),
        (("{recording}", "--mcap", "x.txt"), 2, ("x.txt", ".mcap")),
        (("{recording}", "--mcap", "x.mcap", "--loop"), 2, ("x.mcap", "--loop")),
        (("{recording}", "--set", "filter.tr_max=1"), 2, ("filter.tr_s",)),
        (("{recording}", "--publish", "--set", 'zenoh.listen=["bogus/1"]'), 1, ("bogus/1",)),
    ],
)
def test_replay_refuses_in_one_line(
    refused: Refused, recording: Path, arguments: tuple[str, ...], status: int, parts: tuple[str, ...]
) -> None:
    filled = [argument.format(recording=recording) for argument in arguments]
    refused("replay", *filled, status=status, parts=parts)


def test_a_busy_port_is_named(refused: Refused, recording: Path) -> None:
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        endpoint = f"tcp/127.0.0.1:{busy.getsockname()[1]}"
        setting = f'zenoh.listen=["{endpoint}"]'
        parts = (endpoint, "already in use")
        refused("replay", recording, "--publish", "--set", setting, status=1, parts=parts)


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def test_published_scenes_arrive(recording: Path) -> None:
    endpoint, arrived = free_endpoint(), threading.Event()

    def receive(sample: zenoh.Sample) -> None:
        if decode_scene(sample.payload.to_bytes()).seq == FRAMES - 1:
            arrived.set()

    with open_session(Zenoh(listen=[endpoint])) as session:
        session.declare_subscriber("robot7/scene", receive)
        publish = ("--publish", "--set", "publish.prefix=robot7")
        link = ("--set", "zenoh.listen=[]", "--set", f'zenoh.connect=["{endpoint}"]')
        assert lcf_edge("replay", recording, *publish, *link).returncode == 0
        assert arrived.wait(PATIENCE_S)


def sequence(done: Done) -> list[int]:
    assert (done.returncode, "Traceback" in done.stderr) == (0, False)
    return [json.loads(line)["seq"] for line in done.stdout.splitlines()]


def test_a_part_of_a_recording_is_replayed(recording: Path) -> None:
    """At 10 frames a second."""
    assert sequence(lcf_edge("replay", recording, "-o", "-", "--start", "1", "--duration", "0.5")) == list(
        range(10, 16)
    )
    assert sequence(lcf_edge("replay", recording, "-o", "-", "--start", "2")) == list(range(20, FRAMES))


def test_a_start_beyond_the_end_is_reported_with_the_length(refused: Refused, recording: Path) -> None:
    refused("replay", recording, "--start", "60", status=1, parts=("ends after 2.3 s", "earlier start than 60 s"))


def test_a_replay_takes_its_time_as_it_is_told(recording: Path) -> None:
    began_s = time.monotonic()
    assert len(sequence(lcf_edge("replay", recording, "-o", "-", "--speed", "2"))) == FRAMES
    assert time.monotonic() - began_s >= 1.15


def test_a_replay_in_a_loop_begins_again_until_it_is_interrupted(recording: Path) -> None:
    command = (sys.executable, "-m", "lcf_edge", "replay", str(recording), "-o", "-", "--loop", "--start", "2")
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout
        seen = [json.loads(process.stdout.readline())["seq"] for _ in range(10)]
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=PATIENCE_S)
    assert seen == [20, 21, 22, 23] * 2 + [20, 21]
    assert process.returncode == 130


def test_a_replay_goes_step_by_step(recording: Path) -> None:
    done = subprocess.run(
        (sys.executable, "-m", "lcf_edge", "replay", str(recording), "-o", "-", "--step"),
        input="\n\n\n",
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )
    assert sequence(done) == [0, 1, 2]
    assert done.stderr.startswith("image 0: Enter shows it, Ctrl-D ends\n")
    assert "frames   3, 0.2 s of recording" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (("watch", "--start", "3"), ("these options need a recording", "RECORDING")),
        (("view", "--set", "camera.fps=20"), ("these options need a recording", "RECORDING")),
        (("watch", ".", "--json"), ("--json is for a daemon", "replay RECORDING -o -")),
        (("replay", ".", "--speed", "0"), ("--speed", "between 0.01 and 100")),
        (("replay", ".", "--duration", "-1"), ("--duration", "above 0")),
    ],
)
def test_options_of_a_replay_are_refused_where_they_mean_nothing(
    refused: Refused, arguments: tuple[str, ...], parts: tuple[str, ...]
) -> None:
    refused(*arguments, status=2, parts=parts)


def test_a_recording_that_is_not_there_is_reported_by_view_and_watch(refused: Refused) -> None:
    for command in ("view", "watch"):
        refused(command, "nowhere", status=1, parts=("nowhere",))


def test_a_recording_is_not_overwritten_by_its_own_results(refused: Refused, replayed: tuple[Done, Path]) -> None:
    video = replayed[1] / "overlay.webm"
    kept = video.read_bytes()
    for option in ("-o", "--video"):
        refused("replay", video, option, video, status=2, parts=("overlay.webm: is the recording itself",))
    assert video.read_bytes() == kept


def test_a_damaged_recording_is_replayed_with_a_warning(recording: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged"
    subprocess.run(["cp", "-r", recording, damaged], check=True)
    victim = sorted((damaged / "mav0/cam0/data").iterdir())[5]
    victim.write_bytes(victim.read_bytes()[:100])
    done = lcf_edge("replay", damaged)
    assert done.returncode == 0
    assert f"frames   {FRAMES - 1}" in done.stdout
    assert "skipped" in done.stdout
    (warning,) = done.stderr.splitlines()
    assert warning.startswith("lcf-edge: warning: ")
    assert victim.name in warning


def test_a_reader_that_goes_away_is_no_error(recording: Path) -> None:
    with subprocess.Popen(
        [*COMMAND, "replay", str(recording), "-o", "-"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as replay:
        assert replay.stdout
        assert replay.stderr
        json.loads(replay.stdout.readline())
        replay.stdout.close()
        assert replay.stderr.read() == b""
        assert replay.wait(PATIENCE_S) == 141


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_line(refused: Refused, recording: Path) -> None:
    refused("replay", recording, "-o", "/dev/full", status=1, parts=("/dev/full: cannot be written",))
    with Path("/dev/full").open("w") as full:
        command = (*COMMAND, "config")
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert is_one_line(done.stderr, "standard output: cannot be written")


def test_an_interrupt_is_quiet_and_leaves_whole_lines(recording: Path, tmp_path: Path) -> None:
    results = tmp_path / "results.fifo"
    os.mkfifo(results)
    with subprocess.Popen(
        [*COMMAND, "replay", str(recording), "--speed", "0.1", "-o", str(results)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as replay:
        with results.open("rb") as lines:
            json.loads(lines.readline())
            replay.send_signal(signal.SIGINT)
            rest = lines.read().splitlines()
        output, errors = replay.communicate(timeout=PATIENCE_S)
    assert (replay.returncode, output, errors) == (130, b"", b"")
    assert len(rest) < FRAMES - 1
    for line in rest:
        json.loads(line)


def on_a_terminal(columns: int, *arguments: object) -> tuple[int, str, str]:
    """Status, standard output, and what came on a terminal that is standard error."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, columns))
    with subprocess.Popen(
        [*COMMAND, *map(str, arguments)], stdout=subprocess.PIPE, stderr=theirs, text=True
    ) as process:
        os.close(theirs)
        shown = b""
        try:
            while block := os.read(ours, 4096):
                shown += block
        except OSError:  # Linux: the other end is closed
            pass
        output, _ = process.communicate(timeout=PATIENCE_S)
    os.close(ours)
    return process.returncode, output, shown.decode()


@pytest.mark.parametrize("columns", [100, 0], ids=["window", "serial line"])
def test_a_progress_bar_on_a_terminal(recording: Path, columns: int) -> None:
    status, output, shown = on_a_terminal(columns, "replay", recording)
    assert status == 0
    assert f"{FRAMES}/{FRAMES}" in shown
    assert "frame/s" in shown
    assert "frames" in output


def test_real_recordings() -> None:
    """A drive among parked cars, when the recordings are at hand."""
    data = Path(os.environ.get("LCF_EDGE_DATA", Path(__file__).parents[4] / "shared" / "data"))
    drive = data / "kitti-straight"
    if not drive.is_dir():
        pytest.skip("set LCF_EDGE_DATA to the folder of recordings")
    done = lcf_edge("replay", drive, "--set", "vehicle.half_width_m=1.2", "--set", "camera.height_m=1.65")
    assert done.returncode == 0
    assert "frames   51, 5.2 s of recording" in done.stdout


# demo


def truth(seq: int, *objects: ObjectTruth) -> Truth:
    return Truth(seq * 100_000_000, seq, 1.0, 0.0, objects)


def thing(number: int, **changed: Any) -> ObjectTruth:
    seen = ObjectTruth(number, f"walker_{number}", (100.0, 100.0, 40.0, 80.0), 1.0, 3.0, 2.0, 0.0, True, True)
    return replace(seen, **changed)


HITS = [(120, 140, True), (83, 140, True), (81, 140, False), (157, 140, True), (159, 140, False)]
HITS += [(120, 73, True), (120, 71, False), (120, 207, True), (120, 209, False)]


@pytest.mark.parametrize(("x", "y", "hit"), HITS)
def test_a_threat_is_found_by_a_circle_in_its_box_grown_by_a_quarter_and_8_px(x: int, y: int, hit: bool) -> None:
    drive = [truth(seq, thing(1)) for seq in range(10)]
    (finding,) = findings(drive, {seq: [(x, y, Cause.CROSSING)] for seq in (4, 5)})
    assert finding.latency_s == (0.4 if hit else None)
    assert finding.found_seq == (4 if hit else None)
    assert dict(finding.causes) == ({Cause.CROSSING: 2} if hit else {})


def test_only_a_threat_in_sight_for_a_while_is_asked_for() -> None:
    small, hidden, harmless = (0.0, 0.0, 7.0, 7.0), 0.2, False
    drive = [
        truth(seq, thing(1, box=small), thing(2, visible=hidden), thing(3, threat=harmless), thing(4))
        for seq in range(4)
    ]
    assert [finding.name for finding in findings(drive, {})] == ["walker_4"]
    assert findings(drive[:3], {}) == []


def test_latency_counts_from_when_it_threatens() -> None:
    drive = [truth(seq, thing(1, threat=seq >= 5)) for seq in range(10)]
    on_it = [(120.0, 140.0, Cause.INCOMING)]
    (finding,) = findings(drive, dict.fromkeys((2, 7, 8), on_it))
    assert finding.latency_s == pytest.approx(0.2)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Done, Path]:
    """A short demo while its usual port is busy, and where it wrote."""
    folder = tmp_path_factory.mktemp("demo")
    with socket.socket() as busy:
        busy.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            busy.bind(("127.0.0.1", 7447))
            busy.listen()
        except OSError:
            pass  # busy already
        done = lcf_edge("demo", "--seconds", "1", "--out", "out", cwd=folder)
    return done, folder / "out"


def test_the_demo_goes_the_whole_way(shown: tuple[Done, Path]) -> None:
    done, folder = shown
    assert (done.returncode, done.stderr) == (0, "")
    stages = re.findall(r"^(\d)/5 ", done.stdout, re.MULTILINE)
    assert stages == ["1", "2", "3", "4", "5"]
    lines = (folder / "results.jsonl").read_bytes().splitlines()
    assert len(lines) == 20
    assert "received 20 of 20 scenes in the second process" in done.stdout
    received = sum(len(json.loads(line)["objects"]) for line in lines)
    assert re.search(rf", {received} objects?, \d+ circles, 0 broken", done.stdout)
    assert len(list(frame_shapes(folder / "overlay.webm"))) == 20
    for image in (folder / "sizes.png", folder / "picture-1.png"):
        assert cv2.imread(str(image)) is not None
    memory = re.search(r"memory +(\d+) MiB", done.stdout)
    assert memory
    assert 20 < int(memory[1]) < 400


def test_the_demo_finds_a_free_port_and_says_so(shown: tuple[Done, Path]) -> None:
    done, _ = shown
    endpoint = re.search(r"on tcp/127\.0\.0\.1:(\d+),", done.stdout)
    assert endpoint
    assert int(endpoint[1]) != 7447
    assert "(after you have stopped what has tcp/127.0.0.1:7447 now)\n" in done.stdout


def test_what_the_demo_leaves_is_at_the_port_of_every_subscriber(shown: tuple[Done, Path]) -> None:
    done, folder = shown
    assert load(folder / "config.toml").zenoh == Zenoh()
    assert "scenes('tcp/127.0.0.1:7447')" in done.stdout.splitlines()[-1]


def test_the_lines_that_the_demo_ends_with_work(shown: tuple[Done, Path], endpoint: str) -> None:
    """At another port, for 7447 may be busy."""
    done, folder = shown
    publish, subscribe = (shlex.split(line) for line in done.stdout.splitlines()[-2:])
    publish += ["--set", f'zenoh.listen=["{endpoint}"]']
    assert subprocess.run(publish, check=True, capture_output=True, cwd=folder.parent).stderr == b""

    subscribe[-1] = subscribe[-1].replace("tcp/127.0.0.1:7447", endpoint)
    unbuffered = {**os.environ, "PYTHONUNBUFFERED": "1"}
    with (
        open_session(Zenoh(listen=[endpoint])) as session,
        subprocess.Popen(subscribe, stdout=subprocess.PIPE, cwd=folder.parent, env=unbuffered) as subscriber,
    ):
        publisher = ScenePublisher(session, Publish())
        assert publisher.wait_for_subscriber(PATIENCE_S)
        none = np.zeros(0, CIRCLE), np.zeros(0, PSI_REGION)
        publisher.put(Scene(0, 41, 640, 480, 1.0, *none, objects=np.zeros(1, OBJECT)))
        assert subscriber.stdout
        assert subscriber.stdout.readline() == b"41 [(0, 0., 0., 0.)]\n"
        subscriber.kill()


def test_the_demo_says_how_to_look_at_it(shown: tuple[Done, Path]) -> None:
    done, folder = shown
    (line,) = (line for line in done.stdout.splitlines() if " view " in line)
    with subprocess.Popen((*shlex.split(line), "--port", "0"), stdout=subprocess.PIPE, cwd=folder.parent) as page:
        try:
            assert page.stdout
            assert page.stdout.readline().startswith(b"open http://127.0.0.1:")
        finally:
            page.terminate()


def test_a_demo_whose_reader_goes_away_ends_silently(tmp_path: Path) -> None:
    command = (sys.executable, "-m", "lcf_edge", "demo", "--seconds", "1", "--out", "out")
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as demo:
        assert demo.stdout
        assert demo.stderr
        assert demo.stdout.readline().startswith("1/5")
        demo.stdout.close()  # the next line comes when its subscriber has started
        assert demo.stderr.read() == ""  # of both processes
    assert demo.returncode == 141


def test_the_demo_refuses_a_folder_that_cannot_be_written(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    refused("demo", "--out", "taken", status=1, parts=("taken: cannot be written (File exists)",))


def test_the_demo_recording_replays_with_its_own_configuration(
    shown: tuple[Done, Path],
) -> None:
    _, folder = shown
    done = lcf_edge("replay", folder / "recording", "-c", folder / "config.toml", "-o", "-")
    assert list(map(without_timing, done.stdout.encode().splitlines())) == list(
        map(without_timing, (folder / "results.jsonl").read_bytes().splitlines())
    )
