"""The preview: the overlay, drawn in parallel to the pipeline, one at a time, while somebody subscribes."""

import threading
from collections.abc import Callable

import cv2
import numpy as np

from drivers.samples import Frame
from lcf_edge.config import Config
from lcf_edge.daemon.link import Link
from lcf_edge.daemon.mailbox import Newest
from lcf_edge.messages import PipelineScene, View
from lcf_edge.sinks.sink import Sink

JPEG_QUALITY = 70
WIDEST_PX = 1920  # both panels: a message may not be larger than 1 MiB
_WAKE_S = 0.25
_ENDS_WITHIN_S = 0.3  # for an image that is being drawn


class Previewer(Sink):
    """Draws a frame when a preview is wanted and no other is being drawn, and hands it to ``link`` as a JPEG."""

    name = "preview"
    sheds = "the preview"

    def __init__(self, link: Link) -> None:
        self._off = False
        self._drawing = False
        self._closing = False
        self._next: Newest[tuple[Frame, PipelineScene, View]] = Newest()
        self._link = link
        self._thread = threading.Thread(target=self._run, name=self.name, daemon=True)

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:
        """Have this frame drawn, if a preview is wanted now."""
        if not (self._off or self._drawing) and self._link.has_preview_subscriber():
            self._drawing = True
            self._next.put((frame, scene, view()))

    def start(self) -> None:
        """Start drawing."""
        self._thread.start()

    def show_config(self, config: Config) -> None:  # noqa: ARG002
        """Draw again, if drawing was given up."""
        self._off = False

    def shed(self) -> None:
        """Stop drawing."""
        self._off = True

    def close(self) -> None:
        """Draw no more images; one in progress may still be sent."""
        self._closing = True
        self._next.close()
        self.join(_ENDS_WITHIN_S)

    def join(self, timeout_s: float) -> bool:
        """Wait until no image is being drawn; False: timeout."""
        if self._thread.ident is not None:
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while not self._closing:
            given = self._next.take(_WAKE_S)
            if given is not None:
                self._draw(*given)
                self._drawing = False

    def _draw(self, frame: Frame, scene: PipelineScene, view: View) -> None:
        try:
            from lcf_edge.sinks.overlay import draw  # noqa: PLC0415  # loaded only if somebody subscribes
        except OSError:  # no descriptor is left; perhaps for the next one
            return
        image = draw(frame.image, scene, view)
        height, width = image.shape[:2]
        if width > WIDEST_PX:
            size = WIDEST_PX, round(height * WIDEST_PX / width)
            image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        _, jpeg = cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))
        self._link.put_preview(jpeg.tobytes(), scene.stamp_ns)
