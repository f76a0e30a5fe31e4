"""Standard messages besides the scene: each has a key of ``publish``, and is made while somebody subscribes.

The camera's pose is sent once a second, so that late subscribers get it too.
"""

from collections import Counter
from collections.abc import Callable

import zenoh

from lcf_edge.config import Config, Publish
from lcf_edge.lens import Lens
from lcf_edge.messages import Scene
from lcf_edge.standard_messages import (
    camera_transform,
    detections,
    image_annotations,
    markers,
    point_cloud,
    speed_limit,
)
from lcf_edge.standard_messages.positions import Setup
from lcf_edge.zenoh_link.publisher import MessagePublisher
from lcf_edge.zenoh_link.ros2 import Ros2Node
from lcf_edge.zenoh_link.topics import (
    ANNOTATIONS,
    DETECTIONS_2D,
    DETECTIONS_3D,
    MARKERS,
    NAV2_SPEED_LIMIT,
    POINTS,
    SPEED_LIMIT,
    TRANSFORM,
    ZenohTopic,
)

LensFor = Callable[[Config, int, int], Lens]
"""The lens of images of a width and height, px."""

_OF_A_SCENE: tuple[tuple[Callable[[Publish], bool], ZenohTopic, Callable[[Scene, Setup], bytes]], ...] = (
    (lambda on: on.annotations, ANNOTATIONS, lambda scene, _: image_annotations.encode_image_annotations(scene)),
    (lambda on: on.points, POINTS, point_cloud.encode_point_cloud),
    (lambda on: on.markers, MARKERS, markers.encode_markers),
    (lambda on: on.detections, DETECTIONS_2D, detections.encode_detections_2d),
    (lambda on: on.detections, DETECTIONS_3D, detections.encode_detections_3d),
    (lambda on: on.speed_limit, SPEED_LIMIT, speed_limit.encode_speed_limit),
    (lambda on: on.speed_limit, NAV2_SPEED_LIMIT, speed_limit.encode_nav2_speed_limit),
)
"""The key that turns it on, its topic, and how it is made."""


def lens_by_config(config: Config, width: int, height: int) -> Lens:
    """Return the lens by the configuration. Raises ``ConfigError``."""
    return Lens.from_config(config.camera, width, height)


class StandardMessages:
    """Puts the messages that ``config.publish`` turns on.

    ``counts``: ``sent`` and ``failed``, of all together. Raises ``PublishError`` when ``publish.prefix`` is no valid
    key.
    """

    def __init__(
        self,
        session: zenoh.Session,
        config: Config,
        ros2: Ros2Node | None = None,
        lens_for: LensFor = lens_by_config,
    ) -> None:
        publish = config.publish
        self.config = config
        self._lens_for = lens_for
        self._setup: tuple[Config, int, int, Setup] | None = None
        self._publishers = [
            (MessagePublisher(session, publish, topic, ros2), encode)
            for is_on, topic, encode in _OF_A_SCENE
            if is_on(publish)
        ]
        self._transform = MessagePublisher(session, publish, TRANSFORM, ros2) if publish.transform else None

    @property
    def counts(self) -> Counter[str]:
        """Counts so far."""
        publishers = [publisher for publisher, _ in self._publishers]
        counts = Counter(sent=0, failed=0)
        for publisher in publishers if self._transform is None else [*publishers, self._transform]:
            counts.update(publisher.counts)
        return counts

    def put(self, scene: Scene) -> None:
        """Send what somebody subscribes to. Raises ``CdrError``, ``ConfigError`` where the lens does not fit."""
        for publisher, encode in self._publishers:
            if publisher.matched:
                publisher.put(encode(scene, self._setup_for(scene.image_width, scene.image_height)))

    def put_transform(self, stamp_ns: int) -> None:
        """Send the camera's pose, as of ``stamp_ns`` of the system clock. Raises ``CdrError``."""
        if self._transform is not None and self._transform.matched:
            camera = self.config.camera
            setup = Setup.from_config(self.config, lens_by_config(self.config, camera.width, camera.height))
            self._transform.put(camera_transform.encode_camera_transform(stamp_ns, setup))

    def _setup_for(self, width: int, height: int) -> Setup:
        known = self._setup
        if known is None or known[:3] != (self.config, width, height):
            setup = Setup.from_config(self.config, self._lens_for(self.config, width, height))
            self._setup = known = (self.config, width, height, setup)
        return known[3]
