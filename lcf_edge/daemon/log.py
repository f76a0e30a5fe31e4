"""Logs: one line per event on standard error, for journald or a terminal, rate-limited."""

import faulthandler
import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import TextIO

from lcf_edge.printable import printable

LOGGER = logging.getLogger("lcf_edge")

AT_ONCE = 5  # lines of one kind at first
EACH_S = 10.0  # then one in this time
KINDS = 256  # of lines that are remembered
MAX_LINE_CHARACTERS = 500  # of a library's

_PRIORITIES = {logging.DEBUG: 7, logging.INFO: 6, logging.WARNING: 4, logging.ERROR: 3}
_LEVELS = {"debug": logging.DEBUG, "info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}


def start(level: str, stream: TextIO | None = None, environment: Mapping[str, str] = os.environ) -> None:
    """Log to ``stream`` (standard error) at ``level`` (error, warning, info, debug) and above."""
    stream = stream or sys.stderr
    handler = logging.StreamHandler(stream)
    handler.setFormatter(_Line(journal=_is_journal(stream, environment)))
    handler.addFilter(NoFlood())
    logging.raiseExceptions = False  # a log that cannot be written must not raise
    LOGGER.handlers[:] = [handler]
    LOGGER.propagate = False
    set_level(level)


def take_over_standard_error() -> None:
    """Log what libraries write to standard error by themselves, line by line, as a libjpeg does of every bad image.

    Python's own messages, also those of a crash (``PYTHONFAULTHANDLER``), still go to the old standard error.
    """
    ours = os.fdopen(os.dup(2), "w", encoding="utf-8", errors="backslashreplace", buffering=1)
    reading, writing = os.pipe()
    os.dup2(writing, 2)
    os.close(writing)
    sys.stderr = ours
    if faulthandler.is_enabled():
        faulthandler.enable(ours)
    threading.Thread(target=_log_lines, args=(reading,), name="standard error", daemon=True).start()


def _log_lines(reading: int) -> None:
    with os.fdopen(reading, encoding="utf-8", errors="backslashreplace") as lines:
        while line := lines.readline(MAX_LINE_CHARACTERS):
            if line.strip():
                LOGGER.warning("library: %s", printable(line.strip()))


def set_level(level: str) -> None:
    """Log at ``level`` and above."""
    LOGGER.setLevel(_LEVELS[level])


def _is_journal(stream: TextIO, environment: Mapping[str, str]) -> bool:
    """Whether journald reads the stream: systemd names its device and inode (systemd.exec(5), JOURNAL_STREAM)."""
    try:
        status = os.fstat(stream.fileno())
    except (OSError, ValueError):
        return False
    return environment.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"


class _Line(logging.Formatter):
    """``<4>text`` for journald (sd-daemon(3)), else ``lcf-edge: warning: text``."""

    def __init__(self, *, journal: bool) -> None:
        super().__init__()
        self._journal = journal

    def format(self, record: logging.LogRecord) -> str:
        text = " ".join(record.getMessage().split())
        if self._journal:
            return f"<{_PRIORITIES.get(record.levelno, 6)}>{text}"
        return (
            f"lcf-edge: {text}" if record.levelno == logging.INFO else f"lcf-edge: {record.levelname.lower()}: {text}"
        )


class NoFlood(logging.Filter):
    """Lets ``AT_ONCE`` lines of a kind through, then one in ``EACH_S`` that says how many were not written.

    Lines are of one kind if they have the same message before its arguments are inserted.
    """

    def __init__(self, monotonic_s: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._monotonic_s = monotonic_s
        self._kinds: dict[str, tuple[float, float, int]] = {}  # lines still allowed, since when, lines not written

    def filter(self, record: logging.LogRecord) -> bool:
        now_s = self._monotonic_s()
        allowed, since_s, unwritten = self._kinds.pop(record.msg, (float(AT_ONCE), now_s, 0))
        allowed = min(allowed + (now_s - since_s) / EACH_S, AT_ONCE)
        if allowed < 1:
            self._kinds[record.msg] = (allowed, now_s, unwritten + 1)
            return False
        if len(self._kinds) >= KINDS:
            del self._kinds[next(iter(self._kinds))]
        self._kinds[record.msg] = (allowed - 1, now_s, 0)
        if unwritten:
            record.msg, record.args = f"{record.getMessage()} (and {unwritten} more like it)", None
        return True
