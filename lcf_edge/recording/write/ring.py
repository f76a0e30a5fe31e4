"""The last seconds, kept in memory until an event makes them worth saving."""

from collections import deque

from lcf_edge.recording.write.messages import RecordedMessage


class Ring:
    """Messages of the last ``before_s``; older ones are dropped."""

    def __init__(self, before_s: float) -> None:
        self.bytes = 0
        self._before_ns = round(before_s * 1e9)
        self._messages: deque[RecordedMessage] = deque()

    def add(self, message: RecordedMessage, limit_bytes: int) -> None:
        """Keep a message; then no more than ``limit_bytes`` are kept."""
        self._messages.append(message)
        self.bytes += size_bytes(message)
        while self._messages and (
            self.bytes > limit_bytes or self._messages[0].stamp_ns < message.stamp_ns - self._before_ns
        ):
            self.bytes -= size_bytes(self._messages.popleft())

    def take(self) -> list[RecordedMessage]:
        """Remove and return all messages, oldest first."""
        messages = list(self._messages)
        self._messages.clear()
        self.bytes = 0
        return messages


def size_bytes(message: RecordedMessage) -> int:
    """Return the memory that a message takes, bytes, with the objects that hold it."""
    return len(message.payload) + 256
