"""A stand-in for libcamera's Python binding, so that the shipped process and driver run without libcamera.

``python -m hil_mocks.libcamera_device WORLD FD REQUEST`` runs ``drivers.camera.libcamera_process`` on the cameras of
``WORLD``, which is a ``World`` as JSON. They behave as a Raspberry Pi's: a sensor with modes of which some see only a
part of the image, and the one of the nearest size is the default; images in shared memory, at the camera's rate, on the
system's clock. ``command`` returns the command for the driver.
"""

import contextlib
import json
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec

from drivers.camera import libcamera_process
from drivers.camera.luminance import min_stride
from hil_mocks.v4l2_device import drawn_image, encode

SENSOR_TIMESTAMP = "SensorTimestamp"
FULL = (3280, 2464)  # of the sensor, px
MODES = {  # size: what is seen of the sensor, shortest time of a frame in µs
    (640, 480): ((1280, 960), 4_800),
    (1640, 1232): (FULL, 24_000),
    (1920, 1080): ((1920, 1080), 21_000),
    (3280, 2464): (FULL, 47_000),
}
UNLOCKED = {"ExposureTime": 20_000, "AnalogueGain": 1.0}  # what switching the automatic off leaves at first


class World(msgspec.Struct, frozen=True, kw_only=True):
    """The cameras and their faults; image numbers count from the start of the stream."""

    names: tuple[str, ...] = ("imx219",)  # of the cameras
    nodes: tuple[int, ...] = ()  # device numbers that belong to the first
    formats: tuple[str, ...] = ("YUV420", "NV12", "YUYV", "RGB888")  # by libcamera's names
    focuses: bool = False
    newer: bool = False  # has the controls of libcamera 0.5
    starts_bare: bool = False  # takes controls with requests alone, as an RK3399's pipeline does
    chooses_modes: bool = True
    log_path: str = ""  # a file that gets the mode, the controls of the start, and what of UNLOCKED is locked

    installed: bool = True
    busy: bool = False
    hangs: bool = False  # while it opens
    padding: int = 0  # bytes after each row
    bad: bool = False  # every other image is marked as bad
    skipped: int = -1  # the image that is lost
    cancelled: int = -1  # the image with which the camera is gone
    crash: int = -1  # the image at which libcamera crashes
    silent: int = -1  # the image from which on nothing comes
    stamp_offset_s: float = 0.0
    stamped: bool = True  # SensorTimestamp is there


def command(world: World) -> tuple[str, ...]:
    """Runs ``world`` instead of libcamera."""
    return (sys.executable, "-m", "hil_mocks.libcamera_device", msgspec.json.encode(world).decode())


class Status(Enum):
    """Of requests, images and configurations; each of them has some."""

    Complete = Success = Valid = 0
    Adjusted = Cancelled = 1
    Invalid = Error = 2


class StreamRole(Enum):
    """What images are for."""

    Viewfinder = 0
    Raw = 1


class Size:
    """In px."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height


@dataclass(frozen=True)
class Control:
    """Of a camera, or a property; known by its name."""

    name: str


@dataclass(frozen=True)
class Info:
    """A control's range."""

    min: Any
    max: Any
    default: Any = 0


@dataclass
class SensorConfiguration:
    """A chosen mode of the sensor."""

    bit_depth: int = 0
    output_size: Size = field(default_factory=lambda: Size(0, 0))


class Formats:
    """What a stream offers."""

    def __init__(self, names: Sequence[str], sizes: list[tuple[int, int]]) -> None:
        self.pixel_formats = names
        self._sizes = sizes

    def sizes(self, _pixel_format: str) -> list[Size]:
        """Those that are listed; none: a range."""
        return [Size(*size) for size in self._sizes]

    def range(self, _pixel_format: str) -> str:
        """All sizes, in words."""
        return "(64x64)-(3280x2464)/(+2,+2)"


class Configuration:
    """Of one stream."""

    def __init__(self, world: World, role: StreamRole) -> None:
        raw = role is StreamRole.Raw
        self._world = world
        self.sensor_config: SensorConfiguration | None = None
        self.stream = SimpleNamespace(
            formats=Formats(["SRGGB10_CSI2P", "SRGGB8"], list(MODES)) if raw else Formats(world.formats, []),
            size=Size(800, 600),
            pixel_format="",
            buffer_count=1,
            stride=0,
            stream="stream",
        )

    def __len__(self) -> int:
        return 1

    def at(self, _index: int) -> Any:
        """The stream."""
        return self.stream

    def validate(self) -> Status:
        """Adjust it to what is supported."""
        stream, mode = self.stream, self.sensor_config
        if mode is not None and mode.bit_depth != 10:
            return Status.Invalid
        stream.size = Size(min(stream.size.width, FULL[0]), min(stream.size.height, FULL[1]))
        stride = min_stride(libcamera_process.PIXEL_FORMATS[stream.pixel_format], stream.size.width)
        stream.stride = stride + self._world.padding
        return Status.Adjusted  # the colour space always is

    def mode(self) -> tuple[int, int]:
        """The sensor's: the one that is chosen, else the nearest."""
        if self.sensor_config is not None:
            return self.sensor_config.output_size.width, self.sensor_config.output_size.height
        wanted = self.stream.size
        return min(MODES, key=lambda size: abs(size[0] - wanted.width) + abs(size[1] - wanted.height))


