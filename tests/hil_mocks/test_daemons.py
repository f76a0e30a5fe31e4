"""The programs that run the daemon on stand-ins: they end as `lcf-edge` does, whatever a device's thread is at."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks import session
from hil_mocks.soak import stand_ins
from lcf_edge.rendered import scenes
from tests.lcf_edge.daemon.process import Process, end, ended, line_of

HANGING = """
import sys, threading
import cv2, numpy as np

def hang(_):
    sys.stderr.write("hangs\\n")
    while True:
        cv2.imdecode(picture, cv2.IMREAD_GRAYSCALE)

picture = cv2.imencode(".png", np.random.default_rng(0).integers(0, 256, (600, 800), np.uint8))[1]
"""
SOAK = "from hil_mocks.soak import daemon; daemon.FastCamera.read = hang"
SESSION = "from benchmarks import session_daemon as daemon; daemon.Camera.read = hang"
LIVE = """
from hil_mocks.closed_loop import live as daemon
daemon._Device.read = hang
daemon.drive = lambda *_: threading.Event().wait()  # a drive that lasts
"""


@pytest.fixture(scope="module")
def places(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """The first arguments of each program."""
    folder = tmp_path_factory.mktemp("drive")
    drive = scenes.make("crossing", 1, seconds=0.5, fps=20.0, width=64, height=48, focal_px=50.0)
    stand_ins.save(drive, folder / "drive.npz")
    session.save(drive, folder)
    return {SOAK: [str(folder / "drive.npz"), "1"], SESSION: [str(folder), "run"], LIVE: ["0"]}


@pytest.fixture(params=[SOAK, SESSION, LIVE], ids=["soak", "session", "live"])
def daemon(
    request: pytest.FixtureRequest, places: dict[str, list[str]], tmp_path: Path, endpoint: str
) -> Iterator[Process]:
    """With a camera that hangs where no clock can stop it."""
    settings = [f'zenoh.listen=["{endpoint}"]', "camera.driver=recording", f"camera.recording={tmp_path}"]
    arguments = [*places[request.param], "-c", str(tmp_path / "config.toml")]
    (tmp_path / "config.toml").touch()
    for setting in (*settings, "imu.driver=recording", "memory.budget_mib=1000"):
        arguments += ["--set", setting]
    program = f"{HANGING}\n{request.param}\ndaemon.main(sys.argv[1:])"
    process = subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    yield process
    end(process)


def test_a_device_that_hangs_does_not_abort_it(daemon: Process) -> None:
    line_of(daemon, "hangs")
    daemon.terminate()
    status, _, said = ended(daemon)
    assert status == 0
    assert said[-1].endswith("does not end; abandoned")
