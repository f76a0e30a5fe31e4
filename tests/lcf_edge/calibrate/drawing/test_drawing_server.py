"""What the page may ask, and what the command makes of it: the real server over real HTTP."""

import socket
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import cv2
import numpy as np
import pytest

from lcf_edge.cli.command_line import main
from lcf_edge.config import load

Draw = Callable[..., Any]

TRIANGLE = [[0, 0], [20, 0], [0, 20]]
TOO_LARGE = 2**19 + 1


@pytest.fixture
def drawing(draw: Draw) -> Any:
    return draw()


def test_the_page_comes_with_a_strict_policy_and_nothing_from_elsewhere(drawing: Any) -> None:
    for path in ("/", "/base.css", "/page.css", "/page.js", "/outlines.js", "/surface.js", "/icon.svg"):
        answer = drawing.ask(path)
        assert answer.status == 200
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        assert b"//" not in answer.body.replace(b"http://www.w3.org/2000/svg", b"").replace(b"// ", b"")


def test_only_this_machine_and_this_page_are_let_in(drawing: Any) -> None:
    host = urlsplit(drawing.address).netloc
    saved = b'{"polygons": [[[0, 0], [20, 0], [0, 20]]]}'
    for path in ("/", "/state", "/image"):
        assert drawing.ask(path, Host="localhost:8088").status == 200  # through a tunnel
        assert drawing.ask(path, Host="evil.example").status == 403
    assert drawing.ask("/save", saved, Host="evil.example").status == 403
    assert drawing.ask("/save", saved, Origin="http://evil.example").status == 403
    assert drawing.ask("/save", saved, Content_Type="text/plain").status == 400
    assert drawing.ask("/save", saved, Origin=f"http://{host}").status == 204


def test_it_listens_on_loopback_alone_and_other_users_of_this_machine_are_kept_out(drawing: Any) -> None:
    assert urlsplit(drawing.address).hostname == "127.0.0.1"
    for path in ("/", "/page.js", "/state", "/image", "/?token=guessed"):
        assert drawing.ask(path, Cookie="").status == 403
    for path in ("/check", "/save"):
        assert drawing.ask(path, b'{"polygons": []}', Cookie="lcf_edge_view_0=guessed").status == 403
    assert drawing.process.poll() is None


