"""``lcf-edge record``: the daemon, recording into a file, or into a folder as a bag of rosbag2."""

from collections.abc import Sequence
from pathlib import Path

from lcf_edge.cli.run import run
from lcf_edge.daemon.log import LOGGER
from lcf_edge.daemon.recorder import Recorder
from lcf_edge.errors import LcfError, RecordingError
from lcf_edge.recording.write.destination import Bag, Named
from lcf_edge.sinks import cannot_write, check_output, refuse_existing


def record(file: Path, seconds: float | None, path: Path | None, settings: Sequence[str]) -> str:
    """Record until a signal ends it, or for a time from the first image on. Return the summary.

    ``file``: a name that ends in ``.mcap`` is a file's, one without an ending a folder's. Raises ``UsageError`` for a
    name that exists or cannot be used, ``SinkError`` for one that cannot be written, ``LcfError`` when no image was
    recorded, and what ``run`` raises.
    """
    refuse_existing(file)
    is_bag = not file.suffix
    if is_bag:
        _make(file)
    else:
        check_output(file, (".mcap",))
    try:
        sinks = run(path, (*settings, "record.when=always"), Bag(file) if is_bag else Named(file), seconds)
    finally:
        if is_bag:
            _finish(file)
    (recorder,) = (sink for sink in sinks if isinstance(sink, Recorder))
    summary = f"{file}: {recorder.summary()}"
    if not recorder.frames:
        raise LcfError(f"{summary}; the messages above say why")
    return summary


def _make(folder: Path) -> None:
    try:
        folder.mkdir()
    except OSError as error:
        raise cannot_write(folder, error) from error


def _finish(folder: Path) -> None:
    """Write the folder's metadata; remove the folder when it is empty."""
    from lcf_edge.recording.write.bag import write_metadata  # noqa: PLC0415  # what reads takes memory while it records

    try:
        if any(folder.iterdir()):
            write_metadata(folder)
        else:
            folder.rmdir()
    except (RecordingError, OSError) as error:
        LOGGER.warning("recorder: %s: no metadata.yaml: %s", folder, error)
