"""Plays a recording through the pipeline, at a given pace; can pause, seek and step."""

import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from msgspec.structs import asdict

from drivers.samples import Frame
from lcf_edge.cdr import CompressedImage, DiagnosticArray, Header
from lcf_edge.config import Config
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.errors import LcfError
from lcf_edge.messages import PipelineScene, View
from lcf_edge.meters import IntervalMeter
from lcf_edge.monitor.live.monitor import Ahead, Presence, Preview, Replay, Snapshot
from lcf_edge.monitor.live.traces import TABLES, Point, Traces
from lcf_edge.monitor.replay.alarms import Alarms
from lcf_edge.pipeline import Outcome, run
from lcf_edge.printable import printable
from lcf_edge.recording.pace import FASTEST, SLOWEST, Pace
from lcf_edge.recording.read import open_recording
from lcf_edge.sinks.overlay import draw

WARM_UP_S = 2.0  # filtered but not shown before a position that is sought
ALARM_LEAD_S = 0.5  # seeking an alarm goes this much before it
_PREVIEW_S = 0.1  # between two images while it plays
_POINT_S = 1.0  # of the recording between two points of the plots
_LATE_S = 0.5  # then it goes on from here instead of catching up
_QUALITY = 80


class Player:
    """A recording in place of a daemon: ``snapshot``, ``traces`` and ``switch_preview`` are those of a ``Monitor``.

    Positions are seconds after the first image. ``changed`` is called in the player's thread whenever another
    image is shown. Raises ``RecordingError`` for a recording without a usable image in the part that is played,
    ``ConfigError`` for tables that are larger than the memory budget.
    """

    def __init__(self, path: Path, config: Config, pace: Pace, *, changed: Callable[[], None] = lambda: None) -> None:
        self.traces = Traces()
        self.alarms = Alarms(path, config, pace)
        self.failed: LcfError | None = None  # why it stopped
        self._ahead = Ahead(config.vehicle.half_width_m, config.vehicle.horizon_s)
        self._name = printable(path.name)
        self._config, self._pace, self._changed = config, pace, changed
        self._recording = open_recording(path, config)
        self._first_ns = self._first_stamp_ns()
        self._condition = threading.Condition()
        self._sought_s: float | None = pace.start_s
        self._position_s = pace.start_s
        self._due = 0  # images to show even if it does not play
        self._playing, self._speed, self._loop = not pace.step, pace.speed or 1.0, pace.loop
        self._anchor: tuple[float, float] | None = None  # monotonic time and position where playing began, s
        self._preview_on = self._closing = False
        self._shown: tuple[Frame, PipelineScene, View] | None = None
        self._preview: Preview | None = None
        self._diagnostics: DiagnosticArray | None = None
        self._diagnostics_ns = self._version = 0
        self._drawn_s = -math.inf
        self._intervals = IntervalMeter()
        self._thread = threading.Thread(target=self._run, name="player", daemon=True)

    def start(self) -> None:
        """Begin to play, and to search for alarms."""
        self._thread.start()
        self.alarms.start()

    def close(self) -> None:
        """End both threads."""
        with self._condition:
            self._closing = True
            self._condition.notify()
        self.alarms.close()
        if self._thread.ident is not None:
            self._thread.join()

    def play(self, playing: bool) -> None:
        """Play, from the beginning if at the end; or pause."""
        with self._changing():
            if not playing:
                self._preview = None  # the last drawn may be an earlier one
            if playing and self._ended():
                self._sought_s = self._pace.start_s
            self._playing, self._anchor = playing, None

    def step(self) -> None:
        """Pause at the next image."""
        with self._changing():
            self._playing = False
            self._due += 1

    def run_at(self, speed: float) -> None:
        """Play that many times as fast as it was recorded, limited to ``SLOWEST`` and ``FASTEST``."""
        with self._changing():
            self._speed, self._anchor = min(max(speed, SLOWEST), FASTEST), None

    def seek(self, at_s: float) -> None:
        """Go to the image nearest to a position."""
        with self._changing():
            self._sought_s = min(max(at_s, self._pace.start_s), self._length_s())

    def seek_alarm(self, forward: bool) -> None:
        """Go to just before the next or the previous alarm, if there is one."""
        at_s = self._position_s if self._sought_s is None else self._sought_s
        lead_s = ALARM_LEAD_S + 1e-3
        alarm_s = self.alarms.after(at_s + lead_s) if forward else self.alarms.before(at_s)
        if alarm_s is not None:
            self.seek(alarm_s - ALARM_LEAD_S)

    def snapshot(self) -> Snapshot:
        """Return what is shown; nothing of a recording is stale."""
        with self._condition:
            now_ns = time.time_ns()
            replay = Replay(
                self._position_s,
                self._length_s(),
                self._pace.start_s,
                self._playing,
                self._speed,
                self.alarms.found_s,
                self.alarms.done,
            )
            scene = None if self._shown is None else self._shown[1]
            return Snapshot(
                self._version,
                Presence.THERE,
                now_ns,
                (self._name,),
                scene,
                now_ns,
                self._intervals.rate_hz,
                math.nan,
                self._diagnostics,
                self._diagnostics_ns,
                self._preview,
                0,
                replay,
                self._ahead,
            )

    def switch_preview(self, on: bool) -> None:
        """Start or stop drawing previews."""
        with self._condition:
            self._preview_on = on
            self._condition.notify()

    @contextmanager
    def _changing(self) -> Iterator[None]:
        """Within, change state; then wake waiting threads, and call ``changed`` without the lock, which it may need."""
        with self._condition:
            yield
            self._version += 1
            self._condition.notify()
        self._changed()

    def _length_s(self) -> float:
        return max(self.alarms.searched_s, self._position_s)

    def _ended(self) -> bool:
        return self.alarms.done and self._position_s >= self.alarms.searched_s

    def _first_stamp_ns(self) -> int:
        """Return the first stamp, ns. Raises what the first image would raise in the player's thread."""
        self._recording.start_s = self._pace.start_s
        next(run(self._recording, self._config))
        assert self._recording.first_ns is not None
        return self._recording.first_ns

    def _run(self) -> None:
        try:
            while not self._closing:
                with self._condition:
                    at_s, self._sought_s = self._sought_s, None
                    if at_s is not None:
                        self._anchor, self._due = None, max(self._due, 1)
                if at_s is not None:
                    self._play_from(at_s)
                else:
                    self._stand()
        except LcfError as error:  # the recording was removed meanwhile
            with self._changing():
                self.failed, self._playing = error, False
                status = DeviceStatus("recording", Level.ERROR, printable(str(error)))
                self._diagnostics = DiagnosticArray(Header(0, ""), self._name, (status,))
                self._diagnostics_ns = time.time_ns()

    def _play_from(self, at_s: float) -> None:
        start_s = max(at_s - WARM_UP_S, 0.0)
        self._recording.start_s = start_s
        self._recording.duration_s = self._pace.start_s + self._pace.duration_s - start_s
        self._intervals = IntervalMeter()
        for frame, outcome in run(self._recording, self._config):
            position_s = (frame.stamp_ns - self._first_ns) / 1e9
            self._intervals.add([frame.stamp_ns])
            if position_s < at_s - 1e-6:
                if self._closing or self._sought_s is not None:
                    return
                continue
            if not self._wait(position_s):
                return
            self._show(frame, outcome, position_s)
        with self._changing():
            if self._loop and self._playing and self._sought_s is None:
                self._sought_s = self._pace.start_s
            elif self._sought_s is None:
                self._playing, self._preview = False, None  # the last drawn may be an earlier one

    def _stand(self) -> None:
        """Wait at the end until a position is sought."""
        with self._condition:
            self._due = 0
            if not self._needs_preview():
                if self._sought_s is None and not self._closing:
                    self._condition.wait()
                return
        with self._changing():
            self._draw()

    def _wait(self, position_s: float) -> bool:
        """Wait until an image is to be shown; False: another one is sought."""
        while True:
            with self._condition:
                if self._closing or self._sought_s is not None:
                    return False
                if self._due:
                    self._due -= 1
                    return True
                wait_s = self._wait_s(position_s) if self._playing else None
                if wait_s is not None and wait_s <= 0:
                    return True
                if wait_s is not None or not self._needs_preview():
                    self._condition.wait(wait_s)
                    continue
            with self._changing():
                self._draw()

    def _wait_s(self, position_s: float) -> float:
        """Return the time until a position is due at the present pace, s."""
        now_s = time.monotonic()
        since_s, from_s = self._anchor or (now_s, position_s)
        wait_s = (position_s - from_s) / self._speed - (now_s - since_s)
        self._anchor = None if wait_s < -_LATE_S else (since_s, from_s)
        return wait_s

    def _needs_preview(self) -> bool:
        return self._preview_on and self._preview is None and self._shown is not None

    def _show(self, frame: Frame, outcome: Outcome, position_s: float) -> None:
        with self._changing():
            went_on = 0 <= position_s - self._position_s < _POINT_S
            self._position_s = position_s
            self._shown = frame, outcome.scene, outcome.view()
            self._preview = self._preview if self._playing else None
            if not went_on or frame.stamp_ns - self._diagnostics_stamp_ns() >= _POINT_S * 1e9:
                self._add_point(outcome.scene)
            if self._preview_on and (not self._playing or time.monotonic() - self._drawn_s >= _PREVIEW_S):
                self._draw()

    def _diagnostics_stamp_ns(self) -> int:
        return 0 if self._diagnostics is None else self._diagnostics.header.stamp_ns

    def _add_point(self, scene: PipelineScene) -> None:
        """Add a point to the plots, at the time of the recording."""
        memory = asdict(self._config.memory)
        values = {f"{table}_fill": f"{getattr(scene.sizes, table)}/{memory[table]}" for table in TABLES}
        values["detect_p50_ms"] = f"{scene.timing.detect / 1e3:.2f}"
        values["filter_p50_ms"] = f"{scene.timing.filter / 1e3:.2f}"
        status = (
            DeviceStatus("pipeline", Level.WARN if scene.notes else Level.OK, "; ".join(scene.notes) or "runs", values),
            DeviceStatus("recording", Level.OK, self._name, {k: str(n) for k, n in self._recording.skipped.items()}),
        )
        self._diagnostics = DiagnosticArray(Header(scene.stamp_ns, ""), self._name, status)
        self._diagnostics_ns = time.time_ns()
        self.traces.add(Point.of(scene.stamp_ns, scene, self._intervals.rate_hz, self._diagnostics))

    def _draw(self) -> None:
        if self._shown is None or not self._preview_on:
            return
        frame, scene, view = self._shown
        _, jpeg = cv2.imencode(".jpg", draw(frame.image, scene, view), (cv2.IMWRITE_JPEG_QUALITY, _QUALITY))
        image = CompressedImage(Header(scene.stamp_ns, ""), "jpeg", memoryview(np.ascontiguousarray(jpeg).tobytes()))
        self._preview, self._drawn_s = Preview(image, time.time_ns(), scene), time.monotonic()
