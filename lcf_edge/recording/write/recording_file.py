"""One MCAP file (mcap.dev/spec) that grows by whole chunks: however it ends, it is readable up to the last of them."""

import os
from contextlib import suppress
from pathlib import Path

from mcap.writer import CompressionType, Writer

from lcf_edge import __version__
from lcf_edge.cdr import restamped
from lcf_edge.config.attached import IN_RECORDING
from lcf_edge.recording.write.messages import TOPICS, RecordedMessage
from lcf_edge.recording.write.qos import offered_qos
from lcf_edge.recording.write.schemas import ENCODING, schema

CHUNK_BYTES = 2**19  # the library holds a chunk four times while it closes it


class RecordingFile:
    """A file that is being written. Stamps in it are those of the monotonic clock plus ``offset_ns``, all along.

    ``size_bytes``: on the disk. ``unwritten_bytes``: not yet. Raises ``OSError``; ``FileExistsError`` for a file that
    is there already.
    """

    def __init__(self, path: Path, prefix: str, config_text: str, offset_ns: int, now_ns: int) -> None:
        self.path = path
        self.size_bytes = 0
        self._offset_ns = offset_ns
        self._in_chunk_bytes = 0
        self._pending = _Pending()
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        self._writer = Writer(self._pending, CHUNK_BYTES, CompressionType.NONE)  # type: ignore[arg-type]
        self._writer.start("ros2", f"lcf-edge {__version__}")
        self.attach(config_text, now_ns)
        self._channels = {
            topic: self._writer.register_channel(
                topic.path(prefix),
                "cdr",
                self._writer.register_schema(topic.message, ENCODING, schema(topic.message)),
                {"offered_qos_profiles": offered_qos(topic)},
            )
            for topic in TOPICS
        }
        try:
            self.sync()
            _sync_folder(path.parent)
        except OSError:
            self.abandon()
            with suppress(OSError):
                path.unlink()  # it is empty
            raise

    @property
    def unwritten_bytes(self) -> int:
        """Bytes that a loss of power would cost now."""
        return self._in_chunk_bytes + self._pending.bytes

    @property
    def vanished(self) -> bool:
        """Whether the file was removed."""
        return os.fstat(self._file).st_nlink == 0

    def attach(self, config_text: str, now_ns: int) -> None:
        """Put a configuration into the file; the first is the one with which it began."""
        stamp_ns = _written(now_ns + self._offset_ns)
        self._writer.add_attachment(stamp_ns, stamp_ns, IN_RECORDING, "application/toml", config_text.encode())

    def add(self, message: RecordedMessage) -> None:
        """Append a message. Raises ``CdrError`` for an invalid stamp."""
        stamp_ns = message.stamp_ns + self._offset_ns
        payload = message.payload
        if message.topic.is_stamped:
            payload = restamped(payload, stamp_ns, message.stamps)
        self._writer.add_message(self._channels[message.topic], _written(stamp_ns), payload, _written(stamp_ns))
        self._in_chunk_bytes += len(payload)

    def sync(self) -> None:
        """Close the chunk and sync it to the disk. Raises ``OSError``; then the next call tries again."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._in_chunk_bytes = 0
        at = self.size_bytes
        try:
            for piece in self._pending.pieces:
                left = memoryview(piece)
                while left:
                    written = os.pwrite(self._file, left, at)
                    left, at = left[written:], at + written
            os.fsync(self._file)
        except OSError:
            with suppress(OSError):  # what was written of the chunk
                os.ftruncate(self._file, self.size_bytes)
            raise
        self.size_bytes = at
        self._pending.forget()

    def finish(self) -> None:
        """Write the summary and close. Raises ``OSError``; the file is closed and readable even then."""
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self.sync()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file as it is."""
        with suppress(OSError):  # the disk is gone; the descriptor is closed nevertheless
            os.close(self._file)


def _written(stamp_ns: int) -> int:
    """Clamp a stamp to what MCAP can hold: unsigned ns, until the year 2554."""
    return min(max(stamp_ns, 0), 2**64 - 1)


class _Pending:
    """A file for ``Writer`` that holds what is not on the disk yet."""

    def __init__(self) -> None:
        self.bytes = 0
        self.pieces: list[bytes] = []
        self._before = 0

    def write(self, data: bytes) -> int:
        self.pieces.append(data)
        self.bytes += len(data)
        return len(data)

    def tell(self) -> int:
        return self._before + self.bytes

    def flush(self) -> None:
        """Do nothing: ``RecordingFile.sync`` writes it."""

    def forget(self) -> None:
        """Drop what is on the disk."""
        self._before += self.bytes
        self.bytes = 0
        self.pieces.clear()


def _sync_folder(folder: Path) -> None:
    """Sync a folder, so that a new name in it survives a power cut."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
