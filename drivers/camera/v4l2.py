"""A camera on the kernel's V4L2 interface: single-planar capture into memory-mapped buffers.

Source: Linux "Video for Linux API" (Documentation/userspace-api/media/v4l), chapters Streaming I/O, Buffers (time
stamps and their source), and the requests named in ``v4l2_ioctl``.
By hand: ``python -m drivers.camera.v4l2 [DEVICE] [--list]``.
"""

import argparse
import contextlib
import errno
import mmap
import os
import select
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.by_hand import watch
from drivers.camera import controls, offers
from drivers.camera.find import cameras, open_camera_node
from drivers.camera.luminance import PIXEL_FORMATS, FrameError, Grey, least_stride, luminance
from drivers.camera.v4l2_errors import NOT_IMPLEMENTED, started, told
from drivers.camera.v4l2_ioctl import (
    CAP_TIMEPERFRAME,
    DQBUF,
    FIELD_ANY,
    FIELD_NONE,
    FLAG_ERROR,
    FLAG_STAMP_SOURCE_MASK,
    FLAG_STAMPED_AT_EXPOSURE,
    FLAG_TIMESTAMP_MASK,
    FLAG_TIMESTAMP_MONOTONIC,
    LINUX,
    MEMORY_MMAP,
    QBUF,
    QUERYBUF,
    REQBUFS,
    S_FMT,
    S_PARM,
    STREAMOFF,
    STREAMON,
    VIDEO_CAPTURE,
    Buffer,
    BufferType,
    Format,
    Kernel,
    Node,
    RequestBuffers,
    StreamParm,
    fourcc,
    letters,
)
from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import DeviceLostError, DeviceStalledError, DriverError, UnsupportedSettingError
from drivers.records import Frame

BUFFERS = 4  # one being filled, one being read, two for the time in between
LATE_INTERVALS = 2
STALL_INTERVALS = 10
LEAST_STALL_S = 1.0
LONGEST_WAIT_S = 0.25  # of one read
_GONE = select.POLLERR | select.POLLHUP | select.POLLNVAL
_LARGEST_GAP = 1000  # pictures; a larger step of the sequence number is the device counting anew


@dataclass(frozen=True, slots=True)
class Mode:
    """What the camera granted."""

    pixel_format: str
    width: int
    height: int
    stride: int  # bytes from one row to the next
    fps: float


