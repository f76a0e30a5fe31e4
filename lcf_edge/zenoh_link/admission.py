"""Access rules of a daemon that listens only on this machine: it accepts what it needs, and nothing else.

Every local process can connect. It may read all that the daemon publishes, query it, and send the speed; it cannot send
scenes, answers or tokens to others through the daemon, nor fill its memory with large messages.
"""

import json
from typing import Any

from lcf_edge.config import Publish, Zenoh
from lcf_edge.zenoh_link.topics import STANDARD

MAX_MESSAGE_BYTES = 2**14
"""Larger incoming messages are dropped before their parts are put together: a speed takes less than 1 kB."""


def settings(options: Zenoh, publish: Publish) -> dict[str, str]:
    """Return settings of Zenoh, as JSON by key, to be used unless the user's file has others.

    A daemon that connects to routers, is one, or speaks to ROS 2, also routes for others, with keys that it cannot
    know: there are no rules then.
    """
    chosen = {"transport/link/rx/max_message_size": str(MAX_MESSAGE_BYTES)}
    if options.mode == "peer" and not options.connect and not options.config_file and not publish.ros2:
        chosen["access_control"] = json.dumps(access_control(publish.prefix))
    return chosen


def access_control(prefix: str) -> dict[str, Any]:
    """Zenoh's rules for everybody: reading, asking, and the speed; what others declare is not passed on."""

    def rule(name: str, flow: str, messages: list[str], *keys: str) -> dict[str, Any]:
        return {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": list(keys)}

    published = [f"{prefix}/scene", f"{prefix}/preview/compressed", f"{prefix}/diagnostics"]
    published += [topic.key(prefix) for topic in STANDARD]
    alive = f"{prefix}/@alive/*"
    rules = [
        rule("published", "egress", ["put"], *published),
        rule("answers", "egress", ["declare_queryable", "reply"], f"{prefix}/query/*"),
        rule("alive", "egress", ["liveliness_token"], alive),
        rule("speed wanted", "egress", ["declare_subscriber"], f"{prefix}/speed"),
        rule("subscribed to", "ingress", ["declare_subscriber"], "**"),
        rule("asked", "ingress", ["query"], "**"),
        rule(
            "asked whether alive",
            "ingress",
            ["declare_liveliness_subscriber", "liveliness_query"],
            f"{prefix}/@alive/**",
        ),
        rule("speed", "ingress", ["put"], f"{prefix}/speed"),
    ]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": "everybody"}],
        "policies": [{"rules": [rule["id"] for rule in rules], "subjects": ["everybody"]}],
    }
