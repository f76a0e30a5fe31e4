"""On loopback every local process may read, query and send the speed; it cannot impersonate the rover."""

import subprocess
from collections.abc import Callable
from typing import Any

import pytest

from lcf_edge.cdr import decode_diagnostics
from lcf_edge.config import Publish, Zenoh
from lcf_edge.zenoh_link.admission import settings

ALLOWED_MIB = 10.0
SILENCE_S = 0.3
PATIENCE_S = 20.0

Daemon = subprocess.Popen[str]


@pytest.fixture
def daemon(without_camera: Callable[..., Daemon]) -> Daemon:
    return without_camera()


@pytest.fixture
def local(start: Any, endpoint: str, daemon: Daemon) -> Callable[[], Any]:
    """Any process of this machine."""
    assert daemon

    def connect() -> Any:
        peer = start(mode="client", listen__endpoints=[], connect__endpoints=[endpoint])
        assert peer.ask("connected")
        return peer

    return connect


def test_a_local_process_cannot_speak_for_the_rover(local: Callable[[], Any]) -> None:
    planner, liar = local(), local()
    keys = ("lcf/scene", "lcf/diagnostics", "lcf/query/config", "lcf/query/fake")
    for key in keys:
        planner.subscribe(key)
        liar.ask("answer", key=key, payload=b"fake".hex())
        liar.ask("announce", key="lcf/@alive/fake")
    assert planner.get("lcf/query/schema")
    for key in keys:
        liar.ask("put_blindly", key=key, payload=b"fake".hex())
    assert liar.get("lcf/query/schema"), "what it has sent has arrived"
    assert planner.tokens("lcf/@alive/*") == ["lcf/@alive/rover"]
    received = [one for key in keys for one in (*planner.receive(key, 3, SILENCE_S), *planner.get(key, SILENCE_S))]
    assert received
    assert b"fake" not in {one if isinstance(one, str) else one.payload for one in received}


def test_a_local_process_may_read_by_wildcards(local: Callable[[], Any]) -> None:
    reader = local()
    reader.subscribe("**")
    assert reader.receive("**", 1, PATIENCE_S)
    assert reader.get("lcf/**")
    assert reader.tokens("lcf/@alive/**") == ["lcf/@alive/rover"]


def test_a_local_process_receives_messages_that_others_know(
    without_camera: Callable[..., Daemon], start: Any, endpoint: str
) -> None:
    """The camera's place goes out without a camera, too, and its key is not below the prefix."""
    without_camera("publish.transform=true")
    reader = start(mode="client", listen__endpoints=[], connect__endpoints=[endpoint])
    reader.subscribe("tf_static")
    (sample,) = reader.receive("tf_static")
    assert sample.encoding == "application/cdr;tf2_msgs/msg/TFMessage"


def test_what_a_local_process_declares_is_not_passed_on_to_others(local: Callable[[], Any]) -> None:
    """Or it would fill their memory as well."""
    planner, greedy = local(), local()
    greedy.subscribe("lcf/of-the-peer/**")
    greedy.subscribe("lcf/speed")
    assert greedy.get("lcf/query/schema"), "what it has declared has arrived"
    assert planner.ask("matched", key="lcf/speed"), "the rover listens to it"
    assert not planner.ask("matched", key="lcf/of-the-peer/1")


def test_large_messages_do_not_fill_its_memory(
    local: Callable[[], Any], daemon: Daemon, resident_mib: Callable[[Daemon], float]
) -> None:
    floods = [local() for _ in range(6)]
    assert floods[0].get("lcf/query/schema")
    before_mib = resident_mib(daemon)
    for flood in floods:
        flood.ask("put_large", key="lcf/speed", size=1_000_000, count=20)
    assert floods[0].get("lcf/query/schema")
    assert resident_mib(daemon) - before_mib < ALLOWED_MIB
    floods[0].subscribe("lcf/diagnostics")
    (sample,) = floods[0].receive("lcf/diagnostics")
    link = next(dict(one.values) for one in decode_diagnostics(sample.payload).status if one.name == "link")
    assert "speed too large" not in link, "they were dropped before they were put together"


@pytest.mark.parametrize(
    "options",
    [
        (Zenoh(mode="router"), Publish()),
        (Zenoh(connect=["tcp/192.0.2.1:7447"]), Publish()),
        (Zenoh(config_file="zenoh.json5"), Publish()),
        (Zenoh(), Publish(ros2=True)),
    ],
)
def test_who_routes_for_others_or_has_rules_of_its_own_gets_none(options: tuple[Zenoh, Publish]) -> None:
    assert "access_control" not in settings(*options)
    assert "access_control" in settings(Zenoh(), Publish())
