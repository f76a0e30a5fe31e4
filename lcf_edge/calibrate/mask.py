"""The vehicle's own parts in view: regions that never move in the image while the vehicle drives and turns.

The grey gradient of every pixel is averaged over the drive. Where the image is constant, the mean is as long as the
root mean square of the gradients; where the world passes, they change and point anywhere. A plain surface has no
gradients: it belongs to the vehicle if it reaches the border of the image and its rim is constant.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import cv2
import msgspec
import numpy as np
import numpy.typing as npt

from drivers.samples import Frame
from lcf_edge.calibrate import report
from lcf_edge.calibrate.guide import Guide
from lcf_edge.calibrate.result import CalibrationError, Result
from lcf_edge.calibrate.sources import Item, SensorSource, for_a_while
from lcf_edge.config import MAX_POINTS, MAX_POLYGONS, Config, check_mask
from lcf_edge.printable import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Grey = npt.NDArray[np.uint8]
Marked = npt.NDArray[np.bool_]
Polygon = list[list[float]]

LIVE_S = 30.0
NO_IMAGES = "camera: no images came; check camera.device, or name another recording"

_APART_S = 0.2  # images closer together are too similar
_MIN_FRAMES = 20
_SMOOTH_PX = 1.0
_STILL = 0.8  # least ratio of the mean gradient to the root mean square
_TEXTURED = 6.0  # root mean square of the gradients; by Sobel's weights, 8 are one grey level a px
_PASSES = 0.5  # least share of the textured pixels that must move, else the vehicle was stationary
_WALLED = 0.7  # least share of a plain surface's rim that must be constant
_CLOSED_SHARE = 0.02  # of the image's width: gaps that are closed
_MIN_SHARE = 0.001  # of the image
_MAX_SHARE = 0.6
_SMOOTHED_PX = 2.0  # by which a polygon may miss the outline
_GROWN_PX = 2


class Stillness:
    """How constant every pixel's gradient is over the images of a drive."""

    def __init__(self, height: int, width: int) -> None:
        self.frames = 0
        self._sum = np.zeros((2, height, width), np.float32)
        self._squares = np.zeros((height, width), np.float32)

    def add(self, image: Grey) -> None:
        """Take the next image, (height, width)."""
        smooth = cv2.GaussianBlur(image, (0, 0), _SMOOTH_PX)
        gx, gy = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
        self._sum[0] += gx
        self._sum[1] += gy
        self._squares += gx * gx + gy * gy
        self.frames += 1

    def textured(self) -> Marked:
        """Pixels with texture, still or not; (height, width)."""
        return np.asarray(self._squares >= _TEXTURED**2 * self.frames)

    def still(self) -> Marked:
        """Pixels that never move; (height, width)."""
        along, down = self._sum
        return np.asarray(along**2 + down**2 > _STILL**2 * self.frames * self._squares) & self.textured()


def calibrate_mask(source: SensorSource, config: Config, seconds: float | None, guide: Guide) -> Result:
    """``camera.mask`` of the parts that never move. Raises ``CalibrationError``."""
    if source.live:
        seconds = seconds or LIVE_S
        guide.say(f"Drive around for {seconds:g} s, past things, with turns to both sides.")
    stillness: Stillness | None = None
    image = np.zeros((1, 1), np.uint8)
    for image in images_apart(for_a_while(source.items(), seconds, Frame)):
        stillness = stillness or Stillness(*image.shape)
        stillness.add(image)
        guide.progress(f"{stillness.frames} images")
    guide.end()
    if stillness is None:
        raise CalibrationError(NO_IMAGES)
    polygons, words = proposal(stillness)
    return as_result(polygons, image, config, words, "calibrate mask")


def given_mask(source: SensorSource, config: Config, polygons: Sequence[Polygon], guide: Guide) -> Result:
    """``camera.mask`` as given, px of the source's images. Raises ``CalibrationError``, ``ConfigError``."""
    image = next((item.image for item in source.items() if isinstance(item, Frame)), None)
    guide.end()
    if image is None:
        raise CalibrationError(NO_IMAGES)
    return as_result(polygons, image, config, f"{counted(len(polygons), 'own part')}, as given", "--polygon")


def images_apart(items: Iterator[Item]) -> Iterator[Grey]:
    """Yield the images among ``items`` that are so far apart that they differ when the vehicle drives."""
    last_ns: int | None = None
    for item in items:
        if isinstance(item, Frame) and (last_ns is None or item.stamp_ns - last_ns >= _APART_S * 1e9):
            last_ns = item.stamp_ns
            yield item.image


def proposal(stillness: Stillness) -> tuple[list[Polygon], str]:
    """Return the outlines of what never moved, px, and what was found in words. Raises ``CalibrationError``."""
    own = own_parts(stillness)
    polygons = outlines(own)
    if not polygons:
        raise CalibrationError(
            f"camera: nothing stands still in {stillness.frames} images; outline what is in view yourself (--draw)"
        )
    parts = counted(len(polygons), "own part")
    return polygons, f"{counted(stillness.frames, 'image')}; {parts}, {own.mean():.1%} of the image"


