"""``lcf-edge run`` as systemd starts it: a process of its own, real Zenoh, real signals."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from lcf_edge.config import Zenoh
from lcf_edge.zenoh_link import opened_session
from tests.emulation import EMULATED
from tests.lcf_edge.daemon.process import PATIENCE_S, Process, end, ended, line_of, scenes_of, wait_for

Start = Callable[..., Process]


@pytest.fixture
def start(drive: Path, endpoint: str, manager: Any, tmp_path: Path) -> Iterator[Start]:
    """Start the daemon on the drive, with more settings."""
    daemons: list[Process] = []

    def begin(*settings: str, drives: bool = True, program: tuple[str, ...] = ("-m", "lcf_edge")) -> Process:
        (tmp_path / "config.toml").touch()
        mine = [f'zenoh.listen=["{endpoint}"]']
        if EMULATED:
            mine.append("memory.budget_mib=1000")  # the emulator's own memory counts
        if drives:
            mine += ["camera.driver=recording", f"camera.recording={drive}", "imu.driver=recording"]
        arguments = [argument for setting in (*mine, *settings) for argument in ("--set", setting)]
        daemon = subprocess.Popen(
            [sys.executable, *program, "run", "-c", str(tmp_path / "config.toml"), *arguments],
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, **manager.environment},
        )
        daemons.append(daemon)
        manager.daemon = daemon
        return daemon

    yield begin
    for daemon in daemons:
        end(daemon)


def test_a_subscriber_receives_scenes_of_now_until_sigterm(start: Start, manager: Any, endpoint: str) -> None:
    daemon = start()
    seen = []
    for scene in scenes_of(daemon, endpoint):
        seen.append((time.time_ns(), scene))
        if len(seen) == 10:
            break
    assert all(abs(now_ns - scene.stamp_ns) < PATIENCE_S * 1e9 for now_ns, scene in seen)
    assert (seen[0][1].image_width, seen[0][1].image_height) == (320, 240)
    numbers = [scene.seq for _, scene in seen]
    assert numbers == sorted(set(numbers))
    messages = manager.until("READY=1")
    assert messages[-1] == "READY=1"
    daemon.send_signal(signal.SIGTERM)
    manager.until("STOPPING=1")
    status, _, said = ended(daemon)
    assert status == 0
    assert said[-1] == "lcf-edge: stopping: SIGTERM"
    assert not [line for line in said if "error" in line or "abandoned" in line]


def test_sigint_ends_it_too_and_sighup_reads_again(start: Start, manager: Any, tmp_path: Path) -> None:
    daemon = start()
    manager.until("READY=1")
    daemon.send_signal(signal.SIGHUP)
    manager.until("RELOADING=1")
    manager.until("READY=1")
    (tmp_path / "config.toml").write_text("[filter]\ntr_s = 3.5\n")
    manager.until("RELOADING=1")  # nobody had to send a signal
    manager.until("READY=1")
    daemon.send_signal(signal.SIGINT)
    status, _, said = ended(daemon)
    assert status == 0
    assert "lcf-edge: reload: changed nothing" in said
    assert "lcf-edge: reload: changed filter.tr_s" in said
    assert said[-1] == "lcf-edge: stopping: SIGINT"


def test_an_uncompiled_filter_is_reported_once_at_the_start(
    start: Start, manager: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LCF_EDGE_PURE", "1")
    daemon = start("camera.device=/dev/no-such-camera", drives=False)
    manager.until("READY=1")
    daemon.terminate()
    _, _, said = ended(daemon)
    assert said[0].startswith("lcf-edge: warning: the filter runs uncompiled, about 100 times slower: LCF_EDGE_PURE")
    assert len([line for line in said if "uncompiled" in line]) == 1


def test_after_sigkill_the_next_one_starts(start: Start, manager: Any, endpoint: str) -> None:
    first = start()
    next(scenes_of(first, endpoint))
    manager.until("READY=1")  # which may come after the first scene
    first.kill()
    first.wait(PATIENCE_S)
    second = start()
    next(scenes_of(second, endpoint))
    manager.until("READY=1")
    second.terminate()
    assert ended(second)[0] == 0


def test_without_a_camera_it_lives_and_says_since_when(start: Start, manager: Any, endpoint: str) -> None:
    daemon = start("camera.device=/dev/no-such-camera", drives=False)
    manager.until("READY=1")
    with opened_session(Zenoh(connect=[endpoint], listen=[])) as session:
        handler: Any = zenoh.handlers.RingChannel(4)
        alive: Any = session.liveliness().declare_subscriber("lcf/@alive/*", handler, history=True)
        assert str(wait_for(daemon, alive.try_recv).key_expr) == "lcf/@alive/rover"
        alive.undeclare()
        subscriber: Any = session.declare_subscriber("lcf/diagnostics", handler)
        messages = wait_for(daemon, subscriber.try_recv).payload.to_bytes()
        subscriber.undeclare()
    assert b"away since 2" in messages
    assert b"/dev/no-such-camera" in messages
    daemon.terminate()
    status, _, said = ended(daemon)
    assert status == 0
    assert [line for line in said if line.startswith("lcf-edge: error: camera: /dev/no-such-camera")]


@pytest.mark.parametrize(
    ("settings", "status", "part"),
    [
        (("memory.budget_mib=20",), 2, "memory.budget_mib: about"),
        (("camera.intrinsics=[500, 500, 320, 320]", "camera.width=640", "camera.height=640"), 2, "camera.intrinsics"),
        (('zenoh.listen=["tcp/192.0.2.1:7447"]',), 1, "192.0.2.1"),
        (("publish.prefix=a*",), 1, "publish.prefix"),
    ],
)
def test_what_cannot_work_ends_in_one_line(start: Start, settings: tuple[str, ...], status: int, part: str) -> None:
    code, _, said = ended(start(*settings))
    assert code == status
    assert part in said[-1]
    assert said[-1].startswith("lcf-edge: ")


LATE = """
import time
now_ns = time.time_ns
time.time_ns = lambda: now_ns() + {years} * 31_556_952 * 10**9
from lcf_edge.cli.command_line import program
program()
"""


@pytest.mark.parametrize("years", [200, 300, 9000])
def test_a_clock_that_no_message_can_express_is_no_end(start: Start, manager: Any, tmp_path: Path, years: int) -> None:
    daemon = start("record.when=always", f"record.folder={tmp_path}", program=("-c", LATE.format(years=years)))
    manager.until("READY=1")
    for _ in range(3):
        manager.until("STATUS=")
    daemon.terminate()
    status, _, said = ended(daemon)
    assert status == 0
    assert said[-1] == "lcf-edge: stopping: SIGTERM"


# A camera that hangs where no clock can stop it, as in a decoder or a broken driver.
HANGING = """
import cv2, numpy as np
from lcf_edge.cli.command_line import program
from lcf_edge.recording.playback import RecordedCamera

