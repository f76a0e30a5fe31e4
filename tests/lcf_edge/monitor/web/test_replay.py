"""The page of a recording, in a real browser, and what it may be asked."""

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from lcf_edge.rendered import scenes

STATE = "document.getElementById('state').textContent"
TIME = "document.querySelector('[data-part=time]').textContent"
CLICK = "document.querySelector('[data-part={}]').click()"
SLIDER = "document.querySelector('[data-part=slider]')"
PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = scenes.make("crossing", 3, seconds=4.0, fps=20.0, width=320, height=240, focal_px=250.0)
    return scenes.write(made, tmp_path_factory.mktemp("page") / "drive")


@pytest.fixture
def address(drive: Path) -> Iterator[str]:
    """Of a page of the drive, which stands at its beginning."""
    command = (sys.executable, "-m", "lcf_edge", "view", str(drive), "--step", "--port", "0")
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout
        assert process.stderr
        yield process.stdout.readline().split()[1]
        process.send_signal(signal.SIGTERM)
        assert process.stderr.read() == ""
        assert process.wait(PATIENCE_S) == 0


def test_the_slider_seeks_and_its_buttons_play_step_and_find_alarms(address: str, browser: Any) -> None:
    browser.open(address)
    browser.wait_for(f"{STATE} === 'replay, paused: drive' && {TIME}.startsWith('0.00 of 3.95 s · ')")
    browser.wait_for("document.getElementById('picture').getAttribute('aria-label').startsWith('Camera image')")
    browser.wait_for(f"!{TIME}.includes('so far')")
    assert browser.evaluate("document.getElementById('save').hidden && document.getElementById('pause').hidden")
    browser.evaluate(CLICK.format("step"))
    browser.wait_for(f"{TIME}.startsWith('0.05 of ')")
    browser.evaluate(f"({SLIDER}.value = 2.5, {SLIDER}.dispatchEvent(new Event('input')))")
    browser.wait_for(f"{TIME}.startsWith('2.50 of ')")
    assert browser.evaluate("document.querySelectorAll('.marks i').length") > 0
    browser.evaluate(CLICK.format("previous"))
    alarm_s = browser.wait_for(f"!{TIME}.startsWith('2.50') && {TIME}.split(' ')[0]")
    assert float(alarm_s) < 2.5
    browser.evaluate(CLICK.format("play"))
    browser.wait_for(f"{STATE} === 'replay: drive'")
    browser.wait_for(f"{STATE} === 'replay, paused: drive' && {TIME}.startsWith('3.95 of ')")


def test_it_fits_and_can_be_used_with_the_keyboard(address: str, browser: Any) -> None:
    browser.open(address)
    browser.wait_for(f"{STATE}.startsWith('replay')")
    for width in (320, 390, 768, 1280):
        browser.look_like(width, 800)
        browser.wait_for(f"innerWidth === {width}")
        assert browser.evaluate("document.documentElement.scrollWidth") <= width
    browser.evaluate(f"{SLIDER}.focus()")
    browser.wait_for(f"!{TIME}.includes('so far')")
    for kind in ("keyDown", "keyUp"):
        browser.send("Input.dispatchKeyEvent", type=kind, key="End", code="End", windowsVirtualKeyCode=35)
    browser.wait_for(f"{TIME}.startsWith('3.95 of ')")


def asked(address: str, body: bytes, **headers: str) -> int:
    request = Request(f"{address}player", data=body, headers={"Content-Type": "application/json", **headers})
    try:
        with urlopen(request, timeout=PATIENCE_S) as answer:
            return int(answer.status)
    except HTTPError as error:
        with error:  # a response, too
            return error.code


def test_a_wish_is_done_and_what_is_none_is_refused(address: str) -> None:
    assert asked(address, b'{"do": "seek", "value": 1.5}') == 204
    assert asked(address, b'{"do": "speed", "value": 1e300}') == 204  # cut to the fastest
    for body in (b"", b"[]", b"{", b'{"do": "delete"}', b'{"do": "seek", "value": "x"}', b'{"do": "play", "more": 1}'):
        assert asked(address, body) == 400
    assert asked(address, json.dumps({"do": "play", "more": "x" * 1000}).encode()) == 400
    assert asked(address, b'{"do": "play"}', **{"Content-Type": "text/plain"}) == 400


def test_another_page_may_not_ask(address: str) -> None:
    play = b'{"do": "play"}'
    assert asked(address, play, Origin=address.rstrip("/")) == 204
    assert asked(address, play, Origin="http://example.org") == 403
    assert asked(address, play, Host="example.org") == 403


def test_a_page_of_a_daemon_cannot_be_asked_and_one_of_a_recording_saves_nothing(seen: Any, address: str) -> None:
    assert asked(seen[1].address, b'{"do": "play"}') == 404
    with pytest.raises(HTTPError, match="404") as refused:
        urlopen(f"{address}save", timeout=PATIENCE_S)
    refused.value.close()
