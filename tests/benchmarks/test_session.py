"""The daemon in a session, and the parts of its frames: small runs of what `make bench` measures."""

from benchmarks import session, stages
from benchmarks.playing import config_of
from lcf_edge.rendered import scenes


def test_a_session_counts_what_the_daemon_sends_to_another_process() -> None:
    found = session.measure(1.0, drive_s=2.0)
    assert 0 < found.received <= found.frame_count
    assert 0 < found.latency_p50_ms <= found.latency_p99_ms
    assert found.core_share > 0
    assert found.reading_share > 0
    assert found.resident_mib > 10


def test_every_part_of_a_frame_is_timed() -> None:
    drive = scenes.make("two_crossing", 1, seconds=2.0)
    parts = stages.measure_frame(drive, config_of(drive))
    assert {"image out of a YUYV buffer", "corners", "ego-motion", "filter", "scene as a message", "put"} <= {
        part.name for part in parts
    }
    assert all(part.median > 0 for part in parts)
    assert abs(sum(part.share for part in parts) - 1) < 1e-9
