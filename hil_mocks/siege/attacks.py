"""The attacks: each is a thread that repeats one thing, holds a bounded number of sockets, and ends when stopped."""

import os
import select
import signal
import socket
import threading
import time
import tty
from collections import deque
from collections.abc import Callable
from contextlib import closing, suppress
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import zenoh

from hil_mocks.serial_imu import CsvEncoder, flipped_bits, still
from lcf_edge.config import Zenoh
from lcf_edge.errors import PublishError
from lcf_edge.zenoh_link import opened_session

HELD = 150  # sockets of one attack
CONNECT_S = 1.0
DECLARED = 1000  # keys of a kind at a time
LEVELS = 40  # of a key
WILD, WILD_S = 100, 0.5  # keys with wildcards at a time; how long
LINES, LINES_AT_ONCE = 1000, 50  # of a serial IMU
FLOOD = 500  # messages and questions at a time
HTTP = b"GET / HTTP/1.0\r\n\r\n"
HALF_A_REQUEST = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "
UPGRADE = (
    b"GET /updates HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)
CLIENT_HELLO = b"\x16\x03\x01\x02\x00\x01"  # incomplete


class Attack(threading.Thread):
    """Calls ``wave`` every ``pause_s`` until it is ended. ``waves``: number of calls."""

    def __init__(self, name: str, pause_s: float, wave: Callable[[], object]) -> None:
        super().__init__(name=name, daemon=True)
        self.waves = 0
        self._pause_s, self._wave = pause_s, wave
        self._ends = threading.Event()

    def run(self) -> None:
        """Attack."""
        while not self._ends.wait(self._pause_s):
            with suppress(OSError, zenoh.ZError, PublishError):  # what is refused was refused
                self._wave()
            self.waves += 1

    def end(self) -> None:
        """Stop, and wait for the thread."""
        self._ends.set()
        self.join(10.0)


class Strangers(Attack):
    """One more connection at a time, which sends ``first`` and stays until ``HELD`` others have come."""

    def __init__(self, name: str, pause_s: float, port: int, first: bytes) -> None:
        super().__init__(name, pause_s, self._come)
        self._port, self._first = port, first
        self._held: deque[socket.socket] = deque()

    def _come(self) -> None:
        if len(self._held) == HELD:
            self._held.popleft().close()
        self._held.append(socket.create_connection(("127.0.0.1", self._port), CONNECT_S))
        self._held[-1].sendall(self._first)

    def end(self) -> None:
        """Stop, and close the connections."""
        super().end()
        for one in self._held:
            one.close()


class WildImu(Attack):
    """An IMU at the serial port ``link`` that writes whole and damaged lines as fast as they are read."""

    def __init__(self, name: str, link: Path) -> None:
        super().__init__(name, 0.0, self._write)
        self._ends_of_line = os.openpty()
        tty.setraw(self._ends_of_line[1])
        os.set_blocking(self._ends_of_line[0], False)
        link.symlink_to(os.ttyname(self._ends_of_line[1]))
        encoder, damage = CsvEncoder(), flipped_bits()
        whole = [encoder(sample) for sample in islice(still(1000.0), LINES)]
        self._pieces = cycle([line if number % 2 else damage(line) or b"" for number, line in enumerate(whole)])

    def _write(self) -> None:
        if select.select([], [self._ends_of_line[0]], [], CONNECT_S)[1]:
            os.write(self._ends_of_line[0], b"".join(islice(self._pieces, LINES_AT_ONCE)))

    def end(self) -> None:
        """Stop, and unplug."""
        super().end()
        for one in self._ends_of_line:
            os.close(one)


def liar(endpoint: str, prefix: str = "lcf") -> Callable[[], None]:
    """A local process that impersonates the rover, sends oversized messages, and queries without listening."""

    def wave() -> None:
        with opened_session(Zenoh(mode="client", connect=[endpoint], listen=[])) as session:
            token = session.liveliness().declare_token(f"{prefix}/@alive/liar")
            for key in ("scene", "speed", "diagnostics", "query/config"):
                session.put(f"{prefix}/{key}", os.urandom(64))
                session.put(f"{prefix}/{key}", bytes(1_000_000))
            for _ in range(50):
                session.get(f"{prefix}/query/*", zenoh.handlers.RingChannel(1), timeout=1.0)
            declared: list[Any] = [token]
            declared += [session.declare_subscriber(f"{prefix}/none/{n}", lambda _: None) for n in range(50)]
            for one in declared:
                one.undeclare()

    return wave


def declarer(endpoint: str, prefix: str = "lcf") -> Callable[[], None]:
    """A local process that makes useless declarations, and disconnects; Zenoh keeps part of them."""
    turn = iter(range(2**30))

    def wave() -> None:
        key = f"{prefix}/of-the-declarer/{next(turn)}"
        with opened_session(Zenoh(mode="client", connect=[endpoint], listen=[])) as session:
            tokens = [session.liveliness().declare_token(f"{key}/{n}") for n in range(DECLARED)]
            publishers = [session.declare_publisher(f"{key}/offered/{n}") for n in range(DECLARED)]
            del tokens, publishers

    return wave


def wild(endpoint: str, settings: str = "", prefix: str = "lcf") -> Callable[[], None]:
    """A client whose keys take Zenoh long to compare: one of many wildcards, many of two."""
    turn = iter(range(2**30))
    options = Zenoh(mode="client", connect=[endpoint], listen=[], config_file=settings)

    def wave() -> None:
        number = next(turn)
        with opened_session(options) as first, opened_session(options) as second:
            deep = first.declare_publisher("/".join("a" * LEVELS))
            many = [second.declare_publisher(f"{prefix}/**/{number}/**/{n}") for n in range(WILD)]
            one = second.declare_publisher("**/a/" * (LEVELS // 4) + str(number))
            time.sleep(WILD_S)  # the sessions reconnect when they are cut
            del deep, many, one

    return wave


def flood(endpoint: str, prefix: str = "lcf") -> Callable[[], None]:
    """A local process that queries and publishes as fast as it can."""

    def wave() -> None:
        with opened_session(Zenoh(mode="client", connect=[endpoint], listen=[])) as session:
            for _ in range(FLOOD):
                session.put(f"{prefix}/speed", os.urandom(300))
                session.get(f"{prefix}/query/config", zenoh.handlers.RingChannel(1), timeout=1.0)

    return wave


def reloads(file: Path, good: str) -> Callable[[], None]:
    """Write in turn a configuration that is malformed, invalid, too large, and good."""
    texts = ("nonsense = 1\n", "[filter]\ntr_s = -1.0\n", "a" * 3_000_000, good)
    turn = iter(range(2**30))

    def wave() -> None:
        new = file.with_suffix(".new")
        new.write_text(texts[next(turn) % len(texts)], encoding="utf-8")
        new.replace(file)

    return wave


def frames(port: int) -> Callable[[], None]:
    """A browser that sends invalid WebSocket frames, a different one each time."""
    wrong = (
        b"\x81\xff" + b"\xff" * 8 + bytes(4),
        b"\x01\x81\0\0\0\0a" * 1000,
        b"\x89\x80\0\0\0\0" * 20_000,
        os.urandom(100),
    )
    turn = iter(range(2**30))

    def wave() -> None:
        with closing(socket.create_connection(("127.0.0.1", port), CONNECT_S)) as browser:
            browser.settimeout(CONNECT_S)
            browser.sendall(UPGRADE + wrong[next(turn) % len(wrong)])
            browser.recv(4096)

    return wave


def pause(process: int, seconds: float) -> None:
    """Stop a process for a while, as a suspended machine does."""
    os.kill(process, signal.SIGSTOP)
    time.sleep(seconds)
    os.kill(process, signal.SIGCONT)


def page_is_served(port: int) -> bool:
    """Whether a browser gets the page."""
    with closing(socket.create_connection(("127.0.0.1", port), CONNECT_S)) as browser:
        browser.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n")
        return browser.recv(15).startswith(b"HTTP/1.1 200")
