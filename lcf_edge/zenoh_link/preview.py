"""Previews: frames with the overlay drawn, only while somebody subscribes, at the lowest priority."""

import time

import zenoh

from lcf_edge import config
from lcf_edge.cdr import encode_compressed_image
from lcf_edge.zenoh_link.publisher import MessagePublisher
from lcf_edge.zenoh_link.ros2 import Ros2Node
from lcf_edge.zenoh_link.session import MAX_MESSAGE_BYTES
from lcf_edge.zenoh_link.topics import ZenohTopic

PREVIEW = ZenohTopic(
    "preview/compressed",
    "sensor_msgs/msg/CompressedImage",
    zenoh.Priority.BACKGROUND,
    max_bytes=MAX_MESSAGE_BYTES,
)


ASKED_EACH_NS = 200_000_000  # whether somebody subscribes: Zenoh takes 0.1 ms to answer


class PreviewPublisher:
    """Puts JPEG images on ``<prefix>/preview/compressed``, at most ``publish.preview_hz`` of them a second."""

    def __init__(self, session: zenoh.Session, publish: config.Publish, ros2: Ros2Node | None = None) -> None:
        self._frame_id = publish.frame_id
        self._pause_ns = round(1e9 / publish.preview_hz) if publish.preview_hz else None
        self._due_ns = time.monotonic_ns()  # the next one, or the next question
        self._publisher = MessagePublisher(session, publish, PREVIEW, ros2)
        self.counts = self._publisher.counts

    @property
    def has_subscriber(self) -> bool:
        """Whether somebody subscribes, as far as is known, and the next preview is due."""
        if self._pause_ns is None or (now_ns := time.monotonic_ns()) < self._due_ns:
            return False
        matched = self._publisher.matched
        if not matched:
            self._due_ns = now_ns + ASKED_EACH_NS
        return matched

    def put(self, jpeg: bytes, stamp_ns: int) -> None:
        """Send one image, taken at ``stamp_ns`` of the system clock."""
        if self._pause_ns is not None:
            self._due_ns = time.monotonic_ns() + self._pause_ns
        self._publisher.put(encode_compressed_image(stamp_ns, self._frame_id, "jpeg", jpeg))
