"""The messages of the last seconds, as they were sent."""

import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

LENGTH_S = 30.0
MAX_BYTES = {"scene": 4 * 2**20, "diagnostics": 2**20, "preview/compressed": 16 * 2**20}
"""Bytes by topic, so that images do not push out what is small."""


@dataclass(frozen=True, slots=True)
class ReceivedMessage:
    """One payload of a topic."""

    topic: str  # "scene": the key after the prefix
    received_ns: int  # system clock
    payload: bytes


class History:
    """Holds the messages of the last ``length_s`` seconds, of each topic at most ``max_bytes``."""

    def __init__(self, length_s: float = LENGTH_S, max_bytes: Mapping[str, int] = MAX_BYTES) -> None:
        self._length_ns = round(length_s * 1e9)
        self._max_bytes = max_bytes
        self._kept: dict[str, deque[ReceivedMessage]] = {topic: deque() for topic in max_bytes}
        self._bytes = dict.fromkeys(max_bytes, 0)
        self._lock = threading.Lock()

    def add(self, message: ReceivedMessage) -> None:
        """Keep a message; the oldest of its topic are dropped to make room."""
        topic = message.topic
        with self._lock:
            self._kept[topic].append(message)
            self._bytes[topic] += len(message.payload)
            while self._bytes[topic] > self._max_bytes[topic]:
                self._forget(topic)
            self._expire(message.received_ns)

    def messages(self, now_ns: int) -> list[ReceivedMessage]:
        """Return the messages of the last ``length_s``, in the order of arrival."""
        with self._lock:
            self._expire(now_ns)
            kept = [message for messages in self._kept.values() for message in messages]
        return sorted(kept, key=lambda message: message.received_ns)

    def _expire(self, now_ns: int) -> None:
        for topic, messages in self._kept.items():
            while messages and now_ns - messages[0].received_ns > self._length_ns:
                self._forget(topic)

    def _forget(self, topic: str) -> None:
        self._bytes[topic] -= len(self._kept[topic].popleft().payload)
