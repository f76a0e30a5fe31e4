"""The overlay: two panels that show the filter's results for a frame.

Left, the Line expert: corners (yellow dots), those omitted by ψ (red dots), estimated normal edges (blue
squares), λ groups (green lines from each edge to the group's centre), ψ (yellow circles and rectangles).
Right, the results: objects (boxes with class, time to contact and its standard deviation; orange: will probably
be met, blue: will not; thin and dashed: not seen in this frame), C_n (green circles), C_r (red circles; those of no
object with cause and time to contact), rebel edges (red squares), the focus of expansion (white cross). Own parts that
the configuration masks are hatched in both. The caption names each in its colour.
"""

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.messages import Cause, Kind, ObjectClass, ObjectState, PipelineScene, Shape, View
from lcf_edge.printable import counted
from lcf_edge.sinks.lettering import Mask, lettering

Image = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]
Figures = tuple[tuple[str, Colour], ...]
"""Blue, green, red."""

YELLOW: Colour = (0, 225, 255)
RED: Colour = (50, 50, 255)
LIGHT_RED: Colour = (150, 150, 255)  # text
BLUE: Colour = (255, 140, 30)
GREEN: Colour = (70, 215, 70)
ORANGE: Colour = (40, 160, 255)
LIGHT_BLUE: Colour = (255, 215, 110)
GREY: Colour = (150, 150, 150)
WHITE: Colour = (255, 255, 255)
BLACK: Colour = (0, 0, 0)

_FRACTION_BITS = 3  # OpenCV draws at an eighth of a pixel
_FARTHEST_PX = 100_000  # what lies beyond cannot be seen, and would overflow OpenCV's fixed point
_SQUARE = np.array([(-3, -3), (3, -3), (3, 3), (-3, 3)], np.float32)
_CROSS = np.array([[(-9, 0), (9, 0)], [(0, -9), (0, 9)]], np.float32)
_HALO = np.ones((3, 3), np.uint8)
_STRIP_PX = 20
_HATCH_PX = 8
_HALO_PX = 2
_DASH_PX, _GAP_PX = 7, 5
_PROBABLY = 0.5


def draw(image: npt.NDArray[np.uint8], scene: PipelineScene, view: View) -> Image:
    """The two panels of one frame: (h, w) luminance in, (h, 2w, 3) blue, green, red out."""
    base = cv2.cvtColor(cv2.convertScaleAbs(image, alpha=0.75), cv2.COLOR_GRAY2BGR)  # dimmed: marks stand out
    width = image.shape[1]
    panels = np.concatenate((base, base), axis=1).astype(np.uint8, copy=False)
    left, right = panels[:, :width], panels[:, width:]
    for panel, paint in ((left, _line_expert), (right, _found)):
        own = np.ascontiguousarray(panel)  # a copy, so that nothing spills over into the other panel
        _hatch(own, view.own_parts)
        paint(own, scene, view)
        panel[...] = own
    return panels


def _line_expert(panel: Image, scene: PipelineScene, view: View) -> None:
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
            (counted(sizes.corners, "corner"), YELLOW),
            (f"{sizes.omitted} omitted", LIGHT_RED),
            (counted(sizes.edges_normal, "edge"), BLUE),
            (counted(sizes.groups, "group"), GREEN),
            (f"{sizes.psi} psi", YELLOW),
        ),
    )


