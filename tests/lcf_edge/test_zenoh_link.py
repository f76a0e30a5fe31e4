"""Scenes reach a second process over Zenoh under the published key, encoding, attachment and quality."""

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import msgspec
import numpy as np
import pytest
import zenoh

from lcf_edge.cdr import decode_scene
from lcf_edge.config import Publish, Zenoh
from lcf_edge.errors import PublishError
from lcf_edge.records import CIRCLE, PSI_REGION, Scene
from lcf_edge.zenoh_link import ATTACHMENT, ScenePublisher, open_session, scenes

PATIENCE_S = 20.0
FRAME_S = 0.02


def scene(seq: int, circles: int = 3) -> Scene:
    rows = np.zeros(circles, CIRCLE)
    rows["id"], rows["x"], rows["ttc"] = np.arange(circles), seq, np.inf
    return Scene(
        stamp_ns=1_700_000_000_000_000_000 + seq,
        seq=seq,
        image_width=640,
        image_height=480,
        vehicle_speed=1.5,
        circles=rows,
        psi=np.zeros(1, PSI_REGION),
    )


@pytest.fixture
def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@pytest.fixture
def session(endpoint: str) -> Iterator[zenoh.Session]:
    with open_session(Zenoh(listen=[endpoint])) as opened:
        yield opened


