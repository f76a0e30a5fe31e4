"""Messages that others know go out when their key says so, and are made only for somebody who listens."""

from collections.abc import Callable
from typing import Any

import msgspec
import pytest
import zenoh

from lcf_edge.config import Camera, Config, Publish
from lcf_edge.messages import Scene
from lcf_edge.zenoh_link.link import Link

KEYS = {
    "annotations": ["lcf/annotations"],
    "points": ["lcf/points"],
    "markers": ["lcf/markers"],
    "detections": ["lcf/detections", "lcf/detections_3d"],
    "speed_limit": ["lcf/nav2_speed_limit", "lcf/speed_limit"],
    "transform": ["tf_static"],
}


@pytest.mark.parametrize("name", KEYS)
def test_each_is_turned_on_by_its_key(
    session: zenoh.Session, peer: Any, until_matched: Any, scene: Callable[..., Scene], name: str
) -> None:
    link = Link(session, Config(publish=msgspec.structs.replace(Publish(), **{name: True})))
    peer.subscribe("**")
    for key in KEYS[name]:
        until_matched(session, key)
    link.put_scene(scene())
    link.put_diagnostics([], 5)
    received = {sample.key for sample in peer.receive("**", 2 + len(KEYS[name]))}
    assert sorted(received - {"lcf/scene", "lcf/diagnostics"}) == KEYS[name]
    link.close()


def test_none_is_made_for_nobody(session: zenoh.Session, scene: Callable[..., Scene]) -> None:
    link = Link(session, Config(publish=msgspec.structs.replace(Publish(), **dict.fromkeys(KEYS, True))))
    link.put_scene(scene())
    link.put_diagnostics([], 5)
    assert link.counts["messages sent"] == 0
    assert link.counts["scene sent"] == 1
    link.close()


def test_a_reload_moves_the_camera(session: zenoh.Session, peer: Any, until_matched: Any, ros: Any) -> None:
    link = Link(session, Config(publish=Publish(transform=True)))
    peer.subscribe("tf_static")
    until_matched(session, "tf_static")
    link.show_config(Config(publish=Publish(transform=True), camera=Camera(ahead_m=1.5)))
    link.put_diagnostics([], 5)
    (sample,) = peer.receive("tf_static")
    (transform,) = ros.deserialize_cdr(sample.payload, "tf2_msgs/msg/TFMessage").transforms
    assert transform.transform.translation.x == 1.5
    link.close()
