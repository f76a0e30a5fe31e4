"""The page in a real browser."""

import json
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import pytest

from lcf_edge.diagnostics import Level
from lcf_edge.rendered import scenes
from lcf_edge.zenoh_link.link import Link

STATE = "document.getElementById('state').textContent"
THREAT = "document.getElementById('threat').textContent"
LIVE = f"{STATE}.startsWith('live: rover')"
PIXEL_AT = "[...document.getElementById('picture').getContext('2d').getImageData({x}, {y}, 1, 1).data]"

WRITTEN = """
  window.written = new Set();
  window.gaps = []; // px between neighbouring times below a plot
  const beside = new Map();
  const [fill, stroke] = [CanvasRenderingContext2D.prototype.fillText, CanvasRenderingContext2D.prototype.strokeText];
  CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
    window.written.add(String(text));
    if (text === 0) beside.set(this.canvas, -Infinity); // an axis begins; its times follow
    if (/\\d\\d:\\d\\d/.test(text) && beside.has(this.canvas)) {
      const half = this.measureText(text).width / 2;
      const before = beside.get(this.canvas);
      if (before !== -Infinity) window.gaps.push(Math.abs(rest[0] - before) - 2 * half);
      beside.set(this.canvas, rest[0]);
    }
    fill.call(this, text, ...rest);
  };
  CanvasRenderingContext2D.prototype.strokeText = function (text, ...rest) {
    window.written.add(`outline of ${text}`);
    stroke.call(this, text, ...rest);
  };
"""
"""Keeps what is written into any picture."""


@pytest.fixture
def reading(browser: Any) -> Iterator[Any]:
    """A browser that knows what is written into pictures."""
    kept = browser.send("Page.addScriptToEvaluateOnNewDocument", source=WRITTEN)
    yield browser
    browser.send("Page.removeScriptToEvaluateOnNewDocument", identifier=kept["identifier"])


CELLS = "[...document.querySelectorAll('#{} tr')].map((row) => [...row.cells].map((c) => c.textContent))"


def test_it_shows_what_the_rover_sees(seen: tuple[Any, Any], browser: Any) -> None:
    browser.open(seen[1].address)
    browser.wait_for(f"{LIVE} && {THREAT}.startsWith('crossing')")
    assert browser.evaluate(THREAT).replace("\xa0", " ") == "crossing · contact in 2.1 ±0.3 s · 3.3 ±0.5 m · 3° right"
    objects = browser.evaluate(CELLS.format("things"))
    assert [row[0] for row in objects] == ["crossing", "standing", "cutting in (hidden)"]
    assert objects[0] == ["crossing", "2.1 ±0.3", "97", "3.3 ±0.5", "0.1 ±0.3", "2.9", "0.1, 0.9", "2"]
    assert objects[2] == ["cutting in (hidden)", "-", "0", "-", "-", "20.1", "1.2, -0.4", "8"]
    assert browser.evaluate("document.getElementById('thing-count').textContent") == "3, 1 to be met"
    rows = browser.evaluate(CELLS.format("rows"))
    assert [row[0] for row in rows] == ["incoming", "leading", "normal", "normal", "normal"]
    assert rows[0] == ["incoming", "1.3", "2.9", "2.5", "-", "11", "4.0", "12"]
    browser.wait_for("document.querySelectorAll('#devices details').length === 4")
    devices = browser.evaluate("document.getElementById('devices').innerText")
    assert "away since 2026-01-01T00:00:00Z: unplugged" in devices
    browser.wait_for("document.getElementById('traces').innerText.includes('99 % below 8.2')")
    assert browser.evaluate("document.title") == "lcf-edge"


def test_from_above_it_shows_objects_the_way_and_the_horizon(seen: tuple[Any, Any], browser: Any) -> None:
    browser.open(seen[1].address)
    label = "document.getElementById('above').getAttribute('aria-label')"
    browser.wait_for(f"{LIVE} && {label}.includes('crossing')")
    assert browser.evaluate(label) == "From above: crossing 3.3 m ahead, standing 1.5 m ahead"
    ahead = "document.getElementById('ahead').textContent"
    browser.wait_for(f"{ahead}.includes('way')")  # the daemon answers queries for its configuration
    assert browser.evaluate(ahead) == "10 m ahead · way 0.60 m wide, horizon 4 s (6.0 m) · 1 without range"
    place = "(({clientWidth: w, clientHeight: h}) => [w / 2 + {x} * (h - 30) / 10, h - 22 - {y} * (h - 30) / 10])"
    x, y = 3.25 * math.tan(0.05), 3.25
    at = place.replace("{x}", str(x)).replace("{y}", str(y))
    pixel = (
        f"((c) => {{ const [x, y] = {at}(c), k = c.width / c.clientWidth;"
        "return [...c.getContext('2d').getImageData(x * k, y * k, 1, 1).data]; })(document.getElementById('above'))"
    )
    red, green, blue, _ = browser.evaluate(pixel)
    assert red > green > blue  # the colour of what will be met


