"""The last seconds as an MCAP file (mcap.dev/spec) with ROS 2 messages, made while it is sent."""

from collections.abc import Iterator, Sequence

from mcap.writer import CompressionType, Writer

from lcf_edge import __version__
from lcf_edge.cdr import decode_scene
from lcf_edge.monitor.live.history import ReceivedMessage
from lcf_edge.recording.write.schemas import ENCODING, schema
from lcf_edge.standard_messages.image_annotations import encode_image_annotations
from lcf_edge.zenoh_link.diagnostics import DIAGNOSTICS
from lcf_edge.zenoh_link.preview import PREVIEW
from lcf_edge.zenoh_link.scene import SCENE
from lcf_edge.zenoh_link.topics import ANNOTATIONS

CHUNK_BYTES = 2**18


class _Outflow:
    """An append-only file; what was written waits in ``data`` until it is taken."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._taken = 0

    def write(self, data: bytes) -> int:
        self.data += data
        return len(data)

    def tell(self) -> int:
        return self._taken + len(self.data)

    def take(self) -> bytes:
        data = bytes(self.data)
        self._taken += len(data)
        self.data.clear()
        return data


def mcap_parts(messages: Sequence[ReceivedMessage], prefix: str) -> Iterator[bytes]:
    """Yield the file of ``messages``, given in order of arrival, in parts of about ``CHUNK_BYTES``."""
    outflow = _Outflow()
    writer = Writer(outflow, CHUNK_BYTES, CompressionType.LZ4)  # type: ignore[arg-type]
    writer.start("ros2", f"lcf-edge {__version__}")
    channels = {
        topic.name: writer.register_channel(
            f"/{topic.key(prefix)}", "cdr", writer.register_schema(topic.message, ENCODING, schema(topic.message))
        )
        for topic in (SCENE, DIAGNOSTICS, PREVIEW, ANNOTATIONS)
    }
    for message in messages:
        for name, payload in _with_annotations(message):
            writer.add_message(channels[name], message.received_ns, payload, message.received_ns)
        if outflow.data:
            yield outflow.take()
    writer.finish()  # type: ignore[no-untyped-call]
    yield outflow.take()


def _with_annotations(message: ReceivedMessage) -> Iterator[tuple[str, bytes]]:
    """Yield topic and payload of a message, and of its annotations."""
    yield message.topic, message.payload
    if message.topic == SCENE.name:
        yield ANNOTATIONS.name, encode_image_annotations(decode_scene(message.payload))
