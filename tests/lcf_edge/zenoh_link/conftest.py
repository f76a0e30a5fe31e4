"""Sessions on free ports, and other processes that talk to them."""

import base64
import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh
from rosbags.typesys.store import Typestore

from lcf_edge.config import Zenoh
from lcf_edge.messages import CIRCLE, PSI_REGION, Scene
from lcf_edge.zenoh_link import open_session, opened_session

PATIENCE_S = 20.0
QUIET = {"scouting/multicast/enabled": False, "transport/shared_memory/enabled": False, "scouting/delay": 0}


@dataclass(frozen=True)
class Sample:
    """What another process received."""

    key: str
    payload: bytes
    encoding: str
    attachment: bytes
    congestion_control: str
    priority: str
    express: bool


class Peer:
    """A process that runs ``peer.py``."""

    def __init__(self, settings: dict[str, Any]) -> None:
        command = (sys.executable, str(Path(__file__).with_name("peer.py")), json.dumps({**QUIET, **settings}))
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, do: str, **request: Any) -> Any:
        self.tell(do, **request)
        assert self.process.stdout
        return json.loads(self.process.stdout.readline())

    def tell(self, do: str, **request: Any) -> None:
        """And wait for nothing."""
        assert self.process.stdin
        self.process.stdin.write(json.dumps({"do": do, **request}) + "\n")
        self.process.stdin.flush()

    def subscribe(self, key: str) -> None:
        self.ask("subscribe", key=key)

    def receive(self, key: str, count: int = 1, timeout_s: float = PATIENCE_S) -> list[Sample]:
        return [sample(one) for one in self.ask("receive", key=key, count=count, timeout_s=timeout_s)]

    def put(self, key: str, payload: bytes, encoding: str = "zenoh/bytes", count: int = 1) -> None:
        """And wait until it was received: what is asked on the same connection is answered after it."""
        text = base64.b64encode(payload).decode()
        assert self.ask("put", key=key, payload=text, encoding=encoding, count=count)

    def get(self, key: str, timeout_s: float = PATIENCE_S) -> list[Sample | str]:
        replies = self.ask("get", key=key, timeout_s=timeout_s)
        return [one["error"] if "error" in one else sample(one) for one in replies]

    def tokens(self, key: str) -> list[str]:
        return list(self.ask("tokens", key=key))

    def freeze(self) -> None:
        os.kill(self.process.pid, signal.SIGSTOP)
        os.waitid(os.P_PID, self.process.pid, os.WSTOPPED | os.WNOWAIT)

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


def sample(described: dict[str, Any]) -> Sample:
    binary = {name: base64.b64decode(described[name]) for name in ("payload", "attachment")}
    return Sample(**(described | binary))


@pytest.fixture
def session(endpoint: str) -> Iterator[zenoh.Session]:
    with opened_session(Zenoh(listen=[endpoint])) as opened:
        yield opened


@pytest.fixture
def unattended() -> zenoh.Session:
    """A session that the test closes."""
    return open_session(Zenoh(listen=[]))


@pytest.fixture
def start() -> Iterator[Callable[..., Peer]]:
    """Starts another process with a Zenoh configuration; it is ended with the test."""
    with ExitStack() as peers:

        def begin(**settings: Any) -> Peer:
            peer = Peer({key.replace("__", "/"): value for key, value in settings.items()})
            peers.callback(peer.end)
            return peer

        yield begin


@pytest.fixture
def peer(start: Callable[..., Peer], endpoint: str, session: zenoh.Session) -> Peer:
    """One that is connected to the session."""
    assert session
    return start(mode="client", connect__endpoints=[endpoint])


@pytest.fixture(scope="session")
def until_matched() -> Callable[[zenoh.Session, str], None]:
    """Waits until somebody subscribes to what a session publishes."""

    def wait(session: zenoh.Session, key: str) -> None:
        matched = threading.Event()
        publisher = session.declare_publisher(key)
        with publisher.declare_matching_listener(lambda status: matched.set() if status.matching else None):
            assert publisher.matching_status.matching or matched.wait(PATIENCE_S)
        publisher.undeclare()

    return wait


@pytest.fixture(scope="session")
def scene() -> Callable[..., Scene]:
    def make(seq: int = 0, circles: int = 3) -> Scene:
        rows = np.zeros(circles, CIRCLE)
        rows["id"], rows["x"], rows["ttc"] = np.arange(circles), seq, np.inf
        return Scene(1_700_000_000_000_000_000 + seq, seq, 640, 480, 1.5, rows, np.zeros(1, PSI_REGION))

    return make


@pytest.fixture(scope="session")
def velocity(ros: Typestore) -> Callable[..., bytes]:
    """A message about the vehicle's speed, written by another implementation."""

    def vector(x: float, y: float, z: float) -> Any:
        return ros.types["geometry_msgs/msg/Vector3"](x=x, y=y, z=z)

    def write(
        speed_mps: float = 1.5,
        yaw_rate_radps: float = 0.25,
        *,
        kind: str = "nav_msgs/msg/Odometry",
        stamp_ns: int | None = None,
        little_endian: bool = True,
    ) -> bytes:
        types = ros.types
        sec, nanosec = divmod(time.time_ns() if stamp_ns is None else stamp_ns, 10**9)
        stamp = types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="odom")
        linear, angular = vector(speed_mps, 0.0, 0.0), vector(0.0, 0.0, yaw_rate_radps)
        twist = types["geometry_msgs/msg/Twist"](linear=linear, angular=angular)
        if kind == "nav_msgs/msg/Odometry":
            pose = types["geometry_msgs/msg/Pose"](
                position=types["geometry_msgs/msg/Point"](x=1.0, y=2.0, z=0.0),
                orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
            )
            covariance = np.zeros(36)
            message = types[kind](
                header=header,
                child_frame_id="base_link",
                pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=covariance),
                twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=covariance),
            )
        else:
            message = types[kind](header=header, twist=twist)
        return bytes(ros.serialize_cdr(message, kind, little_endian=little_endian))

    return write


@contextmanager
def _without_camera(endpoint: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    chosen = (f'zenoh.listen=["{endpoint}"]', "camera.device=/dev/no-such-camera", *options)
    command = [sys.executable, "-m", "lcf_edge", "run", *(part for option in chosen for part in ("--set", option))]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    assert process.stderr
    assert next(line for line in process.stderr if "ready" in line)
    yield process
    process.terminate()
    _, said = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0
    assert "Traceback" not in said


@pytest.fixture
def without_camera(endpoint: str) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start a daemon that has no camera, with options, at ``endpoint``; at the end it must go in good order."""
    with ExitStack() as daemons:
        yield lambda *options: daemons.enter_context(_without_camera(endpoint, *options))


@pytest.fixture
def resident_mib() -> Callable[[subprocess.Popen[str]], float]:
    """Resident memory of a process, MiB."""
    page = os.sysconf("SC_PAGE_SIZE")
    return lambda process: int(Path(f"/proc/{process.pid}/statm").read_text().split()[1]) * page / 2**20
