"""A sink of one's own: a CSV file with the most urgent object of each frame, from a replay.

    python examples/custom_sink.py demo-out/recording demo-out/config.toml urgent.csv

In the daemon the same class needs one line in ``lcf_edge/daemon/sinks.py``.
"""

import sys
from collections.abc import Callable
from pathlib import Path

from drivers.samples import Frame
from lcf_edge.config import load
from lcf_edge.messages import PipelineScene, View
from lcf_edge.pipeline import run
from lcf_edge.recording.read import open_recording
from lcf_edge.sinks import cannot_write
from lcf_edge.sinks.sink import Sink


class UrgentSink(Sink):
    """Appends a row ``seq,id,ttc_s`` for each frame with objects. Raises ``SinkError``."""

    name = "urgent"

    def __init__(self, path: Path) -> None:
        self._path = path
        self._write("w", "seq,id,ttc_s\n")

    def put(self, frame: Frame, scene: PipelineScene, view: Callable[[], View]) -> None:  # noqa: ARG002
        """Append one row."""
        if len(scene.objects):
            thing = scene.objects[scene.objects["ttc"].argmin()]
            self._write("a", f"{scene.seq},{thing['id']},{thing['ttc']:.2f}\n")

    def close(self) -> None:
        """Do nothing: each row is written at once."""

    def _write(self, mode: str, text: str) -> None:
        try:
            with self._path.open(mode, encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            raise cannot_write(self._path, error) from error


def main(recording: str, config_file: str, output: str) -> None:
    """Replay a recording into the file."""
    config = load(Path(config_file))
    with UrgentSink(Path(output)) as sink:
        for frame, outcome in run(open_recording(Path(recording), config), config):
            sink.put(frame, outcome.scene, outcome.view)


if __name__ == "__main__":
    main(*sys.argv[1:])
