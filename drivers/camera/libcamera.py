"""A camera that libcamera runs, such as those on the ribbon cable of a Raspberry Pi.

libcamera runs in a process of its own (``libcamera_process``) under the system's Python: its binding is built only for
that, and a crash ends the process but not the program, which reopens the camera. Images are copied once, as with V4L2:
the process hands over descriptors of libcamera's buffers (dma-buf), and then only reports which one is filled.
Source: libcamera, ``SensorTimestamp`` of control_ids_core.yaml; Linux ``include/uapi/linux/dma-buf.h``.
By hand: ``python -m drivers.camera.libcamera [CAMERA] [--list]``.
"""

import contextlib
import fcntl
import json
import mmap
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from drivers.camera import by_hand
from drivers.camera.arrival import Arrivals
from drivers.camera.luminance import FrameError, Grey, luminance
from drivers.camera.mode import Mode
from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import (
    DeviceBusyError,
    DeviceForbiddenError,
    DeviceLostError,
    DeviceMissingError,
    DeviceStalledError,
    DriverError,
    MissingSoftwareError,
    UnsupportedSettingError,
    WrongDeviceError,
)
from drivers.samples import Frame

COMMAND = ("/usr/bin/python3", "-I", str(Path(__file__).with_name("libcamera_process.py")))
"""What runs libcamera: the Python for which the distribution builds its binding."""
LOG_LEVELS = "LIBCAMERA_LOG_LEVELS"  # set in the environment: libcamera's log goes to stderr
MAX_WAIT_S = 0.25  # of one read
OPENING_S = 15.0  # at most; a small computer loads everything from its card
STARTING_S = 3.0  # extra time until the first image: those before the exposure settles are held back
ENDING_S = 0.4  # then the process is killed; a daemon that shuts down has no more time
_MAX_MESSAGE = 65536
_MAX_BUFFERS = 32
_SYNC = 0x4008_6200  # DMA_BUF_IOCTL_SYNC
_BEGIN_READ, _END_READ = struct.pack("=Q", 1), struct.pack("=Q", 1 | 4)  # DMA_BUF_SYNC_READ, with _START and _END

_ERRORS: dict[str, type[DriverError]] = {
    "software": MissingSoftwareError,
    "missing": DeviceMissingError,
    "forbidden": DeviceForbiddenError,
    "busy": DeviceBusyError,
    "wrong": WrongDeviceError,
    "unsupported": UnsupportedSettingError,
    "lost": DeviceLostError,
}


class Listed(msgspec.Struct, frozen=True):
    """A camera as libcamera lists it: its sensor, and its unique id."""

    name: str
    id: str


class _Cameras(msgspec.Struct, frozen=True, tag_field="type", tag="cameras"):
    cameras: list[Listed]


class _Ready(msgspec.Struct, frozen=True, tag_field="type", tag="ready"):
    format: str
    width: int
    height: int
    stride: int
    fps: float
    buffers: list[tuple[int, int]]  # offset and length in each descriptor


class _FilledBuffer(msgspec.Struct, frozen=True, tag_field="type", tag="picture"):
    index: int  # of the buffer
    sequence: int
    stamp_ns: int
    size: int  # bytes that are filled
    good: bool


class _Failure(msgspec.Struct, frozen=True, tag_field="type", tag="failure"):
    kind: str
    text: str


_Message = _Cameras | _Ready | _FilledBuffer | _Failure
_DECODER = msgspec.json.Decoder(_Message)


