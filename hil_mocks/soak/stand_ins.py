"""Camera, IMU and odometry of one looped drive, as fast as the daemon takes its images.

The drive's own time runs: stamps are those of a vehicle in real time, only that they come sooner. Whoever knows that a
image became a scene calls ``Feed.taken``, and the next one comes. Faults come at random, from a seed.
"""

import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import count
from pathlib import Path
from random import Random
from typing import Literal

import numpy as np
import numpy.typing as npt

from drivers.errors import DeviceLostError, DeviceMissingError
from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.rendered import scenes
from lcf_edge.rendered.drives import stamp_ns

WAIT_S = 0.25  # of one read
CAMERA_FAULT_EACH = 1500  # images, on average
SAMPLES_FAULT_EACH = 3000  # reads of IMU or odometry, on average
MAX_FAULT = 40  # images

Table = npt.NDArray[np.float64]
CameraFault = Literal["unplugged", "dropped", "burst", "dark", "noise", "leap"]
CAMERA_FAULTS: tuple[CameraFault, ...] = ("unplugged", "dropped", "burst", "dark", "noise", "leap")
SAMPLE_FAULTS = ("unplugged", "wild", "gap", "again")


def save(drive: scenes.Drive, path: Path) -> None:
    """Render a drive into one file (npz): images, and samples with their time from the first image, s."""
    start_ns = stamp_ns(0.0)
    frames = [frame for frame, _ in scenes.frames(drive)]
    np.savez(
        path,
        images=np.stack([frame.image for frame in frames]),
        imu=np.array([((one.stamp_ns - start_ns) / 1e9, *one.gyro, *one.accel) for one in scenes.imu(drive)]),
        speed=np.array(
            [((one.stamp_ns - start_ns) / 1e9, one.speed_mps, one.yaw_rate_radps) for one in scenes.odometry(drive)]
        ),
        seconds=len(frames) / drive.fps,
    )


class Feed:
    """The drive's time, which all devices share. ``start_ns``: of the first image, monotonic."""

    def __init__(self, path: Path, seed: int, start_ns: int) -> None:
        with np.load(path) as drive:
            self.images: npt.NDArray[np.uint8] = drive["images"]
            self.imu: Table = drive["imu"]
            self.speed: Table = drive["speed"]
            self.lap_s = float(drive["seconds"])
        self.random = Random(seed)
        self.faults: Counter[str] = Counter()
        self.seq = 0  # of the next image
        self.start_ns = start_ns
        self.interval_ns = round(self.lap_s / len(self.images) * 1e9)
        self._horizon_ns = start_ns
        self._passed = threading.Condition()
        self._taken = threading.Event()
        self._taken.set()
        self._goes_on = threading.Event()
        self._goes_on.set()

    def taken(self) -> None:
        """The newest image has been processed."""
        self._taken.set()

    def pause_or_go_on(self) -> None:
        """Stop the images, until called again; for a signal handler."""
        (self._goes_on.clear if self._goes_on.is_set() else self._goes_on.set)()

    def await_taken(self) -> bool:
        """Wait until the next image may come; False: not yet."""
        if self._goes_on.wait(WAIT_S) and self._taken.wait(WAIT_S):
            self._taken.clear()
            return True
        return False

    def advance(self, frames: int = 1) -> int:
        """Let time pass, with all samples up to the next image and one more. Return its stamp."""
        with self._passed:
            self.seq += frames
            stamp_ns = self.start_ns + (self.seq - 1) * self.interval_ns
            self._horizon_ns = stamp_ns + self.interval_ns // 4
            self._passed.notify_all()
        return stamp_ns

    def await_after(self, stamp_ns: int) -> int:
        """Wait briefly until time has passed ``stamp_ns``. Return the time."""
        with self._passed:
            self._passed.wait_for(lambda: self._horizon_ns > stamp_ns, WAIT_S)
            return self._horizon_ns

    def fault(self, device: str, kinds: Sequence[str], each: int) -> str:
        """Draw a fault of ``device`` that begins now, mostly none ("")."""
        if self.random.random() * each > 1:
            return ""
        kind = self.random.choice(kinds)
        self.faults[f"{device} {kind}"] += 1
        return kind