def _found(panel: Image, scene: PipelineScene, view: View) -> None:
    _outlines(panel, view.rebels[:, None] + _SQUARE, RED)
    _outlines(panel, view.focus + _CROSS, BLACK, 3)
    _outlines(panel, view.focus + _CROSS, WHITE)
    for circle in scene.circles[scene.circles["kind"] == Kind.NORMAL]:
        _circle(panel, (circle["x"], circle["y"], circle["radius"]), GREEN, 1)
    is_rebel = scene.circles["kind"] == Kind.REBEL
    for circle in scene.circles[is_rebel]:
        _circle(panel, (circle["x"], circle["y"], circle["radius"]), RED, 2)
    urgent_first = scene.objects[np.lexsort((scene.objects["ttc"], -scene.objects["probability"]))]
    for thing in urgent_first[::-1]:
        _box(panel, thing)
    taken: list[_Box] = []
    for thing in urgent_first:  # the most urgent gets the best place
        around = (thing["x"], thing["y"], thing["width"] / 2, thing["height"] / 2)
        is_met = thing["probability"] >= _PROBABLY
        _beside(panel, _object_label(thing), around, taken, _colour(thing), needed=is_met)
    alone = is_rebel
    if len(scene.circle_objects):
        alone = is_rebel & (scene.circle_objects == 0)
    rebels = scene.circles[alone]
    for circle in rebels[np.argsort(rebels["ttc"], kind="stable")]:
        around = (circle["x"], circle["y"], circle["radius"], circle["radius"])
        _beside(panel, _label(circle), around, taken, LIGHT_RED)
    _caption(panel, found_figures(scene))


def found_figures(scene: PipelineScene) -> Figures:
    """The caption of the right panel; of circles, as many as are drawn and published."""
    sizes, count = scene.sizes, len(scene.objects)
    met = int((scene.objects["probability"] >= _PROBABLY).sum())
    rebels = int((scene.circles["kind"] == Kind.REBEL).sum())
    return (
        (counted(count, "object") if count else "", LIGHT_BLUE),
        (f"{met} to be met" if met else "", ORANGE),
        (counted(len(scene.circles) - rebels, "normal circle"), GREEN),
        (f"{counted(rebels, 'rebel circle')}, {counted(sizes.edges_rebel, 'edge')}", LIGHT_RED),
        (counted(sizes.chains, "chain"), WHITE),
        (", ".join(scene.notes), YELLOW),
    )


def _colour(thing: np.void) -> Colour:
    return ORANGE if thing["probability"] >= _PROBABLY else LIGHT_BLUE


def _box(panel: Image, thing: np.void) -> None:
    """Draw a box: 2 px and solid if seen, else 1 px and dashed; with a dark border, for bright images."""
    half = np.array((thing["width"], thing["height"]), np.float64) / 2
    middle = np.array((thing["x"], thing["y"]), np.float64)
    if not (np.isfinite(half) & np.isfinite(middle)).all():
        return
    beyond = _DASH_PX + _GAP_PX  # of the image: a side farther out is invisible
    rows, columns = panel.shape[:2]
    limits = np.array((columns, rows)) + beyond
    (left, top), (right, bottom) = (np.clip(corner, -beyond, limits) for corner in (middle - half, middle + half))
    corners = np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
    if thing["state"] == ObjectState.SEEN:
        _outlines(panel, corners[None], BLACK, 4)
        _outlines(panel, corners[None], _colour(thing), 2)
        return
    dashes = np.concatenate([_dashes(start, end) for start, end in zip(corners, np.roll(corners, -1, 0), strict=True)])
    _outlines(panel, dashes, BLACK, 3)
    _outlines(panel, dashes, _colour(thing))


