"""``python -m hil_mocks.siege``: run the siege, and report the results."""

import argparse
import socket
import sys
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import zenoh

from hil_mocks.siege.attacks import (
    CLIENT_HELLO,
    HALF_A_REQUEST,
    HTTP,
    Attack,
    Strangers,
    WildImu,
    declarer,
    flood,
    frames,
    liar,
    page_is_served,
    pause,
    reloads,
    wild,
)
from hil_mocks.siege.place import Process, certificates, planner_settings, rover_settings
from lcf_edge.cdr import decode_diagnostics, decode_scene
from lcf_edge.config import Camera, Config, Imu, Memory, Metrics, Vehicle, Zenoh, to_toml
from lcf_edge.errors import LcfError
from lcf_edge.rendered import scenes
from lcf_edge.zenoh_link import opened_session
from lcf_edge.zenoh_link.diagnostics import DIAGNOSTICS
from lcf_edge.zenoh_link.scene import SCENE
from lcf_edge.zenoh_link.subscription import reading_from

FPS = 15.0
WARM_S = 4.0
PAUSE_S = 2.0
PATIENCE_S = 30.0
BUDGET_MIB = 120.0  # the stand-in's images are in it
BEYOND_MIB = 10.0  # the budget, for a moment
MIN_SHARE = 0.9  # of the frames, where the attackers have processors of their own
LET_IN_S = 2.0
MAX_DESCRIPTORS = {"daemon": 200, "gate": 200, "page": 230}
MAX_LINES = 300  # of one log


@dataclass
class Figures:
    """Measurements during the siege."""

    waves: dict[str, int] = field(default_factory=dict)
    let_in_s: list[float] = field(default_factory=list)  # of planners
    descriptors: dict[str, int] = field(default_factory=dict)  # most
    memory_mib: float = 0.0  # of the daemon, most
    frames_share: float = 0.0  # of the images that the camera made
    excess_bytes: int = 0  # of the wild IMU, that the daemon dropped
    pages: int = 0
    complaints: list[str] = field(default_factory=list)

    def lines(self) -> list[str]:
        """The report."""
        return [
            "waves: " + ", ".join(f"{name} {number}" for name, number in self.waves.items()),
            f"planners: {len(self.let_in_s)} let in, the last after {max(self.let_in_s, default=0):.2f} s at most",
            "descriptors, most: " + ", ".join(f"{name} {number}" for name, number in self.descriptors.items()),
            f"memory of the daemon: {self.memory_mib:.0f} MiB at most, of a budget of {BUDGET_MIB:g}",
            f"frames: {self.frames_share:.0%} of the camera's; pages served: {self.pages}",
            f"the wild IMU: {self.excess_bytes / 1e6:.1f} MB dropped and counted",
        ]

    def judge(self, min_share: float) -> None:
        """Add a complaint for each violation; of frames, if fewer than ``min_share`` were received."""
        for complaint, wrong in (
            (
                f"a planner was let in after {max(self.let_in_s, default=0):.1f} s",
                max(self.let_in_s, default=0) > LET_IN_S,
            ),
            ("no planner was let in", not self.let_in_s),
            ("no page was served", not self.pages),
            ("nothing of the wild IMU was dropped", not self.excess_bytes),
            (f"the daemon took {self.memory_mib:.0f} MiB", self.memory_mib > BUDGET_MIB + BEYOND_MIB),
            (f"only {self.frames_share:.0%} of the frames", self.frames_share < min_share),
        ):
            if wrong:
                self.complaints.append(complaint)
        for name, number in self.descriptors.items():
            if number > MAX_DESCRIPTORS[name]:
                self.complaints.append(f"{name}: {number} descriptors")


