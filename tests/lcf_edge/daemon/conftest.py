"""What the daemon is tested with: a drive to replay, a link that keeps what it gets, systemd's end of the socket."""

import select
import socket
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest

from drivers.samples import SpeedSample
from lcf_edge.config import Camera, Config, Imu, Memory
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.messages import Scene
from lcf_edge.rendered import scenes
from tests.emulation import SLOWNESS
from tests.lcf_edge.daemon.process import Process, wait_for

PATIENCE_S = 20.0 * SLOWNESS


class KeptLink:
    """A link that leads nowhere; ``held``: while it is clear, every ``put_scene`` waits."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.scenes: list[Scene] = []
        self.statuses: dict[str, DeviceStatus] = {}
        self.previews: list[tuple[bytes, int]] = []
        self.speeds: list[tuple[int, SpeedSample]] = []
        self.looks = False
        self.closed = 0
        self.charged_mib = 0.0
        self.sessions = 0
        self.max_sessions = 2
        self.config: Config | None = None
        self.held = threading.Event()
        self.held.set()
        self._changed = threading.Condition()

    def put_scene(self, scene: Scene) -> None:
        with self._changed:
            self.scenes.append(scene)
            self._changed.notify_all()
        self.held.wait(PATIENCE_S)

    def put_diagnostics(self, status: Sequence[DeviceStatus], stamp_ns: int) -> None:
        assert stamp_ns > 0
        with self._changed:
            self.statuses = {one.name: one for one in status}
            self._changed.notify_all()

    def has_preview_subscriber(self) -> bool:
        return self.looks

    def put_preview(self, jpeg: bytes, stamp_ns: int) -> None:
        with self._changed:
            self.previews.append((jpeg, stamp_ns))
            self._changed.notify_all()

    def take_speeds(self) -> list[tuple[int, SpeedSample]]:
        speeds, self.speeds = self.speeds, []
        return speeds

    def show_config(self, config: Config) -> None:
        self.config = config

    def charge(self, grown_mib: float) -> None:
        assert grown_mib >= 0

    def cut(self, charge_mib: float) -> int:
        assert charge_mib > 0
        return 0

    def renew(self) -> bool:
        return True

    def close(self) -> None:
        self.closed += 1

    def wait_for(self, happened: Callable[[], object]) -> None:
        """Look at each change until ``happened``."""
        with self._changed:
            assert self._changed.wait_for(lambda: bool(happened()), PATIENCE_S)


class Manager:
    """systemd's end of the notification socket. ``daemon``: the process at the other end, if it is one."""

    def __init__(self, folder: Path) -> None:
        self.daemon: Process | None = None
        self.environment = {"NOTIFY_SOCKET": str(folder / "notify"), "WATCHDOG_USEC": "3000000"}
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(self.environment["NOTIFY_SOCKET"])
        self._socket.settimeout(PATIENCE_S)

    def next(self) -> str:
        """The next message."""
        if self.daemon is not None:
            wait_for(self.daemon, self._look)
        return self._socket.recv(4096).decode()

    def _look(self) -> bool | None:
        """True: there is a message."""
        return bool(select.select([self._socket], [], [], 0)[0]) or None

    def until(self, wanted: str) -> list[str]:
        """Messages up to the first that begins so."""
        messages = [self.next()]
        while not messages[-1].startswith(wanted):
            messages.append(self.next())
        return messages

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def link() -> KeptLink:
    return KeptLink()


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[Manager]:
    manager = Manager(tmp_path)
    yield manager
    manager.close()


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of 1.5 s with IMU and odometry, 320×240 at 20 frames a second."""
    made = scenes.make("crossing", 3, seconds=1.5, fps=20.0, width=320, height=240, focal_px=250.0)
    return scenes.write(made, tmp_path_factory.mktemp("drive"))


@pytest.fixture
def config(drive: Path) -> Config:
    camera = Camera(driver="recording", recording=str(drive), width=320, height=240)
    return Config(
        camera=camera, imu=Imu(driver="recording"), memory=Memory(budget_mib=1000)
    )  # the tests' own are in it
