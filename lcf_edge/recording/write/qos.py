"""How ``ros2 bag play`` is to publish a topic: rosbag2's ``offered_qos_profiles`` (YAML) in the channel."""

from lcf_edge.recording.write.messages import RecordedTopic

# In numbers, as every version of rosbag2 reads them; 2147483647 s is for ever.
_RELIABLE, _VOLATILE, _TRANSIENT_LOCAL, _KEEP_LAST, _AUTOMATIC = 1, 2, 1, 1, 1
_DEPTH = 10
_FOR_EVER = "sec: 2147483647\n    nsec: 4294967295"


def offered_qos(topic: RecordedTopic) -> str:
    """Reliable; a lasting topic keeps its last message for late subscribers."""
    return (
        f"- history: {_KEEP_LAST}\n"
        f"  depth: {1 if topic.is_lasting else _DEPTH}\n"
        f"  reliability: {_RELIABLE}\n"
        f"  durability: {_TRANSIENT_LOCAL if topic.is_lasting else _VOLATILE}\n"
        f"  deadline:\n    {_FOR_EVER}\n"
        f"  lifespan:\n    {_FOR_EVER}\n"
        f"  liveliness: {_AUTOMATIC}\n"
        f"  liveliness_lease_duration:\n    {_FOR_EVER}\n"
        "  avoid_ros_namespace_conventions: false"
    )