def test_plots_have_axes_with_values_and_times_and_each_table_has_its_own(seen: tuple[Any, Any], reading: Any) -> None:
    reading.open(seen[1].address)
    reading.wait_for("document.querySelectorAll('#tables figure:not([hidden])').length === 2")
    shown = "[...document.querySelectorAll('#tables figure:not([hidden])')].map((figure) => figure.innerText)"
    captions = [caption.split() for caption in reading.evaluate(shown)]
    assert captions == [["Objects", "3", "of", "24"], ["Regions", "ψ", "2", "of", "32"]]
    reading.wait_for("['0', '10', '20'].every((text) => window.written.has(text))")  # scenes a second
    reading.wait_for("[...window.written].some((text) => /\\d\\d:\\d\\d/.test(text))")


def test_times_below_a_plot_do_not_run_into_each_other(seen: tuple[Any, Any], reading: Any) -> None:
    """At any second, since they move; each draw of each plot counts."""
    reading.open(seen[1].address)
    reading.wait_for("window.gaps.length > 60")
    assert reading.evaluate("Math.min(...window.gaps)") > 4


def test_a_label_has_an_outline(rover: Any, view: Callable[..., Any], reading: Any) -> None:
    rover.link.has_preview_subscriber = lambda: False
    reading.open(view().address)
    reading.wait_for("window.written.has('outline of crossing 2.1 ±0.3 s')")


