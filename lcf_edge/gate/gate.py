"""Lets parties through to the daemon. Whatever strangers do takes no more than ``MAX_STRANGERS`` descriptors.

A connection is a stranger's until its TLS handshake has shown a certificate, or the daemon has opened a session for it.
The oldest stranger gives way to the newest: an honest handshake is over in a few round trips, long before so many
others have come. Who has begun to open a session gives way only to others who have. What a party says is
read on its way: one whose keys are beyond the limits of ``key_limits`` is cut before the daemon hears of them.
"""

import asyncio
import gc
import logging
import signal
import socket
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

from lcf_edge.daemon.log import LOGGER
from lcf_edge.gate.entrances import MAX_PARTIES, PIECE_BYTES, DaemonAwayError, Entrance, Party, Stream
from lcf_edge.gate.key_limits import KeyLimits, NameKeys, RefusedKeyError
from lcf_edge.gate.pace import Pace
from lcf_edge.gate.zenoh_batches import GREETINGS, LENGTH_BYTES, NotUnderstoodError
from lcf_edge.tallies import Tallies

MAX_STRANGERS = 64
MAX_GREETERS = 48  # strangers who have said something that strangers say
SILENCE_S = 15.0  # Zenoh is silent for 2.5 s at most
PAUSE_S = 0.1  # when the system refuses a connection
PENALTY_S = 1.0
REPORT_EACH_S = 10.0
COLLECT_EACH = 32  # connections: asyncio leaves each in a reference cycle with 256 KiB of buffer
BACKLOG = 1024  # who does not fit would come again after a second
LET_IN = "let in "


async def serve(listening: Sequence[socket.socket], gate: "Gate", ends: int | None = None) -> None:
    """Until SIGINT or SIGTERM, or the other side of the pipe ``ends`` is closed."""
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda *_: None)  # of connections: counted where they end
    gc.collect()
    gc.freeze()  # objects that exist now stay: collections are short
    tasks = [loop.create_task(work) for work in (*map(gate.accept, listening), gate.report())]

    def end() -> None:
        for task in tasks:
            task.cancel()

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, end)
    if ends is not None:
        loop.add_reader(ends, end)
    with suppress(asyncio.CancelledError):
        await asyncio.gather(*tasks)
    gate.report_now()


