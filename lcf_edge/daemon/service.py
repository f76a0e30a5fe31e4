"""The main thread: starts the others, runs periodic tasks once a second, handles signals, and shuts down in order."""

import gc
import math
import queue
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from traceback import extract_tb
from typing import TYPE_CHECKING, Any

import msgspec

from lcf_edge.config import DEFAULT_PATH, Config, is_filled, load
from lcf_edge.daemon import log
from lcf_edge.daemon.clock import StoppableClock, SystemTime
from lcf_edge.daemon.descriptors import Reserve
from lcf_edge.daemon.devices import readers
from lcf_edge.daemon.health import Health
from lcf_edge.daemon.heap import leave_start
from lcf_edge.daemon.link import Link
from lcf_edge.daemon.log import LOGGER
from lcf_edge.daemon.loop import Loop, Mail
from lcf_edge.daemon.memory import MemoryWatch, ResidentMemory, Shedding, check_budget
from lcf_edge.daemon.notify import Notifier
from lcf_edge.daemon.outputs import Outputs
from lcf_edge.daemon.peers import CHECK_S, PeersMemory
from lcf_edge.daemon.reload import changed, merged, signature, wants_pipeline, wants_restart
from lcf_edge.daemon.sinks import sinks
from lcf_edge.errors import LcfError

if TYPE_CHECKING:  # most daemons record nothing
    from lcf_edge.recording.write.destination import Destination

TICK_S = 1.0
ENDS_WITHIN_S = 0.7  # all threads together; the link has its own limit
WRITTEN_WITHIN_S = 1.9  # all, with the sinks, which write their last data while the link closes


class InternalError(LcfError):
    """A bug in the program."""


