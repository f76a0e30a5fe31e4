"""Scenes reach a second process under the published key, with the attachment of rmw_zenoh."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import zenoh

from lcf_edge.cdr import decode_scene
from lcf_edge.config import Publish, Zenoh
from lcf_edge.errors import PublishError
from lcf_edge.messages import OBJECT, Scene
from lcf_edge.zenoh_link import ATTACHMENT, ScenePublisher, opened_session

PATIENCE_S = 20.0
FRAME_S = 0.02

NewScene = Callable[..., Scene]


def test_a_second_process_receives_every_scene_whole(session: zenoh.Session, endpoint: str, scene: NewScene) -> None:
    subscriber = subprocess.Popen(
        [sys.executable, "-m", "lcf_edge.cli.demo_subscriber", endpoint, "robot7/scene"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    publisher = ScenePublisher(session, Publish(prefix="robot7"))
    with subscriber:
        assert publisher.wait_for_subscriber(PATIENCE_S)
        sizes = []
        for seq in range(20):
            sizes.append(publisher.put(replace(scene(seq), objects=np.zeros(2, OBJECT))))
            threading.Event().wait(FRAME_S)  # a burst may be dropped, frames at their rate may not
        output, _ = subscriber.communicate("20\n", timeout=PATIENCE_S)
    assert publisher.sent == 20
    received = {"scenes": 20, "bytes": sum(sizes), "broken": 0, "circles": 60, "objects": 40}
    assert json.loads(output) == received
    assert subscriber.returncode == 0


def test_the_subscriber_ends_with_its_input(session: zenoh.Session, endpoint: str) -> None:
    publisher = ScenePublisher(session, Publish())
    subscriber = subprocess.Popen(
        [sys.executable, "-m", "lcf_edge.cli.demo_subscriber", endpoint, "lcf/scene"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with subscriber:
        assert publisher.wait_for_subscriber(PATIENCE_S)
        output, _ = subscriber.communicate(timeout=PATIENCE_S)
    assert json.loads(output)["scenes"] == 0
    assert subscriber.returncode == 0


def samples(session: zenoh.Session, peer: Any, publish: Publish, scenes: list[Scene]) -> list[Any]:
    """What another process gets of some scenes."""
    peer.subscribe("**")
    publisher = ScenePublisher(session, publish)
    assert publisher.wait_for_subscriber(PATIENCE_S)
    received = []
    for one in scenes:  # one by one: on a busy machine a few at once are too many, and dropped
        publisher.put(one)
        received += peer.receive("**")
    return received


def test_the_payload_is_the_scene(session: zenoh.Session, peer: Any, scene: NewScene) -> None:
    (sample,) = samples(session, peer, Publish(frame_id="eye"), [scene()])
    received = decode_scene(sample.payload)
    assert sample.payload[:4] == bytes((0, 1, 0, 0))
    assert b"eye\0" in sample.payload
    assert received.stamp_ns == scene().stamp_ns
    assert received.circles.tobytes() == scene().circles.tobytes()


def test_the_attachment_is_that_of_rmw_zenoh(session: zenoh.Session, peer: Any, scene: NewScene) -> None:
    began_ns = time.time_ns()
    attachments = [one.attachment for one in samples(session, peer, Publish(), [scene(n) for n in range(3)])]
    assert [len(attachment) for attachment in attachments] == [33, 33, 33]
    numbers, times_ns, lengths, gids = zip(*map(ATTACHMENT.unpack, attachments), strict=True)
    assert numbers == (1, 2, 3)
    assert attachments[0][:8] == (1).to_bytes(8, "little")
    assert began_ns <= times_ns[0] <= times_ns[1] <= times_ns[2] <= time.time_ns()
    assert lengths == (16, 16, 16)
    assert len(set(gids)) == 1
    assert gids[0] != bytes(16)


def test_two_publishers_have_different_gids(session: zenoh.Session, peer: Any, scene: NewScene) -> None:
    both = [samples(session, peer, Publish(prefix=prefix), [scene()])[0] for prefix in ("a", "b")]
    assert len({ATTACHMENT.unpack(one.attachment)[3] for one in both}) == 2


def test_nobody_listens_to_nobody(session: zenoh.Session, scene: NewScene) -> None:
    publisher = ScenePublisher(session, Publish())
    assert not publisher.wait_for_subscriber(0.0)
    assert publisher.put(scene()) > 0


@pytest.mark.parametrize("prefix", ["", "/lcf", "lcf//a", "lcf/*", "lcf/**", "a#b", "$*"])
def test_a_prefix_that_is_no_key_is_refused(session: zenoh.Session, prefix: str) -> None:
    with pytest.raises(PublishError, match=r"^publish\.prefix: "):
        ScenePublisher(session, Publish(prefix=prefix))


def test_a_liveliness_token_shows_that_the_publisher_is_there(session: zenoh.Session, endpoint: str) -> None:
    alive, output = threading.Event(), []

    def tell(sample: zenoh.Sample) -> None:
        output.append((str(sample.key_expr), sample.kind))
        alive.set()

    with (
        opened_session(Zenoh(connect=[endpoint], listen=[])) as other,
        other.liveliness().declare_subscriber("fleet/@alive/*", tell, history=True),
    ):
        publisher = ScenePublisher(session, Publish(prefix="fleet", robot="seven"))
        assert alive.wait(PATIENCE_S)
    assert publisher.sent == 0
    assert output[0] == ("fleet/@alive/seven", zenoh.SampleKind.PUT)


@pytest.mark.parametrize("publish", [Publish(prefix="a/*"), Publish(robot="r*"), Publish(robot="")])
def test_a_name_that_is_no_key_is_refused(session: zenoh.Session, publish: Publish) -> None:
    with pytest.raises(PublishError, match=r"publish\.(prefix|robot)"):
        ScenePublisher(session, publish)