class Buffer:
    """An image's memory."""

    def __init__(self, length: int) -> None:
        self.descriptor = os.memfd_create("picture")
        os.ftruncate(self.descriptor, length)
        self.planes = [SimpleNamespace(fd=self.descriptor, offset=0, length=length)]
        self.metadata: Any = None


class Request:
    """A buffer on its way to the camera and back."""

    def __init__(self, cookie: int) -> None:
        self.cookie = cookie
        self.status = Status.Complete
        self.buffers: dict[str, Buffer] = {}
        self.controls: dict[Control, Any] = {}
        self.metadata: dict[Control, Any] = {}

    def add_buffer(self, stream: str, buffer: Buffer) -> None:
        """Give it the memory."""
        self.buffers[stream] = buffer

    def set_control(self, control: Control, value: Any) -> None:
        """From this image on."""
        self.controls[control] = value

    def reuse(self) -> None:
        """Make it as new."""
        self.controls.clear()


class Camera:
    """A sensor on a ribbon cable."""

    def __init__(self, manager: "Manager", world: World, number: int) -> None:
        self._manager, self._world = manager, world
        self.id = f"/base/soc/i2c0mux/i2c@{number}/{world.names[number]}@10"
        self.properties: dict[Control, Any] = {
            Control("Model"): world.names[number],
            Control("SystemDevices"): tuple(world.nodes if number == 0 else ()),
        }
        self.controls = {
            Control("FrameDurationLimits"): Info((10_000,), (10_000_000,)),
            Control("ExposureTime"): Info(75, 11_766_829),
            Control("AnalogueGain"): Info(1.0, 10.6),
            Control("AeFlickerMode"): Info(0, 1),
            Control("AeFlickerPeriod"): Info(100, 1_000_000),
            Control("AeEnable"): Info(min=False, max=True),
        }
        if world.chooses_modes:
            self.properties[Control("ScalerCropMaximum")] = SimpleNamespace(size=Size(0, 0))
        if world.focuses:
            self.controls |= {Control("AfMode"): Info(0, 2), Control("LensPosition"): Info(0.0, 32.0, 1.0)}
        if world.newer:
            self.controls |= {Control("ExposureTimeMode"): Info(0, 1), Control("AnalogueGainMode"): Info(0, 1)}
        self._mode = (0, 0)
        self._configuration: Configuration | None = None
        self._queue: deque[Request] = deque()
        self._log: dict[str, Any] = {}
        self._locked: dict[str, Any] = {}
        self._stopped = threading.Event()

    def acquire(self) -> None:
        """Acquire it for this process."""
        if self._world.busy:
            raise RuntimeError("Failed to acquire camera: Device or resource busy")
        while self._world.hangs:
            time.sleep(60)

    def release(self) -> None:
        """Release it for others."""

    def generate_configuration(self, roles: list[StreamRole]) -> Configuration:
        """A default."""
        return Configuration(self._world, roles[0])

    def configure(self, configuration: Configuration) -> None:
        """Take it; what the mode sees and how fast it is are known from now on."""
        self._configuration, self._mode = configuration, configuration.mode()
        seen, fastest_us = MODES[self._mode]
        if self._world.chooses_modes:
            self.properties[Control("ScalerCropMaximum")] = SimpleNamespace(size=Size(*seen))
        self.controls[Control("FrameDurationLimits")] = Info((fastest_us,), (10_000_000,))

    def create_request(self, cookie: int) -> Request:
        """An empty one."""
        return Request(cookie)

    def start(self, controls: dict[Control, Any]) -> None:
        """Images come from now on."""
        started_with = {control.name: value for control, value in controls.items()}
        self._log = {"mode": self._mode, **started_with}
        self._apply({} if self._world.starts_bare else started_with)
        threading.Thread(target=self._run, args=(started_with["FrameDurationLimits"][0] / 1e6,), daemon=True).start()

    def stop(self) -> None:
        """No more images."""
        self._stopped.set()

    def queue_request(self, request: Request) -> None:
        """Fill it when its turn comes."""
        self._queue.append(request)

    def _apply(self, controls: dict[str, Any]) -> None:
        """Before libcamera 0.5 in any order; here what switches the automatic is last, and forgets what is locked.

        From 0.5 on the switches go first, and what is not switched to manual is not locked.
        """
        values = {name: value for name, value in controls.items() if name in UNLOCKED}
        if self._world.newer:
            for name, unlocked in UNLOCKED.items():
                mode = controls.get(f"{name}Mode")
                if mode == 0:
                    self._locked.pop(name, None)
                elif mode == 1:
                    self._locked[name] = unlocked
            self._locked |= {name: value for name, value in values.items() if name in self._locked}
        else:
            self._locked |= values
            if "AeEnable" in controls:
                self._locked = {} if controls["AeEnable"] else dict(UNLOCKED)
        if self._world.log_path:
            text = json.dumps({**self._log, "locked": self._locked})
            Path(self._world.log_path).write_text(text, encoding="utf-8")

    def _run(self, interval_s: float) -> None:
        world, number, due_s = self._world, 0, time.monotonic()
        while not self._stopped.wait(max(due_s + interval_s - time.monotonic(), 0)):
            due_s += interval_s
            if number == world.crash:
                os.kill(os.getpid(), signal.SIGSEGV)
            if 0 <= world.silent <= number:
                continue
            if self._queue and number != world.skipped:
                request = self._queue.popleft()
                request.status = Status.Cancelled if number == world.cancelled else Status.Complete
                if request.controls:
                    self._apply({control.name: value for control, value in request.controls.items()})
                self._fill(request, number)
                self._manager.pass_on(request)
            number += 1

    def _fill(self, request: Request, number: int) -> None:
        assert self._configuration is not None
        stream, buffer = self._configuration.stream, request.buffers["stream"]
        stamp_ns = time.monotonic_ns() + round(self._world.stamp_offset_s * 1e9)
        name = libcamera_process.PIXEL_FORMATS[stream.pixel_format]
        image = drawn_image(number, stream.size.width, stream.size.height)
        data = encode(image, name, self._world.padding)[: buffer.planes[0].length]
        os.pwrite(buffer.descriptor, data, 0)
        buffer.metadata = SimpleNamespace(
            sequence=number,
            timestamp=stamp_ns,
            status=Status.Error if self._world.bad and number % 2 else Status.Success,
            planes=[SimpleNamespace(bytes_used=len(data))],
        )
        request.metadata = {Control(SENSOR_TIMESTAMP): stamp_ns} if self._world.stamped else {}