class FastCamera:
    """A camera. ``counts``: ``delivered``, ``dropped``, and its ``fault …``."""

    def __init__(self, feed: Feed) -> None:
        """Raises ``DeviceMissingError`` now and then."""
        self.name = "stand-in camera"
        self.counts: Counter[str] = Counter()
        self._feed = feed
        self._fault = ""
        self._left = 0  # images that it lasts
        if feed.fault("camera", ("missing",), each=4):
            raise DeviceMissingError(f"{self.name}: unplugged; plug it in again")

    def read(self) -> list[Frame]:
        """The next image. Raises ``DeviceLostError`` now and then."""
        feed = self._feed
        if self._fault != "burst" and not feed.await_taken():
            return []
        self._begin_fault()
        stamp_ns = feed.advance(1 + self._skipped())
        image = feed.images[(feed.seq - 1) % len(feed.images)].copy()
        if self._fault == "dark":
            image[:] = 3
        elif self._fault == "noise":
            image[:] = np.frombuffer(feed.random.randbytes(image.size), np.uint8).reshape(image.shape)
        self.counts["delivered"] += 1
        return [Frame(stamp_ns, feed.seq - 1, image)]

    def close(self) -> None:
        """Nothing is held."""

    def _begin_fault(self) -> None:
        self._left -= 1
        if self._left > 0:
            return
        self._fault = self._feed.fault("camera", CAMERA_FAULTS, CAMERA_FAULT_EACH)
        if not self._fault:
            return
        self.counts[f"fault {self._fault}"] += 1
        self._left = self._feed.random.randint(2, MAX_FAULT) if self._fault in {"burst", "dark", "noise"} else 1
        if self._fault == "unplugged":
            self._feed.taken()  # the image that would have come
            raise DeviceLostError(f"{self.name}: unplugged; plug it in again")

    def _skipped(self) -> int:
        """Images that the camera counts but does not deliver."""
        most = {"dropped": MAX_FAULT, "leap": 200}.get(self._fault, 0)
        skipped = self._feed.random.randint(1, most) if most else 0
        self.counts["dropped"] += skipped
        return skipped


class _FastSamples:
    """Samples of one kind, from the moment on at which it is opened."""

    def __init__(self, feed: Feed, name: str, table: Table) -> None:
        """Raises ``DeviceMissingError`` now and then."""
        self.name = f"stand-in {name}"
        self.counts: Counter[str] = Counter()
        self._feed = feed
        self._kind = name
        self._rows = self._since(table, feed.await_after(0))
        self._next_ns, self._row = next(self._rows)
        if feed.fault(name, ("missing",), each=4):
            raise DeviceMissingError(f"{self.name}: unplugged; plug it in again")

    def close(self) -> None:
        """Nothing is held."""

    def _since(self, table: Table, begin_ns: int) -> Iterator[tuple[int, Table]]:
        """Stamps and rows, lap by lap."""
        feed = self._feed
        rows = table[(table[:, 0] >= 0) & (table[:, 0] < feed.lap_s)]
        first_lap = int((begin_ns - feed.start_ns) / (feed.lap_s * 1e9))
        for lap in count(first_lap):
            for row in rows:
                stamp_ns = feed.start_ns + round((lap * feed.lap_s + row[0]) * 1e9)
                if stamp_ns > begin_ns:
                    yield stamp_ns, row[1:]

    def _read(self) -> list[tuple[int, Table]]:
        """What time has passed. Raises ``DeviceLostError`` now and then."""
        horizon_ns = self._feed.await_after(self._next_ns)
        passed = []
        while self._next_ns < horizon_ns:
            passed.append((self._next_ns, self._row))
            self._next_ns, self._row = next(self._rows)
        fault = self._feed.fault(self._kind, SAMPLE_FAULTS, SAMPLES_FAULT_EACH)
        if fault:
            self.counts[f"fault {fault}"] += 1
        if fault == "unplugged":
            raise DeviceLostError(f"{self.name}: unplugged; plug it in again")
        wild = self._feed.random.choice((float("nan"), float("inf"), -1e9, 1e9))
        return {
            "wild": [(stamp_ns, np.full_like(row, wild)) for stamp_ns, row in passed],
            "gap": [],
            "again": [*passed, *passed],
        }.get(fault, passed)


class FastImu(_FastSamples):
    """An IMU."""

    def __init__(self, feed: Feed) -> None:
        super().__init__(feed, "imu", feed.imu)

    def read(self) -> list[ImuSample]:
        """Samples up to now. Raises ``DeviceLostError`` now and then."""
        return [ImuSample(stamp_ns, (p, q, r), (x, y, z)) for stamp_ns, (p, q, r, x, y, z) in self._read()]


class FastSpeed(_FastSamples):
    """Wheel odometry."""

    def __init__(self, feed: Feed) -> None:
        super().__init__(feed, "speed", feed.speed)

    def read(self) -> list[SpeedSample]:
        """Speeds up to now. Raises ``DeviceLostError`` now and then."""
        return [SpeedSample(stamp_ns, speed, yaw_rate) for stamp_ns, (speed, yaw_rate) in self._read()]