class V4l2Camera:
    """A camera that delivers the newest picture, stamped by the kernel.

    ``device``: a path, a link in ``/dev/v4l/by-id`` or the camera's own name. ``pixel_format``: one of
    ``PIXEL_FORMATS``, or ``auto`` for the first of them that the camera has at that size and rate. ``exposure_s``,
    ``gain`` (in the camera's own units) and ``power_line_hz`` (0, 50, 60) lock what they name; None: the camera's
    automatic. Raises ``DriverError``; what is not granted raises ``UnsupportedSettingError`` with what is offered.

    ``mode``: what was granted. ``stamped_at_exposure``: whether the kernel's stamps are of the start of exposure (after
    the first picture; else of the end of the frame, a constant later, which belongs into the time offset between camera
    and IMU).

    ``counts``: ``dropped`` (the camera counted them, nobody got them), ``overtaken`` (a newer picture was there),
    ``late`` (delivered, but older than two intervals), ``corrupt``, ``short``, ``wrong size`` (refused), ``stamped at
    arrival`` (the kernel's stamp was of another clock or impossible).
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
        gain: int | None = None,
        power_line_hz: int | None = None,
        clock: Clock = SYSTEM_CLOCK,
        kernel: Kernel = LINUX,
    ) -> None:
        self.name = device
        self.counts: Counter[str] = Counter()
        self.stamped_at_exposure: bool | None = None
        self._clock = clock
        with told(device), contextlib.ExitStack() as resources:
            self._node = open_camera_node(device, kernel)
            resources.callback(self._node.close)
            self.mode = _set_mode(self._node, pixel_format, width, height, fps)
            controls.set_power_line(self._node, power_line_hz)
            controls.set_exposure(self._node, exposure_s)
            controls.set_gain(self._node, gain)
            self._memory = _map_buffers(self._node, resources)
            self._queued_ns = [0] * len(self._memory)
            for index in range(len(self._memory)):
                self._queue(index)
            with started(device):
                self._node.ask(STREAMON, BufferType(VIDEO_CAPTURE))
            resources.callback(self._node.ask, STREAMOFF, BufferType(VIDEO_CAPTURE))
            self._resources = resources.pop_all()
        self._interval_ns = round(1e9 / self.mode.fps)
        self._stall_ns = max(STALL_INTERVALS * self._interval_ns, round(LEAST_STALL_S * 1e9))
        self._waited_ns = 0  # in vain, since the last usable picture
        self._stamp_ns = -1
        self._sequence: int | None = None  # as the device counts, modulo 2^32
        self._seq = -1

    def read(self) -> Sequence[Frame]:
        """The newest picture, waiting at most ``LONGEST_WAIT_S``. Raises ``DriverError``."""
        began_ns = self._clock.monotonic_ns()
        with told(self.name):
            events = self._node.poll(LONGEST_WAIT_S)
            if events & _GONE:
                raise DeviceLostError(f"{self.name}: unplugged or failed; plug it in again")
            frames = self._take() if events else []
        if frames:
            self._waited_ns = 0
            return frames
        self._waited_ns += self._clock.monotonic_ns() - began_ns
        if self._waited_ns > self._stall_ns:
            raise DeviceStalledError(
                f"{self.name}: no usable picture for {self._stall_ns / 1e9:.1f} s; check cable, power and light"
            )
        return []

    def close(self) -> None:
        """Let the camera go."""
        with contextlib.suppress(OSError):
            self._resources.close()

    def _take(self) -> list[Frame]:
        """The newest of the filled buffers; all go back to the camera."""
        filled: list[Buffer] = []
        while len(filled) < len(self._memory) and (buffer := self._dequeue()) is not None:
            filled.append(buffer)
        if not filled:
            return []
        now_ns = self._clock.monotonic_ns()
        *older, newest = filled
        for buffer in older:
            self._queue(buffer.index)
        self.counts["overtaken"] += len(older)
        stamp_ns = self._stamp(newest, now_ns)
        late = now_ns - stamp_ns > LATE_INTERVALS * self._interval_ns
        try:
            if len(filled) == len(self._memory) and (late or stamp_ns == now_ns):
                # Without a free buffer the camera dropped what came after these; a fresh picture is on its way.
                self.counts["overtaken"] += 1
                return []
            image = self._luminance(newest)
        except FrameError as error:
            self.counts[str(error)] += 1
            return []
        finally:
            self._queue(newest.index)
        self.counts["late"] += late
        self._stamp_ns = stamp_ns
        return [Frame(stamp_ns, self._seq, image)]

    def _dequeue(self) -> Buffer | None:
        """A filled buffer, its picture counted; None: there is none."""
        try:
            buffer = self._node.ask(DQBUF, Buffer(type=VIDEO_CAPTURE, memory=MEMORY_MMAP))
        except BlockingIOError:
            return None
        step = 1 if self._sequence is None else (buffer.sequence - self._sequence) % 2**32
        if not 0 < step <= _LARGEST_GAP:
            step = 1  # it does not count, or counts anew
        self._sequence = buffer.sequence
        self._seq += step
        self.counts["dropped"] += step - 1
        return buffer

    def _queue(self, index: int) -> None:
        self._queued_ns[index] = self._clock.monotonic_ns()
        self._node.ask(QBUF, Buffer(index=index, type=VIDEO_CAPTURE, memory=MEMORY_MMAP))

    def _stamp(self, buffer: Buffer, now_ns: int) -> int:
        """The kernel's stamp where it can be true, else now.

        True: of the monotonic clock, after the last one, not long before the buffer was given to the camera, and not in
        the future, give or take an interval (some drivers reckon when the frame will have ended).
        """
        self.stamped_at_exposure = buffer.flags & FLAG_STAMP_SOURCE_MASK == FLAG_STAMPED_AT_EXPOSURE
        stamp_ns = int(buffer.seconds) * 1_000_000_000 + int(buffer.microseconds) * 1_000
        earliest_ns = max(self._queued_ns[buffer.index] - LATE_INTERVALS * self._interval_ns, self._stamp_ns + 1)
        monotonic = buffer.flags & FLAG_TIMESTAMP_MASK == FLAG_TIMESTAMP_MONOTONIC
        if monotonic and earliest_ns <= stamp_ns <= now_ns + self._interval_ns:
            return stamp_ns
        self.counts["stamped at arrival"] += 1
        return now_ns

    def _luminance(self, buffer: Buffer) -> Grey:
        if buffer.flags & FLAG_ERROR:
            raise FrameError("corrupt")
        mode = self.mode
        with memoryview(self._memory[buffer.index]) as memory, memory[: buffer.bytesused] as data:
            return luminance(mode.pixel_format, data, mode.width, mode.height, mode.stride)


def _set_mode(node: Node, pixel_format: str, width: int, height: int, fps: float) -> Mode:
    """Format, size and rate, set and read back. Raises ``UnsupportedSettingError``, ``OSError``."""
    wanted = PIXEL_FORMATS if pixel_format == "auto" else (pixel_format,)
    readable = [name for name in offers.formats(node) if name in PIXEL_FORMATS]
    fitting = [name for name in wanted if name in readable and offers.grants(node, name, width, height, fps)]
    refusal = UnsupportedSettingError(
        f"{node.name}: no {' or '.join(wanted)} of {width}x{height} at {fps:g}/s; "
        f"offered: {'; '.join(offers.describe(node, readable)) or 'nothing that can be read'}"
    )
    if not fitting:
        raise refusal
    asked = Format(type=VIDEO_CAPTURE, width=width, height=height, pixelformat=fourcc(fitting[0]), field=FIELD_NONE)
    granted = node.ask(S_FMT, asked)
    if (granted.width, granted.height, letters(granted.pixelformat)) != (width, height, fitting[0]):
        raise refusal
    if granted.field not in {FIELD_ANY, FIELD_NONE}:
        raise UnsupportedSettingError(f"{node.name}: only interlaced pictures; choose another size or camera")
    stride = max(granted.bytesperline, least_stride(fitting[0], width))
    granted_fps = _set_rate(node, fps)
    if abs(granted_fps / fps - 1) > offers.RATE_TOLERANCE:
        raise refusal
    return Mode(fitting[0], width, height, stride, granted_fps)


def _set_rate(node: Node, fps: float) -> float:
    """The rate that the camera will have; the one that was asked for where it cannot be told anything."""
    parameters = StreamParm(type=VIDEO_CAPTURE, numerator=1000, denominator=round(1000 * fps))
    try:
        granted = node.ask(S_PARM, parameters)
    except OSError as error:
        if error.errno in NOT_IMPLEMENTED:
            return fps
        raise
    tells = granted.capability & CAP_TIMEPERFRAME and granted.numerator and granted.denominator
    return float(granted.denominator / granted.numerator) if tells else fps


def _map_buffers(node: Node, resources: contextlib.ExitStack) -> list[mmap.mmap]:
    request = RequestBuffers(count=BUFFERS, type=VIDEO_CAPTURE, memory=MEMORY_MMAP)
    count = node.ask(REQBUFS, request).count
    if count < 2:  # one to fill while the other is read
        raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
    memory = []
    for index in range(count):
        buffer = node.ask(QUERYBUF, Buffer(index=index, type=VIDEO_CAPTURE, memory=MEMORY_MMAP))
        memory.append(node.map(buffer))
        resources.callback(memory[-1].close)
    return memory


def _list() -> int:
    """Cameras, and which of their formats can be read."""
    for node in cameras():
        with told(node.path):
            offered = offers.formats(node)
            readable = [name for name in offered if name in PIXEL_FORMATS]
            sys.stdout.write(f"{node.path}: {node.card}\n")
            sys.stdout.writelines(f"  {line}\n" for line in offers.describe(node, readable))
            if others := sorted(set(offered) - set(readable)):
                sys.stdout.write(f"  not read: {', '.join(others)}\n")
    return 0


def main(argv: Sequence[str] | None = None) -> int:
    """Run a camera by hand."""
    parser = argparse.ArgumentParser(prog="python -m drivers.camera.v4l2", description="Run a camera by hand.")
    parser.add_argument(
        "device", nargs="?", default="/dev/video0", help="path, /dev/v4l/by-id/..., or the camera's name"
    )
    parser.add_argument("--list", action="store_true", help="list the cameras and what they offer")
    parser.add_argument("--width", type=int, default=640, help="px")
    parser.add_argument("--height", type=int, default=480, help="px")
    parser.add_argument("--fps", type=float, default=30.0, help="frames a second")
    parser.add_argument("--format", choices=("auto", *PIXEL_FORMATS), default="auto")
    parser.add_argument("--exposure-s", type=float)
    parser.add_argument("--gain", type=int)
    parser.add_argument("--power-line-hz", type=int, choices=(0, 50, 60))
    parser.add_argument("--seconds", type=float, default=10.0)
    arguments = parser.parse_args(argv)
    if arguments.fps <= 0:
        parser.error("argument --fps: must be positive")
    if arguments.list:
        try:
            return _list()
        except DriverError as error:
            sys.stderr.write(f"{error}\n")
            return error.exit_status

    def open_device() -> V4l2Camera:
        return V4l2Camera(
            arguments.device,
            width=arguments.width,
            height=arguments.height,
            fps=arguments.fps,
            pixel_format=arguments.format,
            exposure_s=arguments.exposure_s,
            gain=arguments.gain,
            power_line_hz=arguments.power_line_hz,
        )

    return watch(open_device, arguments.seconds, _describe)


def _describe(frame: Frame) -> str:
    height, width = frame.image.shape
    return f"{width}x{height}, mean {frame.image.mean():.0f}"


if __name__ == "__main__":
    sys.exit(main())
