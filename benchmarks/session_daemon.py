"""`lcf-edge` with a drive in place of devices: ``python -m benchmarks.session_daemon FOLDER run|record [OPTION ...]``.

FOLDER holds ``images.raw``, one after the other, ``imu.raw``, ``speed.raw`` and ``size.json``, as ``session.save``
writes them.
The devices read no more than a driver does: an image comes out of a file, as it would out of the driver's buffer, and
is decoded by nobody. At the end it prints the processor time, s, that reading took.
"""

import json
import os
import sys
import time
import types
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.cli import command_line

MAX_WAIT_S = 0.25


class Drive:
    """The drive in a loop; all devices share its time. ``read_s``: processor time of reading images."""

    def __init__(self, folder: Path) -> None:
        size = json.loads((folder / "size.json").read_text("utf-8"))
        self.shape = size["height"], size["width"]
        self.lap_ns = round(1e9 * size["seconds"])
        self.images_file = os.open(folder / "images.raw", os.O_RDONLY)
        self.count = size["count"]
        self.imu = np.fromfile(folder / "imu.raw").reshape(-1, 7)  # np.load would take memory that no vehicle needs
        self.speed = np.fromfile(folder / "speed.raw").reshape(-1, 3)
        self.start_ns = time.monotonic_ns()
        self.read_s = 0.0


class Device(ABC):
    """Records at times, s, of each lap."""

    def __init__(self, drive: Drive, times_s: Sequence[float]) -> None:
        self.name = "stand-in"
        self.counts: Counter[str] = Counter()
        self.drive = drive
        self._times_ns = [round(1e9 * time_s) for time_s in times_s]
        self._next = 0
        now_ns = time.monotonic_ns()
        while self._due_ns() < now_ns:
            self._next += 1

    def _due_ns(self) -> int:
        lap, k = divmod(self._next, len(self._times_ns))
        return self.drive.start_ns + lap * self.drive.lap_ns + self._times_ns[k]

    def read(self) -> list[Any]:
        """What is due next, at its time; nothing after ``MAX_WAIT_S``."""
        due_ns = self._due_ns()
        wait_s = (due_ns - time.monotonic_ns()) / 1e9
        time.sleep(min(max(wait_s, 0.0), MAX_WAIT_S))
        if wait_s > MAX_WAIT_S:
            return []
        self._next += 1
        return [self.record(due_ns, self._next - 1)]

    @abstractmethod
    def record(self, stamp_ns: int, number: int) -> Any:
        """The record of a number."""

    def close(self) -> None:  # noqa: B027  # nothing is held, whatever it records
        """Nothing is held."""


class Camera(Device):
    """Its stamp is the moment from which on the image can be read."""

    def __init__(self, drive: Drive) -> None:
        super().__init__(drive, [k * drive.lap_ns / 1e9 / drive.count for k in range(drive.count)])

    def record(self, stamp_ns: int, number: int) -> Frame:
        """An image."""
        before = time.thread_time()
        image = np.empty(self.drive.shape, np.uint8)
        os.preadv(self.drive.images_file, [image], number % self.drive.count * image.nbytes)
        self.drive.read_s += time.thread_time() - before
        return Frame(stamp_ns, number, image)


class Imu(Device):
    """At 200 Hz."""

    def __init__(self, drive: Drive) -> None:
        super().__init__(drive, drive.imu[:, 0].tolist())

    def record(self, stamp_ns: int, number: int) -> ImuSample:
        """A sample."""
        _, *values = self.drive.imu[number % len(self.drive.imu)].tolist()
        return ImuSample(stamp_ns, tuple(values[:3]), tuple(values[3:]))


class Speed(Device):
    """At 50 Hz."""

    def __init__(self, drive: Drive) -> None:
        super().__init__(drive, drive.speed[:, 0].tolist())

    def record(self, stamp_ns: int, number: int) -> SpeedSample:
        """A speed."""
        _, speed_mps, yaw_rate_radps = self.drive.speed[number % len(self.drive.speed)].tolist()
        return SpeedSample(stamp_ns, speed_mps, yaw_rate_radps)


def main(argv: Sequence[str]) -> NoReturn:
    """Run until a signal ends it."""
    folder, *command = argv
    drive = Drive(Path(folder))
    stand_ins = types.ModuleType("lcf_edge.recording.playback")  # the real one reads all formats, which takes memory
    vars(stand_ins).update(
        RecordedCamera=lambda *_: Camera(drive),
        RecordedImu=lambda *_: Imu(drive),
        RecordedSpeed=lambda *_: Speed(drive),
    )
    sys.modules["lcf_edge.recording.playback"] = stand_ins
    try:
        command_line.program(command)
    finally:
        sys.stdout.write(f"{drive.read_s}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
