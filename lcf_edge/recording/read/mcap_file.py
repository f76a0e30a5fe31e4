"""The messages of an MCAP file, as far as it is intact.

The ``mcap`` package gives up at the first damage; a recording that a power cut ended is read here up to the
last whole message, even inside the chunk that was cut.
"""

import io
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import mcap.records
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from lcf_edge.errors import RecordingError

MAGIC = b"\x89MCAP0\r\n"
MAX_RECORD_BYTES = 128 * 2**20  # of a message, or a chunk, also unpacked: a colour image of 8K fits
MAX_RATIO = 256  # of an unpacked chunk to a packed one, beyond this size:
MAX_DENSE_BYTES = 16 * 2**20
MAX_OTHER_BYTES = 2**20  # of a record that describes messages
MAX_NAME = 1024  # bytes of a topic, its type and its encoding together
MAX_TOPICS = 4096

_READ = frozenset((Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.STATISTICS))
_HEAD = struct.Struct("<BQ")  # opcode, bytes of the body
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_FOOTER = struct.Struct("<BQQQI8s")


class McapTopic(NamedTuple):
    """A stream of messages of one type."""

    name: str
    schema: str  # "sensor_msgs/msg/Imu"
    encoding: str  # "cdr"


@dataclass(frozen=True, slots=True)
class McapMessage:
    """One message as it was recorded."""

    topic: McapTopic
    log_time_ns: int
    data: bytes


class _DamageError(Exception):
    """Bytes that break the format; the text says what and where."""


class _Record(NamedTuple):
    offset: int
    opcode: int
    body: bytes | memoryview
    whole: bool


