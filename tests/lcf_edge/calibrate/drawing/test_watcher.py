"""The images to draw on, and the proposal, while the source still delivers."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
import pytest

from drivers.errors import DeviceMissingError, DriverError
from drivers.samples import Frame
from lcf_edge.calibrate.drawing.watcher import Watched, Watcher
from lcf_edge.calibrate.result import CalibrationError
from lcf_edge.rendered import scenes

STEP_NS = 200_000_000


def frames_of(kind: str) -> list[Frame]:
    drive = scenes.make(kind, 24, fps=5.0, width=320, height=240, focal_px=250.0)
    return [frame for frame, _ in scenes.frames(drive)]


@dataclass
class Camera:
    """Delivers ``frames``, then fails with ``error`` if there is one."""

    frames: Iterator[Frame]
    error: DriverError | None = None
    live: bool = True
    film: bool = True
    let_go: bool = False

    def items(self) -> Iterator[Frame]:
        try:
            yield from self.frames
            if self.error:
                raise self.error
        finally:
            self.let_go = True

    def lens(self, *_: int) -> None:
        return None


@pytest.fixture
def watch() -> Iterator[Callable[..., Watcher]]:
    watchers: list[Watcher] = []

    def begin(camera: Any, seconds: float | None = None) -> Watcher:
        watchers.append(Watcher(camera, seconds))
        watchers[-1].start()
        return watchers[-1]

    yield begin
    for one in watchers:
        one.close()


def noise() -> Iterator[Frame]:
    random = np.random.default_rng(1)
    for seq in count():
        yield Frame(1 + seq * STEP_NS, seq, random.integers(0, 256, (48, 64), np.uint8))


def until(watcher: Watcher, is_so: Callable[[Watched], bool]) -> Watched:
    """What is known once that is so."""
    while not is_so(known := watcher.watched()):
        time.sleep(0.01)
    return known


def is_measured(known: Watched) -> bool:
    return not known.is_measuring


def test_a_recording_ends_with_its_last_image_and_a_proposal(watch: Callable[..., Watcher]) -> None:
    frames = frames_of("own_bumper")
    camera = Camera(iter(frames), live=False)
    watcher = watch(camera)
    known = until(watcher, is_measured)
    assert np.array_equal(known.image, frames[-1].image)
    assert known.number == len(frames)
    assert len(known.proposed) == 1


def test_where_nothing_stands_still_it_says_so_and_can_be_drawn_on(watch: Callable[..., Watcher]) -> None:
    watcher = watch(Camera(iter(frames_of("turn")), live=False))
    known = until(watcher, is_measured)
    assert known.proposed == ()
    assert known.note.startswith("no proposal: camera: nothing stands still")


def test_a_camera_goes_on_after_the_proposal(watch: Callable[..., Watcher]) -> None:
    camera = Camera(noise())
    watcher = watch(camera, 2.0)
    number = until(watcher, is_measured).number
    until(watcher, lambda known: known.number > number)
    watcher.close()
    assert camera.let_go


def test_what_is_unplugged_leaves_its_last_image(watch: Callable[..., Watcher]) -> None:
    frames = frames_of("own_bumper")[:3]
    camera = Camera(iter(frames), DeviceMissingError("/dev/video0: away"))
    known = until(watch(camera), is_measured)
    assert np.array_equal(known.image, frames[-1].image)
    assert known.note == "no more images: /dev/video0: away"
    assert not known.is_measuring


def test_without_any_image_it_does_not_begin(watch: Callable[..., Watcher]) -> None:
    with pytest.raises(DeviceMissingError, match="away"):
        watch(Camera(iter(()), DeviceMissingError("/dev/video0: away")))
    with pytest.raises(CalibrationError, match="no images came"):
        watch(Camera(iter(())))
