"""A recording as camera, IMU and odometry: its frames and samples are delivered at the recording's own rate.

All devices opened on one recording with one clock share a ``Playback``: they start together, from whichever thread they
are opened, and stay aligned to the nanosecond. At its end a recording loops, one average frame interval later, with
stamps and sequence numbers that continue. Once all devices are closed, it starts from the beginning.
"""

import random
import threading
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Generic, TypeVar

from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import DeviceLostError, DeviceMissingError, DeviceStalledError, WrongDeviceError
from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.errors import RecordingError
from lcf_edge.recording.read import open_recording

Item = Frame | ImuSample | SpeedSample
Record = TypeVar("Record", Frame, ImuSample, SpeedSample)

MAX_WAIT_S = 0.25  # of one read
_ON_TIME_NS = 2_000_000
_STALL_S = 1.0
_NAMES: dict[type, str] = {ImuSample: "inertial samples", SpeedSample: "speeds"}
_MAX_WAITING = {Frame: 4, ImuSample: 4096, SpeedSample: 4096}  # for their reader; the oldest are dropped


@dataclass
class Faults:
    """Faults to simulate; may be changed at any time, also between two openings."""

    drop: float = 0.0  # share of the records that are lost
    jitter_s: float = 0.0  # largest delay of a record; its stamp stays true
    stalled: bool = False  # open, but nothing comes
    unplugged: bool = False  # reading fails, opening too
    seed: int = 0


class Playback:
    """One recording, played in a loop on a clock for all devices that are open on it."""

    _playing: ClassVar[dict[tuple[Path, int], "Playback"]] = {}
    _lock_of_all: ClassVar[threading.Lock] = threading.Lock()

    def __init__(self, path: Path, config: Config, clock: Clock) -> None:
        """Raises ``RecordingError``."""
        self.recording = open_recording(path, config)
        self._config = config
        self._users = 0
        self._lock, self._turn = threading.Lock(), threading.Lock()
        self._waiting: dict[type, deque[tuple[int, Item]]] = {
            kind: deque(maxlen=longest) for kind, longest in _MAX_WAITING.items()
        }
        self._items: Iterator[Item] = iter(())
        self._lap = -1
        self._start_ns = clock.monotonic_ns()  # of the lap
        self._span_ns: tuple[int, int] | None = None  # first and last stamp in the lap so far
        self._frames, self._first_seq = 0, 0  # frames in the lap so far, and in those before

    @classmethod
    def join(cls, path: Path, config: Config, clock: Clock) -> "Playback":
        """Return the running playback, or a new one. Raises ``RecordingError``."""
        key = (path.resolve(), id(clock))
        with cls._lock_of_all:
            if key not in cls._playing:
                cls._playing[key] = cls(path, config, clock)
            cls._playing[key]._users += 1
            return cls._playing[key]

    def leave(self) -> None:
        """Undo a ``join``."""
        with self._lock_of_all:
            self._users -= 1
            for key in [key for key, playback in self._playing.items() if playback is self and not self._users]:
                del self._playing[key]

    def next(self, kind: type[Record]) -> tuple[int, Record]:
        """Return the next record of a kind and when it is due, ns. Raises ``RecordingError`` if there is none."""
        with self._turn:  # fair: a late camera that asks again at once does not lock out the others
            self._lock.acquire()
        try:
            lap = self._lap
            while not self._waiting[kind]:
                if self._lap > lap + 1:
                    raise RecordingError(f"{self.recording.path}: has no such data; name another recording")
                self._advance()
            due_ns, record = self._waiting[kind].popleft()
            assert isinstance(record, kind)
            return due_ns, record
        finally:
            self._lock.release()

    def _advance(self) -> None:
        """Queue the recording's next item for its reader, or begin again."""
        item = next(self._items, None)
        if item is None:
            self._begin_lap()
            return
        offset_ns = round(self._config.imu.time_offset_s * 1e9) if isinstance(item, ImuSample) else 0
        camera_ns = item.stamp_ns + offset_ns
        first_ns, last_ns = self._span_ns or (camera_ns, camera_ns)
        self._span_ns = first_ns, max(last_ns, camera_ns)
        due_ns = self._start_ns + camera_ns - first_ns
        if isinstance(item, Frame):
            self._frames = item.seq + 1
            item = replace(item, seq=self._first_seq + item.seq)
        self._waiting[type(item)].append((due_ns, replace(item, stamp_ns=due_ns - offset_ns)))

    def _begin_lap(self) -> None:
        if self._span_ns:
            length_ns = self._span_ns[1] - self._span_ns[0]
            several = self._frames > 1
            self._start_ns += length_ns
            self._start_ns += length_ns // (self._frames - 1) if several else round(1e9 / self._config.camera.fps)
        self._first_seq += self._frames
        self._span_ns, self._frames = None, 0
        self._lap += 1
        self._items = iter(self.recording)


