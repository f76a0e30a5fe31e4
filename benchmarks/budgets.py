"""``python -m benchmarks.budgets``: budgets of CPU and memory for each process, and its measured use.

The daemon replays a rendered drive in a loop, in place of a 30 Hz camera and a 200 Hz IMU. The other processes connect
to it one after the other, each with a client, and are measured for the given time. Shares are of one core of this
computer, with whatever else runs on it.
"""

import argparse
import asyncio
import json
import os
import pty
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import aiohttp
from msgspec.structs import replace as changed

from benchmarks.report import Table, write
from benchmarks.session import FRAMES_HZ, config_in, cpu_s, free_port, save, status_mib
from hil_mocks.siege.place import certificates, planner_settings, rover_settings
from lcf_edge.config import to_toml
from lcf_edge.errors import LcfError
from lcf_edge.rendered import scenes
from lcf_edge.zenoh_link import opened_session
from lcf_edge.zenoh_link.subscription import reading_from

WARM_UP_S = 3.0
PATIENCE_S = 30.0


@dataclass(frozen=True, slots=True)
class Budget:
    """The budget of one process: share of a core of the computer in ``results/budgets.md``, and peak memory."""

    core_share: float
    memory_mib: float
    busy_with: str


BUDGETS = {
    "run": Budget(0.15, 96, "640×480 at 30 frames a second, IMU 200 Hz, one subscriber"),
    "record": Budget(0.20, 96, "as run, and everything into a file"),
    "watch": Budget(0.05, 72, "a terminal of 24 × 100"),
    "view": Budget(0.10, 112, "a browser that asks again at once"),
    "foxglove": Budget(0.05, 80, "an app that takes every topic"),
    "gate": Budget(0.05, 96, "a planner over TLS"),
}
"""By command of ``lcf-edge``."""


@dataclass(frozen=True, slots=True)
class Use:
    """The use of one process. ``daemon_share``: of a core, by the daemon meanwhile; None: it is the daemon."""

    core_share: float
    peak_mib: float
    daemon_share: float | None


@dataclass(frozen=True, slots=True)
class Place:
    """The daemon's folder, and its ports for local clients and for the gate."""

    folder: Path
    local: str
    inner_port: int


User = Callable[[Place], AbstractContextManager[int]]
"""Starts a process and somebody who uses it, for as long as it is entered; gives the process's number."""


def measure(seconds: float, *, drive_s: float = 10.0) -> dict[str, Use]:
    """Measure every process for ``seconds``. Raises ``LcfError`` if one does not start, or openssl is missing."""
    with tempfile.TemporaryDirectory() as name:
        place = Place(Path(name), f"tcp/127.0.0.1:{free_port()}", free_port())
        drive = replace(scenes.make("two_crossing", 1, seconds=drive_s), fps=FRAMES_HZ)
        save(drive, place.folder)
        certificates(place.folder / "tls")
        config = config_in(place.folder, drive, place.local, f"tls/127.0.0.1:{place.inner_port}")
        zenoh = changed(config.zenoh, config_file=str(rover_settings(place.folder / "tls")))
        (place.folder / "config.toml").write_text(to_toml(changed(config, zenoh=zenoh)), encoding="utf-8")
        found = {}
        with _daemon(place, "run") as daemon:
            found["run"] = _use(daemon, seconds)
            for process, user in USERS.items():
                with user(place) as number:
                    found[process] = _use(number, seconds, daemon)
        with _daemon(place, "record", str(place.folder / "recording.mcap")) as daemon:
            found["record"] = _use(daemon, seconds)
    return {process: found[process] for process in BUDGETS}


def _use(process: int, seconds: float, daemon: int | None = None) -> Use:
    time.sleep(WARM_UP_S)
    processes = [process] if daemon is None else [process, daemon]
    begun_s, before_s = time.monotonic(), [cpu_s(each) for each in processes]
    time.sleep(seconds)
    lasted_s = time.monotonic() - begun_s
    shares = [(cpu_s(each) - before) / lasted_s for each, before in zip(processes, before_s, strict=True)]
    return Use(shares[0], status_mib(process, "VmHWM"), None if daemon is None else shares[-1])


@contextmanager
def _daemon(place: Place, *command: str) -> Iterator[int]:
    """The daemon, with a subscriber in this process."""
    program = (sys.executable, "-m", "benchmarks.session_daemon", str(place.folder), *command)
    with _started((*program, "-c", str(place.folder / "config.toml"))) as daemon, _subscribed(place.local):
        yield daemon.pid


@contextmanager
def _subscribed(endpoint: str, settings: str = "") -> Iterator[None]:
    came = threading.Event()
    with opened_session(reading_from(endpoint, settings)) as session:
        subscriber = session.declare_subscriber("lcf/scene", lambda _: came.set())
        if not came.wait(PATIENCE_S):
            raise LcfError(f"budgets: no scene comes from {endpoint} within {PATIENCE_S:g} s")
        yield
        subscriber.undeclare()  # type: ignore[no-untyped-call]


@contextmanager
def _started(command: Sequence[str], terminal: int | None = None) -> Iterator["subprocess.Popen[bytes]"]:
    with ExitStack() as stack:
        out = subprocess.PIPE if terminal is None else terminal
        err = stack.enter_context(tempfile.TemporaryFile()) if terminal is None else terminal
        environment = {**os.environ, "TERM": "xterm-256color", "LINES": "24", "COLUMNS": "100"}
        process = subprocess.Popen(
            command, stdin=terminal or subprocess.DEVNULL, stdout=out, stderr=err, env=environment
        )
        try:
            yield process
            if process.poll() is not None:
                raise LcfError(f"budgets: {' '.join(command)} ended with status {process.returncode}")
        finally:
            process.terminate()
            process.communicate()


