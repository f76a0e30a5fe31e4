"""The recorder: input and output of the pipeline, encoded in one thread and written in another.

Callers never wait: records go into an inbox of fixed size, then, encoded, into a backlog of fixed size or the ring of
the last seconds. Records that do not fit are dropped and counted, images first.
"""

import threading
import time
from collections.abc import Callable, Sequence

import numpy as np

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.cdr import CdrError
from lcf_edge.config import Config
from lcf_edge.daemon.backlog import Backlog
from lcf_edge.daemon.clock import SystemTime
from lcf_edge.daemon.disk_writer import DiskWriter, EndOfFile
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import Kind, PipelineScene, View
from lcf_edge.recording.write.destination import MIB, Destination
from lcf_edge.recording.write.messages import (
    IMAGES,
    Encoder,
    FrameAndScene,
    KnownLens,
    Record,
    RecordedMessage,
    Statuses,
)
from lcf_edge.recording.write.ring import Ring, size_bytes
from lcf_edge.sinks.sink import Sink

INBOX_BYTES = 2 * MIB
SHED_BYTES = MIB  # of the backlog, when memory is short
_RESERVE = 1 / 8  # of inbox and backlog is reserved for what is no image
_SAMPLE_BYTES = 512
_STATUSES_BYTES = 8192
_WAKE_S = 0.25
_PROBABLE = 0.5  # least probability that an object is met


