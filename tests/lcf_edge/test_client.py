"""What a planner in Python gets: scenes as they come, with little else."""

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
import zenoh

from lcf_edge import client
from lcf_edge.config import Publish, Zenoh
from lcf_edge.errors import PublishError
from lcf_edge.messages import CIRCLE, OBJECT, PSI_REGION, Scene
from lcf_edge.zenoh_link import ScenePublisher, opened_session

PATIENCE_S = 20.0


def scene(seq: int) -> Scene:
    circles = np.zeros(3, CIRCLE)
    circles["id"], circles["x"] = np.arange(3), seq
    objects = np.zeros(2, OBJECT)
    objects["id"], objects["range"] = (7, 8), (3.5, np.nan)
    stamp_ns = 1_700_000_000_000_000_000 + seq
    return Scene(stamp_ns, seq, 640, 480, 1.5, circles, np.zeros(1, PSI_REGION), objects=objects)


@pytest.fixture
def session(endpoint: str) -> Iterator[zenoh.Session]:
    with opened_session(Zenoh(listen=[endpoint])) as opened:
        yield opened


@pytest.fixture
def publisher(session: zenoh.Session) -> ScenePublisher:
    return ScenePublisher(session, Publish())


def test_scenes_are_iterated_over(publisher: ScenePublisher, endpoint: str) -> None:
    with closing(client.scenes(endpoint)) as scenes:
        assert publisher.wait_for_subscriber(PATIENCE_S)
        for seq in range(5):
            publisher.put(scene(seq))
        received = [next(scenes) for _ in range(5)]
    assert [one.seq for one in received] == [0, 1, 2, 3, 4]
    assert received[4].circles.tobytes() == scene(4).circles.tobytes()
    assert received[4].objects.tobytes() == scene(4).objects.tobytes()
    assert received[4].vehicle_speed == 1.5


def test_records_look_into_the_payload(publisher: ScenePublisher, endpoint: str) -> None:
    with closing(client.scenes(endpoint)) as scenes:
        assert publisher.wait_for_subscriber(PATIENCE_S)
        publisher.put(scene(0))
        circles, psi, objects = (received := next(scenes)).circles, received.psi, received.objects
    assert not circles.flags.owndata
    assert not circles.flags.writeable
    assert circles.base is not None
    assert np.shares_memory(np.frombuffer(circles.base.obj, np.uint8), circles)
    assert np.shares_memory(np.frombuffer(circles.base.obj, np.uint8), psi)
    assert np.shares_memory(np.frombuffer(circles.base.obj, np.uint8), objects)


def test_what_is_no_scene_is_skipped_and_counted(
    session: zenoh.Session, publisher: ScenePublisher, endpoint: str
) -> None:
    with closing(client.scenes(endpoint)) as scenes:
        assert publisher.wait_for_subscriber(PATIENCE_S)
        for payload in (b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 100, bytes(100_000)[:7]):
            # As fast a lane as that of scenes, which would overtake them.
            session.put(publisher.key, payload, priority=zenoh.Priority.REAL_TIME, express=True)
        publisher.put(scene(6))
        assert next(scenes).seq == 6
        assert scenes.broken == 4


def test_of_scenes_that_wait_the_newest_are_kept(publisher: ScenePublisher, endpoint: str) -> None:
    enough = threading.Event()

    def publish() -> None:
        seq = 0
        while not enough.wait(0.001):
            seq += 1
            publisher.put(scene(seq))

    with closing(client.scenes(endpoint, kept=2)) as scenes, closing(client.scenes(endpoint)) as witness:
        publishing = threading.Thread(target=publish)
        publishing.start()
        try:
            before = next(scenes).seq
            seen = [next(witness).seq for _ in range(50)]
            while seen[-1] < before + 50:
                seen.append(next(witness).seq)
            assert next(scenes).seq > before + 40  # of fifty that came meanwhile the old ones are gone
        finally:
            enough.set()
            publishing.join()


def test_a_wait_ends_with_the_iterator(publisher: ScenePublisher, endpoint: str) -> None:
    scenes = client.scenes(endpoint)
    assert publisher.wait_for_subscriber(PATIENCE_S)
    ended = threading.Thread(target=lambda: list(scenes))
    ended.start()
    scenes.close()
    ended.join(PATIENCE_S)
    assert not ended.is_alive()
    assert list(scenes) == []
    scenes.close()


@pytest.mark.parametrize(
    ("endpoint", "key", "said"),
    [
        ("nonsense", "lcf/scene", "nonsense"),
        ("tcp/127.0.0.1:1", "lcf//scene", "lcf//scene: "),
        ("tcp/127.0.0.1:1", "", "key"),
    ],
)
def test_a_wrong_endpoint_or_key_is_one_line(endpoint: str, key: str, said: str) -> None:
    with pytest.raises(PublishError) as caught:
        client.scenes(endpoint, key)
    assert said in str(caught.value).lower()
    assert "\n" not in str(caught.value)


def test_a_planner_loads_neither_opencv_nor_a_driver() -> None:
    code = "import sys, lcf_edge.client\nprint(*sorted(sys.modules))\n"
    done = subprocess.run((sys.executable, "-c", code), check=True, capture_output=True, text=True)
    modules = done.stdout.split()
    loaded = {name.partition(".")[0] for name in modules}
    assert {"lcf_edge", "numpy", "zenoh"} <= loaded
    assert not loaded & {"cv2", "hil_mocks", "mcap", "smbus2", "serial", "tqdm", "matplotlib"}
    names_of_drivers = {"drivers", "drivers.imu", "drivers.imu.registry"}  # which the configuration may hold
    assert {name for name in modules if name.partition(".")[0] == "drivers"} <= names_of_drivers


@pytest.mark.parametrize("end", ["return", "interrupt"])
def test_a_planner_that_does_not_close_ends_all_the_same(publisher: ScenePublisher, endpoint: str, end: str) -> None:
    code = (
        "import sys, lcf_edge.client\n"
        "for scene in lcf_edge.client.scenes(sys.argv[1]):\n"
        "    print(scene.seq, flush=True)\n"
        "    if sys.argv[2] == 'return': break\n"
    )
    with subprocess.Popen((sys.executable, "-c", code, endpoint, end), stdout=-1, stderr=-1, text=True) as planner:
        assert publisher.wait_for_subscriber(PATIENCE_S)
        publisher.put(scene(3))
        assert planner.stdout
        assert planner.stdout.readline() == "3\n"
        if end == "interrupt":
            planner.send_signal(signal.SIGINT)
        planner.communicate(timeout=PATIENCE_S)
    assert planner.returncode == {"return": 0, "interrupt": -signal.SIGINT}[end]
