"""What the terminal shows: what is urgent first, and never more than fits."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from lcf_edge.cdr import DiagnosticArray, Header
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Cause, Kind, ObjectClass, ObjectState, Scene
from lcf_edge.monitor.live.monitor import Presence, Snapshot
from lcf_edge.monitor.terminal.screen import Screen, ordered, urgent

NOW_NS = 1_700_000_000_000_000_000
OK = DeviceStatus("camera", Level.OK, "delivers", {"rate_hz": "20.00"})
AWAY = DeviceStatus("imu", Level.ERROR, "away since 2026-01-01T00:00:00Z: unplugged")
MEMORY = DeviceStatus("memory", Level.WARN, "gave up the preview", {"resident_mib": "91.2", "budget_mib": "96"})
PIPELINE = DeviceStatus("pipeline", Level.OK, "runs", {"corners_fill": "700/1500", "latency_p99_ms": "8.20"})


def circles(rebels: int, normals: int) -> Any:
    rows = np.zeros(rebels + normals, CIRCLE)
    rows["id"] = np.arange(len(rows))[::-1]
    rows["kind"] = np.arange(len(rows)) >= normals
    rows["ttc"] = np.where(rows["kind"] == Kind.REBEL, 0.5 + np.arange(len(rows))[::-1], np.inf)
    rows["cause"] = np.where(rows["kind"] == Kind.REBEL, Cause.CROSSING, Cause.NONE)
    rows["range"] = rows["lateral"] = np.nan
    return rows


def things(count: int) -> Any:
    """The one with the highest number is met first; every third is not met at all."""
    rows = np.zeros(count, OBJECT)
    rows["id"] = np.arange(count)
    rows["class_id"] = np.where(rows["id"] % 3, ObjectClass.ONCOMING, ObjectClass.STANDING)
    rows["probability"] = np.where(rows["id"] % 3, 0.75, 0.25)
    rows["ttc"], rows["ttc_sigma"] = 40.5 - rows["id"], 0.25
    rows["range"], rows["range_sigma"] = 3.5, np.nan
    rows["lateral"] = rows["lateral_sigma"] = np.nan
    return rows


def snapshot(rebels: int = 2, normals: int = 5, *status: DeviceStatus, objects: int = 0) -> Snapshot:
    tables = circles(rebels, normals), np.zeros(3, PSI_REGION)
    scene = Scene(NOW_NS, 1, 640, 480, 1.5, *tables, objects=things(objects))
    diagnostics = DiagnosticArray(Header(NOW_NS, ""), "rover", status or (OK, AWAY, MEMORY, PIPELINE))
    there = Presence.THERE, NOW_NS - 5 * 10**9, ("rover",)
    return Snapshot(9, *there, scene, NOW_NS, 20.0, 0.0031, diagnostics, NOW_NS, None, 0)


def shown(snapshot: Snapshot, width: int = 100, height: int = 24, later_s: float = 0.1) -> list[str]:
    console = Console(width=width, height=height, color_system=None, force_terminal=False)
    with console.capture() as text:
        console.print(Screen(snapshot, "tcp/127.0.0.1:7447", NOW_NS + round(later_s * 1e9)), height=height)
    return text.get().splitlines()


def test_all_of_it_is_on_a_usual_terminal() -> None:
    lines = shown(snapshot())
    assert lines[0].startswith("live  rover  tcp/127.0.0.1:7447")
    assert lines[1].split("  ")[:3] == ["20.0 scenes/s", "latency 3 ms", "99% 8 ms"]
    assert "memory 91 of 96 MiB" in lines[1]
    assert "speed 1.50 m/s" in lines[1]
    assert lines[2].strip() == "2 rebels  5 normal  3 ψ"
    assert lines[4].split()[:4] == ["crossing", "0.5", "+0.0", "-"]
    assert [line.split()[0] for line in lines[4:11]] == ["crossing"] * 2 + ["normal"] * 5
    assert lines[11:14] == [
        "error  imu: away since 2026-01-01T00:00:00Z: unplugged",
        "warn  memory: gave up the preview",
        "ok  camera 20.00 Hz, pipeline",
    ]
    assert lines[14] == "corners 700/1500"


@settings(max_examples=30)
@given(st.integers(20, 200), st.integers(2, 60), st.integers(0, 12), st.integers(0, 60))
def test_it_always_fits_and_rebels_go_before_the_rest(width: int, height: int, rebels: int, normals: int) -> None:
    lines = shown(snapshot(rebels, normals), width, height)
    assert len(lines) <= height
    assert all(len(line) <= width for line in lines)
    if width < 40:  # names are cut
        return
    kinds = [word for line in lines if (word := line.split(" ")[0]) in {"crossing", "normal"}]
    assert kinds == sorted(kinds)
    assert kinds.count("crossing") >= min(rebels, height - 4)  # two lines above, two of the table's own
    if len(kinds) < rebels + normals and height > 2:
        assert f", {rebels + normals - len(kinds)} not" in lines[2]


def test_objects_stand_above_circles_what_is_met_first() -> None:
    lines = shown(snapshot(objects=3), width=110)
    assert lines[2].strip() == "3 objects  2 to be met"
    assert lines[3].split("  ")[0] == "object"
    assert [line.split()[0] for line in lines[4:7]] == ["oncoming", "oncoming", "standing"]
    assert lines[4].split() == [
        "oncoming",
        "38.5",
        "±0.2",
        "+0.0",
        "3.5",
        "-",
        "75",
        "+0.0",
        "+0.0",
        "seen",
        "0.0",
        "2",
    ]
    assert lines[7].strip() == "2 rebels  5 normal  3 ψ"
    assert lines[9].startswith("crossing")


@pytest.mark.parametrize(
    ("state", "said"), [(ObjectState.SEEN, "seen"), (ObjectState.HIDDEN, "hidden"), (ObjectState.COASTING, "coasting")]
)
def test_it_shows_what_an_object_does_and_whether_it_is_seen(state: ObjectState, said: str) -> None:
    known = snapshot(objects=1)
    assert known.scene
    known.scene.objects["class_id"], known.scene.objects["state"] = ObjectClass.CUTTING_IN, state
    line = shown(known)[4]
    assert line.startswith("cutting in")
    assert f" {said} " in line


@settings(max_examples=30)
@given(st.integers(30, 200), st.integers(2, 60), st.integers(0, 12), st.integers(1, 40))
def test_with_objects_it_fits_as_well(width: int, height: int, rebels: int, objects: int) -> None:
    lines = shown(snapshot(rebels, 5, objects=objects), width, height)
    assert len(lines) <= height
    assert all(len(line) <= width for line in lines)
    rows = [word for line in lines if (word := line.split(" ")[0]) in {"oncoming", "standing", "crossing", "normal"}]
    there = [row for row in rows if row in {"oncoming", "standing"}]
    assert rows[: len(there)] == there == sorted(there)
    assert len(there) >= min(objects, height - 5)  # two lines above, two of the table's own, one for the circles
    if height > 3 and len(there) < objects:
        assert f", {objects - len(there)} not" in lines[2] or lines[2].endswith("…")


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0.1, 100) | st.just(math.inf) | st.just(math.nan)), max_size=20))
def test_what_is_met_first_then_the_soonest_contact(rows: list[tuple[float, float]]) -> None:
    table = np.zeros(len(rows), OBJECT)
    table["probability"], table["ttc"] = [probability for probability, _ in rows], [ttc for _, ttc in rows]
    table["id"] = np.arange(len(rows))
    result = urgent(table)
    assert sorted(result["id"]) == sorted(table["id"])
    for one, next_one in pairwise(result):
        assert (one["probability"] >= 0.5) >= (next_one["probability"] >= 0.5)
        if (one["probability"] >= 0.5) == (next_one["probability"] >= 0.5):
            assert not one["ttc"] > next_one["ttc"]


@given(st.lists(st.tuples(st.booleans(), st.floats(0.1, 100) | st.just(math.inf)), max_size=20))
def test_rebels_first_then_the_soonest_contact(rows: list[tuple[bool, float]]) -> None:
    table = np.zeros(len(rows), CIRCLE)
    table["kind"], table["ttc"] = [kind for kind, _ in rows], [ttc for _, ttc in rows]
    table["id"] = np.arange(len(rows))
    result = ordered(table)
    assert sorted(result["id"]) == sorted(table["id"])
    for one, next_one in pairwise(result):
        assert one["kind"] >= next_one["kind"]
        if one["kind"] == next_one["kind"] == Kind.REBEL:
            assert one["ttc"] <= next_one["ttc"]
        if one["kind"] == next_one["kind"] == Kind.NORMAL:
            assert one["id"] < next_one["id"]  # a row keeps its place


@pytest.mark.parametrize(
    ("known", "later_s", "text"),
    [
        (replace(snapshot(), presence=Presence.AWAY, robots=()), 65.0, "daemon away since"),
        (replace(snapshot(), presence=Presence.SOUGHT, scene=None), 1.0, "waiting for a daemon since"),
        (snapshot(), 4.0, "there, no scenes for 4 s"),
        (replace(snapshot(), scene=None), 4.0, "there, no scenes"),
        (snapshot(), 0.5, "live"),
    ],
)
def test_it_says_whether_the_daemon_is_there(known: Snapshot, later_s: float, text: str) -> None:
    assert shown(known, later_s=later_s)[0].startswith(text)


def test_figures_are_whole_or_not_there() -> None:
    of_80 = ["20.0 scenes/s", "latency 3 ms", "99% 8 ms", "speed 1.50 m/s", "memory 91 of 96 MiB"]
    for width in range(13, 81):
        figures = shown(snapshot(), width)[1].split("  ")
        assert figures == of_80[: len(figures)]
    assert len(figures) == len(of_80)


def test_nothing_has_no_minus() -> None:
    known = snapshot(objects=1)
    assert known.scene
    known.scene.objects["lateral"] = known.scene.objects["v_right"] = -0.04
    line = shown(known)[4]
    assert line.count("+0.0") > 1
    assert "-0.0" not in line


def test_only_a_terminal_has_a_key_to_press() -> None:
    for is_terminal in (False, True):
        console = Console(width=80, height=24, color_system=None, force_terminal=is_terminal)
        with console.capture() as text:
            console.print(Screen(snapshot(), "tcp/127.0.0.1:7447", NOW_NS))
        assert ("q: end" in text.get()) == is_terminal


def test_what_was_refused_is_reported() -> None:
    assert "3 payloads refused" in shown(replace(snapshot(), broken=3), width=120)[1]


def test_what_others_send_does_not_command_the_terminal() -> None:
    evil = "\x1b]0;mine\x07\x1b[2J\x9b2J\r\n\u202e"
    status = [DeviceStatus(f"a{evil}", level, f"b{evil}", {"rate_hz": evil}) for level in Level]
    memory = DeviceStatus("memory", Level.OK, "", {"resident_mib": "1", "budget_mib": evil})
    lines = shown(replace(snapshot(1, 1, *status, memory), robots=(f"rover{evil}",)))
    assert len(lines) <= 24
    assert "rover\ufffd]0;mine" in lines[0]
    assert all(line.isprintable() for line in lines)


def test_an_endless_message_takes_a_few_lines_only() -> None:
    lines = shown(snapshot(1, 1, DeviceStatus("imu", Level.ERROR, "bad " * 200_000)))
    assert sum("bad" in line for line in lines) < 10


def test_of_many_devices_that_are_not_well_the_worst_are_shown() -> None:
    many = [DeviceStatus(f"d{number}", Level.WARN, "slow") for number in range(500)]
    lines = shown(snapshot(2, 5, *many, AWAY))
    assert [line for line in lines if line.startswith(("error", "warn"))][:2] == [
        "error  imu: away since 2026-01-01T00:00:00Z: unplugged",
        "warn  d0: slow",
    ]
    assert len(lines) <= 24
