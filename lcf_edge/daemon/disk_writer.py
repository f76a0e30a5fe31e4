"""The thread that writes messages from the backlog to files, so that no other thread waits for the disk."""

import errno
import threading
import time
from collections import Counter

import msgspec

from lcf_edge.cdr import CdrError
from lcf_edge.config import Config
from lcf_edge.config.shown import shown
from lcf_edge.daemon.backlog import Backlog
from lcf_edge.daemon.clock import SystemTime
from lcf_edge.daemon.log import LOGGER
from lcf_edge.recording.write.destination import MIB, Destination, Named, free_mib
from lcf_edge.recording.write.messages import IMAGES, RecordedMessage
from lcf_edge.recording.write.recording_file import CHUNK_BYTES, RecordingFile

SYNC_S = 0.5
"""A power cut loses this much of a recording, plus the time the disk takes to write it."""

RETRY_S = 2.0
_TAKEN_BYTES = CHUNK_BYTES // 4
_LACK_OF_ROOM = {errno.ENOSPC, errno.EDQUOT}  # the file can be continued once there is room


class EndOfFile:
    """Placed among the messages: what follows goes into a new file."""


class DiskWriter(threading.Thread):
    """Writes the messages of ``backlog``, until that is closed and empty. If the disk fails, only messages are lost.

    For others to read: ``trouble`` (why nothing is written; None: all is well), ``file``, ``counts``,
    ``written_bytes``.
    """

    def __init__(
        self,
        config: Config,
        backlog: Backlog[RecordedMessage | EndOfFile],
        destination: Destination,
        system_time: SystemTime,
    ) -> None:
        super().__init__(name="recorder's disk", daemon=True)
        self.config = config
        self.trouble: str | None = None
        self.file: RecordingFile | None = None
        self.counts: Counter[str] = Counter(files=0, messages=0, pictures=0, lost=0, unfit=0)
        self._backlog = backlog
        self._destination = destination
        self._system_time = system_time
        self._begun_ns = self._sync_at_ns = self._retry_at_ns = 0
        self._attached = config
        self._unsynced = 0  # messages
        self._finished_bytes = 0

    @property
    def written_bytes(self) -> int:
        """Bytes written into all files."""
        file = self.file
        return self._finished_bytes + (file.size_bytes if file else 0)

    def run(self) -> None:
        """Write until the backlog has ended."""
        while not self._backlog.ended:
            for item in self._backlog.take(_TAKEN_BYTES, SYNC_S / 2):
                if isinstance(item, EndOfFile):
                    self._end_file()
                else:
                    self._write(item)
            self._sync()
        self._end_file()

    def _write(self, message: RecordedMessage) -> None:
        file = self.file if self.file and not self.trouble else self._made_ready()
        if file is None:
            self.counts["lost"] += 1
            return
        if self._attached is not self.config:
            self._attached = self.config
            file.attach(self._config_text(), time.monotonic_ns())
        try:
            file.add(message)
        except CdrError:
            self.counts["unfit"] += 1
            return
        self._unsynced += 1
        self.counts["messages"] += 1
        self.counts["pictures"] += message.topic is IMAGES

    def _made_ready(self) -> RecordingFile | None:
        """Return the file to continue, or a new one; None: the disk refuses, and is tried again later."""
        if self.trouble and time.monotonic_ns() < self._retry_at_ns:
            return None
        try:
            if self.file is None:
                self.file = self._begun()
            else:
                self._check_room()
                self.file.sync()
        except OSError as error:
            self._fail(error)
            return None
        LOGGER.info("recorder: %s %s", "continues in" if self.trouble else "records into", self.file.path)
        self.trouble = None
        return self.file

    def _begun(self) -> RecordingFile:
        now_ns = time.monotonic_ns()
        offset_ns = self._system_time.system_ns(0)  # the same for the whole file, even if the clock is set meanwhile
        path = self._destination.next(now_ns + offset_ns)
        self._check_room()
        self._attached = self.config
        file = RecordingFile(path, self.config.publish.prefix, self._config_text(), offset_ns, now_ns)
        self.counts["files"] += 1
        self._begun_ns, self._sync_at_ns = now_ns, now_ns + round(SYNC_S * 1e9)
        return file

    def _config_text(self) -> str:
        """Return the configuration to attach; without ``record.when`` of a file that a command asked for."""
        config = self.config
        if isinstance(self._destination, Named):
            config = msgspec.structs.replace(config, record=msgspec.structs.replace(config.record, when="never"))
        return shown(config)

    def _sync(self) -> None:
        """Sync what is due."""
        file, now_ns = self.file, time.monotonic_ns()
        if file is None or self.trouble or (now_ns < self._sync_at_ns and file.unwritten_bytes < CHUNK_BYTES):
            return
        self._sync_at_ns = now_ns + round(SYNC_S * 1e9)
        if file.vanished:
            LOGGER.warning("recorder: %s: was removed; starting the next file", file.path)
            self._drop_file()
            return
        try:
            file.sync()
            self._unsynced = 0
            self._check_room()
        except OSError as error:
            self._fail(error)
            return
        record = self.config.record
        if file.size_bytes >= record.file_mib * MIB or now_ns - self._begun_ns >= record.file_s * 1e9:
            self._end_file()

    def _check_room(self) -> None:
        """Raise ``OSError`` if no more of the disk may be used."""
        min_mib = self.config.record.free_mib
        if min_mib and free_mib(self._destination.folder) < min_mib:
            raise OSError(errno.ENOSPC, f"less than record.free_mib = {min_mib:g} MiB are free")

    def _fail(self, error: OSError) -> None:
        where = self.file.path if self.file else self._destination.folder
        if error.errno not in _LACK_OF_ROOM:
            self._drop_file()
        self._retry_at_ns = time.monotonic_ns() + round(RETRY_S * 1e9)
        if not self.trouble:
            self.trouble = f"{where}: cannot be written ({error.strerror})"
            LOGGER.error("recorder: %s; free the disk, or record elsewhere; still trying", self.trouble)

    def _drop_file(self) -> None:
        """Close the file as it is."""
        file, self.file = self.file, None
        if file is not None:
            file.abandon()
            self._finished_bytes += file.size_bytes
            self.counts["lost"] += self._unsynced
            self._unsynced = 0

    def _end_file(self) -> None:
        """Close the file with its summary, if the disk has room for it."""
        file, self.file = self.file, None
        if file is None:
            return
        try:
            file.finish()
        except OSError as error:
            self.counts["lost"] += self._unsynced
            self._fail(error)
        self._unsynced = 0
        self._finished_bytes += file.size_bytes
