"""Every command and every piece of Python in the documents runs."""

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lcf_edge.cli.command_line import main
from lcf_edge.config import Publish, Zenoh, load
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, ObjectClass, Scene
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording
from lcf_edge.zenoh_link import ScenePublisher, open_session

ROOT = Path(__file__).parents[2]
DOCUMENTS = ("README.md", *sorted(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md")))
PYTHON = ".venv/bin/python "  # where the documents are typed
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
PATIENCE_S = 60.0

Blocks = Callable[[str, str], list[str]]


def commands(document: str) -> list[str]:
    text = (ROOT / document).read_text(encoding="utf-8")
    return [line for block in re.findall(r"^```sh\n(.*?)^```$", text, re.M | re.S) for line in block.splitlines()]


COMMANDS = sorted({command for document in DOCUMENTS for command in commands(document)})


@pytest.mark.parametrize("command", [command for command in COMMANDS if command.startswith("lcf-edge ")], ids=str)
def test_the_commands_run(place: Path, monkeypatch: pytest.MonkeyPatch, endpoint: str, command: str) -> None:
    monkeypatch.chdir(place)
    _, *arguments = shlex.split(command)
    if "--publish" in arguments:
        arguments += ["--set", f'zenoh.listen=["{endpoint}"]']
    assert main(arguments) == 0


@pytest.mark.skipif(shutil.which("make") is None, reason="no make here")
@pytest.mark.parametrize("command", [command for command in COMMANDS if not command.startswith(("lcf-edge ", PYTHON))])
def test_what_else_is_typed_is_a_target_of_make(command: str) -> None:
    make, target, *variables = shlex.split(command)
    done = subprocess.run([make, "--dry-run", target, *variables], cwd=ROOT, check=True, capture_output=True, text=True)
    runs = {"demo": "lcf-edge demo --out demo-out", "test": "-m pytest", "fuzz": "-m tests.fuzz"}[target]
    assert runs in done.stdout
    assert all(variable.partition("=")[2] in done.stdout for variable in variables)


@pytest.mark.parametrize("command", [command for command in COMMANDS if command.startswith(f"{PYTHON}docs/")])
def test_a_script_of_the_documents_runs(place: Path, command: str) -> None:
    _, script, *arguments = shlex.split(command)
    subprocess.run((sys.executable, ROOT / script, *arguments), cwd=place, check=True, timeout=300)
    assert (place / arguments[-1]).stat().st_size > 0


@pytest.mark.parametrize("command", [command for command in COMMANDS if command.startswith(f"{PYTHON}-m ")])
def test_a_driver_by_hand_understands_it_and_says_in_one_line_what_is_missing(command: str) -> None:
    _, *arguments = shlex.split(command)
    done = subprocess.run(
        (sys.executable, *arguments), cwd=ROOT, check=False, capture_output=True, text=True, timeout=60
    )
    assert done.returncode in {0, 1}  # 2 would be wrong usage
    assert len(done.stderr.splitlines()) == done.returncode


def test_every_driver_by_hand_is_called_with_the_python_that_has_it() -> None:
    lines = [line for document in DOCUMENTS for line in (ROOT / document).read_text(encoding="utf-8").splitlines()]
    typed = [line for line in lines if "python -m drivers." in line]
    assert len(typed) > 6
    assert all(re.match(r"(LIBCAMERA_\S+ )?(\.venv|/opt/lcf-edge)/bin/python ", line) for line in typed)


def test_the_page_comes_through_ssh_in_one_way() -> None:
    """With a terminal: the page ends with its connection."""
    texts = [(ROOT / document).read_text(encoding="utf-8") for document in DOCUMENTS]
    typed = [line for text in texts for line in text.splitlines() if line.startswith("ssh ") and line.endswith(" view")]
    assert len(typed) > 1
    assert {re.sub(r"\S+@\S+", "USER@HOST", line) for line in typed} == {
        "ssh -t -L 8088:127.0.0.1:8088 USER@HOST lcf-edge view"
    }


def first_line(code: str, endpoint: str, publish: Callable[[ScenePublisher], object]) -> str:
    """What a subscriber prints first."""
    command = (sys.executable, "-u", "-c", code.replace(DEFAULT_ENDPOINT, endpoint))
    with (
        open_session(Zenoh(listen=[endpoint])) as session,
        subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as subscriber,
    ):
        publisher = ScenePublisher(session, Publish())
        try:
            assert publisher.wait_for_subscriber(PATIENCE_S)
            publish(publisher)
            assert subscriber.stdout
            return subscriber.stdout.readline()
        finally:
            subscriber.kill()


def test_the_subscriber_tells_what_the_demo_finds(blocks: Blocks, place: Path, endpoint: str) -> None:
    (code,) = blocks("README.md", "python")
    assert DEFAULT_ENDPOINT in code
    config = load(place / "demo-out/config.toml")

    def publish(publisher: ScenePublisher) -> None:
        for _, outcome in run(open_recording(place / "demo-out/recording", config), config):
            publisher.put(outcome.scene)
            if len(outcome.scene.objects):
                break

    line = first_line(code, endpoint, publish)
    assert re.fullmatch(r"\d+: (crossing|standing|unknown), contact in \d+\.\d ± \d+\.\d s\n", line)


def test_a_subscriber_needs_no_more_than_numpy_and_zenoh(endpoint: str) -> None:
    code = (ROOT / "examples/without_lcf_edge.py").read_text(encoding="utf-8")
    assert "lcf_edge" not in code.replace("examples/without_lcf_edge.py", "")
    objects = np.zeros(1, OBJECT)
    objects["class_id"], objects["ttc"], objects["ttc_sigma"] = ObjectClass.CROSSING, 2.5, 0.25
    circles, psi = np.zeros(2, CIRCLE), np.zeros(1, PSI_REGION)
    scene = Scene(1_700_000_000_000_000_001, 7, 640, 480, 1.5, circles, psi, objects=objects)
    assert first_line(code, endpoint, lambda publisher: publisher.put(scene)) == "7 [(2, 0., 2.5, 0.25)]\n"
