"""The overlay: two panels that show what the filter made of a frame, and the video of them.

Left, the Line expert: corners (yellow dots), those omitted by ψ (red dots), estimated normal edges (blue
squares), λ groups (green lines from each edge to the group's centre), ψ (yellow circles and rectangles).
Right, the Circle expert: C_n (green circles), C_r (red circles, cause and time to contact beside them), rebel
edges (red squares), the focus of expansion (white cross). Own parts that the configuration masks are hatched in both.
The caption names each in its colour.
"""

from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.records import Cause, Kind, Scene, Shape, View
from lcf_edge.sinks import SinkError, check_output
from lcf_edge.sinks.lettering import Mask, lettering

if TYPE_CHECKING:
    from lcf_edge.pipeline import Outcome

Picture = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]
"""Blue, green, red."""

YELLOW: Colour = (0, 225, 255)
RED: Colour = (50, 50, 255)
LIGHT_RED: Colour = (150, 150, 255)  # text
BLUE: Colour = (255, 140, 30)
GREEN: Colour = (70, 215, 70)
GREY: Colour = (150, 150, 150)
WHITE: Colour = (255, 255, 255)
BLACK: Colour = (0, 0, 0)

SUFFIXES = (".mp4",)

_FRACTION_BITS = 3  # OpenCV draws at an eighth of a pixel
_FARTHEST_PX = 100_000  # what lies beyond cannot be seen, and would overflow OpenCV's fixed point
_SQUARE = np.array([(-3, -3), (3, -3), (3, 3), (-3, 3)], np.float32)
_CROSS = np.array([[(-9, 0), (9, 0)], [(0, -9), (0, 9)]], np.float32)
_HALO = np.ones((3, 3), np.uint8)
_STRIP_PX = 20
_HATCH_PX = 8
_HALO_PX = 2


def draw(image: npt.NDArray[np.uint8], outcome: "Outcome") -> Picture:
    """The two panels of one frame: (h, w) luminance in, (h, 2w, 3) blue, green, red out."""
    base = cv2.cvtColor(cv2.convertScaleAbs(image, alpha=0.75), cv2.COLOR_GRAY2BGR)  # dimmed: the marks stand out
    width = image.shape[1]
    panels = np.concatenate((base, base), axis=1).astype(np.uint8, copy=False)
    left, right = panels[:, :width], panels[:, width:]
    for panel, paint in ((left, _line_expert), (right, _circle_expert)):
        own = np.ascontiguousarray(panel)  # nothing drawn in one panel spills over into the other
        _hatch(own, outcome.view.own_parts)
        paint(own, outcome.scene, outcome.view)
        panel[...] = own
    return panels


def _line_expert(panel: Picture, scene: Scene, view: View) -> None:
    member = view.edge_group >= 0
    centres = view.groups[view.edge_group[member], :2]
    _outlines(panel, np.stack((view.edges[member], centres), axis=1), GREEN)
    _outlines(panel, view.edges[:, None] + _SQUARE, BLUE)
    _dots(panel, view.corners[~view.omitted], YELLOW)
    _dots(panel, view.corners[view.omitted], RED)
    for region in scene.psi:
        if region["shape"] == Shape.CIRCLE:
            _circle(panel, (region["x"], region["y"], region["width"] / 2), YELLOW, 2)
        else:
            size = np.array((region["width"], region["height"]), np.float64)
            corners = np.array((region["x"], region["y"]), np.float64) + size * _SQUARE / 6
            _outlines(panel, corners[None], YELLOW, 2)
    speed = f"{scene.vehicle_speed:.2f} m/s" if np.isfinite(scene.vehicle_speed) else "speed unknown"
    sizes = scene.sizes
    _caption(
        panel,
        (
            (f"frame {scene.seq}  {scene.stamp_ns / 1e9 % 1000:.2f} s  {speed}", WHITE),
            (f"{sizes.corners} corners", YELLOW),
            (f"{sizes.omitted} omitted", LIGHT_RED),
            (f"{sizes.edges_normal} edges", BLUE),
            (f"{sizes.groups} groups", GREEN),
            (f"{sizes.psi} psi", YELLOW),
        ),
    )