class _Process:
    """The process and the socket to it; ends with ``close``. Raises ``DriverError``."""

    def __init__(self, name: str, request: dict[str, Any], command: Sequence[str]) -> None:
        self._name = name
        self._socket, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.setblocking(False)
        log = None if LOG_LEVELS in os.environ else subprocess.DEVNULL
        try:
            self._process = subprocess.Popen(
                (*command, str(other.fileno()), json.dumps(request)),
                pass_fds=(other.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=log,
            )
        except OSError as error:
            self._socket.close()
            raise MissingSoftwareError(
                f"{name}: {command[0]} cannot be run ({error.strerror}); apt install python3 python3-libcamera"
            ) from error
        finally:
            other.close()

    def wait(self, timeout_s: float) -> bool:
        """Wait; return whether a message, or the end, has come."""
        poller = select.poll()
        poller.register(self._socket, select.POLLIN)
        return bool(poller.poll(timeout_s * 1e3))

    def receive(self) -> tuple[_Message, list[int]] | None:
        """Return the next message and the descriptors that came with it; None: none yet."""
        try:
            data, descriptors, _, _ = socket.recv_fds(self._socket, _MAX_MESSAGE, _MAX_BUFFERS)
        except BlockingIOError:
            return None
        except ConnectionError:
            data, descriptors = b"", []
        if not data:
            raise DeviceLostError(f"{self._name}: the process that runs libcamera {self._end()}; opened again")
        message = _DECODER.decode(data)
        if isinstance(message, _Failure):
            raise _ERRORS.get(message.kind, DeviceLostError)(f"{self._name}: {message.text}")
        return message, descriptors

    def give_back(self, index: int) -> None:
        """Let libcamera fill this buffer again. If the process is gone, the next ``receive`` notices."""
        with contextlib.suppress(ConnectionError):
            self._socket.send(bytes([index]))

    def close(self) -> None:
        """End the process."""
        self._socket.close()
        self._end()

    def _end(self) -> str:
        """Describe how it ended."""
        try:
            status = self._process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            status = self._process.wait()
        return f"was ended by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"


class LibcameraCamera:
    """A camera that delivers the newest image, stamped by libcamera.

    ``device``: the sensor's name, whole or in part ("imx219"), the camera's id, or a node in /dev that is its own.
    The images show the whole field of view where the sensor has a mode for that at ``fps``. ``pixel_format``: one of
    those that libcamera offers and ``luminance`` reads; ``auto``: the cheapest. ``exposure_s``, ``gain`` (1: none)
    and ``power_line_hz`` (0, 50, 60) lock what they name; None: automatic. Autofocus is off, the lens where it is sharp
    from near to far. ``command``: runs libcamera. Raises ``DriverError``; what is not granted raises
    ``UnsupportedSettingError`` with what is offered, a system without libcamera ``MissingSoftwareError``.

    ``mode``: what was granted.

    ``counts``: ``dropped`` (libcamera counted them, nobody got them), ``overtaken`` (a newer image was there),
    ``late`` (delivered, but older than two intervals), ``corrupt``, ``short`` (refused), ``stamped at arrival`` (the
    stamp was impossible).
    """

    def __init__(
        self,
        device: str,
        *,
        width: int = 640,
        height: int = 480,
        fps: float = 30.0,
        pixel_format: str = "auto",
        exposure_s: float | None = None,
        gain: float | None = None,
        power_line_hz: int | None = None,
        clock: Clock = SYSTEM_CLOCK,
        command: Sequence[str] | None = None,
    ) -> None:
        self.name = device
        self.counts: Counter[str] = Counter()
        self._clock = clock
        request = {
            "device": device,
            "width": width,
            "height": height,
            "fps": fps,
            "format": pixel_format,
            "exposure_s": exposure_s,
            "gain": gain,
            "power_line_hz": power_line_hz,
        }
        with contextlib.ExitStack() as resources:
            self._process = _Process(device, request, command or COMMAND)
            resources.callback(self._process.close)
            ready, self._descriptors = _first(self._process, device)
            for descriptor in self._descriptors:
                resources.callback(os.close, descriptor)
            if not isinstance(ready, _Ready) or len(ready.buffers) != len(self._descriptors):
                raise DeviceLostError(f"{device}: the buffers of libcamera did not arrive; opened again")
            self.mode = Mode(ready.format, ready.width, ready.height, ready.stride, ready.fps)
            self._memory = _map(device, self._descriptors, ready.buffers, resources)
            self._places = ready.buffers
            self._resources = resources.pop_all()
        self._queued_ns = [clock.monotonic_ns()] * len(self._memory)
        self._arrivals = Arrivals(device, fps, self.counts, STARTING_S)
        self._interval_ns = round(1e9 / fps)

    def read(self) -> Sequence[Frame]:
        """Return the newest image, after waiting at most ``MAX_WAIT_S``. Raises ``DriverError``."""
        began_ns = self._clock.monotonic_ns()
        frames = self._take() if self._process.wait(MAX_WAIT_S) else []
        if not frames:
            self._arrivals.wait(self._clock.monotonic_ns() - began_ns)
        return frames

    def close(self) -> None:
        """Close the camera."""
        self._resources.close()

    def _take(self) -> list[Frame]:
        """Return the image of the newest filled buffer; all go back to libcamera."""
        filled: list[_FilledBuffer] = []
        while len(filled) < len(self._memory) and (received := self._process.receive()) is not None:
            filled_buffer = received[0]
            if isinstance(filled_buffer, _FilledBuffer) and 0 <= filled_buffer.index < len(self._memory):
                self._arrivals.number(filled_buffer.sequence)
                filled.append(filled_buffer)
        if not filled:
            return []
        now_ns = self._clock.monotonic_ns()
        *older, newest = filled
        for filled_buffer in older:
            self._give_back(filled_buffer.index)
        self.counts["overtaken"] += len(older)
        claimed_ns = monotonic(newest.stamp_ns, now_ns + self._interval_ns)
        stamp_ns = self._arrivals.stamp(claimed_ns, self._queued_ns[newest.index], now_ns)
        try:
            if len(filled) == len(self._memory) and (self._arrivals.is_late(stamp_ns, now_ns) or stamp_ns == now_ns):
                # All buffers were full, so the camera dropped newer images; a fresh one is on its way.
                self.counts["overtaken"] += 1
                return []
            image = self._luminance(newest)
        except FrameError as error:
            self.counts[str(error)] += 1
            return []
        finally:
            self._give_back(newest.index)
        self._arrivals.deliver(stamp_ns, now_ns)
        return [Frame(stamp_ns, self._arrivals.seq, image)]

    def _give_back(self, index: int) -> None:
        self._queued_ns[index] = self._clock.monotonic_ns()
        self._process.give_back(index)

    def _luminance(self, filled_buffer: _FilledBuffer) -> Grey:
        if not filled_buffer.good:
            raise FrameError("corrupt")
        mode, descriptor = self.mode, self._descriptors[filled_buffer.index]
        offset, length = self._places[filled_buffer.index]
        end = offset + min(filled_buffer.size, length)
        _sync(descriptor, _BEGIN_READ)
        try:
            with memoryview(self._memory[filled_buffer.index]) as memory, memory[offset:end] as data:
                return luminance(mode.pixel_format, data, mode.width, mode.height, mode.stride)
        finally:
            _sync(descriptor, _END_READ)


def cameras(command: Sequence[str] | None = None) -> list[Listed]:
    """List the cameras that libcamera finds. Raises ``DriverError``."""
    with contextlib.closing(_Process("libcamera", {"device": ""}, command or COMMAND)) as process:
        message, _ = _first(process, "libcamera")
        return message.cameras if isinstance(message, _Cameras) else []


def monotonic(stamp_ns: int, latest_ns: int) -> int:
    """Convert a stamp of CLOCK_BOOTTIME or CLOCK_MONOTONIC to CLOCK_MONOTONIC, where it is at most ``latest_ns``.

    libcamera documents its stamps as the former, but passes on the kernel's, which are the latter. The clocks differ by
    the time that the computer was suspended.
    """
    if stamp_ns <= latest_ns:
        return stamp_ns
    return stamp_ns - (time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.clock_gettime_ns(time.CLOCK_MONOTONIC))


def _first(process: _Process, name: str) -> tuple[_Message, list[int]]:
    """Return the first message that answers the request."""
    received = process.receive() if process.wait(OPENING_S) else None
    if received is None:
        raise DeviceStalledError(f"{name}: libcamera has not opened it within {OPENING_S:g} s; opened again")
    return received


def _map(
    name: str, descriptors: list[int], places: list[tuple[int, int]], resources: contextlib.ExitStack
) -> list[mmap.mmap]:
    memory = []
    for descriptor, (offset, length) in zip(descriptors, places, strict=True):
        try:
            memory.append(mmap.mmap(descriptor, offset + length, mmap.MAP_SHARED, mmap.PROT_READ))
        except (OSError, ValueError) as error:
            raise DeviceLostError(f"{name}: cannot map its buffers ({error}); opened again") from error
        resources.callback(memory[-1].close)
    return memory


def _sync(descriptor: int, phase: bytes) -> None:
    """Make what the camera wrote visible to the processor, where caches are not coherent."""
    with contextlib.suppress(OSError):  # memory that is no dma-buf needs none
        fcntl.ioctl(descriptor, _SYNC, phase)


def _list() -> int:
    """Print the cameras that libcamera finds. Return the exit status: 1, with a line on stderr, for none."""
    found = cameras()
    if not found:
        usb = by_hand.list_command("drivers.camera.v4l2")
        sys.stderr.write(f"libcamera finds no camera; check the ribbon cable, at both ends; those at USB: {usb}\n")
        return 1
    sys.stdout.writelines(f"{camera.name}: {camera.id}\n" for camera in found)
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Run a camera by hand."""
    return by_hand.run(
        argv,
        "drivers.camera.libcamera",
        device="sensor's name, camera's id, or a node in /dev",
        listed="list the cameras that libcamera finds",
        list_cameras=_list,
        camera=LibcameraCamera,
    )


if __name__ == "__main__":
    sys.exit(main())
