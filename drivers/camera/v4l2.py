"""A camera on the kernel's V4L2 interface: capture into memory-mapped buffers.

Source: Linux "Video for Linux API" (Documentation/userspace-api/media/v4l), chapters Streaming I/O, Buffers (time
stamps and their source), and the requests named in ``v4l2_ioctl``.
By hand: ``python -m drivers.camera.v4l2 [DEVICE] [--list]``.
"""

import contextlib
import errno
import mmap
import os
import select
import sys
from collections import Counter
from collections.abc import Sequence

from drivers.camera import by_hand, controls, offers
from drivers.camera.arrival import Arrivals
from drivers.camera.find import cameras, open_camera_node
from drivers.camera.luminance import PIXEL_FORMATS, REDUCTIONS, FrameError, Grey, luminance, min_stride
from drivers.camera.mode import Mode
from drivers.camera.v4l2_buffers import Buffers, Filled, buffers_of
from drivers.camera.v4l2_errors import NOT_IMPLEMENTED, as_driver_errors, started
from drivers.camera.v4l2_ioctl import (
    CAP_TIMEPERFRAME,
    FIELD_ANY,
    FIELD_NONE,
    FLAG_ERROR,
    FLAG_STAMP_SOURCE_MASK,
    FLAG_STAMPED_AT_EXPOSURE,
    FLAG_TIMESTAMP_MASK,
    FLAG_TIMESTAMP_MONOTONIC,
    LINUX,
    MEMORY_MMAP,
    REQBUFS,
    S_PARM,
    STREAMOFF,
    STREAMON,
    BufferType,
    Kernel,
    Node,
    RequestBuffers,
    StreamParm,
)
from drivers.clock import SYSTEM_CLOCK, Clock
from drivers.errors import DeviceLostError, UnsupportedSettingError
from drivers.samples import Frame

BUFFERS = 4  # one being filled, one being read, two for the time in between
MAX_WAIT_S = 0.25  # of one read
_GONE = select.POLLERR | select.POLLHUP | select.POLLNVAL


class V4l2Camera:
    """A camera that delivers the newest image, stamped by the kernel.

    ``device``: a path, a link in ``/dev/v4l/by-id`` or the camera's own name. ``pixel_format``: one of
    ``PIXEL_FORMATS``, or ``auto`` for the first of them that the camera has at that size and rate. ``exposure_s``,
    ``gain`` (in the camera's own units) and ``power_line_hz`` (0, 50, 60) lock what they name; None: the camera's
    automatic. Raises ``DriverError``; what is not granted raises ``UnsupportedSettingError`` with what is offered.

    ``mode``: what was granted. ``stamped_at_exposure``: whether the kernel's stamps are of the start of exposure (after
    the first image; else of the end of the frame, a constant later, which belongs into the time offset between camera
    and IMU).

    ``counts``: ``dropped`` (the camera counted them, nobody got them), ``overtaken`` (a newer image was there),
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
        with as_driver_errors(device), contextlib.ExitStack() as resources:
            self._node = open_camera_node(device, kernel)
            resources.callback(self._node.close)
            self._buffers = buffers_of(self._node)
            self.mode = _set_mode(self._node, self._buffers, pixel_format, width, height, fps)
            controls.set_power_line(self._node, power_line_hz)
            controls.set_exposure(self._node, exposure_s)
            controls.set_gain(self._node, gain)
            self._memory = _map_buffers(self._node, self._buffers, resources)
            self._queued_ns = [0] * len(self._memory)
            for index in range(len(self._memory)):
                self._queue(index)
            with started(device):
                self._node.ask(STREAMON, BufferType(self._node.buffer_type))
            resources.callback(self._node.ask, STREAMOFF, BufferType(self._node.buffer_type))
            self._resources = resources.pop_all()
        self._arrivals = Arrivals(device, self.mode.fps, self.counts)

    def read(self) -> Sequence[Frame]:
        """Return the newest image, after waiting at most ``MAX_WAIT_S``. Raises ``DriverError``."""
        began_ns = self._clock.monotonic_ns()
        with as_driver_errors(self.name):
            events = self._node.poll(MAX_WAIT_S)
            if events & _GONE:
                raise DeviceLostError(f"{self.name}: unplugged or failed; plug it in again")
            frames = self._take() if events else []
        if not frames:
            self._arrivals.wait(self._clock.monotonic_ns() - began_ns)
        return frames

    def close(self) -> None:
        """Close the camera."""
        with contextlib.suppress(OSError):
            self._resources.close()

    def _take(self) -> list[Frame]:
        """Return the image of the newest filled buffer; all go back to the camera."""
        filled: list[Filled] = []
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
        late = self._arrivals.is_late(stamp_ns, now_ns)
        try:
            if len(filled) == len(self._memory) and (late or stamp_ns == now_ns):
                # All buffers were full, so the camera dropped newer images; a fresh one is on its way.
                self.counts["overtaken"] += 1
                return []
            image = self._luminance(newest)
        except FrameError as error:
            self.counts[str(error)] += 1
            return []
        finally:
            self._queue(newest.index)
        self._arrivals.deliver(stamp_ns, now_ns)
        return [Frame(stamp_ns, self._arrivals.seq, image)]

    def _dequeue(self) -> Filled | None:
        """Dequeue a filled buffer and count its image; None: there is none."""
        try:
            filled = self._buffers.dequeue(self._node)
        except BlockingIOError:
            return None
        self._arrivals.number(filled.sequence)
        return filled

    def _queue(self, index: int) -> None:
        self._queued_ns[index] = self._clock.monotonic_ns()
        self._buffers.queue(self._node, index)

    def _stamp(self, filled: Filled, now_ns: int) -> int:
        """Return the kernel's stamp if it is plausible, else now."""
        self.stamped_at_exposure = filled.flags & FLAG_STAMP_SOURCE_MASK == FLAG_STAMPED_AT_EXPOSURE
        monotonic = filled.flags & FLAG_TIMESTAMP_MASK == FLAG_TIMESTAMP_MONOTONIC
        return self._arrivals.stamp(filled.stamp_ns if monotonic else None, self._queued_ns[filled.index], now_ns)

    def _luminance(self, filled: Filled) -> Grey:
        if filled.flags & FLAG_ERROR:
            raise FrameError("corrupt")
        mode = self.mode
        with memoryview(self._memory[filled.index]) as memory, memory[filled.start : filled.end] as data:
            return luminance(mode.pixel_format, data, mode.width, mode.height, mode.stride, mode.reduction)


