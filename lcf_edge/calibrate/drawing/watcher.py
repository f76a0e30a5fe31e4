"""Follows a source in a thread of its own: its newest image, and a proposal of what never moves in it."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace

from drivers.errors import DriverError
from drivers.samples import Frame
from lcf_edge.calibrate.mask import LIVE_S, NO_IMAGES, Grey, Polygon, Stillness, images_apart, proposal
from lcf_edge.calibrate.result import CalibrationError
from lcf_edge.calibrate.sources import Item, SensorSource, for_a_while
from lcf_edge.errors import LcfError

_ENDS_WITHIN_S = 2.0


@dataclass(frozen=True)
class Watched:
    """``image``: the newest; ``number``: which it is, from 1; ``proposed``: px; ``note``: on images and proposal."""

    image: Grey
    number: int = 1
    is_measuring: bool = True
    proposed: tuple[Polygon, ...] = ()
    note: str = ""


class Watcher:
    """Watches ``source`` from ``start`` to ``close``. The proposal is made of ``seconds``, or of a whole recording."""

    def __init__(self, source: SensorSource, seconds: float | None) -> None:
        self.live = source.live
        self._source = source
        self._seconds = seconds or (LIVE_S if source.live else None)
        self._watched: Watched | None = None
        self._error: LcfError | DriverError | None = None
        self._began, self._ended = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="watcher", daemon=True)

    def start(self) -> None:
        """Begin, and wait for the first image. Raises ``CalibrationError``, ``RecordingError``, ``DriverError``."""
        self._thread.start()
        self._began.wait()
        if self._watched is None:
            raise self._error or CalibrationError(NO_IMAGES)

    def watched(self) -> Watched:
        """Return what is known now."""
        assert self._watched is not None  # start has waited for it
        return self._watched

    def close(self) -> None:
        """End it."""
        self._ended.set()
        self._thread.join(_ENDS_WITHIN_S)

    def _run(self) -> None:
        try:
            self._watch()
        except (LcfError, DriverError) as error:
            self._error = error
            if self._watched is not None:  # what is drawn on its last image is not lost
                self._watched = replace(self._watched, is_measuring=False, note=f"no more images: {error}")
        finally:
            self._began.set()

    def _watch(self) -> None:
        """Raises ``RecordingError``, ``DriverError``."""
        items = self._until_the_end()
        stillness: Stillness | None = None
        for image in images_apart(for_a_while(items, self._seconds, Frame)):
            stillness = stillness or Stillness(*image.shape)
            stillness.add(image)
            self._show(image)
        if self._watched is None or stillness is None or self._ended.is_set():
            return
        try:
            polygons, note = proposal(stillness)
        except CalibrationError as error:
            polygons, note = [], f"no proposal: {error}"
        self._watched = replace(self._watched, is_measuring=False, proposed=tuple(polygons), note=note)
        for image in images_apart(items) if self.live else ():
            self._show(image)

    def _until_the_end(self) -> Iterator[Item]:
        for item in self._source.items():
            if self._ended.is_set():
                return
            yield item

    def _show(self, image: Grey) -> None:
        before = self._watched
        self._watched = replace(before, image=image, number=before.number + 1) if before else Watched(image)
        self._began.set()
