"""The interface of every sink: it takes frame after frame, each with its scene."""
# ruff: noqa: B027  # what a sink does not override does nothing

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import ClassVar, Self

from drivers.samples import Frame, ImuSample, SpeedSample
from lcf_edge.config import Config
from lcf_edge.diagnostics import DeviceStatus
from lcf_edge.messages import PipelineScene, View


class Sink(ABC):
    """An output for scenes: a file, the network, a screen. The same in ``replay`` and in the daemon.

    A sink needs a ``name`` (for messages to the user), ``put`` and ``close``. All other methods concern the daemon,
    and do nothing unless a sink overrides them. ``put`` and ``put_sample`` are called in the pipeline's thread, the
    others in the main thread.
    """

    name: ClassVar[str]
    sheds: ClassVar[str] = ""
    """What ``shed`` gives up, in words: "the preview"; empty: it has no memory to give."""

    @abstractmethod
    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:
        """Take a frame and its scene, without changing them. In the daemon, never wait.

        ``view`` makes what an overlay shows of the frame; it takes about a millisecond, and may be called only before
        ``put`` returns. In the daemon, ``scene`` is stamped by the system clock and ``frame`` by the monotonic one.
        Raises ``SinkError``; the daemon goes on without the sink and says why in its diagnostics.
        """

    @abstractmethod
    def close(self) -> None:
        """Finish the output; nothing more comes. In the daemon, return within half a second. Raises ``SinkError``."""

    def __enter__(self) -> Self:
        """Close it at the end of the block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def start(self) -> None:
        """Start threads, if any."""

    def put_sample(self, sample: ImuSample | SpeedSample) -> None:
        """Take a sample that the pipeline got.

        In the daemon it is stamped by the monotonic clock; never wait, never raise. Raises ``SinkError``, ``CdrError``
        in a replay.
        """

    def put_diagnostics(self, stamp_ns: int, statuses: Sequence[DeviceStatus]) -> None:
        """Take the status of each part of the daemon, once a second, as of ``stamp_ns`` of the monotonic clock."""

    def show_config(self, config: Config) -> None:
        """Take the configuration after a reload. What ``shed`` gave up may be used again."""

    def shed(self) -> None:
        """Give up memory, because the budget is nearly used up."""

    def status(self) -> DeviceStatus | None:
        """Return its status for the diagnostics; None: nothing to report."""
        return None

    def join(self, timeout_s: float) -> bool:  # noqa: ARG002
        """Wait, after ``close``, until its threads have ended; False: they did not in time."""
        return True
