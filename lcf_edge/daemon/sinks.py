"""The sinks that a daemon has.

A new one is a file with a ``Sink`` and a line here; the methods of the class say what it does in diagnostics, at
reloads, when memory is short and at the end.
"""

from typing import TYPE_CHECKING

from lcf_edge.config import Config
from lcf_edge.daemon.clock import SystemTime
from lcf_edge.daemon.lenses import known_lens
from lcf_edge.daemon.link import Link
from lcf_edge.daemon.preview import Previewer
from lcf_edge.daemon.scenes import LinkedScenes
from lcf_edge.sinks.sink import Sink

if TYPE_CHECKING:  # most daemons record nothing
    from lcf_edge.recording.write.destination import Destination


def sinks(config: Config, link: Link, system_time: SystemTime, destination: "Destination | None" = None) -> list[Sink]:
    """Return the daemon's sinks by ``config``, not started, in the order in which each frame reaches them.

    Memory is given up in the same order. ``destination``: of recordings; None: ``record.folder``.
    """
    outputs: list[Sink] = [LinkedScenes(link), Previewer(link)]
    if config.record.when != "never":
        from lcf_edge.daemon.recorder import Recorder  # noqa: PLC0415  # its formats take megabytes
        from lcf_edge.recording.write.destination import Folder  # noqa: PLC0415

        outputs.append(Recorder(config, destination or Folder(config.record), system_time, known_lens))
    if config.metrics.textfile or config.metrics.port:
        from lcf_edge.metrics.sink import MetricsSink  # noqa: PLC0415  # a server takes megabytes

        outputs.append(MetricsSink(config))
    return outputs