class Gate:
    """``counts``: ``let in``, and of those who were not: ``no certificate``, ``gave way``, ``unknown NAME``, …

    ``own_keys``: keys that everybody may use. ``tallies``: where the daemon sees how many were refused.
    """

    def __init__(self, entrance: Entrance, own_keys: Collection[bytes] = (), tallies: Tallies | None = None) -> None:
        self.counts: Counter[str] = Counter()
        self._reported: Counter[str] = Counter()
        self._entrance = entrance
        self._tallies = tallies
        self._strangers: dict[asyncio.Task[None], None] = {}  # oldest first
        self._greeters: dict[asyncio.Task[None], None] = {}
        self._parties: dict[asyncio.Task[None], str] = {}
        self._keys: defaultdict[str, NameKeys] = defaultdict(partial(NameKeys, own_keys))
        self._cut_parties = 0  # that do not know it yet
        self._gone = 0

    async def accept(self, listening: socket.socket) -> None:
        """Until cancelled."""
        loop = asyncio.get_running_loop()
        listening.setblocking(False)
        while True:
            try:
                connection, _ = await loop.sock_accept(listening)
            except OSError:
                self._refuse("no descriptor")
                await asyncio.sleep(PAUSE_S)
                continue
            self._begin(connection)
            await asyncio.sleep(0)  # lets handshakes go on, however many connections come

    def _begin(self, connection: socket.socket) -> None:
        """Let a stranger in place of the oldest."""
        self._make_room(self._strangers, MAX_STRANGERS)
        task = asyncio.get_running_loop().create_task(self._meet(connection))
        self._strangers[task] = None
        task.add_done_callback(self._forget)

    def _make_room(self, among: dict[asyncio.Task[None], None], most: int) -> None:
        while len(among) >= most:
            oldest = next(iter(among))
            del among[oldest]
            oldest.cancel()
            self._refuse("gave way")

    def _greeted(self) -> None:
        """Give the current task's stranger one of the places of those who have said something."""
        task = asyncio.current_task()
        assert task is not None
        if task in self._strangers:
            del self._strangers[task]
            self._make_room(self._greeters, MAX_GREETERS)
            self._greeters[task] = None

    async def report(self) -> None:
        """Now and then, until cancelled."""
        while True:
            await asyncio.sleep(REPORT_EACH_S)
            self.report_now()

    def report_now(self) -> None:
        """Report what has happened since the last report."""
        news = self.counts - self._reported
        self._reported = self.counts.copy()
        if news:
            level = logging.INFO if all(what.startswith(LET_IN) for what in news) else logging.WARNING
            LOGGER.log(level, "gate: %s", ", ".join(f"{what} {number}" for what, number in sorted(news.items())))

    def _refuse(self, why: str) -> None:
        self.counts[why] += 1
        if self._tallies is not None:
            self._tallies.refuse()

    def _forget(self, task: asyncio.Task[None]) -> None:
        self._strangers.pop(task, None)
        self._greeters.pop(task, None)
        self._parties.pop(task, None)
        if not task.cancelled() and task.exception() is not None:
            self._refuse("failed")
        self._gone += 1
        if self._gone % COLLECT_EACH == 0:
            gc.collect()

    async def _meet(self, connection: socket.socket) -> None:
        """From the first byte to the last."""
        task = asyncio.current_task()
        assert task is not None
        try:
            party = await self._met(connection)
        except DaemonAwayError:
            self._refuse("daemon away")
            return
        except (OSError, asyncio.IncompleteReadError):
            self._refuse(self._entrance.stranger)
            return
        finally:
            self._strangers.pop(task, None)
            self._greeters.pop(task, None)
        try:
            refusal = self._refusal(party.name)
            if refusal:
                self._refuse(refusal)
                return
            self._parties[task] = party.name
            await self._through(party)
        finally:
            party.leave()

    async def _met(self, connection: socket.socket) -> Party:
        try:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return await self._entrance.meet(connection, self._greeted)
        except BaseException:
            connection.close()
            raise

    def _refusal(self, name: str) -> str:
        """Return why a party is not let in; empty: it is."""
        if not self._entrance.knows(name):
            return "of no known name"
        names = list(self._parties.values())
        if len(names) >= MAX_PARTIES or names.count(name) >= self._entrance.max_of_one_name:
            return f"too many of {name}"
        return ""

    async def _through(self, party: Party) -> None:
        name, outer = party.name, party.stream
        try:
            inner = await self._entrance.dial(party)
        except OSError:  # also a timeout
            self._refuse("daemon away")
            return
        self.counts[f"{LET_IN}{name}"] += 1
        limits = KeyLimits(self._keys[name])
        brought = party.place.add if party.place is not None else int
        pumps = [
            asyncio.create_task(_pump_in(outer[0], inner[1], limits, GREETINGS - party.greeted, brought)),
            asyncio.create_task(_pump(inner[0], outer[1])),
        ]
        try:
            await asyncio.wait(pumps, return_when=asyncio.FIRST_COMPLETED)
            if pumps[0].done():
                pumps[0].result()
        except RefusedKeyError as refused:
            await self._cut(inner, f"{refused} of {name}")
        except NotUnderstoodError:
            await self._cut(inner, f"not understood {name}")
        finally:
            for pump in pumps:
                pump.cancel()
            inner[1].transport.abort()

    async def _cut(self, inner: Stream, why: str) -> None:
        """Away from the daemon, and from its place, at once; let it know a little later: it comes again at once."""
        self._refuse(why)
        inner[1].transport.abort()
        task = asyncio.current_task()
        assert task is not None
        self._parties.pop(task, None)
        if self._cut_parties < MAX_PARTIES:
            self._cut_parties += 1
            try:
                await asyncio.sleep(PENALTY_S)
            finally:
                self._cut_parties -= 1


async def _pump_in(
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    limits: KeyLimits,
    greetings: int,
    brought: Callable[[int], object],
) -> None:
    """Like ``_pump``, batch by batch. Raises ``RefusedKeyError``, ``NotUnderstoodError``."""
    pace = Pace(asyncio.get_running_loop().time)
    with suppress(OSError, asyncio.IncompleteReadError):
        while True:
            async with asyncio.timeout(SILENCE_S):
                length = await reader.readexactly(LENGTH_BYTES)
                batch = await reader.readexactly(int.from_bytes(length, "little"))
                messages = 0
                if greetings:
                    greetings -= 1
                else:
                    messages = limits.check(batch)
                brought(len(batch))
                writer.write(length + batch)
                await writer.drain()
            wait_s = pace.wait_s(1 + messages)
            if wait_s:
                await asyncio.sleep(wait_s)


async def _pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Until one side ends, is silent, or takes nothing any more."""
    with suppress(OSError):
        while True:
            async with asyncio.timeout(SILENCE_S):
                piece: Any = await reader.read(PIECE_BYTES)
                if not piece:
                    return
                writer.write(piece)
                await writer.drain()