class _Recorded(Generic[Record]):
    """One kind of a recording's records as a device, from the moment at which it is opened.

    ``counts``: ``dropped`` by the fault of that name; of a camera also ``overtaken``, counted as by a real one.
    """

    kind: type[Record]

    def __init__(self, path: Path, config: Config, clock: Clock = SYSTEM_CLOCK, faults: Faults | None = None) -> None:
        """Raises ``DriverError``."""
        self.name = str(path)
        self.counts: Counter[str] = Counter()
        self.faults = faults or Faults()
        self._random = random.Random(self.faults.seed)
        self._clock = clock
        self._opened_ns = clock.monotonic_ns()
        self._stalled_s = 0.0
        self._next: tuple[int, Record] | None = None
        self._playback: Playback | None = None
        if self.faults.unplugged:
            raise DeviceMissingError(f"{path}: unplugged; plug it in again")
        try:
            self._playback = Playback.join(path, config, clock)
        except RecordingError as error:
            raise DeviceMissingError(str(error)) from error
        recording = self._playback.recording
        if not {ImuSample: recording.has_imu, SpeedSample: recording.has_speed}.get(self.kind, True):
            self.close()
            raise WrongDeviceError(f"{path}: no {_NAMES[self.kind]} in this recording; name another one, or none")

    def read(self) -> Sequence[Record]:
        """Return the records since the last call; empty after ``MAX_WAIT_S``. Raises ``DriverError``."""
        if self.faults.unplugged or self._playback is None:
            raise DeviceLostError(f"{self.name}: unplugged; plug it in again")
        if self.faults.stalled:
            return self._stall()
        self._stalled_s = 0.0
        due_ns = self._due_ns()
        wait_s = (due_ns - self._clock.monotonic_ns()) / 1e9
        self._clock.sleep_s(min(wait_s, MAX_WAIT_S))
        now_ns = self._clock.monotonic_ns()
        records: deque[Record] = deque(maxlen=_MAX_WAITING[self.kind])  # after a pause of the process many are due
        while (due_ns := self._due_ns()) <= now_ns:
            assert self._next is not None
            if self._random.random() < self.faults.drop:
                self.counts["dropped"] += 1
            else:
                self.counts["overtaken"] += len(records) == records.maxlen
                records.append(self._next[1])
            self._next = None
            if now_ns - due_ns < _ON_TIME_NS:
                break  # the next is not due; asking for it would decode it while this one waits
        return list(records)

    def close(self) -> None:
        """Release the recording."""
        if self._playback is not None:
            self._playback.leave()
            self._playback = None

    def _due_ns(self) -> int:
        """Return when the next record is due, ns; records from before the opening are skipped."""
        assert self._playback is not None
        while self._next is None:
            try:
                due_ns, record = self._playback.next(self.kind)
            except RecordingError as error:
                raise DeviceLostError(str(error)) from error
            if due_ns >= self._opened_ns:
                self._next = due_ns + round(self._random.uniform(0, self.faults.jitter_s) * 1e9), record
        return self._next[0]

    def _stall(self) -> Sequence[Record]:
        self._clock.sleep_s(MAX_WAIT_S)
        self._stalled_s += MAX_WAIT_S
        if self._stalled_s >= _STALL_S:
            raise DeviceStalledError(f"{self.name}: nothing for {self._stalled_s:.1f} s; check cable and power")
        return []


class RecordedCamera(_Recorded[Frame]):
    """The images of a recording; the newest wins, as with the real driver."""

    kind = Frame

    def read(self) -> Sequence[Frame]:
        """The newest image; nothing after ``MAX_WAIT_S``. Raises ``DriverError``."""
        frames = super().read()
        self.counts["overtaken"] += len(frames[:-1])
        return frames[-1:]


class RecordedImu(_Recorded[ImuSample]):
    """The inertial samples of a recording, in the axes in which it delivers them."""

    kind = ImuSample


class RecordedSpeed(_Recorded[SpeedSample]):
    """The odometry of a recording."""

    kind = SpeedSample