class Manager:
    """All cameras, and the requests that are done."""

    def __init__(self, world: World) -> None:
        self.event_fd = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._done: deque[Request] = deque()
        self.cameras = [Camera(self, world, number) for number in range(len(world.names))]

    def pass_on(self, request: Request) -> None:
        """A request is done."""
        self._done.append(request)
        os.eventfd_write(self.event_fd, 1)

    def get_ready_requests(self) -> list[Request]:
        """Those that are done."""
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self.event_fd)
        return [self._done.popleft() for _ in range(len(self._done))]


class Allocator:
    """Memory for a camera's images."""

    def __init__(self, camera: Camera) -> None:
        self._camera = camera
        self._buffers: list[Buffer] = []

    def allocate(self, _stream: str) -> None:
        """As much as the configuration says."""
        assert self._camera._configuration is not None
        stream = self._camera._configuration.stream
        length = stream.stride * stream.size.height  # of the first plane
        self._buffers = [Buffer(length) for _ in range(stream.buffer_count)]

    def buffers(self, _stream: str) -> list[Buffer]:
        """What was allocated."""
        return self._buffers


def binding(world: World) -> Any:
    """The module."""
    manager = Manager(world)
    return SimpleNamespace(
        CameraManager=SimpleNamespace(singleton=lambda: manager),
        CameraConfiguration=SimpleNamespace(Status=Status),
        FrameBufferAllocator=Allocator,
        FrameMetadata=SimpleNamespace(Status=Status),
        Request=SimpleNamespace(Status=Status),
        SensorConfiguration=SensorConfiguration,
        Size=Size,
        StreamRole=StreamRole,
    )


def main(described: str, descriptor: str, request: str) -> None:
    """Run the process on a world."""
    world = msgspec.json.decode(described, type=World)
    sys.modules["libcamera"] = binding(world) if world.installed else None  # type: ignore[assignment]
    libcamera_process.main(descriptor, request)


if __name__ == "__main__":
    main(*sys.argv[1:])
