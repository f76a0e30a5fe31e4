"""The preview: the overlay drawn beside the pipeline, one at a time, while somebody looks."""

import threading

import cv2
import numpy as np

from drivers.records import Frame
from lcf_edge.daemon.clock import StoppableClock
from lcf_edge.daemon.link import Link
from lcf_edge.daemon.mailbox import Newest
from lcf_edge.pipeline import Outcome

JPEG_QUALITY = 70
WIDEST_PX = 1920  # both panels: a message may not be larger than 1 MiB
_WAKE_S = 0.25


Drawable = tuple[Frame, Outcome]


class Previewer(threading.Thread):
    """Draws what it is offered when it ``wants`` something, and hands JPEG pictures to ``link``.

    ``off``: nothing is drawn any more, to save memory.
    """

    def __init__(self, link: Link, clock: StoppableClock) -> None:
        super().__init__(name="preview", daemon=True)
        self.off = False
        self._drawing = False
        self._offered: Newest[Drawable] = Newest()
        self._link = link
        self._clock = clock

    def wants(self) -> bool:
        """Whether a preview is wanted now, and nothing else is being drawn."""
        return not self.off and not self._drawing and self._link.preview_wanted()

    def offer(self, frame: Frame, outcome: Outcome) -> None:
        """Draw this; its scene is stamped by the system clock."""
        self._drawing = True
        self._offered.put((frame, outcome))

    def run(self) -> None:
        """Draw until stopped."""
        while not self._clock.stopped:
            drawable = self._offered.take(_WAKE_S)
            if drawable is not None:
                self._draw(*drawable)
                self._drawing = False

    def wake(self) -> None:
        """Notice a stop at once."""
        self._offered.close()

    def _draw(self, frame: Frame, outcome: Outcome) -> None:
        try:
            from lcf_edge.sinks.overlay import draw  # noqa: PLC0415  # nobody may ever look
        except OSError:  # no descriptor is left; the next one may find one
            return
        picture = draw(frame.image, outcome)
        height, width = picture.shape[:2]
        if width > WIDEST_PX:
            size = WIDEST_PX, round(height * WIDEST_PX / width)
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
        _, jpeg = cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))
        self._link.put_preview(jpeg.tobytes(), outcome.scene.stamp_ns)