def _dashes(start: npt.NDArray[np.float64], end: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the dashes of a line, (n, 2, 2) px."""
    length_px = float(np.hypot(*(end - start)))
    along = np.arange(0.0, max(length_px, 1.0), _DASH_PX + _GAP_PX)
    shares = np.stack((along, np.minimum(along + _DASH_PX, length_px)), axis=1) / max(length_px, 1.0)
    return start + shares[..., None] * (end - start)


def _object_label(thing: np.void) -> str:
    kind = ObjectClass(thing["class_id"])
    name = "object" if kind is ObjectClass.UNKNOWN else kind.name.lower().replace("_", " ")
    if not np.isfinite(thing["ttc"]):
        return name
    spread = f" ±{thing['ttc_sigma']:.1f}" if np.isfinite(thing["ttc_sigma"]) else ""
    return f"{name} {thing['ttc']:.1f}{spread} s"


def _hatch(panel: Image, parts: tuple[npt.NDArray[np.float32], ...]) -> None:
    """Hatch and outline own parts."""
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
    """Convert shapes, (n, k, 2) px, to OpenCV's fixed point, without those with points not finite or far outside."""
    seen = (np.abs(points) < _FARTHEST_PX).all(axis=(1, 2))  # NaN compares false
    fixed: npt.NDArray[np.int32] = np.round(points[seen] * (1 << _FRACTION_BITS)).astype(np.int32)
    return fixed


def _outlines(panel: Image, shapes: npt.NDArray[np.floating], colour: Colour, thickness: int = 1) -> None:
    """Draw (n, k, 2) closed outlines; k = 2 is a line, k = 1 a dot."""
    cv2.polylines(panel, list(_fixed_point(shapes)), True, colour, thickness, cv2.LINE_AA, _FRACTION_BITS)


def _dots(panel: Image, points: npt.NDArray[np.float32], colour: Colour) -> None:
    _outlines(panel, points[:, None], colour, 3)


def _circle(panel: Image, place: tuple[float, float, float], colour: Colour, thickness: int) -> None:
    """``place``: x, y, radius in px."""
    for x, y, radius in _fixed_point(np.array([[place]], np.float32))[:, 0].tolist():
        cv2.circle(panel, (x, y), max(radius, 1), colour, thickness, cv2.LINE_AA, _FRACTION_BITS)


_Box = tuple[int, int, int, int]
"""Left, top, right, bottom, px."""


def _beside(
    panel: Image,
    text: str,
    around: tuple[float, float, float, float],
    taken: list[_Box],
    colour: Colour,
    *,
    needed: bool = True,
) -> None:
    """Write a label beside something: ``around``: its middle and half extent (x, y, across, down; px).

    It is placed inside the image and away from other labels; without such a place, only if it is ``needed``.
    """
    if not np.less(np.abs(around), _FARTHEST_PX).all():
        return
    x, y, across, down = map(round, map(float, around))
    mask = lettering(text)
    height, width = mask.shape
    gap = 2
    places = (
        (x - width // 2, y - down - gap - height),
        (x - width // 2, y + down + gap),
        (x + across + gap, y - height // 2),
        (x - across - gap - width, y - height // 2),
        (x - width // 2, y - height // 2),
    )
    rows, columns = panel.shape[:2]
    boxes = []
    for left, top in places:
        inner_left = max(min(left, columns - width - 2), 2)
        inner_top = max(min(top, rows - _STRIP_PX - height), 2)
        boxes.append((inner_left, inner_top, inner_left + width, inner_top + height))
    free = [box for box in boxes if not any(_overlap(box, other) for other in taken)]
    if not free and not needed:
        return
    box = (free or boxes)[0]
    taken.append(box)
    _write(panel, mask, box[:2], colour)


def _overlap(a: _Box, b: _Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _write(panel: Image, mask: Mask, left_top: tuple[int, int], colour: Colour) -> None:
    """Text with a dark halo; what would lie outside the image is cut."""
    mask = np.pad(mask, _HALO_PX)
    left, top = (max(at - _HALO_PX, 0) for at in left_top)
    place = panel[top : top + mask.shape[0], left : left + mask.shape[1]]
    mask = mask[: place.shape[0], : place.shape[1], None]
    if mask.size:
        halo = cv2.dilate(mask, _HALO)[..., None]
        dark = place * (1 - halo / np.float32(255))
        place[...] = dark + (mask / np.float32(255)) * (np.array(colour, np.float32) - dark)


def _caption(panel: Image, parts: Figures) -> None:
    """A dark strip at the foot with ``parts`` in a row, shrunk until they fit."""
    strip = panel[-_STRIP_PX:]
    strip //= 3
    rows, columns = panel.shape[:2]
    margin, gap = 5, 10
    texts = [(lettering(text), colour) for text, colour in parts if text]
    room = columns - 2 * margin - gap * len(texts)
    scale = min(1.0, max(room, 1) / max(sum(mask.shape[1] for mask, _ in texts), 1))
    x = margin
    for mask, colour in texts:
        height, width = (max(round(side * scale), 1) for side in mask.shape)
        fitted = np.asarray(cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
        _write(panel, fitted, (x, rows - (_STRIP_PX + height) // 2), colour)
        x += width + gap
