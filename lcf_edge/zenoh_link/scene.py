"""Scenes: one per frame, at the highest priority."""

import zenoh

from lcf_edge import config
from lcf_edge.cdr import encode_scene
from lcf_edge.errors import PublishError
from lcf_edge.messages import Scene
from lcf_edge.zenoh_link.publisher import MessagePublisher
from lcf_edge.zenoh_link.ros2 import Ros2Node
from lcf_edge.zenoh_link.session import reason
from lcf_edge.zenoh_link.topics import ZenohTopic

SCENE = ZenohTopic("scene", "lcf_msgs/msg/Scene", zenoh.Priority.REAL_TIME, express=True)
SCENE_ENCODING = SCENE.encoding


def scene_key(prefix: str) -> str:
    """The key of scenes."""
    return SCENE.key(prefix)


class ScenePublisher:
    """Puts each scene on ``<prefix>/scene``, and with ``publish.ros2`` on its ROS 2 topic.

    A liveliness token ``<prefix>/@alive/<robot>`` shows its presence. It lives as long as its session. ``ros2``:
    the node to which the topic belongs; None with ``publish.ros2`` on: its own. ``latest``: the last payload. Raises
    ``PublishError`` when ``publish.prefix`` or ``publish.robot`` is no valid key.
    """

    def __init__(self, session: zenoh.Session, publish: config.Publish, ros2: Ros2Node | None = None) -> None:
        self.latest: bytes | None = None
        self._frame_id = publish.frame_id
        self._ros2 = Ros2Node(session, publish) if ros2 is None and publish.ros2 else ros2  # kept alive here
        self._publisher = MessagePublisher(session, publish, SCENE, self._ros2)
        self.key, self.counts = self._publisher.key, self._publisher.counts
        if set("*$#?") & set(publish.robot) or not publish.robot:
            raise PublishError(f"publish.robot: {publish.robot!r}: a key to publish on has no wildcards")
        try:
            self._alive = session.liveliness().declare_token(f"{publish.prefix}/@alive/{publish.robot}")
        except zenoh.ZError as error:
            raise PublishError(f"publish.robot: {publish.robot}: {reason(error)}") from error

    @property
    def sent(self) -> int:
        """Number of scenes that were sent."""
        return self.counts["sent"]

    def put(self, scene: Scene) -> int:
        """Send one scene. Return the bytes of its payload. Raises ``CdrError``."""
        self.latest = encode_scene(scene, self._frame_id)
        self._publisher.put(self.latest)
        return len(self.latest)

    def wait_for_subscriber(self, timeout_s: float) -> bool:
        """Wait until somebody subscribes; False when nobody did in time."""
        return self._publisher.wait_until_matched(timeout_s)
