"""A recording is played, stood still, sought in and stepped through."""

import math
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from lcf_edge.config import Config, Memory
from lcf_edge.diagnostics import Level
from lcf_edge.errors import ConfigError, RecordingError
from lcf_edge.monitor.live.monitor import Replay, Snapshot
from lcf_edge.monitor.replay.player import ALARM_LEAD_S, Player
from lcf_edge.pipeline import run
from lcf_edge.recording.pace import Pace
from lcf_edge.recording.read import open_recording

PATIENCE_S = 60.0
FRAME_S = 0.05
LAST_S = 79 * FRAME_S
STILL = Pace(step=True)


class Playing:
    """A player, and a way to wait for what it shows."""

    def __init__(self, path: Path, pace: Pace) -> None:
        self._changed = threading.Condition()
        self.player = Player(path, Config(), pace, changed=self._notify)
        self.player.start()

    def shows(self, what: Callable[[Replay], object]) -> Snapshot:
        with self._changed:
            assert self._changed.wait_for(lambda: what(self.replay()), PATIENCE_S), self.replay()
        return self.player.snapshot()

    def at(self, position_s: float) -> Snapshot:
        return self.shows(lambda replay: replay.position_s == pytest.approx(position_s, abs=1e-6) and self.seq() >= 0)

    def searched(self) -> Replay:
        deadline_s = time.monotonic() + PATIENCE_S
        while not self.replay().searched:
            assert time.monotonic() < deadline_s
            threading.Event().wait(0.01)  # its thread sends no notification
        return self.replay()

    def replay(self) -> Replay:
        replay = self.player.snapshot().replay
        assert replay is not None
        return replay

    def seq(self) -> int:
        scene = self.player.snapshot().scene
        return -1 if scene is None else scene.seq

    def _notify(self) -> None:
        with self._changed:
            self._changed.notify_all()


@pytest.fixture
def playing(drive: Path) -> Iterator[Callable[[Pace], Playing]]:
    begun: list[Playing] = []

    def begin(pace: Pace = STILL) -> Playing:
        begun.append(Playing(drive, pace))
        return begun[-1]

    yield begin
    for one in begun:
        one.player.close()
        assert one.player.failed is None


def test_it_stands_at_the_first_image_and_goes_on_step_by_step(playing: Any) -> None:
    it = playing()
    it.shows(lambda _: it.seq() == 0)
    for seq in (1, 2, 3):
        it.player.step()
        it.shows(lambda _, seq=seq: it.seq() == seq)
    assert it.replay().position_s == pytest.approx(3 * FRAME_S)
    assert not it.replay().playing


def test_it_plays_to_the_end_and_again_from_the_beginning(playing: Any) -> None:
    it = playing(Pace(speed=50.0))
    it.shows(lambda replay: replay.position_s == pytest.approx(LAST_S) and not replay.playing)
    it.searched()
    it.player.run_at(0.01)
    it.player.play(True)
    it.shows(lambda replay: replay.position_s < 1.0 and replay.playing)


def test_in_a_loop_it_begins_again_by_itself(playing: Any) -> None:
    it = playing(Pace(start_s=3.5, speed=10.0, loop=True))
    for _ in range(2):
        it.shows(lambda replay: replay.position_s == pytest.approx(LAST_S))
        it.shows(lambda replay: replay.position_s == pytest.approx(3.5))


def test_it_is_as_slow_as_it_is_told(playing: Any) -> None:
    began_s = time.monotonic()
    it = playing(Pace(duration_s=0.5, speed=0.5))
    it.shows(lambda replay: replay.position_s == pytest.approx(0.5))
    assert time.monotonic() - began_s >= 1.0 - 2 * FRAME_S


@pytest.mark.parametrize("at_s", [0.0, 1.0, 2.45, LAST_S])
def test_while_it_stands_a_place_that_is_sought_is_shown_at_once(playing: Any, at_s: float) -> None:
    it = playing()
    it.player.switch_preview(True)
    it.searched()
    it.player.seek(at_s)
    it.at(at_s)
    snapshot = it.shows(lambda _: it.player.snapshot().preview is not None)
    assert snapshot.scene.seq == round(at_s / FRAME_S)
    assert snapshot.preview.scene is snapshot.scene
    assert bytes(snapshot.preview.image.data[:2]) == b"\xff\xd8"  # a JPEG


