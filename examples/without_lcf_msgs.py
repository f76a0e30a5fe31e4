"""A subscriber that makes classes of the daemon's own message definitions: needs only eclipse-zenoh and rosbags.

python examples/without_lcf_msgs.py
"""

import zenoh
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

ENDPOINT = "tcp/127.0.0.1:7447"

config = zenoh.Config()
config.insert_json5("connect/endpoints", f'["{ENDPOINT}"]')
config.insert_json5("scouting/multicast/enabled", "false")
with zenoh.open(config) as session:
    (answer,) = session.get("lcf/query/schema")
    messages = get_typestore(Stores.ROS2_JAZZY)
    messages.register(get_types_from_msg(answer.ok.payload.to_string(), "lcf_msgs/msg/Scene"))
    subscriber = session.declare_subscriber("lcf/scene")
    for sample in subscriber:
        scene = messages.deserialize_cdr(sample.payload.to_bytes(), "lcf_msgs/msg/Scene")
        for thing in scene.objects:
            print(f"{scene.frame_seq}: class {thing.class_id}, contact in {thing.ttc:.1f} ± {thing.ttc_sigma:.1f} s")
