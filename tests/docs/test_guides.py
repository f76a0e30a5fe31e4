"""The map of the documents is whole; questions quote real messages; the guide to several cameras works."""

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from lcf_edge.config import Config, Publish, Zenoh, load
from lcf_edge.messages import CIRCLE, PSI_REGION, Scene
from lcf_edge.zenoh_link import ScenePublisher, open_session

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PATIENCE_S = 60.0

Blocks = Callable[[str, str], list[str]]


def text_of(page: str) -> str:
    return (DOCS / page).read_text(encoding="utf-8")


def test_every_page_is_on_the_map_once() -> None:
    named = re.findall(r"\]\(([\w-]+\.md)\)", text_of("README.md"))
    assert sorted(named) == sorted(path.name for path in DOCS.glob("*.md") if path.name != "README.md")


@pytest.fixture(scope="module")
def said() -> str:
    """Everything that the program can say, one text a line."""
    trees = (
        ast.parse(path.read_text("utf-8")) for part in ("lcf_edge", "drivers") for path in (ROOT / part).rglob("*.py")
    )
    nodes = (node for tree in trees for node in ast.walk(tree))
    return "\n".join(node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str))


MESSAGES = [
    message
    for row in re.findall(r"^\| (`.+?) \|", text_of("faq.md"), re.M)
    for message in re.findall(r"`([^`]+)`", row)
]


def test_the_questions_quote_messages() -> None:
    assert len(MESSAGES) > 12


@pytest.mark.parametrize("message", MESSAGES)
def test_a_message_among_the_questions_is_one_of_the_programs(said: str, message: str) -> None:
    assert message in said


def test_the_oldest_python_is_that_of_the_package() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    (oldest,) = re.findall(r"Python ([\d.]+) or later", text_of("platforms.md"))
    assert project["requires-python"] == f">={oldest}"


INSTANCES = ("front", "tele")


@pytest.fixture
def cameras(blocks: Blocks, tmp_path: Path) -> list[Config]:
    """The configurations of the two daemons."""
    found = []
    for name, content in zip(INSTANCES, blocks("docs/several-cameras.md", "toml"), strict=True):
        file = tmp_path / f"{name}.toml"
        file.write_text(content, encoding="utf-8")
        found.append(load(file))
    return found


def test_two_daemons_share_nothing(cameras: list[Config]) -> None:
    front, tele = cameras
    assert front.camera.device != tele.camera.device
    assert front.imu.address != tele.imu.address
    assert not set(front.zenoh.listen) & set(tele.zenoh.listen)
    assert front.publish.prefix != tele.publish.prefix
    assert front.publish.frame_id != tele.publish.frame_id
    assert front.publish.robot != tele.publish.robot


def test_the_instances_of_the_unit_read_these_files_and_keep_recordings_in_these_folders(
    cameras: list[Config], blocks: Blocks
) -> None:
    text = text_of("several-cameras.md")
    unit = (ROOT / "systemd/lcf-edge@.service").read_text(encoding="utf-8")
    started = f"sudo systemctl enable --now {' '.join(f'lcf-edge@{name}' for name in INSTANCES)}\n"
    assert any(started in block for block in blocks("docs/several-cameras.md", "bash"))
    for name, config in zip(INSTANCES, cameras, strict=True):
        of_this = unit.replace("%i", name).replace("%S", "/var/lib")
        assert f"`/etc/lcf-edge/{name}.toml`:" in text
        assert f"lcf-edge run -c /etc/lcf-edge/{name}.toml\n" in of_this
        assert f"WorkingDirectory={config.record.folder}\n" in of_this


def test_a_planner_hears_both(cameras: list[Config], blocks: Blocks, endpoint: str) -> None:
    (code,) = blocks("docs/several-cameras.md", "python")
    for config in cameras:
        assert f'("{config.publish.prefix.removesuffix("/lcf")}", "{config.zenoh.listen[0]}")' in code
        code = code.replace(config.zenoh.listen[0], endpoint)
    scene = Scene(1_700_000_000_000_000_001, 7, 640, 480, 1.5, np.zeros(0, CIRCLE), np.zeros(0, PSI_REGION))
    command = (sys.executable, "-u", "-c", code)
    with ExitStack() as stack:
        session = stack.enter_context(open_session(Zenoh(listen=[endpoint])))
        planner = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        stack.callback(planner.kill)
        for config in cameras:
            publisher = ScenePublisher(session, Publish(prefix=config.publish.prefix))
            assert publisher.wait_for_subscriber(PATIENCE_S)
            publisher.put(scene)
        assert planner.stdout
        heard = {planner.stdout.readline() for _ in cameras}
    assert heard == {"front 7 0\n", "tele 7 0\n"}