def own_parts(stillness: Stillness) -> Marked:
    """Parts that never move, with the plain surfaces that they enclose. Raises ``CalibrationError``."""
    if stillness.frames < _MIN_FRAMES:
        raise CalibrationError(
            f"camera: {stillness.frames} images {_APART_S:g} s apart, {_MIN_FRAMES} are needed; drive longer"
        )
    textured, still = stillness.textured(), stillness.still()
    moves = 1 - still.sum() / max(textured.sum(), 1)
    if moves < _PASSES:
        raise CalibrationError(
            f"camera: only {moves:.0%} of what can be seen moved; drive past things, and turn to both sides"
        )
    own = _solid(still | _enclosed(still, ~textured))
    if own.mean() > _MAX_SHARE:
        raise CalibrationError(
            f"camera: {own.mean():.0%} of the image never moved; drive past things, and turn to both sides"
        )
    return own


def _enclosed(still: Marked, plain: Marked) -> Marked:
    """Plain surfaces at the border of the image whose rim is constant."""
    count, label = cv2.connectedComponents(plain.astype(np.uint8), connectivity=4)
    rim = np.zeros(still.shape, np.bool_)
    around = cv2.dilate(label.astype(np.float32), np.ones((3, 3), np.uint8)).astype(np.int32)
    rim = ~plain & (around > 0)
    walled = np.bincount(around[rim & still], minlength=count) / np.maximum(
        np.bincount(around[rim], minlength=count), 1
    )
    at_border = np.unique(np.concatenate([label[0], label[-1], label[:, 0], label[:, -1]]))
    enclosed = np.intersect1d(np.flatnonzero(walled >= _WALLED), at_border[at_border > 0])
    return np.isin(label, enclosed)


def _solid(marked: Marked) -> Marked:
    """Remove gaps, specks, and regions that do not reach the image's border: they are not part of the vehicle."""
    height, width = marked.shape
    reach = 2 * round(_CLOSED_SHARE * width / 2) + 1
    round_brush = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))
    framed = cv2.copyMakeBorder(marked.astype(np.uint8), *(reach,) * 4, cv2.BORDER_REPLICATE)
    closed = cv2.morphologyEx(framed, cv2.MORPH_CLOSE, round_brush)
    small = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach // 2 | 1,) * 2)
    opened = cv2.morphologyEx(closed, cv2.MORPH_OPEN, small)[reach:-reach, reach:-reach]
    count, label, stats, _ = cv2.connectedComponentsWithStats(opened)
    at_border = np.unique(np.concatenate([label[0], label[-1], label[:, 0], label[:, -1]]))
    large = np.flatnonzero(stats[:, cv2.CC_STAT_AREA] >= _MIN_SHARE * width * height)
    return np.isin(label, np.intersect1d(large, at_border[at_border > 0])) if count > 1 else np.zeros_like(marked)


def outlines(own: Marked) -> list[Polygon]:
    """Polygons around each part, the largest first, integer px."""
    grown = cv2.dilate(own.astype(np.uint8), np.ones((2 * _GROWN_PX + 1,) * 2, np.uint8))
    found, _ = cv2.findContours(grown, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    simple = [cv2.approxPolyDP(each, _SMOOTHED_PX, True)[:, 0] for each in sorted(found, key=cv2.contourArea)[::-1]]
    return [each.astype(float).tolist() for each in simple if 3 <= len(each) <= MAX_POINTS][:MAX_POLYGONS]


def as_result(polygons: Sequence[Polygon], image: Grey, config: Config, finding: str, origin: str) -> Result:
    """``camera.mask`` of polygons in px of ``image``. Raises ``ConfigError`` in the name of ``origin``."""
    height, width = image.shape
    scale = np.array((config.camera.width / width, config.camera.height / height))
    with np.errstate(over="ignore"):  # infinity is refused
        mask = [np.rint((np.reshape(each, (-1, 2)) + 0.5) * scale - 0.5).tolist() for each in polygons]
    check_mask(msgspec.structs.replace(config.camera, mask=mask), origin)
    whole: list[list[list[float]]] = [[[int(x), int(y)] for x, y in polygon] for polygon in mask]
    words = f"px of an image of {config.camera.width}x{config.camera.height} (camera.width, camera.height)"
    return Result((finding, words), "camera", {"mask": whole}, _painter(polygons, image))


def _painter(polygons: Sequence[Polygon], image: Grey) -> "Callable[[Figure], None]":
    def paint(figure: "Figure") -> None:
        axes = figure.subplots()
        axes.imshow(image, cmap="gray", vmin=0, vmax=255)
        for polygon in polygons:
            axes.fill(*zip(*polygon, strict=True), facecolor=report.RED, alpha=0.35, edgecolor=report.RED, hatch="//")
        axes.set(xlim=(-0.5, image.shape[1] - 0.5), ylim=(image.shape[0] - 0.5, -0.5))
        axes.set_title("own parts: nothing is looked for there", loc="left")

    return paint
