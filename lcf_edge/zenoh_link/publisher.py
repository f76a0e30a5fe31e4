"""Puts the messages of one topic, and with ROS 2 on, the same samples under rmw_zenoh's key."""

import struct
import threading
import time
from collections import Counter
from contextlib import ExitStack
from typing import Any

import zenoh

from lcf_edge import config
from lcf_edge.errors import PublishError
from lcf_edge.zenoh_link.ros2 import Endpoint, Ros2Node, gid_of
from lcf_edge.zenoh_link.session import reason
from lcf_edge.zenoh_link.topics import ZenohTopic

ATTACHMENT = struct.Struct("<qqB16s")
"""Attachment of rmw_zenoh, 33 bytes: sequence number, source time (ns), length of the gid (16), gid."""

LATEST_NS = 2**63 - 1
"""The last time, in April 2262, that an attachment can hold, ns; later times are clamped to it."""


class MessagePublisher:
    """Puts payloads of one topic; on congestion Zenoh drops them, a put never waits.

    ``counts``: ``sent``, and ``failed`` when the session is closed. Raises ``PublishError`` when ``publish.prefix``
    is no valid key.
    """

    def __init__(
        self, session: zenoh.Session, publish: config.Publish, topic: ZenohTopic, ros2: Ros2Node | None = None
    ) -> None:
        self.key = topic.key(publish.prefix)
        self.counts: Counter[str] = Counter(sent=0, failed=0)  # all keys at once: read meanwhile
        if set("*$#?") & set(publish.prefix) or not publish.prefix:
            raise PublishError(f"publish.prefix: {publish.prefix!r}: a key to publish on has no wildcards")
        endpoints = [Endpoint(self.key, gid_of(f"{session.zid()}/{self.key}"))]
        if ros2 is not None:
            endpoints.append(ros2.declare("MP", self.key, topic.message, is_lasting=topic.is_lasting))
        self._gid = endpoints[-1].gid
        try:
            self._publishers = [
                session.declare_publisher(
                    endpoint.key,
                    encoding=zenoh.Encoding(topic.encoding),
                    congestion_control=zenoh.CongestionControl.DROP,
                    priority=topic.priority,
                    express=topic.express,
                )
                for endpoint in endpoints
            ]
        except zenoh.ZError as error:
            raise PublishError(f"publish.prefix: {publish.prefix}: {reason(error)}") from error

    @property
    def matched(self) -> bool:
        """Whether somebody subscribes."""
        status: list[Any] = [publisher.matching_status for publisher in self._publishers]
        return any(one.matching for one in status)

    def wait_until_matched(self, timeout_s: float) -> bool:
        """Wait until somebody subscribes; False when nobody did in time."""
        matched = threading.Event()

        def on_match(status: zenoh.MatchingStatus) -> None:
            if status.matching:
                matched.set()

        with ExitStack() as listeners:
            for publisher in self._publishers:
                listeners.enter_context(publisher.declare_matching_listener(on_match))
            return self.matched or matched.wait(timeout_s)

    def put(self, payload: bytes) -> None:
        """Send one message; never raises, never waits."""
        number = self.counts["sent"] + 1
        attachment = ATTACHMENT.pack(number, min(time.time_ns(), LATEST_NS), len(self._gid), self._gid)
        try:
            for publisher in self._publishers:
                publisher.put(payload, attachment=attachment)
        except zenoh.ZError:
            self.counts["failed"] += 1
        else:
            self.counts["sent"] = number
