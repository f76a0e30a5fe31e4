"""What makes a Zenoh session a ROS 2 node for those that speak rmw_zenoh: keys, and liveliness tokens.

As in the design document of ros2/rmw_zenoh: samples of a topic go to ``<domain>/<topic>/<type>/<hash>``; each node
and each of its publishers and subscriptions is told of by a token under ``@ros2_lv``.
"""

import re
from typing import Literal, NamedTuple

import xxhash
import zenoh

from lcf_edge import config
from lcf_edge.errors import PublishError

TYPE_HASHES = {
    "lcf_msgs/msg/Scene": "RIHS01_8192214a4a1c8d6f43ddb34ab11633a9470615d3a2f524bf16291fcc5706c5f5",
    "sensor_msgs/msg/CompressedImage": "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "diagnostic_msgs/msg/DiagnosticArray": "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "nav_msgs/msg/Odometry": "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
}
"""REP-2011 hashes of the message definitions; they change with any field, and with nothing else."""

_NODE_ID = 0
_BEST_EFFORT_DEPTH_1 = "2::,1:,:,:,,"  # what is not written is the default: volatile, keep last, …

EndpointKind = Literal["MP", "MS"]
"""A publisher, a subscription."""


class Endpoint(NamedTuple):
    """Where the samples of a publisher go, or those for a subscription come from, and its 16 bytes of identity."""

    key: str
    gid: bytes


def gid_of(name: str) -> bytes:
    """As rmw_zenoh makes it of an entity's token: XXH3 of 128 bits, little-endian."""
    return xxhash.xxh3_128_digest(name.encode())[::-1]


def dds_type(message: str) -> str:
    """``lcf_msgs/msg/Scene`` as ``lcf_msgs::msg::dds_::Scene_``."""
    package, kind, name = message.split("/")
    return f"{package}::{kind}::dds_::{name}_"


class Ros2Node:
    """The node ``/lcf_edge_<robot>``, there for as long as this object and its session.

    Raises ``PublishError`` when ``publish.prefix`` is no name for a ROS topic.
    """

    def __init__(self, session: zenoh.Session, publish: config.Publish) -> None:
        if not re.fullmatch(r"[A-Za-z_]\w*(/[A-Za-z_]\w*)*", publish.prefix, re.ASCII):
            raise PublishError(
                f"publish.prefix: {publish.prefix!r}: with publish.ros2, letters, digits and _ only, no digit first"
            )
        self.domain = publish.ros2_domain
        self._hash = None if publish.ros2_type_hash == "RIHS01" else publish.ros2_type_hash
        self._name = "lcf_edge_" + re.sub(r"\W", "_", publish.robot, flags=re.ASCII)
        self._session = session
        self._tokens = [session.liveliness().declare_token(self._token(_NODE_ID, "NN"))]

    def declare(self, kind: EndpointKind, topic: str, message: str) -> Endpoint:
        """Tell of a publisher or a subscription."""
        type_name, type_hash = dds_type(message), self._hash or TYPE_HASHES[message]
        name = f"/{topic}".replace("/", "%")
        endpoint = f"{name}/{type_name}/{type_hash}/{_BEST_EFFORT_DEPTH_1}"
        token = f"{self._token(len(self._tokens), kind)}/{endpoint}"
        self._tokens.append(self._session.liveliness().declare_token(token))
        return Endpoint(f"{self.domain}/{topic}/{type_name}/{type_hash}", gid_of(token))

    def _token(self, entity_id: int, kind: str) -> str:
        return f"@ros2_lv/{self.domain}/{self._session.zid()}/{_NODE_ID}/{entity_id}/{kind}/%/%/{self._name}"
