"""``lcf-edge watch`` in a real terminal, and in pipes."""

import fcntl
import json
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyte
import pytest

from lcf_edge.rendered import scenes

PATIENCE_S = 30.0
MARK = b"\x1b]2;all of it\x07"
COMMAND = (sys.executable, "-m", "lcf_edge", "watch")


class Terminal:
    """A terminal in which ``watch`` runs; ``shows`` waits for what it shows."""

    def __init__(self, *seen: str, rows: int = 24, columns: int = 100, **environment: str) -> None:
        self.screen = pyte.Screen(columns, rows)
        self._stream = pyte.ByteStream(self.screen)
        self.raw = bytearray()
        self._ours, theirs = pty.openpty()
        self.resize(rows, columns)
        self.before = termios.tcgetattr(theirs)
        self._theirs = theirs
        # A session's first terminal, once opened, is the one whose keys are signals.
        opened = ("sh", "-c", 'exec "$@" <"$0" >"$0" 2>&1', os.ttyname(theirs), *COMMAND, *seen)
        self.process = subprocess.Popen(
            opened, env={**os.environ, "TERM": "xterm-256color", **environment}, start_new_session=True
        )

    def resize(self, rows: int, columns: int) -> None:
        self.screen.resize(rows, columns)
        fcntl.ioctl(self._ours, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def press(self, keys: bytes) -> None:
        os.write(self._ours, keys)

    def shows(self, what: Callable[[list[str]], object]) -> list[str]:
        """The lines, once they are so."""
        deadline_s = time.monotonic() + PATIENCE_S
        while not what(lines := [line.rstrip() for line in self.screen.display]):
            assert time.monotonic() < deadline_s, lines
            self._read(0.2)
        return lines

    def ended(self) -> int:
        """Its exit status, with all read that it wrote."""
        deadline_s = time.monotonic() + PATIENCE_S
        while self.process.poll() is None:
            assert time.monotonic() < deadline_s
            self._read(0.05)
        self.catch_up()
        return self.process.returncode

    def catch_up(self) -> None:
        """Read all that was written so far, which the kernel passes on when it has time: up to a title of our own."""
        os.write(self._theirs, MARK)
        deadline_s = time.monotonic() + PATIENCE_S
        while MARK not in self.raw:
            assert time.monotonic() < deadline_s
            self._read(0.2)
        self.raw = self.raw.replace(MARK, b"")

    def modes(self) -> Any:
        return termios.tcgetattr(self._theirs)

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self._ours)
        os.close(self._theirs)

    def _read(self, timeout_s: float) -> None:
        while select.select([self._ours], [], [], timeout_s)[0]:
            data = os.read(self._ours, 65536)
            self.raw += data
            self._stream.feed(data)
            timeout_s = 0


@pytest.fixture
def terminal(endpoint: str) -> Iterator[Callable[..., Terminal]]:
    terminals: list[Terminal] = []

    def begin(*seen: str, **settings: Any) -> Terminal:
        terminals.append(Terminal(*(seen or ("--connect", endpoint)), **settings))
        return terminals[-1]

    yield begin
    for one in terminals:
        one.close()


def is_live(lines: list[str]) -> bool:
    return lines[0].startswith("live  rover") and any(line.startswith("error  imu") for line in lines)


def given_back(terminal: Terminal) -> bool:
    """The screen that was there before, the cursor, and the keys."""
    return (
        terminal.raw.rfind(b"\x1b[?1049l") > terminal.raw.rfind(b"\x1b[?1049h")
        and terminal.raw.rfind(b"\x1b[?25h") > terminal.raw.rfind(b"\x1b[?25l")
        and terminal.modes() == terminal.before
    )