def free_ports(count: int) -> list[int]:
    """Return free TCP ports on loopback."""
    probes = [socket.socket() for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def besiege(seconds: float, folder: Path, min_share: float = MIN_SHARE) -> Figures:
    """For so long. Raises ``LcfError`` where it cannot begin."""
    local, inner, outer, page_port, metrics_port = free_ports(5)
    certificates(folder / "tls")
    drive = scenes.write(
        scenes.make("crossing", 3, seconds=4.0, fps=FPS, width=320, height=240, focal_px=250.0), folder
    )
    config = Config(
        camera=Camera(driver="recording", recording=str(drive), width=320, height=240, fps=FPS),
        imu=Imu(driver="csv", port=str(folder / "imu")),
        vehicle=Vehicle(speed_source="zenoh"),
        memory=Memory(budget_mib=BUDGET_MIB),
        metrics=Metrics(port=metrics_port),
        zenoh=Zenoh(
            listen=[f"tcp/127.0.0.1:{local}", f"tls/127.0.0.1:{inner}"],
            config_file=str(rover_settings(folder / "tls")),
        ),
    )
    file = folder / "config.toml"
    file.write_text(to_toml(config), encoding="utf-8")
    wild_imu = WildImu("wild IMU", folder / "imu")
    processes = [
        Process("daemon", folder, "run", "-c", str(file)),
        Process("gate", folder, "gate", "--tls", str(folder / "tls"), "--listen", "127.0.0.1", "--port", str(outer),
                "--to", str(inner)),
        Process("page", folder, "view", "--connect", f"tcp/127.0.0.1:{local}", "--port", str(page_port)),
    ]  # fmt: skip
    attacks = [
        Strangers("nonsense at the gate", 0.01, outer, HTTP),
        Strangers("silence at the gate", 0.02, outer, b""),
        Strangers("half a handshake", 0.02, outer, CLIENT_HELLO),
        Strangers("silence at the local port", 0.02, local, b""),
        Strangers("nonsense at the local port", 0.02, local, HTTP),
        Strangers("slow page", 0.02, page_port, HALF_A_REQUEST),
        Strangers("slow metrics", 0.1, metrics_port, HALF_A_REQUEST),
        Attack("wrong frames", 0.1, frames(page_port)),
        Attack("liar", 0.5, liar(f"tcp/127.0.0.1:{local}")),
        Attack("declarer", 1.0, declarer(f"tcp/127.0.0.1:{local}")),
        Attack("wild keys", 0.5, wild(f"tls/localhost:{outer}", str(planner_settings(folder / "tls")))),
        Attack("wild keys at the local port", 0.5, wild(f"tcp/127.0.0.1:{local}")),
        Attack("flood", 0.5, flood(f"tcp/127.0.0.1:{local}")),
        Attack("reload", 1.0, reloads(file, to_toml(config))),
        wild_imu,
    ]
    figures = Figures()
    try:
        planner = str(planner_settings(folder / "tls"))
        wait_for_planner(f"tls/localhost:{outer}", planner, PATIENCE_S)
        time.sleep(WARM_S)
        watched(figures, processes, attacks, seconds, outer, page_port, planner, local)
    finally:
        for attack in attacks:
            if attack.ident is not None:
                attack.end()
        for process in processes:
            alive = process.status is None
            status = process.end()
            if not alive or status != 0:
                figures.complaints.append(f"{process.name}: ended with status {status}: {(process.said or [''])[-1]}")
            if any("Traceback" in line for line in process.said) or len(process.said) > MAX_LINES:
                figures.complaints.append(f"{process.name}: {len(process.said)} lines in its log, or a traceback")
    figures.judge(min_share)
    return figures


def watched(
    figures: Figures,
    processes: Sequence[Process],
    attacks: Sequence[Attack],
    seconds: float,
    outer: int,
    page_port: int,
    planner: str,
    local: int,
) -> None:
    """Attack, and look once a second."""
    daemon = processes[0]
    for attack in attacks:
        attack.start()
    with opened_session(reading_from(f"tls/localhost:{outer}", planner)) as session:
        received: list[int] = []  # numbers of images

        def count(sample: zenoh.Sample) -> None:
            received.append(decode_scene(SCENE.payload(sample)).seq)

        def look(sample: zenoh.Sample) -> None:
            for status in decode_diagnostics(DIAGNOSTICS.payload(sample)).status:
                figures.excess_bytes = max(int(status.values.get("excess_bytes", "0")), figures.excess_bytes)

        subscribers = [
            session.declare_subscriber(f"lcf/{key}", take) for key, take in (("scene", count), ("diagnostics", look))
        ]
        while not received:
            time.sleep(0.01)
        del received[:]
        begin_s, paused_s = time.monotonic(), 0.0
        while time.monotonic() < begin_s + seconds:
            if not paused_s and time.monotonic() > begin_s + seconds / 2:
                pause(daemon.pid, PAUSE_S)
                paused_s = PAUSE_S
            for endpoint, settings in ((f"tls/localhost:{outer}", planner), (f"tcp/127.0.0.1:{local}", "")):
                figures.let_in_s.append(wait_for_planner(endpoint, settings, PATIENCE_S))
            with suppress(OSError):
                figures.pages += page_is_served(page_port)
            if any(process.status is not None for process in processes):
                return
            for process in processes:
                most = max(process.descriptors, figures.descriptors.get(process.name, 0))
                figures.descriptors[process.name] = most
            figures.memory_mib = max(figures.memory_mib, daemon.resident_mib)
            time.sleep(0.5)
        if received:
            figures.frames_share = len(received) / (received[-1] - received[0] + 1 - FPS * paused_s)
        for subscriber in subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]
    figures.waves = {attack.name: attack.waves for attack in attacks}


def wait_for_planner(endpoint: str, settings: str, patience_s: float) -> float:
    """Return how long a planner takes from its start to the first scene, s. Raises ``LcfError``."""
    came = threading.Event()
    begin_s = time.monotonic()
    with opened_session(reading_from(endpoint, settings)) as session:
        subscriber = session.declare_subscriber("lcf/scene", lambda _: came.set())
        if not came.wait(patience_s):
            raise LcfError(f"siege: no scene comes to a planner within {patience_s:g} s")
        took_s = time.monotonic() - begin_s
        subscriber.undeclare()  # type: ignore[no-untyped-call]
    return took_s


def main(argv: Sequence[str] | None = None) -> int:
    """Besiege, and report."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_mocks.siege",
        description="The daemon, its gate and its page under attack, on loopback.",
        allow_abbrev=False,
    )
    parser.add_argument("--seconds", type=float, default=60.0, metavar="N", help="of the siege (%(default)g)")
    parser.add_argument(
        "--least-share",
        dest="min_share",
        type=float,
        default=MIN_SHARE,
        metavar="SHARE",
        help="of the frames (%(default)g); less where daemon and attackers share two processors",
    )
    arguments = parser.parse_args(argv)
    with TemporaryDirectory(prefix="lcf-edge-siege-") as folder:
        try:
            figures = besiege(arguments.seconds, Path(folder), arguments.min_share)
        except LcfError as error:
            sys.stderr.write(f"{error}\n")
            return error.exit_status
        except KeyboardInterrupt:
            return 130
    sys.stdout.writelines(f"{line}\n" for line in figures.lines())
    sys.stderr.writelines(f"siege: {complaint}\n" for complaint in figures.complaints)
    return 1 if figures.complaints else 0


if __name__ == "__main__":
    sys.exit(main())
