"""Makes a Zenoh session a ROS 2 node for rmw_zenoh: keys, and liveliness tokens.

As in the design document of ros2/rmw_zenoh: samples of a topic go to ``<domain>/<topic>/<type>/<hash>``; each node
and each of its publishers and subscriptions is announced by a token under ``@ros2_lv``.
"""

import re
from typing import Literal, NamedTuple

import xxhash
import zenoh

from lcf_edge import config
from lcf_edge.errors import PublishError

TYPE_HASHES = {
    "lcf_msgs/msg/Scene": "RIHS01_20e110493747a055e4e24eb485477108ba7f0a9d69725aa87f86db1529dd6907",
    "sensor_msgs/msg/CompressedImage": "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "diagnostic_msgs/msg/DiagnosticArray": "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "nav_msgs/msg/Odometry": "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "foxglove_msgs/msg/ImageAnnotations": "RIHS01_bc4e578b1ef80953415d6f966a4cab305c8a44c8b64fc405312b6f06a08fc45e",
    "sensor_msgs/msg/PointCloud2": "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "visualization_msgs/msg/MarkerArray": "RIHS01_86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
    "vision_msgs/msg/Detection2DArray": "RIHS01_214274120007f4a683866481336b70310268cfa107aebe9d594a6acf75bda968",
    "vision_msgs/msg/Detection3DArray": "RIHS01_793f5eab9595ac1c0da07873cc859db42eae51f0ee76056db8562515d830e018",
    "geometry_msgs/msg/TwistStamped": "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    "nav2_msgs/msg/SpeedLimit": "RIHS01_83d8e4e842559f4d9a988b19d31b162216ec738536389f98438d1a166f91845a",
    "tf2_msgs/msg/TFMessage": "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}
"""REP-2011 hashes of the message definitions; they change with any field, and with nothing else."""

_NODE_ID = 0
_BEST_EFFORT_DEPTH_1 = "2::,1:,:,:,,"  # omitted fields have defaults: volatile, keep last, …
_LASTING_DEPTH_1 = ":1:,1:,:,:,,"  # reliable, transient local

EndpointKind = Literal["MP", "MS"]
"""A publisher, a subscription."""


class Endpoint(NamedTuple):
    """Key of a publisher's or subscription's samples, and its 16 bytes of identity."""

    key: str
    gid: bytes


def gid_of(name: str) -> bytes:
    """Return the identity that rmw_zenoh derives from an entity's token: XXH3 of 128 bits, little-endian."""
    return xxhash.xxh3_128_digest(name.encode())[::-1]


def dds_type(message: str) -> str:
    """``lcf_msgs/msg/Scene`` as ``lcf_msgs::msg::dds_::Scene_``."""
    package, kind, name = message.split("/")
    return f"{package}::{kind}::dds_::{name}_"


class Ros2Node:
    """The node ``/lcf_edge_<robot>``, which exists as long as this object and its session.

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

    def declare(self, kind: EndpointKind, topic: str, message: str, *, is_lasting: bool = False) -> Endpoint:
        """Announce a publisher or a subscription. ``is_lasting``: a late subscriber wants the last message."""
        type_name, type_hash = dds_type(message), self._hash or TYPE_HASHES[message]
        name = f"/{topic}".replace("/", "%")
        endpoint = f"{name}/{type_name}/{type_hash}/{_LASTING_DEPTH_1 if is_lasting else _BEST_EFFORT_DEPTH_1}"
        token = f"{self._token(len(self._tokens), kind)}/{endpoint}"
        self._tokens.append(self._session.liveliness().declare_token(token))
        return Endpoint(f"{self.domain}/{topic}/{type_name}/{type_hash}", gid_of(token))

    def _token(self, entity_id: int, kind: str) -> str:
        return f"@ros2_lv/{self.domain}/{self._session.zid()}/{_NODE_ID}/{entity_id}/{kind}/%/%/{self._name}"