class McapFile:
    """An MCAP file. Raises ``RecordingError`` for any other, and ``OSError``.

    ``counts``: messages of each topic, by the summary at the end; None: it has none.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._channels = _Channels()
        self.counts: Counter[McapTopic] | None = None
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise RecordingError(f"{path}: not an MCAP file; name another recording")
            self._read_summary(file)

    def messages(self, warn: Callable[[str], None], skip: Callable[[str, str], None]) -> Iterator[McapMessage]:
        """Yield the messages in the order of the file.

        ``warn`` gets where the file is damaged, ``skip`` why and where a chunk is skipped.
        """
        try:
            with self._path.open("rb") as file:
                yield from self._messages(file, warn, skip)
        except OSError as error:
            warn(f"{self._path}: cannot be read further ({error.strerror})")

    def _messages(
        self, file: BinaryIO, warn: Callable[[str], None], skip: Callable[[str, str], None]
    ) -> Iterator[McapMessage]:
        file.seek(len(MAGIC))
        try:
            for record in _records(file):
                if record.opcode == Opcode.DATA_END:
                    return
                if record.opcode == Opcode.CHUNK:
                    yield from self._chunk(record, skip)
                elif message := self._channels.take(record):
                    yield message
            damage = f"byte {file.tell()}: ends too early"
        except _DamageError as error:
            damage = str(error)
        warn(f"{self._path}: damaged at {damage}, read up to there")

    def _chunk(self, record: _Record, skip: Callable[[str, str], None]) -> Iterator[McapMessage]:
        try:
            data = _unpacked(record)
            for inner in _records(io.BytesIO(data), memoryview(data)):
                if message := self._channels.take(inner):
                    yield message
        except _DamageError as damage:
            if record.whole:
                skip("chunk damaged", f"{self._path}: byte {record.offset} ({damage})")

    def _read_summary(self, file: BinaryIO) -> None:
        size = file.seek(0, io.SEEK_END)
        if size < _FOOTER.size:
            return
        file.seek(size - _FOOTER.size)
        opcode, _, start, _, _, magic = _FOOTER.unpack(file.read(_FOOTER.size))
        if opcode != Opcode.FOOTER or magic != MAGIC or not 0 < start < size:
            return
        file.seek(start)
        counts: dict[int, int] = {}
        try:
            for record in _records(file):
                if record.opcode == Opcode.STATISTICS:
                    counts = _parse(mcap.records.Statistics.read, record).channel_message_counts
                else:
                    self._channels.take(record)
        except _DamageError:
            return
        if counts and counts.keys() <= self._channels.topics.keys():
            self.counts = self._channels.named(counts)


@dataclass(slots=True)
class _Channels:
    """What the schema and channel records so far say about later messages."""

    schemas: dict[int, str] = field(default_factory=dict)
    topics: dict[int, McapTopic] = field(default_factory=dict)

    def take(self, record: _Record) -> McapMessage | None:
        """Take a record of any kind. Return the message, if it is one."""
        if record.opcode == Opcode.SCHEMA:
            schema = _parse(mcap.records.Schema.read, record)
            self.schemas[schema.id] = _named(record, schema.name)
        elif record.opcode == Opcode.CHANNEL:
            channel = _parse(mcap.records.Channel.read, record)
            _named(record, channel.topic, channel.message_encoding)
            if len(self.topics) >= MAX_TOPICS and channel.id not in self.topics:
                raise _DamageError(f"byte {record.offset}: more than {MAX_TOPICS} topics")
            schema_name = self.schemas.get(channel.schema_id, "")
            self.topics[channel.id] = McapTopic(channel.topic, schema_name, channel.message_encoding)
        elif record.opcode == Opcode.MESSAGE:
            if len(record.body) < _MESSAGE.size:
                raise _DamageError(f"byte {record.offset}: a record is malformed")
            number, _, log_time_ns, _ = _MESSAGE.unpack_from(record.body)
            if topic := self.topics.get(number):
                return McapMessage(topic, log_time_ns, bytes(record.body[_MESSAGE.size :]))
        return None

    def named(self, counts: dict[int, int]) -> Counter[McapTopic]:
        """Return counts by topic instead of channel number."""
        total: Counter[McapTopic] = Counter()
        for number, topic in self.topics.items():
            total[topic] += counts.get(number, 0)
        return total


def _named(record: _Record, *names: str) -> str:
    """The first of ``names``, which are kept. Raises ``_DamageError``."""
    if sum(map(len, names)) > MAX_NAME:
        raise _DamageError(f"byte {record.offset}: a name of thousands of characters")
    return names[0]


def _records(stream: BinaryIO, view: memoryview | None = None) -> Iterator[_Record]:
    """Yield records from the position of ``stream``. Bodies of unused records are skipped; of a truncated chunk
    the front part is yielded. ``view``: of the stream's memory, for bodies that are not copied. Raises
    ``_DamageError``.
    """
    at = stream.tell()
    end = stream.seek(0, io.SEEK_END)
    while at < end:
        stream.seek(at)
        head = stream.read(_HEAD.size)
        if len(head) < _HEAD.size:
            raise _DamageError(f"byte {at}: a record is cut off")
        opcode, length = _HEAD.unpack(head)
        there = min(length, end - at - _HEAD.size)
        if opcode == 0:
            raise _DamageError(f"byte {at}: no record")
        most = MAX_RECORD_BYTES if opcode in {Opcode.MESSAGE, Opcode.CHUNK} else MAX_OTHER_BYTES
        if opcode in _READ and there > most:
            raise _DamageError(f"byte {at}: a record of {length} bytes")
        if there == length or opcode == Opcode.CHUNK:
            start = at + _HEAD.size
            body: bytes | memoryview = b""
            if opcode in _READ:
                body = stream.read(there) if view is None else view[start : start + there]
            yield _Record(at, opcode, body, there == length)
        if opcode == Opcode.FOOTER:
            return
        if there < length:
            raise _DamageError(f"byte {at}: a record is cut off")
        at += _HEAD.size + length


def _unpacked(record: _Record) -> bytes:
    """Return the records of a chunk; of a truncated one, as much as can be unpacked. Raises ``_DamageError``."""
    chunk = _parse(mcap.records.Chunk.read, record)
    size = chunk.uncompressed_size
    if size > MAX_RECORD_BYTES:
        raise _DamageError(f"{size} bytes unpacked")
    if size > max(MAX_DENSE_BYTES, MAX_RATIO * len(chunk.data)):
        raise _DamageError(f"{len(chunk.data)} bytes that claim to unpack to {size}")
    try:
        if not size or not chunk.compression:
            data = chunk.data
        elif chunk.compression == "lz4":
            data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size)
        elif chunk.compression == "zstd":
            data = zstandard.ZstdDecompressor().stream_reader(chunk.data).read(size)
        else:
            raise _DamageError(f"compression {chunk.compression!r} is not supported")
    except (RuntimeError, zstandard.ZstdError) as error:  # lz4 has no exception of its own
        raise _DamageError("it cannot be unpacked") from error
    if record.whole and chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise _DamageError("its checksum is wrong")
    return bytes(data)


def _parse(read: Callable[[ReadDataStream], Any], record: _Record) -> Any:
    """Parse a record's body with the ``mcap`` package. Raises ``_DamageError``."""
    try:
        return read(ReadDataStream(io.BytesIO(record.body)))
    except (McapError, struct.error, UnicodeDecodeError, OverflowError) as error:
        raise _DamageError(f"byte {record.offset}: a record is malformed") from error
