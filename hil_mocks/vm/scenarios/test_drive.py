"""A vehicle in a rendered world, in real time: the daemon in one process, the planner in another, Zenoh between them.

It runs on the host, since an emulated processor is too slow for it.
"""

import socket
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from hil_mocks.closed_loop.live import LENS, world_of
from hil_mocks.closed_loop.loop import Log
from lcf_edge.config import Camera, Config, Imu, Vehicle, Zenoh, to_toml

ROOT = Path(__file__).parents[3]
SEED = 121  # somebody crosses ahead; at the end a box stands in the way
MAX_DURATION_S = 300.0


@pytest.fixture
def endpoint() -> str:
    """A free port of the host."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def test_a_planner_in_another_process_drives_by_what_the_daemon_tells(tmp_path: Path, endpoint: str) -> None:
    world = world_of(SEED)
    width, height = LENS.width, LENS.height
    config = Config(
        camera=Camera(
            driver="recording",
            recording="rendered world",
            width=width,
            height=height,
            fps=world.fps,
            intrinsics=[LENS.focal_px, LENS.focal_px, (width - 1) / 2, (height - 1) / 2],
            height_m=world.camera_height_m,
            pitch_rad=world.camera_pitch_rad,
        ),
        imu=Imu(driver="recording"),
        vehicle=Vehicle(half_width_m=world.build.half_width_m, speed_source="odometry"),
        zenoh=Zenoh(listen=[endpoint]),
    )
    (tmp_path / "config.toml").write_text(to_toml(config), encoding="utf-8")
    planner = [sys.executable, "examples/planner.py", endpoint, str(world.cruise_mps)]
    planner += [str(world.build.half_width_m), str(LENS.focal_px)]
    vehicle = [sys.executable, "-m", "hil_mocks.closed_loop.live", str(SEED), "-c", str(tmp_path / "config.toml")]
    with subprocess.Popen(planner, cwd=ROOT, stdout=subprocess.PIPE) as planning:
        try:
            done = subprocess.run(
                vehicle, cwd=ROOT, stdin=planning.stdout, stdout=subprocess.PIPE, timeout=MAX_DURATION_S, check=True
            )
        finally:
            planning.kill()
    log = msgspec.json.decode(done.stdout.splitlines()[-1], type=Log)
    assert log.distance_m > 0.9 * world.course.length_m
    assert log.contacts == []
    assert min(log.target_mps[len(log.target_mps) // 4 :]) < world.cruise_mps  # it had something to brake for
