"""Where in a recording a contact becomes probable: all of it is filtered once, in parallel to playback."""

import math
import threading
from pathlib import Path

from lcf_edge.config import Config
from lcf_edge.errors import LcfError
from lcf_edge.messages import Scene
from lcf_edge.pipeline import run
from lcf_edge.recording.pace import Pace
from lcf_edge.recording.read import open_recording

PROBABLY = 0.5  # least probability of being met for an alarm
_APART_S = 0.5  # an alarm sooner after another one counts as the same


def met(scene: Scene) -> set[int]:
    """Return the ids of objects that will probably be met."""
    return set(scene.objects["id"][scene.objects["probability"] >= PROBABLY].tolist())


class Alarms:
    """Searches a recording in a thread of its own; what it has found may be read at any time."""

    def __init__(self, path: Path, config: Config, pace: Pace) -> None:
        """Raises ``RecordingError``."""
        self._recording = open_recording(path, config)
        self._recording.start_s, self._recording.duration_s = pace.start_s, pace.duration_s
        self._config = config
        self.found_s: tuple[float, ...] = ()  # when each begins, after the first image
        self.searched_s = pace.start_s  # up to here
        self.done = False
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._search, name="alarms", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """Stop, even before the search is complete."""
        self._closing.set()
        if self._thread.ident is not None:
            self._thread.join()

    def before(self, at_s: float) -> float | None:
        """Return the last alarm before a position, s; None: there is none."""
        return max((found_s for found_s in self.found_s if found_s < at_s), default=None)

    def after(self, at_s: float) -> float | None:
        """Return the first alarm after a position, s; None: there is none yet."""
        return min((found_s for found_s in self.found_s if found_s > at_s), default=None)

    def _search(self) -> None:
        last_s, announced = -math.inf, set[int]()
        try:
            for frame, outcome in run(self._recording, self._config):
                assert self._recording.first_ns is not None
                at_s = (frame.stamp_ns - self._recording.first_ns) / 1e9
                new = met(outcome.scene) - announced
                announced |= new
                if new and at_s - last_s >= _APART_S:
                    self.found_s += (at_s,)
                    last_s = at_s
                self.searched_s = at_s
                if self._closing.wait(0):
                    return
        except LcfError:
            return  # the player meets the same error, and reports it
        finally:
            self.done = True