def test_what_is_sought_outside_is_the_nearest_that_there_is(playing: Any) -> None:
    it = playing(replace(STILL, start_s=1.0, duration_s=1.0))
    it.at(1.0)
    it.searched()
    it.player.seek(100.0)
    it.at(2.0)
    it.player.seek(-100.0)
    it.at(1.0)


def test_after_a_warm_up_what_is_shown_is_what_the_whole_recording_gives(playing: Any, drive: Path) -> None:
    """From its beginning on: exactly."""
    it = playing()
    it.searched()
    it.player.seek(1.5)
    scene = it.at(1.5).scene
    whole = next(out.scene for frame, out in run(open_recording(drive, Config()), Config()) if frame.seq == scene.seq)
    assert scene.circles.tobytes() == whole.circles.tobytes()
    assert scene.objects.tobytes() == whole.objects.tobytes()


def test_alarms_are_where_something_comes_to_be_met(playing: Any, drive: Path) -> None:
    it = playing()
    alarms_s = it.searched().alarms_s
    assert alarms_s
    assert list(alarms_s) == sorted(alarms_s)
    first = next(
        frame.seq
        for frame, outcome in run(open_recording(drive, Config()), Config())
        if (outcome.scene.objects["probability"] >= 0.5).any()
    )
    assert alarms_s[0] == pytest.approx(first * FRAME_S)
    it.player.seek_alarm(forward=True)
    sought_s = alarms_s[0] - ALARM_LEAD_S
    it.shows(lambda replay: sought_s - 1e-6 <= replay.position_s < sought_s + FRAME_S)
    it.player.seek(LAST_S)
    it.at(LAST_S)
    it.player.seek_alarm(forward=False)
    sought_s = alarms_s[-1] - ALARM_LEAD_S
    it.shows(lambda replay: sought_s - 1e-6 <= replay.position_s < sought_s + FRAME_S)


def test_its_plots_go_by_the_time_of_the_recording(playing: Any) -> None:
    it = playing(Pace(speed=50.0))
    it.shows(lambda replay: replay.position_s == pytest.approx(LAST_S))
    points = it.player.traces.since(0)
    assert len(points) == 4
    assert (points[-1].at_ns - points[0].at_ns) / 1e9 == pytest.approx(3.0)
    assert points[-1].fill["corners"][0] > 0


def test_nobody_looks_and_nothing_is_drawn(playing: Any) -> None:
    it = playing(Pace(speed=50.0))
    assert it.shows(lambda replay: replay.position_s == pytest.approx(LAST_S)).preview is None


def test_a_start_beyond_the_end_is_refused_with_the_length(drive: Path) -> None:
    with pytest.raises(RecordingError, match=r"drive: ends after 4\.0 s; name an earlier start than 30 s"):
        Player(drive, Config(), Pace(start_s=30.0))


def test_tables_beyond_the_budget_are_refused_before_anything_is_shown(drive: Path) -> None:
    with pytest.raises(ConfigError, match=r"memory\.budget_mib"):
        Player(drive, Config(memory=Memory(budget_mib=0.01)), STILL)


def test_a_recording_that_goes_away_is_reported(drive: Path, tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    shutil.copytree(drive, gone)
    it = Playing(gone, STILL)
    it.shows(lambda _: it.seq() == 0)
    it.searched()
    shutil.rmtree(gone)
    it.player.seek(3.0)
    it.shows(lambda _: it.player.failed is not None)
    diagnostics = it.player.snapshot().diagnostics
    it.player.close()
    assert diagnostics
    assert [(status.name, status.level) for status in diagnostics.status] == [("recording", Level.ERROR)]
    assert "gone" in diagnostics.status[0].message


@pytest.mark.parametrize(
    ("start_s", "duration_s"), [(0.0, math.inf), (1.0, math.inf), (0.0, 1.0), (1.02, 0.5), (3.9, 9)]
)
def test_a_part_of_a_recording_has_the_images_and_samples_of_that_part(
    drive: Path, start_s: float, duration_s: float
) -> None:
    recording = open_recording(drive, Config())
    whole = list(recording)
    frames = [item for item in whole if hasattr(item, "image")]
    recording.start_s, recording.duration_s = start_s, duration_s
    part = list(recording)
    wanted = [
        frame.seq for frame in frames if start_s <= (frame.stamp_ns - frames[0].stamp_ns) / 1e9 <= start_s + duration_s
    ]
    assert [item.seq for item in part if hasattr(item, "image")] == wanted
    kept = iter([item.stamp_ns for item in whole])
    assert all(any(stamp_ns == item.stamp_ns for stamp_ns in kept) for item in part)  # in the same order