def test_a_recording_is_played_by_keys(terminal: Callable[..., Terminal], tmp_path: Path) -> None:
    made = scenes.make("crossing", 3, seconds=4.0, fps=20.0, width=320, height=240, focal_px=250.0)
    watch = terminal(str(scenes.write(made, tmp_path / "drive")), "--step")
    watch.shows(lambda lines: lines[0].startswith("paused  drive  0.00 of 3.95 s  x1  ") and "so far" not in lines[0])
    watch.press(b"s")
    watch.shows(lambda lines: lines[0].startswith("paused  drive  0.05 of "))
    watch.press(b"\x1b[C")
    lines = watch.shows(lambda lines: lines[0].startswith("paused  drive  3.95 of "))
    assert any(line.startswith("normal") for line in lines)
    watch.press(b"p")
    watch.shows(lambda lines: lines[0].startswith("paused  drive  ") and "  3.95 of " not in lines[0])
    watch.press(b"+ ")
    watch.shows(lambda lines: lines[0].startswith("plays  drive  ") and "  x2  " in lines[0])
    watch.press(b"q")
    assert watch.ended() == 0
    assert given_back(watch)


def test_the_table_in_a_terminal_of_any_size_until_q(rover: Any, terminal: Callable[..., Terminal]) -> None:
    watch = terminal()
    lines = watch.shows(is_live)
    objects = [line for line in lines if line.startswith(("standing", "crossing", "cutting in"))]
    assert [line.partition("  ")[0] for line in objects] == ["crossing", "standing", "cutting in"]
    assert objects[0].split()[1:6] == ["2.1", "±0.2", "+2.9", "3.2", "±0.5"]
    assert lines.index(objects[2]) < next(at for at, line in enumerate(lines) if line.startswith("2 rebels"))
    table = [line.split() for line in lines if line.startswith(("incoming", "leading", "normal"))]
    assert [row[0] for row in table] == ["incoming", "leading", "normal", "normal", "normal"]
    assert table[0][1:4] == ["1.2", "+2.9", "2.5"]
    assert any(line.startswith("error  imu: away since 2026-01-01") for line in lines)
    watch.resize(7, 40)
    lines = watch.shows(lambda lines: lines[2].endswith("1 not shown") and lines[4].startswith("crossing"))
    assert lines[5].startswith("standing")
    assert lines[6].startswith("2 rebels  3 normal")
    rover.leave()
    watch.shows(lambda lines: lines[0].startswith("daemon away since"))
    rover.come()
    watch.shows(lambda lines: lines[0].startswith("live  rover"))
    watch.press(b"q")
    assert watch.ended() == 0
    assert given_back(watch)
    assert b"Traceback" not in watch.raw


@pytest.mark.usefixtures("rover")
def test_ctrl_z_gives_the_terminal_back_until_it_goes_on(terminal: Callable[..., Terminal]) -> None:
    watch = terminal()
    watch.shows(is_live)
    watch.press(b"\x1a")
    stopped, status = os.waitpid(watch.process.pid, os.WUNTRACED)
    assert (stopped, os.WIFSTOPPED(status)) == (watch.process.pid, True)
    watch.catch_up()
    assert given_back(watch)
    watch.screen.reset()
    watch.process.send_signal(signal.SIGCONT)
    watch.shows(is_live)
    watch.press(b"\x03")
    assert watch.ended() == 0
    assert given_back(watch)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.usefixtures("rover")
def test_a_signal_ends_it_by_the_way_back(
    terminal: Callable[..., Terminal],
    number: signal.Signals,
) -> None:
    watch = terminal(NO_COLOR="1")
    watch.shows(is_live)
    assert b"\x1b[31m" not in watch.raw  # red
    assert b"\x1b[1;31m" not in watch.raw
    watch.process.send_signal(number)
    assert watch.ended() == 128 + number
    assert given_back(watch)


@pytest.mark.usefixtures("rover")
def test_colours_distinguish_rebels(terminal: Callable[..., Terminal]) -> None:
    watch = terminal()
    watch.shows(is_live)
    assert b"\x1b[1;31m" in watch.raw