class Recorder(Sink):
    """Records by ``config.record``, whose ``when`` is not ``never``, into ``destination``."""

    name = "recorder"
    sheds = "most of the recording buffer"

    def __init__(
        self, config: Config, destination: Destination, system_time: SystemTime, known_lens: KnownLens
    ) -> None:
        self._when, self._ttc_s = config.record.when, config.record.ttc_s
        self._after_ns = round(config.record.after_s * 1e9)
        self._buffer_bytes = round(config.record.buffer_mib * MIB)
        self._inbox: Backlog[Record] = Backlog(INBOX_BYTES)
        self._backlog: Backlog[RecordedMessage | EndOfFile] = Backlog(self._buffer_bytes)
        self._ring = Ring(config.record.before_s)
        self._saving_until_ns: int | None = None  # while there is a threat, and shortly after
        self._events = 0
        self._unfit = 0
        self._encoder = Encoder(config, known_lens)
        self._destination = destination
        self._encoding = threading.Thread(target=self._encode, name="recorder", daemon=True)
        self._disk = DiskWriter(config, self._backlog, destination, system_time)

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:  # noqa: ARG002
        """Record a frame and its scene, with the stamp of the frame. Takes a few µs."""
        taken = frame.image.nbytes + scene.circles.nbytes + scene.psi.nbytes + scene.objects.nbytes
        self._inbox.put(FrameAndScene(frame, scene), taken, round(INBOX_BYTES * _RESERVE))

    def put_sample(self, sample: ImuSample | SpeedSample) -> None:
        """Record a sample."""
        self._inbox.put(sample, _SAMPLE_BYTES)

    def put_diagnostics(self, stamp_ns: int, statuses: Sequence[DeviceStatus]) -> None:
        """Record the status of each part of the daemon."""
        self._inbox.put(Statuses(stamp_ns, statuses), _STATUSES_BYTES)

    def show_config(self, config: Config) -> None:
        """Take the configuration now in effect; it is attached to the file."""
        self._encoder.config = self._disk.config = config
        self._backlog.limit_bytes = self._buffer_bytes

    def shed(self) -> None:
        """Give up most of the memory."""
        self._backlog.limit_bytes = min(SHED_BYTES, self._buffer_bytes)

    def start(self) -> None:
        """Start both threads."""
        self._encoding.start()
        self._disk.start()

    def close(self) -> None:
        """Accept nothing more; what was accepted is still written."""
        self._inbox.close()

    def join(self, timeout_s: float) -> bool:
        """Wait until all is written and the file closed; False: timeout."""
        deadline_s = time.monotonic() + timeout_s
        for thread in (self._encoding, self._disk):
            if thread.ident is not None:
                thread.join(max(deadline_s - time.monotonic(), 0))
        return not self._disk.is_alive()

    @property
    def dropped(self) -> int:
        """Number of records and messages that did not fit, or that the disk refused."""
        return self._inbox.dropped + self._backlog.dropped + self._disk.counts["lost"]

    @property
    def frames(self) -> int:
        """Number of frames written."""
        return self._disk.counts["pictures"]

    def status(self) -> DeviceStatus:
        """Return its status, for the diagnostics."""
        disk = self._disk
        file, trouble = disk.file, disk.trouble
        idle = "waits for a threat" if self._when == "threat" else "waits for something to record"
        message = trouble or (f"records into {file.path}" if file else idle)
        values = {
            "written_mib": f"{disk.written_bytes / MIB:.1f}",
            "held_mib": f"{(self._inbox.bytes + self._backlog.bytes + self._ring.bytes) / MIB:.2f}",
            "files": str(disk.counts["files"]),
            "files removed": str(self._destination.removed),
            "messages": str(disk.counts["messages"]),
            "pictures": str(disk.counts["pictures"]),
            "dropped before encoding": str(self._inbox.dropped),
            "dropped before the disk": str(self._backlog.dropped),
            "lost to the disk": str(disk.counts["lost"]),
            "unfit": str(self._unfit + disk.counts["unfit"]),
        }
        if self._when == "threat":
            values["threats"] = str(self._events)
        return DeviceStatus("recorder", Level.WARN if trouble else Level.OK, message, values)

    def summary(self) -> str:
        """Return in one line what was recorded."""
        disk = self._disk
        counts = disk.counts
        files = "one file" if counts["files"] == 1 else f"{counts['files']} files"
        dropped = f", {self.dropped} messages dropped" if self.dropped else ""
        return (
            f"{counts['pictures']} images, {counts['messages']} messages, {disk.written_bytes / MIB:.1f} MiB "
            f"in {files}{dropped}"
        )

    def _encode(self) -> None:
        while not self._inbox.ended:
            for record in self._inbox.take(0, _WAKE_S):
                self._watch(record)
                try:
                    for message in self._encoder.encode(record):
                        self._keep(message)
                except CdrError:
                    self._unfit += 1
        self._backlog.close()

    def _watch(self, record: Record) -> None:
        """Save the ring when a threat appears; end the file when the threat is over."""
        if self._when != "threat":
            return
        if isinstance(record, FrameAndScene) and _threatens(record.scene, self._ttc_s):
            if self._saving_until_ns is None:
                self._events += 1
                for message in self._ring.take():
                    self._pass_on(message)
            self._saving_until_ns = record.frame.stamp_ns + self._after_ns
        elif (
            isinstance(record, FrameAndScene | Statuses)
            and self._saving_until_ns is not None
            and _stamp_ns(record) > self._saving_until_ns
        ):
            self._saving_until_ns = None
            self._backlog.put(EndOfFile(), 0)

    def _keep(self, message: RecordedMessage) -> None:
        if self._when == "always" or self._saving_until_ns is not None:
            self._pass_on(message)
        else:
            limit_bytes = round(self._backlog.limit_bytes * (1 - _RESERVE))
            self._ring.add(message, limit_bytes - self._backlog.bytes)

    def _pass_on(self, message: RecordedMessage) -> None:
        reserve_bytes = round(self._backlog.limit_bytes * _RESERVE) if message.topic is IMAGES else 0
        self._backlog.put(message, size_bytes(message), reserve_bytes)


def _stamp_ns(record: FrameAndScene | Statuses) -> int:
    return record.frame.stamp_ns if isinstance(record, FrameAndScene) else record.stamp_ns


def _threatens(scene: PipelineScene, ttc_s: float) -> bool:
    """Whether ``ttc_s`` is undercut by an object with probable contact, or by a rebel circle without an object."""
    circles, objects = scene.circles, scene.objects
    alone = (circles["kind"] == Kind.REBEL) & (scene.circle_objects == 0)
    met = objects["probability"] >= _PROBABLE
    return bool(np.any(alone & (circles["ttc"] < ttc_s)) or np.any(met & (objects["ttc"] < ttc_s)))
