"""systemd is notified by its own protocol, and nothing it does holds the daemon up."""

import os
import socket
import time
from pathlib import Path
from typing import Any

import pytest

from lcf_edge.daemon.notify import Notifier


def test_the_words_are_those_of_sd_notify(manager: Any) -> None:
    notifier = Notifier(manager.environment)
    notifier.ready()
    notifier.status("30.0 frames/s,\n 12 circles")
    notifier.alive()
    before_us = time.monotonic_ns() // 1000
    notifier.reloading()
    notifier.stopping()
    notifier.close()
    notifier.ready()  # nothing any more
    messages = [manager.next() for _ in range(5)]
    assert messages[:3] == ["READY=1", "STATUS=30.0 frames/s, 12 circles", "WATCHDOG=1"]
    first, second = messages[3].split("\n")
    assert first == "RELOADING=1"
    assert before_us <= int(second.removeprefix("MONOTONIC_USEC=")) <= time.monotonic_ns() // 1000
    assert messages[4] == "STOPPING=1"


def test_an_abstract_address_begins_with_an_at_sign() -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(f"\0lcf-edge-test-{os.getpid()}")
        notifier = Notifier({"NOTIFY_SOCKET": f"@lcf-edge-test-{os.getpid()}"})
        notifier.ready()
        assert manager.recv(100) == b"READY=1"
        notifier.close()


@pytest.mark.parametrize("address", ["", "/nowhere/at/all", "vsock:2:3", "relative"])
def test_without_somebody_who_listens_nothing_happens(address: str) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": address})
    notifier.ready()
    notifier.close()


def test_a_reader_that_does_not_read_holds_nobody_up(manager: Any) -> None:
    notifier = Notifier(manager.environment)
    for _ in range(10_000):
        notifier.ready()
    notifier.close()


@pytest.mark.parametrize(
    ("environment", "watchdog_s"),
    [
        ({}, None),
        ({"WATCHDOG_USEC": "2500000"}, 2.5),
        ({"WATCHDOG_USEC": "2500000", "WATCHDOG_PID": str(os.getpid())}, 2.5),
        ({"WATCHDOG_USEC": "2500000", "WATCHDOG_PID": "1"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
    ],
)
def test_the_watchdog_is_that_of_this_process(environment: dict[str, str], watchdog_s: float | None) -> None:
    assert Notifier(environment).watchdog_s == watchdog_s


def test_without_a_watchdog_it_is_not_fed(manager: Any, tmp_path: Path) -> None:
    notifier = Notifier({"NOTIFY_SOCKET": str(tmp_path / "notify")})
    notifier.alive()
    notifier.stopping()
    notifier.close()
    assert manager.next() == "STOPPING=1"
