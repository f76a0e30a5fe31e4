"""A folder of recordings as a bag: ``metadata.yaml`` as rosbag2 writes it, which lists the contents of all files.

Of version 5, which Humble and all later read. Values are written as JSON, which is YAML as well.
"""

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Statistics

from lcf_edge.errors import RecordingError
from lcf_edge.recording.read.rosbag import bag_files

FILE = "metadata.yaml"
_QOS = "offered_qos_profiles"


@dataclass(frozen=True, slots=True)
class _Content:
    """A file as the bag lists it. ``topics``: each channel with the type of its messages."""

    topics: list[tuple[Channel, str]]
    statistics: Statistics

    @property
    def times(self) -> tuple[str, str]:
        """Time of the first message, and duration of all."""
        return _times(self.statistics.message_start_time, self.statistics.message_end_time)


def write_metadata(folder: Path) -> Path:
    """Write the metadata of a bag, which has one file at least; return where.

    Raises ``RecordingError`` for a file that was not finished, ``OSError``.
    """
    contents = {path.name: _content(path) for path in bag_files(folder)}
    place = folder / FILE
    place.write_text("".join(f"{line}\n" for line in _lines(contents)), encoding="utf-8")
    return place


def _content(path: Path) -> _Content:
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except McapError as error:
        raise RecordingError(f"{path}: was not finished ({error}); read it with: ros2 bag reindex") from error
    if summary is None or summary.statistics is None:
        raise RecordingError(f"{path}: was not finished; read it with: ros2 bag reindex")
    topics = [(channel, summary.schemas[channel.schema_id].name) for channel in summary.channels.values()]
    return _Content(topics, summary.statistics)


def _times(begin_ns: int, end_ns: int) -> tuple[str, str]:
    return json.dumps({"nanoseconds_since_epoch": begin_ns}), json.dumps({"nanoseconds": end_ns - begin_ns})


def _lines(contents: dict[str, _Content]) -> Iterator[str]:
    every = [content.statistics for content in contents.values()]
    begin, duration = _times(min(each.message_start_time for each in every), max(e.message_end_time for e in every))
    topics: dict[str, tuple[Channel, str]] = {}
    counts: Counter[str] = Counter()
    for content in contents.values():
        for channel, message in content.topics:
            topics.setdefault(channel.topic, (channel, message))
            counts[channel.topic] += content.statistics.channel_message_counts.get(channel.id, 0)
    yield "rosbag2_bagfile_information:"
    yield "  version: 5"
    yield "  storage_identifier: mcap"
    yield f"  duration: {duration}"
    yield f"  starting_time: {begin}"
    yield f"  message_count: {sum(counts.values())}"
    yield "  topics_with_message_count:"
    for topic, (channel, message) in topics.items():
        yield "    - topic_metadata:"
        yield f"        name: {json.dumps(topic)}"
        yield f"        type: {json.dumps(message)}"
        yield f"        serialization_format: {json.dumps(channel.message_encoding)}"
        yield f"        offered_qos_profiles: {json.dumps(channel.metadata.get(_QOS, ''))}"
        yield f"      message_count: {counts[topic]}"
    yield '  compression_format: ""'
    yield '  compression_mode: ""'
    yield f"  relative_file_paths: {json.dumps(list(contents))}"
    yield "  files:"
    for name, content in contents.items():
        begin, duration = content.times
        yield f"    - path: {json.dumps(name)}"
        yield f"      starting_time: {begin}"
        yield f"      duration: {duration}"
        yield f"      message_count: {content.statistics.message_count}"
