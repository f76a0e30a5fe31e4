"""The page in a real browser: what mouse, finger and keys do, and what comes of it in a replay."""

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from lcf_edge.config import load
from lcf_edge.corners.own_parts import MARGIN_PX
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording

Draw = Callable[..., Any]

STATE = "document.getElementById('state').textContent"
LINES = "document.getElementById('lines').textContent"
CLICK = "document.getElementById('{}').click()"
IS_OFF = "document.getElementById('{}').disabled"
ROWS = "[...document.querySelectorAll('#{} li span')].map((one) => one.textContent)"
PRESS = "[...document.querySelectorAll('#{} button')].find((one) => one.ariaLabel === '{}').click()"
BOX = "(({x, y, width, height}) => [x, y, width, height])(document.getElementById('image').getBoundingClientRect())"
HANDLES = "document.querySelectorAll('.corner').length"
SQUARE = [(100, 60), (200, 60), (200, 160), (100, 160)]


class Hand:
    """Mouse and finger over the image, at px of it."""

    def __init__(self, browser: Any) -> None:
        self.browser = browser

    def at(self, x: float, y: float) -> dict[str, float]:
        left, top, width, height = self.browser.evaluate(BOX)
        return {"x": left + (x + 0.5) * width / 320, "y": top + (y + 0.5) * height / 240}

    def mouse(self, kind: str, x: float, y: float, buttons: int = 1) -> None:
        self.browser.send(
            "Input.dispatchMouseEvent", type=kind, button="left", buttons=buttons, clickCount=1, **self.at(x, y)
        )

    def click(self, *places: tuple[float, float]) -> None:
        for x, y in places:
            self.mouse("mousePressed", x, y)
            self.mouse("mouseReleased", x, y, 0)

    def drag(self, begin: tuple[float, float], end: tuple[float, float]) -> None:
        self.mouse("mousePressed", *begin)
        self.mouse("mouseMoved", (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2)
        self.mouse("mouseMoved", *end)
        self.mouse("mouseReleased", *end, 0)

    def touch(self, kind: str, *places: tuple[float, float]) -> None:
        points = [{**self.at(*place), "id": number} for number, place in enumerate(places)]
        self.browser.send("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    def tap(self, *places: tuple[float, float]) -> None:
        for place in places:
            self.touch("touchStart", place)
            self.touch("touchEnd")

    def key(self, key: str, modifiers: int = 0) -> None:
        for kind in ("keyDown", "keyUp"):
            self.browser.send("Input.dispatchKeyEvent", type=kind, key=key, modifiers=modifiers)


@pytest.fixture
def hand(browser: Any) -> Hand:
    return Hand(browser)


@pytest.fixture
def page(draw: Draw, hand: Hand) -> Any:
    """A page with nothing drawn and the proposal dropped."""
    drawing = draw("--set", "camera.width=320", "--set", "camera.height=240")
    hand.browser.open(drawing.address)
    hand.browser.wait_for("document.querySelectorAll('#proposed li').length === 1")
    hand.browser.evaluate(PRESS.format("proposed", "Drop Proposal 1"))
    return drawing


def drawn(hand: Hand, *corners: tuple[float, float]) -> None:
    """Wait until this is the only outline, give or take what a px of the screen is of the image."""
    shown = "document.querySelectorAll('.drawn')"
    text = hand.browser.wait_for(f"{shown}.length === 1 && {shown}[0].getAttribute('points')")
    points = [tuple(map(float, point.split(","))) for point in text.split()]
    assert np.allclose(points, corners, atol=0.5), points


def test_what_is_drawn_is_written_and_has_no_corners_in_a_replay(
    draw: Draw, hand: Hand, bumper: Path, rover: Path
) -> None:
    drawing = draw("--write")
    hand.browser.open(drawing.address)
    hand.browser.wait_for("document.querySelectorAll('#proposed li').length === 1")
    assert hand.browser.evaluate(IS_OFF.format("save"))  # the proposal is to be kept or dropped
    hand.click(*SQUARE)
    assert hand.browser.evaluate(IS_OFF.format("save"))  # and the outline to be closed
    hand.click(SQUARE[0])
    hand.browser.evaluate(PRESS.format("proposed", "Keep Proposal 1"))
    hand.browser.wait_for(f"!{IS_OFF.format('save')}")
    lines = hand.browser.evaluate(LINES)
    hand.browser.evaluate(CLICK.format("save"))
    hand.browser.wait_for(f"{STATE}.startsWith('saved')")
    status, out, errors = drawing.end()
    assert (status, errors) == (0, "")
    assert lines in out
    mask = tomllib.loads(out)["camera"]["mask"]
    assert len(mask) == 2
    assert np.allclose(mask[0], 2 * np.array(SQUARE) + 0.5, atol=1.5)  # of an image twice as wide

    hidden = np.zeros((240, 320), np.uint8)
    cv2.fillPoly(hidden, [np.array(SQUARE, np.int32)], (1,))

    def corners_inside(config: Any) -> int:
        found = [outcome.view().corners for _, outcome in run(open_recording(bumper, config), config)]
        return sum(int(np.count_nonzero(hidden[y.astype(int), x.astype(int)])) for x, y in (each.T for each in found))

    with_mask, without = load(rover), load(rover, ["camera.mask=[]"])
    assert MARGIN_PX > 1  # so that what a px of the screen is of the image does not matter
    assert corners_inside(with_mask) == 0
    assert corners_inside(without) > 0


@pytest.mark.usefixtures("page")
def test_corners_are_moved_added_and_removed_and_all_is_undone(hand: Hand) -> None:
    hand.click(*SQUARE, SQUARE[0])
    drawn(hand, *SQUARE)
    hand.drag((200, 160), (260, 200))
    moved = [*SQUARE[:2], (260, 200), SQUARE[3]]
    drawn(hand, *moved)
    hand.drag((150, 60), (150, 20))  # between two corners
    more = [moved[0], (150, 20), *moved[1:]]
    drawn(hand, *more)
    hand.browser.evaluate(CLICK.format("remove"))  # the one that was set last
    drawn(hand, *moved)
    for before in (more, moved, SQUARE):
        hand.browser.evaluate(CLICK.format("undo"))
        drawn(hand, *before)
    hand.key("z", modifiers=2)  # Ctrl: open again
    hand.browser.wait_for(f"document.querySelectorAll('.drawn').length === 0 && {HANDLES} === 4")
    for _ in range(4):
        hand.key("z", modifiers=2)
    hand.browser.wait_for(f"{HANDLES} === 0")
    hand.key("z", modifiers=2)
    hand.browser.wait_for("document.querySelectorAll('#proposed li').length === 1")  # not dropped any more


@pytest.mark.usefixtures("page")
def test_a_corner_is_moved_by_keys_and_the_outline_closed_by_one(hand: Hand) -> None:
    hand.click(*SQUARE)
    hand.key("ArrowLeft")
    hand.key("ArrowDown", modifiers=8)  # Shift: 10 px
    hand.key("Enter")
    drawn(hand, *SQUARE[:3], (99, 170))


@pytest.mark.usefixtures("page")
def test_beside_the_image_is_its_border(hand: Hand) -> None:
    hand.click((-3, 100), (40, 100), (40, 242), (-3, 242))
    hand.browser.evaluate(CLICK.format("close"))
    drawn(hand, (0, 100), (40, 100), (40, 239), (0, 239))
    hand.drag((40, 100), (40, -500))
    drawn(hand, (0, 100), (40, 0), (40, 239), (0, 239))


@pytest.mark.usefixtures("page")
def test_an_outline_is_chosen_by_a_click_and_deleted(hand: Hand) -> None:
    hand.click(*SQUARE, SQUARE[0])
    hand.click((250, 20), (300, 20), (300, 60), (250, 20))
    rows = hand.browser.wait_for(f"{ROWS.format('outlines')}.length === 2 && {ROWS.format('outlines')}")
    assert rows[1].startswith("Outline 2: 3 corners, ")
    hand.click((130, 100))
    hand.browser.wait_for(f"{HANDLES} === 4")
    hand.browser.evaluate(PRESS.format("outlines", "Delete Outline 2"))
    drawn(hand, *SQUARE)


@pytest.mark.usefixtures("page")
def test_a_finger_draws_and_two_fingers_zoom(hand: Hand) -> None:
    hand.browser.look_like(390, 800)
    hand.browser.send("Emulation.setTouchEmulationEnabled", enabled=True)
    hand.browser.wait_for("innerWidth === 390")
    try:
        hand.tap(*SQUARE)
        hand.browser.wait_for(f"{HANDLES} === 4")
        hand.tap(SQUARE[0])
        drawn(hand, *SQUARE)
        hand.touch("touchStart", (200, 160))
        hand.touch("touchMove", (230, 170))
        hand.touch("touchMove", (240, 190))
        hand.touch("touchEnd")
        drawn(hand, *SQUARE[:2], (240, 190), SQUARE[3])
        hand.touch("touchStart", (20, 30))
        hand.touch("touchStart", (20, 30), (60, 30))
        for wide in range(5, 30, 5):
            hand.touch("touchMove", (20 - wide, 30), (60 + wide, 30))
        hand.touch("touchEnd")
        drawn(hand, *SQUARE[:2], (240, 190), SQUARE[3])
        assert hand.browser.evaluate("document.querySelectorAll('.open').length") == 0
    finally:
        hand.browser.send("Emulation.setTouchEmulationEnabled", enabled=False)
        hand.browser.send("Emulation.resetPageScaleFactor")


def test_what_there_was_can_be_taken_away(draw: Draw, hand: Hand) -> None:
    drawing = draw("--polygon", "0,0,20,0,0,20")
    hand.browser.open(drawing.address)
    hand.browser.wait_for("document.querySelectorAll('#proposed li').length === 1")
    hand.browser.evaluate(PRESS.format("proposed", "Drop Proposal 1"))
    hand.browser.evaluate(PRESS.format("outlines", "Delete Outline 1"))
    hand.browser.wait_for(f"!{IS_OFF.format('save')}")
    hand.browser.evaluate(CLICK.format("save"))
    assert tomllib.loads(drawing.end()[1])["camera"]["mask"] == []


@pytest.mark.usefixtures("page")
def test_nothing_cannot_be_saved(hand: Hand) -> None:
    hand.browser.wait_for("document.getElementById('why').textContent === 'nothing is drawn yet'")
    assert hand.browser.evaluate(IS_OFF.format("save"))


def test_when_the_command_has_ended_the_page_says_so(page: Any, hand: Hand) -> None:
    assert page.interrupt()[0] == 130
    hand.browser.wait_for(f"{STATE} === 'lcf-edge has ended: what is drawn here is not saved'")
    assert hand.browser.evaluate(IS_OFF.format("save"))
    assert all("ERR_CONNECTION_REFUSED" in text for text in hand.browser.said)
    hand.browser.said.clear()


@pytest.mark.usefixtures("page")
def test_it_fits(hand: Hand) -> None:
    hand.click(*SQUARE)
    for width in (320, 390, 768, 1280):
        hand.browser.look_like(width, 800)
        hand.browser.wait_for(f"innerWidth === {width}")
        assert hand.browser.evaluate("document.documentElement.scrollWidth") <= width
