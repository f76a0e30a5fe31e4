"""Base of every kind of recording: delivery order, one image size, counted skips."""

import bisect
import heapq
import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.errors import RecordingError
from lcf_edge.lens import Lens
from lcf_edge.printable import printable
from lcf_edge.recording.read.decoding import Grey, ImageDecodeError

WARNINGS_OF_A_KIND = 5  # further skips for the same reason are only counted
MAX_STAMP_NS = 2**63 - 1
MAX_WAITING_FRAMES = 6  # that wait for earlier ones
MAX_WAITING_SAMPLES = 1024

Sample = ImuSample | SpeedSample


@dataclass(frozen=True, slots=True)
class UndecodedFrame:
    """A frame whose image is decoded when its turn comes, so that no decoded images wait in memory."""

    stamp_ns: int
    name: str  # for warnings
    decode: Callable[[], Grey]  # raises ImageDecodeError


class Recording(ABC):
    """Frames, IMU and speed samples of one drive; every ``iter`` starts anew and reads lazily.

    Items come in the order of their stamps, except that before each frame all IMU and speed samples up to and
    including the first one at or after the frame's stamp are delivered, so that the interval between two
    exposures can be integrated exactly.

    What cannot be used is skipped, counted in ``skipped`` by reason, and reported in ``warnings``, which grow
    while reading; ``seq`` of the frames has a gap at each skipped image. Iterating raises
    ``RecordingError`` at the end if no image could be read.

    ``iter`` yields the part from ``start_s`` after the first frame on, for ``duration_s``; what comes before is not
    decoded. ``first_ns``: the stamp of the first frame, once it was reached.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.lens: Lens | None = None  # the recording's own
        self.frame_count: int | None = None
        self.has_imu = False
        self.has_speed = False
        self.warnings: list[str] = []
        self.skipped: Counter[str] = Counter()
        self.start_s, self.duration_s = 0.0, math.inf
        self.first_ns: int | None = None

    @abstractmethod
    def _items(self) -> Iterator[UndecodedFrame | Sample]:
        """Items in the order of delivery."""

    def __iter__(self) -> Iterator[Frame | ImuSample | SpeedSample]:
        self.skipped.clear()
        shape: tuple[int, ...] | None = None
        seq = -1
        last_s, start_s, end_s = 0.0, self.start_s, self.start_s + self.duration_s
        begun = start_s <= 0
        for item in self._items():
            if not isinstance(item, UndecodedFrame):
                if begun:
                    yield item
                continue
            seq += 1
            if seq == 0:
                self.first_ns = item.stamp_ns
            assert self.first_ns is not None
            last_s = (item.stamp_ns - self.first_ns) / 1e9
            begun = begun or last_s >= start_s
            if not begun:
                continue
            if last_s > end_s:
                break
            try:
                image = item.decode()
            except ImageDecodeError as error:
                self._skip(f"image {error}", item.name)
                continue
            shape = shape or image.shape
            if image.shape == shape:
                yield Frame(item.stamp_ns, seq, image)
            else:
                self._skip("image of another size than the first", item.name)
        if not begun and seq >= 0:
            raise RecordingError(f"{self.path}: ends after {last_s:.1f} s; name an earlier start than {start_s:g} s")
        if shape is None:
            why = "".join(f" ({count} times: {what})" for what, count in self.skipped.most_common(1))
            raise RecordingError(f"{self.path}: not one image could be read{why}; record it again")

    def _warn(self, text: str) -> None:
        text = printable(text, 1000)  # names in a file may hold anything
        if text not in self.warnings:
            self.warnings.append(text)

    def _skip(self, reason: str, where: str) -> None:
        self.skipped[reason] += 1
        if self.skipped[reason] <= WARNINGS_OF_A_KIND:
            last = self.skipped[reason] == WARNINGS_OF_A_KIND
            self._warn(f"{where}: {reason}, skipped" + ("; more of these are only counted" if last else ""))

    def _warn_without_lens(self, config: Config) -> None:
        if self.lens is None and not config.camera.intrinsics:
            self._warn(f"{self.path}: has no intrinsics, they are guessed; set camera.intrinsics")


def interleave(
    frames: Iterable[UndecodedFrame], imu: Iterable[ImuSample], speed: Iterable[SpeedSample]
) -> Iterator[UndecodedFrame | Sample]:
    """Merge three streams, each in stamp order, into the order of delivery (see ``Recording``)."""
    streams: tuple[_Stream, _Stream] = (_Stream(imu), _Stream(speed))
    for frame in frames:
        yield from heapq.merge(*(stream.up_to(frame.stamp_ns) for stream in streams), key=_stamp_ns)
        yield frame
    yield from heapq.merge(*(stream.up_to(math.inf) for stream in streams), key=_stamp_ns)


def reorder(
    items: Iterable[UndecodedFrame | Sample], late: Callable[[UndecodedFrame | Sample], None]
) -> Iterator[UndecodedFrame | Sample]:
    """Sort one stream that is only roughly in stamp order into the order of delivery (see ``Recording``).

    At most ``MAX_WAITING_FRAMES`` and ``MAX_WAITING_SAMPLES`` wait for earlier ones; what comes later still, or repeats
    the stamp of its kind, goes to ``late``.
    """
    waiting: list[UndecodedFrame | Sample] = []
    frames = 0
    reached_ns: dict[type, float] = dict.fromkeys((UndecodedFrame, ImuSample, SpeedSample), -math.inf)

    def release() -> Iterator[UndecodedFrame | Sample]:
        first = waiting.pop(0)
        if first.stamp_ns <= reached_ns[type(first)]:
            late(first)
            return
        reached_ns[type(first)] = first.stamp_ns
        if isinstance(first, UndecodedFrame):
            yield from ahead(first.stamp_ns)
        yield first

    def ahead(stamp_ns: int) -> Iterator[Sample]:
        waited_for = {kind for kind in (ImuSample, SpeedSample) if reached_ns[kind] < stamp_ns}
        index = 0
        while waited_for and index < len(waiting):
            sample = waiting[index]
            if isinstance(sample, UndecodedFrame) or type(sample) not in waited_for:
                index += 1
                continue
            del waiting[index]
            waited_for.remove(type(sample))
            reached_ns[type(sample)] = sample.stamp_ns
            yield sample

    for item in items:
        bisect.insort(waiting, item, key=_stamp_ns)
        frames += isinstance(item, UndecodedFrame)
        while frames > MAX_WAITING_FRAMES or len(waiting) - frames > MAX_WAITING_SAMPLES:
            frames -= isinstance(waiting[0], UndecodedFrame)
            yield from release()
    while waiting:
        yield from release()


class _Stream:
    """Samples, and how far they were read."""

    def __init__(self, samples: Iterable[Sample]) -> None:
        self._samples = iter(samples)
        self._reached_ns = -math.inf

    def up_to(self, stamp_ns: float) -> Iterator[Sample]:
        """The samples still to come, up to and including the first one at or after ``stamp_ns``."""
        while self._reached_ns < stamp_ns and (sample := next(self._samples, None)) is not None:
            self._reached_ns = sample.stamp_ns
            yield sample


def _stamp_ns(item: UndecodedFrame | Sample) -> int:
    return item.stamp_ns
