"""A device is kept open, its records are passed on, and how it does can be read beside it."""

import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from drivers.clock import Clock
from drivers.device import Device
from drivers.errors import DeviceForbiddenError
from drivers.samples import Frame, ImuSample
from lcf_edge.config import Config
from lcf_edge.daemon.clock import StoppableClock
from lcf_edge.daemon.reader import Reader
from lcf_edge.recording.playback import Faults, RecordedCamera, RecordedImu

PATIENCE_S = 20.0


class Arrivals:
    """Counts what is delivered."""

    def __init__(self) -> None:
        self.records: list[Any] = []
        self._arrived = threading.Condition()

    def __call__(self, records: Sequence[Any]) -> None:
        with self._arrived:
            self.records += records
            self._arrived.notify()

    def wait_for_more(self, count: int) -> None:
        with self._arrived:
            wanted = len(self.records) + count
            assert self._arrived.wait_for(lambda: len(self.records) >= wanted, PATIENCE_S)


@contextmanager
def running(reader: Reader[Any], clock: StoppableClock) -> Iterator[None]:
    reader.start()
    try:
        yield
    finally:
        clock.stop()
        reader.join(PATIENCE_S)
    assert not reader.is_alive()


def is_well(reader: Reader[Any]) -> bool:
    return reader.error is None and reader.away_since_ns is None


def test_records_are_passed_on_and_measured(config: Config, drive: Path) -> None:
    clock, arrivals = StoppableClock(), Arrivals()
    reader = Reader("imu", lambda at: RecordedImu(drive, config, at), arrivals, clock)
    with running(reader, clock):
        arrivals.wait_for_more(60)
    assert is_well(reader)
    assert reader.intervals.rate_hz == pytest.approx(200, rel=0.01)
    assert reader.intervals.jitter_s < 1e-4
    assert reader.counts["opened"] == 1


def test_a_device_that_goes_comes_back(config: Config, drive: Path) -> None:
    clock, arrivals, faults = StoppableClock(), Arrivals(), Faults()
    reader = Reader("camera", lambda at: RecordedCamera(drive, config, at, faults), arrivals, clock)
    gone = threading.Event()
    with running(reader, clock):
        arrivals.wait_for_more(2)
        faults.unplugged = True
        while "unplugged; plug it in again" not in str(reader.error):
            gone.wait(0.01)
        assert reader.away_since_ns is not None
        faults.unplugged = False
        arrivals.wait_for_more(2)
    assert is_well(reader)
    assert reader.counts["failed"] >= 1
    assert reader.counts["opened"] == 2


class Lingering:
    """A device that knows whether it was closed."""

    def __init__(self) -> None:
        self.name = "lingering"
        self.counts: Counter[str] = Counter()
        self.closed = False

    def read(self) -> Sequence[Frame]:
        return []

    def close(self) -> None:
        self.closed = True


def test_a_stop_closes_the_device() -> None:
    clock, device = StoppableClock(), Lingering()
    reader: Reader[Frame] = Reader("camera", lambda _: device, lambda _: None, clock)
    with running(reader, clock):
        pass
    assert device.closed


def test_a_stop_does_not_wait_for_the_next_attempt() -> None:
    clock, tried = StoppableClock(), threading.Event()

    def forbidden(_: Clock) -> Device[Frame]:
        tried.set()
        raise DeviceForbiddenError("/dev/video0: no permission; join the group video")

    reader: Reader[Frame] = Reader("camera", forbidden, lambda _: None, clock)
    with running(reader, clock):
        assert tried.wait(PATIENCE_S)
    assert reader.counts["failed"] >= 1


def test_a_missing_device_is_reported_once(config: Config, caplog: pytest.LogCaptureFixture) -> None:
    clock = StoppableClock()
    missing = Faults(unplugged=True)
    tries = 0
    enough = threading.Event()

    def open_camera(at: Clock) -> Device[Frame]:
        nonlocal tries
        tries += 1
        if tries == 3:
            enough.set()
        return RecordedCamera(Path("x"), config, at, missing)

    reader = Reader("camera", open_camera, lambda _: None, clock)
    with running(reader, clock):
        assert enough.wait(PATIENCE_S)
    assert [record.getMessage() for record in caplog.records] == ["camera: x: unplugged; plug it in again"]


class TooMuch:
    """A device that drops what it cannot take."""

    name = "too much"

    def __init__(self, clock: Clock) -> None:
        self.counts: Counter[str] = Counter()
        self._clock = clock

    def read(self) -> list[ImuSample]:
        self.counts["excess_bytes"] += 1000
        return [ImuSample(self._clock.monotonic_ns(), (0.0, 0.0, 0.0), (0.0, 0.0, 9.8))]

    def close(self) -> None:
        pass


def test_what_is_dropped_for_being_too_much_is_reported_once(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lcf_edge.daemon.reader._COUNTS_EACH_NS", 0)
    clock, arrivals = StoppableClock(), Arrivals()
    reader = Reader("imu", TooMuch, arrivals, clock)
    with running(reader, clock):
        arrivals.wait_for_more(3)
    assert sum("sends more than" in record.getMessage() for record in caplog.records) == 1
    assert reader.counts["excess_bytes"] >= 3000