def read_and_hang(camera, read=RecordedCamera.read, seen=[]):
    while seen:
        cv2.imdecode(picture, cv2.IMREAD_GRAYSCALE)
    seen += read(camera)
    return list(seen)

picture = cv2.imencode(".png", np.random.default_rng(0).integers(0, 256, (600, 800), np.uint8))[1]
RecordedCamera.read = read_and_hang
program()
"""


def test_a_device_that_hangs_does_not_keep_it_from_ending_well(start: Start, manager: Any) -> None:
    daemon = start(program=("-c", HANGING))
    manager.until("READY=1")
    daemon.terminate()
    status, _, said = ended(daemon)
    assert status == 0
    assert said[-1] == "lcf-edge: warning: camera: does not end; abandoned"


# A stand-in for strangers: whatever opens files in its process once the FIFO is written to, and tries for ever.
CROWDED = """
import os, resource, threading
from lcf_edge.cli.command_line import program

def crowd():
    open({fifo!r}).close()
    while True:
        try:
            os.open(os.devnull, os.O_RDONLY)
        except OSError:
            threading.Event().wait(0.1)

resource.setrlimit(resource.RLIMIT_NOFILE, (256, 256))
threading.Thread(target=crowd, daemon=True).start()
program()
"""


def test_without_descriptors_it_lives_reports_and_reads_its_configuration(
    start: Start, manager: Any, tmp_path: Path
) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    daemon = start(program=("-c", CROWDED.format(fifo=str(fifo))))
    manager.until("READY=1")
    fifo.write_bytes(b"")
    line_of(daemon, "file descriptors")
    written = tmp_path / "config.new"
    written.write_text("[filter]\ntr_s = 3.5\n")
    written.replace(tmp_path / "config.toml")  # at once: half a file would be read, and change nothing
    assert line_of(daemon, "reload: changed") == "lcf-edge: reload: changed filter.tr_s\n"
    manager.until("STATUS=")
    daemon.terminate()
    assert ended(daemon)[0] == 0


def test_two_at_one_port(start: Start, endpoint: str) -> None:
    next(scenes_of(start(), endpoint))
    status, _, said = ended(start())
    assert status == 1
    assert "already in use" in said[-1]