def lines_of(endpoint: str, *more: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        (*COMMAND, "--connect", endpoint, *more), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.mark.usefixtures("rover")
def test_json_is_a_line_a_scene_and_ends_quietly_when_nobody_reads(endpoint: str) -> None:
    with lines_of(endpoint, "--json") as watch:
        assert watch.stdout
        assert watch.stderr
        scenes = [json.loads(watch.stdout.readline()) for _ in range(3)]
        watch.stdout.close()
        assert watch.wait(PATIENCE_S) == 141
        assert watch.stderr.read() == ""
    first, *_ = scenes
    assert set(first) == {"stamp_ns", "seq", "objects", "circles", "psi", "speed", "image_width", "image_height"}
    assert [thing["class"] for thing in first["objects"]] == ["standing", "crossing", "cutting_in"]
    assert (first["objects"][1]["ttc_s"], first["objects"][1]["ttc_sigma_s"]) == (2.125, 0.25)
    assert first["circles"][3]["cause"] == "incoming"
    assert (first["circles"][3]["ttc_s"], first["circles"][3]["lateral_m"]) == (1.25, None)
    assert first["psi"][0] == {"id": 1, "shape": "circle", "x": 200.0, "y": 150.0, "r": 25.0}
    assert [scene["seq"] for scene in scenes] == list(range(first["seq"], first["seq"] + 3))


@pytest.mark.usefixtures("rover")
def test_json_needs_no_more_than_the_program(endpoint: str) -> None:
    code = (
        "import sys; sys.modules['rich'] = sys.modules['cv2'] = None\n"
        "from lcf_edge.cli.command_line import main; sys.exit(main(sys.argv[1:]))"
    )
    command = (sys.executable, "-c", code, "watch", "--connect", endpoint)
    with subprocess.Popen((*command, "--json"), stdout=subprocess.PIPE, text=True) as watch:
        assert watch.stdout
        assert json.loads(watch.stdout.readline())["speed"] == 1.5
        watch.send_signal(signal.SIGINT)
        assert watch.wait(PATIENCE_S) == 130
    table = subprocess.run(command, check=False, capture_output=True, text=True, timeout=PATIENCE_S)
    assert table.returncode == 1
    assert table.stderr == "lcf-edge: watch: rich is missing; run pip install 'lcf-edge[watch]', or use --json\n"


@pytest.mark.usefixtures("rover")
def test_into_a_pipe_the_table_is_plain_text(endpoint: str) -> None:
    with lines_of(endpoint) as watch:
        assert watch.stdout
        text = iter(watch.stdout.readline, "")
        line = next(line for line in text if line.startswith("incoming"))
        assert "\x1b" not in line
        watch.stdout.close()
        assert watch.wait(PATIENCE_S) == 141


@pytest.mark.parametrize(
    ("arguments", "status", "part"),
    [
        (("--connect", "nonsense"), 1, "nonsense"),
        (("--prefix", "a//b"), 1, "a//b"),
        (("--zenoh-config", "/no/such.json5"), 1, "/no/such.json5"),
        (("--conect", "x"), 2, "--conect"),
    ],
)
def test_wrong_usage_is_one_line(arguments: tuple[str, ...], status: int, part: str) -> None:
    for json_lines in ((), ("--json",)):
        done = subprocess.run(
            (*COMMAND, *arguments, *json_lines), check=False, capture_output=True, text=True, timeout=PATIENCE_S
        )
        assert done.returncode == status
        assert len(done.stderr.splitlines()) == 1
        assert part in done.stderr


def test_when_the_terminal_goes_away_it_ends(endpoint: str) -> None:
    ours, theirs = pty.openpty()
    command = (sys.executable, "-m", "lcf_edge", "watch", "--connect", endpoint)
    process = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=subprocess.PIPE, start_new_session=True)
    os.close(theirs)
    os.read(ours, 1)  # it draws
    os.close(ours)  # it is not the terminal of its session: no SIGHUP comes
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode in {0, 1}  # it wanted to read, or to write
    assert len(said.decode().splitlines()) == process.returncode
