"""The vehicle's own odometry from ``<prefix>/speed``: samples are checked, and refused ones counted.

A sample is a ``nav_msgs/msg/Odometry`` or a ``geometry_msgs/msg/TwistStamped``; the speed is the twist's linear x,
the yaw rate its angular z. The sender's clock must agree with ours to within ``MAX_AHEAD_S``.
"""

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from math import isfinite, isinf
from typing import Any

import zenoh

from drivers.samples import SpeedSample
from lcf_edge.cdr import CdrError, decode_velocity
from lcf_edge.config import Publish
from lcf_edge.zenoh_link.ros2 import Ros2Node, dds_type

CAPACITY = 256
MAX_BYTES = 4096
MAX_SPEED_MPS = 70.0
MAX_YAW_RATE_RADPS = 40.0
MAX_AGE_S = 0.5
MAX_AHEAD_S = 0.1

REFUSALS = ("too large", "malformed", "wrong type", "not finite", "out of range", "stale", "from the future")


class RefusedError(Exception):
    """A sample that is not used; its text is the reason."""


class SpeedInput:
    """Listens in Zenoh's threads and keeps the newest ``CAPACITY`` samples.

    ``counts``: ``taken``, ``overtaken`` (by newer ones, before they were asked for), and each of ``REFUSALS``.
    """

    def __init__(
        self,
        session: zenoh.Session,
        publish: Publish,
        ros2: Ros2Node | None = None,
        now_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self.counts: Counter[str] = Counter(dict.fromkeys(("taken", "overtaken", *REFUSALS), 0))
        self._now_ns = now_ns
        self._lock = threading.Lock()
        self._samples: deque[tuple[int, SpeedSample]] = deque()
        key = f"{publish.prefix}/speed"
        receive = zenoh.handlers.Callback(self._receive, indirect=False)  # no queue in between
        self._subscribers: list[Any] = [session.declare_subscriber(key, receive)]
        if ros2 is not None:
            ros2.declare("MS", key, "nav_msgs/msg/Odometry")
            self._subscribers.append(session.declare_subscriber(f"{ros2.domain}/{key}/*/*", receive))

    def take(self) -> list[tuple[int, SpeedSample]]:
        """Return what arrived since the last call, oldest first: arrival (monotonic, ns), and the sample as stamped."""
        with self._lock:
            samples = list(self._samples)
            self._samples.clear()
        return samples

    def close(self) -> None:
        """Stop listening; may be called twice."""
        for subscriber in self._subscribers:
            with suppress(zenoh.ZError):  # it was closed before
                subscriber.undeclare()

    def _receive(self, sample: zenoh.Sample) -> None:
        arrived_ns = time.monotonic_ns()
        try:
            speed = self._read(sample)
        except RefusedError as refusal:
            with self._lock:
                self.counts[str(refusal)] += 1
            return
        with self._lock:
            if len(self._samples) == CAPACITY:
                self._samples.popleft()
                self.counts["overtaken"] += 1
            self._samples.append((arrived_ns, speed))
            self.counts["taken"] += 1

    def _read(self, sample: zenoh.Sample) -> SpeedSample:
        """Raises ``RefusedError``."""
        if len(sample.payload) > MAX_BYTES:
            raise RefusedError("too large")
        try:
            kind, twist = decode_velocity(sample.payload.to_bytes())
        except CdrError as error:
            raise RefusedError("malformed") from error
        if _announced(sample) not in {"", kind, dds_type(kind)}:
            raise RefusedError("wrong type")
        speed_mps, yaw_rate_radps = twist.linear[0], twist.angular[2]
        if not isfinite(speed_mps) or isinf(yaw_rate_radps):
            raise RefusedError("not finite")
        if abs(speed_mps) > MAX_SPEED_MPS or abs(yaw_rate_radps) > MAX_YAW_RATE_RADPS:
            raise RefusedError("out of range")
        age_s = (self._now_ns() - twist.header.stamp_ns) / 1e9
        if age_s > MAX_AGE_S:
            raise RefusedError("stale")
        if age_s < -MAX_AHEAD_S:
            raise RefusedError("from the future")
        return SpeedSample(twist.header.stamp_ns, speed_mps, yaw_rate_radps)


def _announced(sample: zenoh.Sample) -> str:
    """Return the type that the sender states, in the encoding or, with rmw_zenoh, in the key; empty: none."""
    part = str(sample.key_expr).split("/")[-2:]
    if "::" in part[0]:
        return part[0]
    return str(sample.encoding).partition(";")[2]