def _circle_expert(panel: Picture, scene: Scene, view: View) -> None:
    _outlines(panel, view.rebels[:, None] + _SQUARE, RED)
    _outlines(panel, view.focus + _CROSS, BLACK, 3)
    _outlines(panel, view.focus + _CROSS, WHITE)
    for circle in scene.circles[scene.circles["kind"] == Kind.NORMAL]:
        _circle(panel, (circle["x"], circle["y"], circle["radius"]), GREEN, 1)
    rebels = scene.circles[scene.circles["kind"] == Kind.REBEL]
    for circle in rebels:
        _circle(panel, (circle["x"], circle["y"], circle["radius"]), RED, 2)
    taken: list[_Box] = []
    for circle in rebels[np.argsort(rebels["ttc"], kind="stable")]:  # the most urgent has the best place
        _beside(panel, _label(circle), circle, taken)
    sizes = scene.sizes
    _caption(
        panel,
        (
            (f"{sizes.circles_normal} normal circles", GREEN),
            (f"{sizes.circles_rebel} rebel circles, {sizes.edges_rebel} edges", LIGHT_RED),
            (f"{sizes.chains} chains", WHITE),
            (", ".join(scene.notes), YELLOW),
        ),
    )


def _hatch(panel: Picture, parts: tuple[npt.NDArray[np.float32], ...]) -> None:
    """Own parts: hatched, with an outline."""
    if not parts:
        return
    rows, columns = panel.shape[:2]
    inside = np.zeros((rows, columns), np.uint8)
    for part in parts:
        cv2.fillPoly(inside, list(_fixed_point(part[None])), (255,), cv2.LINE_8, _FRACTION_BITS)
    stripes = (np.arange(columns) + np.arange(rows)[:, None]) % _HATCH_PX == 0
    panel[(inside > 0) & stripes] = GREY
    for part in parts:
        _outlines(panel, part[None], GREY)


def _label(circle: np.void) -> str:
    cause = Cause(circle["cause"])
    name = "rebel" if cause is Cause.NONE else cause.name.lower()
    return f"{name} {circle['ttc']:.1f} s" if np.isfinite(circle["ttc"]) else name


def _fixed_point(points: npt.NDArray[np.floating]) -> npt.NDArray[np.int32]:
    """(n, k, 2) px to OpenCV's fixed point, without shapes that have a point not finite or far outside."""
    seen = (np.abs(points) < _FARTHEST_PX).all(axis=(1, 2))  # NaN compares false
    fixed: npt.NDArray[np.int32] = np.round(points[seen] * (1 << _FRACTION_BITS)).astype(np.int32)
    return fixed


def _outlines(panel: Picture, shapes: npt.NDArray[np.floating], colour: Colour, thickness: int = 1) -> None:
    """Draw (n, k, 2) closed outlines; k = 2 is a line, k = 1 a dot."""
    cv2.polylines(panel, list(_fixed_point(shapes)), True, colour, thickness, cv2.LINE_AA, _FRACTION_BITS)


def _dots(panel: Picture, points: npt.NDArray[np.float32], colour: Colour) -> None:
    _outlines(panel, points[:, None], colour, 3)


def _circle(panel: Picture, place: tuple[float, float, float], colour: Colour, thickness: int) -> None:
    """``place``: x, y, radius in px."""
    for x, y, radius in _fixed_point(np.array([[place]], np.float32))[:, 0].tolist():
        cv2.circle(panel, (x, y), max(radius, 1), colour, thickness, cv2.LINE_AA, _FRACTION_BITS)


_Box = tuple[int, int, int, int]
"""Left, top, right, bottom, px."""


