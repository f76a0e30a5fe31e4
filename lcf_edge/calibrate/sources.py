"""Images and inertial samples, from the devices of the configuration or from a recording; samples in the IMU's axes.

The stamps are the devices' own: ``imu.time_offset_s`` is not yet in them.
"""

import queue
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Protocol

import msgspec

from drivers.device import Device
from drivers.errors import DriverError
from drivers.samples import Frame, ImuSample
from lcf_edge.calibrate.guide import Guide
from lcf_edge.config import Config
from lcf_edge.devices import open_camera, open_imu
from lcf_edge.errors import ConfigError, RecordingError
from lcf_edge.lens import Lens
from lcf_edge.recording.read import open_recording
from lcf_edge.recording.read.images import ImageFolder

Item = Frame | ImuSample

_AS_IT_COMES = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
_MAX_WAITING = 512
_MAX_CLOSE_S = 2.0
_POLL_S = 0.2


class SensorSource(Protocol):
    """Where data come from. ``live``: the user can still act; ``film``: images follow each other closely."""

    live: bool
    film: bool

    def items(self) -> Iterator[Item]:
        """Yield images and samples, each kind in stamp order. Raises ``DriverError``, ``RecordingError``."""
        ...

    def lens(self, width: int, height: int) -> Lens | None:
        """Return the lens of its images; None: unknown. Raises ``ConfigError``."""
        ...


class RecordedSource:
    """A recording. Raises ``RecordingError`` if it cannot be read, or has no IMU and ``imu`` asks for one."""

    live = False

    def __init__(self, path: Path, config: Config, guide: Guide, *, imu: bool) -> None:
        self._config = in_imu_axes(config)
        self._recording = open_recording(path, self._config)
        self._guide = guide
        self.film = not isinstance(self._recording, ImageFolder)
        if imu and not self._recording.has_imu:
            raise RecordingError(f"{path}: no inertial samples in it; name a recording with an IMU")

    def items(self) -> Iterator[Item]:
        """Yield in the recording's order of delivery; report at the end what was skipped."""
        for item in self._recording:
            if isinstance(item, Frame | ImuSample):
                yield item
        for reason, count in self._recording.skipped.items():
            self._guide.say(f"skipped: {count} {reason}")

    def lens(self, width: int, height: int) -> Lens | None:
        """Return the configured lens, else the recording's own."""
        configured = _configured_lens(self._config, width, height)
        if configured is None and self._recording.lens is not None:
            return self._recording.lens.scaled(width, height)
        return configured


class LiveSource:
    """The devices of the configuration. Raises ``ConfigError`` when ``imu`` is wanted and none is configured."""

    live = film = True

    def __init__(self, config: Config, *, camera: bool, imu: bool) -> None:
        if imu and config.imu.driver == "none":
            raise ConfigError("imu.driver: none is configured; name one, or a recording with --from")
        self._config = in_imu_axes(config)
        self._camera, self._imu = camera, imu

    def items(self) -> Iterator[Item]:
        """Yield in the order of arrival, without end."""
        with ExitStack() as stack:
            devices: list[Device[Any]] = []
            for is_needed, open_device in ((self._camera, open_camera), (self._imu, open_imu)):
                device = open_device(self._config) if is_needed else None
                if device is not None:
                    stack.callback(device.close)
                    devices.append(device)
            yield from _merged(devices)

    def lens(self, width: int, height: int) -> Lens | None:
        """Return the configured lens."""
        return _configured_lens(self._config, width, height)


def in_imu_axes(config: Config) -> Config:
    """Return ``config`` changed so that samples come in the IMU's own axes."""
    return msgspec.structs.replace(config, imu=msgspec.structs.replace(config.imu, axes=_AS_IT_COMES))


def for_a_while(items: Iterator[Item], seconds: float | None, kind: type[Item]) -> Iterator[Item]:
    """Yield ``items`` until ``seconds`` have passed by the stamps of ``kind``; None: all of them."""
    end_ns: float | None = None
    for item in items:
        if seconds is not None and isinstance(item, kind):
            end_ns = end_ns or item.stamp_ns + seconds * 1e9
            if item.stamp_ns > end_ns:
                return
        yield item


def _configured_lens(config: Config, width: int, height: int) -> Lens | None:
    return Lens.from_config(config.camera, width, height) if config.camera.intrinsics else None


def _merged(devices: list[Device[Any]]) -> Iterator[Item]:
    """Yield what several devices deliver, each read in its own thread. Raises ``DriverError``."""
    arrived: queue.Queue[Item | DriverError] = queue.Queue(_MAX_WAITING)
    ended = threading.Event()

    def put(item: Item | DriverError) -> None:
        while not ended.is_set():
            try:
                arrived.put(item, timeout=_POLL_S)
            except queue.Full:
                continue
            return

    def read(device: Device[Any]) -> None:
        try:
            while not ended.is_set():
                for item in device.read():
                    put(item)
        except DriverError as error:
            put(error)

    threads = [threading.Thread(target=read, args=(device,), daemon=True) for device in devices]
    for thread in threads:
        thread.start()
    try:
        while True:
            item = arrived.get()
            if isinstance(item, DriverError):
                raise item
            yield item
    finally:
        ended.set()
        for thread in threads:
            thread.join(_MAX_CLOSE_S)
