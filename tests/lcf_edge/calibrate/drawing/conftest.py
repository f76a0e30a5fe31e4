"""`calibrate mask --draw` as a process, on a recording of a rover that sees its own bumper."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from lcf_edge.rendered import scenes

PATIENCE_S = 60.0


class Drawing:
    """The command, and what is asked of its page."""

    def __init__(self, *arguments: str) -> None:
        command = (sys.executable, "-m", "lcf_edge", "calibrate", "mask", "--draw", "--port", "0", *arguments)
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stderr
        self.address = self.process.stderr.readline().removeprefix("open ").removesuffix(" (Ctrl-C ends)\n")
        self._cookie = ""
        parts = urlsplit(self.address)
        self._cookie = self.ask(f"/?{parts.query}").headers["Set-Cookie"].split(";")[0]

    def ask(self, path: str, body: bytes | None = None, **headers: str) -> Any:
        """One answer, read into its ``body``. With a body: sent as JSON, unless ``headers`` say otherwise."""
        parts = urlsplit(self.address)
        connection = HTTPConnection(parts.hostname or "", parts.port, timeout=PATIENCE_S)
        kind = {"Cookie": self._cookie} | ({} if body is None else {"Content-Type": "application/json"})
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request("GET" if body is None else "POST", path, body, kind | named)
        answer: Any = connection.getresponse()
        answer.body = answer.read()
        connection.close()
        return answer

    def send(self, path: str, *polygons: Any) -> tuple[int, str]:
        """Status and text of the answer to a drawing."""
        answer = self.ask(path, json.dumps({"polygons": polygons}).encode())
        return answer.status, answer.body.decode()

    def state(self) -> dict[str, Any]:
        known: dict[str, Any] = json.loads(self.ask("/state").body)
        return known

    def end(self) -> tuple[int, str, str]:
        """Exit status, output and errors, once it has ended by itself."""
        out, errors = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, out, errors

    def interrupt(self) -> tuple[int, str, str]:
        self.process.send_signal(signal.SIGINT)
        return self.end()


@pytest.fixture(scope="session")
def bumper(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 320 x 240 px, of which the lowest rows show a bumper."""
    drive = scenes.make("own_bumper", 24, fps=5.0, width=320, height=240, focal_px=250.0)
    return scenes.write(drive, tmp_path_factory.mktemp("bumper"))


@pytest.fixture
def rover(tmp_path: Path) -> Path:
    """A configuration of 640 x 480 px."""
    file = tmp_path / "rover.toml"
    file.write_text("# my rover\n[camera]\nwidth = 640\nheight = 480\n", encoding="utf-8")
    return file


@pytest.fixture
def draw(bumper: Path, rover: Path) -> Iterator[Callable[..., Drawing]]:
    begun: list[Drawing] = []

    def begin(*arguments: str, live: bool = False) -> Drawing:
        camera = ("--set", "camera.driver=recording", "--set", f"camera.recording={bumper}")
        source = camera if live else ("--from", str(bumper))
        begun.append(Drawing("-c", str(rover), *source, *arguments))
        return begun[-1]

    yield begin
    for one in begun:
        one.process.kill()
        one.process.communicate(timeout=PATIENCE_S)
