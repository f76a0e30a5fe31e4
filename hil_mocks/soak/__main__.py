"""``python -m hil_mocks.soak``: starts the daemon, ends it and starts it again, and reports."""

import argparse
import queue
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import zenoh

from hil_mocks.soak.figures import Life, Parts, complaints, lines
from hil_mocks.soak.stand_ins import save
from lcf_edge.cdr import decode_diagnostics
from lcf_edge.config import Camera, Config, Imu, Memory, Vehicle, to_toml
from lcf_edge.config import Zenoh as ZenohKeys
from lcf_edge.errors import LcfError
from lcf_edge.rendered import scenes
from lcf_edge.zenoh_link import opened_session

KINDS = ("crossing", "passing", "two_crossing", "oncoming")  # of drives, in turn
SILENT_S = 60.0  # without diagnostics: the daemon is stuck, or gone
SETTLED = 3  # seconds with constant counters: no image is on its way
RELOAD_EACH_S = 20.0  # on average
LOOK_EACH_S = 15.0
ENDS_WITHIN_S = 10.0
BUDGET_MIB = 192.0  # the drive's images are in it


class SoakError(LcfError):
    """The daemon misbehaved."""


class Daemon:
    """A running daemon; ``diagnostics`` come as it publishes them, ``received`` counts its scenes."""

    def __init__(self, drive: Path, folder: Path, seed: int, endpoint: str, session: zenoh.Session) -> None:
        self.config = folder / "config.toml"
        self.log = folder / "log.txt"
        self.received = 0
        self.random = Random(seed)
        self._folder = folder
        self._drive, self._endpoint = drive, endpoint
        self._session = session
        self._preview: zenoh.Subscriber[None] | None = None
        self._diagnostics: queue.SimpleQueue[Parts] = queue.SimpleQueue()
        self._subscribers = [
            session.declare_subscriber("lcf/diagnostics", self._take),
            session.declare_subscriber("lcf/scene", self._count),
        ]
        self.configure(0.3)
        command = (sys.executable, "-m", "hil_mocks.soak.daemon", drive, str(seed), "-c", self.config)
        with self.log.open("wb") as log:
            self._process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def configure(self, height_m: float) -> None:
        """Write the configuration, which the daemon notices by itself."""
        config = Config(
            camera=Camera(
                driver="recording", recording=str(self._drive), intrinsics=[500, 500, 319.5, 239.5], height_m=height_m
            ),
            imu=Imu(driver="recording"),
            vehicle=Vehicle(speed_source="odometry"),
            memory=Memory(budget_mib=BUDGET_MIB),
            zenoh=ZenohKeys(listen=[self._endpoint]),
        )
        self._replace(to_toml(config))

    def spoil_configuration(self) -> None:
        """Write one that is refused."""
        self._replace("nonsense = 1\n")

    def _replace(self, text: str) -> None:
        new = self._folder / "new.toml"
        new.write_text(text, encoding="utf-8")
        new.replace(self.config)

    def look(self, *, on: bool) -> None:
        """Subscribe to the preview, or unsubscribe."""
        if on and self._preview is None:
            self._preview = self._session.declare_subscriber("lcf/preview/compressed", lambda _: None)
        elif not on and self._preview is not None:
            self._preview.undeclare()  # type: ignore[no-untyped-call]
            self._preview = None

    def next(self) -> Parts:
        """The next second's diagnostics. Raises ``SoakError``."""
        try:
            return self._diagnostics.get(timeout=SILENT_S)
        except queue.Empty:
            raise SoakError(
                f"the daemon publishes nothing for {SILENT_S:g} s; its log ends with: {self.last_line()}"
            ) from None

    def last_line(self) -> str:
        """The last line of its log."""
        return (self.log.read_text(encoding="utf-8", errors="replace").splitlines() or ["(it is empty)"])[-1]

    def pause(self) -> None:
        """Stop the images, or continue them."""
        self._process.send_signal(signal.SIGUSR1)

    go_on = pause

    def end(self, number: signal.Signals) -> float:
        """End it; how long that took, s. Raises ``SoakError`` when it had ended by itself or ends badly."""
        status = self._process.poll()
        if status is not None:
            raise SoakError(f"the daemon ended by itself with status {status}; its log ends with: {self.last_line()}")
        begin_s = time.monotonic()
        self._process.send_signal(number)
        try:
            status = self._process.wait(ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            raise SoakError(f"{number.name} did not end the daemon within {ENDS_WITHIN_S:g} s") from None
        if status not in {0, -signal.SIGKILL} or "Traceback" in self.log.read_text(encoding="utf-8", errors="replace"):
            raise SoakError(f"the daemon ended with status {status}; its log ends with: {self.last_line()}")
        return time.monotonic() - begin_s

    def close(self) -> None:
        """Clean up."""
        self._process.kill()
        self._process.wait()
        self.look(on=False)
        for subscriber in self._subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]

    def _take(self, sample: zenoh.Sample) -> None:
        array = decode_diagnostics(sample.payload.to_bytes())
        self._diagnostics.put({status.name: status for status in array.status})

    def _count(self, _: zenoh.Sample) -> None:
        self.received += 1


