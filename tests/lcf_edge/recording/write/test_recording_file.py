"""A file is whole, or readable up to where something ended it."""

import errno
import os
import shutil
from pathlib import Path
from typing import Any

import msgspec
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosHistory, QosReliability

from lcf_edge.config import Camera, Config, Imu, load, to_toml
from lcf_edge.errors import ConfigError
from lcf_edge.recording.read import open_recording
from lcf_edge.recording.read.mcap_file import McapFile
from lcf_edge.recording.write.messages import TOPICS
from lcf_edge.recording.write.recording_file import RecordingFile

OFFSET_NS = 1_700_000_000_000_000_000
CONFIG = Config(camera=Camera(height_m=0.77), imu=Imu(axes=[[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]))


def begun(path: Path) -> RecordingFile:
    return RecordingFile(path, "lcf", to_toml(CONFIG), OFFSET_NS, 0)


@pytest.fixture
def whole(tmp_path: Path, recorded: Any) -> Path:
    """Six images in three chunks, and their summary."""
    file = begun(tmp_path / "whole.mcap")
    for index, message in enumerate(recorded(6)):
        file.add(message)
        if index in {8, 18}:
            file.sync()
    file.finish()
    return file.path


def test_independent_readers_find_all_messages(whole: Path, recorded: Any, by_rosbags: Any, by_mcap: Any) -> None:
    wanted = sorted((one.topic.path("lcf"), one.stamp_ns + OFFSET_NS) for one in recorded(6))
    read = by_rosbags(whole)
    assert sorted((one.topic, one.log_time_ns) for one in read) == wanted == sorted(by_mcap(whole))
    assert {(one.topic, one.kind) for one in read} == {(topic.path("lcf"), topic.message) for topic in TOPICS}
    unstamped = {topic.path("lcf") for topic in TOPICS if not topic.is_stamped}
    for one in read:
        if one.topic in unstamped:
            continue
        stamp = one.message.header.stamp if hasattr(one.message, "header") else one.message.timestamp
        assert stamp.sec * 10**9 + stamp.nanosec == one.log_time_ns
    drawn = [(one.log_time_ns, one.message) for one in read if one.topic == "/lcf/annotations"]
    for log_time_ns, message in drawn:
        for each in (*message.circles, *message.points, *message.texts):
            assert each.timestamp.sec * 10**9 + each.timestamp.nanosec == log_time_ns
    assert all(message.circles and message.points and message.texts for _, message in drawn)
    with whole.open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert len(summary.chunk_indexes) == 3
        assert summary.statistics
        assert summary.statistics.message_count == len(wanted)


def test_each_topic_states_how_it_is_to_be_played(whole: Path) -> None:
    """As rosbag2 reads it; what is sent once a second is kept for late subscribers."""
    with AnyReader([whole]) as reader:
        offered = {one.topic: one.ext.offered_qos_profiles for one in reader.connections}
    assert set(offered) == {topic.path("lcf") for topic in TOPICS}
    for topic, (qos,) in offered.items():
        assert (qos.reliability, qos.history) == (QosReliability.RELIABLE, QosHistory.KEEP_LAST)
        is_lasting = topic == "/tf_static"
        assert qos.durability == (QosDurability.TRANSIENT_LOCAL if is_lasting else QosDurability.VOLATILE)


def test_our_own_reader_plays_it(whole: Path) -> None:
    recording = open_recording(whole, CONFIG)
    assert (recording.frame_count, recording.has_imu, recording.has_speed) == (6, True, True)
    assert len(list(recording)) == 18
    assert not recording.skipped


def test_the_configuration_is_in_it(whole: Path) -> None:
    assert load(whole) == CONFIG
    with whole.open("rb") as file:
        (attachment,) = make_reader(file).iter_attachments()
    assert (attachment.name, attachment.data.decode()) == ("lcf-edge.toml", to_toml(CONFIG))


def test_a_later_configuration_follows_but_the_first_counts(tmp_path: Path) -> None:
    file = begun(tmp_path / "two.mcap")
    later = msgspec.structs.replace(CONFIG, camera=Camera(height_m=0.5))
    file.attach(to_toml(later), 10**9)
    file.finish()
    assert load(file.path) == CONFIG
    with file.path.open("rb") as opened:
        assert [one.log_time - OFFSET_NS for one in make_reader(opened).iter_attachments()] == [0, 10**9]


def test_a_recording_of_others_has_no_configuration(tmp_path: Path, whole: Path) -> None:
    path = tmp_path / "other.mcap"
    path.write_bytes(whole.read_bytes()[:30])
    for file in (path, tmp_path / "nothing.mcap"):
        with pytest.raises(ConfigError, match=str(file)):
            load(file)


def test_an_attachment_of_exabytes_is_none(whole: Path) -> None:
    data = bytearray(whole.read_bytes())
    kind = data.index(b"application/toml") + len(b"application/toml")
    data[kind : kind + 8] = b"\xff" * 7 + b"\x3f"  # the length of the attachment's data
    whole.write_bytes(data)
    with pytest.raises(ConfigError, match="no configuration in it"):
        load(whole)


def test_what_was_synced_is_there_without_an_end(tmp_path: Path, recorded: Any, by_mcap: Any) -> None:
    file = begun(tmp_path / "open.mcap")
    messages = list(recorded(4))
    for message in messages[:10]:
        file.add(message)
    file.sync()
    for message in messages[10:]:
        file.add(message)
    assert file.unwritten_bytes > 0
    shutil.copy(file.path, tmp_path / "cut.mcap")  # what a loss of power leaves
    assert len(by_mcap(tmp_path / "cut.mcap")) == 10
    assert load(tmp_path / "cut.mcap") == CONFIG
    file.finish()
    assert len(by_mcap(file.path)) == len(messages)


def test_cut_anywhere_it_is_read_up_to_there(whole: Path, by_mcap: Any) -> None:
    """The messages of a file that is cut are the first ones of the whole, the more the later it is cut."""
    all_messages = [(one.topic.name, one.log_time_ns) for one in McapFile(whole).messages(str, lambda *_: None)]
    assert all_messages == by_mcap(whole)
    found = len(all_messages)
    for size in range(whole.stat().st_size - 1, 8, -29):
        os.truncate(whole, size)
        read = [(one.topic.name, one.log_time_ns) for one in McapFile(whole).messages(lambda _: None, lambda *_: None)]
        assert read == all_messages[: len(read)]
        assert len(read) <= found
        found = len(read)
        theirs = by_mcap(whole)  # by whole chunks
        assert theirs == all_messages[: len(theirs)]
    assert found == 0


def test_a_file_that_is_there_is_not_touched(whole: Path) -> None:
    before = whole.read_bytes()
    with pytest.raises(FileExistsError):
        begun(whole)
    assert whole.read_bytes() == before


def test_it_notices_that_it_was_removed(tmp_path: Path) -> None:
    file = begun(tmp_path / "gone.mcap")
    assert not file.vanished
    file.path.unlink()
    assert file.vanished
    file.abandon()


def test_a_disk_that_fails_at_closing_ends_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = begun(tmp_path / "pulled.mcap")
    close = os.close

    def fail(number: int) -> None:
        close(number)
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "close", fail)
    file.abandon()
