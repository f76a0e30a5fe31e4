"""`lcf-edge run` in a vehicle in a rendered world: ``python -m hil_mocks.closed_loop.live SEED [OPTION ...]``.

Wanted speeds, m/s, are read from standard input, one a line; a planner in another process writes them. At the end of
the drive the daemon ends, and the outcome is written to standard output as JSON. The world runs in real time if the
computer is fast enough; else its time, and that of the stamps, passes more slowly.
"""

import os
import signal
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from typing import NoReturn

import msgspec

from drivers.samples import Frame, ImuSample, SpeedSample
from hil_mocks.closed_loop import worlds
from hil_mocks.closed_loop.loop import Log, Moment, drive
from hil_mocks.closed_loop.world import World
from lcf_edge.cli import command_line
from lcf_edge.recording import playback
from lcf_edge.rendered.drives import START_NS, Lens

LENS = Lens(320, 240, 250.0)
WAIT_S = 0.25  # of one read
_HELD = 1024  # records of a kind that wait for their reader

Item = Frame | ImuSample | SpeedSample


def world_of(seed: int) -> World:
    """The world of a seed with small images, which a busy computer can render in time; it starts at rest."""
    return worlds.make(seed, lens=LENS, start_mps=0.0)


class LiveDriver:
    """Passes images and samples to the devices, and drives at the newest commanded speed."""

    def __init__(self, fps: float) -> None:
        self.target_mps = 0.0
        self._interval_s = 1 / fps
        self._due_ns = time.monotonic_ns()
        self.offset_ns = self._due_ns - START_NS  # from the world's stamps to the computer's
        self._waiting: dict[type, deque[Item]] = {kind: deque(maxlen=_HELD) for kind in (Frame, ImuSample, SpeedSample)}
        self._came = threading.Condition()

    def decide(self, moment: Moment) -> float:
        """The speed that is wanted when the next image is due, m/s."""
        assert moment.frame is not None
        with self._came:
            for item in (*moment.samples, moment.frame):
                self._waiting[type(item)].append(replace(item, stamp_ns=item.stamp_ns + self.offset_ns))
            self._came.notify_all()
        now_ns = time.monotonic_ns()
        self._due_ns = max(self._due_ns + round(self._interval_s * 1e9), now_ns)
        time.sleep((self._due_ns - now_ns) * 1e-9)
        return self.target_mps

    def obey(self, line: str) -> None:
        """Take a line from the planner; ignore what is no speed."""
        try:
            speed = float(line)
        except ValueError:
            return
        if isfinite(speed):
            self.target_mps = speed

    def come(self, kind: type) -> list[Item]:
        """Return the records of a kind since the last call; waits briefly for one."""
        with self._came:
            self._came.wait_for(lambda: bool(self._waiting[kind]), WAIT_S)
            found = list(self._waiting[kind])
            self._waiting[kind].clear()
        return found


class _Device:
    """One kind of what the driver hands on, as a device."""

    def __init__(self, live: LiveDriver, kind: type) -> None:
        self.name, self.counts = "rendered world", Counter[str]()
        self._live, self._kind = live, kind

    def read(self) -> Sequence[Item]:
        """Return new records; of images the newest."""
        found = self._live.come(self._kind)
        return found[-1:] if self._kind is Frame else found

    def close(self) -> None:
        """Nothing is held."""


def main(argv: Sequence[str]) -> NoReturn:
    """Run until the drive is over."""
    seed, *options = argv
    world = world_of(int(seed))
    live = LiveDriver(world.fps)
    logs: list[Log] = []

    def ride() -> None:
        logs.append(drive(world, live))
        os.kill(os.getpid(), signal.SIGTERM)

    def listen() -> None:
        for line in sys.stdin:
            live.obey(line)

    vars(playback).update(
        RecordedCamera=lambda *_: _Device(live, Frame),
        RecordedImu=lambda *_: _Device(live, ImuSample),
        RecordedSpeed=lambda *_: _Device(live, SpeedSample),
    )
    for work in (listen, ride):
        threading.Thread(target=work, daemon=True).start()
    try:
        command_line.program(["run", *options])
    finally:
        for log in logs:
            sys.stdout.write(msgspec.json.encode(log).decode() + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
