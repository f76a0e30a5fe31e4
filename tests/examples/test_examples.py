"""Each example does what it says, as a program of its own. The planner has tests of its own."""

import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from lcf_edge.config import Publish, Zenoh
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, ObjectClass, Scene
from lcf_edge.rendered import scenes
from lcf_edge.zenoh_link import ScenePublisher, opened_session

ROOT = Path(__file__).parents[2]
PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walker who crosses; its configuration is beside the recording."""
    folder = tmp_path_factory.mktemp("drive")
    made = scenes.make("crossing", 3, seconds=2.0, fps=20.0, width=320, height=240, focal_px=250.0)
    (folder / "config.toml").write_text(f"[camera]\nheight_m = {made.camera_height_m}\n", encoding="utf-8")
    return scenes.write(made, folder / "recording").parent


def output_of(example: str, *arguments: Path) -> str:
    command = (sys.executable, "-m", f"examples.{example}", *map(str, arguments))
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True, timeout=PATIENCE_S).stdout


def test_the_smallest_subscriber_prints_what_comes(endpoint: str) -> None:
    things = np.zeros(1, OBJECT)
    things["class_id"], things["ttc"], things["ttc_sigma"] = ObjectClass.CROSSING, 2.5, 0.25
    scene = Scene(time.time_ns(), 7, 640, 480, 1.5, np.empty(0, CIRCLE), np.empty(0, PSI_REGION), things)
    command = (sys.executable, "-m", "examples.subscriber", endpoint)
    with (
        opened_session(Zenoh(listen=[endpoint])) as session,
        subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as subscriber,
    ):
        try:
            publisher = ScenePublisher(session, Publish())
            assert publisher.wait_for_subscriber(PATIENCE_S)
            publisher.put(scene)
            assert subscriber.stdout
            assert subscriber.stdout.readline() == "7: crossing, contact in 2.5 ± 0.2 s\n"
        finally:
            subscriber.kill()


def test_a_sink_of_one_s_own_has_a_row_for_each_frame_with_objects(drive: Path, tmp_path: Path) -> None:
    output_of("custom_sink", drive / "recording", drive / "config.toml", tmp_path / "urgent.csv")
    header, *rows = (tmp_path / "urgent.csv").read_text(encoding="utf-8").splitlines()
    assert header == "seq,id,ttc_s"
    assert rows
    assert all(re.fullmatch(r"\d+,\d+,(\d+\.\d\d|inf)", row) for row in rows)
    numbers = [int(row.partition(",")[0]) for row in rows]
    assert numbers == sorted(set(numbers))


def test_a_replay_tells_how_many_objects_there_were_and_keeps_an_image(drive: Path, tmp_path: Path) -> None:
    output = output_of("replay", drive / "recording", drive / "config.toml", tmp_path / "frame.png")
    assert re.fullmatch(r"40 frames, \d+\.\d\d objects a frame, at most \d+: .*frame\.png\n", output)
    assert (tmp_path / "frame.png").stat().st_size > 10_000


def test_every_example_is_tested() -> None:
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests").rglob("test_*.py"))
    names = {path.stem for path in (ROOT / "examples").glob("*.py")} - {"__init__"}
    assert {
        name
        for name in names
        if f"examples.{name}" not in tests and f'"{name}"' not in tests and f"/{name}.py" not in tests
    } == set()