def _set_mode(node: Node, buffers: Buffers, pixel_format: str, width: int, height: int, fps: float) -> Mode:
    """Set format, size and rate, and read them back. Raises ``UnsupportedSettingError``, ``OSError``."""
    candidates = PIXEL_FORMATS if pixel_format == "auto" else (pixel_format,)
    readable = [name for name in offers.formats(node) if name in PIXEL_FORMATS]
    choices = [(name, 1) for name in candidates if name in readable]
    choices += [("MJPG", reduction) for reduction in REDUCTIONS if reduction > 1 and ("MJPG", 1) in choices]
    fitting = [
        (name, reduction)
        for name, reduction in choices
        if offers.grants(node, name, width * reduction, height * reduction, fps)
    ]
    refusal = UnsupportedSettingError(
        f"{node.name}: no {pixel_format if pixel_format != 'auto' else 'format that can be read'} of {width}x{height} "
        f"at {fps:g}/s; offered: {'; '.join(offers.describe(node, readable)) or 'nothing that can be read'}"
    )
    if not fitting:
        raise refusal
    name, reduction = fitting[0]
    size = width * reduction, height * reduction
    granted = buffers.set_format(node, name, *size)
    if (granted.width, granted.height, granted.pixel_format) != (*size, name):
        raise refusal
    if granted.field not in {FIELD_ANY, FIELD_NONE}:
        raise UnsupportedSettingError(f"{node.name}: only interlaced images; choose another size or camera")
    granted_fps = _set_rate(node, fps)
    if abs(granted_fps / fps - 1) > offers.RATE_TOLERANCE:
        raise refusal
    return Mode(name, width, height, max(granted.stride, min_stride(name, width)), granted_fps, reduction)


def _set_rate(node: Node, fps: float) -> float:
    """Set the rate; return what was granted, or the requested one where it cannot be set."""
    parameters = StreamParm(type=node.buffer_type, numerator=1000, denominator=round(1000 * fps))
    try:
        granted = node.ask(S_PARM, parameters)
    except OSError as error:
        if error.errno in NOT_IMPLEMENTED:
            return fps
        raise
    tells = granted.capability & CAP_TIMEPERFRAME and granted.numerator and granted.denominator
    return float(granted.denominator / granted.numerator) if tells else fps


def _map_buffers(node: Node, buffers: Buffers, resources: contextlib.ExitStack) -> list[mmap.mmap]:
    request = RequestBuffers(count=BUFFERS, type=node.buffer_type, memory=MEMORY_MMAP)
    count = node.ask(REQBUFS, request).count
    if count < 2:  # one to fill while the other is read
        raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
    memory = []
    for index in range(count):
        memory.append(node.map(*buffers.place(node, index)))
        resources.callback(memory[-1].close)
    return memory


def _list() -> int:
    """Print cameras and their readable formats. Return the exit status: 1, with a line on stderr, for none."""
    listed = 0
    for listed, node in enumerate(cameras(), start=1):  # noqa: B007  # how many there were
        with as_driver_errors(node.path):
            offered = offers.formats(node)
            readable = [name for name in offered if name in PIXEL_FORMATS]
            sys.stdout.write(f"{node.path}: {node.card}\n")
            sys.stdout.writelines(f"  {line}\n" for line in offers.describe(node, readable))
            if others := sorted(set(offered) - set(readable)):
                sys.stdout.write(f"  not read: {', '.join(others)}\n")
    if not listed:
        ribbon = f"those at a ribbon cable: {by_hand.list_command('drivers.camera.libcamera')}"
        sys.stderr.write(f"no camera can be opened; lcf-edge doctor says why; {ribbon}\n")
    return 0 if listed else 1


def main(argv: Sequence[str] | None = None) -> int:
    """Run a camera by hand."""
    return by_hand.run(
        argv,
        "drivers.camera.v4l2",
        device="path, /dev/v4l/by-id/..., or the camera's name",
        listed="list the cameras and what they offer",
        list_cameras=_list,
        camera=V4l2Camera,
        formats=("auto", *PIXEL_FORMATS),
        gain=int,
    )


if __name__ == "__main__":
    sys.exit(main())
