"""What happens at the other end costs nothing here: frozen, vanished or hostile peers, routers that come and go."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
import zenoh

from lcf_edge.config import Config, Zenoh
from lcf_edge.errors import PublishError
from lcf_edge.messages import Scene
from lcf_edge.zenoh_link import open_session, opened_session
from lcf_edge.zenoh_link.link import Link

PATIENCE_S = 20.0
MANY = 3000  # scenes of 15 kB: more than any buffer in between holds

NewScene = Callable[..., Scene]

WITHIN_S = 4.0  # a put that waits for a frozen peer takes 5 s, a closing that waits for one 10 s


def within(do: Callable[[], object]) -> bool:
    """Whether it came to its end."""
    thread = threading.Thread(target=do, daemon=True)
    thread.start()
    thread.join(WITHIN_S)
    return not thread.is_alive()


@pytest.fixture
def frozen(session: zenoh.Session, start: Any, endpoint: str, until_matched: Any) -> Any:
    """A process that subscribes to everything and then stands still."""
    peer = start(mode="client", connect__endpoints=[endpoint])
    peer.subscribe("lcf/**")
    until_matched(session, "lcf/scene")
    peer.freeze()
    return peer


def test_a_frozen_subscriber_holds_up_neither_puts_nor_those_who_listen(
    session: zenoh.Session, frozen: Any, start: Any, endpoint: str, scene: NewScene
) -> None:
    link = Link(session, Config())
    other = start(mode="client", connect__endpoints=[endpoint])
    other.subscribe("lcf/diagnostics")
    other.subscribe("lcf/scene")
    full = scene(circles=300)

    def put() -> None:
        for _ in range(MANY):
            link.put_scene(full)
        link.put_diagnostics([], time.time_ns())

    assert within(put)
    assert link.counts["scene sent"] == MANY
    assert link.counts["scene failed"] == 0
    assert len(other.receive("lcf/diagnostics")) == 1
    assert len(other.receive("lcf/scene", 2)) == 2
    frozen.end()
    link.close()


@pytest.mark.usefixtures("frozen")
def test_a_frozen_subscriber_does_not_hold_up_the_end(session: zenoh.Session, scene: NewScene) -> None:
    link = Link(session, Config())
    full = scene(circles=300)
    for _ in range(MANY):
        link.put_scene(full)
    assert within(link.close)
    link.put_scene(full)
    assert link.counts["scene sent"] + link.counts["scene failed"] == MANY + 1


def test_a_process_ends_though_a_subscriber_is_frozen(start: Any, endpoint: str) -> None:
    code = (
        "import sys\n"
        "from lcf_edge.config import Config, Zenoh\n"
        "from lcf_edge.zenoh_link import open_session\n"
        "from lcf_edge.zenoh_link.link import Link\n"
        "link = Link(open_session(Zenoh(listen=[sys.argv[1]])), Config())\n"
        "print(flush=True)\n"
        "sys.stdin.readline()\n"
        "for _ in range(3000):\n"
        "    link.put_preview(bytes(15000), 0)\n"
        "link.close()\n"
    )
    command = (sys.executable, "-c", code, endpoint)
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        assert process.stdin
        process.stdout.readline()
        try:
            peer = start(mode="client", connect__endpoints=[endpoint])
            peer.subscribe("lcf/**")
            peer.get("lcf/query/config")  # the subscription has arrived
            peer.freeze()
            process.stdin.write("\n")
            process.stdin.flush()
            assert process.wait(2 * WITHIN_S) == 0
        finally:
            process.kill()


def test_a_subscriber_that_vanishes_is_nothing_and_one_that_comes_is_served(
    session: zenoh.Session, start: Any, endpoint: str, until_matched: Any, scene: NewScene
) -> None:
    link = Link(session, Config())
    for round_ in range(3):
        peer = start(mode="client", connect__endpoints=[endpoint])
        peer.subscribe("lcf/scene")
        until_matched(session, "lcf/scene")
        link.put_scene(scene(round_))
        assert len(peer.receive("lcf/scene")) == 1
        peer.end()  # SIGKILL
        for _ in range(100):
            link.put_scene(scene())
    assert link.counts == {"scene sent": 303}
    link.close()


def test_a_router_comes_and_goes(
    start: Any, endpoint: str, until_matched: Any, scene: NewScene, velocity: Callable[..., bytes]
) -> None:
    with opened_session(Zenoh(connect=[endpoint], listen=[])) as session:  # nobody is there yet
        link = Link(session, Config())
        link.put_scene(scene())
        for round_ in range(2):
            router = start(mode="router", listen__endpoints=[endpoint])
            router.subscribe("lcf/scene")
            until_matched(session, "lcf/scene")
            link.put_scene(scene(round_))
            assert len(router.receive("lcf/scene")) == 1
            router.put("lcf/speed", velocity())
            router.get("lcf/query/config")
            assert len(link.take_speeds()) == 1
            router.end()
            link.put_scene(scene())
        assert link.counts == {"scene sent": 5, "speed taken": 2, "query answered": 2}
        link.close()


def test_a_port_in_use_is_reported_with_the_remedy(start: Any, endpoint: str) -> None:
    start(mode="peer", listen__endpoints=[endpoint]).tokens("**")
    with pytest.raises(PublishError) as caught:
        open_session(Zenoh(listen=[endpoint]))
    assert str(caught.value) == (
        f"{endpoint}: already in use; stop the other program or set zenoh.listen to another port"
    )


def test_a_daemon_that_was_killed_leaves_nothing_that_stops_the_next(start: Any, endpoint: str) -> None:
    peer = start(mode="peer", listen__endpoints=[endpoint])
    peer.tokens("**")
    peer.end()  # SIGKILL
    with opened_session(Zenoh(listen=[endpoint])):
        pass


def test_more_sessions_than_a_robot_has_planners_are_refused_and_those_that_are_there_stay(
    session: zenoh.Session, peer: Any, endpoint: str, until_matched: Any, scene: NewScene
) -> None:
    link = Link(session, Config())
    peer.subscribe("lcf/scene")
    until_matched(session, "lcf/scene")
    opened: list[zenoh.Session] = []

    def open_many() -> None:
        while len(opened) < 40:
            opened.append(open_session(Zenoh(mode="client", connect=[endpoint], listen=[])))

    with pytest.raises(PublishError):
        open_many()
    assert 20 < len(opened) < 40
    link.put_scene(scene())
    assert len(peer.receive("lcf/scene")) == 1
    for one in opened:
        one.close()
    link.close()


def test_a_thousand_queries_at_once_cost_those_who_ask(
    session: zenoh.Session, peer: Any, until_matched: Any, scene: NewScene
) -> None:
    link = Link(session, Config())
    peer.subscribe("lcf/scene")
    until_matched(session, "lcf/scene")
    link.put_scene(scene())
    peer.ask("flood", key="lcf/query/*", count=1000)
    link.put_scene(scene())
    assert len(peer.receive("lcf/scene", 2)) == 2
    names = 3  # that are meant by one query
    assert link.counts["query answered"] > 0
    assert link.counts["query answered"] + names * link.counts["query overtaken"] == names * 1000
    link.close()