def test_a_second_process_receives_every_scene_whole(session: zenoh.Session, endpoint: str) -> None:
    subscriber = subprocess.Popen(
        [sys.executable, "-m", "lcf_edge.commands.demo_subscriber", endpoint, "robot7/scene"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    publisher = ScenePublisher(session, Publish(prefix="robot7"))
    with subscriber:
        assert publisher.wait_for_subscriber(PATIENCE_S)
        sizes = []
        for seq in range(20):
            sizes.append(publisher.put(scene(seq)))
            threading.Event().wait(FRAME_S)  # a burst may be dropped, frames at their rate may not
        told, _ = subscriber.communicate("20\n", timeout=PATIENCE_S)
    assert publisher.sent == 20
    assert json.loads(told) == {"scenes": 20, "bytes": sum(sizes), "broken": 0, "circles": 60}
    assert subscriber.returncode == 0


def test_the_subscriber_ends_with_its_input(session: zenoh.Session, endpoint: str) -> None:
    publisher = ScenePublisher(session, Publish())
    subscriber = subprocess.Popen(
        [sys.executable, "-m", "lcf_edge.commands.demo_subscriber", endpoint, "lcf/scene"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    with subscriber:
        assert publisher.wait_for_subscriber(PATIENCE_S)
        told, _ = subscriber.communicate(timeout=PATIENCE_S)
    assert json.loads(told)["scenes"] == 0
    assert subscriber.returncode == 0


def samples(session: zenoh.Session, endpoint: str, publish: Publish, count: int) -> list[zenoh.Sample]:
    """What another session gets of ``count`` scenes."""
    with open_session(Zenoh(connect=[endpoint], listen=[])) as other:
        subscriber = other.declare_subscriber("**", zenoh.handlers.FifoChannel(count))
        publisher = ScenePublisher(session, publish)
        assert publisher.wait_for_subscriber(PATIENCE_S)
        for seq in range(count):
            publisher.put(scene(seq))
        return [subscriber.recv() for _ in range(count)]


def test_key_encoding_and_quality_of_service(session: zenoh.Session, endpoint: str) -> None:
    (sample,) = samples(session, endpoint, Publish(prefix="lcf"), 1)
    assert str(sample.key_expr) == "lcf/scene"
    assert str(sample.encoding) == "application/cdr;lcf_msgs/msg/Scene"
    assert sample.congestion_control == zenoh.CongestionControl.DROP
    assert sample.priority == zenoh.Priority.REAL_TIME
    assert sample.express


def test_the_payload_is_the_scene(session: zenoh.Session, endpoint: str) -> None:
    (sample,) = samples(session, endpoint, Publish(frame_id="eye"), 1)
    payload = sample.payload.to_bytes()
    received, sent = decode_scene(payload), scene(0)
    assert payload[:4] == bytes((0, 1, 0, 0))
    assert b"eye\0" in payload
    assert received.stamp_ns == sent.stamp_ns
    assert received.circles.tobytes() == sent.circles.tobytes()


def test_the_attachment_is_that_of_rmw_zenoh(session: zenoh.Session, endpoint: str) -> None:
    began_ns = time.time_ns()
    attachments = [s.attachment.to_bytes() for s in samples(session, endpoint, Publish(), 3) if s.attachment]
    assert [len(attachment) for attachment in attachments] == [33, 33, 33]
    numbers, times_ns, lengths, gids = zip(*map(ATTACHMENT.unpack, attachments), strict=True)
    assert numbers == (1, 2, 3)
    assert attachments[0][:8] == (1).to_bytes(8, "little")
    assert began_ns <= times_ns[0] <= times_ns[1] <= times_ns[2] <= time.time_ns()
    assert lengths == (16, 16, 16)
    assert len(set(gids)) == 1
    assert gids[0] != bytes(16)


def test_two_publishers_have_different_gids(session: zenoh.Session, endpoint: str) -> None:
    gids = set()
    for prefix in ("a", "b"):
        (sample,) = samples(session, endpoint, Publish(prefix=prefix), 1)
        assert sample.attachment is not None
        gids.add(ATTACHMENT.unpack(sample.attachment.to_bytes())[3])
    assert len(gids) == 2


def test_scenes_are_yielded_as_they_come(session: zenoh.Session, endpoint: str) -> None:
    publisher = ScenePublisher(session, Publish())

    def publish() -> None:
        if publisher.wait_for_subscriber(PATIENCE_S):
            for seq in range(5):
                publisher.put(scene(seq))

    thread = threading.Thread(target=publish)
    thread.start()
    with closing(scenes(endpoint)) as received:
        assert [next(received).seq for _ in range(5)] == [0, 1, 2, 3, 4]
    thread.join()


def test_nobody_listens_to_nobody(session: zenoh.Session) -> None:
    publisher = ScenePublisher(session, Publish())
    assert not publisher.wait_for_subscriber(0.0)
    assert publisher.put(scene(0)) > 0


@pytest.mark.usefixtures("session")
def test_a_busy_port_names_the_endpoint_and_the_remedy(endpoint: str) -> None:
    with pytest.raises(PublishError) as caught:
        open_session(Zenoh(listen=[endpoint]))
    assert str(caught.value) == (
        f"{endpoint}: already in use; stop the other program or set zenoh.listen to another port"
    )


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (Zenoh(listen=["nonsense"]), "nonsense"),
        (Zenoh(listen=["bogus/1"]), "bogus/1: Unicast not supported for bogus protocol"),
        (Zenoh(listen=["tcp/127.0.0.1:99999"]), "tcp/127.0.0.1:99999: invalid port"),
        (Zenoh(mode="client", connect=["tcp/127.0.0.1:9"], listen=[]), "tcp/127.0.0.1:9: Unable to connect"),
        (Zenoh(config_file="/nowhere.json5"), "/nowhere.json5: no valid Zenoh configuration"),
    ],
)
def test_a_session_that_cannot_be_opened_is_one_line(options: Zenoh, text: str) -> None:
    with pytest.raises(PublishError) as caught:
        open_session(options)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "cargo" not in str(caught.value)


@pytest.mark.parametrize("prefix", ["", "/lcf", "lcf//a", "lcf/*", "lcf/**", "a#b", "$*"])
def test_a_prefix_that_is_no_key_is_refused(session: zenoh.Session, prefix: str) -> None:
    with pytest.raises(PublishError, match=r"^publish\.prefix: "):
        ScenePublisher(session, Publish(prefix=prefix))


def listening_addresses(options: Zenoh) -> tuple[set[str], set[str]]:
    """Local addresses of the TCP listeners and of the UDP sockets of a process that opens such a session."""
    code = (
        "import sys, msgspec, pathlib, os, glob\n"
        "from lcf_edge.config import Zenoh\n"
        "from lcf_edge.zenoh_link import open_session\n"
        "with open_session(msgspec.json.decode(sys.argv[1], type=Zenoh)):\n"
        "    links = {os.readlink(f) for f in glob.glob('/proc/self/fd/*') if os.path.islink(f)}\n"
        "    for name in ('tcp', 'tcp6', 'udp', 'udp6'):\n"
        "        for row in pathlib.Path('/proc/net', name).read_text().splitlines()[1:]:\n"
        "            part = row.split()\n"
        "            if f'socket:[{part[9]}]' in links: print(name[:3], part[1])\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, msgspec.json.encode(options).decode()],
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line.split() for line in done.stdout.splitlines()]
    return {at for name, at in rows if name == "tcp"}, {at for name, at in rows if name == "udp"}


needs_proc = pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads Linux's table of sockets")


@needs_proc
def test_by_default_only_loopback_listens_and_nobody_is_scouted(endpoint: str) -> None:
    tcp, udp = listening_addresses(Zenoh(listen=[endpoint]))
    port = int(endpoint.rpartition(":")[2])
    assert tcp == {f"0100007F:{port:04X}"}
    assert udp == set()


@needs_proc
def test_without_an_endpoint_nothing_listens() -> None:
    assert listening_addresses(Zenoh(listen=[])) == (set(), set())


@needs_proc
def test_a_configuration_file_is_heard_and_the_keys_go_on_top(tmp_path: Path, endpoint: str) -> None:
    file = tmp_path / "zenoh.json5"
    file.write_text(f'{{listen: {{endpoints: ["{endpoint}"]}}, mode: "router"}}')
    port = int(endpoint.rpartition(":")[2])
    tcp, udp = listening_addresses(Zenoh(config_file=os.fspath(file), listen=[]))
    assert tcp == {f"0100007F:{port:04X}"}, "an empty list leaves the file's"
    assert udp == set(), "what the file does not ask for stays off"
    other, _ = listening_addresses(Zenoh(config_file=os.fspath(file), listen=["tcp/127.0.0.1:0"]))
    assert other
    assert tcp.isdisjoint(other)


def test_a_liveliness_token_tells_that_the_publisher_is_there(session: zenoh.Session, endpoint: str) -> None:
    alive, told = threading.Event(), []

    def tell(sample: zenoh.Sample) -> None:
        told.append((str(sample.key_expr), sample.kind))
        alive.set()

    with (
        open_session(Zenoh(connect=[endpoint], listen=[])) as other,
        other.liveliness().declare_subscriber("fleet/@alive/*", tell, history=True),
    ):
        publisher = ScenePublisher(session, Publish(prefix="fleet", robot="seven"))
        assert alive.wait(PATIENCE_S)
    assert publisher.sent == 0
    assert told[0] == ("fleet/@alive/seven", zenoh.SampleKind.PUT)


@pytest.mark.parametrize("publish", [Publish(prefix="a/*"), Publish(robot="r*"), Publish(robot="")])
def test_a_name_that_is_no_key_is_refused(session: zenoh.Session, publish: Publish) -> None:
    with pytest.raises(PublishError, match=r"publish\.(prefix|robot)"):
        ScenePublisher(session, publish)