def live(daemon: Daemon, life: Life, frame_limit: int, seconds: float) -> None:
    """One life, until so many images or seconds are over. Raises ``SoakError``."""
    begin_s = time.monotonic()
    daemon.look(on=True)  # what the first look costs belongs to the warm-up
    while life.balance.put < frame_limit and time.monotonic() - begin_s < seconds:
        life.note(daemon.next())
        disturb(daemon)
    life.seconds = time.monotonic() - begin_s
    daemon.pause()
    same = 0
    while same < SETTLED:
        before, known = life.balance, len(life.memory)
        life.note(daemon.next())
        del life.memory[known:]
        same = same + 1 if life.balance == before else 0
    life.received = daemon.received
    daemon.go_on()
    while life.balance.put == before.put:
        settled = life.balance
        life.note(daemon.next())
    life.balance = settled


def disturb(daemon: Daemon) -> None:
    """Now and then, write a new or an invalid configuration, or subscribe or unsubscribe."""
    if daemon.random.random() < 1 / RELOAD_EACH_S:
        daemon.random.choice((daemon.spoil_configuration, lambda: daemon.configure(daemon.random.uniform(0.2, 0.6))))()
    if daemon.random.random() < 1 / LOOK_EACH_S:
        daemon.look(on=daemon.random.random() < 0.5)


def soak(frame_limit: int, seconds: float, lives: int, seed: int, folder: Path) -> list[Life]:
    """Run the daemon that many times, ended in turn by SIGTERM and SIGKILL, with log and memory of each in ``folder``.

    Raises ``LcfError``.
    """
    lived = []
    for number in range(lives):
        place = folder / f"life-{number + 1}"
        place.mkdir(parents=True)
        save(scenes.make(KINDS[number % len(KINDS)], seed + number, seconds=3.0), place / "drive.npz")
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
        life = Life(seed + number)
        lived.append(life)
        with opened_session(ZenohKeys(connect=[endpoint], listen=[])) as session:
            daemon = Daemon(place / "drive.npz", place, life.seed, endpoint, session)
            try:
                live(daemon, life, frame_limit // lives, seconds / lives)
                how = signal.SIGKILL if number % 2 else signal.SIGTERM
                life.end, life.ended_s = how.name, daemon.end(how)
            finally:
                daemon.close()
                rows = (f"{put},{mib}" for put, mib in life.memory)
                (place / "memory.csv").write_text("\n".join(("images,MiB", *rows)) + "\n", encoding="ascii")
    return lived


def main(argv: Sequence[str] | None = None) -> int:
    """Soak, and report."""
    parser = argparse.ArgumentParser(
        prog="python -m hil_mocks.soak", description="The daemon at full speed, with random faults.", allow_abbrev=False
    )
    length = parser.add_mutually_exclusive_group(required=True)
    length.add_argument("--frames", type=_positive, metavar="N", help="images in all")
    length.add_argument("--minutes", type=float, metavar="N", help="time in all")
    parser.add_argument("--lives", type=_positive, default=4, metavar="N", help="runs of the daemon (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the faults (%(default)s)")
    parser.add_argument(
        "--allowed-mib",
        type=float,
        default=1.0,
        metavar="N",
        help="growth of memory in 100,000 images, beyond 3 sigma, that is no failure (%(default)s)",
    )
    parser.add_argument("--logs", type=Path, metavar="DIR", help="keep log and memory of each life here")
    arguments = parser.parse_args(argv)
    frame_limit = arguments.frames or sys.maxsize
    seconds = 60 * arguments.minutes if arguments.minutes else float("inf")
    with TemporaryDirectory(prefix="lcf-edge-soak-") as temporary:
        try:
            lived = soak(frame_limit, seconds, arguments.lives, arguments.seed, Path(temporary))
        except LcfError as error:
            sys.stderr.write(f"soak: {error}\n")
            return error.exit_status
        except KeyboardInterrupt:
            return 130
        finally:
            if arguments.logs:
                keep_logs(Path(temporary), arguments.logs)
    sys.stdout.writelines(f"{line}\n" for line in lines(lived))
    wrong = complaints(lived, arguments.allowed_mib)
    sys.stderr.writelines(f"soak: {complaint}\n" for complaint in wrong)
    return 1 if wrong else 0


def keep_logs(temporary: Path, folder: Path) -> None:
    """Copy the daemon's log, and its memory over its frames."""
    for kept in ("log.txt", "memory.csv"):
        for file in temporary.glob(f"*/{kept}"):
            (folder / file.parent.name).mkdir(parents=True, exist_ok=True)
            shutil.copy(file, folder / file.parent.name)


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise ValueError
    return number


if __name__ == "__main__":
    sys.exit(main())
