"""A ROS 2 node of an independent implementation (``zenoh-ros2-sdk``), in a process of its own.

``python ros_node.py PORT DOMAIN``; on standard input one line of JSON: for each topic its type, and the definitions
of that and of all types within it. Tells what it subscribed to, the topics that it sees, then one message of each.
"""

import json
import queue
import sys
from typing import Any

import numpy as np
from rosbags.typesys import get_types_from_msg
from zenoh_ros2_sdk import ROS2Subscriber, ZenohSession
from zenoh_ros2_sdk.discovery import get_topic_names_and_types
from zenoh_ros2_sdk.utils import get_type_hash

PATIENCE_S = 20.0


def plain(value: Any) -> Any:
    """What JSON can hold; of images only the size."""
    if isinstance(value, np.ndarray):
        return {"bytes": value.size} if value.dtype == np.uint8 else value.tolist()
    if isinstance(value, list):
        return [plain(item) for item in value]
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__ if name != "__msgtype__"}
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value


def tell(what: Any) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()


def main() -> None:
    port, domain = int(sys.argv[1]), int(sys.argv[2])
    node = ZenohSession.get_instance("127.0.0.1", port)
    received: dict[str, queue.Queue[Any]] = {}
    kept = []
    for topic, (kind, definitions) in json.loads(sys.stdin.readline()).items():
        for name, text in definitions.items():
            if name not in node.store.types:
                node.store.register(get_types_from_msg(text, name))
        own = definitions[kind]
        others = {name: text for name, text in definitions.items() if name != kind}
        node._registered_types[kind] = kind  # or it would ask the network for the definitions
        received[topic] = queue.Queue()
        subscriber = ROS2Subscriber(
            topic, kind, received[topic].put, own, domain_id=domain, router_port=port,
            type_hash=get_type_hash(kind, own, others),
        )  # fmt: skip
        kept.append(subscriber)
    tell({subscriber.topic: subscriber.keyexpr for subscriber in kept})
    tell(dict(get_topic_names_and_types(domain, router_port=port, timeout=PATIENCE_S)))
    try:
        tell({topic: plain(messages.get(timeout=PATIENCE_S)) for topic, messages in received.items()})
    finally:
        node.close()


if __name__ == "__main__":
    main()