def _beside(panel: Picture, text: str, circle: np.void, taken: list[_Box]) -> None:
    """Write beside the circle, inside the picture, where no other label stands if there is such a place."""
    place = [float(circle[name]) for name in ("x", "y", "radius")]
    if not np.less(np.abs(place), _FARTHEST_PX).all():
        return
    x, y, radius = map(round, place)
    letters = lettering(text)
    height, width = letters.shape
    gap = 2
    places = (
        (x - width // 2, y - radius - gap - height),
        (x - width // 2, y + radius + gap),
        (x + radius + gap, y - height // 2),
        (x - radius - gap - width, y - height // 2),
        (x - width // 2, y - height // 2),
    )
    rows, columns = panel.shape[:2]
    boxes = []
    for left, top in places:
        inner_left = max(min(left, columns - width - 2), 2)
        inner_top = max(min(top, rows - _STRIP_PX - height), 2)
        boxes.append((inner_left, inner_top, inner_left + width, inner_top + height))
    box = next((box for box in boxes if not any(_overlap(box, other) for other in taken)), boxes[0])
    taken.append(box)
    _write(panel, letters, box[:2], LIGHT_RED)


def _overlap(a: _Box, b: _Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _write(panel: Picture, letters: Mask, left_top: tuple[int, int], colour: Colour) -> None:
    """Text with a dark halo; what would lie outside the picture is cut."""
    letters = np.pad(letters, _HALO_PX)
    left, top = (max(at - _HALO_PX, 0) for at in left_top)
    place = panel[top : top + letters.shape[0], left : left + letters.shape[1]]
    letters = letters[: place.shape[0], : place.shape[1], None]
    if letters.size:
        halo = cv2.dilate(letters, _HALO)[..., None]
        dark = place * (1 - halo / np.float32(255))
        place[...] = dark + (letters / np.float32(255)) * (np.array(colour, np.float32) - dark)


def _caption(panel: Picture, parts: tuple[tuple[str, Colour], ...]) -> None:
    """A dark strip at the foot with ``parts`` in a row, shrunk until they fit."""
    strip = panel[-_STRIP_PX:]
    strip //= 3
    rows, columns = panel.shape[:2]
    margin, gap = 5, 10
    texts = [(lettering(text), colour) for text, colour in parts if text]
    room = columns - 2 * margin - gap * len(texts)
    scale = min(1.0, max(room, 1) / max(sum(letters.shape[1] for letters, _ in texts), 1))
    x = margin
    for letters, colour in texts:
        height, width = (max(round(side * scale), 1) for side in letters.shape)
        fitted = np.asarray(cv2.resize(letters, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
        _write(panel, fitted, (x, rows - (_STRIP_PX + height) // 2), colour)
        x += width + gap


class VideoSink:
    """An MP4 video of pictures of ``size`` (width, height) px at ``frames_per_s``.

    The codec wants even sizes: an odd last row is cut. Raises ``UsageError`` when the name does not end in
    ``.mp4``, ``SinkError`` when the file cannot be written.
    """

    def __init__(self, path: Path, frames_per_s: float, size: tuple[int, int]) -> None:
        check_output(path, SUFFIXES)
        self.path = path
        # Two decimals: the container's time base cannot hold more.
        self._writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), round(frames_per_s, 2), size)
        self._frames = 0
        if not self._writer.isOpened():
            raise self._failure()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, failed: type[BaseException] | None, *_: TracebackType | BaseException | None) -> None:
        self._writer.release()
        # The writer keeps silent about a full disk; the index at the end of the file tells.
        if failed is None and self._frames and not cv2.VideoCapture(str(self.path)).isOpened():
            raise self._failure()

    def _failure(self) -> SinkError:
        return SinkError(f"{self.path}: the video cannot be written; name another file or free the disk")

    def write(self, picture: Picture) -> None:
        """Append one picture."""
        self._writer.write(picture)
        self._frames += 1