@contextmanager
def _watch(place: Place) -> Iterator[int]:
    ours, theirs = pty.openpty()
    with _started((*_LCF_EDGE, "watch", "--connect", place.local), theirs) as process:
        os.close(theirs)
        threading.Thread(target=_read_away, args=(ours,), daemon=True).start()
        yield process.pid


def _read_away(descriptor: int) -> None:
    """Read and discard until the other end is closed."""
    with open(descriptor, "rb", buffering=0) as terminal:  # of a descriptor
        try:
            while terminal.read(2**16):
                pass
        except OSError:  # how a terminal reports its end
            return


@contextmanager
def _view(place: Place) -> Iterator[int]:
    async def look(address: str, seen: threading.Event) -> None:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(f"{address.rstrip('/')}/updates", max_msg_size=0) as socket,
        ):
            await socket.send_str("next")
            async for message in socket:
                seen.set()
                if message.type == aiohttp.WSMsgType.BINARY or "picture" not in json.loads(message.data):
                    await socket.send_str("next")

    with _served(place, "view", "http://", look) as number:
        yield number


@contextmanager
def _foxglove(place: Place) -> Iterator[int]:
    async def look(address: str, seen: threading.Event) -> None:
        async with (
            aiohttp.ClientSession() as session,
            session.ws_connect(address, protocols=["foxglove.sdk.v1"], max_msg_size=0) as socket,
        ):
            async for message in socket:
                if message.type == aiohttp.WSMsgType.BINARY:
                    seen.set()
                    continue
                received = json.loads(message.data)
                if received["op"] == "advertise":
                    wanted = [{"id": each["id"], "channelId": each["id"]} for each in received["channels"]]
                    await socket.send_str(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    with _served(place, "foxglove", "ws://", look) as number:
        yield number


@contextmanager
def _served(
    place: Place, command: str, scheme: str, look: Callable[[str, threading.Event], Coroutine[Any, Any, None]]
) -> Iterator[int]:
    """A command that serves, with a client in a thread of this process."""
    with _started((*_LCF_EDGE, command, "--connect", place.local, "--port", "0")) as process:
        assert process.stdout
        address = next(word for word in process.stdout.readline().decode().split() if word.startswith(scheme))
        seen = threading.Event()
        loop = asyncio.new_event_loop()
        task = loop.create_task(look(address, seen))
        thread = threading.Thread(target=_until_cancelled, args=(loop, task))
        thread.start()
        try:
            if not seen.wait(PATIENCE_S):
                raise LcfError(f"budgets: {command} shows nothing within {PATIENCE_S:g} s")
            yield process.pid
        finally:
            loop.call_soon_threadsafe(task.cancel)
            thread.join()


def _until_cancelled(loop: asyncio.AbstractEventLoop, task: "asyncio.Task[None]") -> None:
    try:
        loop.run_until_complete(task)
    except (asyncio.CancelledError, OSError, aiohttp.ClientError):  # whoever waits for it reports it
        pass
    finally:
        loop.close()


@contextmanager
def _gate(place: Place) -> Iterator[int]:
    port, tls = free_port(), place.folder / "tls"
    options = ("--tls", str(tls), "--listen", "127.0.0.1", "--port", str(port), "--to", str(place.inner_port))
    with (
        _started((*_LCF_EDGE, "gate", *options)) as process,
        _subscribed(f"tls/localhost:{port}", str(planner_settings(tls))),
    ):
        yield process.pid


_LCF_EDGE = (sys.executable, "-m", "lcf_edge")
USERS: dict[str, User] = {"watch": _watch, "view": _view, "foxglove": _foxglove, "gate": _gate}


def tables(found: dict[str, Use]) -> list[Table]:
    """One table: budget and use of each process."""
    rows = [
        [
            f"{process}: {budget.busy_with}",
            f"{budget.core_share:.0%}",
            _share(found[process].core_share),
            f"{budget.memory_mib:g}",
            f"{found[process].peak_mib:.1f}",
            _share(found[process].daemon_share),
        ]
        for process, budget in BUDGETS.items()
    ]
    columns = ["process", "of a core: budget", "used", "peak MiB: budget", "used", "the daemon meanwhile"]
    return [Table("Budgets", columns, rows)]


def _share(share: float | None) -> str:
    return "-" if share is None else f"{share:.1%}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, write. Exit status 1: a process takes more memory than its budget."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.budgets", description=__doc__, allow_abbrev=False)
    parser.add_argument("--seconds", type=float, default=20.0, metavar="N", help="for each process (%(default)g)")
    options = parser.parse_args(arguments)
    try:
        found = measure(options.seconds)
    except LcfError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_status
    sys.stdout.write(write("budgets", "What each process takes", tables(found), {"budgets": BUDGETS, "used": found}))
    beyond = [process for process, budget in BUDGETS.items() if found[process].peak_mib > budget.memory_mib]
    for process in beyond:
        sys.stderr.write(f"budgets: {process} took {found[process].peak_mib:.1f} MiB at its peak\n")
    return 1 if beyond else 0


if __name__ == "__main__":
    sys.exit(main())