def test_the_image_is_that_of_the_recording_and_the_proposal_comes_with_it(drawing: Any) -> None:
    answer = drawing.ask("/image")
    assert answer.headers["Content-Type"] == "image/jpeg"
    image = cv2.imdecode(np.frombuffer(answer.body, np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    assert image.shape == (240, 320)
    while (state := drawing.state())["measuring"]:
        assert state["proposed"] == []
    (polygon,) = state["proposed"]
    assert max(y for _, y in polygon) == 239
    assert "1 own part" in state["note"]
    assert not state["live"]


def test_what_is_checked_is_answered_with_the_lines_that_saving_prints(draw: Draw, rover: Path) -> None:
    drawing = draw()
    status, lines = drawing.send("/check", TRIANGLE)
    assert (status, lines) == (200, "[camera]\nmask = [[[0, 0], [40, 0], [0, 40]]]\n")  # px of the configured size
    assert drawing.send("/save", TRIANGLE) == (204, "")
    status, out, errors = drawing.end()
    assert (status, errors) == (0, "")
    assert out == f"# 1 own part, as drawn\n# px of an image of 640x480 (camera.width, camera.height)\n{lines}"
    assert "mask" not in rover.read_text(encoding="utf-8")


def test_with_write_it_is_in_the_file(draw: Draw, rover: Path, tmp_path: Path) -> None:
    report = tmp_path / "mask.png"
    drawing = draw("--write", "--report", str(report))
    drawing.send("/save", TRIANGLE, [[10.5, 10], [30, 10], [10, 30]])
    status, out, _ = drawing.end()
    assert status == 0
    assert load(rover).camera.mask == tomllib.loads(out)["camera"]["mask"]
    assert len(load(rover).camera.mask) == 2
    assert f"# written to {rover}" in out
    assert cv2.imread(str(report)) is not None


def test_it_begins_with_the_mask_of_the_configuration_or_the_polygons_given(draw: Draw, rover: Path) -> None:
    rover.write_text(rover.read_text() + "mask = [[[1, 1], [41, 1], [1, 41]]]\n", encoding="utf-8")
    assert draw().state()["given"] == [[[0.25, 0.25], [20.25, 0.25], [0.25, 20.25]]]
    assert draw("--polygon", "0,0,9,0,0,9").state()["given"] == [[[0, 0], [9, 0], [0, 9]]]


def test_a_mask_that_was_left_as_it_was_stays_the_same(draw: Draw, rover: Path) -> None:
    mask = [[[1, 2], [437, 3], [639, 479]]]
    rover.write_text(rover.read_text() + f"mask = {mask}\n", encoding="utf-8")
    drawing = draw()
    drawing.send("/save", *drawing.state()["given"])
    assert tomllib.loads(drawing.end()[1])["camera"]["mask"] == mask


@pytest.mark.parametrize(
    ("polygons", "why"),
    [
        ([[[0, 0], [9, 0]]], "polygon 1 must have 3 to 256 points"),
        ([TRIANGLE, []], "polygon 2 must have 3 to 256 points"),
        ([[[0, 0]] * 257], "polygon 1 must have 3 to 256 points"),
        ([TRIANGLE] * 65, "65 polygons, more than 64"),
        ([[[0, 0], [1e300, 0], [0, 9]]], "polygon 1 lies far outside an image of 640x480 px"),
    ],
)
def test_what_the_configuration_would_refuse_is_refused_in_one_line(
    drawing: Any, polygons: list[Any], why: str
) -> None:
    for path in ("/check", "/save"):
        status, text = drawing.send(path, *polygons)
        assert status == 400
        assert text.count("\n") == 1
        assert why in text
    assert drawing.send("/save", TRIANGLE)[0] == 204  # it goes on until something can be used


def test_what_is_no_drawing_is_refused(drawing: Any) -> None:
    for body in (
        b"",
        b"[]",
        b"{",
        b"{}",
        b'{"polygons": 1}',
        b'{"polygons": [[[0, 0, 0]]]}',
        b'{"polygons": [[["0", 0]]]}',
        b'{"polygons": [[[NaN, 0], [1, 0], [0, 1]]]}',
        b'{"polygons": [], "more": 1}',
        b"\xff",
    ):
        answer = drawing.ask("/save", body)
        assert (answer.status, answer.body.count(b"\n")) == (400, 1), body
    assert drawing.ask("/save", b" " * TOO_LARGE).status == 413
    assert drawing.process.poll() is None


def test_ctrl_c_ends_it_with_nothing_written(draw: Draw, rover: Path) -> None:
    before = rover.read_text(encoding="utf-8")
    drawing = draw("--write")
    drawing.send("/check", TRIANGLE)
    assert drawing.interrupt() == (130, "", "")
    assert rover.read_text(encoding="utf-8") == before


def test_a_camera_delivers_image_after_image_until_ctrl_c_ends_it(draw: Draw) -> None:
    drawing = draw(live=True)
    state = drawing.state()
    assert (state["live"], state["measuring"]) == (True, True)
    while drawing.state()["number"] == state["number"]:
        pass
    assert drawing.interrupt() == (130, "", "")


@pytest.mark.parametrize(
    ("arguments", "status", "part"),
    [
        (["--from", "missing"], 1, "missing"),
        (["--set", "camera.device=/dev/no-such-camera"], 1, "/dev/no-such-camera"),
        (["--port", "70000"], 2, "--port: 70000"),
    ],
)
def test_what_cannot_be_shown_ends_in_one_line(
    capsys: pytest.CaptureFixture[str], arguments: list[str], status: int, part: str
) -> None:
    assert main(["calibrate", "mask", "--draw", *arguments]) == status
    (line,) = capsys.readouterr().err.splitlines()
    assert part in line


def test_a_port_in_use(bumper: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = str(other.getsockname()[1])
        assert main(["calibrate", "mask", "--draw", "--from", str(bumper), "--port", port]) == 1
    error = f"lcf-edge: calibrate mask: 127.0.0.1:{port}: cannot listen (Address already in use); choose with --port N"
    assert capsys.readouterr().err.splitlines() == [error]


def test_without_the_library_it_names_the_extra(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    assert main(["calibrate", "mask", "--draw"]) == 1
    said = "lcf-edge: calibrate mask: aiohttp is missing; run pip install 'lcf-edge[view]'\n"
    assert capsys.readouterr().err == said
