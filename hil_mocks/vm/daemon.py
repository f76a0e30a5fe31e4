"""The installed service as its user and its subscribers see it, from outside."""

import threading
from collections.abc import Callable, Mapping
from pathlib import Path

import zenoh

from hil_mocks.vm.machine import Machine, MachineError
from lcf_edge.cdr import decode_diagnostics, decode_scene
from lcf_edge.config import Zenoh
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.messages import Scene
from lcf_edge.zenoh_link import close_session, open_session

CONFIGURATION = "/etc/lcf-edge/config.toml"
WEBCAM = """[camera]
device = "/dev/video0"
width = 320
height = 180
fps = 5.0

[filter]
corners_target = 150
"""  # light enough for a processor that is emulated
LISTENS = '\n[zenoh]\nlisten = ["tcp/0.0.0.0:7447"]\n'
DEFAULT_SETTINGS = WEBCAM + LISTENS
UNIT = "lcf-edge"
STATE = "/var/lib/private/lcf-edge"
PATIENCE_S = 150.0


class Subscriber:
    """Scenes and diagnostics of the daemon, on the host. ``patience``: the machine's."""

    def __init__(self, endpoint: str, patience: float, config_file: str = "") -> None:
        self.scenes: list[Scene] = []
        self.statuses: Mapping[str, DeviceStatus] = {}
        self._patience = patience
        self._changed = threading.Condition()
        self._session = open_session(Zenoh(connect=[endpoint], listen=[], config_file=config_file))
        self._session.declare_subscriber("lcf/scene", self._take_scene)
        self._session.declare_subscriber("lcf/diagnostics", self._take_diagnostics)

    def wait_for(self, happened: Callable[[], object], what: str, timeout_s: float = PATIENCE_S) -> None:
        """Look at everything that comes until ``happened``. Raises ``MachineError``."""
        timeout_s *= self._patience
        with self._changed:
            if not self._changed.wait_for(lambda: bool(happened()), timeout_s):
                known = "; ".join(f"{one.name}: {one.message} {dict(one.values)}" for one in self.statuses.values())
                raise MachineError(f"not within {timeout_s:g} s: {what}; {len(self.scenes)} scenes; {known}")

    def wait_for_scenes(self, number: int = 5) -> None:
        """Wait until so many more have come."""
        wanted = len(self.scenes) + number
        self.wait_for(lambda: len(self.scenes) >= wanted, f"{number} scenes")

    def wait_for_status(self, name: str, text: str, timeout_s: float = PATIENCE_S) -> None:
        """Wait until a part's message has that in it."""
        self.wait_for(lambda: text in self.message(name), f"{name}: {text}", timeout_s)

    def wait_for_count(self, name: str, what: str, least: int = 1) -> None:
        """Wait until a part has counted that often."""
        self.wait_for(lambda: self.count(name, what) >= least, f"{name} {what} >= {least}")

    def message(self, name: str) -> str:
        """What a part says now; empty: nothing yet."""
        return self.statuses[name].message if name in self.statuses else ""

    def count(self, name: str, what: str) -> int:
        """What a part has counted."""
        return int(self.statuses[name].values.get(what, 0)) if name in self.statuses else 0

    def close(self) -> None:
        """Listen no more."""
        close_session(self._session)

    def _take_scene(self, sample: zenoh.Sample) -> None:
        scene = decode_scene(sample.payload.to_bytes())
        with self._changed:
            self.scenes.append(scene)
            self._changed.notify_all()

    def _take_diagnostics(self, sample: zenoh.Sample) -> None:
        array = decode_diagnostics(sample.payload.to_bytes())
        with self._changed:
            self.statuses = {status.name: status for status in array.status}
            self._changed.notify_all()


class Daemon:
    """The unit ``lcf-edge`` in the machine."""

    def __init__(self, machine: Machine, subscriber: Subscriber) -> None:
        self.machine = machine
        self.subscriber = subscriber

    def configure(self, config: str) -> None:
        """Replace the configuration in one step."""
        (self.machine.share / "config.toml").write_text(config, encoding="utf-8")
        self.machine.run(f"cp /mnt/config.toml {CONFIGURATION}.new && mv {CONFIGURATION}.new {CONFIGURATION}")

    def start(self, config: str) -> None:
        """Start it anew. Return when it is ready. Raises ``MachineError``."""
        self.configure(config)
        self.subscriber.statuses = {}
        self.machine.run(f"systemctl reset-failed {UNIT}; systemctl restart {UNIT}", PATIENCE_S)

    def stop(self) -> None:
        """Stop it."""
        self.machine.run(f"systemctl stop {UNIT}")

    def show(self, name: str) -> str:
        """A property of the unit."""
        return self.machine.run(f"systemctl show {UNIT} --property={name} --value")

    @property
    def pid(self) -> int:
        """Its main process; 0: none."""
        return int(self.show("MainPID"))

    @property
    def restarts(self) -> int:
        """How often systemd started it anew by itself."""
        return int(self.show("NRestarts"))

    def wait_for_restart(self, restarts: int) -> None:
        """Wait until it was started anew more often than that, and is ready."""
        shown = f"systemctl show {UNIT} --value --property"
        self.machine.wait_until(
            f"test $({shown}=NRestarts) -gt {restarts} -a $({shown}=ActiveState) = active", PATIENCE_S
        )


def write_lines(path: Path, rows: list[list[float]]) -> None:
    """Rows of numbers, separated by commas."""
    path.write_text("\n".join(",".join(f"{value:.6f}" for value in row) for row in rows) + "\n", encoding="ascii")
