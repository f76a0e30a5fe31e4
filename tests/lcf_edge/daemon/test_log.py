"""One line an event, with a priority for journald, and never a flood."""

import io
import logging
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from lcf_edge.daemon import log
from lcf_edge.daemon.log import LOGGER


@pytest.fixture(autouse=True)
def restored() -> Iterator[None]:
    yield
    LOGGER.handlers.clear()
    LOGGER.propagate = True
    LOGGER.setLevel(logging.NOTSET)
    logging.raiseExceptions = True


def test_an_event_is_one_line() -> None:
    stream = io.StringIO()
    log.start("info", stream, {})
    LOGGER.info("camera: %s", "open\nand  well")
    LOGGER.warning("degraded: %s", "dark")
    LOGGER.error("imu: gone")
    LOGGER.debug("not told")
    assert stream.getvalue().splitlines() == [
        "lcf-edge: camera: open and well",
        "lcf-edge: warning: degraded: dark",
        "lcf-edge: error: imu: gone",
    ]


def test_journald_gets_the_priority(tmp_path: Path) -> None:
    with (tmp_path / "journal").open("w+", encoding="utf-8") as stream:
        status = os.fstat(stream.fileno())
        log.start("debug", stream, {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino}"})
        for level in (logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG):
            LOGGER.log(level, "level %d", level)
        stream.seek(0)
        assert stream.read().splitlines() == ["<3>level 40", "<4>level 30", "<6>level 20", "<7>level 10"]


def test_standard_error_that_was_redirected_is_not_journald(tmp_path: Path) -> None:
    with (tmp_path / "file").open("w+", encoding="utf-8") as stream:
        log.start("info", stream, {"JOURNAL_STREAM": "1:2"})
        LOGGER.info("hello")
        stream.seek(0)
        assert stream.read() == "lcf-edge: hello\n"


def test_a_flood_is_cut_and_counted() -> None:
    now_s = 0.0
    stream = io.StringIO()
    flood = log.NoFlood(lambda: now_s)
    log.start("info", stream, {})
    LOGGER.handlers[0].filters[:] = [flood]
    for number in range(100):
        LOGGER.warning("imu: lost sample %d", number)
    LOGGER.warning("camera: another kind")
    now_s += log.EACH_S
    LOGGER.warning("imu: lost sample %d", 100)
    lines = stream.getvalue().splitlines()
    assert len(lines) == log.AT_ONCE + 2
    assert lines[-2] == "lcf-edge: warning: camera: another kind"
    assert lines[-1] == "lcf-edge: warning: imu: lost sample 100 (and 95 more like it)"


def test_kinds_without_end_take_no_memory_without_end() -> None:
    flood: Any = log.NoFlood(lambda: 0.0)
    for number in range(5 * log.KINDS):
        assert flood.filter(logging.LogRecord("lcf_edge", logging.INFO, "", 0, f"kind {number}", (), None))
    assert len(flood._kinds) <= log.KINDS


def test_a_log_that_cannot_be_written_is_nobodys_error() -> None:
    stream = io.StringIO()
    log.start("info", stream, {})
    stream.close()
    LOGGER.info("lost")


NOISY = """
import os, sys, threading
from lcf_edge.daemon import log
log.take_over_standard_error()
log.start("info")
for _ in range(1000):
    os.write(2, b"Corrupt JPEG data: \x1b[31m premature end\\n")
log.LOGGER.info("end")
sys.stderr.write("by Python\\n")
os.close(2)  # its reader ends with it
for thread in threading.enumerate():
    if thread.name == "standard error":
        thread.join()
"""


def test_what_a_library_writes_by_itself_is_limited_too() -> None:
    done = subprocess.run((sys.executable, "-c", NOISY), check=True, capture_output=True, text=True)
    lines = done.stderr.splitlines()
    assert "by Python" in lines
    assert "lcf-edge: end" in lines
    warnings = [line for line in lines if line.startswith("lcf-edge: warning: library: Corrupt JPEG data")]
    assert 1 <= len(warnings) <= log.AT_ONCE
    assert len(lines) == len(warnings) + 2
    assert "\x1b" not in done.stderr
