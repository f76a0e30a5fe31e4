"""Keeps the metrics up to date: a file that is replaced atomically, a text that is served."""

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from drivers.samples import Frame
from lcf_edge.config import Config
from lcf_edge.diagnostics import DeviceStatus, Level
from lcf_edge.messages import PipelineScene, View
from lcf_edge.metrics.endpoint import Endpoint
from lcf_edge.metrics.text import prometheus_text
from lcf_edge.sinks.sink import Sink


class MetricsSink(Sink):
    """Writes the diagnostics once a second, by ``config.metrics``."""

    name = "metrics"

    def __init__(self, config: Config) -> None:
        self._robot = config.publish.robot
        self._file = Path(config.metrics.textfile) if config.metrics.textfile else None
        self._port = config.metrics.port
        self._endpoint: Endpoint | None = None
        self._trouble = ""

    def start(self) -> None:
        """Begin to serve. Raises ``LcfError`` for a port that is in use."""
        if self._port:
            self._endpoint = Endpoint(self._port)
            self._endpoint.start()

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:
        """Do nothing: single frames are no metric."""

    def put_diagnostics(self, stamp_ns: int, statuses: Sequence[DeviceStatus]) -> None:  # noqa: ARG002
        """Take the status of each part. A file that cannot be written is reported by ``status``."""
        text = prometheus_text(statuses, self._robot)
        if self._endpoint is not None:
            self._endpoint.text = text
        if self._file is not None:
            try:
                _replace(self._file, text)
                self._trouble = ""
            except OSError as error:
                self._trouble = f"{self._file}: cannot be written ({error.strerror}); check metrics.textfile"

    def status(self) -> DeviceStatus:
        """How it is, for the diagnostics."""
        return DeviceStatus(self.name, Level.WARN if self._trouble else Level.OK, self._trouble or "written")

    def close(self) -> None:
        """Stop serving; remove the file, or its last figures would be taken for current ones."""
        if self._endpoint is not None:
            self._endpoint.close()
        if self._file is not None:
            with suppress(OSError):
                self._file.unlink()


def _replace(path: Path, text: bytes) -> None:
    """Readers find the old text or the new one, never a part. Raises ``OSError``."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_bytes(text)
        beside.chmod(0o644)  # node_exporter runs as another user
        beside.replace(path)
    except OSError:
        with suppress(OSError):
            beside.unlink()
        raise