def test_the_picture_is_saved_as_a_png(seen: tuple[Any, Any], browser: Any, tmp_path: Path) -> None:
    browser.send("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    browser.open(seen[1].address)
    browser.wait_for(f"{LIVE} && document.getElementById('picture').width === 320")
    browser.evaluate("document.getElementById('snap').click()")
    seen[0].wait_for(lambda: [file for file in tmp_path.iterdir() if file.suffix == ".png"])
    (file,) = tmp_path.iterdir()
    assert re.fullmatch(r"lcf-edge-picture-\d+\.png", file.name)
    preview = cv2.imread(str(file))
    assert preview is not None
    assert preview.shape == (240, 320, 3)


def test_the_numbers_beside_a_picture_are_those_of_its_frame(
    rover: Any, view: Callable[..., Any], browser: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The preview comes with every third frame; the figures beside it do not run ahead."""
    drawn_s: set[str] = set()
    put = rover.link.put_preview

    def contact_s(seq: int) -> float:
        return 2 + seq % 100 / 8 + 0.01

    def put_preview(jpeg: bytes, stamp_ns: int) -> None:
        drawn_s.add(f"{contact_s(rover.seq):.1f}")
        put(jpeg, stamp_ns)

    def wanted() -> bool:
        rover.objects = rover.objects.copy()
        rover.objects["ttc"][1] = contact_s(rover.seq + 1)
        return bool(rover.seq % 3 == 0 and Link.has_preview_subscriber(rover.link))

    monkeypatch.setattr(rover.link, "put_preview", put_preview)
    monkeypatch.setattr(rover.link, "has_preview_subscriber", wanted)
    browser.open(view().address)
    contact = "document.querySelector('#things td:nth-child(2)').textContent.split(' ')[0]"
    of_preview = f"{PIXEL_AT.format(x=2, y=2)}[0] > 60"  # grey; what is drawn from a scene alone is nearly black
    browser.wait_for(f"{LIVE} && {of_preview} && {contact}")
    # Otherwise the picture says how late it is, or there is none.
    near = f"{LIVE} && document.getElementById('behind').hidden && {of_preview} ? {contact} : ''"
    seen = {browser.evaluate(f"new Promise((go) => setTimeout(() => go({near}), 60))") for _ in range(40)} - {""}
    assert len(seen) > 3
    assert seen <= drawn_s


def test_what_passes_is_no_threat_and_without_objects_the_circles_decide(
    rover: Any, view: Callable[..., Any], browser: Any
) -> None:
    rover.objects = rover.objects[:1]  # it stands beside the path
    browser.open(view().address)
    browser.wait_for(f"{LIVE} && {THREAT} === 'nothing to be met'")
    rover.objects = rover.objects[:0]
    browser.wait_for(f"{THREAT}.startsWith('incoming')")
    assert browser.evaluate(THREAT).replace("\xa0", " ") == "incoming · contact in 1.3 s · 2.5 m · 3° right"
    assert browser.evaluate(CELLS.format("things")) == []


def test_the_picture_is_one_panel_or_both(seen: tuple[Any, Any], browser: Any) -> None:
    browser.open(seen[1].address)
    grey, blue = PIXEL_AT.format(x=5, y=5) + "[2] > 70", PIXEL_AT.format(x=5, y=5) + "[2] > 120"
    size = "[document.getElementById('picture').width, document.getElementById('picture').height].join()"

    def choose(panel: str) -> None:
        browser.evaluate(f"document.querySelector('input[value={panel}]').click()")

    choose("circles")
    browser.wait_for(f"{size} === '320,240' && {grey} && !({blue})")
    side = "[...document.getElementById('picture').getContext('2d').getImageData(254, 180, 3, 40).data]"
    yellow = "(bytes) => bytes.some((red, at) => at % 4 === 0 && red > 150 && bytes[at + 2] < 90)"
    browser.wait_for(f"({yellow})({side})")  # the rectangular ψ, drawn on top
    choose("corners")
    browser.wait_for(f"{size} === '320,240' && {blue}")
    choose("both")
    browser.wait_for(f"{size} === '640,240' && {blue}")


def test_it_says_that_the_rover_is_away_and_comes_back(rover: Any, view: Callable[..., Any], browser: Any) -> None:
    browser.open(view().address)
    browser.wait_for(LIVE)
    rover.leave()
    browser.wait_for(f"{STATE}.startsWith('daemon away since ')")
    browser.wait_for(f"{THREAT} === 'no scenes'")
    rover.come()
    browser.wait_for(LIVE)
    rover.silent = True
    browser.wait_for(f"{STATE}.startsWith('rover is there, but no scenes for ')")


def test_two_devices_of_one_name_are_two(rover: Any, view: Callable[..., Any], browser: Any) -> None:
    camera, imu, *_ = rover.status
    rover.status = (camera, imu, replace(imu, level=Level.STALE, message="<b>again</b>"))
    browser.open(view().address)
    browser.wait_for(f"{LIVE} && document.querySelectorAll('#devices details').length")
    seq = rover.seq
    rover.wait_for(lambda: rover.seq > seq + 30)
    assert browser.evaluate("document.querySelectorAll('#devices details').length") == 3
    assert "<b>again</b>" in browser.evaluate("document.getElementById('devices').textContent")


def test_without_a_rover_it_waits(view: Callable[..., Any], browser: Any, endpoint: str) -> None:
    browser.open(view().address)
    browser.wait_for(f"{STATE}.startsWith('waiting for a daemon at {endpoint} since ')")


def test_without_pictures_the_scene_is_drawn_and_the_reason_reported(
    rover: Any, view: Callable[..., Any], browser: Any
) -> None:
    rover.link.has_preview_subscriber = lambda: False
    rover.status = (*rover.status[:3], replace(rover.status[3], level=Level.WARN, message="gave up the preview"))
    browser.open(view().address)
    browser.wait_for("document.getElementById('why').innerText.includes('gave up the preview to save memory')")
    red = PIXEL_AT.format(x=150 + 30, y=110)  # on the rebel circle
    assert browser.evaluate(f"((pixel) => pixel[0] > 150 && pixel[1] < 120)({red})")
    orange = PIXEL_AT.format(x=150 - 35, y=110)  # on the box of what will be met
    assert browser.evaluate(f"((pixel) => pixel[0] > 200 && pixel[1] > 120 && pixel[2] < 120)({orange})")
    side = "[...document.getElementById('picture').getContext('2d').getImageData(265, 90, 1, 80).data]"
    blue = f"{side}.filter((byte, at) => at % 4 === 2 && byte > 120).length"
    assert 10 < browser.evaluate(blue) < 70  # the dashed side of the one that is hidden


def test_paused_or_hidden_it_costs_the_rover_nothing(seen: tuple[Any, Any], browser: Any) -> None:
    rover, view = seen
    browser.open(view.address)
    browser.wait_for(LIVE)
    rover.wait_for(lambda: rover.previews > 2)
    browser.evaluate("document.getElementById('pause').click()")
    rover.wait_for(lambda: rover.unseen > 20)
    assert browser.evaluate(STATE).startswith("paused at ")
    assert browser.evaluate("document.getElementById('pause').getAttribute('aria-pressed')") == "true"
    browser.evaluate("document.getElementById('pause').click()")
    browser.wait_for(LIVE)
    hide = "Object.defineProperty(document, 'hidden', {{value: {}, configurable: true}});"
    browser.evaluate(hide.format("true") + "document.dispatchEvent(new Event('visibilitychange'))")
    rover.wait_for(lambda: rover.unseen > 20)
    seen = rover.previews
    browser.evaluate(hide.format("false") + "document.dispatchEvent(new Event('visibilitychange'))")
    rover.wait_for(lambda: rover.previews > seen + 2)


@pytest.mark.usefixtures("rover")
def test_it_says_that_the_server_is_gone_and_finds_the_next_one(
    view: Callable[..., Any],
    browser: Any,
) -> None:
    first = view()
    browser.open(first.address)
    browser.wait_for(LIVE)
    first.end()
    browser.wait_for(f"{STATE}.startsWith('lcf-edge view does not answer since ')")
    view("--port", first.address.rstrip("/").rpartition(":")[2])
    browser.wait_for(LIVE)
    browser.said.clear()  # of the connections that were refused


def test_nothing_sticks_out_at_any_width(seen: tuple[Any, Any], browser: Any) -> None:
    browser.open(seen[1].address)
    browser.wait_for(f"{LIVE} && document.querySelector('#devices details')")
    for width in (320, 390, 768, 1280, 1920):
        browser.look_like(width, 800)
        browser.wait_for(f"innerWidth === {width}")
        assert browser.evaluate("document.documentElement.scrollWidth") <= width
        tables = "[...document.querySelectorAll('.scroll')].filter((box) => box.scrollWidth > box.clientWidth).length"
        assert browser.evaluate(tables) == 0, width


CONTRAST = """(() => {
  const light = ([r, g, b]) => [r, g, b].map((c) => (c /= 255) <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
    .reduce((sum, c, at) => sum + c * [0.2126, 0.7152, 0.0722][at], 0);
  const numbers = (text) => text.match(/[\\d.]+/g).map(Number);
  const back = (element) => {
    for (; element; element = element.parentElement) {
      const colour = numbers(getComputedStyle(element).backgroundColor);
      if (colour.length < 4 || colour[3] > 0.8) return colour;
    }
    return [255, 255, 255];
  };
  const least = [];
  for (const element of document.querySelectorAll("body *")) {
    const speaks = [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
    if (!speaks || !element.checkVisibility()) continue;
    const [a, b] = [numbers(getComputedStyle(element).color), back(element)].map(light).sort((x, y) => y - x);
    least.push([(a + 0.05) / (b + 0.05), element.textContent.slice(0, 40)]);
  }
  return least.sort((x, y) => x[0] - y[0])[0];
})()"""


def test_it_can_be_read_and_used_by_everybody(seen: tuple[Any, Any], browser: Any) -> None:
    browser.open(seen[1].address)
    browser.wait_for(f"{LIVE} && document.querySelector('#devices details')")
    for scheme in ("light", "dark"):
        browser.look_like(1280, 800, scheme)
        browser.wait_for(f"matchMedia('(prefers-color-scheme: {scheme})').matches")
        ratio, text = browser.evaluate(CONTRAST)
        assert ratio >= 4.5, text  # WCAG 2.2, AA
    nodes = browser.send("Accessibility.getFullAXTree")["nodes"]
    used = {"button", "link", "radio", "img", "image", "canvas", "table", "region", "DisclosureTriangle"}
    named = [(node["role"]["value"], node.get("name", {}).get("value")) for node in nodes if not node.get("ignored")]
    assert all(name for role, name in named if role in used - {"table"}), named
    reached = []
    for _ in range(12):
        for kind in ("keyDown", "keyUp"):
            browser.send("Input.dispatchKeyEvent", type=kind, key="Tab", code="Tab", windowsVirtualKeyCode=9)
        reached.append(browser.evaluate("(document.activeElement.id || document.activeElement.tagName)"))
    assert {"pause", "save", "INPUT", "SUMMARY"} <= set(reached), json.dumps(reached)


def test_with_the_real_daemon(view: Callable[..., Any], browser: Any, endpoint: str, tmp_path: Path) -> None:
    made = scenes.make("crossing", 3, seconds=1.5, fps=20.0, width=320, height=240, focal_px=250.0)
    drive = scenes.write(made, tmp_path / "drive")
    settings = (
        f'zenoh.listen=["{endpoint}"]',
        "camera.driver=recording",
        f"camera.recording={drive}",
        "imu.driver=recording",
    )
    arguments = [part for setting in settings for part in ("--set", setting)]
    daemon = subprocess.Popen(
        (sys.executable, "-m", "lcf_edge", "run", *arguments), stderr=subprocess.DEVNULL, env=os.environ
    )
    try:
        browser.open(view().address)
        browser.wait_for(f"{LIVE} && document.querySelectorAll('#rows tr').length > 3")
        browser.evaluate("document.querySelector('input[value=both]').click()")
        browser.wait_for("document.getElementById('picture').width === 640")
        browser.wait_for("document.querySelectorAll('#devices details').length >= 6")
    finally:
        daemon.terminate()
        daemon.wait()
    browser.wait_for(f"{STATE}.startsWith('daemon away since ')")
