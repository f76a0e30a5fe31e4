"""Images of a report: what is known of a frame, and what was reported."""

from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from lcf_edge.evaluate.report import Rebel
from lcf_edge.evaluate.score import CLOSE_S
from lcf_edge.evaluate.truth import Known

WIDTH_PX = 420
MAX_HEIGHT_PX = 1260  # of an image that is higher than wide
QUALITY = 82  # of the JPEGs
_RED, _YELLOW, _GREY, _WHITE, _BLACK = (60, 60, 255), (0, 230, 255), (190, 190, 190), (255, 255, 255), (0, 0, 0)

Colours = npt.NDArray[np.uint8]


def draw(image: npt.NDArray[np.uint8], known: Sequence[Known], reported: Sequence[Rebel], caption: str) -> Colours:
    """A frame (h, w), grey, as a small image (h, w, 3): threats yellow, other things grey, rebels red.

    At most ``WIDTH_PX`` wide and ``MAX_HEIGHT_PX`` high.
    """
    scale = min(WIDTH_PX / image.shape[1], MAX_HEIGHT_PX / image.shape[0])
    kind = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    height, width = (max(round(scale * side), 1) for side in image.shape)
    canvas = cv2.cvtColor(cv2.resize(image, (width, height), interpolation=kind), cv2.COLOR_GRAY2BGR)
    for each in known:
        x0, y0, x1, y1 = (round(scale * value) for value in each.box)
        cv2.rectangle(canvas, (x0, y0), (x1, y1), _YELLOW if each.threat else _GREY, 1, cv2.LINE_AA)
    for rebel in reported:
        place = round(scale * rebel.x), round(scale * rebel.y)
        cv2.circle(canvas, place, max(round(scale * rebel.r), 3), _RED, 2, cv2.LINE_AA)
        if rebel.ttc_s is not None and 0 < rebel.ttc_s < CLOSE_S:
            _write(canvas, f"{rebel.ttc_s:.1f} s", place)
    _write(canvas, caption, (5, 16))
    return np.asarray(canvas, np.uint8)


def beside(left: Colours, right: Colours) -> Colours:
    """Put two images of one frame side by side."""
    gap = np.full((left.shape[0], 6, 3), 255, np.uint8)
    return np.concatenate([left, gap, right], axis=1)


def encode(canvas: Colours) -> bytes:
    """Encode an image as JPEG."""
    _, data = cv2.imencode(".jpg", canvas, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return data.tobytes()


def _write(canvas: cv2.typing.MatLike, text: str, place: tuple[int, int]) -> None:
    for colour, thickness in ((_BLACK, 3), (_WHITE, 1)):
        cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, thickness, cv2.LINE_AA)
