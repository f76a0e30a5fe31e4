"""The map of the documents is whole; questions quote real messages; the guide to several cameras works."""

import ast
import re
import shlex
import shutil
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


@pytest.fixture
def cameras(blocks: Blocks, tmp_path: Path) -> list[Config]:
    """The configurations of the two daemons."""
    found = []
    for number, content in enumerate(blocks("docs/several-cameras.md", "toml")):
        file = tmp_path / f"{number}.toml"
        file.write_text(content, encoding="utf-8")
        found.append(load(file))
    return found


def test_two_daemons_share_nothing(cameras: list[Config]) -> None:
    front, left = cameras
    assert front.camera.device != left.camera.device
    assert front.imu.address != left.imu.address
    assert not set(front.zenoh.listen) & set(left.zenoh.listen)
    assert front.publish.prefix != left.publish.prefix


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
    assert heard == {"front 7 0\n", "left 7 0\n"}


def test_the_second_unit_has_its_own_configuration_and_folder(blocks: Blocks, tmp_path: Path) -> None:
    (block,) = [text for text in blocks("docs/several-cameras.md", "bash") if text.startswith("sed ")]
    line, _, _ = block.replace("\\\n", "").partition(" |" + " sudo tee")
    *command, _ = shlex.split(line)
    unit = subprocess.run(
        (*command, ROOT / "systemd/lcf-edge.service"), check=True, capture_output=True, text=True
    ).stdout
    assert "ExecStart=/opt/lcf-edge/bin/lcf-edge run -c /etc/lcf-edge/left.toml\n" in unit
    assert "WorkingDirectory=%S/lcf-edge-left\n" in unit
    assert "StateDirectory=lcf-edge-left\n" in unit
    if shutil.which("systemd-analyze"):
        file = tmp_path / "lcf-edge-left.service"
        file.write_text(unit.replace("/opt/lcf-edge/bin/lcf-edge", "/bin/true"), encoding="utf-8")
        done = subprocess.run(("systemd-analyze", "verify", file), check=False, capture_output=True, text=True)
        assert [said for said in done.stderr.splitlines() if file.name in said] == []
