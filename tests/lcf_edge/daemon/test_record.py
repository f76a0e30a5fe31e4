"""``lcf-edge record`` as a user runs it: a process of its own, real Zenoh, real signals, real files."""

import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader

from lcf_edge.config import load
from tests.emulation import SLOWNESS
from tests.lcf_edge.daemon.process import PATIENCE_S, Process, end, ended, scenes_of

SECONDS = 1.5 * SLOWNESS
LOST_S = 1.0 * SLOWNESS  # at most, to a loss of power

Start = Callable[..., Process]


@pytest.fixture
def start(drive: Path, endpoint: str) -> Iterator[Start]:
    """Start to record the drive."""
    started: list[Process] = []

    def begin(*arguments: str | Path, camera: str = "") -> Process:
        mine = [f'zenoh.listen=["{endpoint}"]', "record.free_mib=0", "camera.height_m=0.77"]
        mine += (
            [f"camera.device={camera}"]
            if camera
            else ["camera.driver=recording", f"camera.recording={drive}", "imu.driver=recording"]
        )
        settings = [argument for setting in mine for argument in ("--set", setting)]
        process = subprocess.Popen(
            [sys.executable, "-m", "lcf_edge", "record", *map(str, arguments), *settings],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={name: value for name, value in os.environ.items() if name != "NOTIFY_SOCKET"},
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        end(process)


def replayed(path: Path, *arguments: str | Path) -> str:
    """The first line of the summary of its replay."""
    command = [sys.executable, "-m", "lcf_edge", "replay", str(path), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    return done.stdout.splitlines()[0]


def messages_in(file: Path) -> int:
    with AnyReader([file]) as reader:
        return reader.message_count


def test_for_some_seconds_and_the_file_is_whole(start: Start, tmp_path: Path) -> None:
    file = tmp_path / "drive.mcap"
    status, out, said = ended(start(file, "--seconds", str(SECONDS)))
    assert status == 0
    assert f"lcf-edge: stopping: {SECONDS:g} s have passed" in said
    with AnyReader([file]) as reader:
        counts = Counter(connection.topic for connection, _, _ in reader.messages())
    frame_count = counts["/lcf/camera/image_raw/compressed"]
    assert out.startswith(f"{file}: {frame_count} images, {counts.total()} messages, ")
    assert frame_count == counts["/lcf/scene"] == counts["/lcf/camera/camera_info"] >= 10
    assert counts["/lcf/imu"] >= 5 * frame_count
    assert counts["/lcf/speed"] > 0
    assert counts["/lcf/diagnostics"] > 0
    assert load(file).camera.height_m == 0.77
    assert load(file).record.when == "never"  # run -c drive.mcap records nothing unasked
    assert replayed(file, "-c", file).split()[:2] == ["frames", f"{frame_count},"]


def test_without_an_ending_it_is_a_folder_that_is_a_bag_of_rosbag2(start: Start, tmp_path: Path) -> None:
    folder = tmp_path / "drive"
    status, out, _ = ended(start(folder, "--seconds", str(SECONDS), "--set", f"record.file_s={0.4 * SECONDS}"))
    assert status == 0
    assert out.startswith(f"{folder}: ")
    files = sorted(path.name for path in folder.glob("*.mcap"))
    assert files[:2] == ["drive_0.mcap", "drive_1.mcap"]
    with Reader(folder) as bag:  # reads what metadata.yaml names, and nothing else
        counts = Counter(connection.topic for connection, _, _ in bag.messages())
        recorded = {connection.topic: connection.msgcount for connection in bag.connections}
        qualities = {connection.topic: connection.ext.offered_qos_profiles for connection in bag.connections}
        assert bag.message_count == counts.total() == sum(messages_in(folder / name) for name in files)
        assert bag.start_time < bag.end_time
    assert {topic: count for topic, count in recorded.items() if count} == counts
    (lasting,) = qualities["/tf_static"]
    assert lasting.durability is QosDurability.TRANSIENT_LOCAL
    assert replayed(folder).split()[1] == f"{counts['/lcf/scene']},"


def test_it_publishes_too_and_a_signal_ends_it(start: Start, tmp_path: Path, endpoint: str) -> None:
    file = tmp_path / "drive.mcap"
    process = start(file)
    seen = scenes_of(process, endpoint)
    published = [next(seen).stamp_ns for _ in range(5)]
    process.send_signal(signal.SIGINT)
    assert ended(process)[0] == 0
    with AnyReader([file]) as reader:
        recorded = [stamp_ns for connection, stamp_ns, _ in reader.messages() if connection.topic == "/lcf/scene"]
    assert set(published) <= set(recorded)


def test_killed_it_leaves_all_but_the_last_second(start: Start, tmp_path: Path, endpoint: str) -> None:
    file = tmp_path / "drive.mcap"
    process = start(file)
    last_ns = first_ns = None
    for scene in scenes_of(process, endpoint):
        first_ns = first_ns or scene.stamp_ns
        last_ns = scene.stamp_ns
        if last_ns - first_ns > 3e9 * LOST_S:
            break
    process.kill()
    process.wait(PATIENCE_S)
    assert first_ns
    assert last_ns
    found: dict[str, list[int]] = {}
    with file.open("rb") as opened, suppress(McapError):  # there is no end
        for _, channel, message in NonSeekingReader(opened).iter_messages(log_time_order=False):
            found.setdefault(channel.topic, []).append(message.log_time)
    for topic in ("/lcf/scene", "/lcf/camera/image_raw/compressed", "/lcf/imu", "/lcf/speed"):
        assert min(found[topic]) <= first_ns
        assert max(found[topic]) >= last_ns - LOST_S * 1e9
    frames = int(replayed(file, "-c", file).split()[1].rstrip(","))
    assert frames == len(found["/lcf/camera/image_raw/compressed"])


@pytest.mark.parametrize(
    ("arguments", "status", "part"),
    [
        (("there.mcap",), 2, "there.mcap: already exists; name another file, or remove it"),
        (("drive.bag",), 2, "drive.bag: the name must end in .mcap"),
        (("nowhere/drive.mcap",), 1, "nowhere/drive.mcap: cannot be written"),
        (("drive.mcap", "--seconds", "0"), 2, "0: write a number above 0"),
        (("drive.mcap", "--set", "record.total_mib=1"), 2, "record.total_mib: must be record.file_mib at least"),
        (("drive", "--set", "record.total_mib=1"), 2, "record.total_mib: must be record.file_mib at least"),
        (("nowhere/drive",), 1, "nowhere/drive: cannot be written"),
        (("drive.mcap", "--set", "record.buffer_mib=100"), 2, "lower record.buffer_mib, or raise it to"),
    ],
)
def test_what_cannot_work_ends_in_one_line(
    start: Start,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    status: int,
    part: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[3]))
    Path("there.mcap").write_text("precious")
    code, out, said = ended(start(*arguments))
    assert (code, out, len(said)) == (status, "", 1)
    assert part in said[0]
    assert [path.name for path in tmp_path.iterdir()] == ["there.mcap"]
    assert Path("there.mcap").read_text() == "precious"


def test_without_an_image_it_has_failed(start: Start, tmp_path: Path) -> None:
    status, out, said = ended(start(tmp_path / "drive.mcap", "--seconds", "0.2", camera="/dev/no-such-camera"))
    assert (status, out) == (1, "")
    assert any("/dev/no-such-camera" in line for line in said)
    assert ": 0 images, " in said[-1]