class Service:
    """One run of the daemon. ``path`` and ``settings`` are read again at a reload.

    ``config`` is one that ``check_budget`` let pass; ``notifier`` informs systemd. ``destination``: of
    recordings by ``config.record``; None: its folder. ``seconds``: end so long after the start is over; None: never.
    ``sinks``: where its scenes go.
    """

    def __init__(
        self,
        config: Config,
        link: Link,
        path: Path | None = None,
        settings: Sequence[str] = (),
        notifier: Notifier | None = None,
        tick_s: float = TICK_S,
        destination: "Destination | None" = None,
        seconds: float | None = None,
    ) -> None:
        self._config = config
        self._path, self._settings = path, settings
        self._signature = signature(path or DEFAULT_PATH)
        self._filled = is_filled(path or DEFAULT_PATH)
        self._link = link
        self._notifier = notifier or Notifier()
        self._to_do: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._clock = StoppableClock()
        self._system_time = SystemTime()
        self._mail = Mail()
        self._reserve = Reserve()
        self._resident_mib = ResidentMemory()
        self._readers = readers(config, self._mail, self._clock, self._reserve)
        self.sinks = sinks(config, link, self._system_time, destination)
        self._outputs = Outputs(self.sinks)
        self._loop = Loop(
            config,
            self._mail,
            link,
            self._outputs,
            self._clock,
            self._system_time,
            lambda: self._to_do.put(self._check_ready),
        )
        self._memory = self._watched()
        self._peers = PeersMemory(link, self._resident_mib)
        self._health = Health(self._readers, self._mail, self._loop, link, self._system_time, self._reserve)
        self._ready = False
        self._seconds = seconds
        self._ends_at_s = math.inf
        self._ending = False
        self._failure: LcfError | None = None
        self._turns = 0
        self._tick_s = tick_s
        self._tick_at_s = time.monotonic() + tick_s
        self._check_at_s = time.monotonic() + CHECK_S
        self._notes: set[str] = set()

    def run(self) -> None:
        """Run until ``stop`` or a failure. Raises ``LcfError`` when a thread failed."""
        with self._failures_noticed():
            try:
                self._outputs.start()
                for thread in (self._loop, *self._readers):
                    thread.start()
                gc.collect()
                gc.freeze()  # objects that exist now stay: later collections skip them
                while not self._ending:
                    self._do_next()
            finally:
                self._close()
        if self._failure is not None:
            raise self._failure

    def stop(self, why: str) -> None:
        """End soon; may be called from a signal handler."""
        self._to_do.put(partial(self._end, why))

    def reload(self) -> None:
        """Read the configuration again soon; may be called from a signal handler."""
        self._to_do.put(self._reload)

    @contextmanager
    def signals_minded(self) -> Iterator[None]:
        """Handle signals: SIGTERM and SIGINT end, SIGHUP reloads; in the main thread only."""
        handlers = {
            signal.SIGTERM: lambda *_: self.stop("SIGTERM"),
            signal.SIGINT: lambda *_: self.stop("SIGINT"),
            signal.SIGHUP: lambda *_: self.reload(),
        }
        before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    @contextmanager
    def _failures_noticed(self) -> Iterator[None]:
        """Within, an exception in any thread ends the daemon, with one line."""

        def notice(failed: threading.ExceptHookArgs) -> None:
            self._to_do.put(partial(self._fail, _error_of(failed)))

        before, threading.excepthook = threading.excepthook, notice
        try:
            yield
        finally:
            threading.excepthook = before

    def _do_next(self) -> None:
        next_s = min(self._tick_at_s, self._check_at_s, self._ends_at_s)
        try:
            self._to_do.get(timeout=max(next_s - time.monotonic(), 0))()
        except queue.Empty:
            if next_s == self._ends_at_s:
                self._end(f"{self._seconds:g} s have passed")
            elif next_s == self._check_at_s:
                self._check_at_s = max(self._check_at_s + CHECK_S, time.monotonic())
                self._check_peers()
            else:
                self._tick_at_s = max(self._tick_at_s + self._tick_s, time.monotonic())
                self._tick()

    def _check_peers(self) -> None:
        if self._ready:  # memory taken by the start is not charged to peers
            self._peers.check(self._memory.budget_mib)

    def _tick(self) -> None:
        self._check_peers()
        if not self._peers.blamed:
            self._memory.check()
        self._check_descriptors()
        self._check_ready()
        if self._loop.turns != self._turns:  # the watchdog is fed only while the pipeline makes progress
            self._turns = self._loop.turns
            self._notifier.alive()
        statuses = [*self._health.statuses(self._config, self._memory), *self._outputs.statuses()]
        self._outputs.put_diagnostics(time.monotonic_ns(), statuses)
        self._link.put_diagnostics(statuses, time.time_ns())
        self._notifier.status(self._health.line(self._memory))
        self._log_notes(self._loop.degradation.notes)
        now = signature(self._path or DEFAULT_PATH)
        if now != self._signature:
            self._reload()

    def _check_descriptors(self) -> None:
        was_short = self._reserve.short
        self._reserve.check()
        if self._reserve.short and not was_short:
            LOGGER.warning("link: connections use up all file descriptors but the reserved; docs/network.md: Strangers")

    def _check_ready(self) -> None:
        """Report readiness once frames flow, or once the reason why not was logged."""
        if not self._ready and (self._loop.frames or self._readers[0].error):
            self._ready = True
            leave_start()
            self._ends_at_s = math.inf if self._seconds is None else time.monotonic() + self._seconds
            self._notifier.status(self._health.line(self._memory))
            self._notifier.ready()
            LOGGER.info("ready: %s", "without a camera" if self._readers[0].error else "receiving frames")

    def _log_notes(self, notes: Sequence[str]) -> None:
        kinds = {note.partition(":")[0]: note for note in notes}
        for kind in kinds.keys() - self._notes:
            LOGGER.warning("degraded: %s", kinds[kind])
        for kind in self._notes - kinds.keys():
            LOGGER.info("no longer degraded: %s", kind)
        self._notes = set(kinds)

    def _reload(self) -> None:
        self._notifier.reloading()
        path = self._path or DEFAULT_PATH
        self._signature = signature(path)
        self._filled = self._filled or is_filled(path)
        done = False
        try:
            with self._reserve.lent():
                self._take(load(self._path, self._settings, filled=self._filled))  # an editor may just have emptied it
            done = True
        except LcfError as error:
            LOGGER.error("reload: %s; keeping the old configuration", error)
        except Exception as error:  # noqa: BLE001  # a bug must not end what runs
            LOGGER.error("reload: internal error: %r; please report it; keeping the old configuration", error)
        if not done and self._reserve.short:  # others may have taken the lent descriptors
            self._signature = None  # so it is tried again with the next tick
        if self._ready:
            self._notifier.ready()

    def _take(self, requested: Config) -> None:
        """Apply those keys of ``requested`` that can change now. Raises ``LcfError``; then nothing has changed."""
        config = merged(self._config, requested)
        keys, refused = changed(self._config, config), wants_restart(changed(self._config, requested))
        check_budget(config)
        if wants_pipeline(keys):
            self._loop.rebuild(config)
        self._config = config
        self._link.show_config(config)
        self._outputs.show_config(config)
        log.set_level(config.log.level)
        self._memory = self._watched()
        LOGGER.info("reload: changed %s", ", ".join(sorted(keys)) or "nothing")
        if refused:
            LOGGER.warning("reload: %s cannot change while running; restart to change it", ", ".join(sorted(refused)))

    def _watched(self) -> MemoryWatch:
        order = [*self._outputs.sheddings(), Shedding("half of the corners", self._shed_corners)]
        return MemoryWatch(self._config.memory.budget_mib, order, self._resident_mib)

    def _shed_corners(self) -> None:
        replace = msgspec.structs.replace
        memory, filters = self._config.memory, self._config.filter
        self._config = replace(
            self._config,
            memory=replace(memory, corners=max(memory.corners // 2, 1), edges_normal=max(memory.edges_normal // 2, 1)),
            filter=replace(filters, corners_target=max(filters.corners_target // 2, 1)),
        )
        self._loop.rebuild(self._config)

    def _end(self, why: str) -> None:
        if not self._ending:
            LOGGER.info("stopping: %s", why)
        self._ending = True

    def _fail(self, failure: LcfError) -> None:
        self._failure = self._failure or failure
        self._ending = True

    def _close(self) -> None:
        """Close devices first, then the pipeline, then the link, while the sinks write their last data."""
        self._notifier.stopping()
        self._clock.stop()
        self._loop.wake()
        begun_s = time.monotonic()
        deadline_s = begun_s + ENDS_WITHIN_S
        threads: tuple[Any, ...] = (*self._readers, self._loop)
        for thread in threads:
            if thread.ident is not None:
                thread.join(max(deadline_s - time.monotonic(), 0))
                if thread.is_alive():
                    LOGGER.warning("%s: does not end; abandoned", thread.name)
        self._outputs.close()
        self._link.close()
        self._outputs.join(begun_s + WRITTEN_WITHIN_S - time.monotonic())
        self._notifier.close()
        self._reserve.close()


def _error_of(failed: threading.ExceptHookArgs) -> LcfError:
    """Return a failure as one line."""
    if isinstance(failed.exc_value, LcfError):
        return failed.exc_value
    name = failed.thread.name if failed.thread else "a thread"
    where = [f"{Path(place.filename).name}:{place.lineno}" for place in extract_tb(failed.exc_traceback)[-1:]]
    what = f"{failed.exc_type.__name__} ({failed.exc_value}) at {', '.join(where)}"
    return InternalError(f"{name}: internal error: {what}; please report it")
