"""``lcf-edge record``: the daemon, recording into a file."""

from collections.abc import Sequence
from pathlib import Path

from lcf_edge.commands.run import run
from lcf_edge.errors import LcfError, UsageError
from lcf_edge.recorder.destination import Named
from lcf_edge.sinks import check_output


def record(file: Path, seconds: float | None, path: Path | None, settings: Sequence[str]) -> str:
    """Record until a signal ends it, or for so long from the first picture on; answers with the summary.

    Raises ``UsageError`` for a file that is there already or is none, ``SinkError`` for one that cannot be written,
    ``LcfError`` when not one picture was recorded, and what ``run`` raises.
    """
    if file.exists():
        raise UsageError(f"{file}: is there already; name another file, or remove it")
    check_output(file, (".mcap",))
    recorder = run(path, (*settings, "record.when=always"), Named(file), seconds)
    assert recorder is not None
    summary = f"{file}: {recorder.summary()}"
    if not recorder.pictures:
        raise LcfError(f"{summary}; see above what the camera or the disk lacks")
    return summary
