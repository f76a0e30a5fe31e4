"""A drive as a video: the camera's image, the planner's input, and its decision."""

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.drivers import SceneDriver, driver
from hil_mocks.closed_loop.loop import Moment, drive
from hil_mocks.closed_loop.world import World
from lcf_edge.messages import ObjectClass, Scene
from lcf_edge.sinks.lettering import HEIGHT_PX, lettering

Image = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

_WHITE, _BLACK, _RED, _GREEN, _GREY = (255, 255, 255), (0, 0, 0), (60, 60, 255), (80, 220, 80), (160, 160, 160)
_COLOURS: dict[ObjectClass, Colour] = {
    ObjectClass.UNKNOWN: _GREY,
    ObjectClass.STANDING: (255, 200, 60),
    ObjectClass.CROSSING: (60, 220, 255),
    ObjectClass.ONCOMING: _RED,
    ObjectClass.LEADING: _GREEN,
    ObjectClass.CUTTING_IN: (255, 80, 255),
}
_HALO_PX = 1


class _Filmed:
    """A driver who is filmed."""

    def __init__(self, world: World, name: str, path: Path) -> None:
        inner = driver(world, name)
        if not isinstance(inner, SceneDriver):
            raise TypeError(f"{name} looks at no images")
        self._driver = inner
        size = world.lens.width, world.lens.height
        self.writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), world.fps, size)

    def decide(self, moment: Moment) -> float:
        """The speed that the driver wants now, m/s."""
        target_mps = self._driver.decide(moment)
        assert moment.frame is not None
        assert self._driver.scene is not None
        image = draw(moment, self._driver.scene, self._driver.reported(self._driver.scene), target_mps)
        self.writer.write(image)
        return target_mps


def draw(moment: Moment, scene: Scene, objects: npt.NDArray[np.void], target_mps: float) -> Image:
    """One image (height, width, 3): threats by ground truth (red below them), the planner's input, speeds."""
    assert moment.frame is not None
    image = np.asarray(cv2.cvtColor(moment.frame.image, cv2.COLOR_GRAY2BGR), dtype=np.uint8)
    for body in moment.known:
        if body.in_sight and body.threat:
            x, y, width, height = (round(value) for value in body.box)
            cv2.line(image, (x, y + height + 3), (x + width, y + height + 3), _RED, 3)
    for thing in objects:
        kind = ObjectClass(int(thing["class_id"]))
        colour = _COLOURS[kind]
        middle = np.array([thing["x"], thing["y"]])
        half = np.array([thing["width"], thing["height"]]) / 2
        low, high = (tuple(np.rint(corner).astype(int).tolist()) for corner in (middle - half, middle + half))
        cv2.rectangle(image, low, high, _BLACK, 3)
        cv2.rectangle(image, low, high, colour, 2 if thing["probability"] >= 0.3 else 1)
        _write(image, label(thing), (max(low[0], 2), max(low[1] - HEIGHT_PX - 5, 20)), colour)
    height = image.shape[0]
    braking = target_mps < 0.95 * moment.cruise_mps
    text = (
        f"{moment.time_s:.1f} s  speed {moment.speed_mps:.2f}  wanted {target_mps:.2f} of {moment.cruise_mps:.2f} m/s"
    )
    _write(image, text, (8, height - HEIGHT_PX - 6), _RED if braking else _GREEN)
    _write(image, ", ".join(scene.notes), (8, 4), _WHITE)
    return image


def label(thing: np.void) -> str:
    """Id, class, and what is known of contact, range and lateral miss, each with one sigma."""
    parts = [f"{thing['id']} {ObjectClass(int(thing['class_id'])).name.lower().replace('_', ' ')}"]
    for name, unit, form in (("ttc", " s", ".1f"), ("range", " m", ".1f"), ("lateral", " m aside", "+.1f")):
        if np.isfinite(thing[name]):
            sigma = thing[f"{name}_sigma"]
            spread = f" ±{sigma:.1f}" if np.isfinite(sigma) else ""
            parts.append(f"{thing[name]:{form}}{spread}{unit}")
    return ", ".join(parts)


def _write(image: Image, text: str, at: tuple[int, int], colour: Colour) -> None:
    """Text whose upper left corner is at a point, px."""
    ink = np.pad(lettering(text), _HALO_PX)
    left, top = at
    region = image[max(top, 0) :, max(left, 0) :][: ink.shape[0], : ink.shape[1]]
    ink = ink[: region.shape[0], : region.shape[1]]
    region[cv2.dilate(ink, np.ones((3, 3), np.uint8)) > 0] = _BLACK
    region[ink > 127] = colour


def write(world: World, name: str, folder: Path) -> Path:
    """Drive once more and film it; returns the file (MPEG-4). Raises OSError when it cannot be written."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}-world-{world.seed}.mp4"
    filmed = _Filmed(world, name, path)
    if not filmed.writer.isOpened():
        raise OSError(f"{path}: this OpenCV writes no MPEG-4")
    drive(world, filmed)
    filmed.writer.release()
    return path
