"""A recording of the replay: images, samples and results, as ``lcf-edge record`` writes it."""

from collections.abc import Callable
from pathlib import Path

import msgspec

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.config.shown import shown
from lcf_edge.messages import PipelineScene, View
from lcf_edge.recording.write.messages import Encoder, FrameAndScene, KnownLens, Record, Statuses
from lcf_edge.recording.write.recording_file import CHUNK_BYTES, RecordingFile
from lcf_edge.sinks import cannot_write, check_output, refuse_existing
from lcf_edge.sinks.sink import Sink

_TRANSFORM_EVERY_NS = 1_000_000_000


class RecordingSink(Sink):
    """A new MCAP file with the stamps of the replayed recording, and ``config`` attached.

    Raises ``UsageError`` for a name that exists or does not end in ``.mcap``, ``SinkError`` when the file cannot be
    written, ``CdrError`` for stamps that ROS cannot hold.
    """

    name = "recording"

    def __init__(self, path: Path, config: Config, known_lens: KnownLens) -> None:
        refuse_existing(path)
        check_output(path, (".mcap",))
        self._path = path
        self._config = config
        self._encoder = Encoder(config, known_lens)
        self._file: RecordingFile | None = None
        self._transform_due_ns: int | None = None

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:  # noqa: ARG002
        """Append an image and its scene."""
        if self._transform_due_ns is None or frame.stamp_ns >= self._transform_due_ns:
            self._transform_due_ns = frame.stamp_ns + _TRANSFORM_EVERY_NS
            self._add(Statuses(frame.stamp_ns, ()), frame.stamp_ns)
        self._add(FrameAndScene(frame, scene), frame.stamp_ns)

    def put_sample(self, sample: ImuSample | SpeedSample) -> None:
        """Append a sample."""
        self._add(sample, sample.stamp_ns)

    def close(self) -> None:
        """Write the summary. Raises ``SinkError``."""
        file, self._file = self._file, None
        if file is None:
            return
        try:
            file.finish()
        except OSError as error:
            raise cannot_write(self._path, error) from error

    def _add(self, record: Record, stamp_ns: int) -> None:
        try:
            file = self._file = self._file or self._begun(stamp_ns)
            for message in self._encoder.encode(record):
                file.add(message)
            if file.unwritten_bytes >= CHUNK_BYTES:
                file.sync()
        except OSError as error:
            raise cannot_write(self._path, error) from error

    def _begun(self, stamp_ns: int) -> RecordingFile:
        never = msgspec.structs.replace(self._config.record, when="never")
        config_text = shown(msgspec.structs.replace(self._config, record=never))
        return RecordingFile(self._path, self._config.publish.prefix, config_text, 0, stamp_ns)
