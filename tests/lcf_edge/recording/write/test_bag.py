"""The metadata of a bag, held against what another implementation reads of it."""

from pathlib import Path
from typing import Any

import pytest
from rosbags.rosbag2 import Reader

from lcf_edge.errors import RecordingError
from lcf_edge.recording.write.bag import write_metadata
from lcf_edge.recording.write.recording_file import RecordingFile


def written(path: Path, messages: Any, *, finished: bool = True) -> int:
    file = RecordingFile(path, "lcf", "", 0, 0)
    count = 0
    for message in messages:
        file.add(message)
        count += 1
    if finished:
        file.finish()
    else:
        file.sync()
        file.abandon()
    return count


def test_it_lists_what_is_in_all_files_together(tmp_path: Path, recorded: Any) -> None:
    counts = [written(tmp_path / f"drive_{number}.mcap", recorded(3, (number + 1) * 10**9)) for number in range(11)]
    write_metadata(tmp_path)
    with Reader(tmp_path) as bag:
        assert bag.message_count == sum(counts) == len(list(bag.messages()))
        assert bag.start_time == 10**9
        assert bag.duration > 10 * 10**9
        kinds = {connection.topic: connection.msgtype for connection in bag.connections}
    assert kinds["/lcf/scene"] == "lcf_msgs/msg/Scene"
    lines = (tmp_path / "metadata.yaml").read_text(encoding="utf-8")
    assert lines.index("drive_9.mcap") < lines.index("drive_10.mcap")  # in the order of time


def test_a_file_that_was_not_finished_is_named_with_what_reads_it(tmp_path: Path, recorded: Any) -> None:
    written(tmp_path / "drive_0.mcap", recorded(3), finished=False)
    with pytest.raises(RecordingError, match=r"drive_0\.mcap: was not finished.*ros2 bag reindex"):
        write_metadata(tmp_path)
    assert not (tmp_path / "metadata.yaml").exists()
