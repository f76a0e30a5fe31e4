"""All sinks of a running daemon as one."""

import time
from collections.abc import Callable, Sequence

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.daemon.log import LOGGER
from lcf_edge.daemon.memory import Shedding
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import PipelineScene, View
from lcf_edge.sinks import SinkError
from lcf_edge.sinks.sink import Sink


class Outputs:
    """Passes everything on to each sink. One that fails is left out from then on; the diagnostics say why."""

    def __init__(self, sinks: Sequence[Sink]) -> None:
        self._sinks = tuple(sinks)
        self._working = self._sinks
        self._errors: dict[str, SinkError] = {}

    def start(self) -> None:
        """Start the threads of the sinks."""
        for sink in self._sinks:
            sink.start()

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> int:
        """Pass a frame and its scene to each sink. Return when the first had received it, monotonic ns."""
        first_ns: int | None = None
        for sink in self._working:
            try:
                sink.put(frame, scene, view)
            except SinkError as error:
                self._leave_out(sink, error)
            if first_ns is None:
                first_ns = time.monotonic_ns()
        return first_ns or time.monotonic_ns()

    def put_sample(self, sample: ImuSample | SpeedSample) -> None:
        """Pass a sample to each sink."""
        for sink in self._working:
            sink.put_sample(sample)

    def put_diagnostics(self, stamp_ns: int, statuses: Sequence[DeviceStatus]) -> None:
        """Pass the status of each part of the daemon to each sink, as of ``stamp_ns`` of the monotonic clock."""
        for sink in self._working:
            sink.put_diagnostics(stamp_ns, statuses)

    def show_config(self, config: Config) -> None:
        """Pass the configuration to each after a reload."""
        for sink in self._working:
            sink.show_config(config)

    def statuses(self) -> list[DeviceStatus]:
        """Return the statuses of the sinks that have one."""
        working = [sink.status() for sink in self._working]
        failed = [DeviceStatus(name, Level.ERROR, str(error)) for name, error in self._errors.items()]
        return [*(status for status in working if status is not None), *failed]

    def sheddings(self) -> list[Shedding]:
        """Return, in order, what the sinks can release when memory is short."""
        return [Shedding(sink.sheds, sink.shed) for sink in self._sinks if sink.sheds]

    def close(self) -> None:
        """Close all sinks. Returns soon; ``join`` waits for the rest."""
        for sink in self._sinks:
            try:
                sink.close()
            except SinkError as error:
                if sink.name not in self._errors:
                    self._leave_out(sink, error)

    def join(self, timeout_s: float) -> None:
        """Wait until all have ended; those that do not in time are abandoned, and named in the log."""
        deadline_s = time.monotonic() + timeout_s
        for sink in self._sinks:
            if not sink.join(max(deadline_s - time.monotonic(), 0)):
                LOGGER.warning("%s: does not end in time; abandoned", sink.name)

    def _leave_out(self, sink: Sink, error: SinkError) -> None:
        LOGGER.error("%s: %s; continuing without it", sink.name, error)
        self._errors[sink.name] = error
        self._working = tuple(other for other in self._working if other is not sink)
